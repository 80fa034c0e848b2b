"""Constraints that hold all along a path: a tool that stays upright, within a box, or turned as told.

A constraint is about one frame of the robot. It has values with bounds, and their derivatives by the motion of the
frame, so that a configuration can be checked, moved onto it, and a straight joint motion proven to keep it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_pose, as_vector
from ..errors import InputError


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
    """*frame* stays turned as *rotation* (3, 3) within a rotation vector of ± *tolerance* (3,) rad, in its axes.

    A tolerance of π or more leaves that component free.
    """

    frame: str
    rotation: ArrayLike
    tolerance: ArrayLike

    def __post_init__(self) -> None:
        R = as_array(self.rotation, "rotation")
        if R.shape != (3, 3) or np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0.0:
            raise InputError("rotation of a constraint must be one rotation matrix (3, 3)")
        tolerance = np.broadcast_to(as_array(self.tolerance, "tolerance"), (3,)).astype(np.float64)
        if not (tolerance > 0.0).all():
            raise InputError(f"tolerance is {tolerance.tolist()}; expected three positive angles in rad (π: free)")
        object.__setattr__(self, "rotation", R)
        object.__setattr__(self, "tolerance", tolerance)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the values."""
        return -np.asarray(self.tolerance), np.asarray(self.tolerance)

    def values(self, T: Array) -> tuple[Array, Array]:
        """The rotation vector ``(..., 3)`` at frame poses, and its derivative ``(..., 3, 6)`` by (v, ω)."""
        from ..spatial import so3

        R = np.asarray(self.rotation)
        value = so3.log(R.T @ T[..., :3, :3])
        rows = np.zeros((*value.shape, 6))
        rows[..., 3:] = so3.inverse_left_jacobian(value) @ R.T
        return value, rows

    def words(self, value: Array) -> str:
        """The values, for people."""
        allowed = np.degrees(np.asarray(self.tolerance)).round(1).tolist()
        return f"{self.frame} is turned by {np.degrees(value).round(1).tolist()}°, allowed are ± {allowed}°"


PathConstraint = Upright | Inside | Turned


def _unit(value: ArrayLike, name: str) -> Array:
    v = as_vector(as_array(value, name), name, 3)
    length = float(np.linalg.norm(v))
    if not length > 1e-12:
        raise InputError(f"{name} is {v.tolist()}; expected a direction, not zero")
    return v / length
