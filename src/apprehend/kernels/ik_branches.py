"""Closed forms of inverse kinematics: all branches of arms that fall apart into small subproblems.

A geometry is the robot at zero: directions ``h (6, 3)`` of the axes, points ``o (7, 3)`` (one on each axis, then the frame's
origin), and the frame's rotation ``R0``. With R_i the rotation by θ_i about h_i, the frame is at
``p = o_0 + R_1 (o_1 − o_0 + R_2 (… R_6 (o_6 − o_5)))`` with the rotation ``R_1 … R_6 R0``. Vectors are tuples
(`triples`). The subproblems are those of Paden (1986) and Kahan as extended by Elias and Wen (2022): 1 turns a vector
into another, 3 to a given distance, 4 to a given height. A general regional structure leads to a quartic (Pieper 1968).
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .lanes import sincos
from .triples import across, add, apply, cross, dot, row, sub, turn, turn_by

SPHERICAL_WRIST = 1
THREE_PARALLEL = 2
PLANAR = 3

EXACT = 1e-9  # slack of subproblems whose geometry is the arm's own
ALIKE = 1e-9
ALIGNED = 1e-7  # sine of the angle below which two axes count as parallel
MOST = 16  # room for branches; the families here have up to 8


@kernel
def angle_between(h, a, b):
    """Subproblem 1: the angle about *h* that brings a nearest to b (zero where every angle does)."""
    ha, hb = dot(h, a), dot(h, b)
    return math.atan2(dot(h, cross(a, b)), dot(a, b) - ha * hb)


@kernel
def angles_at_height(h, k, v, d, slack):
    """Subproblem 4: the angles about *h* with ``k · R v = d``: how many (0, 1, 2), and two angles.

    A cosine beyond 1 by less than *slack* is taken as 1, or, where the geometry is only near the true arm's, as one
    a little inside: the true arm may have two angles there.
    """
    kh, hv = dot(k, h), dot(h, v)
    a = dot(k, v) - kh * hv
    b = dot(k, cross(h, v))
    d -= kh * hv
    r = math.sqrt(a * a + b * b)
    if r < 1e-12:
        return (1, 0.0, 0.0) if abs(d) < 1e-9 else (0, 0.0, 0.0)
    x = d / r
    if abs(x) > 1.0 + slack:
        return 0, 0.0, 0.0
    middle = math.atan2(b, a)
    if abs(x) >= 1.0:
        middle += 0.0 if x > 0.0 else math.pi
        if slack <= EXACT:
            return 1, middle, 0.0
        return 2, middle + 0.1, middle - 0.1
    half = math.acos(x)
    return 2, middle + half, middle - half


@kernel
def quartic_angles(F, roots):
    """Angles θ with F0 + F1 c + F2 s + F3 c² + F4 c s + F5 s² = 0 into ``roots (4)``; returns how many.

    With t = tan((θ − θ₀)/2) a quartic, solved by simultaneous (Durand–Kerner) iteration and refined on the circle;
    θ₀ is chosen so that the point t = ∞ is no root.
    """
    shift, largest = 0.0, -1.0
    for i in range(8):
        x = 0.7853981633974483 * i
        c, s = math.cos(x), math.sin(x)
        f = abs(F[0] + F[1] * c + F[2] * s + F[3] * c * c + F[4] * c * s + F[5] * s * s)
        if f > largest:
            largest = f
            shift = x - math.pi
    c, s = math.cos(shift), math.sin(shift)
    f1 = F[1] * c + F[2] * s
    f2 = F[2] * c - F[1] * s
    f3 = F[3] * c * c + F[4] * c * s + F[5] * s * s
    f5 = F[3] * s * s - F[4] * c * s + F[5] * c * c
    f4 = 2.0 * (F[5] - F[3]) * c * s + F[4] * (c * c - s * s)
    top = F[0] - f1 + f3
    a3 = (2.0 * f2 - 2.0 * f4) / top
    a2 = (2.0 * F[0] - 2.0 * f3 + 4.0 * f5) / top
    a1 = (2.0 * f2 + 2.0 * f4) / top
    a0 = (F[0] + f1 + f3) / top
    size = 1.0 + max(abs(a3), abs(a2), abs(a1), abs(a0))
    z0, z1, z2, z3 = complex(0.4, 0.9), complex(-0.65, 0.72), complex(-0.908, -0.297), complex(-0.113, -0.94)
    radius = min(size, max(abs(a0) ** 0.25, 1e-3))
    z0, z1, z2, z3 = z0 * radius, z1 * radius, z2 * radius, z3 * radius
    for _ in range(60):
        w0 = ((((z0 + a3) * z0 + a2) * z0 + a1) * z0 + a0) / ((z0 - z1) * (z0 - z2) * (z0 - z3))
        z0 -= w0
        w1 = ((((z1 + a3) * z1 + a2) * z1 + a1) * z1 + a0) / ((z1 - z0) * (z1 - z2) * (z1 - z3))
        z1 -= w1
        w2 = ((((z2 + a3) * z2 + a2) * z2 + a1) * z2 + a0) / ((z2 - z0) * (z2 - z1) * (z2 - z3))
        z2 -= w2
        w3 = ((((z3 + a3) * z3 + a2) * z3 + a1) * z3 + a0) / ((z3 - z0) * (z3 - z1) * (z3 - z2))
        z3 -= w3
        if abs(w0) + abs(w1) + abs(w2) + abs(w3) < 1e-14 * size:
            break
    count = 0
    for z in (z0, z1, z2, z3):
        # near a double root the imaginary part is about the square root of the rounding error
        if abs(z.imag) > 1e-5 * (1.0 + abs(z.real)):
            continue
        x = 2.0 * math.atan(z.real)
        for _ in range(3):
            c, s = math.cos(x), math.sin(x)
            f = F[0] + f1 * c + f2 * s + f3 * c * c + f4 * c * s + f5 * s * s
            g = -f1 * s + f2 * c + 2.0 * (f5 - f3) * c * s + f4 * (c * c - s * s)
            if abs(g) < 1e-9 * largest:
                break
            x -= min(max(f / g, -0.1), 0.1)
        roots[count] = x + shift
        count += 1
    return count


@kernel
def regional(h, o, slack, b, out, F, roots):
    """Angles of the first three axes that bring the wrist point o[3] to ``o[0] + b``, into ``out (·, 3)``.

    o[0] and o[1] must be the feet of the common normal of the axes 0 and 1 (any points, if these are parallel).
    """
    h1, h2, h3 = row(h, 0), row(h, 1), row(h, 2)
    p12 = sub(row(o, 1), row(o, 0))
    p23 = sub(row(o, 2), row(o, 1))
    p3 = sub(row(o, 3), row(o, 2))
    g = dot(h1, h2)
    offset = math.sqrt(dot(p12, p12))
    sine2 = 1.0 - g * g
    span = math.sqrt(dot(p23, p23)) + math.sqrt(dot(p3, p3))
    fixed = dot(p23, p23) + dot(p3, p3)
    count = 0
    candidates = 0
    if sine2 < 1e-12:  # parallel: the height along the axes is that of the third joint alone
        candidates, roots[0], roots[1] = angles_at_height(h3, h2, p3, g * dot(h1, sub(b, p12)) - dot(h2, p23), slack)
    elif offset < ALIKE * span:  # intersecting: the distance is that of the third joint alone
        candidates, roots[0], roots[1] = angles_at_height(h3, p23, p3, 0.5 * (dot(b, b) - fixed), slack)
    else:
        k3, hp = cross(h3, p3), dot(h3, p3)
        base = (hp * h3[0], hp * h3[1], hp * h3[2])  # R3 p3 = base + c (p3 − base) + s k3
        side = sub(p3, base)
        a0, a1, a2 = dot(h2, add(p23, base)), dot(h2, side), dot(h2, k3)
        n0, n1, n2 = fixed + 2.0 * dot(p23, base), 2.0 * dot(p23, side), 2.0 * dot(p23, k3)
        c1 = dot(h1, b)
        c0 = (0.5 * (dot(b, b) - offset * offset - n0)) / offset
        d1, d2 = -0.5 * n1 / offset, -0.5 * n2 / offset
        k = 1.0 / sine2
        F[0] = k * (c1 * c1 - 2.0 * g * c1 * a0 + a0 * a0) + c0 * c0 - n0
        F[1] = k * (2.0 * a0 - 2.0 * g * c1) * a1 + 2.0 * c0 * d1 - n1
        F[2] = k * (2.0 * a0 - 2.0 * g * c1) * a2 + 2.0 * c0 * d2 - n2
        F[3] = k * a1 * a1 + d1 * d1
        F[4] = 2.0 * (k * a1 * a2 + d1 * d2)
        F[5] = k * a2 * a2 + d2 * d2
        candidates = quartic_angles(F, roots)
    for i in range(candidates):
        v = add(p23, turn(h3, roots[i], p3))
        if sine2 < 1e-12:
            d = 0.5 * (dot(b, b) - dot(p12, p12) - dot(v, v))
            many, x, y = angles_at_height(h2, p12, v, d, slack)
        elif offset < ALIKE * span:
            many, x, y = angles_at_height(h2, h1, v, dot(h1, b), slack)
        else:  # u = R2 v has known parts along h1, h2 and the normal: one angle
            along = dot(h2, v)
            c1 = dot(h1, b)
            xa, ya = (c1 - g * along) / sine2, (along - g * c1) / sine2
            c2 = 0.5 * (dot(b, b) - offset * offset - dot(v, v)) / (offset * offset)
            u = (
                xa * h1[0] + ya * h2[0] + c2 * p12[0],
                xa * h1[1] + ya * h2[1] + c2 * p12[1],
                xa * h1[2] + ya * h2[2] + c2 * p12[2],
            )
            many, x, y = 1, angle_between(h2, v, u), 0.0
        for j in range(many):
            second = x if j == 0 else y
            w = add(p12, turn(h2, second, v))
            out[count, 0] = angle_between(h1, w, b)
            out[count, 1] = second
            out[count, 2] = roots[i]
            count += 1
    return count


@kernel
def wrist_branches(h, o, slack, R, p, out, three, F, roots):
    """All branches of an arm whose last three axes meet in o[3] = o[4] = o[5]."""
    h4, h5, h6 = row(h, 3), row(h, 4), row(h, 5)
    reach = apply(R, sub(row(o, 6), row(o, 3)))
    b = (p[0] - reach[0] - o[0, 0], p[1] - reach[1] - o[0, 1], p[2] - reach[2] - o[0, 2])
    arms = regional(h, o, slack, b, three, F, roots)
    side = across(h6)
    Rh, Rs = apply(R, h6), apply(R, side)
    count = 0
    for i in range(arms):
        a1, a2, a3 = three[i, 0], three[i, 1], three[i, 2]
        h1, h2, h3 = row(h, 0), row(h, 1), row(h, 2)
        s1, c1 = sincos(a1)
        s2, c2 = sincos(a2)
        s3, c3 = sincos(a3)
        # (R1 R2 R3)ᵀ R h6 = R4 R5 h6
        wrist = turn_by(h3, -s3, c3, turn_by(h2, -s2, c2, turn_by(h1, -s1, c1, Rh)))
        cross_wrist = turn_by(h3, -s3, c3, turn_by(h2, -s2, c2, turn_by(h1, -s1, c1, Rs)))
        many, x, y = angles_at_height(h5, h4, h6, dot(h4, wrist), slack)
        for j in range(many):
            a5 = x if j == 0 else y
            s5, c5 = sincos(a5)
            a4 = angle_between(h4, turn_by(h5, s5, c5, h6), wrist)
            out[count, 0], out[count, 1], out[count, 2] = a1, a2, a3
            out[count, 3], out[count, 4] = a4, a5
            out[count, 5] = angle_between(h6, side, turn_by(h5, -s5, c5, turn(h4, -a4, cross_wrist)))
            count += 1
    return count


@kernel
def parallel_first(h, o, slack, R, p, first, F, roots):
    """Angles (θ1, θ5) of an arm whose axes 2, 3, 4 are parallel, into ``first (·, 2)``: from the two parts of the
    frame's position and direction along these axes, which the three joints leave as they are."""
    h1, h2, h5, h6 = row(h, 0), row(h, 1), row(h, 4), row(h, 5)
    end = apply(R, sub(row(o, 6), row(o, 5)))
    b = (p[0] - end[0] - o[0, 0], p[1] - end[1] - o[0, 1], p[2] - end[2] - o[0, 2])
    p56 = sub(row(o, 5), row(o, 4))
    height = dot(h2, sub(row(o, 4), row(o, 0)))
    Rh = apply(R, h6)
    count = 0
    # h2 · R1ᵀ b = height + h2 · R5 p56   and   h2 · R1ᵀ (R h6) = h2 · R5 h6
    if dot(p56, p56) < ALIKE * ALIKE * max(dot(b, b), 1e-300):
        many, x, y = angles_at_height(h1, b, h2, height, slack)  # b · R1 h2
        for i in range(many):
            a1 = x if i == 0 else y
            more, u, v = angles_at_height(h5, h2, h6, dot(turn(h1, -a1, Rh), h2), slack)
            for j in range(more):
                first[count, 0] = a1
                first[count, 1] = u if j == 0 else v
                count += 1
        return count
    # both lines are linear in (cos, sin) of θ1 and of θ5: A x1 + a = B x5 + c
    k1, g1 = cross(h1, h2), dot(h1, h2)
    base1 = (g1 * h1[0], g1 * h1[1], g1 * h1[2])
    side1 = sub(h2, base1)
    A00, A01, A10, A11 = dot(b, side1), dot(b, k1), dot(Rh, side1), dot(Rh, k1)
    k5, g5 = cross(h5, p56), dot(h5, p56)
    base5 = (g5 * h5[0], g5 * h5[1], g5 * h5[2])
    k6, g6 = cross(h5, h6), dot(h5, h6)
    base6 = (g6 * h5[0], g6 * h5[1], g6 * h5[2])
    B00, B01 = dot(h2, sub(p56, base5)), dot(h2, k5)
    B10, B11 = dot(h2, sub(h6, base6)), dot(h2, k6)
    c0 = dot(b, base1) - height - dot(h2, base5)
    c1 = dot(Rh, base1) - dot(h2, base6)
    det = B00 * B11 - B01 * B10
    if abs(det) < 1e-12:
        return 0
    # x5 = B⁻¹ (A x1 + c), a unit vector
    e0, e1 = (B11 * c0 - B01 * c1) / det, (B00 * c1 - B10 * c0) / det
    m00, m01 = (B11 * A00 - B01 * A10) / det, (B11 * A01 - B01 * A11) / det
    m10, m11 = (B00 * A10 - B10 * A00) / det, (B00 * A11 - B10 * A01) / det
    F[0] = e0 * e0 + e1 * e1 - 1.0
    F[1] = 2.0 * (e0 * m00 + e1 * m10)
    F[2] = 2.0 * (e0 * m01 + e1 * m11)
    F[3] = m00 * m00 + m10 * m10
    F[4] = 2.0 * (m00 * m01 + m10 * m11)
    F[5] = m01 * m01 + m11 * m11
    many = quartic_angles(F, roots)
    for i in range(many):
        c, s = math.cos(roots[i]), math.sin(roots[i])
        first[count, 0] = roots[i]
        first[count, 1] = math.atan2(e1 + m10 * c + m11 * s, e0 + m00 * c + m01 * s)
        count += 1
    return count


@kernel
def turn_within(h, a, b, u, v):
    """The angle about *h* by which *b* must turn for ``a − b`` to be as long across h as ``u + R v`` can be made.

    Zero where it is so already, and where no turn does it; else to the middle of the lengths that can be had.
    """
    ha, hb = dot(h, a), dot(h, b)
    aa, bb = dot(a, a) - ha * ha, dot(b, b) - hb * hb
    ab = dot(a, b) - ha * hb
    span = 2.0 * math.sqrt(aa * bb)
    ru, rv = math.sqrt(dot(u, u)), math.sqrt(dot(v, v))
    near, far = (ru - rv) ** 2, (ru + rv) ** 2
    now = aa + bb - 2.0 * ab
    if near <= now <= far or span < 1e-12 * far:
        return 0.0
    low, high = max(near, aa + bb - span), min(far, aa + bb + span)
    if low > high + 1e-12 * far:
        return 0.0
    cosine = (aa + bb - 0.5 * (low + high)) / span
    return angle_between(h, b, a) + math.acos(min(max(cosine, -1.0), 1.0))


@kernel
def parallel_branches(h, o, slack, R, p, out, three, F, roots):
    """All branches of an arm whose axes 2, 3 and 4 are parallel; ``h[1], h[2], h[3]`` are equal up to sign."""
    h1, h2, h5, h6 = row(h, 0), row(h, 1), row(h, 4), row(h, 5)
    s3 = 1.0 if dot(h2, row(h, 2)) > 0.0 else -1.0
    s4 = 1.0 if dot(h2, row(h, 3)) > 0.0 else -1.0
    p12, p23 = sub(row(o, 1), row(o, 0)), sub(row(o, 2), row(o, 1))
    p34, p45, p56 = sub(row(o, 3), row(o, 2)), sub(row(o, 4), row(o, 3)), sub(row(o, 5), row(o, 4))
    end = apply(R, sub(row(o, 6), row(o, 5)))
    b = (p[0] - end[0] - o[0, 0], p[1] - end[1] - o[0, 1], p[2] - end[2] - o[0, 2])
    firsts = parallel_first(h, o, slack, R, p, three, F, roots)
    side = across(h2)
    Rt = R.T
    u23, u34 = dot(h2, p23), dot(h2, p34)
    q23 = (p23[0] - u23 * h2[0], p23[1] - u23 * h2[1], p23[2] - u23 * h2[2])
    q34 = (p34[0] - u34 * h2[0], p34[1] - u34 * h2[1], p34[2] - u34 * h2[2])
    count = 0
    for i in range(firsts):
        a1, a5 = three[i, 0], three[i, 1]
        s1, c1 = sincos(a1)
        s5, c5 = sincos(a5)
        # h2ᵀ R1ᵀ R = h2ᵀ R5 R6
        lean = turn_by(h5, -s5, c5, h2)
        a6 = angle_between(h6, apply(Rt, turn_by(h1, s1, c1, h2)), lean)
        # the three joints together turn h2's side by R1ᵀ R R6ᵀ R5ᵀ
        turned = apply(R, turn(h6, -a6, turn_by(h5, -s5, c5, side)))
        total = angle_between(h2, side, turn_by(h1, -s1, c1, turned))
        rest = sub(turn_by(h1, -s1, c1, b), p12)
        arm = add(p45, turn_by(h5, s5, c5, p56))
        apart = cross(h6, lean)
        if dot(apart, apart) < ALIGNED * ALIGNED:  # axis 6 is parallel to axes 2, 3, 4: every θ6 will do
            step = turn_within(h2, rest, turn(h2, total, arm), q23, q34)
            total += step
            a6 -= step if dot(h6, lean) > 0.0 else -step
        rest = sub(rest, turn(h2, total, arm))
        # rest = R2 (p23 + R3 p34), within the plane across h2
        along = dot(h2, rest)
        flat = dot(rest, rest) - along * along
        many, x, y = angles_at_height(h2, q23, q34, 0.5 * (flat - dot(q23, q23) - dot(q34, q34)), slack)
        for j in range(many):
            a3 = x if j == 0 else y
            a2 = angle_between(h2, add(q23, turn(h2, a3, q34)), rest)
            out[count, 0], out[count, 1], out[count, 2] = a1, a2, s3 * a3
            out[count, 3], out[count, 4], out[count, 5] = s4 * (total - a2 - a3), a5, a6
            count += 1
    return count


@kernel
def branches(family, h, o, R0, slack, targets, first, last, out, count):
    """Branches ``out (N, MOST, 6)`` and how many, for poses ``targets (N, 16)``; geometries ``(N or 1, …)``."""
    three = np.empty((MOST, 3))
    F = np.empty(6)
    roots = np.empty(4)
    R = np.empty((3, 3))
    for i in range(first, last):
        g = i if h.shape[0] > 1 else 0
        T = targets[i]
        for a in range(3):
            for b in range(3):
                R[a, b] = T[4 * a] * R0[g, b, 0] + T[4 * a + 1] * R0[g, b, 1] + T[4 * a + 2] * R0[g, b, 2]
        p = (T[3], T[7], T[11])
        if family == SPHERICAL_WRIST:
            count[i] = wrist_branches(h[g], o[g], slack, R, p, out[i], three, F, roots)
        else:
            count[i] = parallel_branches(h[g], o[g], slack, R, p, out[i], three, F, roots)
