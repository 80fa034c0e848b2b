"""Two trees that grow on a constraint: every new configuration is moved onto it (CBiRRT2; Berenson et al. 2011).

Every motion is proven to keep the constraints (`constrain_hold`) and to be free (`lane_edges`). Trees are
``nodes (2, C, n)`` with ``parent (2, C)`` (−1: a root), filled up to ``count (2,)``. Random numbers come in from the
caller, so that the same generator gives the same path.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .collide_plan import CONNECTED, FULL, MORE, PATIENCE, length, nearest_node, point_at
from .constrain import constrain_space, project_one
from .constrain_hold import holds
from .lane_edges import edge_blocked, edge_space

REACHED, STOPPED, NO_ROOM = 0, 1, 2

KEPT, BLOCKED, LEFT = 0, 1, 2
"""What is counted: motions that are kept, that hit something, that leave the constraints."""

NEARER = 0.25  # of a step, by which it must come nearer to where it goes

LEAP = 8  # vertices that a straight motion may pass by at once


class Task(NamedTuple):
    """What trees grow in."""

    exact: tuple
    lanes: tuple
    keep: tuple
    lower: np.ndarray  # (n,)
    upper: np.ndarray  # (n,)
    scale: np.ndarray  # (4,): longest and shortest step, clearance, resolution


@kernel(borrow=True)
def passes(task, qa, qb, edge, space, tally):
    """What becomes of the straight motion ``qa → qb``: `KEPT`, `BLOCKED` or `LEFT`."""
    outcome = KEPT
    if not holds(task.keep, qa, qb, space):
        outcome = LEFT
    elif edge_blocked(task.exact, task.lanes, qa, qb, task.scale[2], task.scale[3], edge):
        outcome = BLOCKED
    tally[outcome] += 1
    return outcome


@kernel(borrow=True)
def distance(a, b):
    """Between two configurations."""
    total = 0.0
    for j in range(a.shape[0]):
        total += (a[j] - b[j]) ** 2
    return math.sqrt(total)


@kernel(borrow=True)
def reach(task, nodes, parent, count, row, goal, edge, space, tally):
    """Grow from node *row* towards *goal*, step by step on the constraint: ``(new count, last node, outcome)``.

    Steps that leave the constraint are halved, and doubled again where they succeed.
    """
    stride, n = task.scale[0], goal.shape[0]
    while count < nodes.shape[0]:
        here, there = nodes[row], nodes[count]
        far = distance(here, goal)
        if far == 0.0:
            return count, row, REACHED
        last = far <= stride
        if last:
            for j in range(n):
                there[j] = goal[j]
            outcome = passes(task, here, there, edge, space, tally)
        else:
            for j in range(n):
                there[j] = here[j] + stride / far * (goal[j] - here[j])
            if (
                not project_one(task.keep, there, task.lower, task.upper, space)
                or distance(there, goal) > far - NEARER * stride
                or distance(there, here) > 2.0 * stride
            ):
                outcome = LEFT
            else:
                outcome = passes(task, here, there, edge, space, tally)
        if outcome == KEPT:
            parent[count] = row
            row = count
            count += 1
            if last:
                return count, row, REACHED
            stride = min(2.0 * stride, task.scale[0])
        elif outcome == LEFT and 0.5 * min(stride, far) >= task.scale[1]:
            stride = 0.5 * min(stride, far)
        else:
            return count, row, STOPPED
    return count, row, NO_ROOM


@kernel
def grow(task, nodes, parent, count, samples, tally):
    """Grow both trees with the configurations of ``samples (S, n)``, the smaller tree first.

    Returns ``(status, samples used, last node of either tree)``; when connected, these two are the same configuration.
    """
    n = samples.shape[1]
    edge, space = edge_space(task.exact, task.lanes, n), constrain_space(task.keep, n)
    target = np.empty(n)
    for s in range(samples.shape[0]):
        one = 0 if count[0] <= count[1] else 1
        other = 1 - one
        for j in range(n):
            target[j] = samples[s, j]
        row, _ = nearest_node(nodes[one], count[one], target)
        count[one], row, outcome = reach(task, nodes[one], parent[one], count[one], row, target, edge, space, tally)
        if outcome == NO_ROOM:
            return FULL, s + 1, 0, 0
        for j in range(n):
            target[j] = nodes[one, row, j]
        met, _ = nearest_node(nodes[other], count[other], target)
        count[other], met, outcome = reach(
            task, nodes[other], parent[other], count[other], met, target, edge, space, tally
        )
        if outcome == REACHED:
            return CONNECTED, s + 1, row if one == 0 else met, met if one == 0 else row
        if outcome == NO_ROOM:
            return FULL, s + 1, 0, 0
    return MORE, samples.shape[0], 0, 0


@kernel(borrow=True)
def thin(task, path, count, edge, space, tally):
    """Drop vertices that a straight motion can pass by, the farthest leaps first; the new count."""
    n = path.shape[1]
    i, kept = 0, 1
    while i < count - 1:
        k = min(count - 1, i + LEAP)
        while k > i + 1 and passes(task, path[kept - 1], path[k], edge, space, tally) != KEPT:
            k -= 1
        for j in range(n):
            path[kept, j] = path[k, j]
        kept += 1
        i = k
    return kept


@kernel
def shorten(task, path, count, samples, tally):
    """Shorten ``path (C, n)`` of *count* vertices in place with pairs of random places ``samples (S, 2)`` in 0 … 1.

    Ways on the constraint from one place to the other replace what lies between where they are shorter. The new count.
    """
    n = path.shape[1]
    edge, space = edge_space(task.exact, task.lanes, n), constrain_space(task.keep, n)
    way, rest, parent = np.empty_like(path), np.empty_like(path), np.zeros(path.shape[0], np.int64)
    b = np.empty(n)
    count = thin(task, path, count, edge, space, tally)
    vain = 0
    for s in range(samples.shape[0]):
        vain += 1
        if count < 3 or vain > PATIENCE:
            break
        total = length(path, 0, count - 1)
        low = min(samples[s, 0], samples[s, 1]) * total
        high = max(samples[s, 0], samples[s, 1]) * total
        i = point_at(path, count, low, way[0])
        k = point_at(path, count, high, b)
        if i == k:
            continue
        new, _, outcome = reach(task, way, parent, 1, 0, b, edge, space, tally)
        if outcome != REACHED or length(way, 0, new - 1) > (high - low) * (1.0 - 1e-3):
            continue
        tail = count - (k + 1)
        if i + 1 + new + tail > path.shape[0]:
            continue
        vain = 0
        for r in range(tail):
            for j in range(n):
                rest[r, j] = path[k + 1 + r, j]
        for r in range(new):
            for j in range(n):
                path[i + 1 + r, j] = way[r, j]
        for r in range(tail):
            for j in range(n):
                path[i + 1 + new + r, j] = rest[r, j]
        count = i + 1 + new + tail
    return thin(task, path, count, edge, space, tally)
