"""Steps of prioritised tasks for batches: on lanes as long as no bound and no rank is in the way, else one by one.

Most steps of a controller meet no bound below the first level, and their tasks are independent. Those run on lanes: every level is
solved in the orthonormal basis of what the levels above leave free, without bounds. A lane whose result would leave
its bounds, or whose rows turn out nearly dependent, is then solved by the active-set method of `ik_priority`.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .chain import load_block
from .ik_faults import first_fault
from .ik_priority import prioritised, priority_work, step_bounds
from .ik_saturate import MET, saturate, saturate_work
from .ik_tasks import task_block
from .lanes import LANES
from .tree import tree_block
from .vector import larger, load, magnitude, root, select, smaller, some, splat, store

L = LANES
REGULAR = 1e-6  # a row whose part in the free space is shorter than this is left to the pivoting method


@kernel(borrow=True)
def project_rows(J, first, last, N, n, width, A):
    """``A = J N`` for the rows first … last of J, on the first *width* columns of N."""
    for i in range(first, last):
        for c in range(width):
            s = splat(0.0)
            for k in range(n):
                s = s + load(J, (i * n + k) * L) * load(N, (k * n + c) * L)
            store(A, (i * n + c) * L, s)


@kernel(borrow=True)
def normal_equations(A, rest, first, last, n, width, damping, H, z):
    """``H = AᵀA + damping (L)``, ``z = Aᵀ rest``, then z becomes H⁻¹ z by a Cholesky factorisation, all on lanes.

    H keeps the factor, with reciprocals on its diagonal.
    """
    for c in range(width):
        for b in range(c + 1):
            s = load(damping, 0) if c == b else splat(0.0)
            for i in range(first, last):
                s = s + load(A, (i * n + c) * L) * load(A, (i * n + b) * L)
            for k in range(b):
                s = s - load(H, (c * n + k) * L) * load(H, (b * n + k) * L)
            s = 1.0 / root(larger(s, 1e-300)) if b == c else s * load(H, (b * n + b) * L)
            store(H, (c * n + b) * L, s)
        s = splat(0.0)
        for i in range(first, last):
            s = s + load(A, (i * n + c) * L) * load(rest, i * L)
        for k in range(c):
            s = s - load(H, (c * n + k) * L) * load(z, k * L)
        store(z, c * L, s * load(H, (c * n + c) * L))
    for c in range(width - 1, -1, -1):
        s = load(z, c * L)
        for k in range(c + 1, width):
            s = s - load(H, (k * n + c) * L) * load(z, k * L)
        store(z, c * L, s * load(H, (c * n + c) * L))


@kernel(borrow=True)
def reflect(u, beta, M, first, last, n, width):
    """Apply the reflection ``1 − β u uᵀ`` to the rows first … last of M, on its first *width* columns."""
    b = load(beta, 0)
    for i in range(first, last):
        dot = splat(0.0)
        for c in range(width):
            dot = dot + load(M, (i * n + c) * L) * load(u, c * L)
        dot = dot * b
        for c in range(width):
            o = (i * n + c) * L
            store(M, o, load(M, o) - dot * load(u, c * L))


@kernel(borrow=True)
def take_rows_out(A, first, last, N, n, width, u, beta, irregular):
    """Reflect N so that the rows of A (in its basis) have no part in the columns that are left; returns how many."""
    for i in range(first, last):
        if width == 0:
            break
        square = splat(0.0)
        for c in range(width):
            x = load(A, (i * n + c) * L)
            store(u, c * L, x)
            square = square + x * x
        short = square < REGULAR * REGULAR
        store(irregular, 0, select(short, 1.0, load(irregular, 0)))
        square = select(short, 1.0, square)
        norm = root(square)
        end = load(u, (width - 1) * L)
        store(beta, 0, 1.0 / (square + norm * magnitude(end)))
        store(u, (width - 1) * L, end + select(end < 0.0, -norm, norm))
        reflect(u, beta, N, 0, n, n, width)
        reflect(u, beta, A, i + 1, last, n, width)
        width -= 1
    return width


@kernel
def steps_block(J, e, levels, damping, low, high, n, dq, N, A, H, rest, z, y, u, work, irregular):
    """All levels on lanes; ``irregular (L)`` becomes 1 where the result must not be used."""
    beta, damped = np.empty(L), np.full(L, damping)
    irregular[:] = 0.0
    N[: n * n * L] = 0.0
    for k in range(n):
        store(N, (k * n + k) * L, splat(1.0))
        store(dq, k * L, smaller(larger(load(low, k * L), 0.0), load(high, k * L)))
    width = n
    for level in range(levels.shape[0] - 1):
        first, last = levels[level], levels[level + 1]
        if width == 0:
            break
        project_rows(J, first, last, N, n, width, A)
        for i in range(first, last):
            s = load(e, i * L)
            for k in range(n):
                s = s - load(J, (i * n + k) * L) * load(dq, k * L)
            store(rest, i * L, s)
        normal_equations(A, rest, first, last, n, width, damped, H, z)
        passed = splat(0.0)
        for k in range(n):
            s = load(dq, k * L)
            for c in range(width):
                s = s + load(N, (k * n + c) * L) * load(z, c * L)
            store(y, k * L, s)
            passed = larger(passed, larger(s - load(high, k * L), load(low, k * L) - s))
        if some(passed > MET):
            saturate(dq, low, high, N, H, z, n, width, y, work, irregular)
        for k in range(n):
            store(dq, k * L, smaller(larger(load(y, k * L), load(low, k * L)), load(high, k * L)))
        if level < levels.shape[0] - 2:
            width = take_rows_out(A, first, last, N, n, width, u, beta, irregular)


@kernel
def steps(
    tree,
    tasks,
    kept,
    levels,
    data,
    goal,
    q,
    before,
    lower,
    upper,
    speed,
    acceleration,
    dt,
    damping,
    first,
    last,
    out,
    fault,
):
    """Steps ``out (N, n)`` for rows first … last of ``q (N, n)``; *kept* are the rows of the tasks that count.

    ``fault (1)`` becomes what `first_fault` finds, and then no step is made.
    """
    wrong = first_fault(tasks, data, goal, q, lower, upper, first, last)
    if wrong != 0:
        fault[0] = wrong
        return
    n = q.shape[1]
    rows = max(tasks.row[tasks.row.shape[0] - 1], 1)
    buffer, value, poses = np.empty(n * L), np.empty(L), np.empty(12 * max(tree.kind.shape[0], 1) * L)
    J, e = np.zeros(rows * n * L), np.zeros(rows * L)
    low, high, dq = np.empty(n * L), np.empty(n * L), np.empty(n * L)
    N, A, H = np.empty(n * n * L), np.empty(rows * n * L), np.empty(n * n * L)
    rest, z, y, u, irregular = np.empty(rows * L), np.empty(n * L), np.empty(n * L), np.empty(n * L), np.empty(L)
    bounds = saturate_work(n)
    work = priority_work(n, rows)
    lo, hi = np.empty(n), np.empty(n)
    J1, e1 = np.empty((rows, n)), np.empty(rows)
    for block in range(first, last, L):
        load_block(q, block, last, buffer)
        tree_block(tree, buffer, value, poses)
        task_block(tree, tasks, data, goal, buffer, block, last, poses, J, e)
        if kept.shape[0] < rows:
            for r in range(kept.shape[0]):
                e[r * L : (r + 1) * L] = e[kept[r] * L : (kept[r] + 1) * L]
                J[r * n * L : (r + 1) * n * L] = J[kept[r] * n * L : (kept[r] + 1) * n * L]
        for l in range(L):
            i = min(block + l, last - 1)
            step_bounds(q[i], lower, upper, speed, acceleration, before[i], dt, lo, hi)
            for k in range(n):
                low[k * L + l] = lo[k]
                high[k * L + l] = hi[k]
        steps_block(J, e, levels, damping, low, high, n, dq, N, A, H, rest, z, y, u, bounds, irregular)
        for l in range(min(L, last - block)):
            i = block + l
            if irregular[l] == 0.0:
                for k in range(n):
                    out[i, k] = dq[k * L + l]
                continue
            for r in range(kept.shape[0]):
                e1[r] = e[r * L + l]
                for k in range(n):
                    J1[r, k] = J[(r * n + k) * L + l]
            for k in range(n):
                lo[k] = low[k * L + l]
                hi[k] = high[k * L + l]
            prioritised(J1, e1, levels, damping, lo, hi, out[i], work)
