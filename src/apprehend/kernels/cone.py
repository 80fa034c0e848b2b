"""Cone programs: a primal-dual interior-point method for contact forces, eight problems at a time.

Solves many small problems of one shape::

    minimise   ½ xᵀ diag(Q) x + cᵀ x     subject to   A x = b,  x ∈ K

where K is a product of half-lines (size 1) and second-order cones ``{x : x₀ ≥ ‖x₁…‖}``. The homogeneous self-dual
embedding (Ye, Todd and Mizuno 1994; with a quadratic term: Goulart and Chen, Clarabel, 2024) gives every problem an
end: an optimum with its dual, or a certificate that there is none. Scaling by Nesterov and Todd (`kernels.cone_algebra`),
steps by Mehrotra.

A grasp has few rows (6 balance equations and the couplings of its limits), so a step is one small Cholesky factor of
``Â Âᵀ`` with the scaled matrix ``Â = A W`` (`kernels.cone_rows`). Directions are kept scaled too, u = W⁻¹ Δx and
v = W Δz: there both are of the size of λ, and what a step leaves of ``A x = b`` is small to the last digits.

Eight problems stand side by side in wide numbers; one that is finished makes room for the next at once. One problem
alone takes the same way with seven idle places: its steps are so short that a kernel of its own would not be faster.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .cone_algebra import apply, apply_rows, quadratic, quotient, room, scaling, triangular
from .cone_rows import backward, factor, forward, gather, gram, spread
from .wide import WIDTH, larger, load, size, smaller, store, where, wide

OPTIMAL, INFEASIBLE, UNBOUNDED, INACCURATE, INVALID = 0, 1, 2, 3, 4
BALANCE, COUPLING = -1, -2
"""Kinds of rows; a limit's row has the column of its slack instead."""
STEP = 0.985
PATIENCE = 6
TOLERANCE = 1e-9
"""Relative residuals and duality gap at which a problem counts as solved."""
ACCEPTABLE = 1e-7
"""What still counts as solved where rounding stops the method earlier."""
EXTRAS = 7
"""Entries of an answer after x, y and z: status, primal and dual value, primal and dual residual, steps, size."""

TAU, KAPPA, LEAST, SINCE, NORM_B, NORM_C, STEPS, SIZE, STATE = 0, 1, 2, 3, 4, 5, 6, 7, 8
PRIMAL, DUAL, ERROR_P, ERROR_D, WORST, MU, BY, CX, PROOF, RAY, RG, QUAD, MEASURES = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12  # fmt: skip


@kernel
def _fetch(lane, D, H, wrench, cones, slack, floor, begin, warm, A, b, c, Q, x, y, z, unit, K):  # type: ignore[no-untyped-def]
    """Put a problem in a place: its right-hand side in units of its size, and where it starts."""
    n, rows = A.shape[0], A.shape[1]
    square = 0.0
    for r in range(rows):
        t = H[r, 0]
        for q in range(wrench.shape[0]):
            t += H[r, 1 + q] * wrench[q]
        b[r, lane] = t
        if slack[r] == BALANCE:
            square += t * t
    scale = np.sqrt(square)
    if scale < floor:
        scale = floor
    if scale == 0.0:
        scale = 1.0
    K[SIZE, lane] = scale
    largest = 0.0
    for r in range(rows):
        t = b[r, lane] / scale if scale < np.inf else 0.0  # what is not finite is answered as INVALID
        unit[r, lane] = max(1.0, abs(t)) if slack[r] >= 0 else 1.0
        t /= unit[r, lane]
        b[r, lane] = t
        largest = max(largest, abs(t))
    K[NORM_B, lane] = largest
    largest = 0.0
    for j in range(n):
        for r in range(rows):
            A[j, r, lane] = D[j, r] / unit[r, lane]
        c[j, lane], Q[j, lane] = D[j, rows], D[j, rows + 1]
        largest = max(largest, abs(c[j, lane]))
    for r in range(rows):
        if slack[r] >= 0:
            A[slack[r], r, lane] = D[slack[r], r]
    K[NORM_C, lane] = largest
    K[TAU, lane], K[LEAST, lane], K[SINCE, lane], K[STEPS, lane] = 1.0, np.inf, 0.0, 0.0
    cold = 1.0 if warm <= 0.0 or begin[2 * n + rows] != OPTIMAL else warm
    s, i, dot = 0, 0, 0.0
    for j in range(n):
        e = 0.0
        if j == s:
            e, s, i = 1.0, s + cones[i], i + 1
        x[j, lane] = z[j, lane] = cold * e
        if cold < 1.0:
            x[j, lane] += (1.0 - cold) * begin[j]
            z[j, lane] += (1.0 - cold) * begin[n + rows + j]
        dot += x[j, lane] * z[j, lane]
    for r in range(rows):
        y[r, lane] = (1.0 - cold) * begin[n + r] if cold < 1.0 else 0.0
    K[KAPPA, lane] = dot / cones.shape[0]


@kernel
def _measure(A, b, c, Q, x, y, z, rd, rp, K, M, degree):  # type: ignore[no-untyped-def]
    """Residuals *rp*, *rd* of all places, and the numbers that decide about them."""
    tau, kappa = load(K, TAU), load(K, KAPPA)
    spread(A, y, rd)
    gather(A, x, rp)
    mu, quad, cx, by = tau * kappa, wide(0.0), wide(0.0), wide(0.0)
    ep, ed, proof, ray = wide(0.0), wide(0.0), wide(0.0), wide(0.0)
    for j in range(A.shape[0]):
        xj, zj, cj, ay = load(x, j), load(z, j), load(c, j), load(rd, j)
        qx = load(Q, j) * xj
        t = qx + cj * tau - zj - ay
        store(rd, j, t)
        ed = larger(size(t), ed)
        proof = larger(size(zj + ay), proof)
        ray = larger(size(qx), ray)
        mu += xj * zj
        cx += cj * xj
        quad += qx * xj
    for r in range(A.shape[1]):
        ax, br = load(rp, r), load(b, r)
        t = ax - br * tau
        store(rp, r, t)
        ep = larger(size(t), ep)
        ray = larger(size(ax), ray)
        by += br * load(y, r)
    share = 1.0 / tau
    mu *= 1.0 / degree
    half = 0.5 * quad * share
    primal, dual = (cx + half) * share, (by - half) * share
    gap = size(primal - dual) / larger(1.0, smaller(size(primal), size(dual)))
    ep, ed = ep * share / (1.0 + load(K, NORM_B)), ed * share / (1.0 + load(K, NORM_C))
    store(M, PRIMAL, primal)
    store(M, DUAL, dual)
    store(M, ERROR_P, ep)
    store(M, ERROR_D, ed)
    store(M, WORST, larger(larger(ep, ed), gap + 0.0 * mu))  # NaN of any kind stays
    store(M, MU, mu)
    store(M, BY, by)
    store(M, CX, cx)
    store(M, PROOF, proof)
    store(M, RAY, ray)
    store(M, RG, kappa + cx - by + quad * share)
    store(M, QUAD, quad)


@kernel
def _keep(x, y, z, K, M, best, figures):  # type: ignore[no-untyped-def]
    """Remember the best iterate of each place and its figures."""
    n, rows = x.shape[0], y.shape[0]
    worst, least, since = load(M, WORST), load(K, LEAST), load(K, SINCE)
    better = worst < least
    store(K, SINCE, where(better, where(worst > 0.5 * least, since, 0.0), since + 1.0))
    store(K, LEAST, where(better, worst, least))
    share = 1.0 / load(K, TAU)
    for j in range(n):
        store(best, j, where(better, load(x, j) * share, load(best, j)))
        store(best, n + rows + j, where(better, load(z, j) * share, load(best, n + rows + j)))
    for r in range(rows):
        store(best, n + r, where(better, load(y, r) * share, load(best, n + r)))
    for r in range(4):
        store(figures, r, where(better, load(M, r), load(figures, r)))


@kernel
def _verdict(lane, limit, K, M):  # type: ignore[no-untyped-def]
    """The status of a place, −1 while it is open."""
    if not K[SIZE, lane] < np.inf:
        return INVALID
    if K[LEAST, lane] <= TOLERANCE:
        return OPTIMAL
    dead = K[KAPPA, lane] > K[TAU, lane]
    stop = K[STEPS, lane] >= limit or not (M[MU, lane] > 1e-40) or (K[SINCE, lane] > PATIENCE and not dead)
    enough = ACCEPTABLE if stop else TOLERANCE
    if dead and M[PROOF, lane] <= enough * M[BY, lane]:
        return INFEASIBLE
    if dead and M[RAY, lane] <= -enough * M[CX, lane]:
        return UNBOUNDED
    if stop:
        return OPTIMAL if K[LEAST, lane] <= ACCEPTABLE else INACCURATE
    return -1


@kernel
def _give(lane, code, x, y, z, unit, K, M, best, figures, out):  # type: ignore[no-untyped-def]
    """Write the answer of a place."""
    n, rows = x.shape[0], y.shape[0]
    m = 2 * n + rows
    for j in range(m):
        out[j] = 0.0 if code == INVALID else best[j, lane]
    out[m + 1], out[m + 2], out[m + 3], out[m + 4] = figures[0, lane], figures[1, lane], figures[2, lane], figures[3, lane]  # fmt: skip
    if code in (INFEASIBLE, UNBOUNDED):
        over = 1.0 / M[BY, lane] if code == INFEASIBLE else -1.0 / M[CX, lane]
        for j in range(n):
            out[j], out[n + rows + j] = x[j, lane] * over, z[j, lane] * over
        for r in range(rows):
            out[n + r] = y[r, lane] * over
        out[m + 1] = out[m + 2] = np.inf if code == INFEASIBLE else -np.inf
        out[m + 3] = out[m + 4] = over * (M[PROOF, lane] if code == INFEASIBLE else M[RAY, lane])
    for r in range(rows):
        out[n + r] /= unit[r, lane]
    out[m], out[m + 5], out[m + 6] = code, K[STEPS, lane], K[SIZE, lane]


@kernel
def _direction(phase, rest, A, L, S, cones, b, rp, ch, qh, d, u, y):  # type: ignore[no-untyped-def]
    """Solve ``(1 + WQW) u − Âᵀ y = −d`` with ``Â u = b`` (phase 0) or ``−rest rp``; what the last row makes of it."""
    if L.shape[0] > 0:
        triangular(L, cones, d, False)
    gather(A, d, y)
    for r in range(A.shape[1]):
        right = load(b, r) if phase == 0 else -(rest * load(rp, r))
        store(y, r, load(y, r) + right)
    forward(S, 0, A.shape[1], y)
    backward(S, 0, A.shape[1], y)
    spread(A, y, u)
    for j in range(A.shape[0]):
        store(u, j, load(u, j) - load(d, j))
    if L.shape[0] > 0:
        triangular(L, cones, u, True)
    t = wide(0.0)
    for j in range(A.shape[0]):
        t += (load(ch, j) + load(qh, j)) * load(u, j)
    for r in range(A.shape[1]):
        t -= load(b, r) * load(y, r)
    return t


@kernel
def _advance(A, b, c, Q, x, y, z, rd, rp, K, M, cones, degree,
             w, beta, lam, rh, ch, qh, u, v, u0, d, e, y1, y0, Ah, S, W, L):  # type: ignore[no-untyped-def]  # fmt: skip
    """One step of all places: scaling, factor, the direction of the embedding's constant, predictor, corrector."""
    n, rows = A.shape[0], A.shape[1]
    tau, kappa, mu, rg, quad = load(K, TAU), load(K, KAPPA), load(M, MU), load(M, RG), load(M, QUAD)
    share = 1.0 / tau
    scaling(x, z, cones, w, beta, lam)
    apply_rows(A, cones, w, beta, Ah)
    apply(c, cones, w, beta, 1.0, ch)
    apply(rd, cones, w, beta, 1.0, rh)
    for j in range(n):
        store(qh, j, wide(0.0))
    if L.shape[0] > 0:
        for j in range(n):
            store(e, j, 2.0 * load(Q, j) * load(x, j) * share)
        apply(e, cones, w, beta, 1.0, qh)
        quadratic(Q, cones, w, beta, W, L, Ah)
    gram(Ah, S)
    factor(S, 0, rows)
    sigma, dtau, dkappa, alpha = wide(0.0), wide(0.0), wide(0.0), wide(0.0)
    den, dk = wide(1.0), kappa * tau
    for phase in range(3):
        rest = 1.0 - sigma
        if phase == 2:
            quotient(lam, u, v, sigma * mu, cones, e)
            dk = kappa * tau + dtau * dkappa - sigma * mu
        for j in range(n):
            if phase == 0:
                store(d, j, load(ch, j))
            else:
                t = load(lam, j) if phase == 1 else load(lam, j) + load(e, j)
                store(v, j, t)
                store(d, j, t + rest * load(rh, j))
        t = _direction(phase, rest, Ah, L, S, cones, b, rp, ch, qh, d, u, y1)
        if phase == 0:
            den = t - kappa * share - quad * share * share
            for j in range(n):
                store(u0, j, load(u, j))
            for r in range(rows):
                store(y0, r, load(y1, r))
            continue
        dtau = (dk * share - rest * rg - t) / den
        dkappa = -(dk + kappa * dtau) * share
        for j in range(n):
            t = load(u, j) + dtau * load(u0, j)
            store(u, j, t)
            store(v, j, -load(v, j) - t)
        for r in range(rows):
            store(y1, r, load(y1, r) + dtau * load(y0, r))
        if L.shape[0] > 0:  # where W stretches Q, the dual equation gives more digits of Δz than complementarity
            apply(u, cones, w, beta, 1.0, d)
            spread(A, y1, e)
            for j in range(n):
                t = load(Q, j) * load(d, j) + load(c, j) * dtau + rest * load(rd, j)
                store(e, j, t - load(e, j))
            apply(e, cones, w, beta, 1.0, v)
        need = larger(larger(room(lam, u, v, cones), -dtau * share), larger(-dkappa / kappa, 1e-30))
        alpha = 1.0 / need
        if phase == 1:
            t = 1.0 - smaller(alpha, 1.0)
            sigma = t * t
    alpha = smaller(STEP * alpha, 1.0)
    if L.shape[0] == 0:
        apply(u, cones, w, beta, 1.0, d)
        apply(v, cones, w, beta, -1.0, e)
    _move(alpha, tau + alpha * dtau, kappa + alpha * dkappa, x, y, z, d, y1, e, K)


@kernel
def _move(alpha, tau, kappa, x, y, z, dx, dy, dz, K):  # type: ignore[no-untyped-def]
    """Go a step where it leads on, and keep numbers near one: the embedding is homogeneous."""
    good = alpha > 1e-9
    t = larger(tau, kappa)
    scale = where(t < 1e-3, 1.0 / t, where(t > 1e3, 1.0 / t, 1.0))
    store(K, TAU, where(good, scale * tau, load(K, TAU)))
    store(K, KAPPA, where(good, scale * kappa, load(K, KAPPA)))
    store(K, SINCE, where(good, load(K, SINCE), 99.0))
    store(K, STEPS, load(K, STEPS) + 1.0)
    for j in range(x.shape[0]):
        a, b = load(x, j), load(z, j)
        store(x, j, where(good, scale * (a + alpha * load(dx, j)), a))
        store(z, j, where(good, scale * (b + alpha * load(dz, j)), b))
    for r in range(y.shape[0]):
        a = load(y, r)
        store(y, r, where(good, scale * (a + alpha * load(dy, r)), a))


@kernel
def solve(D, H, wrench, cones, slack, floor, begin, warm, chain, limit, out):  # type: ignore[no-untyped-def]
    """Solve N problems into ``out (N, 2 n + rows + EXTRAS)``: x, y, z and what follows them.

    ``D (N, n, rows + 2)``: columns of A, c and Q; ``H (N, rows, 1 + p)`` and ``wrench (N, p)``: ``b = H (1, wrench)``;
    axes of length 1 are shared. *cones*: odd sizes. ``slack (rows,)``: kinds of rows; b is counted in units of the
    norm of its balance rows, at least *floor*, and the row of a limit in units of the limit where that is larger.
    With *warm* > 0 problems start from earlier answers ``begin (N, …)``, moved by that share towards the middle of the
    cones, or, if *chain*, from their predecessors. For INFEASIBLE, y and z are the certificate ``Aᵀ y + z = 0``,
    ``bᵀ y = 1``; for UNBOUNDED, x is a ray with ``A x = 0``, ``cᵀ x = −1``.
    """
    n, rows, count = D.shape[1], H.shape[1], out.shape[0]
    m, k, widest, curved = 2 * n + rows, cones.shape[0], 1, False
    for i in range(k):
        widest = max(widest, cones[i])
    for p in range(D.shape[0]):
        for j in range(n):
            curved |= D[p, j, rows + 1] != 0.0
    A, Ah = np.zeros((n, rows, WIDTH)), np.empty((n, rows, WIDTH))
    S, W = np.empty((rows, rows, WIDTH)), np.empty((widest, widest, WIDTH))
    L = np.empty((n if curved else 0, widest, WIDTH))
    x, z, c, Q, rd = np.ones((n, WIDTH)), np.ones((n, WIDTH)), np.zeros((n, WIDTH)), np.zeros((n, WIDTH)), np.empty((n, WIDTH))  # fmt: skip
    w, lam, rh, ch, qh = np.empty((n, WIDTH)), np.empty((n, WIDTH)), np.empty((n, WIDTH)), np.empty((n, WIDTH)), np.empty((n, WIDTH))  # fmt: skip
    u, v, u0, d, e = np.empty((n, WIDTH)), np.empty((n, WIDTH)), np.empty((n, WIDTH)), np.empty((n, WIDTH)), np.empty((n, WIDTH))  # fmt: skip
    b, rp, y, y0, y1, unit = np.zeros((rows, WIDTH)), np.empty((rows, WIDTH)), np.zeros((rows, WIDTH)), np.empty((rows, WIDTH)), np.empty((rows, WIDTH)), np.ones((rows, WIDTH))  # fmt: skip
    best, beta = np.zeros((m, WIDTH)), np.empty((k, WIDTH))
    K, M, figures = np.ones((STATE, WIDTH)), np.zeros((MEASURES, WIDTH)), np.zeros((4, WIDTH))
    problem, last = np.full(WIDTH, -1), np.zeros(WIDTH, np.int64)
    stride = (count + WIDTH - 1) // WIDTH if chain else 1
    following = 0
    for lane in range(WIDTH):
        problem[lane] = lane * stride - 1
        last[lane] = min((lane + 1) * stride, count)
    left, first = count, True
    while left > 0:
        fresh = first
        for lane in range(WIDTH):
            p = problem[lane]
            if not first:
                code = _verdict(lane, limit, K, M) if p >= 0 else -1
                if code < 0:
                    continue
                _give(lane, code, x, y, z, unit, K, M, best, figures, out[p])
                left -= 1
            p = p + 1 if chain else following
            following += 1
            problem[lane] = -1
            if p < (last[lane] if chain else count):
                problem[lane], fresh = p, True
                earlier = out[p - 1] if chain and p > lane * stride else begin[p if begin.shape[0] > 1 else 0]
                share = warm if not chain or p > lane * stride else 0.0
                _fetch(lane, D[p if D.shape[0] > 1 else 0], H[p if H.shape[0] > 1 else 0],
                       wrench[p if wrench.shape[0] > 1 else 0], cones, slack, floor, earlier, share,
                       A, b, c, Q, x, y, z, unit, K)  # fmt: skip
        if fresh:
            first = False
        elif left > 0:
            _advance(A, b, c, Q, x, y, z, rd, rp, K, M, cones, k + 1.0,
                     w, beta, lam, rh, ch, qh, u, v, u0, d, e, y1, y0, Ah, S, W, L)  # fmt: skip
        if left > 0:
            _measure(A, b, c, Q, x, y, z, rd, rp, K, M, k + 1.0)
            _keep(x, y, z, K, M, best, figures)
