"""What there is to say along a planned path: lengths, the way of the tool, and how near things come."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from .plots import Chart, Line

if TYPE_CHECKING:
    from ..collision import CollisionModel
    from ..kinematics import Robot

SAMPLES = 240
"""Places along a path at which distances are measured and curves are drawn, besides its points."""

FAR = 0.5
"""Distances beyond this, in m, are not told apart."""


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


@dataclass(frozen=True, eq=False)
class Nearness:
    """The smallest distances of the robot from what stands around it, or from itself, at every place of a path."""

    label: str
    distance: Array
    """``(S,)`` in m, `FAR` at most."""
    points: Array
    """``(S, 2, 3)``: the two nearest points, in the world."""
    names: tuple[tuple[str, str], ...]

    @property
    def least(self) -> int:
        """The place where it is smallest."""
        return int(np.argmin(self.distance))


@dataclass(frozen=True, eq=False)
class PathFacts:
    """A path ``(M, n)`` seen at *S* places."""

    robot: Robot
    points: Array
    frame: str
    share: Array
    """``(S,)`` of the length in joint space, 0 … 1."""
    q: Array
    """``(S, n)``."""
    tool: Array
    """``(S, 4, 4)``, the poses of *frame*."""
    near: tuple[Nearness, ...] = ()

    @classmethod
    def of(
        cls, robot: Robot, points: Array, frame: str | None = None, model: CollisionModel | None = None
    ) -> PathFacts:
        """The facts of a path; with a collision *model* also how near things come."""
        lengths = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
        share = np.array([0.0])
        if lengths[-1] > 0.0:
            share = np.unique(np.r_[lengths / lengths[-1], np.linspace(0.0, 1.0, SAMPLES)])
        q = np.array([along(points, float(s)) for s in share])
        name = frame or tool_of(robot)
        return cls(robot, points, name, share, q, robot.fk(q, name), () if model is None else nearness(model, q))

    @property
    def length(self) -> float:
        """In joint space, in rad and m."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    @property
    def way(self) -> float:
        """Length of the way of the tool in m."""
        return float(np.linalg.norm(np.diff(self.tool[:, :3, 3], axis=0), axis=1).sum())

    @property
    def turned(self) -> float:
        """How far the tool turns on its way, in rad."""
        steps = np.swapaxes(self.tool[:-1, :3, :3], 1, 2) @ self.tool[1:, :3, :3]
        cosine = np.clip(0.5 * (np.trace(steps, axis1=1, axis2=2) - 1.0), -1.0, 1.0)
        return float(np.arccos(cosine).sum())

    def at(self, share: float) -> int:
        """The place that is nearest to a *share* of the length."""
        return int(np.argmin(np.abs(self.share - share)))

    def charts(self) -> list[Chart]:
        """Distances, and every joint, over the length in %."""
        axis = 100.0 * self.share
        lines = [Line(n.label, 1e3 * n.distance, i) for i, n in enumerate(self.near)]
        found = [Chart("Nearest distance", "mm", axis, lines, axis="%")] if lines else []
        scale = units(self.robot)
        for unit, title in (("°", "Joint angles"), ("mm", "Sliding joints")):
            some = [i for i, (_, u) in enumerate(scale) if u == unit]
            if some:
                curves = [
                    Line(self.robot.joint_names[i], scale[i][0] * self.q[:, i], k % 8) for k, i in enumerate(some)
                ]
                found.append(Chart(title, unit, axis, curves, axis="%"))
        return found


def nearness(model: CollisionModel, q: Array) -> tuple[Nearness, ...]:
    """How near the links come to what stands around, and to each other, at each of ``q (S, n)``."""
    pairs = model.distances(q, FAR)
    moving = set(model.robot.frame_names)
    own = np.array([set(names) <= moving for names in pairs.names], dtype=bool)
    found = []
    for label, some in (("to the surroundings", ~own), ("between links", own)):
        which = np.flatnonzero(some)
        if not len(which):
            continue
        best = which[np.argmin(pairs.distance[:, which], axis=1)]
        rows = np.arange(len(q))
        distance = np.minimum(pairs.distance[rows, best], FAR)
        if distance.min() < FAR:
            found.append(Nearness(label, distance, pairs.points[rows, best], tuple(pairs.names[b] for b in best)))
    return tuple(found)


def units(robot: Robot) -> list[tuple[float, str]]:
    """For each joint the factor to the unit in which people read it, and the unit."""
    from ..robots.description import JointType

    sliding = [robot.description.joint(name).type is JointType.PRISMATIC for name in robot.joint_names]
    return [(1e3, "mm") if slides else (180.0 / np.pi, "°") for slides in sliding]
