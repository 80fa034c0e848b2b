"""Candidates of closed forms made exact on lanes: Newton steps on the true chain, doubles removed, turns and limits."""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .ik_chain import ERR, TARGET, WORK, L
from .ik_queue import TURN, evaluate, newton, rest_lane

TIGHT = 2e-13  # residual (over the reach, or rad) above which a candidate gets a Newton step
REACHED = 1e-9  # residual below which a candidate counts as a branch
SAME = 1e-6  # branches nearer to each other than this in every joint are one: they meet at a singularity


@kernel
def refine(chain, targets, owner, first, last, x, most, error):
    """Newton steps on lanes for the candidates first … of ``x (B, k)``, which aim at ``targets[owner[b]] (12)``.

    Those above `TIGHT` move, at most *most* times, each as if it were alone; ``error (B)`` is the larger of distance
    and angle.
    """
    k = x.shape[1]
    q = np.zeros(k * L)
    axes = np.zeros(6 * chain.kind.shape[0] * L)
    J = np.zeros(6 * k * L)
    step = np.zeros(k * L)
    w = np.zeros(WORK)
    box = np.full(6, TIGHT)
    for block in range(first, last, L):
        for l in range(L):
            rest_lane(w, l)
            b = min(block + l, last - 1)
            for i in range(12):
                w[TARGET + i * L + l] = targets[owner[b], i]
            for c in range(k):
                q[c * L + l] = x[b, c]
        for turn_number in range(most + 1):
            evaluate(chain, q, axes, w, box, False, -1)
            open_lanes = 0
            for l in range(min(L, last - block)):
                distance = angle = 0.0
                for r in range(3):
                    distance += w[ERR + r * L + l] ** 2
                    angle += w[ERR + (3 + r) * L + l] ** 2
                e = math.sqrt(max(distance, angle))
                if turn_number == 0 or TIGHT < error[block + l] > e:  # lanes that are done wait for the others
                    error[block + l] = e
                    for c in range(k):
                        x[block + l, c] = q[c * L + l]
                if error[block + l] > TIGHT:
                    open_lanes += 1
            if open_lanes == 0 or turn_number == most:
                break
            newton(chain, q, axes, w, J, step, False)


@kernel(borrow=True)
def on_nearest_turn(value, near, lower, upper):
    """An angle on the turn nearest to *near* that is within the limits, if any is."""
    value -= TURN * math.floor((value - near) / TURN + 0.5)
    if value > upper:
        value -= TURN * math.ceil((value - upper) / TURN - 1e-12)
    if value < lower:
        value += TURN * math.ceil((lower - value) / TURN - 1e-12)
    return value


@kernel(borrow=True)
def _alike(x, a, b, unit):
    """Whether two rows are the same joint vector but for `SAME` and whole turns."""
    for c in range(unit.shape[0]):
        d = abs(x[a, c] - x[b, c])
        if unit[c] == 1.0:
            d = abs(d - TURN * math.floor(d / TURN + 0.5))
        if d > SAME:
            return False
    return True


@kernel
def finish(
    chain,
    unit,
    targets,
    number,
    candidates,
    near,
    lower,
    upper,
    limited,
    free,
    fill,
    first,
    last,
    q,
    valid,
    residual,
    code,
):
    """From ``candidates (N, M, k)``, by joint, to branches ``q (N, B, n)`` of the robot, with their residuals.

    Rows that are no branch repeat the first one, or ``fill (N or 1, n)``, which also gives the coordinates outside
    ``free (k)``.

    ``code (N)``: 0 there is a valid branch, 1 only ones outside the limits, 2 none at all.
    """
    k = candidates.shape[2]
    total = 0
    for i in range(first, last):
        total += number[i]
    owner = np.empty(total, np.int64)
    x = np.empty((total, k))
    error = np.zeros(total)
    b = 0
    for i in range(first, last):
        for s in range(number[i]):
            owner[b] = i
            for j in range(k):
                c = chain.column[j]
                x[b, c] = candidates[i, s, j] / unit[c]
            b += 1
    refine(chain, targets, owner, 0, total, x, 8, error)
    b = 0
    own = np.empty((q.shape[1], k))
    for i in range(first, last):
        code[i] = 2
        for s in range(number[i]):
            residual[i, s] = error[b]
            good = error[b] < REACHED
            for c in range(k):
                v = x[b, c] * unit[c]
                own[s, c] = v - TURN * math.ceil(v / TURN - 0.5) if unit[c] == 1.0 else v
            b += 1
            for other in range(s):
                if good and valid[i, other] and _alike(own, s, other, unit):
                    good = False
            valid[i, s] = good
        start = -1
        for s in range(number[i]):
            if not valid[i, s]:
                continue
            within = True
            if limited:
                for c in range(k):
                    v = own[s, c]
                    if unit[c] == 1.0:
                        v = on_nearest_turn(v, near[i if near.shape[0] > 1 else 0, c], lower[c], upper[c])
                    if v < lower[c] - 1e-12 or v > upper[c] + 1e-12:
                        within = False
                    own[s, c] = min(max(v, lower[c]), upper[c])
            code[i] = min(code[i], 0 if within else 1)
            valid[i, s] = within
            if within and start < 0:
                start = s
        for s in range(q.shape[1]):
            for c in range(q.shape[2]):
                q[i, s, c] = fill[i if fill.shape[0] > 1 else 0, c]
            if start >= 0:
                for c in range(k):
                    q[i, s, free[c]] = own[s if valid[i, s] else start, c]
            if not valid[i, s]:
                residual[i, s] = 0.0
