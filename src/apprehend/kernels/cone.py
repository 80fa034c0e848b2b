"""Cone programs: a primal-dual interior-point method for contact forces.

Solves many small problems of one shape::

    minimise   ½ xᵀ diag(Q) x + cᵀ x     subject to   A x = b,  x ∈ K

where K is a product of half-lines (size 1) and second-order cones ``{x : x₀ ≥ ‖x₁…‖}``. The homogeneous self-dual
embedding (Ye, Todd and Mizuno 1994; with a quadratic term: Goulart and Chen, Clarabel, 2024) gives every problem an
end: an optimum with its dual, or a certificate that there is none. Scaling by Nesterov and Todd (`kernels.cone_algebra`),
steps by Mehrotra.

A grasp has few rows (6 balance equations and the couplings of its limits), so a step is one small Cholesky factor of
``A M Aᵀ`` with ``M = (Q + W⁻²)⁻¹`` block-diagonal. Where a cone is active W is very stretched; M is therefore taken
with `PROX` added, and each solution is refined once against the true system. Problems are solved one after the other,
not on lanes: for so small systems lanes gained nothing until 32 problems wide (0.33 ns for a multiplication and
addition either way), and one problem alone must be fast too.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .cone_algebra import apply, room, scaling, second_order

OPTIMAL, INFEASIBLE, UNBOUNDED, INACCURATE = 0, 1, 2, 3
STEP = 0.995
PROX = 1e-4
PATIENCE = 6


@kernel
def _blocks(Q, cones, starts, offsets, w, beta, M, low):  # type: ignore[no-untyped-def]
    """``M = (Q + PROX + W⁻²)⁻¹`` of each cone, as dense blocks."""
    for i in range(cones.shape[0]):
        k, s, o = cones[i], starts[i], offsets[i]
        h = 1.0 / (beta[i] * beta[i])
        if k == 1:
            M[o] = 1.0 / (Q[s] + PROX + h)
            continue
        for a in range(k):
            for b in range(a + 1):
                v = 2.0 * h * w[s + a] * w[s + b]
                low[a, b] = -v if b == 0 and a > 0 else v
            low[a, a] += Q[s + a] + PROX + (h if a else -h)
        _factor(low, k)
        for a in range(k):  # inverse of the factor, transposed, in the upper part of M's block
            for b in range(a, k):
                v = 1.0 if a == b else 0.0
                for j in range(a, b):
                    v -= low[b, j] * M[o + a * k + j]
                M[o + a * k + b] = v * low[b, b]
        for a in range(k):  # M = L⁻ᵀ L⁻¹; row a needs columns from a on of the rows a and after: overwrite in order
            for b in range(a, k):
                v = 0.0
                for j in range(b, k):
                    v += M[o + a * k + j] * M[o + b * k + j]
                low[a, b] = v
        for a in range(k):
            for b in range(a, k):
                M[o + a * k + b] = low[a, b]
                M[o + b * k + a] = low[a, b]


@kernel
def _factor(S, n):  # type: ignore[no-untyped-def]
    """Cholesky factor in place (lower part); the diagonal holds reciprocals. A pivot lost to rounding is left out."""
    for j in range(n):
        before = S[j, j]
        t = before
        for m in range(j):
            t -= S[j, m] * S[j, m]
        inverse = 1.0 / np.sqrt(t) if t > 1e-15 * before else 0.0
        S[j, j] = inverse
        for i in range(j + 1, n):
            t = S[i, j]
            for m in range(j):
                t -= S[i, m] * S[j, m]
            S[i, j] = t * inverse


@kernel
def _solve_factor(S, n, v):  # type: ignore[no-untyped-def]
    for j in range(n):
        t = v[j]
        for m in range(j):
            t -= S[j, m] * v[m]
        v[j] = t * S[j, j]
    for jj in range(n):
        j = n - 1 - jj
        v[j] *= S[j, j]
        for m in range(j):
            v[m] -= S[j, m] * v[j]


@kernel
def _times_m(M, v, cones, starts, offsets, out):  # type: ignore[no-untyped-def]
    for i in range(cones.shape[0]):
        k, s, o = cones[i], starts[i], offsets[i]
        for a in range(k):
            t = 0.0
            for b in range(k):
                t += M[o + a * k + b] * v[s + b]
            out[s + a] = t


@kernel
def _kkt(A, At, AM, S, M, Q, w, beta, q1, q2, cones, starts, offsets, x, y, tmp, e1, e2):  # type: ignore[no-untyped-def]
    """``(Q + W⁻²) x − Aᵀ y = q1``, ``A x = q2``: solved with M, and refined once against the true system."""
    rows, n = A.shape
    for r in range(rows):
        t = 0.0
        for j in range(n):
            t += AM[r, j] * q1[j]
        y[r] = q2[r] - t
    _solve_factor(S, rows, y)
    for j in range(n):
        t = q1[j]
        for r in range(rows):
            t += At[j, r] * y[r]
        tmp[j] = t
    _times_m(M, tmp, cones, starts, offsets, x)
    for i in range(cones.shape[0]):  # e1 = q1 − (Q + W⁻²) x + Aᵀ y
        k, s = cones[i], starts[i]
        h = 1.0 / (beta[i] * beta[i])
        dot = w[s] * x[s]
        for j in range(s + 1, s + k):
            dot -= w[j] * x[j]
        e1[s] = tmp[s] - Q[s] * x[s] - h * (2.0 * w[s] * dot - x[s])
        for j in range(s + 1, s + k):
            e1[j] = tmp[j] - Q[j] * x[j] - h * (x[j] - 2.0 * w[j] * dot)
    for r in range(rows):
        t = 0.0
        for j in range(n):
            t += A[r, j] * x[j] + AM[r, j] * e1[j]
        e2[r] = q2[r] - t
    _solve_factor(S, rows, e2)
    for r in range(rows):
        y[r] += e2[r]
    for j in range(n):
        t = e1[j]
        for r in range(rows):
            t += At[j, r] * e2[r]
        e1[j] = t
    _times_m(M, e1, cones, starts, offsets, tmp)
    for j in range(n):
        x[j] += tmp[j]


@kernel
def solve(A, b, c, Q, cones, starts, offsets, tolerance, limit, x, y, z, status, measures):  # type: ignore[no-untyped-def]
    """Solve N problems. ``A (N, rows, n)``, ``b (N, rows)``, ``c, Q (N, n)``; an axis of length 1 is shared by all.

    Answers: ``x, z (N, n)``, ``y (N, rows)``, ``status (N,)``; *measures* ``(N, 5)``: primal value, dual value, primal
    and dual residual, steps. For INFEASIBLE, y and z are the certificate ``Aᵀ y + z = 0``, ``bᵀ y = 1``; for
    UNBOUNDED, x is a ray with ``A x = 0``, ``cᵀ x = −1``.
    """
    rows, n = A.shape[1], A.shape[2]
    widest = 1
    for i in range(cones.shape[0]):
        widest = max(widest, cones[i])
    work = np.empty((16, n))
    short = np.empty((8, rows))
    beta = np.empty(cones.shape[0])
    M, AM, S = np.empty(offsets[-1]), np.empty((rows, n)), np.empty((rows, rows))
    At = np.empty((n, rows))
    low = np.empty((widest, widest))
    best = np.empty(2 * n + rows)
    for p in range(x.shape[0]):
        a, bb = A[p if A.shape[0] > 1 else 0], b[p if b.shape[0] > 1 else 0]
        cc, qq = c[p if c.shape[0] > 1 else 0], Q[p if Q.shape[0] > 1 else 0]
        status[p] = _one(
            a, bb, cc, qq, cones, starts, offsets, tolerance, limit, x[p], y[p], z[p], measures[p],
            work, short, beta, M, At, AM, S, low, best,
        )  # fmt: skip


@kernel
def _one(A, b, c, Q, cones, starts, offsets, tolerance, limit, X, Y, Z, measures,
         work, short, beta, M, At, AM, S, low, best):  # type: ignore[no-untyped-def]  # fmt: skip
    rows, n = A.shape
    w, lam, x1, x2, q1, tmp = work[0], work[1], work[2], work[3], work[4], work[5]
    dx, dz, wx, wz, rd, e1, ds = work[6], work[7], work[8], work[9], work[10], work[11], work[12]
    y1, y2, dy, q2, rp, e2 = short[0], short[1], short[2], short[3], short[4], short[5]
    degree = cones.shape[0] + 1.0
    nb, nc = 0.0, 0.0
    for r in range(rows):
        Y[r] = 0.0
        nb = max(nb, abs(b[r]))
        for j in range(n):
            At[j, r] = A[r, j]
    for i in range(cones.shape[0]):
        for j in range(starts[i], starts[i] + cones[i]):
            X[j] = 1.0 if j == starts[i] else 0.0
            Z[j] = X[j]
            nc = max(nc, abs(c[j]))
    tau, kappa, least, since = 1.0, 1.0, np.inf, 0
    for iteration in range(limit + 1):
        quad, mu, cx, by, ep, ed = 0.0, tau * kappa, 0.0, 0.0, 0.0, 0.0
        for j in range(n):
            qx = Q[j] * X[j]
            rd[j] = qx + c[j] * tau - Z[j]
            quad += qx * X[j]
            mu += X[j] * Z[j]
            cx += c[j] * X[j]
        for r in range(rows):
            t = 0.0
            for j in range(n):
                t += A[r, j] * X[j]
            t -= b[r] * tau
            rp[r] = t
            by += b[r] * Y[r]
            ep = max(ep, abs(t))
        for j in range(n):
            t = 0.0
            for r in range(rows):
                t += At[j, r] * Y[r]
            rd[j] -= t
            ed = max(ed, abs(rd[j]))
        mu /= degree
        rg = kappa + cx - by + quad / tau
        # where do we stand?
        primal, dual = (cx + 0.5 * quad / tau) / tau, (by - 0.5 * quad / tau) / tau
        gap = abs(primal - dual) / max(1.0, min(abs(primal), abs(dual)))
        ep, ed = ep / (tau * (1.0 + nb)), ed / (tau * (1.0 + nc))
        worst = max(gap, max(ep, ed))
        if worst < least:
            since = since if worst > 0.5 * least else 0
            least = worst
            measures[0], measures[1], measures[2], measures[3], measures[4] = primal, dual, ep, ed, iteration
            for j in range(n):
                best[j], best[n + j] = X[j] / tau, Z[j] / tau
            for r in range(rows):
                best[2 * n + r] = Y[r] / tau
        else:
            since += 1
        if least <= tolerance or (since > PATIENCE and kappa < tau) or iteration == limit or not (mu > 1e-40):
            break
        if kappa > tau:
            if by > 0.0:
                error = 0.0
                for j in range(n):
                    e = Z[j]
                    for r in range(rows):
                        e += A[r, j] * Y[r]
                    error = max(error, abs(e))
                if error <= tolerance * by:
                    for j in range(n):
                        X[j], Z[j] = X[j] / by, Z[j] / by
                    for r in range(rows):
                        Y[r] /= by
                    measures[0], measures[1], measures[2], measures[3] = np.inf, np.inf, error / by, error / by
                    measures[4] = iteration
                    return INFEASIBLE
            if cx < 0.0:
                error = 0.0
                for r in range(rows):
                    error = max(error, abs(rp[r] + b[r] * tau))
                for j in range(n):
                    error = max(error, abs(Q[j] * X[j]))
                if error <= -tolerance * cx:
                    for j in range(n):
                        X[j], Z[j] = -X[j] / cx, -Z[j] / cx
                    for r in range(rows):
                        Y[r] /= -cx
                    measures[0], measures[1], measures[2], measures[3] = -np.inf, -np.inf, -error / cx, -error / cx
                    measures[4] = iteration
                    return UNBOUNDED
        if not scaling(X, Z, cones, starts, w, beta, lam):
            break
        _blocks(Q, cones, starts, offsets, w, beta, M, low)
        for r in range(rows):
            _times_m(M, A[r], cones, starts, offsets, AM[r])
            for q in range(r + 1):
                t = 0.0
                for j in range(n):
                    t += AM[r, j] * A[q, j]
                S[r, q] = t
        _factor(S, rows)
        for j in range(n):
            q1[j] = -c[j]
        _kkt(A, At, AM, S, M, Q, w, beta, q1, b, cones, starts, offsets, x2, y2, tmp, e1, e2)
        den = -kappa / tau - quad / (tau * tau)
        for j in range(n):
            den += (c[j] + 2.0 * Q[j] * X[j] / tau) * x2[j]
        for r in range(rows):
            den -= b[r] * y2[r]
        sigma, dtau, dkappa, alpha = 0.0, 0.0, 0.0, 0.0
        for phase in range(2):  # predictor, corrector
            if phase == 0:
                for j in range(n):
                    q1[j] = -rd[j] - Z[j]
                dk = kappa * tau
            else:
                apply(dx, cones, starts, w, beta, -1.0, wx)
                apply(dz, cones, starts, w, beta, 1.0, wz)
                second_order(lam, wx, wz, sigma * mu, cones, starts, ds)
                apply(ds, cones, starts, w, beta, -1.0, q1)
                for j in range(n):
                    q1[j] = -(1.0 - sigma) * rd[j] - Z[j] - q1[j]
                dk = kappa * tau + dtau * dkappa - sigma * mu
            for r in range(rows):
                q2[r] = -(1.0 - sigma) * rp[r]
            _kkt(A, At, AM, S, M, Q, w, beta, q1, q2, cones, starts, offsets, x1, y1, tmp, e1, e2)
            t = -(1.0 - sigma) * rg + dk / tau
            for j in range(n):
                t -= (c[j] + 2.0 * Q[j] * X[j] / tau) * x1[j]
            for r in range(rows):
                t += b[r] * y1[r]
            dtau = t / den
            dkappa = -(dk + kappa * dtau) / tau
            for r in range(rows):
                dy[r] = y1[r] + dtau * y2[r]
            for j in range(n):
                dx[j] = x1[j] + dtau * x2[j]
                t = 0.0
                for r in range(rows):
                    t += At[j, r] * dy[r]
                dz[j] = Q[j] * dx[j] + c[j] * dtau + (1.0 - sigma) * rd[j] - t
            need = max(-dtau / tau, -dkappa / kappa)
            need = max(need, max(room(X, dx, cones, starts), room(Z, dz, cones, starts)))
            alpha = 1.0 / max(need, 1e-30)
            if phase == 0:
                t = 1.0 - min(alpha, 1.0)
                sigma = t * t * t
        alpha = min(1.0, STEP * alpha)
        if not (alpha > 1e-9):
            break
        tau += alpha * dtau
        kappa += alpha * dkappa
        scale = 1.0  # the embedding is homogeneous: keep numbers near one
        t = max(tau, kappa)
        if t < 1e-3 or t > 1e3:
            scale = 1.0 / t
        tau *= scale
        kappa *= scale
        for j in range(n):
            X[j] = scale * (X[j] + alpha * dx[j])
            Z[j] = scale * (Z[j] + alpha * dz[j])
        for r in range(rows):
            Y[r] = scale * (Y[r] + alpha * dy[r])
    for j in range(n):
        X[j], Z[j] = best[j], best[n + j]
    for r in range(rows):
        Y[r] = best[2 * n + r]
    return OPTIMAL if least <= tolerance else INACCURATE
