"""Tolerances per axis for `ik_chain`: partial poses, and room that a step may use."""

from __future__ import annotations

import math

from ._jit import kernel
from .ik_chain import AGE, DAMPING, ERR, FLAG, FLOOR, GRAM, LAMBDA, PAST, PATIENCE, ROT, STALL, TARGET, L

LOOSE = 1e-3  # tolerances above this (over the reach, or rad) are freedom that steps may use


@kernel(borrow=True)
def box_error(w, tool, box, free_axis):
    """Error in the axes of the target, zero where it is inside a loose ``box (6)``; flags as in `pose_error`.

    *free_axis* is the one rotation axis whose tolerance is infinite (the error is then the turn between the two
    directions of that axis), or −1. Outside a tolerance above `LOOSE` an error is measured from half of it, so that
    the step leads inside; a tight one is no room to move in, and its row always stays.
    """
    oriented = math.isfinite(box[3]) or math.isfinite(box[4]) or math.isfinite(box[5])
    for l in range(L):
        total = 0.0
        inside = True
        x, y, z = 0.0, 0.0, 0.0
        if free_axis >= 0:
            a0, a1, a2 = tool[0, free_axis], tool[1, free_axis], tool[2, free_axis]
            u0 = w[ROT + l] * a0 + w[ROT + L + l] * a1 + w[ROT + 2 * L + l] * a2
            u1 = w[ROT + 3 * L + l] * a0 + w[ROT + 4 * L + l] * a1 + w[ROT + 5 * L + l] * a2
            u2 = w[ROT + 6 * L + l] * a0 + w[ROT + 7 * L + l] * a1 + w[ROT + 8 * L + l] * a2
            v0 = w[TARGET + l] * a0 + w[TARGET + L + l] * a1 + w[TARGET + 2 * L + l] * a2
            v1 = w[TARGET + 3 * L + l] * a0 + w[TARGET + 4 * L + l] * a1 + w[TARGET + 5 * L + l] * a2
            v2 = w[TARGET + 6 * L + l] * a0 + w[TARGET + 7 * L + l] * a1 + w[TARGET + 8 * L + l] * a2
            cosine = u0 * v0 + u1 * v1 + u2 * v2
            f = math.sqrt(2.0 / max(1.0 + cosine, 1e-3))
            x, y, z = f * (u1 * v2 - u2 * v1), f * (u2 * v0 - u0 * v2), f * (u0 * v1 - u1 * v0)
            if cosine < -0.9:
                total += 1.0
                inside = False
        else:
            x, y, z = w[ERR + 3 * L + l], w[ERR + 4 * L + l], w[ERR + 5 * L + l]
            trace = 0.0
            for i in range(9):
                trace += w[ROT + i * L + l] * w[TARGET + i * L + l]
            if trace < -0.99 and oriented:  # within 0.1 rad of a half turn the error above fades
                total += 1.0
                inside = False
        px, py, pz = w[ERR + l], w[ERR + L + l], w[ERR + 2 * L + l]
        for k in range(3):
            # axis k of the target frame: (target rotation · tool)[:, k]
            d0 = w[TARGET + l] * tool[0, k] + w[TARGET + L + l] * tool[1, k] + w[TARGET + 2 * L + l] * tool[2, k]
            d1 = (
                w[TARGET + 3 * L + l] * tool[0, k]
                + w[TARGET + 4 * L + l] * tool[1, k]
                + w[TARGET + 5 * L + l] * tool[2, k]
            )
            d2 = (
                w[TARGET + 6 * L + l] * tool[0, k]
                + w[TARGET + 7 * L + l] * tool[1, k]
                + w[TARGET + 8 * L + l] * tool[2, k]
            )
            for h in range(2):
                b = box[3 * h + k]
                e = (d0 * px + d1 * py + d2 * pz) if h == 0 else (d0 * x + d1 * y + d2 * z)
                if abs(e) > b:
                    inside = False
                if b > LOOSE:
                    e = 0.0 if abs(e) <= b else e - math.copysign(0.5 * b, e)
                w[ERR + (3 * h + k) * L + l] = e
                total += e * e
        w[LAMBDA + l] = FLOOR + DAMPING * total
        age = w[AGE + l]
        late = age >= PATIENCE
        if age == 4.0 * math.floor(age * 0.25):
            late = late or total > STALL * w[PAST + l]
            w[PAST + l] = total
        w[FLAG + l] = 1.0 if inside else (2.0 if late else 0.0)


@kernel(borrow=True)
def turn_columns(w, tool, J, k):
    """Rows of ``J`` into the axes of the target frame; rows whose error is zero (satisfied) are left out."""
    for l in range(L):
        for a in range(3):
            d0 = w[TARGET + l] * tool[0, a] + w[TARGET + L + l] * tool[1, a] + w[TARGET + 2 * L + l] * tool[2, a]
            d1 = (
                w[TARGET + 3 * L + l] * tool[0, a]
                + w[TARGET + 4 * L + l] * tool[1, a]
                + w[TARGET + 5 * L + l] * tool[2, a]
            )
            d2 = (
                w[TARGET + 6 * L + l] * tool[0, a]
                + w[TARGET + 7 * L + l] * tool[1, a]
                + w[TARGET + 8 * L + l] * tool[2, a]
            )
            w[GRAM + (3 * a) * L + l] = d0
            w[GRAM + (3 * a + 1) * L + l] = d1
            w[GRAM + (3 * a + 2) * L + l] = d2
    for c in range(k):
        for h in range(2):
            o = (6 * c + 3 * h) * L
            for l in range(L):
                x, y, z = J[o + l], J[o + L + l], J[o + 2 * L + l]
                for a in range(3):
                    g = GRAM + 3 * a * L + l
                    keep = 0.0 if w[ERR + (3 * h + a) * L + l] == 0.0 else 1.0
                    J[o + a * L + l] = keep * (w[g] * x + w[g + L] * y + w[g + 2 * L] * z)
