"""Constraints that hold all along a path: a tool that stays upright, within a box, or turned as told.

A constraint is about one frame of the robot. It has values with bounds, and their derivatives by the motion of the
frame, so that a configuration can be checked, moved onto it, and a straight joint motion proven to keep it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, as_array, as_pose, as_vector
from ..collision import Convex
from ..collision.nodes import Node, matrix, reach
from ..errors import InputError
from ..kinematics import Robot

SHARE, MOST_TURN, MOST_SHIFT = 0.15, 0.02, 0.003
"""Between checked configurations a value may change by this share of its tolerance, or so many rad or m."""

STEPS = 30
"""Newton steps of a projection."""


@dataclass(frozen=True, eq=False)
class Upright:
    """*axis* (3,) of *frame* stays within *angle* (rad) of the direction *up* (3,) of the world: a mug that is full."""

    frame: str
    axis: ArrayLike = (0.0, 0.0, 1.0)
    angle: float = 0.25
    up: ArrayLike = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        if not 0.0 < self.angle < np.pi:
            raise InputError(f"the angle of an upright constraint is {self.angle}; expected 0 to π, in rad, and not 0")
        object.__setattr__(self, "axis", _unit(self.axis, "axis"))
        object.__setattr__(self, "up", _unit(self.up, "up"))

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bound of the value."""
        return np.array([-np.inf]), np.array([self.angle])

    def values(self, T: Array) -> tuple[Array, Array]:
        """The angle ``(..., 1)`` at frame poses ``(..., 4, 4)``, and its derivative ``(..., 1, 6)`` by (v, ω)."""
        axis = T[..., :3, :3] @ np.asarray(self.axis)
        normal = np.cross(axis, np.asarray(self.up))
        sine = np.linalg.norm(normal, axis=-1, keepdims=True)
        angle = np.arctan2(sine[..., 0], axis @ np.asarray(self.up))
        rows = np.zeros((*angle.shape, 1, 6))
        rows[..., 0, 3:] = -normal / np.maximum(sine, 1e-12)
        return angle[..., None], rows

    def words(self, value: Array) -> str:
        """The value, for people."""
        return f"{self.frame} is tilted by {np.degrees(value[0]):.1f}°, allowed are {np.degrees(self.angle):.1f}°"


@dataclass(frozen=True, eq=False)
class Inside:
    """*point* (3,) of *frame* stays between *lower* and *upper* (3,) in m, along the axes of *pose* (T_world_box)."""

    frame: str
    lower: ArrayLike
    upper: ArrayLike
    pose: ArrayLike = field(default_factory=lambda: np.eye(4))
    point: ArrayLike = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        lower, upper = (as_vector(as_array(v, n), n, 3) for v, n in ((self.lower, "lower"), (self.upper, "upper")))
        if not (lower < upper).all():
            raise InputError(f"lower is {lower.tolist()} and upper {upper.tolist()}; each lower bound must be smaller")
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)
        object.__setattr__(self, "pose", as_pose(self.pose, "pose"))
        object.__setattr__(self, "point", as_vector(as_array(self.point, "point"), "point", 3))

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the values."""
        return np.asarray(self.lower), np.asarray(self.upper)

    def values(self, T: Array) -> tuple[Array, Array]:
        """The point in the box's axes ``(..., 3)`` at frame poses, and its derivative ``(..., 3, 6)`` by (v, ω)."""
        box = np.asarray(self.pose)
        arm = T[..., :3, :3] @ np.asarray(self.point)
        value = (T[..., :3, 3] + arm - box[:3, 3]) @ box[:3, :3]
        rows = np.zeros((*value.shape, 6))
        rows[..., :3] = box[:3, :3].T
        rows[..., 3:] = np.cross(arm[..., None, :], box[:3, :3].T)
        return value, rows

    def words(self, value: Array) -> str:
        """The values, for people."""
        beyond = np.maximum(self.bounds[0] - value, value - self.bounds[1])
        i = int(np.argmax(beyond))
        low, high = self.bounds[0][i], self.bounds[1][i]
        return f"{self.frame} is at {'xyz'[i]} = {value[i]:.3f} m of its box, allowed are {low:.3f} to {high:.3f} m"


@dataclass(frozen=True, eq=False)
class Turned:
    """*frame* stays turned as *rotation* (3, 3) within a rotation vector of ± *tolerance* (3,) rad, in its axes."""

    frame: str
    rotation: ArrayLike
    tolerance: ArrayLike

    def __post_init__(self) -> None:
        R = as_array(self.rotation, "rotation")
        if R.shape != (3, 3) or np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0.0:
            raise InputError("rotation of a constraint must be one rotation matrix (3, 3)")
        tolerance = np.broadcast_to(as_array(self.tolerance, "tolerance"), (3,)).astype(np.float64)
        if not ((tolerance > 0.0).all() and np.linalg.norm(np.minimum(tolerance, 9.0)) < 5.5):
            raise InputError(f"tolerance is {tolerance.tolist()}; expected three positive angles below π, in rad")
        object.__setattr__(self, "rotation", R)
        object.__setattr__(self, "tolerance", tolerance)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the values."""
        return -np.asarray(self.tolerance), np.asarray(self.tolerance)

    def values(self, T: Array) -> tuple[Array, Array]:
        """The rotation vector ``(..., 3)`` at frame poses; its derivative ``(..., 3, 6)`` by (v, ω), right at zero."""
        from ..spatial import so3

        R = np.asarray(self.rotation)
        value = so3.log(R.T @ T[..., :3, :3])
        rows = np.zeros((*value.shape, 6))
        rows[..., 3:] = R.T
        return value, rows

    def words(self, value: Array) -> str:
        """The values, for people."""
        allowed = np.degrees(np.asarray(self.tolerance)).round(1).tolist()
        return f"{self.frame} is turned by {np.degrees(value).round(1).tolist()}°, allowed are ± {allowed}°"


PathConstraint = Upright | Inside | Turned


class Constraints:
    """Constraints of one robot: checked, kept along motions, projected onto; joint vectors are ``(..., n)``."""

    def __init__(self, robot: Robot, items: Sequence[PathConstraint], moving: BoolArray | None = None) -> None:
        self.robot, self.items = robot, tuple(items)
        self.moving = np.ones(robot.n, bool) if moving is None else moving
        self._rates: list[Array] = []
        self._slack: list[Array] = []
        for item in self.items:
            f = robot.frame_index(item.frame)
            low, high = item.bounds
            width = np.where(np.isfinite(low), 0.5 * (high - low), high)
            most = MOST_SHIFT if isinstance(item, Inside) else MOST_TURN
            self._slack.append(np.minimum(SHARE * width, most))
            self._rates.append(_rates(robot, f, item))

    def violation(self, q: Array, tight: float = 0.0) -> Array:
        """How far beyond the bounds ``(...)`` in rad or m, 0 where all hold; *tight*: bounds narrowed by slacks."""
        worst: Array = np.zeros(q.shape[:-1])
        for item, slack in zip(self.items, self._slack, strict=True):
            low, high = item.bounds
            value, _ = item.values(self.robot.fk(q, item.frame))
            beyond = np.maximum(low + tight * slack - value, value - high + tight * slack)
            worst = np.maximum(worst, beyond.max(axis=-1))
        return worst

    def why(self, q: Array) -> str:
        """Which constraint ``q (n,)`` violates, in words; empty: none."""
        for item in self.items:
            low, high = item.bounds
            value, _ = item.values(self.robot.fk(q, item.frame))
            if np.maximum(low - value, value - high).max() > 0.0:
                return item.words(value)
        return ""

    def hold(self, qa: Array, qb: Array, share: float = 1.0) -> BoolArray:
        """Whether the constraints certainly hold all along each straight motion ``(N, n)``.

        Checked configurations are so near to one another that no value can change by more than this *share* of its
        slack in between, and each keeps that much.
        """
        out = np.ones(len(qa), bool)
        if not self.items or not len(qa):
            return out
        spans = [np.abs(qb - qa) @ rates / slack.min() for rates, slack in zip(self._rates, self._slack, strict=True)]
        counts = np.maximum(np.ceil(0.5 / share * np.max(spans, axis=0)).astype(int), 1)
        owner = np.repeat(np.arange(len(qa)), counts)
        first = np.cumsum(counts) - counts
        s = (np.arange(len(owner)) - first[owner] + 0.5) / counts[owner]
        bad = self.violation(qa[owner] + s[:, None] * (qb - qa)[owner], share) > 0.0
        out[owner[bad]] = False
        ends = (self.violation(qa) > 0.0) | (self.violation(qb) > 0.0)
        out[ends] = False
        return out

    def project(self, q: Array, lower: Array, upper: Array) -> tuple[Array, BoolArray]:
        """Configurations ``(N, n)`` near *q* that keep all bounds with two slacks to spare, and where that worked."""
        q = np.clip(q, lower, upper)
        for _ in range(STEPS):
            errors, jacobians = [], []
            for item, slack in zip(self.items, self._slack, strict=True):
                low, high = item.bounds
                value, rows = item.values(self.robot.fk(q, item.frame))
                target = np.clip(value, low + 2.0 * slack, high - 2.0 * slack)
                J = rows @ self.robot.jacobian(q, item.frame, "mixed")
                errors.append(target - value)
                jacobians.append(np.where((target != value)[..., None], J, 0.0) * self.moving)
            e, J = np.concatenate(errors, axis=-1), np.concatenate(jacobians, axis=-2)
            if np.abs(e).max(initial=0.0) < 1e-9:
                break
            gram = J @ np.swapaxes(J, -1, -2) + 1e-6 * np.eye(e.shape[-1])
            step = np.swapaxes(J, -1, -2) @ np.linalg.solve(gram, e[..., None])
            q = np.clip(q + step[..., 0], lower, upper)
        return q, self.violation(q, 1.5) <= 0.0


def _rates(robot: Robot, frame: int, item: PathConstraint) -> Array:
    """By how much the values can change per unit of each coordinate ``(n,)``: turning, or moving the point."""
    tree = robot.model
    point = np.asarray(item.point) if isinstance(item, Inside) else np.zeros(3)
    carrier = int(tree.frame_joint[frame])
    out = np.zeros(robot.n)
    place = matrix(tree.frame_place[frame])
    place[:3, 3] += place[:3, :3] @ point
    levers = reach(tree, robot, Node("point", carrier, (Convex.sphere(1e-6).at(place),)))
    joint = carrier
    while joint >= 0:
        turning = float(tree.kind[joint] == 0)
        # rotation vectors change faster than they turn, the more the larger they are
        lever = (
            float(levers[joint]) if isinstance(item, Inside) else turning * (1.6 if isinstance(item, Turned) else 1.0)
        )
        out[tree.coordinate[joint]] += abs(float(tree.gain[joint, 0])) * lever
        joint = int(tree.parent[joint])
    return out


def _unit(value: ArrayLike, name: str) -> Array:
    v = as_vector(as_array(value, name), name, 3)
    length = float(np.linalg.norm(v))
    if not length > 1e-12:
        raise InputError(f"{name} is {v.tolist()}; expected a direction, not zero")
    return v / length
