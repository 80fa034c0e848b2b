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

L = LANES


@kernel
def box_rows(e, box, scale, total, inside):
    """Errors over ``scale (R)``; inside a loose ``box (R)`` they are zero, outside they are measured from half of it."""
    total[:] = 0.0
    inside[:] = 1.0
    for r in range(box.shape[0]):
        for l in range(L):
            x = e[r * L + l]
            if abs(x) > box[r]:
                inside[l] = 0.0
            if box[r] > LOOSE * scale[r]:
                x = 0.0 if abs(x) <= box[r] else x - math.copysign(0.5 * box[r], x)
            x /= scale[r]
            e[r * L + l] = x
            total[l] += x * x


@kernel
def mask_block(J, e, scale, q, lower, upper, rows, n):
    """Scale the rows, leave out satisfied ones, and coordinates at a limit that the gradient pushes outward."""
    for r in range(rows):
        for c in range(n):
            x = J[(r * n + c) * L : (r * n + c + 1) * L]
            for l in range(L):
                x[l] = 0.0 if e[r * L + l] == 0.0 else x[l] / scale[r]
    push = np.empty(L)
    for c in range(n):
        push[:] = 0.0
        for r in range(rows):
            for l in range(L):
                push[l] += J[(r * n + c) * L + l] * e[r * L + l]
        for l in range(L):
            v = q[c * L + l]
            out = ((v <= lower[c]) & (push[l] < 0.0)) | ((v >= upper[c]) & (push[l] > 0.0))
            push[l] = 0.0 if out else 1.0
        for r in range(rows):
            for l in range(L):
                J[(r * n + c) * L + l] *= push[l]


@kernel
def solve_tree(
    tree, tasks, data, box, scale, lower, upper, low, high, fixed, guesses, seed, starts, first, last, out, found, used
):
    """Solve the targets first … of ``data (N, T, 16)``; start s < S of target i is ``guesses[i, s] (N, S, n)``, later
    ones are random between *low* and *high*, where not *fixed*.

    ``out (N, n)``, ``found (N)`` 0 or 1, ``used (N)`` starts. Every lane works on a target of its own.
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
        for l in range(L):
            # a lane without a target, or whose start is over, takes the next
            if owner[l] >= 0 and age[l] >= 0.0:
                continue
            if owner[l] < 0 and following < last:
                owner[l] = following
                following += 1
                working += 1
                number[l] = 0
                mine[l] = data[owner[l]]
            if owner[l] >= 0:
                age[l], past[l] = 0.0, 1e300
                s = number[l]
                for c in range(n):
                    if s < guesses.shape[1]:
                        q[c * L + l] = min(max(guesses[owner[l], s, c], lower[c]), upper[c])
                    elif fixed[c]:
                        q[c * L + l] = guesses[owner[l], 0, c]
                    else:
                        q[c * L + l] = low[c] + (high[c] - low[c]) * uniform(seed, s, c)
        fresh = False
        tree_block(tree, q, value, poses)
        task_block(tree, tasks, mine, goal, q, 0, L, poses, J, e)
        box_rows(e, box, scale, total, inside)
        for l in range(L):
            damping[l] = FLOOR + 0.01 * total[l]
            t = owner[l]
            if t < 0:
                continue
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
        for l in range(L):
            largest = STEP
            for c in range(n):
                largest = max(largest, abs(step[c * L + l]))
            for c in range(n):
                v = q[c * L + l] + step[c * L + l] * STEP / largest
                q[c * L + l] = min(max(v, lower[c]), upper[c])
