"""A planned path: a page with a slider along it, and a picture of its postures."""

from __future__ import annotations

import html
import math
import time
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped
from ..errors import ApprehendError, InputError
from . import picture
from .along import Nearness, PathFacts, along, tool_of, units
from .draw import stage_of
from .live import Page, Serving, serve
from .marks import Mesh, ball, tube
from .picture import Camera, Image, Item, bounds, corners_of
from .replay import COLOURS, plot, switch
from .stage import Stage

if TYPE_CHECKING:
    from ..collision import CollisionModel, Scene
    from ..kinematics import Robot

SECONDS = 4.0
"""How long playing the whole path takes."""
FRAME_RATE = 30.0
CHORDS = 40
"""Points of the tool's way between two vertices."""
WAY = (0.85, 0.35, 0.10, 0.9)
GHOSTS = 5
"""Postures in a picture between the first and the last, see-through."""
PLACES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of a path at which the robot is to be in the picture."""
VERTICES = 40
"""Most points of a path that are marked one by one."""
AZIMUTHS = tuple(math.radians(a) for a in (-50.0, -20.0, -80.0, 20.0, 60.0, 120.0, 180.0, 240.0))
"""Where the camera may stand: the first from which the tool's way is seen best."""
ELEVATION = math.radians(26.0)


def show_path(
    what: Scene | Robot,
    path: ArrayLike,
    frame: str | None = None,
    *,
    model: CollisionModel | None = None,
    **serving: Unpack[Serving],
) -> Page:
    """A page with the robot, its surroundings and a slider along *path* ``(M, n)``; the way of *frame* is drawn.

    The slider runs from 0 to 100 % of the length in joint space. Written and drawn for every place: how near the links
    come to what stands around and to each other (by *model*; None: the scene's own), and the joint values within
    their limits. *serving*: see `Serving`.
    """
    stage = stage_of(what)
    points = _points(stage, path)
    assert stage.robot is not None
    facts = PathFacts.of(stage.robot, points, frame, model or _model(what, stage.robot))
    return serve(f"path of {stage.robot.name}", lambda page: PathPlayer(page, stage, facts), **serving)


def _model(what: Any, robot: Robot) -> CollisionModel | None:
    """The collision model of what is shown; None where the robot has nothing that could collide."""
    from ..collision import CollisionModel, Scene

    try:
        return CollisionModel(robot, what if isinstance(what, Scene) else None)
    except ApprehendError:
        return None


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
    camera = _camera(stage, points, frame, corners_of(low, high), size[0] / size[1])
    return picture.render(items, camera, size=size, focus=(low, high))


class PathPlayer:
    """The slider, play and pause, what is near, and the curves."""

    def __init__(self, page: Page, stage: Stage, facts: PathFacts) -> None:
        self.page, self.facts, self.points, self.robot = page, facts, facts.points, facts.robot
        page.add(stage)
        rest = len(stage.boxes) + len(stage.ghosts)
        low, high = bounds([item for s in PLACES for item in _cast(stage, along(self.points, s), rest)])
        if not stage.boxes:
            page.grid(float((high - low).max()))
        page.look(_camera(stage, self.points, facts.frame, corners_of(low, high), 1.1))
        self._marks(stage)
        self._moving = False
        self._before = time.perf_counter()
        self._build()
        self.go(0.0)
        page.every(1.0 / FRAME_RATE, self._advance)

    def _marks(self, stage: Stage) -> None:
        """The way of the tool, the points of the path on it, and a line between what is nearest."""
        self.shown: dict[str, list[Any]] = {}
        if (way := _way(stage, self.points, self.facts.frame)) is not None:
            marks = [self.page.mesh("/way", way[0], way[1], WAY)]
            if len(self.points) <= VERTICES:
                for i, T in enumerate(self.robot.fk(self.points, self.facts.frame)):
                    marks.append(self.page.mesh(f"/vertex{i}", *ball(T[:3, 3], 0.008), (0.45, 0.15, 0.05, 1.0)))
            self.shown[f"way of {self.facts.frame}"] = marks
        self.gaps = [self._gap(i, near) for i, near in enumerate(self.facts.near)]
        for near, gap in zip(self.facts.near, self.gaps):
            self.shown[f"nearest {near.label}"] = [gap]

    def _gap(self, number: int, near: Nearness) -> Any:
        colour = tuple(int(COLOURS[number][k : k + 2], 16) for k in (1, 3, 5))
        return self.page.server.scene.add_line_segments(
            f"/nearest{number}", near.points[:1].astype(np.float32), (colour[0], colour[1], colour[2]), thickness=0.008
        )

    def _build(self) -> None:
        import viser

        gui = self.page.server.gui
        gui.add_html(summary(self.facts))
        with gui.add_folder("Path"):
            self.slider: Any = gui.add_slider("along the path in %", 0.0, 100.0, 0.1, 0.0)
            self.play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY)
            self.now = gui.add_html("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Curves"):
            for chart in self.facts.charts():
                plot(gui, chart)
        with tabs.add_tab("Show"):
            for label, handles in self.shown.items():
                switch(gui, label, handles)
        self.slider.on_update(lambda _: self.go(0.01 * self.slider.value))
        self.play.on_click(lambda _: self.toggle())

    def go(self, share: float) -> None:
        """Show the posture at this share of the path's length."""
        q = along(self.points, share)
        self.page.draw(dict(zip(self.robot.frame_names, self.robot.fk(q))))
        place = self.facts.at(share)
        for near, gap in zip(self.facts.near, self.gaps):
            gap.points = near.points[place : place + 1].astype(np.float32)
        self.now.content = state(self.facts, q, place)

    def toggle(self) -> None:
        """Play or pause."""
        import viser

        self._moving = not self._moving
        self.play.label = "Pause" if self._moving else "Play"
        self.play.icon = viser.Icon.PLAYER_PAUSE if self._moving else viser.Icon.PLAYER_PLAY
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


def _millimetres(distance: float, most: float) -> str:
    return f"more than {1e3 * most:.0f} mm" if distance >= most else f"{1e3 * distance:.1f} mm".replace("-", "−")


def summary(facts: PathFacts) -> str:
    """Lengths of a path, and where it is nearest to what, as HTML."""
    from .along import FAR

    joint_units = {unit for _, unit in units(facts.robot)}
    unit = "rad" if joint_units == {"°"} else "m" if joint_units == {"mm"} else "rad and m"
    rows = [
        ("points", f"{len(facts.points)}"),
        ("length in joint space", f"{facts.length:.2f} {unit}"),
        (f"way of {facts.frame}", f"{facts.way:.3f} m, turns {math.degrees(facts.turned):.0f}°"),
    ]
    for near in facts.near:
        k = near.least
        names = " – ".join(near.names[k])
        rows.append((f"nearest {near.label}",
                     f"<b>{_millimetres(float(near.distance[k]), FAR)}</b> at {100.0 * facts.share[k]:.0f} %<br>"
                     f'<span style="opacity:.65">{html.escape(names)}</span>'))  # fmt: skip
    cells = "".join(
        f'<tr><td style="opacity:.65;padding:3px 14px 3px 0;vertical-align:top">{html.escape(label)}</td>'
        f'<td style="padding:3px 0">{value}</td></tr>'
        for label, value in rows
    )
    return f'<table style="font-size:13px;line-height:1.35;margin:4px 10px;border-collapse:collapse">{cells}</table>'


def state(facts: PathFacts, q: Array, place: int) -> str:
    """What is near at one place, and every joint with a mark between its limits, as HTML."""
    from .along import FAR

    rows = []
    for near, colour in zip(facts.near, COLOURS):
        value = _millimetres(float(near.distance[place]), FAR)
        names = " – ".join(near.names[place]) if near.distance[place] < FAR else ""
        rows.append(
            f'<div><span style="color:{colour}">●</span> <b>{value}</b> {near.label} '
            f'<span style="opacity:.65">{html.escape(names)}</span></div>'
        )
    limits = facts.robot.limits
    for i, (name, (factor, unit)) in enumerate(zip(facts.robot.joint_names, units(facts.robot))):
        low, high = float(limits.lower[i]), float(limits.upper[i])
        mark = ""
        if math.isfinite(low) and math.isfinite(high) and high > low:
            at = min(max(100.0 * (float(q[i]) - low) / (high - low), 0.0), 100.0)
            mark = f'<span style="position:absolute;left:{at:.1f}%;top:-3px;width:3px;height:9px;margin-left:-1px;' \
                   f'border-radius:2px;background:{COLOURS[0]}"></span>'  # fmt: skip
        rows.append(
            '<div style="display:grid;grid-template-columns:minmax(0,1fr) 70px 30%;gap:8px;align-items:center">'
            f'<span style="overflow:hidden;text-overflow:ellipsis;white-space:nowrap">{html.escape(name)}</span>'
            f'<span style="text-align:right;font-variant-numeric:tabular-nums">{factor * float(q[i]):.1f} {unit}</span>'
            f'<span style="position:relative;height:3px;border-radius:2px;background:#8884">{mark}</span></div>'
        )
    return f'<div style="font-size:12.5px;line-height:1.65;margin:2px 10px">{"".join(rows)}</div>'


def _camera(stage: Stage, points: Array, frame: str | None, seen: Array, aspect: float) -> Camera:
    """A camera that looks at *seen* ``(k, 3)`` from where most of the tool's way is not hidden behind something."""
    assert stage.robot is not None
    steps = np.linspace(0.0, 1.0, 24)
    way = stage.robot.fk([along(points, float(s)) for s in steps], frame or tool_of(stage.robot))[:, :3, 3]
    walls = [(t.vertices @ t.pose[:3, :3].T + t.pose[:3, 3])[t.faces] for t in stage.boxes]
    triangles = np.concatenate(walls) if walls else np.zeros((0, 3, 3))
    cameras = [Camera.around(seen, azimuth=a, elevation=ELEVATION, aspect=aspect) for a in AZIMUTHS]
    if not 0 < len(triangles) <= 20_000:
        return cameras[0]
    hidden = [int(_hidden(way, np.asarray(camera.eye), triangles).sum()) for camera in cameras]
    return cameras[int(np.argmin(hidden))]


def _hidden(points: Array, eye: Array, triangles: Array) -> Array:
    """Whether a triangle ``(F, 3, 3)`` is between *eye* and each of *points* ``(N, 3)`` (Möller & Trumbore 1997)."""
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    found = np.zeros(len(points), dtype=bool)
    for i, point in enumerate(points):
        ray = point - eye
        across = np.cross(ray, v)
        size = np.einsum("ij,ij->i", u, across)
        size = np.where(np.abs(size) > 1e-14, size, np.inf)
        to = eye - a
        other = np.cross(to, u)
        s, t = np.einsum("ij,ij->i", to, across) / size, other @ ray / size
        depth = np.einsum("ij,ij->i", v, other) / size
        found[i] = ((s >= 0.0) & (t >= 0.0) & (s + t <= 1.0) & (depth > 0.0) & (depth < 0.999)).any()
    return found


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
