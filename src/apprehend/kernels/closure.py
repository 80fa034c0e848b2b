"""Force closure of many grasps on lanes, each verdict with its proof.

For contacts with cone bases ``b_i + Σ_j s_j S_ij`` the function

    F(y) = Σ_i ψ(b_i·y + ‖(S_i y, 1)‖),     ψ(h) = (h + √(h² + 4)) / 2

is smooth and strictly convex. Its gradient is ``Σ w_i (b_i + S_iᵗ v_i)`` with ``w_i > 0`` and ``‖v_i‖ < 1``: the wrench
of forces strictly inside the cones. A grasp is force-closure exactly if F has a minimum, where those are a strict
internal force (G, Satz 2.4); else y runs away along a wrench that no contact can oppose. Newton's method finds either
proof in a few steps: the Newton step corrects the forces to ``G f = 0`` exactly to first order, and they count as soon
as they lie inside the cones; a y with ``b_i·y + ‖S_i y‖ < 0`` for all contacts counts as well.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .hull_support import BOX
from .lanes import LANES

CLOSED, OPEN, UNDECIDED = 0, 2, 3
"""Verdicts; the last needs another method (the origin is on the boundary, or nearly)."""
STRIDE = 8.0
"""A Newton step changes no contact's argument by more than this many times its own scale."""
RESIDUAL = 1e-11
"""Largest ``‖G f‖`` of an internal force, for normal forces that sum to one and bases of unit size."""


@kernel
def generate(points, normals, friction, torsion, kind, reference, scale, base, spread, flags):  # type: ignore[no-untyped-def]
    """Cone bases of contacts in space: ``points, normals (N, k, 3)``, ``friction, torsion (N, k)``, ``kind (N, k)``.

    Kinds: 0 without friction, 1 Coulomb, 2 soft (elliptic), 3 soft (box). ``reference (N, 3)``, ``scale (N,)`` of
    torques. *base* ``(N, k, 6)``, *spread* ``(N, k, 3, 6)``, *flags* ``(N, k)``. Tangents as in `Contact.rotation`.
    """
    t = np.empty((3, 3))
    for g in range(points.shape[0]):
        for i in range(points.shape[1]):
            x, y, z = normals[g, i, 0], normals[g, i, 1], normals[g, i, 2]
            ax, ay, az = abs(x), abs(y), abs(z)
            if ax <= ay and ax <= az:  # t₁ = e × n with e the axis most square to n
                t[0, 0], t[0, 1], t[0, 2] = 0.0, -z, y
            elif ay <= az:
                t[0, 0], t[0, 1], t[0, 2] = z, 0.0, -x
            else:
                t[0, 0], t[0, 1], t[0, 2] = -y, x, 0.0
            length = np.sqrt(t[0, 0] ** 2 + t[0, 1] ** 2 + t[0, 2] ** 2)
            for j in range(3):
                t[0, j] /= length
            t[1, 0] = y * t[0, 2] - z * t[0, 1]
            t[1, 1] = z * t[0, 0] - x * t[0, 2]
            t[1, 2] = x * t[0, 1] - y * t[0, 0]
            t[2, 0], t[2, 1], t[2, 2] = x, y, z
            px = points[g, i, 0] - reference[g, 0]
            py = points[g, i, 1] - reference[g, 1]
            pz = points[g, i, 2] - reference[g, 2]
            s, what = scale[g], kind[g, i]
            for a in range(3):
                mu = 1.0 if a == 2 else (friction[g, i] if what > 0 else 0.0)
                fx, fy, fz = mu * t[a, 0], mu * t[a, 1], mu * t[a, 2]
                out = base[g, i] if a == 2 else spread[g, i, a]
                out[0], out[1], out[2] = fx, fy, fz
                out[3] = s * (py * fz - pz * fy)
                out[4] = s * (pz * fx - px * fz)
                out[5] = s * (px * fy - py * fx)
            gamma = s * torsion[g, i] if what > 1 else 0.0
            for j in range(3):
                spread[g, i, 2, j] = 0.0
                spread[g, i, 2, 3 + j] = gamma * t[2, j]
            flags[g, i] = BOX if what == 3 else 0


@kernel
def _load(base, spread, flags, g, lane, B, boxed, Y):  # type: ignore[no-untyped-def]
    """Put grasp *g* into a lane; its largest entry."""
    size = 0.0
    for i in range(base.shape[1]):
        boxed[i, lane] = 1.0 if flags[g, i] & BOX else 0.0
        for j in range(base.shape[2]):
            B[i, 0, j, lane] = base[g, i, j]
            size = max(size, abs(base[g, i, j]))
            for a in range(3):
                B[i, 1 + a, j, lane] = spread[g, i, a, j]
    for j in range(base.shape[2]):
        Y[j, lane] = 0.0
    return size


@kernel
def _model(B, boxed, Y, C, P, H, grad, reach):  # type: ignore[no-untyped-def]
    """Gradient and Hessian of F at Y on all lanes.

    *C* ``(k, 16, L)`` keeps of each contact: w, ψ″, v₁ v₂ v₃, w A (11 22 33 12 13 23), the scales of h and of ‖S y‖.
    *reach* ``(L,)``: the largest exact support value.
    """
    k, d = B.shape[0], B.shape[2]
    s = np.empty((4, LANES))
    T = np.empty((3, LANES))
    grad[:] = 0.0
    H[:] = 0.0
    reach[:] = -np.inf
    for i in range(k):
        s[:] = 0.0
        for a in range(4):
            for j in range(d):
                for l in range(LANES):
                    s[a, l] += B[i, a, j, l] * Y[j, l]
        c = C[i]
        for l in range(LANES):
            one, b = s[1, l] * s[1, l] + s[2, l] * s[2, l], boxed[i, l]
            three = s[3, l] * s[3, l]
            ra, rb = np.sqrt(1.0 + one + (1.0 - b) * three), np.sqrt(1.0 + three)
            h = s[0, l] + ra + b * rb
            q = np.sqrt(h * h + 4.0)
            w = 2.0 / (q * (q - h)) if h < 0.0 else 0.5 * (1.0 + h / q)
            ia, ib = 1.0 / ra, b / rb
            v1, v2, v3 = s[1, l] * ia, s[2, l] * ia, s[3, l] * ((1.0 - b) * ia + ib)
            c[0, l], c[1, l] = w, 2.0 / (q * q * q)
            c[2, l], c[3, l], c[4, l] = v1, v2, v3
            c[5, l], c[6, l], c[8, l] = w * ia * (1.0 - v1 * v1), w * ia * (1.0 - v2 * v2), -w * ia * v1 * v2
            c[7, l] = w * ((1.0 - b) * ia + ib) * (1.0 - v3 * v3)
            c[9, l], c[10, l] = -(1.0 - b) * w * ia * v1 * v3, -(1.0 - b) * w * ia * v2 * v3
            c[11, l], c[12, l] = q, ra
            exact = s[0, l] + np.sqrt(one + (1.0 - b) * three) + b * abs(s[3, l])
            reach[l] = max(reach[l], exact)
        for j in range(d):
            for l in range(LANES):
                p = B[i, 0, j, l] + c[2, l] * B[i, 1, j, l] + c[3, l] * B[i, 2, j, l] + c[4, l] * B[i, 3, j, l]
                P[i, j, l] = p
                grad[j, l] += c[0, l] * p
        for j in range(d):
            for l in range(LANES):
                x, y, z = B[i, 1, j, l], B[i, 2, j, l], B[i, 3, j, l]
                T[0, l] = c[5, l] * x + c[8, l] * y + c[9, l] * z
                T[1, l] = c[8, l] * x + c[6, l] * y + c[10, l] * z
                T[2, l] = c[9, l] * x + c[10, l] * y + c[7, l] * z
            for m in range(j + 1):
                for l in range(LANES):
                    H[j, m, l] += (
                        c[1, l] * P[i, j, l] * P[i, m, l]
                        + T[0, l] * B[i, 1, m, l] + T[1, l] * B[i, 2, m, l] + T[2, l] * B[i, 3, m, l]
                    )  # fmt: skip


@kernel
def _newton(H, grad, dY, pivot):  # type: ignore[no-untyped-def]
    """Solve ``H dY = −grad`` by Cholesky on all lanes; *pivot*: the smallest pivot over its diagonal entry."""
    d = grad.shape[0]
    pivot[:] = np.inf
    inverse = np.empty((d, LANES))
    t = np.empty(LANES)
    for j in range(d):
        for m in range(j + 1):
            for l in range(LANES):
                t[l] = H[j, m, l]
            for n in range(m):
                for l in range(LANES):
                    t[l] -= H[j, n, l] * H[m, n, l]
            if m < j:
                for l in range(LANES):
                    H[j, m, l] = t[l] * inverse[m, l]
            else:
                for l in range(LANES):
                    whole = H[j, j, l] + 1e-300
                    pivot[l] = min(pivot[l], t[l] / whole)
                    inverse[j, l] = 1.0 / np.sqrt(max(t[l], 1e-15 * whole))
        for l in range(LANES):
            t[l] = -grad[j, l]
        for n in range(j):
            for l in range(LANES):
                t[l] -= H[j, n, l] * dY[n, l]
        for l in range(LANES):
            dY[j, l] = t[l] * inverse[j, l]
    for j in range(d - 1, -1, -1):
        for n in range(j + 1, d):
            for l in range(LANES):
                dY[j, l] -= H[n, j, l] * dY[n, l]
        for l in range(LANES):
            dY[j, l] *= inverse[j, l]


@kernel
def _correct(B, boxed, dY, C, P, F, rest, slack, total, step):  # type: ignore[no-untyped-def]
    """Forces after the Newton step, in units of the half-axes: *F* ``(k, 4, L)``; how far they miss ``G f = 0``
    *(rest)*, their least slack, the sum of normal forces, and how far the step may go."""
    k, d = B.shape[0], B.shape[2]
    e = np.empty((4, LANES))
    wrench = np.zeros((d, LANES))
    slack[:] = np.inf
    total[:] = 0.0
    step[:] = 1.0
    for i in range(k):
        c, f = C[i], F[i]
        e[:] = 0.0
        for a in range(4):
            for j in range(d):
                for l in range(LANES):
                    e[a, l] += B[i, a, j, l] * dY[j, l]
        for l in range(LANES):
            v1, v2, v3 = c[2, l], c[3, l], c[4, l]
            dh = e[0, l] + v1 * e[1, l] + v2 * e[2, l] + v3 * e[3, l]
            normal = c[0, l] + c[1, l] * dh
            f1 = normal * v1 + c[5, l] * e[1, l] + c[8, l] * e[2, l] + c[9, l] * e[3, l]
            f2 = normal * v2 + c[8, l] * e[1, l] + c[6, l] * e[2, l] + c[10, l] * e[3, l]
            f3 = normal * v3 + c[9, l] * e[1, l] + c[10, l] * e[2, l] + c[7, l] * e[3, l]
            f[0, l], f[1, l], f[2, l], f[3, l] = normal, f1, f2, f3
            b, flat = boxed[i, l], f1 * f1 + f2 * f2
            need = max(np.sqrt(flat + (1.0 - b) * f3 * f3), b * abs(f3))
            slack[l] = min(slack[l], normal - need)
            total[l] += normal
            turn = np.sqrt(e[1, l] * e[1, l] + e[2, l] * e[2, l] + e[3, l] * e[3, l])
            step[l] = min(step[l], STRIDE * c[11, l] / (abs(e[0, l]) + turn + 1e-300))
            step[l] = min(step[l], STRIDE * c[12, l] / (turn + 1e-300))
        for j in range(d):
            for l in range(LANES):
                wrench[j, l] += (
                    f[0, l] * B[i, 0, j, l]
                    + f[1, l] * B[i, 1, j, l]
                    + f[2, l] * B[i, 2, j, l]
                    + f[3, l] * B[i, 3, j, l]
                )
    rest[:] = 0.0
    for j in range(d):
        for l in range(LANES):
            rest[l] = max(rest[l], abs(wrench[j, l]))


@kernel
def prove(base, spread, flags, margin, steps, verdict, slack_out, force, wrench):  # type: ignore[no-untyped-def]
    """Decide force closure of grasps ``base (N, k, d)``, ``spread (N, k, 3, d)``, ``flags (N, k)``.

    CLOSED needs an internal force at least *margin* inside every cone; after *steps* a grasp is UNDECIDED.
    *slack_out* ``(N,)``: how far inside; *force* ``(N, k, 4)``: normal force and parts along the half-axes (in units
    of the half-axes), normal forces summing to one; *wrench* ``(N, d)``: unit direction along which none can push.
    """
    N, k, d = base.shape
    if N == 0:
        return
    B, boxed = np.zeros((k, 4, d, LANES)), np.zeros((k, LANES))
    Y, dY, grad = np.zeros((d, LANES)), np.zeros((d, LANES)), np.zeros((d, LANES))
    H, C, P, F = np.zeros((d, d, LANES)), np.zeros((k, 13, LANES)), np.zeros((k, d, LANES)), np.zeros((k, 4, LANES))
    reach, pivot, rest = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    slack, total, step = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    owner, age, size = np.empty(LANES, np.int64), np.zeros(LANES, np.int64), np.zeros(LANES)
    following, busy = 0, 0
    for l in range(LANES):
        _load(base, spread, flags, min(following, N - 1), l, B, boxed, Y)
        owner[l] = -1
        if following < N:
            size[l] = _load(base, spread, flags, following, l, B, boxed, Y)
            owner[l], following, busy = following, following + 1, busy + 1
    while busy:
        _model(B, boxed, Y, C, P, H, grad, reach)
        _newton(H, grad, dY, pivot)
        _correct(B, boxed, dY, C, P, F, rest, slack, total, step)
        for l in range(LANES):
            g = owner[l]
            if g < 0:
                continue
            age[l] += 1
            length = 0.0
            for j in range(d):
                length += Y[j, l] * Y[j, l]
            length = np.sqrt(length)
            found = -1
            if reach[l] < -1e-12 * size[l] * length:
                found = OPEN
                slack_out[g] = 0.0
                for j in range(d):
                    wrench[g, j] = Y[j, l] / length
            elif (
                pivot[l] > 1e-9 and total[l] > 0.0 and slack[l] > margin * total[l]
                and rest[l] <= RESIDUAL * size[l] * total[l]
            ):  # fmt: skip
                found = CLOSED
                slack_out[g] = slack[l] / total[l]
                for i in range(k):
                    for a in range(4):
                        force[g, i, a] = F[i, a, l] / total[l]
            elif age[l] >= steps:
                found = UNDECIDED
            if found < 0:
                continue
            verdict[g] = found
            age[l] = 0
            for j in range(d):
                dY[j, l] = 0.0
            if following < N:
                size[l] = _load(base, spread, flags, following, l, B, boxed, Y)
                owner[l], following = following, following + 1
            else:
                owner[l], busy = -1, busy - 1
        for j in range(d):
            for l in range(LANES):
                Y[j, l] += step[l] * dY[j, l]
