"""Tasks for `step`: what a frame, a joint or the centre of mass shall do. Plain values, checked when used.

Every task has a *gain*, the share of its error that one step is asked to remove, and a *weight*, a number or one per
row; a weight of zero leaves a row out (a partial pose).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_pose, as_shaped, check_rotation
from ..errors import InputError, unknown_name
from ..kernels import ik_tasks as codes
from ..kinematics import Robot

Z_AXIS = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Rows:
    """A task in the form of the kernels: one entry of `kernels.ik_tasks.TaskList`, with its targets."""

    kind: int
    weight: Array
    gain: float
    frames: tuple[int, int] = (-1, -1)
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = Z_AXIS
    pick: tuple[int, ...] = ()
    data: Array = field(default_factory=lambda: np.zeros((1, 16)))  # (N or 1, 16)
    goal: Array | None = None  # (N or 1, n)


@dataclass(frozen=True, eq=False)
class Task:
    """Base of the tasks."""

    def _rows(self, robot: Robot, q: Array) -> Rows:
        """The task for *robot* in the form of the kernels; *q* ``(N, n)`` for tasks that depend on it."""
        raise NotImplementedError


def _flat(value: Array, *tail: int) -> Array:
    return value.reshape(-1, *tail)


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
    return float(v[0]), float(v[1]), float(v[2])


def _pose_data(T: Array) -> Array:
    T = _flat(T, 4, 4)
    data = np.zeros((T.shape[0], 16))
    data[:, :9] = T[:, :3, :3].reshape(-1, 9)
    data[:, 9:12] = T[:, :3, 3]
    return data


@dataclass(frozen=True, eq=False)
class PoseTask(Task):
    """Bring *frame* to the pose *T* ``(..., 4, 4)``: rows x, y, z, then about x, y, z, in the axes of the target."""

    frame: str
    T: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _rows(self, robot: Robot, q: Array) -> Rows:
        T = as_pose(self.T, "PoseTask.T")
        w = _weights(self.weight, 6, self.gain, "PoseTask")
        return Rows(codes.POSE, w, self.gain, (robot.frame_index(self.frame), -1), data=_pose_data(T))


@dataclass(frozen=True, eq=False)
class PositionTask(Task):
    """Bring *point* (in *frame*) to *position* ``(..., 3)`` of the world: rows x, y, z."""

    frame: str
    position: ArrayLike
    point: ArrayLike = (0.0, 0.0, 0.0)
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _rows(self, robot: Robot, q: Array) -> Rows:
        p = _flat(as_shaped(self.position, "PositionTask.position", 3), 3)
        data = np.zeros((p.shape[0], 16))
        data[:, [0, 4, 8]] = 1.0
        data[:, 9:12] = p
        point = as_shaped(self.point, "PositionTask.point", 3)
        w = _weights(self.weight, 3, self.gain, "PositionTask")
        return Rows(codes.POSITION, w, self.gain, (robot.frame_index(self.frame), -1), _three(point), data=data)


@dataclass(frozen=True, eq=False)
class OrientationTask(Task):
    """Turn *frame* to the rotation *R* ``(..., 3, 3)``: rows about x, y, z of the target."""

    frame: str
    R: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _rows(self, robot: Robot, q: Array) -> Rows:
        R = as_shaped(self.R, "OrientationTask.R", 3, 3)
        check_rotation(R, "OrientationTask.R")
        R = _flat(R, 9)
        data = np.zeros((R.shape[0], 16))
        data[:, :9] = R
        w = _weights(self.weight, 3, self.gain, "OrientationTask")
        return Rows(codes.ORIENTATION, w, self.gain, (robot.frame_index(self.frame), -1), data=data)


@dataclass(frozen=True, eq=False)
class DirectionTask(Task):
    """Point *axis* (of *frame*) along *direction* ``(..., 3)`` of the world: two rows; the turn about it is free."""

    frame: str
    direction: ArrayLike
    axis: ArrayLike = Z_AXIS
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _rows(self, robot: Robot, q: Array) -> Rows:
        d = _flat(_unit(self.direction, "DirectionTask.direction"), 3)
        data = np.zeros((d.shape[0], 16))
        data[:, :3] = d
        axis = _three(_unit(self.axis, "DirectionTask.axis"))
        w = _weights(self.weight, 2, self.gain, "DirectionTask")
        return Rows(codes.DIRECTION, w, self.gain, (robot.frame_index(self.frame), -1), axis=axis, data=data)


@dataclass(frozen=True, eq=False)
class LookAtTask(Task):
    """Point the ray from *eye* along *axis* (both in *frame*) at *target* ``(..., 3)`` of the world: two rows."""

    frame: str
    target: ArrayLike
    axis: ArrayLike = Z_AXIS
    eye: ArrayLike = (0.0, 0.0, 0.0)
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _rows(self, robot: Robot, q: Array) -> Rows:
        p = _flat(as_shaped(self.target, "LookAtTask.target", 3), 3)
        data = np.zeros((p.shape[0], 16))
        data[:, :3] = p
        axis = _three(_unit(self.axis, "LookAtTask.axis"))
        eye = _three(as_shaped(self.eye, "LookAtTask.eye", 3))
        w = _weights(self.weight, 2, self.gain, "LookAtTask")
        return Rows(codes.LOOK_AT, w, self.gain, (robot.frame_index(self.frame), -1), eye, axis, data=data)


@dataclass(frozen=True, eq=False)
class ComTask(Task):
    """Bring the robot's centre of mass to *position* ``(..., 3)`` of the world: rows x, y, z."""

    position: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _rows(self, robot: Robot, q: Array) -> Rows:
        p = _flat(as_shaped(self.position, "ComTask.position", 3), 3)
        if not robot.model.inertia[:, 0].sum() > 0.0:
            raise InputError(f"robot {robot.name!r} has no mass: its centre of mass is undefined")
        data = np.zeros((p.shape[0], 16))
        data[:, :3] = p
        return Rows(codes.COM, _weights(self.weight, 3, self.gain, "ComTask"), self.gain, data=data)


@dataclass(frozen=True, eq=False)
class RelativeTask(Task):
    """Bring *frame* to the pose *T* ``(..., 4, 4)`` relative to the frame *of*: six rows in the axes of *of*."""

    frame: str
    of: str
    T: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _rows(self, robot: Robot, q: Array) -> Rows:
        T = as_pose(self.T, "RelativeTask.T")
        w = _weights(self.weight, 6, self.gain, "RelativeTask")
        frames = (robot.frame_index(self.of), robot.frame_index(self.frame))
        return Rows(codes.RELATIVE, w, self.gain, frames, data=_pose_data(T))


@dataclass(frozen=True, eq=False)
class PostureTask(Task):
    """Bring all joints to *q* ``(..., n)`` (G eq. 1.20: H = ‖θ − θ̄‖²); *weight* may be ``(n,)``."""

    q: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 0.1

    def _rows(self, robot: Robot, q: Array) -> Rows:
        goal = _flat(as_shaped(self.q, "PostureTask.q", robot.n), robot.n)
        w = _weights(self.weight, robot.n, self.gain, "PostureTask")
        return Rows(codes.JOINTS, w, self.gain, pick=tuple(range(robot.n)), goal=goal)


@dataclass(frozen=True, eq=False)
class JointTask(Task):
    """Bring the joints *names* to *values* ``(..., k)``."""

    names: tuple[str, ...]
    values: ArrayLike
    weight: ArrayLike = 1.0
    gain: float = 1.0

    def _rows(self, robot: Robot, q: Array) -> Rows:
        pick = tuple(robot.index(name) for name in self.names)
        values = _flat(as_shaped(self.values, "JointTask.values", len(pick)), len(pick))
        goal = np.zeros((values.shape[0], robot.n))
        goal[:, list(pick)] = values
        w = _weights(self.weight, len(pick), self.gain, "JointTask")
        return Rows(codes.JOINTS, w, self.gain, pick=pick, goal=goal)


@dataclass(frozen=True, eq=False)
class DescentTask(Task):
    """Move down a cost: dq = −rate · ∇H (G eq. 1.21), as far as the tasks above leave freedom.

    *cost*: ``"limits"``, H = ½ Σ ((q − middle) / range)² over joints with limits; ``"manipulability"``, H = −log det
    (J Jᵀ)½ of *frame* (central differences); or a function that returns ∇H ``(N, n)`` for ``q (N, n)``.
    """

    cost: Any
    rate: float = 0.1
    frame: str | None = None

    def _rows(self, robot: Robot, q: Array) -> Rows:
        if self.cost == "limits":
            gradient = _limit_gradient(robot, q)
        elif self.cost == "manipulability":
            if self.frame is None:
                raise InputError("DescentTask.frame is missing; the manipulability is that of a frame")
            gradient = _manipulability_gradient(robot, q, self.frame)
        elif callable(self.cost):
            gradient = _flat(as_shaped(self.cost(q), "the gradient of DescentTask.cost", robot.n), robot.n)
        else:
            unknown_name("cost", str(self.cost), ("limits", "manipulability"), "DescentTask (or give a function)")
        if not self.rate > 0.0:
            raise InputError(f"DescentTask.rate is {self.rate}; expected a positive number")
        goal = -self.rate * gradient
        return Rows(codes.DESCENT, np.ones(robot.n), 1.0, pick=tuple(range(robot.n)), goal=goal)


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
