"""Cone programs on lanes: a primal-dual interior-point method for contact forces.

Solves blocks of `LANES` problems of one shape at once::

    minimise   ½ xᵀ diag(Q) x + cᵀ x     subject to   A x = b,  x ∈ K

where K is a product of half-lines (size 1) and second-order cones ``{x : x₀ ≥ ‖x₁…‖}``. The homogeneous self-dual
embedding (Ye, Todd and Mizuno 1994; with a quadratic term: Goulart and Chen, Clarabel 2024) gives every problem an
end: an optimum with its dual, or a certificate that there is none. Scaling by Nesterov and Todd, steps by Mehrotra.
A problem has few rows (6 balance equations and the couplings of its limits), so the work per step is one small
Cholesky factor.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel

LANES = 8
"""Problems per block: one AVX-512 register, two of AVX2; the work arrays of a block stay in the first-level cache."""

OPTIMAL, INFEASIBLE, UNBOUNDED, INACCURATE = 0, 1, 2, 3
STEP = 0.99
REFINE = 1
PROX = 1e-5


@kernel
def _scaling(x, z, cones, starts, w, beta, lam):  # type: ignore[no-untyped-def]
    """Nesterov–Todd scaling point of each cone: unit vector w and factor β with ``W z = W⁻¹ x = λ``."""
    for i in range(cones.shape[0]):
        k, s = cones[i], starts[i]
        if k == 1:
            for l in range(LANES):
                w[s, l] = 1.0
                beta[i, l] = np.sqrt(x[s, l] / z[s, l])
                lam[s, l] = np.sqrt(x[s, l] * z[s, l])
            continue
        for l in range(LANES):
            xx, zz, xz = x[s, l] * x[s, l], z[s, l] * z[s, l], x[s, l] * z[s, l]
            xs, zs = 0.0, 0.0
            for j in range(s + 1, s + k):
                xs += x[j, l] * x[j, l]
                zs += z[j, l] * z[j, l]
                xz += x[j, l] * z[j, l]
            xx, zz = np.sqrt(xs), np.sqrt(zs)
            xn = np.sqrt(max((x[s, l] - xx) * (x[s, l] + xx), 1e-300))
            zn = np.sqrt(max((z[s, l] - zz) * (z[s, l] + zz), 1e-300))
            g = np.sqrt(0.5 * (1.0 + xz / (xn * zn)))
            w0 = 0.5 * (x[s, l] / xn + z[s, l] / zn) / g
            b = np.sqrt(xn / zn)
            beta[i, l] = b
            w[s, l] = w0
            dot = w0 * z[s, l]
            for j in range(s + 1, s + k):
                w[j, l] = 0.5 * (x[j, l] / xn - z[j, l] / zn) / g
                dot += w[j, l] * z[j, l]
            lam[s, l] = b * dot
            t = (dot - w0 * z[s, l]) / (1.0 + w0) + z[s, l]
            for j in range(s + 1, s + k):
                lam[j, l] = b * (z[j, l] + t * w[j, l])


@kernel
def _apply(v, cones, starts, w, beta, inverse, out):  # type: ignore[no-untyped-def]
    """``W v``, or ``W⁻¹ v``."""
    for i in range(cones.shape[0]):
        k, s = cones[i], starts[i]
        sign = -1.0 if inverse else 1.0
        for l in range(LANES):
            b = 1.0 / beta[i, l] if inverse else beta[i, l]
            dot = 0.0
            for j in range(s + 1, s + k):
                dot += w[j, l] * v[j, l]
            v0 = v[s, l]
            t = dot / (1.0 + w[s, l]) + sign * v0
            out[s, l] = b * (w[s, l] * v0 + sign * dot)
            for j in range(s + 1, s + k):
                out[j, l] = b * (v[j, l] + t * w[j, l])


@kernel
def _divide(lam, d, cones, starts, out):  # type: ignore[no-untyped-def]
    """The u with ``λ ∘ u = d`` in the Jordan algebra of each cone."""
    for i in range(cones.shape[0]):
        k, s = cones[i], starts[i]
        for l in range(LANES):
            n2, dot = 0.0, 0.0
            for j in range(s + 1, s + k):
                n2 += lam[j, l] * lam[j, l]
                dot += lam[j, l] * d[j, l]
            n = np.sqrt(n2)
            det = max((lam[s, l] - n) * (lam[s, l] + n), 1e-300)
            u0 = (lam[s, l] * d[s, l] - dot) / det
            if k == 1:
                u0 = d[s, l] / lam[s, l]
            out[s, l] = u0
            for j in range(s + 1, s + k):
                out[j, l] = (d[j, l] - u0 * lam[j, l]) / lam[s, l]


@kernel
def _room(x, d, cones, starts, step):  # type: ignore[no-untyped-def]
    """Lower each lane of *step* to the largest α with ``x + α d`` in the cone."""
    for i in range(cones.shape[0]):
        k, s = cones[i], starts[i]
        if k == 1:
            for l in range(LANES):
                need = -d[s, l] / x[s, l]
                step[l] = min(step[l], 1.0 / max(need, 1e-30))
            continue
        for l in range(LANES):
            n2, dot = 0.0, 0.0
            for j in range(s + 1, s + k):
                n2 += x[j, l] * x[j, l]
                dot += x[j, l] * d[j, l]
            n = np.sqrt(n2)
            norm = np.sqrt(max((x[s, l] - n) * (x[s, l] + n), 1e-300))
            r0 = (x[s, l] * d[s, l] - dot) / norm
            t = (r0 + d[s, l]) / (x[s, l] + norm)
            r1 = 0.0
            for j in range(s + 1, s + k):
                e = d[j, l] - t * x[j, l]
                r1 += e * e
            need = (np.sqrt(r1) - r0) / norm
            step[l] = min(step[l], 1.0 / max(need, 1e-30))


@kernel
def _blocks(Q, cones, starts, offsets, w, beta, quadratic, M, low):  # type: ignore[no-untyped-def]
    """``M = (Q + W⁻²)⁻¹`` of each cone, as dense blocks."""
    for i in range(cones.shape[0]):
        k, s, o = cones[i], starts[i], offsets[i]
        if False:
            for a in range(k):
                for b in range(k):
                    for l in range(LANES):
                        v = 2.0 * w[s + a, l] * w[s + b, l]
                        if a == b:
                            v += -1.0 if a == 0 else 1.0
                        M[o + a * k + b, l] = v * beta[i, l] * beta[i, l]
            continue
        for a in range(k):
            for b in range(a + 1):
                for l in range(LANES):
                    sign = -1.0 if (a == 0) != (b == 0) else 1.0
                    v = 2.0 * sign * w[s + a, l] * w[s + b, l]
                    if a == b:
                        v += -1.0 if a == 0 else 1.0
                    v = v / (beta[i, l] * beta[i, l])
                    if a == b:
                        v += Q[s + a, l] + PROX
                    low[a, b, l] = v
        _factor(low, k)
        for a in range(k):  # columns of the inverse of the factor, in M
            for b in range(k):
                for l in range(LANES):
                    M[o + b * k + a, l] = 0.0
            for b in range(a, k):
                for l in range(LANES):
                    v = 1.0 if a == b else 0.0
                    for j in range(a, b):
                        v -= low[b, j, l] * M[o + j * k + a, l]
                    M[o + b * k + a, l] = v * low[b, b, l]
        for a in range(k):  # M = L⁻ᵀ L⁻¹; entry (a, b ≥ a) reads only rows from b on, so it may overwrite in this order
            for b in range(k):
                for l in range(LANES):
                    v = 0.0
                    for j in range(max(a, b), k):
                        v += M[o + j * k + a, l] * M[o + j * k + b, l]
                    low[a, b, l] = v
        for a in range(k):
            for b in range(k):
                for l in range(LANES):
                    M[o + a * k + b, l] = low[a, b, l]


@kernel
def _factor(S, n):  # type: ignore[no-untyped-def]
    """Cholesky factor in place (lower part); the diagonal holds reciprocals."""
    for j in range(n):
        for m in range(j):
            for l in range(LANES):
                S[j, j, l] -= S[j, m, l] * S[j, m, l]
        for l in range(LANES):
            S[j, j, l] = 1.0 / np.sqrt(max(S[j, j, l], 1e-200))
        for i in range(j + 1, n):
            for m in range(j):
                for l in range(LANES):
                    S[i, j, l] -= S[i, m, l] * S[j, m, l]
            for l in range(LANES):
                S[i, j, l] *= S[j, j, l]


@kernel
def _solve(S, n, v):  # type: ignore[no-untyped-def]
    for j in range(n):
        for m in range(j):
            for l in range(LANES):
                v[j, l] -= S[j, m, l] * v[m, l]
        for l in range(LANES):
            v[j, l] *= S[j, j, l]
    for jj in range(n):
        j = n - 1 - jj
        for m in range(j + 1, n):
            for l in range(LANES):
                v[j, l] -= S[m, j, l] * v[m, l]
        for l in range(LANES):
            v[j, l] *= S[j, j, l]


@kernel
def _times_m(M, v, cones, starts, offsets, out):  # type: ignore[no-untyped-def]
    for i in range(cones.shape[0]):
        k, s, o = cones[i], starts[i], offsets[i]
        for a in range(k):
            for l in range(LANES):
                t = 0.0
                for b in range(k):
                    t += M[o + a * k + b, l] * v[s + b, l]
                out[s + a, l] = t


@kernel
def _kkt(A, AM, S, M, a, p, q1, q2, cones, starts, offsets, x, y, tmp, ry):  # type: ignore[no-untyped-def]
    """``(Q + W⁻²) x − Aᵀ y = −a z − q1``, ``A x = q2``, with ``p = (Q + W⁻²)⁻¹ z`` known exactly.

    Near the optimum W is very stretched; keeping the large known part apart avoids cancellation.
    """
    rows, n = A.shape[0], A.shape[1]
    for r in range(rows):
        for l in range(LANES):
            y[r, l] = q2[r, l]
        for j in range(n):
            for l in range(LANES):
                y[r, l] += AM[r, j, l] * q1[j, l] + a[l] * A[r, j, l] * p[j, l]
    _solve(S, rows, y)
    for j in range(n):
        for l in range(LANES):
            tmp[j, l] = -q1[j, l]
        for r in range(rows):
            for l in range(LANES):
                tmp[j, l] += A[r, j, l] * y[r, l]
    _times_m(M, tmp, cones, starts, offsets, x)
    for j in range(n):
        for l in range(LANES):
            x[j, l] -= a[l] * p[j, l]
    for _ in range(REFINE):
        for r in range(rows):
            for l in range(LANES):
                ry[r, l] = q2[r, l]
            for j in range(n):
                for l in range(LANES):
                    ry[r, l] -= A[r, j, l] * x[j, l]
        _solve(S, rows, ry)
        for r in range(rows):
            for l in range(LANES):
                y[r, l] += ry[r, l]
            for j in range(n):
                for l in range(LANES):
                    x[j, l] += AM[r, j, l] * ry[r, l]


@kernel
def solve(A, b, c, Q, cones, starts, offsets, quadratic, tolerance, limit, x, y, z, status, measures):  # type: ignore[no-untyped-def]
    """Solve every block. ``A (B, rows, n, L)``, ``b (B, rows, L)``, ``c, Q (B, n, L)``; answers in the same layout.

    *status* ``(B, L)``; *measures* ``(B, 5, L)``: primal value, dual value, primal and dual residual, iterations.
    For INFEASIBLE, y and z are the certificate ``Aᵀ y + z = 0``, ``bᵀ y = 1``; for UNBOUNDED, x is a ray with
    ``A x = 0``, ``cᵀ x = −1``.
    """
    rows, n = A.shape[1], A.shape[2]
    size = offsets[-1]
    w, lam = np.empty((n, LANES)), np.empty((n, LANES))
    beta = np.empty((cones.shape[0], LANES))
    M, AM, S = np.empty((size, LANES)), np.empty((rows, n, LANES)), np.empty((rows, rows, LANES))
    widest = 1
    for i in range(cones.shape[0]):
        widest = max(widest, cones[i])
    low = np.empty((widest, widest, LANES))
    x1, x2, q1, tmp, ds = (np.empty((n, LANES)), np.empty((n, LANES)), np.empty((n, LANES)),
                           np.empty((n, LANES)), np.empty((n, LANES)))  # fmt: skip
    dx, dz, wx, wz, rd = (np.empty((n, LANES)), np.empty((n, LANES)), np.empty((n, LANES)),
                          np.empty((n, LANES)), np.empty((n, LANES)))  # fmt: skip
    y1, y2, dy, q2, rp = (np.empty((rows, LANES)), np.empty((rows, LANES)), np.empty((rows, LANES)),
                          np.empty((rows, LANES)), np.empty((rows, LANES)))  # fmt: skip
    tau, kappa, dtau, dkappa, rg = (np.empty(LANES), np.empty(LANES), np.empty(LANES), np.empty(LANES), np.empty(LANES))
    mu, sigma, step, den, quad = (np.empty(LANES), np.empty(LANES), np.empty(LANES), np.empty(LANES), np.empty(LANES))
    ry = np.empty((rows, LANES))
    nb, nc, one, p = np.empty(LANES), np.empty(LANES), np.empty(LANES), np.empty((n, LANES))
    live = np.empty(LANES, np.bool_)
    best = np.empty(LANES)
    degree = cones.shape[0] + 1.0
    for block in range(A.shape[0]):
        X, Y, Z, Ab, bb, cb, Qb = x[block], y[block], z[block], A[block], b[block], c[block], Q[block]
        for i in range(cones.shape[0]):
            for j in range(cones[i]):
                for l in range(LANES):
                    X[starts[i] + j, l] = 1.0 if j == 0 else 0.0
                    Z[starts[i] + j, l] = 1.0 if j == 0 else 0.0
        for r in range(rows):
            for l in range(LANES):
                Y[r, l] = 0.0
        for l in range(LANES):
            tau[l], kappa[l], live[l], best[l] = 1.0, 1.0, True, np.inf
            status[block, l] = INACCURATE
            nb[l], nc[l] = 0.0, 0.0
        for r in range(rows):
            for l in range(LANES):
                nb[l] = max(nb[l], abs(bb[r, l]))
        for j in range(n):
            for l in range(LANES):
                nc[l] = max(nc[l], abs(cb[j, l]))
        for iteration in range(limit + 1):
            # residuals and values
            for l in range(LANES):
                rg[l], quad[l], mu[l] = kappa[l], 0.0, tau[l] * kappa[l]
            for j in range(n):
                for l in range(LANES):
                    qx = Qb[j, l] * X[j, l]
                    rd[j, l] = qx + cb[j, l] * tau[l] - Z[j, l]
                    quad[l] += qx * X[j, l]
                    mu[l] += X[j, l] * Z[j, l]
            for r in range(rows):
                for l in range(LANES):
                    rp[r, l] = -bb[r, l] * tau[l]
                for j in range(n):
                    for l in range(LANES):
                        rp[r, l] += Ab[r, j, l] * X[j, l]
                        rd[j, l] -= Ab[r, j, l] * Y[r, l]
            running = _judge(
                Ab, bb, cb, Qb, X, Y, Z, rp, rd, rg, quad, tau, kappa, mu, nb, nc, tolerance, iteration,
                live, best, status[block], measures[block], degree,
            )  # fmt: skip
            if not running or iteration == limit:
                break
            _scaling(X, Z, cones, starts, w, beta, lam)
            _blocks(Qb, cones, starts, offsets, w, beta, quadratic, M, low)
            _schur(Ab, M, cones, starts, offsets, AM, S)
            _times_m(M, Z, cones, starts, offsets, p)
            for i in range(cones.shape[0]):
                if False:
                    for j in range(starts[i], starts[i] + cones[i]):
                        for l in range(LANES):
                            p[j, l] = X[j, l]
            for l in range(LANES):
                one[l] = 1.0 / tau[l]
            for j in range(n):
                for l in range(LANES):
                    q1[j, l] = (rd[j, l] - Qb[j, l] * X[j, l]) / tau[l]
            _kkt(Ab, AM, S, M, one, p, q1, bb, cones, starts, offsets, x2, y2, tmp, ry)  # y2 is short of y / τ
            for l in range(LANES):
                den[l] = -kappa[l] / tau[l] - quad[l] / (tau[l] * tau[l])
            for j in range(n):
                for l in range(LANES):
                    den[l] += (cb[j, l] + 2.0 * Qb[j, l] * X[j, l] / tau[l]) * x2[j, l]
            for r in range(rows):
                for l in range(LANES):
                    den[l] -= bb[r, l] * (y2[r, l] + Y[r, l] / tau[l])
            for phase in range(2):  # predictor, corrector; of W⁻¹(λ \ d_s) the part z is kept apart
                if phase == 0:
                    for j in range(n):
                        for l in range(LANES):
                            q1[j, l] = rd[j, l]
                    for l in range(LANES):
                        one[l] = 1.0
                        sigma[l] = 0.0
                        dkappa[l] = kappa[l] * tau[l]  # d_κ
                else:
                    _apply(dx, cones, starts, w, beta, True, wx)
                    _apply(dz, cones, starts, w, beta, False, wz)
                    for i in range(cones.shape[0]):
                        k, s = cones[i], starts[i]
                        for l in range(LANES):
                            t = 0.0
                            for j in range(s, s + k):
                                t += wx[j, l] * wz[j, l]
                            for j in range(s + 1, s + k):
                                ds[j, l] = wx[s, l] * wz[j, l] + wz[s, l] * wx[j, l]
                            ds[s, l] = t - sigma[l] * mu[l]
                    _divide(lam, ds, cones, starts, tmp)
                    _apply(tmp, cones, starts, w, beta, True, q1)
                    for j in range(n):
                        for l in range(LANES):
                            q1[j, l] += (1.0 - sigma[l]) * rd[j, l]
                    for l in range(LANES):
                        dkappa[l] = kappa[l] * tau[l] + dtau[l] * dkappa[l] - sigma[l] * mu[l]
                for r in range(rows):
                    for l in range(LANES):
                        q2[r, l] = -(1.0 - sigma[l]) * rp[r, l]
                _kkt(Ab, AM, S, M, one, p, q1, q2, cones, starts, offsets, x1, y1, tmp, ry)
                for l in range(LANES):
                    dtau[l] = -(1.0 - sigma[l]) * rg[l] + dkappa[l] / tau[l]
                for j in range(n):
                    for l in range(LANES):
                        dtau[l] -= (cb[j, l] + 2.0 * Qb[j, l] * X[j, l] / tau[l]) * x1[j, l]
                for r in range(rows):
                    for l in range(LANES):
                        dtau[l] += bb[r, l] * y1[r, l]
                for l in range(LANES):
                    dtau[l] = dtau[l] / den[l]
                    dkappa[l] = -(dkappa[l] + kappa[l] * dtau[l]) / tau[l]
                    step[l] = 1.0 / max(max(-dtau[l] / tau[l], -dkappa[l] / kappa[l]), 1e-30)
                for r in range(rows):
                    for l in range(LANES):
                        dy[r, l] = y1[r, l] + dtau[l] * y2[r, l]  # and Δτ y / τ, added below
                for j in range(n):
                    for l in range(LANES):
                        dx[j, l] = x1[j, l] + dtau[l] * x2[j, l]
                        qx = Qb[j, l] * X[j, l]
                        dz[j, l] = Qb[j, l] * dx[j, l] + dtau[l] / tau[l] * (Z[j, l] + rd[j, l] - qx)
                        dz[j, l] += (1.0 - sigma[l]) * rd[j, l]
                    for r in range(rows):
                        for l in range(LANES):
                            dz[j, l] -= Ab[r, j, l] * dy[r, l]
                _room(X, dx, cones, starts, step)
                _room(Z, dz, cones, starts, step)
                if phase == 0:
                    for l in range(LANES):
                        t = 1.0 - min(step[l], 1.0)
                        sigma[l] = max(t * t * t, 1e-12)
            for l in range(LANES):
                t = min(1.0, STEP * step[l])
                step[l] = t if live[l] and t == t else 0.0
                one[l] = 1.0 / tau[l]
                tau[l] += step[l] * dtau[l]
                kappa[l] += step[l] * dkappa[l]
            for j in range(n):
                for l in range(LANES):
                    if step[l] > 0.0:
                        X[j, l] += step[l] * dx[j, l]
                        Z[j, l] += step[l] * dz[j, l]
            for r in range(rows):
                for l in range(LANES):
                    if step[l] > 0.0:
                        Y[r, l] += step[l] * (dy[r, l] + dtau[l] * one[l] * Y[r, l])
            # the embedding is homogeneous: keep numbers near one
            for l in range(LANES):
                t = max(tau[l], kappa[l])
                den[l] = 1.0 / t if live[l] and (t < 1e-3 or t > 1e3) else 1.0
                tau[l] *= den[l]
                kappa[l] *= den[l]
            for j in range(n):
                for l in range(LANES):
                    X[j, l] *= den[l]
                    Z[j, l] *= den[l]
            for r in range(rows):
                for l in range(LANES):
                    Y[r, l] *= den[l]
        _finish(bb, cb, X, Y, Z, tau, status[block])


@kernel
def _schur(A, M, cones, starts, offsets, AM, S):  # type: ignore[no-untyped-def]
    """``AM = A M`` and the factor of ``S = A M Aᵀ``, its diagonal raised by a rounding unit for dependent rows."""
    rows, n = A.shape[0], A.shape[1]
    for r in range(rows):
        for i in range(cones.shape[0]):
            k, s, o = cones[i], starts[i], offsets[i]
            for a in range(k):
                for l in range(LANES):
                    t = 0.0
                    for j in range(k):
                        t += A[r, s + j, l] * M[o + j * k + a, l]
                    AM[r, s + a, l] = t
    for r in range(rows):
        for q in range(r + 1):
            for l in range(LANES):
                S[r, q, l] = 0.0
            for j in range(n):
                for l in range(LANES):
                    S[r, q, l] += AM[r, j, l] * A[q, j, l]
    for r in range(rows):
        for l in range(LANES):
            S[r, r, l] = S[r, r, l] * (1.0 + 1e-15) + 1e-15
    _factor(S, rows)


@kernel
def _judge(A, b, c, Q, X, Y, Z, rp, rd, rg, quad, tau, kappa, mu, nb, nc, tolerance, iteration,
           live, best, status, measures, degree):  # type: ignore[no-untyped-def]  # fmt: skip
    """Complete the residuals, and settle the lanes that are done. Returns whether any lane goes on."""
    rows, n = A.shape[0], A.shape[1]
    running = False
    for l in range(LANES):
        cx, by, ep, ed = 0.0, 0.0, 0.0, 0.0
        for j in range(n):
            cx += c[j, l] * X[j, l]
            ed = max(ed, abs(rd[j, l]))
        for r in range(rows):
            by += b[r, l] * Y[r, l]
            ep = max(ep, abs(rp[r, l]))
        rg[l] += cx - by + quad[l] / tau[l]
        mu[l] /= degree
        if not live[l]:
            continue
        t = 1.0 / tau[l]
        primal = cx * t + 0.5 * quad[l] * t * t
        dual = by * t - 0.5 * quad[l] * t * t
        gap = abs(primal - dual) / max(1.0, min(abs(primal), abs(dual)))
        ep_rel, ed_rel = ep * t / (1.0 + nb[l]), ed * t / (1.0 + nc[l])
        worst = max(gap, max(ep_rel, ed_rel))
        measures[4, l] = iteration
        if worst <= tolerance:
            status[l], live[l] = OPTIMAL, False
            measures[0, l], measures[1, l], measures[2, l], measures[3, l] = primal, dual, ep_rel, ed_rel
            continue
        if by > 0.0:  # certificate of infeasibility: Aᵀ y + z = 0
            error = 0.0
            for j in range(n):
                e = Z[j, l]
                for r in range(rows):
                    e += A[r, j, l] * Y[r, l]
                error = max(error, abs(e))
            if error <= tolerance * by and by > tolerance * kappa[l] * 0.0 and kappa[l] > tau[l]:
                status[l], live[l] = INFEASIBLE, False
                measures[0, l], measures[1, l], measures[2, l], measures[3, l] = np.inf, np.inf, error / by, error / by
                continue
        if cx < 0.0 and kappa[l] > tau[l]:  # certificate of unboundedness: A x = 0, Q x = 0, cᵀ x < 0
            error = 0.0
            for r in range(rows):
                e = 0.0
                for j in range(n):
                    e += A[r, j, l] * X[j, l]
                error = max(error, abs(e))
            for j in range(n):
                error = max(error, abs(Q[j, l] * X[j, l]))
            if error <= -tolerance * cx:
                status[l], live[l] = UNBOUNDED, False
                measures[0, l], measures[1, l], measures[2, l], measures[3, l] = -np.inf, -np.inf, error, error
                continue
        if not (mu[l] > 1e-30):
            live[l] = False
        if worst < best[l]:
            best[l] = worst
            measures[0, l], measures[1, l], measures[2, l], measures[3, l] = primal, dual, ep_rel, ed_rel
        if live[l]:
            running = True
    return running


@kernel
def _finish(b, c, X, Y, Z, tau, status):  # type: ignore[no-untyped-def]
    """Leave the embedding: divide by τ, or normalise the certificate."""
    rows, n = Y.shape[0], X.shape[0]
    for l in range(LANES):
        t = tau[l]
        if status[l] == INFEASIBLE:
            t = 0.0
            for r in range(rows):
                t += b[r, l] * Y[r, l]
        elif status[l] == UNBOUNDED:
            t = 0.0
            for j in range(n):
                t -= c[j, l] * X[j, l]
        for j in range(n):
            X[j, l] /= t
            Z[j, l] /= t
        for r in range(rows):
            Y[r, l] /= t
