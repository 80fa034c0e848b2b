"""Time-optimal path timing: certified rows per grid interval, then reachability analysis backward and forward.

On the interval ``[s_i, s_i + h]`` the path speed squared ``x(s) = ṡ²`` runs linearly from ``x`` to ``y`` (constant
path acceleration). A limit on a polynomial that is linear in (x, y), such as the acceleration
``q' (y − x)/2h + q'' x(s)``, holds on the whole interval as soon as it holds for each of its Bernstein coefficients,
which are linear in (x, y) too: rows ``lo ≤ a x + b y ≤ hi``, stored solved for y as ``low ≤ y − slope x ≤ high``.

Rows are built on lanes: a block holds LANES intervals, of one path (`rows_along`) or of as many paths
(`rows_across`). Reachability analysis after Pham & Pham (2018): the controllable speeds backward, the greedy choice
forward; the two-variable linear programs are solved by a monotone Newton iteration on a convex piecewise linear
function.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .lanes import LANES
from .path import locate

OK = 0
INFEASIBLE = 1
START = 2
END = 3
STALLED = 4


@kernel
def row_count(degree, n, sampled):
    """Rows per interval: acceleration, velocity (all coordinates in one), sampled constraints."""
    return degree * n + 2 * degree - 1 + 4 * sampled


@kernel(inline=True)
def _solved(a, b, lo, hi):
    """The row ``lo ≤ a x + b y ≤ hi`` solved for y: slope, low, high; and the bounds on x where it has no y."""
    if abs(b) > 1e-13 * abs(a):
        inverse = 1.0 / b
        first = lo * inverse
        second = hi * inverse
        return -a * inverse, min(first, second), max(first, second), 0.0, np.inf
    if a != 0.0:
        first = lo / a
        second = hi / a
        return 0.0, -np.inf, np.inf, max(min(first, second), 0.0), max(first, second)
    if lo > 0.0 or hi < 0.0:
        return 0.0, -np.inf, np.inf, 0.0, -1.0
    return 0.0, -np.inf, np.inf, 0.0, np.inf


@kernel
def _place(r, lo, hi, a, b, slope, low, high, cap):
    """Store one row of a block from its coefficients ``a, b (LANES,)``."""
    for lane in range(LANES):
        m, bottom, top, least, most = _solved(a[lane], b[lane], lo, hi)
        slope[r, lane] = m
        low[r, lane] = bottom
        high[r, lane] = top
        cap[0, lane] = max(cap[0, lane], least)
        cap[1, lane] = min(cap[1, lane], most)


@kernel
def _rows(local, inv_h, vlim, alim, binomial, v, square, top, a, b, slope, low, high, cap):
    """Velocity and acceleration rows of one block; ``local (D + 1, n, LANES)`` in σ ∈ [0, 1]."""
    degree = local.shape[0] - 1
    n = local.shape[1]
    m = degree - 1
    for lane in range(LANES):
        cap[0, lane] = 0.0
        cap[1, lane] = np.inf
    top[:] = 0.0
    r = 0
    for j in range(n):
        fast = 1.0 / (vlim[j, 1] * vlim[j, 1])
        back = 1.0 / (vlim[j, 0] * vlim[j, 0])
        if fast > 0.0 or back > 0.0:
            for p in range(degree):
                weight = (p + 1) / binomial[m, p]
                for lane in range(LANES):
                    v[p, lane] = weight * local[p + 1, j, lane] * inv_h[lane]
            for level in range(1, degree):
                for p in range(m, level - 1, -1):
                    for lane in range(LANES):
                        v[p, lane] += v[p - 1, lane]
            for lane in range(LANES):
                a[lane] = 0.0
                b[lane] = 0.0
            for p in range(degree):
                for lane in range(LANES):
                    a[lane] = max(a[lane], v[p, lane])
                    b[lane] = min(b[lane], v[p, lane])
            for lane in range(LANES):
                a[lane] = max(fast if a[lane] > 0.0 else 0.0, back if b[lane] < 0.0 else 0.0)
            for k in range(2 * m + 1):
                for lane in range(LANES):
                    square[lane] = 0.0
                for p in range(max(0, k - m), min(m, k) + 1):
                    weight = binomial[m, p] * binomial[m, k - p] / binomial[2 * m, k]
                    for lane in range(LANES):
                        square[lane] += weight * v[p, lane] * v[k - p, lane]
                for lane in range(LANES):
                    top[k, lane] = max(top[k, lane], square[lane] * a[lane])
        # acceleration: (q' + 2 σ q'') u + q'' x with u = (y − x)/2h, as Bernstein coefficients a x + b y
        for p in range(degree):
            first = (p + 1.0) / binomial[m, p]
            second = (p + 2.0) * (p + 1.0) / binomial[m, p]
            mixed = (p + 1.0) * p / binomial[m, p]
            for lane in range(LANES):
                bend = second * local[p + 2, j, lane] if p + 2 <= degree else 0.0
                half = 0.5 * (first + 2.0 * mixed) * local[p + 1, j, lane]
                scale = inv_h[lane] * inv_h[lane]
                v[p, lane] = half * scale
                square[lane] = (bend - half) * scale
            for lane in range(LANES):
                top[2 * m + 1 + p, lane] = square[lane]
        for level in range(1, degree):
            for p in range(m, level - 1, -1):
                for lane in range(LANES):
                    v[p, lane] += v[p - 1, lane]
                    top[2 * m + 1 + p, lane] += top[2 * m + p, lane]
        for p in range(degree):
            _place(r, alim[j, 0], alim[j, 1], top[2 * m + 1 + p], v[p], slope, low, high, cap)
            r += 1
    # velocity² of the worst coordinate: Bernstein coefficients `top` of degree 2 D − 2, times x (1 − σ) + y σ
    last = 2 * degree - 1
    for lane in range(LANES):
        if top[0, lane] > 0.0:
            cap[1, lane] = min(cap[1, lane], 1.0 / top[0, lane])
    for k in range(1, last + 1):
        for lane in range(LANES):
            a[lane] = max(top[k, lane], 0.0) * (last - k) / last if k < last else 0.0
            b[lane] = max(top[k - 1, lane], 0.0) * k / last
        _place(r, -np.inf, 1.0, a, b, slope, low, high, cap)
        r += 1
    return r


@kernel
def _sampled_rows(i, lane, inv_h, sampled, bounds, r, slope, low, high, cap):
    """Rows of the sampled constraints ``lo ≤ A u + B x + C ≤ hi`` of interval i, taken as quadratic in σ.

    ``sampled (N, 3, E, 3)``: A, B, C at the start, middle and end of every interval; ``bounds (N, E, 2)``.
    """
    f = np.empty((3, 3))
    for e in range(sampled.shape[2]):
        for c in range(3):
            f[c, 0] = sampled[i, 0, e, c]
            f[c, 2] = sampled[i, 2, e, c]
            f[c, 1] = 2.0 * sampled[i, 1, e, c] - 0.5 * (f[c, 0] + f[c, 2])
        for k in range(4):
            # degree 3: A and C raised by one degree, B times x (1 − σ) + y σ
            left = (3 - k) / 3.0
            right = k / 3.0
            A = (left * f[0, k] if k < 3 else 0.0) + (right * f[0, k - 1] if k > 0 else 0.0)
            C = (left * f[2, k] if k < 3 else 0.0) + (right * f[2, k - 1] if k > 0 else 0.0)
            half = 0.5 * A * inv_h
            a = (left * f[1, k] if k < 3 else 0.0) - half
            b = (right * f[1, k - 1] if k > 0 else 0.0) + half
            m, bottom, top, least, most = _solved(a, b, bounds[i, e, 0] - C, bounds[i, e, 1] - C)
            slope[r, lane] = m
            low[r, lane] = bottom
            high[r, lane] = top
            cap[0, lane] = max(cap[0, lane], least)
            cap[1, lane] = min(cap[1, lane], most)
            r += 1


@kernel
def _load(coefficients, k, z, h, lane, local):
    """Taylor coefficients of piece k at offset z, scaled by h, into one lane of *local*."""
    degree = coefficients.shape[1] - 1
    n = coefficients.shape[2]
    for p in range(degree + 1):
        for j in range(n):
            local[p, j, lane] = coefficients[k, p, j]
    for p in range(degree):
        for q in range(degree - 1, p - 1, -1):
            for j in range(n):
                local[q, j, lane] += z * local[q + 1, j, lane]
    scale = 1.0
    for p in range(1, degree + 1):
        scale *= h
        for j in range(n):
            local[p, j, lane] *= scale


@kernel
def rows_along(breaks, coefficients, grid, vlim, alim, sampled, bounds, binomial, slope, low, high, cap):
    """Rows of all intervals of one path; lane l of block b is interval ``b LANES + l``."""
    degree = coefficients.shape[1] - 1
    n = coefficients.shape[2]
    count = grid.shape[0] - 1
    local = np.zeros((degree + 1, n, LANES))
    inv_h = np.empty(LANES)
    v = np.empty((degree, LANES))
    square = np.empty(LANES)
    top = np.empty((3 * degree - 1, LANES))
    a = np.empty(LANES)
    b = np.empty(LANES)
    for block in range(slope.shape[0]):
        for lane in range(LANES):
            i = min(block * LANES + lane, count - 1)
            h = grid[i + 1] - grid[i]
            inv_h[lane] = 1.0 / h
            k = locate(breaks, 0.5 * (grid[i] + grid[i + 1]))
            _load(coefficients, k, grid[i] - breaks[k], h, lane, local)
        r = _rows(
            local, inv_h, vlim, alim, binomial, v, square, top, a, b, slope[block], low[block], high[block], cap[block]
        )
        if sampled.shape[2] > 0:
            for lane in range(LANES):
                i = min(block * LANES + lane, count - 1)
                _sampled_rows(
                    i, lane, inv_h[lane], sampled, bounds, r, slope[block], low[block], high[block], cap[block]
                )


@kernel
def extreme(slope, low, high, lane, least, most, y_low, y_high, sign):
    """Largest (sign = 1) or smallest (sign = −1) x in [least, most] that leaves a y in [y_low, y_high]; −1 if none.

    ``gap(x) = (largest lower bound on y) − (smallest upper bound on y)`` is convex and piecewise linear, so Newton's
    iteration from outside reaches its root after finitely many pairs of rows, without ever passing it.
    """
    x = most if sign > 0.0 else least
    if most < least:
        return -1.0
    if x == np.inf:
        x = 1e18
    for _ in range(100):
        top = y_high
        top_slope = 0.0
        bottom = y_low
        bottom_slope = 0.0
        for r in range(slope.shape[0]):
            m = slope[r, lane]
            base = m * x
            upper = high[r, lane] + base
            lower = low[r, lane] + base
            if upper < top:
                top = upper
                top_slope = m
            if lower > bottom:
                bottom = lower
                bottom_slope = m
        gap = bottom - top
        if gap <= 0.0:
            return x
        steepness = bottom_slope - top_slope
        if steepness * sign <= 0.0:
            return -1.0
        following = x - gap / steepness
        if following == x:
            return x
        x = following
        if x < least:
            if least - x > 1e-12 * (1.0 + least):
                return -1.0
            x = least
        elif x > most:
            return -1.0
    return x


@kernel
def profile(grid, slope, low, high, cap, pinned, x_start, x_end, simple, alpha, beta, x):
    """Path speed squared ``x (N + 1,)`` at the grid points, as fast as the rows allow.

    ``pinned (N + 1,)`` marks grid points where the path has a kink and must be passed at rest; *simple* says that
    standing still is allowed everywhere, so that the least controllable speeds are 0. ``alpha, beta`` are the least
    and largest controllable values. Returns (status, stage).
    """
    count = grid.shape[0] - 1
    beta[count] = x_end
    alpha[count] = x_end
    for i in range(count - 1, -1, -1):
        block = i // LANES
        lane = i % LANES
        most = 0.0 if pinned[i] else cap[block, 1, lane]
        least = cap[block, 0, lane]
        beta[i] = extreme(slope[block], low[block], high[block], lane, least, most, alpha[i + 1], beta[i + 1], 1.0)
        if beta[i] < 0.0:
            return (END, i) if i == count - 1 and x_end > 0.0 else (INFEASIBLE, i)
        alpha[i] = least
        if not simple or alpha[i + 1] > 0.0:
            found = extreme(
                slope[block], low[block], high[block], lane, least, beta[i], alpha[i + 1], beta[i + 1], -1.0
            )
            alpha[i] = found if found >= 0.0 else beta[i]
    if x_start > beta[0] * (1.0 + 1e-12) or x_start < alpha[0] * (1.0 - 1e-12):
        return START, 0
    x[0] = min(x_start, beta[0])
    for i in range(count):
        block = i // LANES
        lane = i % LANES
        y = beta[i + 1]
        here = x[i]
        for r in range(slope.shape[1]):
            y = min(y, high[block, r, lane] + slope[block, r, lane] * here)
        y = max(y, alpha[i + 1])
        x[i + 1] = max(y, 0.0)
    return OK, count


@kernel
def mirror(slope, low, high, cap, count, slope_m, low_m, high_m, cap_m):
    """The same rows with the grid run backwards: solved for x instead of y."""
    rows = slope.shape[1]
    for i in range(count):
        block = i // LANES
        lane = i % LANES
        at = (count - 1 - i) // LANES
        to = (count - 1 - i) % LANES
        least = 0.0
        most = np.inf
        for r in range(rows):
            m = slope[block, r, lane]
            slope_m[at, r, to] = 0.0
            low_m[at, r, to] = -np.inf
            high_m[at, r, to] = np.inf
            if m == 0.0:
                least = max(least, low[block, r, lane])
                most = min(most, high[block, r, lane])
            else:
                first = -high[block, r, lane] / m
                second = -low[block, r, lane] / m
                slope_m[at, r, to] = 1.0 / m
                low_m[at, r, to] = min(first, second)
                high_m[at, r, to] = max(first, second)
        slope_m[at, rows, to] = 0.0
        low_m[at, rows, to] = cap[block, 0, lane]
        high_m[at, rows, to] = cap[block, 1, lane]
        cap_m[at, 0, to] = least
        cap_m[at, 1, to] = most


@kernel
def duration(grid, x):
    """Time of the profile *x*; infinite if it stands still over an interval."""
    total = 0.0
    for i in range(grid.shape[0] - 1):
        total += 2.0 * (grid[i + 1] - grid[i]) / (math.sqrt(x[i]) + math.sqrt(x[i + 1]))
    return total


@kernel
def relieve(grid, slope, low, high, cap, pinned, x_start, x_end, simple, beta, x):
    """Mend what the greedy choice spoils on coarse grids, where a high speed at one point forces a low one at the next.

    The allowed profiles are a convex set and the time is convex on it; so the mean of the profile that is greedy
    forward and the one that is greedy backward is allowed, and little slower than either where they agree.
    """
    count = x.shape[0] - 1
    spoilt = False
    for i in range(1, count):
        if not pinned[i] and x[i] < 0.05 * beta[i]:
            spoilt = True
    if not spoilt:
        return
    blocks = slope.shape[0]
    rows = slope.shape[1]
    slope_m = np.empty((blocks, rows + 1, LANES))
    low_m = np.empty((blocks, rows + 1, LANES))
    high_m = np.empty((blocks, rows + 1, LANES))
    cap_m = np.empty((blocks, 2, LANES))
    mirror(slope, low, high, cap, count, slope_m, low_m, high_m, cap_m)
    back = np.zeros(count + 1)
    first = np.empty(count + 1)
    second = np.empty(count + 1)
    reverse = -grid[::-1].copy()
    status, _ = profile(
        reverse, slope_m, low_m, high_m, cap_m, pinned[::-1].copy(), x_end, x_start, simple, first, second, back
    )
    if status != OK:
        return
    best = x.copy()
    least = duration(grid, x)
    for share in (0.25, 0.5, 0.75, 1.0):
        for i in range(count + 1):
            second[i] = (1.0 - share) * x[i] + share * back[count - i]
        time = duration(grid, second)
        if time < least:
            least = time
            best[:] = second
    x[:] = best


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


@kernel
def subdivide(breaks, parts, out):
    """The grid with ``parts (K,)`` equal intervals in every piece."""
    i = 0
    for k in range(parts.shape[0]):
        m = int(parts[k])
        for p in range(m):
            out[i] = breaks[k] + (breaks[k + 1] - breaks[k]) * (p / m)
            i += 1
    out[i] = breaks[-1]


@kernel
def kinks(breaks, coefficients, grid, pinned):
    """Mark the grid points at breaks of the path where its tangent jumps."""
    degree = coefficients.shape[1] - 1
    for k in range(coefficients.shape[0] - 1):
        h = breaks[k + 1] - breaks[k]
        jump = 0.0
        size = 1.0
        for j in range(coefficients.shape[2]):
            left = 0.0
            for p in range(degree, 0, -1):
                left = left * h + p * coefficients[k, p, j]
            right = coefficients[k + 1, 1, j]
            size = max(size, abs(left), abs(right))
            jump = max(jump, abs(left - right))
        if jump > 1e-9 * size:
            pinned[np.searchsorted(grid, breaks[k + 1])] = True


@kernel
def solve(breaks, coefficients, grid, vlim, alim, sampled, bounds, binomial, x_start, x_end, alpha, beta, x, t, timing):
    """Everything for one path: rows, profile, times. Returns (status, stage)."""
    count = grid.shape[0] - 1
    blocks = (count + LANES - 1) // LANES
    size = row_count(coefficients.shape[1] - 1, coefficients.shape[2], sampled.shape[2])
    slope = np.empty((blocks, size, LANES))
    low = np.empty((blocks, size, LANES))
    high = np.empty((blocks, size, LANES))
    cap = np.empty((blocks, 2, LANES))
    rows_along(breaks, coefficients, grid, vlim, alim, sampled, bounds, binomial, slope, low, high, cap)
    pinned = np.zeros(count + 1, dtype=np.bool_)
    kinks(breaks, coefficients, grid, pinned)
    status, stage = profile(grid, slope, low, high, cap, pinned, x_start, x_end, sampled.shape[2] == 0, alpha, beta, x)
    if status == OK:
        relieve(grid, slope, low, high, cap, pinned, x_start, x_end, sampled.shape[2] == 0, beta, x)
        for i in range(count):
            if x[i] <= 0.0 and x[i + 1] <= 0.0:
                return STALLED, i
        times(grid, x, t, timing)
    return status, stage
