"""`plan`: a collision-free path from a start to any of several goals."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_shaped
from ..collision import CollisionModel, Touch
from ..errors import InputError, expect
from ..kernels import collide_plan, plan_ends
from ..kinematics import Robot
from .constrained import ConstrainedSearch
from .constraints import PathConstraint
from .keeping import Constraints
from .result import PlanResult, PlanStatus
from .search import SHORTCUTS, Search, shortcut
from .smoothing import smooth as smoothed

MAX_NODES = 20_000
"""Largest number of nodes of one tree."""

LIMIT_SLACK = 1e-6
"""How far a given configuration may lie beyond a joint limit, in rad or m; it is moved onto the limit."""


def plan(
    model: CollisionModel,
    start: ArrayLike,
    goals: ArrayLike,
    *,
    rng: np.random.Generator,
    time_limit: float = 2.0,
    joints: Iterable[int] | None = None,
    simplify: bool = True,
    smooth: bool = False,
    max_nodes: int = MAX_NODES,
    constraints: Sequence[PathConstraint] = (),
) -> PlanResult:
    """A path from *start* ``(n,)`` to the nearest reachable of *goals* ``(n,)`` or ``(k, n)``.

    First a straight motion to each goal, the nearest first; then RRT-Connect from the start and all free goals at
    once, until a path is found or *time_limit* (s) is spent; then shortcuts (*simplify*) and rounded corners
    (*smooth*). *joints* are the indices of the coordinates that may move; the others stay as in the start, whatever
    the goals say. Angles of joints without limits are taken modulo a turn. Every motion of the path was checked as
    `CollisionModel.edges_free` does.

    *constraints* (`Upright`, `Inside`, `Turned`) hold all along the path, between its configurations, too: proven to
    1e-9 rad or m. Every new configuration is moved onto them; start and goals must keep them themselves.

    The same *rng* state gives the same path, unless the time runs out. Raises `InputError` for arrays of the wrong
    shape; whatever the numbers lead to is in the answer's status.
    """
    expect(model, "CollisionModel", "model")
    began = time.perf_counter()
    robot = model.robot
    q0 = as_shaped(start, "start", robot.n)
    if q0.ndim != 1:
        raise InputError(f"start has shape {q0.shape}; expected ({robot.n},)")
    targets = np.array(np.atleast_2d(as_shaped(goals, "goals", robot.n)))
    if targets.ndim != 2:
        raise InputError(f"goals have shape {targets.shape}; expected (k, {robot.n})")
    if not (math.isfinite(time_limit) and time_limit > 0.0):
        raise InputError(f"time_limit is {time_limit}; expected a positive number of seconds")
    moving = moving_joints(robot, joints)
    keep = Constraints(robot, constraints, moving) if constraints else None

    task = _task(model, q0, targets, moving, keep)
    if isinstance(task, PlanResult):
        return task.timed(time.perf_counter() - began)
    if task.reached >= 0:
        ends = np.stack([task.start, task.goals[task.reached]])
        path = ends if (ends[0] != ends[1]).any() else ends[:1]
        return PlanResult(PlanStatus.SUCCESS, path, task.reached, seconds=time.perf_counter() - began)
    until = time.perf_counter() + time_limit  # what was compiled until here does not count
    if keep is None:
        result = _free(model, task, rng, until, began, max_nodes, simplify)
    else:
        result = _on_constraints(model, task, keep, rng, until, began, max_nodes, simplify)
    if smooth and result.success:
        result = result.along(smoothed(model, result.path, constraints=constraints))
    return result.timed(time.perf_counter() - began)


class _Task(NamedTuple):
    """A start, goals of which those numbered *usable* are free, and where to draw samples."""

    start: Array
    goals: Array
    usable: IntArray
    low: Array
    high: Array
    reached: int
    """The nearest goal that a straight motion reaches, or −1."""


def _task(
    model: CollisionModel, q0: Array, targets: Array, moving: BoolArray, keep: Constraints | None
) -> _Task | PlanResult:
    """What is to be planned, or the reason why there is nothing to plan."""
    robot, limits = model.robot, model.robot.limits_model
    if not len(targets):
        return PlanResult(PlanStatus.NO_GOAL)
    ends = np.concatenate([q0[None], targets])
    state, box = np.empty(len(ends), np.int64), np.empty((2, robot.n))
    reached = plan_ends.look(
        model.compiled, model.lanes, ends, moving, limits.lower, limits.upper, LIMIT_SLACK, model.clearance,
        model.resolution, keep is None, state, box,
    )  # fmt: skip
    usable = np.flatnonzero(state[1:] == plan_ends.GOOD)
    if state[0] != plan_ends.GOOD or not len(usable):
        return _why_not(model, q0, targets, moving, ends, state)
    start, goals = ends[0], ends[1:]
    if keep is not None:
        if why := keep.why(start):
            return PlanResult(PlanStatus.START_OFF_CONSTRAINT, detail=f"{why}.")
        kept = keep.violation(goals[usable]) <= 0.0
        if not kept.any():
            first = int(usable[0])
            return PlanResult(PlanStatus.GOALS_OFF_CONSTRAINT, detail=f"Goal {first}: {keep.why(goals[first])}.")
        usable = usable[kept]
        reached = _direct(model, keep, start, goals, usable)
    return _Task(start, goals, usable, box[0], box[1], int(reached))


def _why_not(
    model: CollisionModel, q0: Array, targets: Array, moving: BoolArray, ends: Array, state: IntArray
) -> PlanResult:
    """Why the start or all of the goals cannot be used."""
    robot, limits = model.robot, model.robot.limits
    lower, upper = np.where(moving, limits.lower, q0), np.where(moving, limits.upper, q0)
    if state[0] == plan_ends.BEYOND:
        return PlanResult(PlanStatus.START_OUT_OF_LIMITS, detail=f"{violated(robot, q0, lower, upper)}.")
    within = state[1:] != plan_ends.BEYOND
    if not within.any():
        worst = violated(robot, np.where(moving, targets[0], q0), lower, upper)
        return PlanResult(PlanStatus.GOALS_OUT_OF_LIMITS, detail=f"Goal 0: {worst}.")
    if state[0] == plan_ends.BLOCKED:
        touches = model.why(ends[0])
        detail = f"{'; '.join(map(str, touches[:3]))}."
        return PlanResult(PlanStatus.START_IN_COLLISION, detail=detail, touches=touches)
    return _why_goals(model, ends[1:], within)


def _direct(model: CollisionModel, keep: Constraints, start: Array, goals: Array, usable: IntArray) -> int:
    """The nearest goal that a straight motion reaches and that keeps the constraints, or −1."""
    order = usable[np.argsort(((goals[usable] - start) ** 2).sum(axis=1), kind="stable")]
    starts = np.repeat(start[None], len(order), axis=0)
    free = order[keep.hold(starts, goals[order]) & model.edges_free(starts, goals[order])]
    return int(free[0]) if len(free) else -1


def _free(
    model: CollisionModel, task: _Task, rng: np.random.Generator, until: float, began: float, max_nodes: int,
    simplify: bool,
) -> PlanResult:  # fmt: skip
    """RRT-Connect, and shortcuts."""
    search = Search(model, task.start, task.goals[task.usable], max_nodes)
    while True:
        status = search.grow(rng, task.low, task.high)
        if status != collide_plan.MORE or time.perf_counter() - search.compiling > until:
            break
    a, b = (int(count) for count in search.count)
    if status != collide_plan.CONNECTED:
        return _spent(status == collide_plan.FULL, began, search.samples, (a, b), task)
    path, root = search.path()
    if simplify:
        path = shortcut(model, path, rng=rng)
    return PlanResult(PlanStatus.SUCCESS, path, int(task.usable[root]), nodes=a + b, samples=search.samples)


def _on_constraints(
    model: CollisionModel, task: _Task, keep: Constraints, rng: np.random.Generator, until: float, began: float,
    max_nodes: int, simplify: bool,
) -> PlanResult:  # fmt: skip
    """The same on constraints."""
    goals = task.goals[task.usable]
    search = ConstrainedSearch(model, keep, task.start, goals, task.low, task.high, max_nodes)
    found = search.solve(rng, until)
    a, b = (int(count) for count in search.count)
    if found is None:
        return _spent(search.full, began, search.samples, (a, b), task, f"; {search.told()}")
    path, root = found
    if simplify:
        path = search.shorten(path, rng, SHORTCUTS)
    return PlanResult(PlanStatus.SUCCESS, path, int(task.usable[root]), nodes=a + b, samples=search.samples)


def _spent(full: bool, began: float, samples: int, nodes: tuple[int, int], task: _Task, more: str = "") -> PlanResult:
    detail = (
        f"{time.perf_counter() - began:.2f} s and {samples} samples; the tree from the start has {nodes[0]} nodes, "
        f"that from {len(task.usable)} free of {len(task.goals)} goals {nodes[1]}{more}."
    )
    status = PlanStatus.NODES_SPENT if full else PlanStatus.TIME_SPENT
    return PlanResult(status, detail=detail, nodes=sum(nodes), samples=samples)


def moving_joints(robot: Robot, joints: Iterable[int] | None) -> BoolArray:
    """A mask (n,) of the coordinates in *joints* (None: all)."""
    mask = np.zeros(robot.n, bool)
    for j in range(robot.n) if joints is None else joints:
        if not 0 <= int(j) < robot.n:
            raise InputError(f"joints contains {j}; robot {robot.name!r} has coordinates 0 to {robot.n - 1}")
        mask[int(j)] = True
    if not mask.any():
        raise InputError("joints is empty; at least one coordinate must be allowed to move")
    return mask


def violated(robot: Robot, q: Array, lower: Array, upper: Array) -> str:
    """Which joint lies beyond its limits by more than `LIMIT_SLACK`, in words; empty: none."""
    beyond = np.maximum(lower - q, q - upper)
    j = int(np.argmax(beyond))
    if beyond[j] <= LIMIT_SLACK:
        return ""
    return f"{robot.joint_names[j]} is {q[j]:.4g}, limits {lower[j]:.4g} to {upper[j]:.4g}"


def _why_goals(model: CollisionModel, targets: Array, within: BoolArray) -> PlanResult:
    words: list[str] = []
    first: tuple[Touch, ...] = ()
    for k, target in enumerate(targets[:20]):
        if within[k]:
            touches = model.why(target)
            first = first or touches
            words.append(f"goal {k}: {touches[0] if touches else 'touching'}")
        else:
            words.append(f"goal {k}: joint limits")
    more = f"; and {len(words) - 4} more" if len(words) > 4 else ""
    return PlanResult(PlanStatus.GOALS_IN_COLLISION, detail=f"{'; '.join(words[:4])}{more}.", touches=first)
