"""Steps of prioritised tasks for batches: on lanes as long as no bound and no rank is in the way, else one by one.

Most steps of a controller meet no bound below the first level, and their tasks are independent. Those run on lanes: every level is
solved in the orthonormal basis of what the levels above leave free, without bounds. A lane whose result would leave
its bounds, or whose rows turn out nearly dependent, is then solved by the active-set method of `ik_priority`.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .chain import load_block
from .ik_priority import prioritised, priority_work, step_bounds
from .ik_tasks import task_block
from .lanes import LANES
from .tree import tree_block

L = LANES
REGULAR = 1e-6  # a row whose part in the free space is shorter than this is left to the pivoting method


@kernel
def project_rows(J, first, last, N, n, width, A):
    """``A = J N`` for the rows first … last of J, on the first *width* columns of N."""
    for i in range(first, last):
        for c in range(width):
            out = A[(i * n + c) * L : (i * n + c + 1) * L]
            out[:] = 0.0
            for k in range(n):
                x = J[(i * n + k) * L : (i * n + k + 1) * L]
                y = N[(k * n + c) * L : (k * n + c + 1) * L]
                for l in range(L):
                    out[l] += x[l] * y[l]


@kernel
def normal_equations(A, rest, first, last, n, width, damping, H, z):
    """``H = AᵀA + damping (L)``, ``z = Aᵀ rest``, then z becomes H⁻¹ z by a Cholesky factorisation, all on lanes."""
    for c in range(width):
        for b in range(c + 1):
            out = H[(c * n + b) * L : (c * n + b + 1) * L]
            for l in range(L):
                out[l] = damping[l] if c == b else 0.0
            for i in range(first, last):
                x = A[(i * n + c) * L : (i * n + c + 1) * L]
                y = A[(i * n + b) * L : (i * n + b + 1) * L]
                for l in range(L):
                    out[l] += x[l] * y[l]
        right = z[c * L : (c + 1) * L]
        right[:] = 0.0
        for i in range(first, last):
            x = A[(i * n + c) * L : (i * n + c + 1) * L]
            y = rest[i * L : (i + 1) * L]
            for l in range(L):
                right[l] += x[l] * y[l]
    for c in range(width):
        for b in range(c + 1):
            out = H[(c * n + b) * L : (c * n + b + 1) * L]
            for k in range(b):
                x = H[(c * n + k) * L : (c * n + k + 1) * L]
                y = H[(b * n + k) * L : (b * n + k + 1) * L]
                for l in range(L):
                    out[l] -= x[l] * y[l]
            if b == c:
                for l in range(L):
                    out[l] = 1.0 / math.sqrt(max(out[l], 1e-300))
            else:
                y = H[(b * n + b) * L : (b * n + b + 1) * L]
                for l in range(L):
                    out[l] *= y[l]
    for c in range(width):
        x = z[c * L : (c + 1) * L]
        for k in range(c):
            h = H[(c * n + k) * L : (c * n + k + 1) * L]
            y = z[k * L : (k + 1) * L]
            for l in range(L):
                x[l] -= h[l] * y[l]
        h = H[(c * n + c) * L : (c * n + c + 1) * L]
        for l in range(L):
            x[l] *= h[l]
    for c in range(width - 1, -1, -1):
        x = z[c * L : (c + 1) * L]
        for k in range(c + 1, width):
            h = H[(k * n + c) * L : (k * n + c + 1) * L]
            y = z[k * L : (k + 1) * L]
            for l in range(L):
                x[l] -= h[l] * y[l]
        h = H[(c * n + c) * L : (c * n + c + 1) * L]
        for l in range(L):
            x[l] *= h[l]


@kernel
def reflect(u, beta, M, first, last, n, width, dot):
    """Apply the reflection ``1 − β u uᵀ`` to the rows first … last of M, on its first *width* columns."""
    for i in range(first, last):
        dot[:] = 0.0
        for c in range(width):
            x = M[(i * n + c) * L : (i * n + c + 1) * L]
            y = u[c * L : (c + 1) * L]
            for l in range(L):
                dot[l] += x[l] * y[l]
        for l in range(L):
            dot[l] *= beta[l]
        for c in range(width):
            x = M[(i * n + c) * L : (i * n + c + 1) * L]
            y = u[c * L : (c + 1) * L]
            for l in range(L):
                x[l] -= dot[l] * y[l]


@kernel
def take_rows_out(A, first, last, N, n, width, u, beta, dot, irregular):
    """Reflect N so that the rows of A (in its basis) have no part in the columns that are left; returns how many."""
    for i in range(first, last):
        if width == 0:
            break
        beta[:] = 0.0
        for c in range(width):
            x = A[(i * n + c) * L : (i * n + c + 1) * L]
            y = u[c * L : (c + 1) * L]
            for l in range(L):
                y[l] = x[l]
                beta[l] += x[l] * x[l]
        y = u[(width - 1) * L : width * L]
        for l in range(L):
            if beta[l] < REGULAR * REGULAR:
                irregular[l] = 1.0
                beta[l] = 1.0
            norm = math.sqrt(beta[l])
            beta[l] = 1.0 / (norm * (norm + abs(y[l])))
            y[l] += math.copysign(norm, y[l])
        reflect(u, beta, N, 0, n, n, width, dot)
        reflect(u, beta, A, i + 1, last, n, width, dot)
        width -= 1
    return width


@kernel
def steps_block(J, e, levels, damping, low, high, n, dq, N, A, H, rest, z, u, irregular):
    """All levels on lanes, without bounds; ``irregular (L)`` becomes 1 where the result must not be used."""
    beta, dot = np.empty(L), np.empty(L)
    damped = np.full(L, damping)
    irregular[:] = 0.0
    N[: n * n * L] = 0.0
    for k in range(n):
        for l in range(L):
            N[(k * n + k) * L + l] = 1.0
            dq[k * L + l] = 0.0
            if low[k * L + l] > 0.0 or high[k * L + l] < 0.0:
                irregular[l] = 1.0
    width = n
    for level in range(levels.shape[0] - 1):
        first, last = levels[level], levels[level + 1]
        if width == 0:
            break
        project_rows(J, first, last, N, n, width, A)
        for i in range(first, last):
            r = rest[i * L : (i + 1) * L]
            for l in range(L):
                r[l] = e[i * L + l]
            for k in range(n):
                x = J[(i * n + k) * L : (i * n + k + 1) * L]
                y = dq[k * L : (k + 1) * L]
                for l in range(L):
                    r[l] -= x[l] * y[l]
        normal_equations(A, rest, first, last, n, width, damped, H, z)
        for k in range(n):
            y = dq[k * L : (k + 1) * L]
            for c in range(width):
                x = N[(k * n + c) * L : (k * n + c + 1) * L]
                v = z[c * L : (c + 1) * L]
                for l in range(L):
                    y[l] += x[l] * v[l]
            for l in range(L):
                bad = (y[l] < low[k * L + l]) | (y[l] > high[k * L + l])
                irregular[l] = 1.0 if bad else irregular[l]
        if level < levels.shape[0] - 2:
            width = take_rows_out(A, first, last, N, n, width, u, beta, dot, irregular)


@kernel
def steps(
    tree, tasks, levels, data, goal, q, before, lower, upper, speed, acceleration, dt, damping, first, last, out, errors
):
    """Steps ``out (N, n)`` for rows first … last of ``q (N, n)``, and the tasks' weighted errors ``errors (N, R)``."""
    n = q.shape[1]
    rows = tasks.row[tasks.row.shape[0] - 1]
    buffer, value, poses = np.empty(n * L), np.empty(L), np.empty(12 * max(tree.kind.shape[0], 1) * L)
    J, e = np.zeros(rows * n * L), np.zeros(rows * L)
    low, high, dq = np.empty(n * L), np.empty(n * L), np.empty(n * L)
    N, A, H = np.empty(n * n * L), np.empty(rows * n * L), np.empty(n * n * L)
    rest, z, u, irregular = np.empty(rows * L), np.empty(n * L), np.empty(n * L), np.empty(L)
    work = priority_work(n, rows)
    lo, hi = np.empty(n), np.empty(n)
    J1 = np.empty((rows, n))
    for block in range(first, last, L):
        load_block(q, block, last, buffer)
        tree_block(tree, buffer, value, poses)
        task_block(tree, tasks, data, goal, buffer, block, last, poses, J, e)
        for l in range(L):
            i = min(block + l, last - 1)
            step_bounds(q[i], lower, upper, speed, acceleration, before[i], dt, lo, hi)
            for k in range(n):
                low[k * L + l] = lo[k]
                high[k * L + l] = hi[k]
        steps_block(J, e, levels, damping, low, high, n, dq, N, A, H, rest, z, u, irregular)
        for l in range(min(L, last - block)):
            i = block + l
            for r in range(rows):
                errors[i, r] = e[r * L + l]
            if irregular[l] == 0.0:
                for k in range(n):
                    out[i, k] = dq[k * L + l]
                continue
            for k in range(n):
                lo[k] = low[k * L + l]
                hi[k] = high[k * L + l]
                for r in range(rows):
                    J1[r, k] = J[(r * n + k) * L + l]
            prioritised(J1, errors[i], levels, damping, lo, hi, out[i], work)
