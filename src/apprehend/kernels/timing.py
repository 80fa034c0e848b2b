"""Time-optimal path timing: certified rows per grid interval, then reachability analysis backward and forward.

On the interval ``[s_i, s_i + h]`` the path speed squared ``x(s) = ṡ²`` runs linearly from ``x`` to ``y`` (constant
path acceleration). A limit on a polynomial that is linear in (x, y), such as the acceleration
``q' (y − x)/2h + q'' x(s)``, holds on the whole interval as soon as it holds for each of its Bernstein coefficients,
which are linear in (x, y) too: rows ``lo ≤ a x + b y ≤ hi``, stored solved for y as ``low ≤ y − slope x ≤ high``.

Rows are built on lanes: a block holds WIDE intervals, of one path (`rows_along`) or of as many paths
(`rows_across`). Reachability analysis after Pham & Pham (2018): the controllable speeds backward, the greedy choice
forward; the two-variable linear programs are solved by a monotone Newton iteration on a convex piecewise linear
function.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel

WIDE = 64
"""Lanes of a block. Loops of 16 short steps are unrolled before they can be vectorised; loops of 64 are not."""

MASK = 0x7FFFFFFF
"""Offsets into lane buffers are masked with it, so that the compiler knows that they are not negative."""

OK = 0
INFEASIBLE = 1
START = 2
END = 3
STALLED = 4


@kernel
def row_count(degree, n, sampled):
    """Rows per interval: acceleration, velocity (all coordinates in one), sampled constraints."""
    return degree * n + 2 * degree - 1 + 4 * sampled


@kernel
def work_size(degree):
    """Lane components of scratch that `velocity_acceleration_rows` needs."""
    return 4 + degree + 3 * degree


@kernel
def _solved(a, b, lo, hi, r, lane, size, out):
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
            _solved(work[ia + lane], work[ib + lane], lo, hi, r, lane, size, out)


@kernel
def velocity_acceleration_rows(local, shift, degree, n, vlim, alim, binomial, work, size, out):
    """Velocity and acceleration rows of one block.

    ``local ((D + 1) n WIDE)``: Taylor coefficients in σ ∈ [0, 1], coefficient p of coordinate j at ``p n + j``;
    ``shift`` as in `load_block`; ``work`` is scratch. Row r of *out* holds slope, low and high at ``3 r`` … ``3 r + 2``; after
    *size* rows come the least and the largest x. All are flat lane buffers, so that the compiler sees what overlaps.
    """
    m = degree - 1
    a = 0
    b = WIDE
    square = 2 * WIDE
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
            for lane in range(WIDE):
                work[a + lane] = 0.0
                work[b + lane] = 0.0
            for p in range(degree):
                weight = (p + 1) / binomial[m, p]
                to = v + (p * WIDE & MASK)
                source = ((p + 1) * n + j) * WIDE & MASK
                for lane in range(WIDE):
                    work[to + lane] = weight * local[source + lane] * shift[2 * WIDE + lane]
            for level in range(1, degree):
                for p in range(m, level - 1, -1):
                    to = v + (p * WIDE & MASK)
                    before = v + ((p - 1) * WIDE & MASK)
                    for lane in range(WIDE):
                        work[to + lane] += work[before + lane]
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
        # acceleration: (q' + 2 σ q'') u + q'' x with u = (y − x)/2h, as Bernstein coefficients a x + b y
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
        for level in range(1, degree):
            for p in range(m, level - 1, -1):
                to = v + (p * WIDE & MASK)
                before = v + ((p - 1) * WIDE & MASK)
                for lane in range(WIDE):
                    work[to + lane] += work[before + lane]
                to = acc + (p * WIDE & MASK)
                before = acc + ((p - 1) * WIDE & MASK)
                for lane in range(WIDE):
                    work[to + lane] += work[before + lane]
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
def _sampled_rows(i, lane, inv_h, sampled, bounds, r, size, out):
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
            _solved(a, b, bounds[i, e, 0] - C, bounds[i, e, 1] - C, r, lane, size, out)
            r += 1


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
    """Rows of all intervals of one path ``out (blocks, (3 R + 2) WIDE)``; lane l of block b: interval ``b WIDE + l``."""
    degree = coefficients.shape[1] - 1
    n = coefficients.shape[2]
    count = grid.shape[0] - 1
    size = row_count(degree, n, sampled.shape[2])
    local = np.zeros((degree + 1) * n * WIDE)
    shift = np.empty(3 * WIDE)
    piece = np.empty(WIDE, dtype=np.int64)
    work = np.empty(work_size(degree) * WIDE)
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
        load_block(coefficients, piece, shift, local)
        r = velocity_acceleration_rows(local, shift, degree, n, vlim, alim, binomial, work, size, out[block])
        if sampled.shape[2] > 0:
            for lane in range(WIDE):
                i = min(block * WIDE + lane, count - 1)
                _sampled_rows(i, lane, shift[2 * WIDE + lane], sampled, bounds, r, size, out[block])


@kernel
def extreme(rows, size, lane, least, most, y_low, y_high, sign):
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
        for r in range(size):
            place = 3 * r * WIDE + lane
            m = rows[place]
            base = m * x
            upper = rows[place + 2 * WIDE] + base
            lower = rows[place + WIDE] + base
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
def profile(grid, rows, size, pinned, x_start, x_end, simple, alpha, beta, x):
    """Path speed squared ``x (N + 1,)`` at the grid points, as fast as the rows allow.

    ``pinned (N + 1,)`` marks grid points where the path has a kink and must be passed at rest; *simple* says that
    standing still is allowed everywhere, so that the least controllable speeds are 0. ``alpha, beta`` are the least
    and largest controllable values. Returns (status, stage).
    """
    count = grid.shape[0] - 1
    end = 3 * size * WIDE
    beta[count] = x_end
    alpha[count] = x_end
    for i in range(count - 1, -1, -1):
        here = rows[i // WIDE]
        lane = i % WIDE
        most = 0.0 if pinned[i] else here[end + WIDE + lane]
        least = here[end + lane]
        beta[i] = extreme(here, size, lane, least, most, alpha[i + 1], beta[i + 1], 1.0)
        if beta[i] < 0.0:
            return (END, i) if i == count - 1 and x_end > 0.0 else (INFEASIBLE, i)
        alpha[i] = least
        if not simple or alpha[i + 1] > 0.0:
            found = extreme(here, size, lane, least, beta[i], alpha[i + 1], beta[i + 1], -1.0)
            alpha[i] = found if found >= 0.0 else beta[i]
    if x_start > beta[0] * (1.0 + 1e-12) or x_start < alpha[0] * (1.0 - 1e-12):
        return START, 0
    x[0] = min(x_start, beta[0])
    for i in range(count):
        here = rows[i // WIDE]
        lane = i % WIDE
        y = beta[i + 1]
        for r in range(size):
            place = 3 * r * WIDE + lane
            y = min(y, here[place + 2 * WIDE] + here[place] * x[i])
        x[i + 1] = max(y, alpha[i + 1], 0.0)
    return OK, count


@kernel
def mirror(rows, size, count, out):
    """The same rows with the grid run backwards: solved for x instead of y; one row more."""
    end = 3 * size * WIDE
    for i in range(count):
        here = rows[i // WIDE]
        lane = i % WIDE
        there = out[(count - 1 - i) // WIDE]
        to = (count - 1 - i) % WIDE
        last = 3 * (size + 1) * WIDE + to
        there[last] = 0.0
        there[last + WIDE] = np.inf
        for r in range(size):
            place = 3 * r * WIDE + lane
            m = here[place]
            if m == 0.0:
                _solved(1.0, 0.0, here[place + WIDE], here[place + 2 * WIDE], r, to, size + 1, there)
            else:
                _solved(1.0, -m, here[place + WIDE], here[place + 2 * WIDE], r, to, size + 1, there)
        _solved(0.0, 1.0, here[end + lane], here[end + WIDE + lane], size, to, size + 1, there)


@kernel
def collapses(x, pinned):
    """Whether the speed collapses from one grid point to the next and recovers: what the greedy choice can spoil."""
    count = 0
    for i in range(1, x.shape[0] - 1):
        if not pinned[i] and x[i] < 0.05 * x[i - 1] and x[i] < 0.05 * x[i + 1]:
            count += 1
    return count > 0


@kernel
def duration(grid, x):
    """Time of the profile *x*; infinite if it stands still over an interval."""
    total = 0.0
    for i in range(grid.shape[0] - 1):
        total += 2.0 * (grid[i + 1] - grid[i]) / (math.sqrt(x[i]) + math.sqrt(x[i + 1]))
    return total


@kernel
def relieve(grid, rows, size, pinned, x_start, x_end, simple, x):
    """Mend what the greedy choice spoils on coarse grids, where a high speed at one point forces a low one at the next.

    The allowed profiles are a convex set and the time is convex on it; so the mean of the profile that is greedy
    forward and the one that is greedy backward is allowed, and little slower than either where they agree.
    """
    count = x.shape[0] - 1
    backward = np.empty((rows.shape[0], (3 * (size + 1) + 2) * WIDE))
    mirror(rows, size, count, backward)
    back = np.zeros(count + 1)
    trial = np.empty(count + 1)
    reverse = np.empty(count + 1)
    marks = np.empty(count + 1, dtype=np.bool_)
    for i in range(count + 1):
        reverse[i] = -grid[count - i]
        marks[i] = pinned[count - i]
    scratch = np.empty(count + 1)
    status, _ = profile(reverse, backward, size + 1, marks, x_end, x_start, simple, scratch, trial, back)
    if status != OK:
        return
    least = duration(grid, x)
    chosen = 0.0
    for share in (0.25, 0.5, 0.75, 1.0):
        for i in range(count + 1):
            trial[i] = (1.0 - share) * x[i] + share * back[count - i]
        time = duration(grid, trial)
        if time < least:
            least = time
            chosen = share
    for i in range(count + 1):
        x[i] = (1.0 - chosen) * x[i] + chosen * back[count - i]


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
def split_evenly(breaks, count, least, parts):
    """Intervals ``parts (K,)`` per piece: near their share of *count*, at least *least*; returns their sum.

    The sum is *count* itself unless that is too small: shares are rounded at their running total.
    """
    pieces = parts.shape[0]
    span = breaks[pieces] - breaks[0]
    total = 0
    for k in range(pieces):
        share = (breaks[k + 1] - breaks[0]) / span * count
        wanted = math.floor(share + 0.5) - total
        parts[k] = max(wanted, least)
        total += parts[k]
    while total > count:  # take back what the small pieces got too much, from the largest
        k = 0
        for i in range(pieces):
            if parts[i] > parts[k]:
                k = i
        if parts[k] <= least:
            break
        parts[k] -= 1
        total -= 1
    return total


@kernel
def subdivide(breaks, parts, out):
    """The grid with ``parts (K,)`` equal intervals in every piece."""
    i = 0
    for k in range(parts.shape[0]):
        m = parts[k]
        for p in range(m):
            out[i] = breaks[k] + (breaks[k + 1] - breaks[k]) * (p / m)
            i += 1
    out[i] = breaks[-1]


@kernel
def kinks(breaks, coefficients, grid, pinned):
    """Mark the grid points at breaks of the path where its tangent jumps."""
    degree = coefficients.shape[1] - 1
    i = 0
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
            while grid[i] < breaks[k + 1]:
                i += 1
            pinned[i] = True


@kernel
def solve_into(
    breaks, coefficients, grid, vlim, alim, sampled, bounds, binomial, x_start, x_end, rows, pinned, alpha, beta, x
):
    """The profile of one path; ``rows (blocks, (3 R + 2) WIDE)`` and ``pinned (N + 1,)`` are scratch."""
    count = grid.shape[0] - 1
    size = row_count(coefficients.shape[1] - 1, coefficients.shape[2], sampled.shape[2])
    rows_along(breaks, coefficients, grid, vlim, alim, sampled, bounds, binomial, rows)
    for i in range(count + 1):
        pinned[i] = False
    kinks(breaks, coefficients, grid, pinned)
    simple = sampled.shape[2] == 0
    status, stage = profile(grid, rows, size, pinned, x_start, x_end, simple, alpha, beta, x)
    if status == OK:
        if collapses(x, pinned):
            relieve(grid, rows, size, pinned, x_start, x_end, simple, x)
        for i in range(count):
            if x[i] <= 0.0 and x[i + 1] <= 0.0:
                return STALLED, i
    return status, stage


@kernel
def solve_many(
    breaks, coefficients, first, grids, vlim, alim, sampled, bounds, binomial, x_start, x_end, start, stop, x, durations
):
    """Profiles ``x (P, N + 1)`` and durations (infinite where there is none) of the paths *start* … *stop*.

    ``breaks`` and ``coefficients`` hold all paths one after the other; the pieces of path p begin at ``first[p]``, its
    breaks p places later, since every path has one break more than pieces.
    """
    count = grids.shape[1] - 1
    size = row_count(coefficients.shape[1] - 1, coefficients.shape[2], 0)
    rows = np.empty(((count + WIDE - 1) // WIDE, (3 * size + 2) * WIDE))
    pinned = np.empty(count + 1, dtype=np.bool_)
    alpha = np.empty(count + 1)
    beta = np.empty(count + 1)
    for p in range(start, stop):
        status, _ = solve_into(
            breaks[first[p] + p : first[p + 1] + p + 1], coefficients[first[p] : first[p + 1]], grids[p], vlim, alim,
            sampled, bounds, binomial, x_start, x_end, rows, pinned, alpha, beta, x[p],
        )  # fmt: skip
        durations[p] = duration(grids[p], x[p]) if status == OK else np.inf
