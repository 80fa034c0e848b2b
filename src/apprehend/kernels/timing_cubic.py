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


@kernel
def shifted(c, z, n, out):
    """Coefficients 1 … 3 of cubics about the offsets ``z (WIDE)``; *c* and *out* ``(3 n WIDE)``."""
    for j in range(n):
        c1 = j * WIDE & MASK
        c2 = (n + j) * WIDE & MASK
        c3 = (2 * n + j) * WIDE & MASK
        for lane in range(WIDE):
            s = z[lane]
            third = c[c3 + lane]
            second = c[c2 + lane] + 3.0 * s * third
            out[c1 + lane] = c[c1 + lane] + s * (c[c2 + lane] + second)
            out[c2 + lane] = second
            out[c3 + lane] = third


@kernel
def _joint_rows(j, n, local, step, fast, back, lowest, highest, work, out):
    """Three acceleration rows of joint j into *out*; its velocity² joins the worst in *work*.

    A row whose coefficient of y vanishes bounds x alone. Written out: a loop over the three would be a loop inside
    that over the lanes, or three passes over memory.
    """
    c1 = j * WIDE & MASK
    c2 = (n + j) * WIDE & MASK
    c3 = (2 * n + j) * WIDE & MASK
    base = (9 * j) * WIDE & MASK
    for lane in range(WIDE):
        h = step[lane]
        v0 = local[c1 + lane]
        w0 = 2.0 * local[c2 + lane]
        bend = 6.0 * local[c3 + lane] * h
        w1 = w0 + bend
        v1 = v0 + 0.5 * w0 * h
        v2 = v0 + w0 * h + 0.5 * bend * h
        top = max(v0, max(v1, v2))
        low = min(v0, min(v1, v2))
        weight = max(fast if top > 0.0 else 0.0, back if low < 0.0 else 0.0)
        work[lane] = max(work[lane], v0 * v0 * weight)
        work[WIDE + lane] = max(work[WIDE + lane], v0 * v1 * weight)
        work[2 * WIDE + lane] = max(work[2 * WIDE + lane], (v0 * v2 + 2.0 * v1 * v1) * weight * 0.3333333333333333)
        work[3 * WIDE + lane] = max(work[3 * WIDE + lane], v1 * v2 * weight)
        work[4 * WIDE + lane] = max(work[4 * WIDE + lane], v2 * v2 * weight)
        half = 0.5 / h
        most = work[5 * WIDE + lane]
        b = v0 * half
        a = w0 - b
        plain = abs(b) > 1e-13 * abs(a)
        inverse = 1.0 / (b if plain else a)
        first = lowest * inverse
        second = highest * inverse
        high = max(first, second)
        out[base + lane] = -a * inverse if plain else 0.0
        out[base + WIDE + lane] = min(first, second) if plain else -np.inf
        out[base + 2 * WIDE + lane] = high if plain else np.inf
        most = min(most, np.inf if plain else high)
        b = 0.5 * w0 + v1 * half
        a = 0.5 * w1 - v1 * half
        plain = abs(b) > 1e-13 * abs(a)
        inverse = 1.0 / (b if plain else a)
        first = lowest * inverse
        second = highest * inverse
        high = max(first, second)
        out[base + 3 * WIDE + lane] = -a * inverse if plain else 0.0
        out[base + 4 * WIDE + lane] = min(first, second) if plain else -np.inf
        out[base + 5 * WIDE + lane] = high if plain else np.inf
        most = min(most, np.inf if plain else high)
        a = -v2 * half
        b = w1 - a
        plain = abs(b) > 1e-13 * abs(a)
        inverse = 1.0 / (b if plain else a)
        first = lowest * inverse
        second = highest * inverse
        high = max(first, second)
        out[base + 6 * WIDE + lane] = -a * inverse if plain else 0.0
        out[base + 7 * WIDE + lane] = min(first, second) if plain else -np.inf
        out[base + 8 * WIDE + lane] = high if plain else np.inf
        work[5 * WIDE + lane] = min(most, np.inf if plain else high)


@kernel
def cubic_rows(local, step, n, vlim, alim, work, size, out):
    """Rows of one block of intervals ``step (WIDE)`` long, of cubics with ``local (3 n WIDE)`` (see `shifted`).

    *out* as in `timing_rows`; *work* ``(WORK WIDE)`` is scratch. Returns the number of rows.
    """
    for k in range(5 * WIDE):
        work[k] = 0.0
    for lane in range(WIDE):
        work[5 * WIDE + lane] = np.inf
    for j in range(n):
        fast = 1.0 / (vlim[j, 1] * vlim[j, 1])
        back = 1.0 / (vlim[j, 0] * vlim[j, 0])
        _joint_rows(j, n, local, step, fast, back, alim[j, 0], alim[j, 1], work, out)
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
