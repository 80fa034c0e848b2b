"""Inverse kinematics of several frames at once: damped Newton steps on lanes in the joint space of a tree.

Rows and Jacobians are those of `ik_tasks` (pose tasks, in the axes of their targets); a row inside its tolerance asks for
nothing. The step solves (JᵀJ + λ 1) dq = Jᵀ e with λ ∝ ‖e‖², coordinates at a limit that the gradient pushes outward are
left out, as in `ik_chain`.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .ik_box import LOOSE
from .ik_chain import FLOOR, PATIENCE, STALL, STEP
from .ik_queue import uniform
from .ik_step import normal_equations
from .ik_tasks import task_block
from .lanes import LANES
from .tree import tree_block
from .vector import larger, load, magnitude, select, smaller, splat, store

L = LANES


@kernel(borrow=True)
def box_rows(e, box, scale, total, inside):
    """Errors over ``scale (R)``; inside a loose ``box (R)`` they are zero, outside they are measured from half of it."""
    sum_, all_ = splat(0.0), splat(1.0)
    for r in range(box.shape[0]):
        x = load(e, r * L)
        beyond = magnitude(x) > box[r]
        all_ = select(beyond, 0.0, all_)
        if box[r] > LOOSE * scale[r]:
            x = select(beyond, x - select(x < 0.0, -0.5 * box[r], 0.5 * box[r]), 0.0)
        x = x * (1.0 / scale[r])
        store(e, r * L, x)
        sum_ = sum_ + x * x
    store(total, 0, sum_)
    store(inside, 0, all_)


@kernel(borrow=True)
def mask_block(J, e, scale, q, lower, upper, rows, n):
    """Scale the rows, leave out satisfied ones, and coordinates at a limit that the gradient pushes outward."""
    for c in range(n):
        push = splat(0.0)
        for r in range(rows):
            o = (r * n + c) * L
            x = load(e, r * L)
            v = select(x == 0.0, 0.0, load(J, o) * (1.0 / scale[r]))
            store(J, o, v)
            push = push + v * x
        v = load(q, c * L)
        out = ((v <= lower[c]) & (push < 0.0)) | ((v >= upper[c]) & (push > 0.0))
        for r in range(rows):
            o = (r * n + c) * L
            store(J, o, select(out, 0.0, load(J, o)))


@kernel(borrow=True)
def advance(q, step, lower, upper, n):
    """``q += step``, shortened as a whole to `STEP`, then clamped to the limits."""
    largest = splat(STEP)
    for c in range(n):
        largest = larger(largest, magnitude(load(step, c * L)))
    share = STEP / largest
    for c in range(n):
        v = load(q, c * L) + load(step, c * L) * share
        store(q, c * L, smaller(larger(v, lower[c]), upper[c]))


@kernel(borrow=True)
def load_starts(
    data, guesses, seed, lower, upper, low, high, fixed, following, last, owner, number, age, past, mine, q
):
    """A lane without a target takes the next, one whose start is over (age < 0) its next start.

    Returns the number of the target that follows, and how many were taken.
    """
    taken = 0
    for l in range(L):
        if owner[l] >= 0 and age[l] >= 0.0:
            continue
        if owner[l] < 0 and following < last:
            owner[l] = following
            following += 1
            taken += 1
            number[l] = 0
            for t in range(mine.shape[1]):
                for j in range(16):
                    mine[l, t, j] = data[owner[l], t, j]
        if owner[l] < 0:
            continue
        age[l], past[l] = 0.0, 1e300
        s = number[l]
        for c in range(lower.shape[0]):
            if s < guesses.shape[1]:
                q[c * L + l] = min(max(guesses[owner[l], s, c], lower[c]), upper[c])
            elif fixed[c]:
                q[c * L + l] = guesses[owner[l], 0, c]
            else:
                q[c * L + l] = low[c] + (high[c] - low[c]) * uniform(seed, s, c)
    return following, taken


@kernel
def solve_tree(
    tree,
    tasks,
    data,
    box,
    scale,
    lower,
    upper,
    low,
    high,
    fixed,
    guesses,
    seed,
    starts,
    first,
    last,
    out,
    found,
    used,
    least,
    nearest,
):
    """Solve the targets first … of ``data (N, T, 16)``; start s < S of target i is ``guesses[i, s] (N, S, n)``, later
    ones are random between *low* and *high*, where not *fixed*.

    ``out (N, n)``, ``found (N)`` 0 or 1, ``used (N)`` starts. Every lane works on a target of its own.
    Unless it is empty, ``least (N)`` becomes the least squared error met, at ``nearest (N, n)``.
    """
    n = lower.shape[0]
    rows = box.shape[0]
    q, step, value = np.zeros(n * L), np.zeros(n * L), np.empty(L)
    poses = np.empty(12 * max(tree.kind.shape[0], 1) * L)
    J, e, H = np.zeros(rows * n * L), np.zeros(rows * L), np.empty(n * n * L)
    total, inside, past = np.empty(L), np.empty(L), np.empty(L)
    age, damping = np.zeros(L), np.empty(L)
    owner, number = np.full(L, -1), np.zeros(L, np.int64)
    mine = np.zeros((L, tasks.kind.shape[0], 16))
    goal = np.zeros((1, tasks.kind.shape[0], n))
    following, working = first, 0
    for l in range(L):
        for t in range(mine.shape[1]):
            mine[l, t, 0], mine[l, t, 5], mine[l, t, 10] = 1.0, 1.0, 1.0
        number[l] = -1
    fresh = True
    while working > 0 or fresh:
        following, taken = load_starts(
            data, guesses, seed, lower, upper, low, high, fixed, following, last, owner, number, age, past, mine, q
        )
        working += taken
        fresh = False
        tree_block(tree, q, value, poses)
        task_block(tree, tasks, mine, goal, q, 0, L, poses, J, e)
        box_rows(e, box, scale, total, inside)
        for l in range(L):
            damping[l] = FLOOR + 0.01 * total[l]
            t = owner[l]
            if t < 0:
                continue
            if least.shape[0] > 0 and total[l] < least[t]:
                least[t] = total[l]
                for c in range(n):
                    nearest[t, c] = q[c * L + l]
            age[l] += 1.0
            late = age[l] >= 2.0 * PATIENCE
            if age[l] == 6.0 * math.floor(age[l] / 6.0):
                late = late or total[l] > STALL * past[l]
                past[l] = total[l]
            if inside[l] == 0.0 and not late:
                continue
            number[l] += 1
            if inside[l] != 0.0:
                found[t] = 1
                for c in range(n):
                    out[t, c] = q[c * L + l]
            age[l] = -1.0
            if inside[l] != 0.0 or number[l] >= starts:
                used[t] = number[l]
                owner[l] = -1
                working -= 1
        if working == 0 and following >= last:
            break
        fresh = following < last
        mask_block(J, e, scale, q, lower, upper, rows, n)
        normal_equations(J, e, 0, rows, n, n, damping, H, step)
        advance(q, step, lower, upper, n)
