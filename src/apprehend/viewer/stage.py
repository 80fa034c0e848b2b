"""What is to be seen: the robot's visible shapes, bodies and boxes, each with a colour, and where each is at a time.

A `Stage` is built from an episode (the data of ``episode.json``), or from robots and bodies; the pictures, the report
and the live page all draw from it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from .looks import Part, link_parts
from .picture import Item, smooth_normals

if TYPE_CHECKING:
    from ..kinematics import Robot
    from ..process import Episode

RGBA = tuple[float, float, float, float]

BODY_COLOURS: tuple[RGBA, ...] = (
    (0.86, 0.42, 0.20, 1.0),
    (0.16, 0.52, 0.62, 1.0),
    (0.55, 0.62, 0.22, 1.0),
    (0.62, 0.36, 0.60, 1.0),
    (0.80, 0.62, 0.16, 1.0),
)
"""sRGB of bodies, in turn; the first is the one that is picked."""
GHOST_ALPHA = 0.32


@dataclass(frozen=True, eq=False)
class Thing:
    """A rigid mesh on the stage that may move: ``vertices (V, 3)``, ``faces (F, 3)``, rest pose and colour."""

    name: str
    vertices: Array
    faces: IntArray
    pose: Array
    rgba: RGBA

    @cached_property
    def normals(self) -> Array:
        """Corner normals ``(F, 3, 3)``, smooth where the surface is."""
        return smooth_normals(self.vertices, self.faces)


@dataclass(frozen=True, eq=False)
class Stage:
    """The cast: a robot with the parts of its links, bodies, boxes, and ghosts of where bodies should go."""

    robot: Robot | None = None
    links: Mapping[str, tuple[Part, ...]] = field(default_factory=dict)
    bodies: tuple[Thing, ...] = ()
    boxes: tuple[Thing, ...] = ()
    ghosts: tuple[Thing, ...] = ()

    @classmethod
    def of(cls, data: Mapping[str, Any], folder: Path | None = None, meshes: Mapping[str, Any] | None = None) -> Stage:
        """The stage of an episode's *data*; its meshes are read below *folder*, or taken from *meshes* by name."""
        from ..collision.scene import RobotSource

        scene = data["scene"]
        robot = None
        if scene.get("robot"):
            options = {k: v for k, v in scene["robot"].items() if v is not None}
            robot = RobotSource(**options).build()[0]
        picked = (scene.get("goal") or {}).get("body")
        names = sorted((b["name"] for b in scene.get("bodies", ())), key=lambda name: name != picked)
        colours = {name: BODY_COLOURS[i % len(BODY_COLOURS)] for i, name in enumerate(names)}
        bodies = []
        for entry in scene.get("bodies", ()):
            vertices, faces = (meshes or {}).get(entry["mesh"]) or _mesh_below(folder, entry["mesh"])
            rgba = tuple(entry["rgba"]) if entry.get("rgba") else colours[entry["name"]]
            bodies.append(Thing(entry["name"], vertices, faces, np.array(entry["pose"]), rgba))
        boxes = [
            box(b["name"], b["size"], b["pose"], tuple(b.get("rgba") or (0.62, 0.55, 0.47, 1.0)))
            for b in scene.get("boxes", ())
        ]
        ghosts = []
        if picked is not None:
            thing = next(b for b in bodies if b.name == picked)
            goal = np.array(scene["goal"]["pose"])
            ghosts.append(
                Thing(f"goal of {picked}", thing.vertices, thing.faces, goal, (0.25, 0.62, 0.36, GHOST_ALPHA))
            )
        return cls(robot, link_parts(robot.description) if robot else {}, tuple(bodies), tuple(boxes), tuple(ghosts))

    def items(
        self,
        q: Array | None = None,
        poses: Mapping[str, Array] | None = None,
        *,
        ghosts: bool = True,
        robot_alpha: float = 1.0,
    ) -> list[Item]:
        """Everything as it is when the robot is at *q* and the bodies at *poses* (others stay where they started)."""
        items = []
        if self.robot is not None:
            frames = self.robot.fk(self.robot.home if q is None else q)
            for name, T in zip(self.robot.frame_names, frames):
                items += [
                    Item(p.vertices, p.faces, T, (*p.rgba[:3], p.rgba[3] * robot_alpha), gloss=0.5, normals=p.normals)
                    for p in self.links.get(name, ())
                ]
        for t in self.bodies:
            items.append(Item(t.vertices, t.faces, (poses or {}).get(t.name, t.pose), t.rgba, normals=t.normals))
        items += [Item(t.vertices, t.faces, t.pose, t.rgba, gloss=0.1, normals=t.normals) for t in self.boxes]
        if ghosts:
            items += [
                Item(t.vertices, t.faces, t.pose, t.rgba, gloss=0.0, shadow=False, normals=t.normals)
                for t in self.ghosts
            ]
        return items


def box(name: str, size: Sequence[float], pose: Any, rgba: RGBA) -> Thing:
    """A box of full extents *size* whose centre is at *pose*."""
    from ..bodies import shapes

    vertices, faces = shapes.box(size)
    return Thing(name, vertices, faces, np.array(pose, dtype=np.float64), rgba)


def read(episode: str | Path | Mapping[str, Any] | Episode) -> tuple[dict[str, Any], Stage]:
    """The data and the stage of an episode, given as a file, a directory, the data itself, or an `Episode`."""
    from ..process.episode import Episode, read_episode

    if isinstance(episode, Episode):
        data = episode.as_dict()
        return data, Stage.of(data, meshes=episode.meshes)
    if isinstance(episode, Mapping):
        data = dict(episode)
        where = Path(data["path"]).parent if "path" in data else None
        return data, Stage.of(data, where)
    data = read_episode(episode)
    return data, Stage.of(data, Path(data["path"]).parent)


def body_poses(rows: Any) -> Array:
    """Poses ``(k, 4, 4)`` of rows ``(x, y, z, qw, qx, qy, qz)``."""
    from scipy.spatial.transform import Rotation

    rows = np.asarray(rows, dtype=np.float64)
    T = np.broadcast_to(np.eye(4), (len(rows), 4, 4)).copy()
    T[:, :3, :3] = Rotation.from_quat(rows[:, 3:], scalar_first=True).as_matrix()
    T[:, :3, 3] = rows[:, :3]
    return T


def _mesh_below(folder: Path | None, name: str) -> tuple[Array, IntArray]:
    """A mesh of an episode; only files below the episode's own folder are read."""
    from ..bodies.load import read_mesh

    if folder is None:
        raise InputError(f"the episode refers to {name!r}, but not from where: give its path, or its data with 'path'")
    root = folder.resolve()
    path = (root / name).resolve()
    if not path.is_relative_to(root):
        raise InputError(f"the episode's mesh {name!r} lies outside its folder {folder}: refused")
    return read_mesh(path, units="m")
