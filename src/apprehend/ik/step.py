"""Differential inverse kinematics: one step of strictly prioritised tasks under exact limits, and tracking."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_pose, as_shaped
from ..errors import InputError
from ..kernels.ik_step import steps
from ..kernels.ik_tasks import TaskList
from ..kinematics import Robot
from ..parallel import over_ranges
from ..result import Result, Status
from .tasks import DescentTask, PoseTask, Rows, Task

GRAIN = 64
"""Smallest share of a batch that is worth a thread."""


@dataclass(frozen=True, eq=False)
class Program:
    """A list of tasks in the form of the kernels."""

    tasks: TaskList
    levels: IntArray
    data: Array  # (N or 1, T, 16)
    goal: Array  # (N or 1, T, n)


def assemble(robot: Robot, levels: Sequence[Task | Sequence[Task]], q: Array) -> Program:
    """Tasks in order of priority (an inner sequence shares one level) as arrays for ``q (N, n)``."""
    if not levels:
        raise InputError("tasks is empty; give at least one task")
    rows: list[Rows] = []
    first = [0]
    for level in levels:
        for task in _members(level):
            if not isinstance(task, Task):
                raise InputError(f"tasks holds {task!r}; expected tasks such as ik.PoseTask(frame, T)")
            rows.append(task._rows(robot, q))
        first.append(sum(r.weight.size for r in rows))
    count = q.shape[0]
    shared = all(r.data.shape[0] == 1 and (r.goal is None or r.goal.shape[0] == 1) for r in rows)
    size = 1 if shared else count
    data = np.empty((size, len(rows), 16))
    goal = np.zeros((size, len(rows), robot.n))
    for t, r in enumerate(rows):
        for value in (r.data, r.goal):
            if value is not None and value.shape[0] not in (1, count):
                raise InputError(
                    f"task {t} has a batch of {value.shape[0]} targets, but there are {count} joint vectors"
                )
        data[:, t] = r.data
        if r.goal is not None:
            goal[:, t] = r.goal
    pick = [c for r in rows for c in (r.pick or (0,) * r.weight.size)]
    tasks = TaskList(
        kind=np.array([r.kind for r in rows], dtype=np.int64),
        frame=np.array([r.frames for r in rows], dtype=np.int64),
        row=np.cumsum([0, *(r.weight.size for r in rows)], dtype=np.int64),
        point=np.array([r.point for r in rows]),
        axis=np.array([r.axis for r in rows]),
        weight=np.concatenate([r.weight for r in rows]),
        gain=np.array([r.gain for r in rows], dtype=np.float64),
        pick=np.array(pick, dtype=np.int64),
    )
    return Program(tasks, np.array(first, dtype=np.int64), data, goal)


class Stepper:
    """`step` prepared for many calls: ``stepper(q)`` returns dq; targets may be moved between calls.

    Reading and checking tasks costs more than solving them, so a control loop keeps one of these.
    """

    def __init__(
        self, robot: Robot, tasks: Sequence[Task | Sequence[Task]], dt: float, *, damping: float = 1e-3
    ) -> None:
        if not (math.isfinite(dt) and dt > 0.0):
            raise InputError(f"dt is {dt}; expected a positive time in seconds")
        if not (math.isfinite(damping) and damping >= 0.0):
            raise InputError(f"damping is {damping}; expected a number from 0 on")
        self.robot = robot
        self.dt = float(dt)
        self._levels = tasks
        self._damping = max(float(damping), 1e-7) ** 2
        self._program: Program | None = None
        self._depends = any(isinstance(t, DescentTask) for level in tasks for t in _members(level))
        self._no_limit = np.full(robot.n, np.inf)

    def retarget(self, number: int, task: Task) -> None:
        """Replace the targets of task *number* (in order, inner sequences counted through) by those of *task*."""
        program = self._program
        flat = [t for level in self._levels for t in _members(level)]
        if not 0 <= number < len(flat) or type(task) is not type(flat[number]):
            kinds = ", ".join(type(t).__name__ for t in flat)
            raise InputError(f"task {number} cannot become a {type(task).__name__}; the tasks are {kinds}")
        members = iter(range(len(flat)))
        self._levels = [
            [task if next(members) == number else t for t in _members(level)] for level in self._levels
        ]  # fmt: skip
        if program is not None and program.data.shape[0] == 1:
            rows = task._rows(self.robot, self.robot.home[None])
            if rows.data.shape[0] == 1 and (rows.goal is None or rows.goal.shape[0] == 1):
                program.data[:, number] = rows.data
                if rows.goal is not None:
                    program.goal[:, number] = rows.goal
                return
        self._program = None

    def __call__(self, q: ArrayLike, velocity: ArrayLike | None = None) -> Array:
        """The step dq ``(..., n)`` from ``q (..., n)``; *velocity*: see `step`."""
        robot = self.robot
        q = as_shaped(q, "q", robot.n)
        shape = q.shape
        rows = q.reshape(-1, robot.n)
        limits = robot.limits
        if (rows < limits.lower - 1e-9).any() or (rows > limits.upper + 1e-9).any():
            self._refuse(rows)
        if velocity is None:
            before, acceleration = rows, self._no_limit
        else:
            acceleration = limits.acceleration
            before = np.ascontiguousarray(np.broadcast_to(as_shaped(velocity, "velocity", robot.n), shape))
            before = before.reshape(-1, robot.n)
        if self._program is None or self._depends or self._program.data.shape[0] not in (1, rows.shape[0]):
            self._program = assemble(robot, self._levels, rows)
        program = self._program
        out = np.zeros(rows.shape)
        errors = np.empty((rows.shape[0], program.tasks.weight.size))

        def work(first: int, last: int) -> None:
            steps(
                robot.model, program.tasks, program.levels, program.data, program.goal, rows, before, limits.lower,
                limits.upper, limits.velocity, acceleration, self.dt, self._damping, first, last, out, errors,
            )  # fmt: skip

        over_ranges(work, rows.shape[0], GRAIN)
        return out.reshape(shape)

    def _refuse(self, rows: Array) -> None:
        limits = self.robot.limits
        over = (rows < limits.lower - 1e-9) | (rows > limits.upper + 1e-9)
        at, joint = (int(i) for i in np.argwhere(over)[0])
        raise InputError(
            f"q of joint {self.robot.joint_names[joint]!r} is {rows[at, joint]:.6g}, outside its limits "
            f"[{limits.lower[joint]:.6g}, {limits.upper[joint]:.6g}]; clip it with robot.limits.clip(q)"
        )


def _members(level: Task | Sequence[Task]) -> list[Task]:
    return [level] if isinstance(level, Task) else list(level)


def step(
    robot: Robot,
    q: ArrayLike,
    tasks: Sequence[Task | Sequence[Task]],
    dt: float,
    *,
    velocity: ArrayLike | None = None,
    damping: float = 1e-3,
) -> Array:
    """The joint step dq ``(..., n)`` for the next *dt* seconds from ``q (..., n)``: q + dq keeps all limits.

    *tasks* are in strict order of priority (Siciliano & Slotine 1991, G 1.8.2); tasks in one inner sequence share a
    level. Level k minimises ‖J_k dq − gain·e_k‖² + damping² ‖dq − dq_(k−1)‖² over the steps that keep the limits and
    leave J_i dq of all higher levels as they are. So a lower task never disturbs a higher one, and a joint at its
    limit is made up for by the others: both at once, which scaling or clipping the unlimited step cannot do.

    Limits: position always; velocity times *dt*; acceleration, where the robot has it and *velocity* ``(..., n)``, the
    velocity of the previous step, is given. Then every step also leaves room to brake in front of the position
    limits. Targets of the tasks may be batched like *q*. For many calls with the same tasks use `Stepper`.
    """
    return Stepper(robot, tasks, dt, damping=damping)(q, velocity)


class TrackStatus(Status):
    """How tracking a path of poses ended."""

    SUCCESS = "every pose of the path is reached within the tolerance, without a jump"
    LOST = "some poses of the path could not be reached on from the poses before them within the limits"


@dataclass(frozen=True, eq=False)
class TrackResult(Result):
    """Joint vectors ``q (M, n)`` along a path of M poses; ``residual (M, 2)`` in m and rad, ``reached (M,)``."""

    status: TrackStatus
    q: Array
    residual: Array
    reached: Any
    largest_step: float  # rad or m, between neighbours of q

    def explain(self) -> str:
        """One sentence; it names the first pose that was lost."""
        if self.status is TrackStatus.SUCCESS:
            return f"{self.status.value}; the largest joint step is {self.largest_step:.3g}"
        at = int(np.flatnonzero(~self.reached)[0])
        distance, angle = self.residual[at]
        return f"{self.status.value}: the first is pose {at} of {len(self.q)}, off by {distance:.3g} m, {angle:.3g} rad"


def track(
    robot: Robot,
    T: ArrayLike,
    frame: str,
    q0: ArrayLike,
    dt: float = 0.01,
    *,
    tasks: Sequence[Task | Sequence[Task]] = (),
    tolerance: float = 1e-6,
    max_steps: int = 50,
) -> TrackResult:
    """Follow the poses ``T (M, 4, 4)`` with *frame* from *q0* ``(n,)``, without a change of branch.

    Every pose is approached by `step` from the joint vector of the one before, with the velocity limits times *dt*
    bounding each of up to *max_steps* steps; *tasks* come below in priority (a posture, say). The branch cannot
    change, since every motion is a continuous one that keeps the limits.
    """
    T = as_pose(T, "T")
    if T.ndim != 3:
        raise InputError(f"T has shape {T.shape}; expected a path (M, 4, 4)")
    if not tolerance > 0.0:
        raise InputError(f"tolerance is {tolerance}; expected a positive number")
    q = as_shaped(q0, "q0", robot.n).copy()
    if q.ndim != 1:
        raise InputError(f"q0 has shape {q.shape}; expected ({robot.n},)")
    path = np.empty((T.shape[0], robot.n))
    stepper = Stepper(robot, [PoseTask(frame, T[:1]), *tasks], dt)
    residual = np.empty((T.shape[0], 2))
    for i, pose in enumerate(T):
        if i:
            stepper.retarget(0, PoseTask(frame, pose))
        for _ in range(max_steps):
            residual[i] = _gap(robot.fk(q, frame), pose)
            if (residual[i] <= tolerance).all():
                break
            q = robot.limits.clip(q + stepper(q))
        else:
            residual[i] = _gap(robot.fk(q, frame), pose)
        path[i] = q
    reached = (residual <= tolerance).all(axis=1)
    jump = float(np.abs(np.diff(path, axis=0)).max(initial=0.0))
    status = TrackStatus.SUCCESS if reached.all() else TrackStatus.LOST
    return TrackResult(status, path, residual, reached, jump)


def _gap(X: Array, T: Array) -> tuple[float, float]:
    R = X[:3, :3] @ T[:3, :3].T
    sine = math.hypot(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    return float(np.linalg.norm(X[:3, 3] - T[:3, 3])), math.atan2(sine, float(np.trace(R)) - 1.0)
