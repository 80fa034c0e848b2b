"""Differential inverse kinematics: one step of strictly prioritised tasks under exact limits, and tracking."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_array, as_pose, as_shaped, spread
from ..errors import InputError, expect
from ..kernels.ik_faults import OUTSIDE
from ..kernels.ik_step import steps
from ..kernels.ik_tasks import JOINTS, TaskList
from ..kinematics import Robot
from ..parallel import over_ranges
from ..result import Result, Status
from .tasks import DescentTask, PoseTask, Rows, Task

GRAIN = 64
"""Smallest share of a batch that is worth a thread."""


@dataclass(frozen=True, eq=False)
class Structure:
    """A list of tasks without their targets, in the form of the kernels."""

    tasks: TaskList
    kept: IntArray  # rows with a weight
    levels: IntArray  # first of these rows of every level, and the end
    blank: Array  # (1, T, 16)


@dataclass(frozen=True, eq=False)
class Program:
    """A list of tasks with their targets."""

    structure: Structure
    data: Array  # (N or 1, T, 16)
    goal: Array  # (N or 1, T, n)

    @property
    def tasks(self) -> TaskList:
        """The tasks without their targets."""
        return self.structure.tasks


Levels = Sequence[Task | Sequence[Task]]
_structures: WeakKeyDictionary[Robot, dict[Any, Structure]] = WeakKeyDictionary()
KEPT = 64
"""Lists of tasks that are remembered for every robot."""


def _listed(tasks: Levels) -> Levels:
    if isinstance(tasks, Task):
        raise InputError(f"tasks is one {type(tasks).__name__}; expected a sequence, in order of priority: [task]")
    return tasks


def _members(level: Task | Sequence[Task]) -> Sequence[Task]:
    members = (level,) if isinstance(level, Task) else level
    for task in members:
        if not isinstance(task, Task):
            raise InputError(f"tasks holds {task!r}; expected tasks such as ik.PoseTask(frame, T)")
    return members


def structure_of(robot: Robot, levels: Sequence[Sequence[Task]]) -> Structure:
    """The tasks without their targets, checked when a list of this kind is first seen."""
    key = tuple([tuple([task._key() for task in level]) for level in levels])
    known = _structures.get(robot)
    if known is None:
        known = _structures[robot] = {}
    found = known.get(key)
    if found is None:
        if len(known) >= KEPT:
            known.clear()
        found = known[key] = _build(robot, levels)
    return found


def _build(robot: Robot, levels: Sequence[Sequence[Task]]) -> Structure:
    if not any(levels):
        raise InputError("tasks is empty; give at least one task")
    rows: list[Rows] = []
    first = [0]
    for level in levels:
        rows.extend(task._rows(robot) for task in level)
        first.append(sum(int((r.weight > 0.0).sum()) for r in rows))
    weight = np.concatenate([r.weight for r in rows])
    tasks = TaskList(
        kind=np.array([r.kind for r in rows], dtype=np.int64),
        frame=np.array([r.frames for r in rows], dtype=np.int64),
        row=np.cumsum([0, *(r.weight.size for r in rows)], dtype=np.int64),
        point=np.array([r.point for r in rows]),
        axis=np.array([r.axis for r in rows]),
        weight=weight,
        gain=np.array([r.gain for r in rows], dtype=np.float64),
        pick=np.array([c for r in rows for c in (r.pick or (0,) * r.weight.size)], dtype=np.int64),
    )
    blank = np.array([[np.zeros(16) if r.blank is None else r.blank for r in rows]])
    return Structure(tasks, np.flatnonzero(weight > 0.0), np.array(first, dtype=np.int64), blank)


def assemble(robot: Robot, levels: Levels, q: Array) -> Program:
    """Tasks in order of priority (an inner sequence shares one level) as arrays for ``q (N, n)``."""
    lists = [_members(level) for level in _listed(levels)]
    structure = structure_of(robot, lists)
    targets = [task._targets(robot, q) for level in lists for task in level]
    count = q.shape[0]
    size = 1
    for t, target in enumerate(targets):
        if target.shape[0] != 1:
            if target.shape[0] != count:
                raise InputError(
                    f"task {t} has a batch of {target.shape[0]} targets, but there are {count} joint vectors"
                )
            size = count
    data = structure.blank.repeat(size, axis=0)
    goal = np.zeros((size, len(targets), robot.n))
    t = 0
    for level in lists:
        for task in level:
            if structure.tasks.kind[t] < JOINTS:
                data[:, t, task.slot] = targets[t]
            else:
                goal[:, t] = targets[t]
            t += 1
    return Program(structure, data, goal)


def _advance(robot: Robot, levels: Levels, program: Program, q: ArrayLike, velocity: ArrayLike | None, dt: float,
             damping: float) -> Array:  # fmt: skip
    """The step from q."""
    rows, shape = _joint_vectors(robot, q)
    limits = robot.limits_model
    before, acceleration = rows, np.full(robot.n, np.inf)
    if velocity is not None:
        acceleration = limits.acceleration
        given = as_shaped(velocity, "velocity", robot.n)
        try:
            before = spread(given, shape).reshape(-1, robot.n)
        except ValueError:
            raise InputError(f"velocity has shape {given.shape}; expected {shape}, as q") from None
    out = np.empty(rows.shape)
    fault = np.zeros(1, dtype=np.int64)
    model, structure = robot.model, program.structure

    def work(first: int, last: int) -> None:
        steps(
            model, structure.tasks, structure.kept, structure.levels, program.data, program.goal, rows, before,
            limits.lower, limits.upper, limits.velocity, acceleration, dt, damping, first, last, out, fault,
        )  # fmt: skip

    over_ranges(work, rows.shape[0], GRAIN)
    if fault[0]:
        _refuse(robot, levels, rows, int(fault[0]))
    return out.reshape(shape)


def _joint_vectors(robot: Robot, q: ArrayLike) -> tuple[Array, tuple[int, ...]]:
    """``q (..., n)`` as rows ``(N, n)``, and its shape; the numbers are looked at by the kernel."""
    array = np.asarray(q, dtype=np.float64, order="C") if isinstance(q, np.ndarray) else as_array(q, "q", finite=False)
    if not array.flags.writeable:
        array = array.copy()  # kernels would be compiled a second time for read-only arrays
    if array.ndim == 0 or array.shape[-1] != robot.n:
        as_shaped(array, "q", robot.n)
    return array.reshape(-1, robot.n), array.shape


def _refuse(robot: Robot, levels: Levels, rows: Array, fault: int) -> None:
    """Say what is wrong with the joint vectors, or with a task's targets."""
    if fault > 0:
        task = [t for level in levels for t in _members(level)][fault - 1]
        task._check(robot, rows)
        raise InputError(f"the targets of task {fault - 1}, a {type(task).__name__}, are not valid")
    as_array(rows, "q")
    limits = robot.limits
    over = (rows < limits.lower - OUTSIDE) | (rows > limits.upper + OUTSIDE)
    at, joint = (int(i) for i in np.argwhere(over)[0])
    raise InputError(
        f"q of joint {robot.joint_names[joint]!r} is {rows[at, joint]:.6g}, outside its limits "
        f"[{limits.lower[joint]:.6g}, {limits.upper[joint]:.6g}]; clip it with robot.limits.clip(q)"
    )


def _settings(dt: float, damping: float) -> tuple[float, float]:
    """The time step, and the square of the damping."""
    if not (math.isfinite(dt) and dt > 0.0):
        raise InputError(f"dt is {dt}; expected a positive time in seconds")
    if not (math.isfinite(damping) and damping >= 0.0):
        raise InputError(f"damping is {damping}; expected a number from 0 on")
    return float(dt), max(float(damping), 1e-7) ** 2


class Stepper:
    """`step` prepared for many calls with the same tasks: ``stepper(q)`` returns dq.

    Targets are read once; `retarget` moves those of one task.
    """

    def __init__(self, robot: Robot, tasks: Levels, dt: float, *, damping: float = 1e-3) -> None:
        self.robot = robot
        self.dt, self._damping = _settings(dt, damping)
        self._levels = [[task._held() for task in _members(level)] for level in _listed(tasks)]
        structure_of(robot, self._levels)
        self._depends = any(isinstance(t, DescentTask) for level in self._levels for t in level)
        self._program: Program | None = None

    def retarget(self, number: int, task: Task) -> None:
        """Replace the targets of task *number* (in order, inner sequences counted through) by those of *task*."""
        places = [(level, i) for level in self._levels for i in range(len(level))]
        if not 0 <= number < len(places) or type(task) is not type(places[number][0][places[number][1]]):
            kinds = ", ".join(type(level[i]).__name__ for level, i in places)
            raise InputError(f"task {number} cannot become a {type(task).__name__}; the tasks are {kinds}")
        level, i = places[number]
        level[i] = task._held()
        self._program = None

    def __call__(self, q: ArrayLike, velocity: ArrayLike | None = None) -> Array:
        """The step dq ``(..., n)`` from ``q (..., n)``; *velocity*: see `step`."""
        rows, _ = _joint_vectors(self.robot, q)
        if self._program is None or self._depends or self._program.data.shape[0] not in (1, rows.shape[0]):
            self._program = assemble(self.robot, self._levels, rows)
        return _advance(self.robot, self._levels, self._program, q, velocity, self.dt, self._damping)


def step(
    robot: Robot,
    q: ArrayLike,
    tasks: Levels,
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
    limits. Targets of the tasks may be batched like *q*. What does not change with the targets is kept between calls.
    """
    expect(robot, "Robot", "robot")
    dt, square = _settings(dt, damping)
    program = assemble(robot, tasks, _joint_vectors(robot, q)[0])
    return _advance(robot, tasks, program, q, velocity, dt, square)


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
    tasks: Levels = (),
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
