"""Time-optimal timing of many cubic paths at once: every lane is a path, all on grids of one size.

The passes of `timing` with their decisions as masks: the controllable speeds backward, the greedy choice forward. Rows
are made twice, once for each pass; that is cheaper than to keep them.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .timing import OK, duration, grid_parts, kinks, solve_into, subdivide
from .timing_cubic import MASK, WIDE, WORK, cubic_rows, reach
from .timing_rows import row_count

ALONE = 12
"""Up to this many paths in a block are faster one by one."""

# components of the state of `extreme_lanes`
TOP, TOP_BASE, TOP_SLOPE, BOTTOM, BOTTOM_BASE, BOTTOM_SLOPE, DONE, X, LEAST, MOST, Y_LOW, Y_HIGH, PARTS = (
    0, WIDE, 2 * WIDE, 3 * WIDE, 4 * WIDE, 5 * WIDE, 6 * WIDE, 7 * WIDE, 8 * WIDE, 9 * WIDE, 10 * WIDE, 11 * WIDE, 12,
)  # fmt: skip


@kernel(borrow=True)
def extreme_lanes(rows, n, size, sign, state):
    """`timing.extreme` on all lanes: x from LEAST, MOST, Y_LOW, Y_HIGH of *state*; −1 where there is none."""
    for lane in range(WIDE):
        start = state[MOST + lane] if sign > 0.0 else state[LEAST + lane]
        bad = state[MOST + lane] < state[LEAST + lane] or state[Y_HIGH + lane] < state[Y_LOW + lane]
        state[X + lane] = -1.0 if bad else min(start, 1e18)
        state[DONE + lane] = 1.0 if bad else 0.0
    for _ in range(100):
        for lane in range(WIDE):
            state[TOP + lane] = state[Y_HIGH + lane]
            state[TOP_BASE + lane] = state[Y_HIGH + lane]
            state[TOP_SLOPE + lane] = 0.0
            state[BOTTOM + lane] = state[Y_LOW + lane]
            state[BOTTOM_BASE + lane] = state[Y_LOW + lane]
            state[BOTTOM_SLOPE + lane] = 0.0
        for j in range(n):
            _meet_joint(rows, j, state)
        for r in range(3 * n, size):  # velocity rows bound y from above only
            at = 3 * r * WIDE & MASK
            for lane in range(WIDE):
                m = rows[at + lane]
                hi = rows[at + 2 * WIDE + lane]
                value = hi + m * state[X + lane]
                less = value < state[TOP + lane]
                state[TOP + lane] = value if less else state[TOP + lane]
                state[TOP_BASE + lane] = hi if less else state[TOP_BASE + lane]
                state[TOP_SLOPE + lane] = m if less else state[TOP_SLOPE + lane]
        active = 0.0
        for lane in range(WIDE):
            here = state[X + lane]
            gap = state[BOTTOM + lane] - state[TOP + lane]
            steep = state[BOTTOM_SLOPE + lane] - state[TOP_SLOPE + lane]
            tb = state[TOP_BASE + lane]
            bb = state[BOTTOM_BASE + lane]
            goal = (tb - bb) / steep
            inside = min(max(goal, state[LEAST + lane]), state[MOST + lane])
            rounding = 1e-12 * (1.0 + inside) + 1e-13 * (abs(tb) + abs(bb)) / abs(steep)
            flat = steep * sign <= 0.0
            keep = state[DONE + lane] > 0.0 or gap <= 0.0 or ((here - goal) * sign <= 0.0 and not flat)
            lost = flat or abs(goal - inside) > rounding
            state[X + lane] = here if keep else (-1.0 if lost else inside)
            end = keep or lost
            state[DONE + lane] = 1.0 if end else 0.0
            active += 0.0 if end else 1.0
        if active == 0.0:
            break


@kernel(borrow=True)
def _meet_joint(rows, j, state):
    """The least upper and the largest lower bound of y at x, after the three acceleration rows of joint j."""
    at = 9 * j * WIDE & MASK  # masked here: what is not known to be positive is not vectorised
    for lane in range(WIDE):
        here = state[X + lane]
        t = state[TOP + lane]
        tb = state[TOP_BASE + lane]
        ts = state[TOP_SLOPE + lane]
        b = state[BOTTOM + lane]
        bb = state[BOTTOM_BASE + lane]
        bs = state[BOTTOM_SLOPE + lane]
        m = rows[at + lane]
        lo = rows[at + WIDE + lane]
        hi = rows[at + 2 * WIDE + lane]
        less = hi + m * here < t
        t = hi + m * here if less else t
        tb = hi if less else tb
        ts = m if less else ts
        more = lo + m * here > b
        b = lo + m * here if more else b
        bb = lo if more else bb
        bs = m if more else bs
        m = rows[at + 3 * WIDE + lane]
        lo = rows[at + 4 * WIDE + lane]
        hi = rows[at + 5 * WIDE + lane]
        less = hi + m * here < t
        t = hi + m * here if less else t
        tb = hi if less else tb
        ts = m if less else ts
        more = lo + m * here > b
        b = lo + m * here if more else b
        bb = lo if more else bb
        bs = m if more else bs
        m = rows[at + 6 * WIDE + lane]
        lo = rows[at + 7 * WIDE + lane]
        hi = rows[at + 8 * WIDE + lane]
        less = hi + m * here < t
        state[TOP + lane] = hi + m * here if less else t
        state[TOP_BASE + lane] = hi if less else tb
        state[TOP_SLOPE + lane] = m if less else ts
        more = lo + m * here > b
        state[BOTTOM + lane] = lo + m * here if more else b
        state[BOTTOM_BASE + lane] = lo if more else bb
        state[BOTTOM_SLOPE + lane] = m if more else bs


@kernel(borrow=True)
def _interval(i, grid, breaks, coefficients, first, begin, last, piece, c, n, place):
    """Put interval i of every lane's path in *place* ``(5 WIDE)``: offset, length h, 1/2h, and the ends of its piece.

    *piece* and the coefficients *c* are kept from interval to interval; ``grid (N + 1, WIDE)``; lane l holds path
    ``min(begin + l, last)``.
    """
    moved = 0.0
    for lane in range(WIDE):
        low = grid[i, lane]
        h = grid[i + 1, lane] - low
        place[lane] = low - place[3 * WIDE + lane]
        place[WIDE + lane] = h
        place[2 * WIDE + lane] = 0.5 / h
        middle = low + 0.5 * h
        moved += 1.0 if middle < place[3 * WIDE + lane] or middle >= place[4 * WIDE + lane] else 0.0
    if moved == 0.0:
        return
    for lane in range(WIDE):
        p = min(begin + lane, last)
        at = first[p] + p
        middle = grid[i, lane] + 0.5 * place[WIDE + lane]
        if middle >= place[3 * WIDE + lane] and middle < place[4 * WIDE + lane]:
            continue
        k = max(piece[lane], 0)
        while k > 0 and breaks[at + k] > middle:
            k -= 1
        while k < first[p + 1] - first[p] - 1 and breaks[at + k + 1] <= middle:
            k += 1
        piece[lane] = k
        place[lane] = grid[i, lane] - breaks[at + k]
        place[3 * WIDE + lane] = breaks[at + k]
        place[4 * WIDE + lane] = breaks[at + k + 1]
        for q in range(3):
            for j in range(n):
                c[(q * n + j) * WIDE + lane] = coefficients[first[p] + k, q + 1, j]


@kernel
def _block(breaks, coefficients, first, grid, pinned, vlim, alim, x_start, x_end, begin, last, alpha, beta, x, good):
    """Profiles ``x (N + 1, WIDE)`` of one block of paths; ``good (WIDE)`` is 0 where there is none."""
    n = coefficients.shape[2]
    count = grid.shape[0] - 1
    size = row_count(3, n, 0)
    rows = np.empty((3 * size + 2) * WIDE)
    work = np.empty(WORK * WIDE)
    state = np.empty(PARTS * WIDE)
    c = np.empty(3 * n * WIDE)
    place = np.full(5 * WIDE, np.inf)
    xy = np.empty(2 * WIDE)
    piece = np.full(WIDE, -1, dtype=np.int64)
    end = 3 * size * WIDE & MASK
    for lane in range(WIDE):
        beta[count, lane] = x_end
        alpha[count, lane] = x_end
        good[lane] = 1.0
    for i in range(count - 1, -1, -1):
        _interval(i, grid, breaks, coefficients, first, begin, last, piece, c, n, place)
        cubic_rows(c, place, n, vlim, alim, work, size, rows)
        rising = 0.0
        for lane in range(WIDE):
            state[LEAST + lane] = rows[end + lane]
            state[MOST + lane] = rows[end + WIDE + lane] if pinned[i, lane] > 0.0 else 0.0
            state[Y_LOW + lane] = alpha[i + 1, lane]
            state[Y_HIGH + lane] = beta[i + 1, lane]
            rising += alpha[i + 1, lane]
        extreme_lanes(rows, n, size, 1.0, state)
        for lane in range(WIDE):
            found = state[X + lane]
            good[lane] = 0.0 if found < 0.0 else good[lane]
            beta[i, lane] = max(found, 0.0)
            alpha[i, lane] = state[LEAST + lane]
        if rising > 0.0:
            for lane in range(WIDE):
                state[MOST + lane] = beta[i, lane]
            extreme_lanes(rows, n, size, -1.0, state)
            for lane in range(WIDE):
                least = state[X + lane] if state[X + lane] >= 0.0 else beta[i, lane]
                alpha[i, lane] = least if alpha[i + 1, lane] > 0.0 else alpha[i, lane]
    for lane in range(WIDE):
        outside = x_start > beta[0, lane] * (1.0 + 1e-12) or x_start < alpha[0, lane] * (1.0 - 1e-12)
        good[lane] = 0.0 if outside else good[lane]
        x[0, lane] = min(x_start, beta[0, lane])
    for i in range(count):
        _interval(i, grid, breaks, coefficients, first, begin, last, piece, c, n, place)
        for lane in range(WIDE):
            xy[lane] = x[i, lane]
            xy[WIDE + lane] = beta[i + 1, lane]
        reach(c, place, n, vlim, alim, work, xy)
        for lane in range(WIDE):
            x[i + 1, lane] = max(xy[WIDE + lane], alpha[i + 1, lane])


@kernel
def _mended(grid, x, pinned, good, seconds):
    """Durations of all lanes; ``good`` becomes −1 where the greedy choice collapses (see `timing.collapses`)."""
    count = grid.shape[0] - 1
    for lane in range(WIDE):
        seconds[lane] = 0.0
    for i in range(count):
        for lane in range(WIDE):
            speed = math.sqrt(x[i, lane]) + math.sqrt(x[i + 1, lane])
            seconds[lane] += 2.0 * (grid[i + 1, lane] - grid[i, lane]) / speed
    for i in range(1, count):
        for lane in range(WIDE):
            low = x[i, lane] < 0.05 * x[i - 1, lane] and x[i, lane] < 0.05 * x[i + 1, lane]
            good[lane] = -1.0 if low and pinned[i, lane] > 0.0 else good[lane]


@kernel
def shares(breaks, first, count, least, parts, totals):
    """`timing.grid_parts` for every path; *parts* ``(all pieces)``, *totals* ``(P,)``."""
    for p in range(totals.shape[0]):
        totals[p] = grid_parts(
            breaks[first[p] + p : first[p + 1] + p + 1], count, least, parts[first[p] : first[p + 1]]
        )


@kernel
def solve_many(
    breaks, coefficients, first, parts, vlim, alim, sampled, bounds, binomial, x_start, x_end, start, stop, grids, x,
    durations,
):  # fmt: skip
    """Grids and profiles ``(P, N + 1)`` and durations (infinite where there is none) of blocks *start* … *stop*.

    ``breaks`` and ``coefficients (K, 4, n)`` hold all paths one after the other; the pieces of path p begin at
    ``first[p]``, its breaks p places later, since every path has one break more than pieces.
    """
    total = grids.shape[0]
    count = grids.shape[1] - 1
    grid, alpha, beta, found, pinned = (
        np.empty((count + 1, WIDE)), np.empty((count + 1, WIDE)), np.empty((count + 1, WIDE)),
        np.empty((count + 1, WIDE)), np.empty((count + 1, WIDE)),
    )  # fmt: skip
    good = np.empty(WIDE)
    seconds = np.empty(WIDE)
    torn = np.empty(WIDE, dtype=np.bool_)
    size = row_count(3, coefficients.shape[2], 0)
    rows = np.empty(((count + WIDE - 1) // WIDE, (3 * size + 2) * WIDE))
    marks = np.empty(count + 1, dtype=np.bool_)
    low = np.empty(count + 1)
    high = np.empty(count + 1)
    for block in range(start, stop):
        begin = block * WIDE
        last = min(begin + WIDE, total) - 1
        for lane in range(WIDE):
            p = min(begin + lane, last)
            own = breaks[first[p] + p : first[p + 1] + p + 1]
            if begin + lane <= last:
                subdivide(own, parts[first[p] : first[p + 1]], grids[p])
            for i in range(count + 1):
                marks[i] = False
            torn[lane] = kinks(own, coefficients[first[p] : first[p + 1]], grids[p], marks) >= 0
            for i in range(count + 1):
                grid[i, lane] = grids[p, i]
                pinned[i, lane] = 0.0 if marks[i] else 1.0
        together = last - begin >= ALONE
        if together:
            _block(
                breaks, coefficients, first, grid, pinned, vlim, alim, x_start, x_end, begin, last, alpha, beta, found,
                good,
            )  # fmt: skip
            _mended(grid, found, pinned, good, seconds)
        for p in range(begin, last + 1):
            if together and good[p - begin] >= 0.0:
                for i in range(count + 1):
                    x[p, i] = found[i, p - begin]
                durations[p] = seconds[p - begin] if good[p - begin] > 0.0 and not torn[p - begin] else np.inf
                continue
            status, _ = solve_into(
                breaks[first[p] + p : first[p + 1] + p + 1], coefficients[first[p] : first[p + 1]], grids[p], vlim,
                alim, sampled, bounds, binomial, x_start, x_end, rows, marks, low, high, x[p],
            )  # fmt: skip
            durations[p] = duration(grids[p], x[p]) if status == OK else np.inf
