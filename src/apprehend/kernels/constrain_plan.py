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
from .collide_plan import CONNECTED, FULL, MORE, PATIENCE, SHRINK, length, nearest_node, point_at
from .constrain import constrain_space, project_one
from .constrain_hold import holds
from .lane_edges import edge_blocked, edge_space

REACHED, STOPPED, NO_ROOM = 0, 1, 2

KEPT, BLOCKED, LEFT = 0, 1, 2
"""What becomes of a step: it is kept, it hits something, it leaves the constraints; counted in ``tally (3,)``."""

NEARER = 0.25  # of a step, by which it must come nearer to where it goes

LEAP = 8  # vertices that a straight motion may pass by at once


class Task(NamedTuple):
    """What trees grow in."""

    exact: tuple
    lanes: tuple
    keep: tuple
    lower: np.ndarray  # (n,)
    upper: np.ndarray  # (n,)
    scale: np.ndarray  # (6,): longest and shortest step, clearance, resolution, widest and least domain


@kernel(borrow=True)
def distance(a, b):
    """Between two configurations."""
    total = 0.0
    for j in range(a.shape[0]):
        total += (a[j] - b[j]) ** 2
    return math.sqrt(total)


@kernel(inline=True)
def passes(task, qa, qb, edge, space):
    """What becomes of the straight motion ``qa → qb``: `KEPT`, `BLOCKED` or `LEFT`."""
    outcome = LEFT
    if holds(task.keep, qa, qb, space):
        outcome = KEPT
        if edge_blocked(task.exact, task.lanes, qa, qb, task.scale[2], task.scale[3], edge):
            outcome = BLOCKED
    return outcome


@kernel(borrow=True)
def step_towards(task, here, goal, far, stride, there, space):
    """A configuration *there* on the constraint, a step nearer to *goal*; whether there is one."""
    if far <= stride:
        for j in range(goal.shape[0]):
            there[j] = goal[j]
        return True
    for j in range(goal.shape[0]):
        there[j] = here[j] + stride / far * (goal[j] - here[j])
    return (
        project_one(task.keep, there, task.lower, task.upper, space)
        and distance(there, goal) <= far - NEARER * stride
        and distance(there, here) <= 2.0 * stride
    )


@kernel(inline=True)
def reach(task, nodes, parent, count, row, goal, edge, space, tally):
    """Grow from node *row* towards *goal*, step by step on the constraint: ``(new count, last node, outcome)``.

    Steps that leave the constraint are halved, and doubled again where they succeed.
    """
    stride = task.scale[0]
    far = distance(nodes[row], goal)
    ended = NO_ROOM if far > 0.0 else REACHED
    while count < nodes.shape[0] and far > 0.0:
        outcome = LEFT
        if step_towards(task, nodes[row], goal, far, stride, nodes[count], space):
            outcome = passes(task, nodes[row], nodes[count], edge, space)
        tally[outcome] += 1
        stride = min(stride, far)
        if outcome == KEPT:
            parent[count] = row
            row = count
            count += 1
            far = distance(nodes[row], goal)
            stride = min(2.0 * stride, task.scale[0])
            if far == 0.0:
                ended = REACHED
        elif outcome == LEFT and 0.5 * stride >= task.scale[1]:
            stride *= 0.5
        else:
            ended = STOPPED
            break
    return count, row, ended


@kernel(inline=True)
def grow(task, nodes, parent, domain, count, samples, ends, tally, target, edge, space):
    """Grow both trees with the configurations of ``samples (S, n)``, the smaller tree first.

    ``domain (2, C)`` is how far from a node samples are of use to it: infinite until the first step from the node is
    blocked, then less with every such step, as in `collide_plan.grow`. Returns ``(status, samples used)``; when connected, ``ends (2,)`` are the last nodes of the trees: the same
    configuration.
    """
    status, used = MORE, 0
    while used < samples.shape[0] and status == MORE:
        for j in range(target.shape[0]):
            target[j] = samples[used, j]
        used += 1
        one = 0 if count[0] <= count[1] else 1
        for k in (one, 1 - one):
            row, far = nearest_node(nodes[k], count[k], target)
            if k == one and far > domain[k, row]:
                break
            before = count[k]
            count[k], ends[k], outcome = reach(task, nodes[k], parent[k], count[k], row, target, edge, space, tally)
            if k == one and count[k] == before and outcome == STOPPED:
                domain[k, row] = max(task.scale[5], min(task.scale[4], SHRINK * domain[k, row]))
                break
            for j in range(target.shape[0]):
                target[j] = nodes[k, ends[k], j]
            if outcome == NO_ROOM:
                status = FULL
                break
            if outcome == REACHED and k != one:
                status = CONNECTED
    return status, used


@kernel(inline=True)
def thin(task, path, count, edge, space):
    """Drop vertices that a straight motion can pass by, the farthest leaps first; the new count."""
    i, kept = 0, 1
    while i < count - 1:
        k = min(count - 1, i + LEAP)
        while k > i + 1 and passes(task, path[kept - 1], path[k], edge, space) != KEPT:
            k -= 1
        for j in range(path.shape[1]):
            path[kept, j] = path[k, j]
        kept += 1
        i = k
    return kept


@kernel(borrow=True)
def replace(path, count, i, k, way, new, rest):
    """Put ``way[:new]`` between the vertices *i* and *k* + 1 of a path; the new count."""
    n, tail = path.shape[1], count - (k + 1)
    for r in range(tail):
        for j in range(n):
            rest[r, j] = path[k + 1 + r, j]
    for r in range(new):
        for j in range(n):
            path[i + 1 + r, j] = way[r, j]
    for r in range(tail):
        for j in range(n):
            path[i + 1 + new + r, j] = rest[r, j]
    return i + 1 + new + tail


@kernel(inline=True)
def shorten(task, path, count, pairs, way, rest, parent, goal, edge, space, tally):
    """Shorten ``path (C, n)`` of *count* vertices in place with pairs of random places ``pairs (S, 2)`` in 0 … 1.

    Ways on the constraint from one place to the other replace what lies between where they are shorter. The new count.
    """
    vain = s = 0
    while s < pairs.shape[0] and count > 2 and vain < PATIENCE:
        total = length(path, 0, count - 1)
        low, high = min(pairs[s, 0], pairs[s, 1]) * total, max(pairs[s, 0], pairs[s, 1]) * total
        s += 1
        vain += 1
        i = point_at(path, count, low, way[0])
        k = point_at(path, count, high, goal)
        if i == k:
            continue
        new, _, outcome = reach(task, way, parent, 1, 0, goal, edge, space, tally)
        if outcome == REACHED and length(way, 0, new - 1) < (high - low) * (1.0 - 1e-3):
            if new + count + i - k <= path.shape[0]:
                count = replace(path, count, i, k, way, new, rest)
                vain = 0
    return count


@kernel
def search(task, nodes, parent, domain, count, samples, path, pairs, ends, tally):
    """`grow` the trees if there are *samples*, else shorten ``path`` of ``count[0]`` vertices with *pairs*.

    One kernel for both: what checks a motion takes long to compile.
    """
    n = path.shape[1]
    edge, space = edge_space(task.exact, task.lanes, n), constrain_space(task.keep, n)
    target = np.empty(n)
    if samples.shape[0] > 0:
        return grow(task, nodes, parent, domain, count, samples, ends, tally, target, edge, space)
    way, rest, parents, vertices = np.empty_like(path), np.empty_like(path), np.zeros(path.shape[0], np.int64), count[0]
    for last in range(2):
        vertices = thin(task, path, vertices, edge, space)
        if last == 0:
            vertices = shorten(task, path, vertices, pairs, way, rest, parents, target, edge, space, tally)
    return MORE, vertices
