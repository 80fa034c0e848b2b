"""Certified rows of constraints ``lo ≤ A u + B x + C ≤ hi`` whose A, B, C are quartics on every interval.

With ``u = (y − x)/2h`` constant and ``x(σ) = x (1 − σ) + y σ`` a constraint is a quintic in σ; each of its six
Bernstein coefficients is a row ``a x + b y``, as in `timing_rows`.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .timing_cubic import MASK, WIDE

ROWS = 6
"""Rows of one constraint."""
VALUES = 15
"""Lane components of one constraint: the Bernstein coefficients of A, of B, of C."""


@kernel
def sampled_rows(values, bounds, step, r, size, work, out):
    """Rows of one block from row *r* on: ``values (E VALUES WIDE)``, ``bounds (E 2 WIDE)`` (lowest, highest).

    *step* ``(WIDE)``; *work* ``(2 WIDE)`` is scratch; *out* as in `timing_rows`: rows, then the least and largest x.
    """
    end = 3 * size * WIDE & MASK
    for lane in range(WIDE):
        work[lane] = out[end + lane]
        work[WIDE + lane] = out[end + WIDE + lane]
    for e in range(bounds.shape[0] // (2 * WIDE)):
        limit = 2 * e * WIDE & MASK
        for k in range(ROWS):
            left = (5 - k) / 5.0
            right = k / 5.0
            here = (VALUES * e + min(k, 4)) * WIDE & MASK
            before = (VALUES * e + max(k - 1, 0)) * WIDE & MASK
            to = 3 * (r + ROWS * e + k) * WIDE & MASK
            for lane in range(WIDE):
                half = 0.5 * (left * values[here + lane] + right * values[before + lane]) / step[lane]
                a = left * values[here + 5 * WIDE + lane] - half
                b = right * values[before + 5 * WIDE + lane] + half
                still = left * values[here + 10 * WIDE + lane] + right * values[before + 10 * WIDE + lane]
                lowest = bounds[limit + lane] - still
                highest = bounds[limit + WIDE + lane] - still
                plain = abs(b) > 1e-13 * abs(a)
                none = a == 0.0 and b == 0.0
                inverse = 1.0 / (1.0 if none else (b if plain else a))
                first = lowest * inverse
                second = highest * inverse
                low = min(first, second)
                high = max(first, second)
                broken = lowest > highest or (none and (lowest > 0.0 or highest < 0.0))
                out[to + lane] = -a * inverse if plain else 0.0
                out[to + WIDE + lane] = low if plain else -np.inf
                out[to + 2 * WIDE + lane] = high if plain else np.inf
                work[lane] = max(work[lane], 0.0 if plain or none else low)
                most = np.inf if plain or none else high
                work[WIDE + lane] = min(work[WIDE + lane], -1.0 if broken else most)
    for lane in range(WIDE):
        out[end + lane] = work[lane]
        out[end + WIDE + lane] = work[WIDE + lane]
