"""The joint vector nearest to poses that several frames cannot reach at once: damped descent on lanes, within limits.

The cost is the sum of squares of the rows of `ik_tree`; since the rotation error is a rotation vector, its gradient is
−2 Jᵀe exactly. The damping of every lane falls after a step that lowers the cost, and rises after one that does not,
which is taken back (Levenberg–Marquardt, as in `ik_nearest`).
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .ik_nearest import judge_step
from .ik_step import normal_equations
from .ik_tasks import task_block
from .ik_tree import advance, box_rows, mask_block
from .lanes import LANES
from .tree import tree_block

L = LANES
REST = 1e-13  # a relative gain below this, several times in a row, ends a descent


@kernel
def descend_tree(tree, tasks, data, box, scale, lower, upper, most, first, last, q, cost):
    """Move the rows first … last of ``q (N, n)`` to where their ``cost (N)`` is least, in at most *most* steps.

    The cost is zero where all errors are within ``box (R)``.
    """
    n = lower.shape[0]
    rows = box.shape[0]
    x, before, step, value = np.zeros(n * L), np.zeros(n * L), np.zeros(n * L), np.empty(L)
    poses = np.empty(12 * max(tree.kind.shape[0], 1) * L)
    J, e, H = np.zeros(rows * n * L), np.zeros(rows * L), np.empty(n * n * L)
    total, inside, lowest, damping, idle = np.empty(L), np.empty(L), np.empty(L), np.empty(L), np.empty(L)
    goal = np.zeros((1, tasks.kind.shape[0], n))
    for block in range(first, last, L):
        for l in range(L):
            lowest[l], damping[l], idle[l] = 1e300, 0.01, 0.0
            for c in range(n):
                x[c * L + l] = q[min(block + l, last - 1), c]
        for _ in range(most):
            tree_block(tree, x, value, poses)
            task_block(tree, tasks, data, goal, x, block, last, poses, J, e)
            box_rows(e, box, scale, total, inside)
            working = False
            for l in range(L):
                total[l] = 0.0 if inside[l] != 0.0 else total[l]
                judge_step(l, n, total, REST * total[l], lowest, damping, idle, x, before)
                working = working or idle[l] <= 3.0
            if not working:
                break
            # a step that was taken back needs the rows at the old place: one more pass of the arithmetic is cheap
            tree_block(tree, x, value, poses)
            task_block(tree, tasks, data, goal, x, block, last, poses, J, e)
            box_rows(e, box, scale, total, inside)
            mask_block(J, e, scale, x, lower, upper, rows, n)
            normal_equations(J, e, 0, rows, n, n, damping, H, step)
            advance(x, step, lower, upper, n)
        for l in range(min(L, last - block)):
            cost[block + l] = lowest[l]
            for c in range(n):
                q[block + l, c] = before[c * L + l]
