"""Certified rows of paths of degree three, the common case: everything of a joint in one pass over the lanes.

The same rows in the same order as `timing_rows` makes for any degree, several times faster. For ``q'`` with Bernstein
coefficients v0, v1, v2 and ``q''`` with w0, w1 on an interval of length h, the acceleration
``q' (y − x)/2h + q'' x(σ)`` has the coefficients ``a x + b y`` with

    a: w0 − v0/2h, (w1 − v1/h)/2, −v2/2h        b: v0/2h, (w0 + v1/h)/2, w1 + v2/2h.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel

WIDE = 64
"""Lanes of a block. Loops of 16 short steps are unrolled before they can be vectorised; loops of 64 are not."""

MASK = 0x7FFFFFFF
"""Offsets into lane buffers are masked with it, so that the compiler knows that they are not negative."""

WORK = 6
"""Lane components of scratch: five Bernstein coefficients of velocity², and the largest x."""


@kernel(inline=True, borrow=True)
def _hull(c1, c2, c3, z, h):
    """Bernstein coefficients v0, v1, v2 of q' and w0, w1 of q'' on [z, z + h], of the cubic with c1, c2, c3 about 0."""
    second = c2 + 3.0 * z * c3
    v0 = c1 + z * (c2 + second)
    w0 = 2.0 * second
    bend = 6.0 * c3 * h
    v1 = v0 + 0.5 * w0 * h
    return v0, v1, v0 + w0 * h + 0.5 * bend * h, w0, w0 + bend


@kernel(inline=True, borrow=True)
def _join_velocity(v0, v1, v2, fast, back, lane, work):
    """The square of q' as a share of its limit joins the worst of the other joints."""
    top = max(v0, max(v1, v2))
    low = min(v0, min(v1, v2))
    weight = max(fast if top > 0.0 else 0.0, back if low < 0.0 else 0.0)
    work[lane] = max(work[lane], v0 * v0 * weight)
    work[WIDE + lane] = max(work[WIDE + lane], v0 * v1 * weight)
    work[2 * WIDE + lane] = max(work[2 * WIDE + lane], (v0 * v2 + 2.0 * v1 * v1) * weight * 0.3333333333333333)
    work[3 * WIDE + lane] = max(work[3 * WIDE + lane], v1 * v2 * weight)
    work[4 * WIDE + lane] = max(work[4 * WIDE + lane], v2 * v2 * weight)


@kernel(inline=True, borrow=True)
def _pairs(v0, v1, v2, w0, w1, half):
    """a and b of the three rows: see the head of this module."""
    return w0 - v0 * half, v0 * half, 0.5 * w1 - v1 * half, 0.5 * w0 + v1 * half, -v2 * half, w1 + v2 * half


@kernel(borrow=True)
def _joint_rows(j, n, c, place, fast, back, lowest, highest, work, out):
    """Three acceleration rows of joint j into *out*; its velocity² joins the worst in *work*, the bounds on x alone (of
    rows whose coefficient of y vanishes) the least.

    Written out: a loop over the three would be a loop inside that over the lanes, or three passes over memory.
    """
    at1 = j * WIDE & MASK
    at2 = (n + j) * WIDE & MASK
    at3 = (2 * n + j) * WIDE & MASK
    base = 9 * j * WIDE & MASK
    for lane in range(WIDE):
        v0, v1, v2, w0, w1 = _hull(c[at1 + lane], c[at2 + lane], c[at3 + lane], place[lane], place[WIDE + lane])
        _join_velocity(v0, v1, v2, fast, back, lane, work)
        half = place[2 * WIDE + lane]
        a0, b0, a1, b1, a2, b2 = _pairs(v0, v1, v2, w0, w1, half)
        plain0 = abs(b0) > 1e-13 * abs(a0)
        plain1 = abs(b1) > 1e-13 * abs(a1)
        plain2 = abs(b2) > 1e-13 * abs(a2)
        i0 = 1.0 / (b0 if plain0 else a0)
        i1 = 1.0 / (b1 if plain1 else a1)
        i2 = 1.0 / (b2 if plain2 else a2)
        high0 = max(lowest * i0, highest * i0)
        high1 = max(lowest * i1, highest * i1)
        high2 = max(lowest * i2, highest * i2)
        out[base + lane] = -a0 * i0 if plain0 else 0.0
        out[base + WIDE + lane] = min(lowest * i0, highest * i0) if plain0 else -np.inf
        out[base + 2 * WIDE + lane] = high0 if plain0 else np.inf
        out[base + 3 * WIDE + lane] = -a1 * i1 if plain1 else 0.0
        out[base + 4 * WIDE + lane] = min(lowest * i1, highest * i1) if plain1 else -np.inf
        out[base + 5 * WIDE + lane] = high1 if plain1 else np.inf
        out[base + 6 * WIDE + lane] = -a2 * i2 if plain2 else 0.0
        out[base + 7 * WIDE + lane] = min(lowest * i2, highest * i2) if plain2 else -np.inf
        out[base + 8 * WIDE + lane] = high2 if plain2 else np.inf
        most = min(np.inf if plain0 else high0, min(np.inf if plain1 else high1, np.inf if plain2 else high2))
        work[5 * WIDE + lane] = min(work[5 * WIDE + lane], most)


@kernel(borrow=True)
def cubic_rows(c, place, n, vlim, alim, work, size, out):
    """Rows of one block of intervals of cubics with the coefficients 1 … 3 ``c (3 n WIDE)``; returns their number.

    ``place (3 WIDE)``: where the interval begins in the variable of c, its length h, and 1/2h. *out* as in
    `timing_rows`; *work* ``(WORK WIDE)`` is scratch.
    """
    for k in range(5 * WIDE):
        work[k] = 0.0
    for lane in range(WIDE):
        work[5 * WIDE + lane] = np.inf
    for j in range(n):
        fast = 1.0 / (vlim[j, 1] * vlim[j, 1])
        back = 1.0 / (vlim[j, 0] * vlim[j, 0])
        _joint_rows(j, n, c, place, fast, back, alim[j, 0], alim[j, 1], work, out)
    for lane in range(WIDE):
        work[5 * WIDE + lane] = min(work[5 * WIDE + lane], 1.0 / work[lane])
    base = 9 * n * WIDE & MASK
    for k in range(5):
        left = (4.0 - k) / 5.0
        right = (k + 1.0) / 5.0
        here = (k + 1 if k < 4 else 0) * WIDE & MASK
        before = k * WIDE & MASK
        to = base + (3 * k * WIDE & MASK)
        for lane in range(WIDE):
            a = left * work[here + lane]
            b = right * work[before + lane]
            plain = b > 1e-13 * a
            inverse = 1.0 / (b if plain else a)
            out[to + lane] = -a * inverse if plain else 0.0
            out[to + WIDE + lane] = -np.inf
            out[to + 2 * WIDE + lane] = inverse if plain else np.inf
            work[5 * WIDE + lane] = min(work[5 * WIDE + lane], np.inf if plain else inverse)
    end = 3 * size * WIDE & MASK
    for lane in range(WIDE):
        out[end + lane] = 0.0
        out[end + WIDE + lane] = work[5 * WIDE + lane]
    return 3 * n + 5


@kernel(borrow=True)
def _reach_joint(j, n, c, place, fast, back, lowest, highest, work, xy):
    """Lower y as far as the acceleration rows of joint j ask for: ``xy (2 WIDE)`` holds x and y."""
    at1 = j * WIDE & MASK
    at2 = (n + j) * WIDE & MASK
    at3 = (2 * n + j) * WIDE & MASK
    for lane in range(WIDE):
        v0, v1, v2, w0, w1 = _hull(c[at1 + lane], c[at2 + lane], c[at3 + lane], place[lane], place[WIDE + lane])
        _join_velocity(v0, v1, v2, fast, back, lane, work)
        half = place[2 * WIDE + lane]
        x = xy[lane]
        a0, b0, a1, b1, a2, b2 = _pairs(v0, v1, v2, w0, w1, half)
        plain0 = abs(b0) > 1e-13 * abs(a0)
        plain1 = abs(b1) > 1e-13 * abs(a1)
        plain2 = abs(b2) > 1e-13 * abs(a2)
        y0 = ((highest if b0 > 0.0 else lowest) - a0 * x) / b0
        y1 = ((highest if b1 > 0.0 else lowest) - a1 * x) / b1
        y2 = ((highest if b2 > 0.0 else lowest) - a2 * x) / b2
        y = min(y0 if plain0 else np.inf, min(y1 if plain1 else np.inf, y2 if plain2 else np.inf))
        xy[WIDE + lane] = min(xy[WIDE + lane], y)


@kernel(borrow=True)
def reach(c, place, n, vlim, alim, work, xy):
    """The largest y that the rows of `cubic_rows` leave at x, and no more than y: both in ``xy (2 WIDE)``."""
    for k in range(5 * WIDE):
        work[k] = 0.0
    for j in range(n):
        fast = 1.0 / (vlim[j, 1] * vlim[j, 1])
        back = 1.0 / (vlim[j, 0] * vlim[j, 0])
        _reach_joint(j, n, c, place, fast, back, alim[j, 0], alim[j, 1], work, xy)
    for k in range(5):
        left = (4.0 - k) / 5.0
        right = (k + 1.0) / 5.0
        here = (k + 1 if k < 4 else 0) * WIDE & MASK
        before = k * WIDE & MASK
        for lane in range(WIDE):
            a = left * work[here + lane]
            b = right * work[before + lane]
            plain = b > 1e-13 * a
            y = (1.0 - a * xy[lane]) / (b if plain else 1.0)
            xy[WIDE + lane] = min(xy[WIDE + lane], y if plain else np.inf)
