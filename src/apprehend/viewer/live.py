"""A page in the browser (viser) with the robot, bodies and marks of a `Stage`; everything else is built on it."""

from __future__ import annotations

import io
import logging
import socket
import threading
import webbrowser
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from typing import Any, Self, TypedDict, Unpack

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from .looks import RGBA
from .picture import Camera, smooth_normals
from .stage import Stage

HOST = "127.0.0.1"
"""The page is served to this machine only, unless another host is asked for."""

Announce = Callable[[str], object]


class Serving(TypedDict, total=False):
    """How a page is served: the options that all functions share that show something."""

    port: int
    """Where, or the next free one; 8080."""
    host: str
    """Who can see it: this machine (`HOST`)."""
    open_browser: bool
    """Whether the default browser opens it; True."""
    block: bool
    """Whether the call returns only when the page is stopped or interrupted; True."""
    announce: Announce | None
    """Called with a line that says where the page is."""


def serve(title: str, build: Callable[[Page], object], **serving: Unpack[Serving]) -> Page:
    """Serve a page with what *build* puts on it; a page that cannot be built is stopped."""
    unknown = set(serving) - set(Serving.__annotations__)
    if unknown:
        raise TypeError(f"pages have no option {sorted(unknown)[0]!r}; there are {', '.join(Serving.__annotations__)}")
    page = Page(title, port=serving.get("port", 8080), host=serving.get("host", HOST))
    try:
        build(page)
    except BaseException:
        page.stop()
        raise
    return page.serve(
        open_browser=serving.get("open_browser", True),
        block=serving.get("block", True),
        announce=serving.get("announce"),
    )


class Page:
    """A running page. `draw` moves what is on it; `stop` ends it; ``with`` ends it too."""

    def __init__(self, title: str, *, port: int = 8080, host: str = HOST) -> None:
        import viser

        if not 0 < port < 65536:
            raise InputError(f"port is {port}; expected 1 to 65535")
        self.title = title
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)  # browsers open sockets and drop them
        with redirect_stdout(io.StringIO()):  # the server prints a banner; `serve` announces instead
            self.server = viser.ViserServer(host=host, port=_free_port(host, port), label=title, verbose=False)
        self.server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        self.server.gui.main_panel.dock_right()
        self.server.gui.set_panel_label(title)
        scene = self.server.scene
        scene.set_up_direction("+z")
        scene.configure_environment_map(None)  # the stock ones are fetched from the network
        scene.configure_default_lights(cast_shadow=True)
        scene.add_light_hemisphere("/light", sky_color=(255, 255, 255), ground_color=(205, 200, 195), intensity=1.1)
        self._lock = threading.Lock()
        self._links: dict[str, Any] = {}
        self._bodies: dict[str, Any] = {}
        self.handles: dict[str, Any] = {}
        """The meshes on the page by their names."""
        self._stopped = threading.Event()
        self._worker: threading.Thread | None = None

    @property
    def link_names(self) -> tuple[str, ...]:
        """The links of the robot that are seen."""
        return tuple(self._links)

    @property
    def url(self) -> str:
        """Where the page is."""
        host = self.server.get_host()
        return f"http://{'localhost' if host in ('127.0.0.1', '0.0.0.0') else host}:{self.server.get_port()}"

    # --- what is on it ---------------------------------------------------------------------------------------------
    def add(self, stage: Stage) -> None:
        """Put everything of *stage* on the page, where it rests."""
        scene = self.server.scene
        if stage.robot is not None:
            for link, parts in stage.links.items():
                if not parts:
                    continue
                self._links[link] = scene.add_frame(f"/robot/{link}", show_axes=False)
                for i, part in enumerate(parts):
                    self.mesh(f"/robot/{link}/{i}", part.vertices, part.faces, part.rgba)
            names = stage.robot.frame_names
            poses = stage.robot.fk(stage.robot.home)
            self.draw(links=dict(zip(names, poses)))
        for thing in (*stage.bodies, *stage.boxes, *stage.ghosts):
            group = "bodies" if thing in stage.bodies else "goals" if thing in stage.ghosts else "surroundings"
            handle = scene.add_frame(f"/{group}/{thing.name}", show_axes=False)
            if group == "bodies":
                self._bodies[thing.name] = handle
            self._place(handle, thing.pose)
            self.mesh(f"/{group}/{thing.name}/mesh", thing.vertices, thing.faces, thing.rgba)

    def mesh(self, name: str, vertices: Array, faces: IntArray, rgba: RGBA) -> Any:
        """A mesh of one colour below the node whose name *name* extends."""
        vertices, faces = creased(vertices, faces)
        colour = tuple(round(255 * c) for c in rgba[:3])
        self.handles[name] = self.server.scene.add_mesh_simple(
            name,
            np.asarray(vertices, dtype=np.float32),
            np.asarray(faces, dtype=np.uint32),
            color=(colour[0], colour[1], colour[2]),
            opacity=None if rgba[3] >= 1.0 else rgba[3],
            cast_shadow=rgba[3] >= 1.0,
        )
        return self.handles[name]

    def grid(self, size: float) -> None:
        """A ground with a grid of 5 cm or 50 cm, depending on the *size* of what stands on it."""
        cell = 0.05 if size < 1.0 else 0.5
        self.server.scene.add_grid(
            "/ground", width=20 * cell, height=20 * cell, cell_size=cell, section_size=10 * cell, plane_opacity=0.5,
            shadow_opacity=0.25,
        )  # fmt: skip

    def look(self, camera: Camera) -> None:
        """Where a visitor starts to look from."""
        start = self.server.initial_camera
        start.position, start.look_at = tuple(camera.eye), tuple(camera.target)
        start.up, start.fov = (0.0, 0.0, 1.0), camera.field_of_view

    def draw(self, links: Mapping[str, Array] | None = None, bodies: Mapping[str, Array] | None = None) -> None:
        """Move links and bodies to poses ``(4, 4)`` in the world, all in one message."""
        with self._lock, self.server.atomic():
            for handles, poses in ((self._links, links), (self._bodies, bodies)):
                for name, T in (poses or {}).items():
                    if name in handles:
                        self._place(handles[name], T)

    @staticmethod
    def _place(handle: Any, T: Array) -> None:
        from scipy.spatial.transform import Rotation

        handle.wxyz = Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)
        handle.position = T[:3, 3]

    # --- life ------------------------------------------------------------------------------------------------------
    def serve(self, *, open_browser: bool, block: bool, announce: Announce | None) -> Self:
        """Tell where the page is, open it, and wait until it is stopped or interrupted if *block*."""
        if announce is not None:
            announce(f"{self.title}: {self.url}" + (" (Ctrl-C ends it)" if block else ""))
        if open_browser:
            webbrowser.open(self.url)
        if block:
            try:
                self._stopped.wait()
            except KeyboardInterrupt:
                pass
            finally:
                self.stop()
        return self

    def every(self, seconds: float, work: Callable[[], object]) -> None:
        """Call *work* again and again, about every so many *seconds*, until the page ends."""

        def run() -> None:
            while not self._stopped.wait(seconds):
                work()

        self._worker = threading.Thread(target=run, name="apprehend-page", daemon=True)
        self._worker.start()

    @property
    def stopped(self) -> bool:
        """Whether `stop` was called."""
        return self._stopped.is_set()

    def stop(self) -> None:
        """End the page."""
        if not self._stopped.is_set():
            self._stopped.set()
            if self._worker is not None and self._worker is not threading.current_thread():
                self._worker.join()
            with redirect_stdout(io.StringIO()):
                self.server.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def creased(vertices: Array, faces: IntArray) -> tuple[Array, IntArray]:
    """The same surface with vertices split at sharp edges, and joined where it is smooth.

    A browser averages the normals of the faces at a vertex: this way it gets those of `smooth_normals`.
    """
    keys = np.concatenate(
        [vertices[faces].reshape(-1, 3), np.round(smooth_normals(vertices, faces).reshape(-1, 3), 3)], axis=1
    )
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return keys[first, :3], inverse.reshape(-1, 3).astype(np.int64)


def _free_port(host: str, port: int) -> int:
    """*port*, or the next one that nobody listens on."""
    for candidate in range(port, min(port + 50, 65536)):
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, candidate))
            except OSError:
                continue
            return candidate
    raise InputError(f"ports {port} to {port + 49} are all taken on {host}; give another --port")
