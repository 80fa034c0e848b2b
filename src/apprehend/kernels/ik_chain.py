"""One damped Newton step of inverse kinematics on lanes: pose error, Jacobian, limits, 6 × 6 solve.

`IKChain` is a serial chain in the form that costs least per step. The fixed rotation between two joints is written
Rz(a)·Rx(α)·Rz(b); both turns about z are moved into the offsets of the neighbouring joints, so only Rx(α) is left.
Unlike Denavit–Hartenberg parameters this form is well conditioned for nearly parallel axes too. The placement before the first
joint and the rotation after the last are taken out of the targets. Lengths are divided by the chain's reach.

==============  =============  =====================================================================================
field           shape          meaning (m joints that move, k coordinates that drive them)
==============  =============  =====================================================================================
``kind``        (m,) int64     0 revolute, 1 prismatic
``column``      (m,) int64     the coordinate that drives the joint
``gain``        (m, 2)         joint value = ``gain[0] * q + gain[1]``
``twist``       (m, 4)         cosine and sine of α; cosine and sine of the constant turn of a prismatic joint
``shift``       (m + 1, 3)     origin of joint i in the moved frame of joint i − 1; row m: the frame's origin
``tool``        (3, 3)         the rotation after the last joint (only tolerances per axis need it)
``lower``       (k,)           limits of the coordinates; infinite where a whole turn is allowed
``upper``       (k,)
``low``         (k,)           box from which random starts are drawn
``high``        (k,)
==============  =============  =====================================================================================

The step is Levenberg–Marquardt in the task space with damping λ ∝ ‖e‖² (Sugihara 2011): dq = Jᵀ (J Jᵀ + λ 1)⁻¹ e.
A coordinate at a limit that the gradient Jᵀ e pushes outward is left out (projected Newton, Bertsekas 1982).
The rotation error is 2 sin(θ/2) times the axis: equal to the logarithm up to θ³/24, bounded, and free of branches.

Fixed-size lane data lie in one flat workspace ``w`` at the constant offsets below, so that the compiler can prove
that they do not overlap.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .lanes import LANES, sincos

L = LANES
ROT = 0  # 9: rotation reached, row-major
POS = 9 * L  # 3: position reached
TARGET = 12 * L  # 12: rotation (9) and position (3) of the target
ERR = 24 * L  # 6: linear and angular error
GRAM = 30 * L  # 21: lower triangle of J Jᵀ, row by row
DUAL = 51 * L  # 6: (J Jᵀ + λ)⁻¹ e
LAMBDA = 57 * L
SIN = 58 * L
COS = 59 * L
SCALE = 60 * L
AGE = 61 * L  # steps taken since this start
PAST = 62 * L  # squared error when stalling was last checked
FLAG = 63 * L  # 0 go on, 1 solved, 2 give up
WORK = 64 * L

DAMPING = 0.01  # λ = DAMPING ‖e‖²
FLOOR = 1e-9
STEP = 0.8  # largest change of a coordinate in one step
PATIENCE = 24.0  # steps before a start is given up
STALL = 0.8  # every fourth step the squared error must have fallen below this share


class IKChain(NamedTuple):
    """Arrays of one chain; see the head of this module."""

    kind: np.ndarray
    column: np.ndarray
    gain: np.ndarray
    twist: np.ndarray
    shift: np.ndarray
    tool: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    low: np.ndarray
    high: np.ndarray


@kernel(inline=True)
def forward(chain, q, axes, w):
    """Pose into ``w[ROT], w[POS]`` and joint origins and axes into ``axes (6 * m * L)`` for ``q (k * L)``."""
    m = chain.kind.shape[0]
    for i in range(9):
        one = 1.0 if i % 4 == 0 else 0.0
        for l in range(L):
            w[ROT + i * L + l] = one
    for i in range(3 * L):
        w[POS + i] = 0.0
    for i in range(m):
        ca, sa, ct, st = chain.twist[i, 0], chain.twist[i, 1], chain.twist[i, 2], chain.twist[i, 3]
        x, y, z = chain.shift[i, 0], chain.shift[i, 1], chain.shift[i, 2]
        g, o = chain.gain[i, 0], chain.gain[i, 1]
        v = q[chain.column[i] * L : (chain.column[i] + 1) * L]
        axis = axes[6 * i * L : 6 * (i + 1) * L]
        if chain.kind[i] == 0:
            for l in range(L):
                s, c = sincos(g * v[l] + o)
                for k in range(3):
                    r0 = w[ROT + 3 * k * L + l]
                    r1 = w[ROT + (3 * k + 1) * L + l]
                    r2 = w[ROT + (3 * k + 2) * L + l]
                    p = w[POS + k * L + l] + r0 * x + r1 * y + r2 * z
                    b1 = r1 * ca + r2 * sa
                    b2 = r2 * ca - r1 * sa
                    w[POS + k * L + l] = p
                    w[ROT + 3 * k * L + l] = r0 * c + b1 * s
                    w[ROT + (3 * k + 1) * L + l] = b1 * c - r0 * s
                    w[ROT + (3 * k + 2) * L + l] = b2
                    axis[k * L + l] = p
                    axis[(3 + k) * L + l] = b2
        else:
            for l in range(L):
                d = g * v[l] + o
                for k in range(3):
                    r0 = w[ROT + 3 * k * L + l]
                    r1 = w[ROT + (3 * k + 1) * L + l]
                    r2 = w[ROT + (3 * k + 2) * L + l]
                    b1 = r1 * ca + r2 * sa
                    b2 = r2 * ca - r1 * sa
                    w[POS + k * L + l] += r0 * x + r1 * y + r2 * z + b2 * d
                    w[ROT + 3 * k * L + l] = r0 * ct + b1 * st
                    w[ROT + (3 * k + 1) * L + l] = b1 * ct - r0 * st
                    w[ROT + (3 * k + 2) * L + l] = b2
                    axis[(3 + k) * L + l] = b2
    x, y, z = chain.shift[m, 0], chain.shift[m, 1], chain.shift[m, 2]
    for k in range(3):
        r = ROT + 3 * k * L
        for l in range(L):
            w[POS + k * L + l] += w[r + l] * x + w[r + L + l] * y + w[r + 2 * L + l] * z


@kernel(inline=True)
def pose_error(w, tolerance, rotation_tolerance):
    """Error of the whole pose, damping, age, and the flag of every lane."""
    tp = tolerance * tolerance
    tr = rotation_tolerance * rotation_tolerance
    t = TARGET
    r = ROT
    for l in range(L):
        r0, r1, r2 = w[r + l], w[r + L + l], w[r + 2 * L + l]
        r3, r4, r5 = w[r + 3 * L + l], w[r + 4 * L + l], w[r + 5 * L + l]
        r6, r7, r8 = w[r + 6 * L + l], w[r + 7 * L + l], w[r + 8 * L + l]
        t0, t1, t2 = w[t + l], w[t + L + l], w[t + 2 * L + l]
        t3, t4, t5 = w[t + 3 * L + l], w[t + 4 * L + l], w[t + 5 * L + l]
        t6, t7, t8 = w[t + 6 * L + l], w[t + 7 * L + l], w[t + 8 * L + l]
        ex = w[t + 9 * L + l] - w[POS + l]
        ey = w[t + 10 * L + l] - w[POS + L + l]
        ez = w[t + 11 * L + l] - w[POS + 2 * L + l]
        trace = t0 * r0 + t1 * r1 + t2 * r2 + t3 * r3 + t4 * r4 + t5 * r5 + t6 * r6 + t7 * r7 + t8 * r8
        f = math.sqrt(1.0 / max(1.0 + trace, 1e-3))
        wx = f * (t6 * r3 + t7 * r4 + t8 * r5 - t3 * r6 - t4 * r7 - t5 * r8)
        wy = f * (t0 * r6 + t1 * r7 + t2 * r8 - t6 * r0 - t7 * r1 - t8 * r2)
        wz = f * (t3 * r0 + t4 * r1 + t5 * r2 - t0 * r3 - t1 * r4 - t2 * r5)
        linear = ex * ex + ey * ey + ez * ez
        angular = wx * wx + wy * wy + wz * wz
        angular = angular if trace > 0.0 else angular + 1.0
        w[ERR + l] = ex
        w[ERR + L + l] = ey
        w[ERR + 2 * L + l] = ez
        w[ERR + 3 * L + l] = wx
        w[ERR + 4 * L + l] = wy
        w[ERR + 5 * L + l] = wz
        total = linear + angular
        w[LAMBDA + l] = FLOOR + DAMPING * total
        age = w[AGE + l] + 1.0
        w[AGE + l] = age
        check = age == 4.0 * math.floor(age * 0.25)
        late = (age >= PATIENCE) | (check & (total > STALL * w[PAST + l]))
        w[PAST + l] = total if check else w[PAST + l]
        flag = 2.0 if late else 0.0
        w[FLAG + l] = 1.0 if (linear <= tp) & (angular <= tr) else flag


@kernel(inline=True)
def columns(kinds, gains, slots, axes, w, J):
    """What every joint gives to the Jacobian at the frame's origin, at ``J[6 * slot * L]``, in the first frame's axes."""
    for i in range(kinds.shape[0]):
        axis = axes[6 * i * L : 6 * (i + 1) * L]
        out = J[6 * slots[i] * L : 6 * (slots[i] + 1) * L]
        g = gains[i, 0]
        if kinds[i] == 0:
            for l in range(L):
                dx = w[POS + l] - axis[l]
                dy = w[POS + L + l] - axis[L + l]
                dz = w[POS + 2 * L + l] - axis[2 * L + l]
                x = g * axis[3 * L + l]
                y = g * axis[4 * L + l]
                z = g * axis[5 * L + l]
                out[l] = y * dz - z * dy
                out[L + l] = z * dx - x * dz
                out[2 * L + l] = x * dy - y * dx
                out[3 * L + l] = x
                out[4 * L + l] = y
                out[5 * L + l] = z
        else:
            for l in range(3 * L):
                out[l] = g * axis[3 * L + l]
                out[3 * L + l] = 0.0


@kernel
def add_columns(chain, axes, w, J):
    """`columns` where some coordinate drives several joints: their columns add up."""
    m = chain.kind.shape[0]
    one = np.empty(6 * m * L)
    columns(chain.kind, chain.gain, np.arange(m), axes, w, one)
    J[:] = 0.0
    for i in range(m):
        c = chain.column[i]
        for l in range(6 * L):
            J[6 * c * L + l] += one[6 * i * L + l]


@kernel(inline=True)
def hold_limits(chain, q, w, J):
    """Leave out coordinates at a limit that the gradient pushes outward."""
    for c in range(chain.lower.shape[0]):
        lower, upper = chain.lower[c], chain.upper[c]
        j = J[6 * c * L : 6 * (c + 1) * L]
        v = q[c * L : (c + 1) * L]
        for l in range(L):
            push = j[l] * w[ERR + l]
            for r in range(1, 6):
                push += j[r * L + l] * w[ERR + r * L + l]
            keep = 0.0 if ((v[l] <= lower) & (push < 0.0)) | ((v[l] >= upper) & (push > 0.0)) else 1.0
            for r in range(6):
                j[r * L + l] *= keep


@kernel(inline=True)
def gram(w, J, k):
    """Lower triangle of J Jᵀ, two columns of J at a time: the sums go through memory half as often."""
    for i in range(21 * L):
        w[GRAM + i] = 0.0
    for c in range(0, k, 2):
        last = min(c + 1, k - 1)
        share = 1.0 if last > c else 0.0
        j = J[6 * c * L : 6 * (c + 1) * L]
        h = J[6 * last * L : 6 * (last + 1) * L]
        for l in range(L):
            for a in range(6):
                x = j[a * L + l]
                y = share * h[a * L + l]
                for b in range(a + 1):
                    w[GRAM + (a * (a + 1) // 2 + b) * L + l] += x * j[b * L + l] + y * h[b * L + l]


@kernel(inline=True)
def solve_dual(w):
    """``DUAL = (J Jᵀ + λ 1)⁻¹ e`` by an unrolled LDLᵀ factorisation, one lane per column of registers."""
    tiny = 1e-12
    for l in range(L):
        m = w[LAMBDA + l]
        a00 = w[GRAM + l] + m
        a10 = w[GRAM + L + l]
        a11 = w[GRAM + 2 * L + l] + m
        a20 = w[GRAM + 3 * L + l]
        a21 = w[GRAM + 4 * L + l]
        a22 = w[GRAM + 5 * L + l] + m
        a30 = w[GRAM + 6 * L + l]
        a31 = w[GRAM + 7 * L + l]
        a32 = w[GRAM + 8 * L + l]
        a33 = w[GRAM + 9 * L + l] + m
        a40 = w[GRAM + 10 * L + l]
        a41 = w[GRAM + 11 * L + l]
        a42 = w[GRAM + 12 * L + l]
        a43 = w[GRAM + 13 * L + l]
        a44 = w[GRAM + 14 * L + l] + m
        a50 = w[GRAM + 15 * L + l]
        a51 = w[GRAM + 16 * L + l]
        a52 = w[GRAM + 17 * L + l]
        a53 = w[GRAM + 18 * L + l]
        a54 = w[GRAM + 19 * L + l]
        a55 = w[GRAM + 20 * L + l] + m
        d0 = 1.0 / a00
        l10, l20, l30, l40, l50 = a10 * d0, a20 * d0, a30 * d0, a40 * d0, a50 * d0
        a11, a21, a31, a41, a51 = a11 - l10 * a10, a21 - l20 * a10, a31 - l30 * a10, a41 - l40 * a10, a51 - l50 * a10
        a22, a32, a42, a52 = a22 - l20 * a20, a32 - l30 * a20, a42 - l40 * a20, a52 - l50 * a20
        a33, a43, a53 = a33 - l30 * a30, a43 - l40 * a30, a53 - l50 * a30
        a44, a54, a55 = a44 - l40 * a40, a54 - l50 * a40, a55 - l50 * a50
        d1 = 1.0 / max(a11, tiny)
        l21, l31, l41, l51 = a21 * d1, a31 * d1, a41 * d1, a51 * d1
        a22, a32, a42, a52 = a22 - l21 * a21, a32 - l31 * a21, a42 - l41 * a21, a52 - l51 * a21
        a33, a43, a53 = a33 - l31 * a31, a43 - l41 * a31, a53 - l51 * a31
        a44, a54, a55 = a44 - l41 * a41, a54 - l51 * a41, a55 - l51 * a51
        d2 = 1.0 / max(a22, tiny)
        l32, l42, l52 = a32 * d2, a42 * d2, a52 * d2
        a33, a43, a53 = a33 - l32 * a32, a43 - l42 * a32, a53 - l52 * a32
        a44, a54, a55 = a44 - l42 * a42, a54 - l52 * a42, a55 - l52 * a52
        d3 = 1.0 / max(a33, tiny)
        l43, l53 = a43 * d3, a53 * d3
        a44, a54, a55 = a44 - l43 * a43, a54 - l53 * a43, a55 - l53 * a53
        d4 = 1.0 / max(a44, tiny)
        l54 = a54 * d4
        d5 = 1.0 / max(a55 - l54 * a54, tiny)
        y0 = w[ERR + l]
        y1 = w[ERR + L + l] - l10 * y0
        y2 = w[ERR + 2 * L + l] - l20 * y0 - l21 * y1
        y3 = w[ERR + 3 * L + l] - l30 * y0 - l31 * y1 - l32 * y2
        y4 = w[ERR + 4 * L + l] - l40 * y0 - l41 * y1 - l42 * y2 - l43 * y3
        y5 = w[ERR + 5 * L + l] - l50 * y0 - l51 * y1 - l52 * y2 - l53 * y3 - l54 * y4
        y5 = y5 * d5
        y4 = y4 * d4 - l54 * y5
        y3 = y3 * d3 - l43 * y4 - l53 * y5
        y2 = y2 * d2 - l32 * y3 - l42 * y4 - l52 * y5
        y1 = y1 * d1 - l21 * y2 - l31 * y3 - l41 * y4 - l51 * y5
        w[DUAL + l] = y0 * d0 - l10 * y1 - l20 * y2 - l30 * y3 - l40 * y4 - l50 * y5
        w[DUAL + L + l] = y1
        w[DUAL + 2 * L + l] = y2
        w[DUAL + 3 * L + l] = y3
        w[DUAL + 4 * L + l] = y4
        w[DUAL + 5 * L + l] = y5


@kernel(inline=True)
def advance(chain, q, w, J, step):
    """``q += Jᵀ y``, shortened as a whole to `STEP`, then clamped to the limits."""
    k = chain.lower.shape[0]
    for l in range(L):
        w[SCALE + l] = STEP
    for c in range(k):
        j = J[6 * c * L : 6 * (c + 1) * L]
        out = step[c * L : (c + 1) * L]
        for l in range(L):
            d = j[l] * w[DUAL + l]
            for r in range(1, 6):
                d += j[r * L + l] * w[DUAL + r * L + l]
            out[l] = d
            w[SCALE + l] = max(w[SCALE + l], abs(d))
    for l in range(L):
        w[SCALE + l] = STEP / w[SCALE + l]
    for c in range(k):
        lower, upper = chain.lower[c], chain.upper[c]
        v = q[c * L : (c + 1) * L]
        d = step[c * L : (c + 1) * L]
        for l in range(L):
            v[l] = min(max(v[l] + d[l] * w[SCALE + l], lower), upper)
