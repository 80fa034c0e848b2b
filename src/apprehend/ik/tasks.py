"""Tasks for `step`: what a frame, a joint or the centre of mass shall do. Plain values, checked when used.

Every task has a *gain*, the share of its error that one step is asked to remove, and a *weight*, a number or one per
row; a weight of zero leaves a row out (a partial pose).
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_pose, as_shaped, check_rotation
from ..errors import InputError, unknown_name
from ..kernels import ik_tasks as codes
from ..kinematics import Robot

Z_AXIS = (0.0, 0.0, 1.0)
_EMPTY_POSE = np.eye(4).reshape(16)


@dataclass(frozen=True, eq=False)
class Rows:
    """All of a task but its targets, in the form of the kernels: one entry of `kernels.ik_tasks.TaskList`."""

    kind: int
    weight: Array
    gain: float
    frames: tuple[int, int] = (-1, -1)
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = Z_AXIS
    pick: tuple[int, ...] = ()
    blank: Array | None = None  # (16,) what the targets leave as it is


@dataclass(frozen=True, eq=False)
class Task:
    """Base of the tasks."""

    slot: ClassVar[slice] = slice(0, 16)
    """Where the targets stand among the 16 numbers of the kernels."""

    def _key(self) -> Hashable:
        """All that `_rows` depends on: tasks with equal keys differ in their targets only."""
        raise NotImplementedError

    def _held(self) -> Self:
        """The task with arrays of its own, which the caller does not change any more."""
        own = copy(self)
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                object.__setattr__(own, name, value.copy())
        return own

    def _rows(self, robot: Robot) -> Rows:
        """The task for *robot*, checked."""
        raise NotImplementedError

    def _targets(self, robot: Robot, q: Array) -> Array:
        """Targets ``(N or 1, …)`` as they stand in the slot, or joint values; their shape is checked, not their
        values."""
        raise NotImplementedError

    def _check(self, robot: Robot, q: Array) -> None:
        """Raise for what is wrong with the values of the targets."""
        self._targets(robot, q)


def _shaped(value: Any, name: str, *tail: int) -> Array:
    """*value* as float64 ``(M, size)`` of shape ``(..., *tail)``; the numbers are not looked at."""
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and value.shape[-len(tail) :] == tail:
        array: Array = value
    else:
        array = as_shaped(value, name, *tail, finite=False)
    size = 1
    for n in tail:
        size *= n
    return array.reshape(-1, size)


def _pose(value: Any, name: str) -> Array:
    if not isinstance(value, np.ndarray) and hasattr(value, "matrix"):
        value = value.matrix
    return _shaped(value, name, 4, 4)


def _hashable(value: Any) -> Hashable:
    kind = type(value)
    if kind is float or kind is int or (kind is tuple and all(type(v) is float for v in value)):
        return value  # type: ignore[no-any-return]
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return id(value)
    return array.shape, array.tobytes()


def _weights(weight: ArrayLike, count: int, gain: float, name: str) -> Array:
    w = as_array(weight, f"{name}.weight")
    if w.shape not in ((), (count,)):
        raise InputError(f"{name}.weight has shape {w.shape}; expected a number or ({count},)")
    if (w < 0.0).any():
        raise InputError(f"{name}.weight is {w}; weights must not be negative")
    if not 0.0 < gain <= 1.0:
        raise InputError(f"{name}.gain is {gain}; expected more than 0 and at most 1")
    return np.full(count, float(w)) if w.ndim == 0 else w


def _unit(value: ArrayLike, name: str) -> Array:
    v = as_shaped(value, name, 3)
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    if (length < 1e-12).any():
        raise InputError(f"{name} is zero; expected a direction")
    unit: Array = v / length
    return unit


def _three(v: Array) -> tuple[float, float, float]:
    if v.shape != (3,):
        raise InputError(f"a point or axis of a task has shape {v.shape}; expected (3,), one for all targets")
    return float(v[0]), float(v[1]), float(v[2])


@dataclass(frozen=True, eq=False)
class PoseTask(Task):
    """Bring *frame* to the pose *T* ``(..., 4, 4)``: rows x, y, z, then about x, y, z, in the axes of the target."""

    frame: str
    T: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _key(self) -> Hashable:
        return PoseTask, self.frame, _hashable(self.weight), self.gain

    def _rows(self, robot: Robot) -> Rows:
        w = _weights(self.weight, 6, self.gain, "PoseTask")
        return Rows(codes.POSE, w, self.gain, (robot.frame_index(self.frame), -1))

    def _targets(self, robot: Robot, q: Array) -> Array:
        return _pose(self.T, "PoseTask.T")

    def _check(self, robot: Robot, q: Array) -> None:
        as_pose(self.T, "PoseTask.T")


@dataclass(frozen=True, eq=False)
class PositionTask(Task):
    """Bring *point* (in *frame*) to *position* ``(..., 3)`` of the world: rows x, y, z."""

    frame: str
    position: ArrayLike
    point: ArrayLike = (0.0, 0.0, 0.0)
    weight: ArrayLike = 1.0
    gain: float = 1.0
    slot: ClassVar[slice] = slice(3, 12, 4)

    def _key(self) -> Hashable:
        return PositionTask, self.frame, _hashable(self.point), _hashable(self.weight), self.gain

    def _rows(self, robot: Robot) -> Rows:
        point = _three(as_shaped(self.point, "PositionTask.point", 3))
        w = _weights(self.weight, 3, self.gain, "PositionTask")
        return Rows(codes.POSITION, w, self.gain, (robot.frame_index(self.frame), -1), point, blank=_EMPTY_POSE)

    def _targets(self, robot: Robot, q: Array) -> Array:
        return _shaped(self.position, "PositionTask.position", 3)

    def _check(self, robot: Robot, q: Array) -> None:
        as_shaped(self.position, "PositionTask.position", 3)


@dataclass(frozen=True, eq=False)
class OrientationTask(Task):
    """Turn *frame* to the rotation *R* ``(..., 3, 3)``: rows about x, y, z of the target."""

    frame: str
    R: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _key(self) -> Hashable:
        return OrientationTask, self.frame, _hashable(self.weight), self.gain

    def _rows(self, robot: Robot) -> Rows:
        w = _weights(self.weight, 3, self.gain, "OrientationTask")
        return Rows(codes.ORIENTATION, w, self.gain, (robot.frame_index(self.frame), -1))

    def _targets(self, robot: Robot, q: Array) -> Array:
        R = _shaped(self.R, "OrientationTask.R", 3, 3)
        T = np.zeros((R.shape[0], 4, 4))
        T[:, :3, :3] = R.reshape(-1, 3, 3)
        T[:, 3, 3] = 1.0
        return T.reshape(-1, 16)

    def _check(self, robot: Robot, q: Array) -> None:
        check_rotation(as_shaped(self.R, "OrientationTask.R", 3, 3), "OrientationTask.R")


@dataclass(frozen=True, eq=False)
class DirectionTask(Task):
    """Point *axis* (of *frame*) along *direction* ``(..., 3)`` of the world: two rows; the turn about it is free."""

    frame: str
    direction: ArrayLike
    axis: ArrayLike = Z_AXIS
    weight: ArrayLike = 1.0
    gain: float = 1.0
    slot: ClassVar[slice] = slice(0, 3)

    def _key(self) -> Hashable:
        return DirectionTask, self.frame, _hashable(self.axis), _hashable(self.weight), self.gain

    def _rows(self, robot: Robot) -> Rows:
        axis = _three(_unit(self.axis, "DirectionTask.axis"))
        w = _weights(self.weight, 2, self.gain, "DirectionTask")
        return Rows(codes.DIRECTION, w, self.gain, (robot.frame_index(self.frame), -1), axis=axis)

    def _targets(self, robot: Robot, q: Array) -> Array:
        return _shaped(self.direction, "DirectionTask.direction", 3)

    def _check(self, robot: Robot, q: Array) -> None:
        _unit(self.direction, "DirectionTask.direction")


@dataclass(frozen=True, eq=False)
class LookAtTask(Task):
    """Point the ray from *eye* along *axis* (both in *frame*) at *target* ``(..., 3)`` of the world: two rows."""

    frame: str
    target: ArrayLike
    axis: ArrayLike = Z_AXIS
    eye: ArrayLike = (0.0, 0.0, 0.0)
    weight: ArrayLike = 1.0
    gain: float = 1.0
    slot: ClassVar[slice] = slice(0, 3)

    def _key(self) -> Hashable:
        place = _hashable(self.axis), _hashable(self.eye)
        return LookAtTask, self.frame, place, _hashable(self.weight), self.gain

    def _rows(self, robot: Robot) -> Rows:
        axis = _three(_unit(self.axis, "LookAtTask.axis"))
        eye = _three(as_shaped(self.eye, "LookAtTask.eye", 3))
        w = _weights(self.weight, 2, self.gain, "LookAtTask")
        return Rows(codes.LOOK_AT, w, self.gain, (robot.frame_index(self.frame), -1), eye, axis)

    def _targets(self, robot: Robot, q: Array) -> Array:
        return _shaped(self.target, "LookAtTask.target", 3)

    def _check(self, robot: Robot, q: Array) -> None:
        as_shaped(self.target, "LookAtTask.target", 3)


@dataclass(frozen=True, eq=False)
class ComTask(Task):
    """Bring the robot's centre of mass to *position* ``(..., 3)`` of the world: rows x, y, z."""

    position: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 1.0
    slot: ClassVar[slice] = slice(0, 3)

    def _key(self) -> Hashable:
        return ComTask, _hashable(self.weight), self.gain

    def _rows(self, robot: Robot) -> Rows:
        if not robot.model.inertia[:, 0].sum() > 0.0:
            raise InputError(f"robot {robot.name!r} has no mass: its centre of mass is undefined")
        return Rows(codes.COM, _weights(self.weight, 3, self.gain, "ComTask"), self.gain)

    def _targets(self, robot: Robot, q: Array) -> Array:
        return _shaped(self.position, "ComTask.position", 3)

    def _check(self, robot: Robot, q: Array) -> None:
        as_shaped(self.position, "ComTask.position", 3)


@dataclass(frozen=True, eq=False)
class RelativeTask(Task):
    """Bring *frame* to the pose *T* ``(..., 4, 4)`` relative to the frame *of*: six rows in the axes of *of*."""

    frame: str
    of: str
    T: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _key(self) -> Hashable:
        return RelativeTask, self.frame, self.of, _hashable(self.weight), self.gain

    def _rows(self, robot: Robot) -> Rows:
        w = _weights(self.weight, 6, self.gain, "RelativeTask")
        return Rows(codes.RELATIVE, w, self.gain, (robot.frame_index(self.of), robot.frame_index(self.frame)))

    def _targets(self, robot: Robot, q: Array) -> Array:
        return _pose(self.T, "RelativeTask.T")

    def _check(self, robot: Robot, q: Array) -> None:
        as_pose(self.T, "RelativeTask.T")


@dataclass(frozen=True, eq=False)
class PostureTask(Task):
    """Bring all joints to *q* ``(..., n)`` (G eq. 1.20: H = ‖θ − θ̄‖²); *weight* may be ``(n,)``."""

    q: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 0.1

    def _key(self) -> Hashable:
        return PostureTask, _hashable(self.weight), self.gain

    def _rows(self, robot: Robot) -> Rows:
        w = _weights(self.weight, robot.n, self.gain, "PostureTask")
        return Rows(codes.JOINTS, w, self.gain, pick=tuple(range(robot.n)))

    def _targets(self, robot: Robot, q: Array) -> Array:
        return _shaped(self.q, "PostureTask.q", robot.n)

    def _check(self, robot: Robot, q: Array) -> None:
        as_shaped(self.q, "PostureTask.q", robot.n)


@dataclass(frozen=True, eq=False)
class JointTask(Task):
    """Bring the joints *names* to *values* ``(..., k)``."""

    names: Sequence[str]
    values: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _key(self) -> Hashable:
        return JointTask, tuple(self.names), _hashable(self.weight), self.gain

    def _rows(self, robot: Robot) -> Rows:
        if isinstance(self.names, str):
            raise InputError(f"JointTask.names is {self.names!r}; expected a sequence of names, ({self.names!r},)")
        pick = tuple(robot.index(name) for name in self.names)
        w = _weights(self.weight, len(pick), self.gain, "JointTask")
        return Rows(codes.JOINTS, w, self.gain, pick=pick)

    def _targets(self, robot: Robot, q: Array) -> Array:
        values = _shaped(self.values, "JointTask.values", len(self.names))
        goal = np.zeros((values.shape[0], robot.n))
        goal[:, [robot.index(name) for name in self.names]] = values
        return goal

    def _check(self, robot: Robot, q: Array) -> None:
        as_shaped(self.values, "JointTask.values", len(self.names))


@dataclass(frozen=True, eq=False)
class DescentTask(Task):
    """Move down a cost: dq = −rate · ∇H (G eq. 1.21), as far as the tasks above leave freedom.

    *cost*: ``"limits"``, H = ½ Σ ((q − middle) / range)² over joints with limits; ``"manipulability"``, H = −log det
    (J Jᵀ)½ of *frame* (central differences); or a function that returns ∇H ``(N, n)`` for ``q (N, n)``.
    """

    cost: Any
    rate: float = 0.1
    frame: str | None = None

    def _key(self) -> Hashable:
        return DescentTask, self.cost if isinstance(self.cost, str) else callable(self.cost), self.rate, self.frame

    def _rows(self, robot: Robot) -> Rows:
        if self.cost == "manipulability":
            if self.frame is None:
                raise InputError("DescentTask.frame is missing; the manipulability is that of a frame")
        elif self.cost != "limits" and not callable(self.cost):
            unknown_name("cost", str(self.cost), ("limits", "manipulability"), "DescentTask (or give a function)")
        if not self.rate > 0.0:
            raise InputError(f"DescentTask.rate is {self.rate}; expected a positive number")
        return Rows(codes.DESCENT, np.ones(robot.n), 1.0, pick=tuple(range(robot.n)))

    def _targets(self, robot: Robot, q: Array) -> Array:
        if self.cost == "limits":
            return -self.rate * _limit_gradient(robot, q)
        if self.cost == "manipulability":
            return -self.rate * _manipulability_gradient(robot, q, str(self.frame))
        gradient = as_shaped(self.cost(q), "the gradient of DescentTask.cost", robot.n)
        return -self.rate * gradient.reshape(-1, robot.n)


def _limit_gradient(robot: Robot, q: Array) -> Array:
    lower, upper = robot.limits.lower, robot.limits.upper
    finite = np.isfinite(lower) & np.isfinite(upper) & (upper > lower)
    span = np.where(finite, upper - lower, 1.0)
    middle = np.where(finite, 0.5 * (np.where(finite, lower, 0.0) + np.where(finite, upper, 0.0)), 0.0)
    gradient: Array = np.where(finite, (q - middle) / span**2, 0.0)
    return gradient


def _manipulability_gradient(robot: Robot, q: Array, frame: str) -> Array:
    h = 1e-5
    free = list(robot.chain(frame))
    probes = np.repeat(q[:, None, :], 2 * len(free), axis=1)
    for i, c in enumerate(free):
        probes[:, 2 * i, c] += h
        probes[:, 2 * i + 1, c] -= h
    J = robot.jacobian(probes, frame)[..., free]
    gram = J @ np.swapaxes(J, -1, -2) if len(free) >= 6 else np.swapaxes(J, -1, -2) @ J
    value = -0.5 * np.log(np.maximum(np.linalg.det(gram), 1e-24))
    gradient = np.zeros_like(q)
    gradient[:, free] = (value[:, 0::2] - value[:, 1::2]) / (2.0 * h)
    return gradient
