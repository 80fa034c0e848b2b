"""Time-optimal path timing: certified rows per grid interval, then reachability analysis backward and forward.

On the interval ``[s_i, s_i + h]`` the path speed squared ``x(s) = ṡ²`` runs linearly from ``x`` to ``y`` (constant
path acceleration). A limit on a polynomial that is linear in (x, y), such as the acceleration
``q' (y − x)/2h + q'' x(s)``, holds on the whole interval as soon as it holds for each of its Bernstein coefficients,
which are linear in (x, y) too. Every such row ``a x + b y ≤ c`` is stored solved for y.

Reachability analysis after Pham & Pham (2018): the largest controllable speed backward, the greedy choice forward.
The two-variable linear programs are solved by a monotone Newton iteration on a convex piecewise linear function.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .path import locate

HUGE = 1e18
"""Stands for an unbounded path speed squared."""

OK = 0
INFEASIBLE = 1
START = 2
END = 3
STALLED = 4


@kernel(inline=True)
def _store(a, b, c, upper, lower, counts, cap):
    """File the row ``a x + b y ≤ c`` as an upper bound on y, a lower bound on y, or a bound on x alone."""
    if abs(b) <= 1e-13 * abs(a) or b == 0.0:
        if a > 0.0:
            bound = c / a
            if bound < cap[1]:
                cap[1] = bound
        elif a < 0.0:
            bound = c / a
            if bound > cap[0]:
                cap[0] = bound
        elif c < 0.0:
            cap[1] = -1.0
    elif b > 0.0:
        k = counts[0]
        upper[k, 0] = c / b
        upper[k, 1] = -a / b
        counts[0] = k + 1
    else:
        k = counts[1]
        lower[k, 0] = c / b
        lower[k, 1] = -a / b
        counts[1] = k + 1


@kernel
def _local(coefficients, k, z, h, j, out):
    """Coefficients of coordinate j of piece k in σ ∈ [0, 1], where s = break + z + h σ."""
    degree = coefficients.shape[1] - 1
    for p in range(degree + 1):
        out[p] = coefficients[k, p, j]
    for p in range(degree):
        for q in range(degree - 1, p - 1, -1):
            out[q] += z * out[q + 1]
    scale = 1.0
    for p in range(degree + 1):
        out[p] *= scale
        scale *= h


@kernel
def acceleration_bernstein(local, h, binomial, alpha, beta):
    """Bernstein coefficients (degree D − 1) of the acceleration as ``alpha x + beta y``."""
    degree = local.shape[0] - 1
    m = degree  # number of coefficients
    inv = 1.0 / h
    for p in range(m):
        d = (p + 1) * local[p + 1]  # σ^p of dq/dσ
        e = (p + 2) * (p + 1) * local[p + 2] if p + 2 <= degree else 0.0  # σ^p of d²q/dσ²
        e_low = (p + 1) * p * local[p + 1]  # σ^(p−1) coefficient, shifted by σ
        big = (d + 2.0 * e_low) * inv  # factor of the path acceleration u = (y − x) / 2h
        b = 0.5 * big * inv
        beta[p] = b / binomial[m - 1, p]
        alpha[p] = (e * inv * inv - b) / binomial[m - 1, p]
    for level in range(1, m):
        for p in range(m - 1, level - 1, -1):
            alpha[p] += alpha[p - 1]
            beta[p] += beta[p - 1]


@kernel
def velocity_bernstein(local, h, binomial, work, square):
    """Bernstein coefficients (degree 2 D − 2) of ``(dq/ds)²``."""
    degree = local.shape[0] - 1
    m = degree - 1
    for p in range(m + 1):
        work[p] = (p + 1) * local[p + 1] / h / binomial[m, p]
    for level in range(1, m + 1):
        for p in range(m, level - 1, -1):
            work[p] += work[p - 1]
    for k in range(2 * m + 1):
        total = 0.0
        for p in range(max(0, k - m), min(m, k) + 1):
            total += binomial[m, p] * binomial[m, k - p] * work[p] * work[k - p]
        square[k] = total / binomial[2 * m, k]


@kernel
def rows(breaks, coefficients, grid, vlim, alim, extra, binomial, upper, lower, counts, cap):
    """All rows of all intervals; see the module.

    ``vlim, alim (n, 2)``; ``extra (N, E, 3)`` further rows (a, b, c); out: ``upper, lower (N, R, 2)`` (constant,
    slope), ``counts (N, 2)``, ``cap (N, 2)`` least and largest x.
    """
    degree = coefficients.shape[1] - 1
    n = coefficients.shape[2]
    local = np.empty(degree + 1)
    alpha = np.empty(degree)
    beta = np.empty(degree)
    work = np.empty(degree)
    square = np.empty(2 * degree - 1)
    for i in range(grid.shape[0] - 1):
        h = grid[i + 1] - grid[i]
        k = locate(breaks, 0.5 * (grid[i] + grid[i + 1]))
        counts[i, 0] = 0
        counts[i, 1] = 0
        cap[i, 0] = 0.0
        cap[i, 1] = HUGE
        for j in range(n):
            _local(coefficients, k, grid[i] - breaks[k], h, j, local)
            if np.isfinite(vlim[j, 0]) or np.isfinite(vlim[j, 1]):
                velocity_bernstein(local, h, binomial, work, square)
                positive = False
                negative = False
                for p in range(degree):
                    if work[p] > 0.0:
                        positive = True
                    elif work[p] < 0.0:
                        negative = True
                v = np.inf
                if positive:
                    v = vlim[j, 1]
                if negative:
                    v = min(v, -vlim[j, 0])
                if v < np.inf:
                    m = 2 * degree - 1
                    inv = 1.0 / (v * v)
                    for p in range(m + 1):
                        a = square[p] * (m - p) / m * inv if p < m else 0.0
                        b = square[p - 1] * p / m * inv if p > 0 else 0.0
                        _store(a, b, 1.0, upper[i], lower[i], counts[i], cap[i])
            if np.isfinite(alim[j, 0]) or np.isfinite(alim[j, 1]):
                acceleration_bernstein(local, h, binomial, alpha, beta)
                for p in range(degree):
                    if np.isfinite(alim[j, 1]):
                        _store(alpha[p], beta[p], alim[j, 1], upper[i], lower[i], counts[i], cap[i])
                    if np.isfinite(alim[j, 0]):
                        _store(-alpha[p], -beta[p], -alim[j, 0], upper[i], lower[i], counts[i], cap[i])
        for e in range(extra.shape[1]):
            if extra[i, e, 2] < np.inf:
                _store(extra[i, e, 0], extra[i, e, 1], extra[i, e, 2], upper[i], lower[i], counts[i], cap[i])


@kernel
def _extreme(upper, nu, lower, nl, low, high, y_low, y_high, sign):
    """Largest (sign = 1) or smallest (sign = −1) x in [low, high] that leaves a y in [y_low, y_high]; −1 if none.

    ``gap(x) = (largest lower bound on y) − (smallest upper bound on y)`` is convex and piecewise linear, so Newton's
    iteration from outside reaches its root after finitely many pairs of rows, without ever passing it.
    """
    x = high if sign > 0.0 else low
    if high < low:
        return -1.0
    for _ in range(200):
        top = y_high
        top_slope = 0.0
        for r in range(nu):
            value = upper[r, 0] + upper[r, 1] * x
            if value < top:
                top = value
                top_slope = upper[r, 1]
        bottom = y_low
        bottom_slope = 0.0
        for r in range(nl):
            value = lower[r, 0] + lower[r, 1] * x
            if value > bottom:
                bottom = value
                bottom_slope = lower[r, 1]
        gap = bottom - top
        slope = bottom_slope - top_slope
        if gap <= 0.0:
            return x
        if slope * sign <= 0.0:
            return -1.0
        step = gap / slope
        following = x - step
        if following == x:
            return x
        x = following
        if x < low:
            # rounding may place the root a hair outside
            if low - x <= 1e-12 * (1.0 + abs(low)):
                x = low
            else:
                return -1.0
        elif x > high:
            return -1.0
    return x


@kernel
def profile(grid, upper, lower, counts, cap, pinned, x_start, x_end, simple, beta, alpha, x):
    """Path speed squared ``x (N + 1,)`` at the grid points, as fast as the rows allow.

    ``pinned (N + 1,)`` marks grid points where the path has a kink and must be passed at rest; *simple* says that
    standing still is allowed everywhere (no row with c < 0), so that the least speeds are 0. Returns (status, stage).
    """
    count = grid.shape[0] - 1
    if x_end > cap[count - 1, 1] * 1e6:
        return END, count
    beta[count] = x_end
    alpha[count] = x_end
    for i in range(count - 1, -1, -1):
        high = 0.0 if pinned[i] else cap[i, 1]
        low = cap[i, 0]
        beta[i] = _extreme(upper[i], counts[i, 0], lower[i], counts[i, 1], low, high, alpha[i + 1], beta[i + 1], 1.0)
        if beta[i] < 0.0:
            return (END, i) if i == count - 1 and x_end > 0.0 else (INFEASIBLE, i)
        alpha[i] = low
        if not simple or low > 0.0 or alpha[i + 1] > 0.0:
            alpha[i] = _extreme(
                upper[i], counts[i, 0], lower[i], counts[i, 1], low, beta[i], alpha[i + 1], beta[i + 1], -1.0
            )
            if alpha[i] < 0.0:
                alpha[i] = beta[i]
    if x_start > beta[0] * (1.0 + 1e-12) or x_start < alpha[0] * (1.0 - 1e-12):
        return START, 0
    x[0] = min(x_start, beta[0])
    for i in range(count):
        y = beta[i + 1]
        for r in range(counts[i, 0]):
            value = upper[i, r, 0] + upper[i, r, 1] * x[i]
            if value < y:
                y = value
        if y < alpha[i + 1]:
            y = alpha[i + 1]
        x[i + 1] = y
        if y <= 0.0:
            x[i + 1] = 0.0
            if x[i] <= 0.0:
                return STALLED, i
    return OK, count


@kernel
def times(grid, x, t, timing):
    """Times at the grid points, and s on every interval as low-first quadratic coefficients ``(N, 3)`` in t − t_i."""
    t[0] = 0.0
    for i in range(grid.shape[0] - 1):
        h = grid[i + 1] - grid[i]
        a = math.sqrt(x[i])
        b = math.sqrt(x[i + 1])
        t[i + 1] = t[i] + 2.0 * h / (a + b)
        timing[i, 0] = grid[i]
        timing[i, 1] = a
        timing[i, 2] = (x[i + 1] - x[i]) / (4.0 * h)
