"""`plan`: a collision-free path from a start to any of several goals."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_shaped
from ..collision import CollisionModel, Touch
from ..errors import InputError
from ..kernels import collide_edges, collide_plan
from ..kinematics import Robot
from .result import PlanResult, PlanStatus

STRIDE = 0.8
"""Largest step of a tree in joint space, in rad (and m)."""

WIDEST, LEAST = 0.45, 0.2
"""Bounds of a node's domain (see `kernels.collide_plan.grow`) relative to the diagonal of the joint space."""

MAX_NODES = 20_000
"""Largest number of nodes of one tree."""

FIRST_ROOM = 512
"""Nodes that a tree has room for at first."""

SHORTCUTS = 100
"""Random shortcuts that are tried on a path."""

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
    max_nodes: int = MAX_NODES,
) -> PlanResult:
    """A path from *start* ``(n,)`` to the nearest reachable of *goals* ``(n,)`` or ``(k, n)``.

    First a straight motion to each goal, the nearest first; then RRT-Connect from the start and all free goals at
    once, until a path is found or *time_limit* (s) is spent; then shortcuts. *joints* are the indices of the
    coordinates that may move; the others stay as in the start, whatever the goals say. Angles of joints without
    limits are taken modulo a turn. Every motion of the path was checked as `CollisionModel.edges_free` does.

    The same *rng* state gives the same path, unless the time runs out. Raises `InputError` for arrays of the wrong
    shape; whatever the numbers lead to is in the answer's status.
    """
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
    targets[:, ~moving] = q0[~moving]

    def answer(status: PlanStatus, **facts: object) -> PlanResult:
        return PlanResult(status, seconds=time.perf_counter() - began, **facts)  # type: ignore[arg-type]

    limits = robot.limits
    lower = np.where(moving, limits.lower, q0)
    upper = np.where(moving, limits.upper, q0)
    if not len(targets):
        return answer(PlanStatus.NO_GOAL)
    turning = np.flatnonzero(moving & (limits.lower == -np.inf) & (limits.upper == np.inf))
    if len(turning):
        way = targets[:, turning] - q0[turning]
        targets[:, turning] = q0[turning] + np.remainder(way + np.pi, 2.0 * np.pi) - np.pi
    both = np.concatenate([q0[None], targets])
    inside = np.clip(both, lower, upper)
    within = np.abs(both - inside).max(axis=1) <= LIMIT_SLACK
    if not within[0]:
        return answer(PlanStatus.START_OUT_OF_LIMITS, detail=f"{violated(robot, q0, lower, upper)}.")
    if not within[1:].any():
        worst = violated(robot, targets[0], lower, upper)
        return answer(PlanStatus.GOALS_OUT_OF_LIMITS, detail=f"Goal 0: {worst}.")
    free = within & model.free(inside)
    q0, targets = inside[0].copy(), inside[1:].copy()
    if not free[0]:
        touches = model.why(q0)
        return answer(PlanStatus.START_IN_COLLISION, detail=f"{'; '.join(map(str, touches[:3]))}.", touches=touches)
    usable = np.flatnonzero(free[1:])
    if not len(usable):
        return answer(PlanStatus.GOALS_IN_COLLISION, **_why_goals(model, targets, within[1:]))

    near = np.argsort(((targets[usable] - q0) ** 2).sum(axis=1), kind="stable")
    direct = first_direct(model, q0, targets, usable[near])
    if direct >= 0:
        path = np.stack([q0, targets[direct]]) if (targets[direct] != q0).any() else q0[None].copy()
        return answer(PlanStatus.SUCCESS, path=path, goal=direct)

    # joints without limits: half a turn around the start and the goals
    span = np.concatenate([q0[None], targets[usable]])
    low = np.where(np.isfinite(lower), lower, span.min(axis=0) - np.pi)
    high = np.where(np.isfinite(upper), upper, span.max(axis=0) + np.pi)
    search = Search(model, q0, targets[usable], max_nodes)
    while True:
        status = search.grow(rng, low, high)
        if status != collide_plan.MORE or time.perf_counter() - began > time_limit:
            break
    spent = {"nodes": int(search.count.sum()), "samples": search.samples}
    if status != collide_plan.CONNECTED:
        out_of = PlanStatus.NODES_SPENT if status == collide_plan.FULL else PlanStatus.TIME_SPENT
        a, b = search.count
        detail = (
            f"{time.perf_counter() - began:.2f} s and {search.samples} samples; the tree from the start has {a} nodes, "
            f"that from {len(usable)} free of {len(targets)} goals {b}."
        )
        return answer(out_of, detail=detail, **spent)
    path, root = search.path()
    if simplify:
        path = shortcut(model, path, rng=rng)
    return answer(PlanStatus.SUCCESS, path=path, goal=int(usable[root]), **spent)


def first_direct(model: CollisionModel, start: Array, goals: Array, order: IntArray) -> int:
    """The first of *goals* in *order* that a straight motion reaches, or −1."""
    starts = np.repeat(start[None], len(goals), axis=0)
    blocked = np.ones(len(goals), np.int64)
    limits = model.clearance, model.resolution
    collide_edges.edges(model.compiled, model.lanes, starts, goals, order, *limits, 0, len(order), blocked)
    free = order[blocked[order] == 0]
    return int(free[0]) if len(free) else -1


class Search:
    """Two growing trees."""

    def __init__(self, model: CollisionModel, start: Array, goals: Array, max_nodes: int):
        self.model = model
        self.most = max(max_nodes, len(goals) + 1)
        room = min(self.most, max(FIRST_ROOM, 2 * len(goals)))
        self.nodes = np.empty((2, room, len(start)))
        self.parent = np.full((2, room), -1, np.int64)
        self.domain = np.full((2, room), np.inf)
        self.count = np.array([1, len(goals)], np.int64)
        self.nodes[0, 0] = start
        self.nodes[1, : len(goals)] = goals
        self.samples = 0
        self.chunk = 64

    def grow(self, rng: np.random.Generator, lower: Array, upper: Array) -> int:
        """Try one more portion of random configurations."""
        samples = rng.uniform(lower, upper, (self.chunk, len(lower)))
        across = float(np.linalg.norm(upper - lower))
        status, used = collide_plan.grow(
            self.model.compiled, self.model.lanes,
            self.nodes, self.parent, self.domain, self.count,
            samples, STRIDE, WIDEST * across, LEAST * across, self.model.clearance, self.model.resolution,
        )  # fmt: skip
        self.samples += int(used)
        self.chunk = min(2 * self.chunk, 512)
        if status == collide_plan.FULL and self.nodes.shape[1] < self.most:
            self._make_room()
            return int(collide_plan.MORE)
        return int(status)

    def _make_room(self) -> None:
        old = self.nodes.shape[1]
        room = min(4 * old, self.most)
        nodes, parent = np.empty((2, room, self.nodes.shape[2])), np.full((2, room), -1, np.int64)
        domain = np.full((2, room), np.inf)
        nodes[:, :old], parent[:, :old], domain[:, :old] = self.nodes, self.parent, self.domain
        self.nodes, self.parent, self.domain = nodes, parent, domain

    def path(self) -> tuple[Array, int]:
        """The path through both trees once they meet, and the number of the goal that it reaches."""
        halves = []
        root = 0
        for k in (0, 1):
            row, rows = int(self.count[k]) - 1, []
            while row >= 0:
                rows.append(row)
                root = row
                row = int(self.parent[k, row])
            halves.append(self.nodes[k, rows])
        return np.concatenate([halves[0][::-1], halves[1][1:]]), root


def shortcut(model: CollisionModel, path: ArrayLike, *, rng: np.random.Generator, tries: int = SHORTCUTS) -> Array:
    """A shorter path ``(M', n)`` with the same ends: vertices are passed by and random shortcuts taken where free."""
    points = as_shaped(path, "path", model.robot.n)
    if points.ndim != 2 or not len(points):
        raise InputError(f"path has shape {points.shape}; expected (M, {model.robot.n})")
    if len(points) < 3:
        return points.copy()
    room = np.zeros((len(points) + 2 * tries + 2, model.robot.n))
    room[: len(points)] = points
    pairs = rng.uniform(size=(tries, 2))
    count = collide_plan.shortcut(
        model.compiled, model.lanes, room, len(points), pairs, model.clearance, model.resolution
    )
    return room[:count].copy()


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


def _why_goals(model: CollisionModel, targets: Array, within: BoolArray) -> dict[str, object]:
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
    return {"detail": f"{'; '.join(words[:4])}{more}.", "touches": first}
