"""A planned path: a page with a slider along it, and a picture of its postures."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped
from ..errors import InputError
from . import picture
from .draw import stage_of
from .live import HOST, Announce, Page
from .marks import Mesh, ball, tube
from .picture import Camera, Image, Item, bounds, corners_of
from .stage import Stage

if TYPE_CHECKING:
    from ..collision import Scene
    from ..kinematics import Robot

SECONDS = 4.0
"""How long playing the whole path takes."""
FRAME_RATE = 30.0
CHORDS = 40
"""Points of the tool's way between two vertices."""
WAY = (0.85, 0.35, 0.10, 0.9)
GHOSTS = 5
"""Postures in a picture between the first and the last, see-through."""


def show_path(
    what: Scene | Robot,
    path: ArrayLike,
    frame: str | None = None,
    *,
    port: int = 8080,
    host: str = HOST,
    open_browser: bool = True,
    block: bool = True,
    announce: Announce | None = None,
) -> Page:
    """A page with the robot, its surroundings and a slider along *path* ``(M, n)``; the way of *frame* is drawn.

    The slider runs from 0 to 100 % of the length in joint space; the joint values there are written below it.
    """
    stage = stage_of(what)
    points = _points(stage, path)
    page = Page(f"path of {stage.robot.name}" if stage.robot else "path", port=port, host=host)
    try:
        PathPlayer(page, stage, points, frame)
    except BaseException:
        page.stop()
        raise
    return page.serve(open_browser=open_browser, block=block, announce=announce)


def render_path(
    what: Scene | Robot, path: ArrayLike, frame: str | None = None, *, size: tuple[int, int] = (960, 640)
) -> Image:
    """A picture of the first and the last posture of *path* ``(M, n)``, see-through ones between, and *frame*'s way."""
    stage = stage_of(what)
    points = _points(stage, path)
    robot_items = len(stage.items(points[0])) - len(stage.bodies) - len(stage.boxes) - len(stage.ghosts)
    items = stage.items(points[-1])
    first = stage.items(points[0])[:robot_items]
    items += [_faded(item, 0.55) for item in first]
    for s in np.linspace(0.0, 1.0, GHOSTS + 2)[1:-1]:
        items += [_faded(item, 0.18) for item in stage.items(along(points, float(s)))[:robot_items]]
    cast = items[:robot_items] + items[robot_items + len(stage.bodies) + len(stage.boxes) + len(stage.ghosts) :]
    if (way := _way(stage, points, frame)) is not None:
        items.append(Item(way[0], way[1], rgba=(*WAY[:3], 1.0), shadow=False))
    low, high = bounds(cast)
    camera = Camera.around(corners_of(low, high), aspect=size[0] / size[1])
    return picture.render(items, camera, size=size, focus=(low, high))


class PathPlayer:
    """The slider, and play and pause."""

    def __init__(self, page: Page, stage: Stage, points: Array, frame: str | None) -> None:
        assert stage.robot is not None
        self.page, self.points, self.robot = page, points, stage.robot
        page.add(stage)
        rest = len(stage.boxes) + len(stage.ghosts)
        low, high = bounds([item for q in points[[0, -1]] for item in _cast(stage, q, rest)])
        if not stage.boxes:
            page.grid(float((high - low).max()))
        page.look(Camera.around(corners_of(low, high)))
        if (way := _way(stage, points, frame)) is not None:
            page.mesh("/way", way[0], way[1], WAY)
            for i, T in enumerate(self.robot.fk(points, frame or tool_of(self.robot))):
                page.mesh(f"/vertex{i}", *ball(T[:3, 3], 0.006), (0.45, 0.15, 0.05, 1.0))
        self._moving = False
        self._before = time.perf_counter()
        self._build()
        self.go(0.0)
        page.every(1.0 / FRAME_RATE, self._advance)

    def _build(self) -> None:
        import viser

        gui = self.page.server.gui
        length = float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())
        gui.add_markdown(f"**{self.robot.name}**: {len(self.points)} points, {length:.2f} rad and m in joint space")
        with gui.add_folder("Path"):
            self.slider: Any = gui.add_slider("along the path in %", 0.0, 100.0, 0.1, 0.0)
            self.play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY)
            self.now = gui.add_markdown("")
        self.slider.on_update(lambda _: self.go(0.01 * self.slider.value))
        self.play.on_click(lambda _: self.toggle())

    def go(self, share: float) -> None:
        """Show the posture at this share of the path's length."""
        q = along(self.points, share)
        self.page.draw(dict(zip(self.robot.frame_names, self.robot.fk(q))))
        rows = [f"{name} {value:.3f}" for name, value in zip(self.robot.joint_names, q)]
        self.now.content = "  \n".join(rows)

    def toggle(self) -> None:
        """Play or pause."""
        self._moving = not self._moving
        self.play.label = "Pause" if self._moving else "Play"
        if self._moving and self.slider.value >= 99.9:
            self.slider.value = 0.0

    def _advance(self) -> None:
        now = time.perf_counter()
        elapsed, self._before = now - self._before, now
        if not self._moving:
            return
        value = min(self.slider.value + 100.0 * elapsed / SECONDS, 100.0)
        if value >= 100.0:
            self.toggle()
        self.slider.value = value
        self.go(0.01 * value)


def along(points: Array, share: float) -> Array:
    """The joint vector at a *share* (0 … 1) of the length of the polyline ``(M, n)``."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    at = min(max(share, 0.0), 1.0) * float(lengths.sum())
    for a, b, length in zip(points[:-1], points[1:], lengths):
        if at <= length:
            return np.asarray(a + (at / length if length > 0.0 else 0.0) * (b - a))
        at -= float(length)
    return np.asarray(points[-1])


def tool_of(robot: Robot) -> str:
    """The frame whose way is drawn where none is named: the description's tool, else the last frame of the tree."""
    return robot.description.tool or robot.frame_names[-1]


def _points(stage: Stage, path: ArrayLike) -> Array:
    if stage.robot is None:
        raise InputError("there is no robot that could follow a path; pass a robot or a scene")
    points = as_shaped(path, "path", stage.robot.n)
    if points.ndim != 2 or not len(points):
        raise InputError(f"path has shape {points.shape}; expected (M, {stage.robot.n})")
    return points


def _way(stage: Stage, points: Array, frame: str | None) -> Mesh | None:
    """A tube along the way of the tool, None if it stands still."""
    assert stage.robot is not None
    if len(points) < 2:
        return None
    s = np.linspace(0.0, 1.0, CHORDS)[None, :, None]
    dense = (points[:-1, None] + s * np.diff(points, axis=0)[:, None]).reshape(-1, points.shape[1])
    return tube(stage.robot.fk(dense, frame or tool_of(stage.robot))[:, :3, 3], 0.004)


def _cast(stage: Stage, q: Array, rest: int) -> list[Item]:
    """Robot and bodies, without the *rest*, which reaches far."""
    items = stage.items(q)
    return items[: len(items) - rest] or items


def _faded(item: Item, alpha: float) -> Item:
    return Item(item.vertices, item.faces, item.pose, (*item.rgba[:3], alpha), item.gloss, False, item.normals)
