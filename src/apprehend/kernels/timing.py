"""Time-optimal path timing by reachability analysis on certified rows (see `timing_rows`).

The controllable speeds backward, the greedy choice forward (Pham & Pham 2018). The two-variable linear programs are
solved by a monotone Newton iteration on a convex piecewise linear function.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .timing_cubic import WIDE
from .timing_rows import file_row, row_count, rows_along
from .timing_sampled import VALUES

OK = 0
INFEASIBLE = 1
START = 2
END = 3
STALLED = 4
TORN = 5

GRADES = 3
"""Intervals that are added at either end of a grid: see `subdivide`."""
GRADED_FROM = 30
"""Grids of fewer intervals are even."""


@kernel(borrow=True)
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
        top_base = y_high
        top_slope = 0.0
        bottom = y_low
        bottom_base = y_low
        bottom_slope = 0.0
        for r in range(size):
            place = 3 * r * WIDE + lane
            m = rows[place]
            base = m * x
            upper = rows[place + 2 * WIDE] + base
            lower = rows[place + WIDE] + base
            if upper < top:
                top = upper
                top_base = rows[place + 2 * WIDE]
                top_slope = m
            if lower > bottom:
                bottom = lower
                bottom_base = rows[place + WIDE]
                bottom_slope = m
        gap = bottom - top
        if gap <= 0.0:
            return x
        steepness = bottom_slope - top_slope
        if steepness * sign <= 0.0:
            return -1.0
        following = (top_base - bottom_base) / steepness  # where the two rows meet: exact from however far
        if (x - following) * sign <= 0.0:  # no further, by rounding
            return x
        x = following
        if x < least or x > most:
            inside = least if x < least else most
            rounding = 1e-12 * (1.0 + inside) + 1e-13 * (abs(top_base) + abs(bottom_base)) / abs(steepness)
            if abs(x - inside) > rounding:
                return -1.0
            x = inside
    return x


@kernel(borrow=True)
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


@kernel(borrow=True)
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
                file_row(1.0, 0.0, here[place + WIDE], here[place + 2 * WIDE], r, to, size + 1, there)
            else:
                file_row(1.0, -m, here[place + WIDE], here[place + 2 * WIDE], r, to, size + 1, there)
        file_row(0.0, 1.0, here[end + lane], here[end + WIDE + lane], size, to, size + 1, there)


@kernel(borrow=True)
def collapses(x, pinned):
    """Whether the speed collapses from one grid point to the next and recovers: what the greedy choice can spoil."""
    count = 0
    for i in range(1, x.shape[0] - 1):
        if not pinned[i] and x[i] < 0.05 * x[i - 1] and x[i] < 0.05 * x[i + 1]:
            count += 1
    return count > 0


@kernel(borrow=True)
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


@kernel(borrow=True)
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


@kernel(borrow=True)
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
def grid_parts(breaks, count, least, parts):
    """`split_evenly` less the intervals that `subdivide` adds at the ends; returns the size of the grid, in intervals."""
    extra = 2 * GRADES if count >= GRADED_FROM else 0
    return split_evenly(breaks, count - extra, least, parts) + extra


@kernel(borrow=True)
def subdivide(breaks, parts, out):
    """The grid with ``parts (K,)`` equal intervals in every piece; the first and the last one are divided further
    where *out* has room, ever finer towards the end: next to rest, a constant acceleration serves badly over a long
    way."""
    i = 0
    total = 0
    for k in range(parts.shape[0]):
        total += parts[k]
    graded = out.shape[0] - 1 > total
    for k in range(parts.shape[0]):
        m = parts[k]
        width = breaks[k + 1] - breaks[k]
        for p in range(m):
            out[i] = breaks[k] + width * (p / m)
            i += 1
            if graded and k == 0 and p == 0:
                for g in range(GRADES):
                    out[i] = breaks[0] + width / m * 4.0 ** (g - GRADES)
                    i += 1
            if graded and k == parts.shape[0] - 1 and p == m - 1:
                for g in range(GRADES):
                    out[i] = breaks[-1] - width / m * 4.0 ** (-1 - g)
                    i += 1
    out[i] = breaks[-1]


@kernel
def kinks(breaks, coefficients, grid, pinned):
    """Mark the grid points at breaks of the path where its tangent jumps; the grid point where the path itself jumps is
    returned, −1 if there is none.

    What counts as a jump is measured, for each coordinate by itself, by its largest motion over a piece.
    """
    pieces, size, n = coefficients.shape
    moves = np.zeros(n)
    rates = np.zeros(n)
    for k in range(pieces):
        h = breaks[k + 1] - breaks[k]
        for j in range(n):
            move = 0.0
            rate = 0.0
            for p in range(size - 1, 0, -1):
                move = (move + abs(coefficients[k, p, j])) * h
                rate = rate * h + p * abs(coefficients[k, p, j])
            offset = abs(coefficients[k, 0, j])
            moves[j] = max(moves[j], move + 1e-3 * offset)  # the offsets are rounded too
            rates[j] = max(rates[j], rate + 1e-4 * offset / h)
    i = 0
    for k in range(pieces - 1):
        h = breaks[k + 1] - breaks[k]
        kink = False
        for j in range(n):
            end = 0.0
            left = 0.0
            for p in range(size - 1, 0, -1):
                end = (end + coefficients[k, p, j]) * h
                left = left * h + p * coefficients[k, p, j]
            kink = kink or abs(left - coefficients[k + 1, 1, j]) > 1e-9 * rates[j]
            if abs(end + coefficients[k, 0, j] - coefficients[k + 1, 0, j]) > 1e-9 * moves[j]:
                while grid[i] < breaks[k + 1]:
                    i += 1
                return i
        if kink:
            while grid[i] < breaks[k + 1]:
                i += 1
            pinned[i] = True
    return -1


@kernel
def solve_into(
    breaks, coefficients, grid, vlim, alim, sampled, bounds, binomial, x_start, x_end, rows, pinned, alpha, beta, x
):
    """The profile of one path; ``rows (blocks, (3 R + 2) WIDE)`` and ``pinned (N + 1,)`` are scratch."""
    count = grid.shape[0] - 1
    size = row_count(coefficients.shape[1] - 1, coefficients.shape[2], sampled.shape[1] // (VALUES * WIDE))
    rows_along(breaks, coefficients, grid, vlim, alim, sampled, bounds, binomial, rows)
    for i in range(count + 1):
        pinned[i] = False
    torn = kinks(breaks, coefficients, grid, pinned)
    if torn >= 0:
        return TORN, torn
    simple = sampled.shape[1] == 0
    status, stage = profile(grid, rows, size, pinned, x_start, x_end, simple, alpha, beta, x)
    if status == OK:
        if collapses(x, pinned):
            relieve(grid, rows, size, pinned, x_start, x_end, simple, x)
        for i in range(count):
            if x[i] <= 0.0 and x[i + 1] <= 0.0:
                return STALLED, i
    return status, stage
