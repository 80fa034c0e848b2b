"""Certified rows of path timing: limits on velocity and acceleration that hold on whole grid intervals.

On the interval ``[s_i, s_i + h]`` the path speed squared ``x(s) = ṡ²`` runs linearly from ``x`` to ``y`` (constant
path acceleration). A limit on a polynomial that is linear in (x, y), such as the acceleration
``q' (y − x)/2h + q'' x(s)``, holds on the whole interval as soon as it holds for each of its Bernstein coefficients,
which are linear in (x, y) too: rows ``lo ≤ a x + b y ≤ hi``, stored solved for y as ``low ≤ y − slope x ≤ high``.
A block of rows holds WIDE intervals side by side.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .timing_cubic import MASK, WIDE, WORK, cubic_rows
from .timing_sampled import ROWS, VALUES, sampled_rows


@kernel
def row_count(degree, n, sampled):
    """Rows per interval: acceleration, velocity (all coordinates in one), sampled constraints."""
    return degree * n + 2 * degree - 1 + ROWS * sampled


@kernel
def work_size(degree):
    """Lane components of scratch that `velocity_acceleration_rows` needs."""
    return 4 + degree + 3 * degree


@kernel
def file_row(a, b, lo, hi, r, lane, size, out):
    """File one row ``lo ≤ a x + b y ≤ hi`` of one lane: slope, low, high; where it has no y, as a bound on x."""
    at_slope = 3 * r * WIDE + lane
    out[at_slope] = 0.0
    out[at_slope + WIDE] = -np.inf
    out[at_slope + 2 * WIDE] = np.inf
    least = 0.0
    most = np.inf
    if abs(b) > 1e-13 * abs(a):
        first = lo / b
        second = hi / b
        out[at_slope] = -a / b
        out[at_slope + WIDE] = min(first, second)
        out[at_slope + 2 * WIDE] = max(first, second)
    elif a != 0.0:
        first = lo / a
        second = hi / a
        least = max(min(first, second), 0.0)
        most = max(first, second)
    elif lo > 0.0 or hi < 0.0:
        most = -1.0
    end = 3 * size * WIDE + lane
    out[end] = max(out[end], least)
    out[end + WIDE] = min(out[end + WIDE], most)


@kernel
def _place(r, lo, hi, ia, ib, work, size, out):
    """File the row r of all lanes; its coefficients a and b are at *ia* and *ib* of *work*."""
    odd = 0.0
    base = (3 * r) * WIDE & MASK
    for lane in range(WIDE):
        a = work[ia + lane]
        b = work[ib + lane]
        plain = abs(b) > 1e-13 * abs(a)
        odd += 0.0 if plain else 1.0
        inverse = 1.0 / (b if plain else 1.0)
        first = lo * inverse
        second = hi * inverse
        out[base + lane] = -a * inverse
        out[base + WIDE + lane] = first if first < second else second
        out[base + 2 * WIDE + lane] = second if first < second else first
    if odd > 0.0:
        for lane in range(WIDE):
            file_row(work[ia + lane], work[ib + lane], lo, hi, r, lane, size, out)


@kernel
def _square_of_velocity(local, shift, j, degree, n, fast, back, binomial, work):
    """Bernstein coefficients of ``q'²`` of coordinate j over its limit, joined with the worst of the others.

    Work: two lanes of sign, one of sums, then from 4 on ``q'`` (degree), from 4 + degree on the worst (2 degree − 1).
    """
    m = degree - 1
    a = 0
    b = WIDE
    square = 2 * WIDE
    v = 4 * WIDE
    top = (4 + degree) * WIDE
    for lane in range(WIDE):
        work[a + lane] = 0.0
        work[b + lane] = 0.0
    for p in range(degree):
        weight = (p + 1) / binomial[m, p]
        to = v + (p * WIDE & MASK)
        source = ((p + 1) * n + j) * WIDE & MASK
        for lane in range(WIDE):
            work[to + lane] = weight * local[source + lane] * shift[2 * WIDE + lane]
    _accumulate(v, degree, work)
    for p in range(degree):
        to = v + (p * WIDE & MASK)
        for lane in range(WIDE):
            value = work[to + lane]
            work[a + lane] = value if value > work[a + lane] else work[a + lane]
            work[b + lane] = value if value < work[b + lane] else work[b + lane]
    for lane in range(WIDE):
        forward = fast if work[a + lane] > 0.0 else 0.0
        backward = back if work[b + lane] < 0.0 else 0.0
        work[a + lane] = forward if forward > backward else backward
    for k in range(2 * m + 1):
        for lane in range(WIDE):
            work[square + lane] = 0.0
        for p in range(max(0, k - m), min(m, k) + 1):
            weight = binomial[m, p] * binomial[m, k - p] / binomial[2 * m, k]
            one = v + (p * WIDE & MASK)
            two = v + ((k - p) * WIDE & MASK)
            for lane in range(WIDE):
                work[square + lane] += weight * work[one + lane] * work[two + lane]
        to = top + (k * WIDE & MASK)
        for lane in range(WIDE):
            value = work[square + lane] * work[a + lane]
            work[to + lane] = value if value > work[to + lane] else work[to + lane]


@kernel
def _accumulate(v, degree, work):
    """Power to Bernstein coefficients in place, once the powers are divided by their binomials."""
    for level in range(1, degree):
        for p in range(degree - 1, level - 1, -1):
            to = v + (p * WIDE & MASK)
            before = v + ((p - 1) * WIDE & MASK)
            for lane in range(WIDE):
                work[to + lane] += work[before + lane]


@kernel
def _acceleration(local, shift, j, degree, n, binomial, work):
    """``(q' + 2 σ q'') u + q'' x`` with ``u = (y − x)/2h``, as Bernstein coefficients: b at 4 of *work*, a behind the
    squares."""
    m = degree - 1
    v = 4 * WIDE
    acc = (4 + degree + 2 * m + 1) * WIDE & MASK
    for p in range(degree):
        first = 0.5 * (p + 1.0) / binomial[m, p] + (p + 1.0) * p / binomial[m, p]
        second = (p + 2.0) * (p + 1.0) / binomial[m, p] if p + 2 <= degree else 0.0
        source = ((p + 1) * n + j) * WIDE & MASK
        further = ((p + 2 if p + 2 <= degree else p + 1) * n + j) * WIDE & MASK
        to = v + (p * WIDE & MASK)
        other = acc + (p * WIDE & MASK)
        for lane in range(WIDE):
            scale = shift[2 * WIDE + lane] * shift[2 * WIDE + lane]
            half = first * local[source + lane]
            work[to + lane] = half * scale
            work[other + lane] = (second * local[further + lane] - half) * scale
    _accumulate(v, degree, work)
    _accumulate(acc, degree, work)


@kernel
def velocity_acceleration_rows(local, shift, degree, n, vlim, alim, binomial, work, size, out):
    """Velocity and acceleration rows of one block; returns their number.

    ``local ((D + 1) n WIDE)``: Taylor coefficients in σ ∈ [0, 1], coefficient p of coordinate j at ``p n + j``;
    ``shift`` as in `load_block`; ``work`` is scratch. Row r of *out* holds slope, low and high at ``3 r`` … ``3 r + 2``; after
    *size* rows come the least and the largest x. All are flat lane buffers, so that the compiler sees what overlaps.
    """
    m = degree - 1
    a = 0
    b = WIDE
    v = 4 * WIDE
    top = (4 + degree) * WIDE
    acc = (4 + degree + 2 * m + 1) * WIDE & MASK
    end = (3 * size) * WIDE & MASK
    for lane in range(WIDE):
        out[end + lane] = 0.0
        out[end + WIDE + lane] = np.inf
    for k in range((2 * m + 1) * WIDE):
        work[top + k] = 0.0
    r = 0
    for j in range(n):
        fast = 1.0 / (vlim[j, 1] * vlim[j, 1])
        back = 1.0 / (vlim[j, 0] * vlim[j, 0])
        if fast > 0.0 or back > 0.0:
            _square_of_velocity(local, shift, j, degree, n, fast, back, binomial, work)
        _acceleration(local, shift, j, degree, n, binomial, work)
        for p in range(degree):
            _place(r, alim[j, 0], alim[j, 1], acc + (p * WIDE & MASK), v + (p * WIDE & MASK), work, size, out)
            r += 1
    # velocity² of the worst coordinate: Bernstein coefficients at `top` of degree 2 D − 2, times x (1 − σ) + y σ
    last = 2 * degree - 1
    for lane in range(WIDE):
        if work[top + lane] > 0.0:
            out[end + WIDE + lane] = min(out[end + WIDE + lane], 1.0 / work[top + lane])
    for k in range(1, last + 1):
        left = (last - k) / last
        right = k / last
        here = top + ((k if k < last else 0) * WIDE & MASK)
        before = top + ((k - 1) * WIDE & MASK)
        for lane in range(WIDE):
            work[a + lane] = left * work[here + lane]
            work[b + lane] = right * work[before + lane]
        _place(r, -np.inf, 1.0, a, b, work, size, out)
        r += 1
    return r


@kernel
def load_block(coefficients, piece, shift, local):
    """Taylor coefficients of the pieces ``piece (WIDE)`` at the offsets z, scaled by h; ``shift`` holds z, h, 1/h."""
    degree = coefficients.shape[1] - 1
    n = coefficients.shape[2]
    same = True
    for lane in range(WIDE):
        same = same and piece[lane] == piece[0]
    for p in range(degree + 1):
        for j in range(n):
            to = (p * n + j) * WIDE & MASK
            if same:
                value = coefficients[piece[0], p, j]
                for lane in range(WIDE):
                    local[to + lane] = value
            else:
                for lane in range(WIDE):
                    local[to + lane] = coefficients[piece[lane], p, j]
    for p in range(degree):
        for q in range(degree - 1, p - 1, -1):
            for j in range(n):
                to = (q * n + j) * WIDE & MASK
                above = ((q + 1) * n + j) * WIDE & MASK
                for lane in range(WIDE):
                    local[to + lane] += shift[lane] * local[above + lane]
    for p in range(1, degree + 1):
        for j in range(n):
            to = (p * n + j) * WIDE & MASK
            for lane in range(WIDE):
                h = shift[WIDE + lane]
                scale = h
                for _ in range(p - 1):
                    scale *= h
                local[to + lane] *= scale


@kernel
def rows_along(breaks, coefficients, grid, vlim, alim, sampled, bounds, binomial, out):
    """Rows of all intervals of one path ``out (blocks, (3 R + 2) WIDE)``; lane l of block b: interval ``b WIDE + l``.

    ``sampled (blocks, E VALUES WIDE)`` and ``bounds (blocks, E 2 WIDE)`` as in `timing_sampled`.
    """
    degree = coefficients.shape[1] - 1
    n = coefficients.shape[2]
    count = grid.shape[0] - 1
    size = row_count(degree, n, sampled.shape[1] // (VALUES * WIDE))
    local = np.zeros((degree + 1) * n * WIDE)
    c = np.empty(3 * n * WIDE)
    shift = np.empty(3 * WIDE)
    place = np.empty(3 * WIDE)
    piece = np.empty(WIDE, dtype=np.int64)
    work = np.empty(max(work_size(degree), WORK) * WIDE)
    k = 0
    for block in range(out.shape[0]):
        for lane in range(WIDE):
            i = min(block * WIDE + lane, count - 1)
            while k < breaks.shape[0] - 2 and breaks[k + 1] <= 0.5 * (grid[i] + grid[i + 1]):
                k += 1
            piece[lane] = k
            shift[lane] = grid[i] - breaks[k]
            shift[WIDE + lane] = grid[i + 1] - grid[i]
            shift[2 * WIDE + lane] = 1.0 / (grid[i + 1] - grid[i])
        if degree == 3:
            for p in range(3):
                for j in range(n):
                    to = (p * n + j) * WIDE & MASK
                    for lane in range(WIDE):
                        c[to + lane] = coefficients[piece[lane], p + 1, j]
            for lane in range(WIDE):
                place[lane] = shift[lane]
                place[WIDE + lane] = shift[WIDE + lane]
                place[2 * WIDE + lane] = 0.5 * shift[2 * WIDE + lane]
            r = cubic_rows(c, place, n, vlim, alim, work, size, out[block])
        else:
            load_block(coefficients, piece, shift, local)
            r = velocity_acceleration_rows(local, shift, degree, n, vlim, alim, binomial, work, size, out[block])
        if sampled.shape[1] > 0:
            sampled_rows(sampled[block], bounds[block], shift[WIDE : 2 * WIDE], r, size, work, out[block])
