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

Eight problems stand side by side on lanes (`kernels.vector`); one that is finished makes room for the next at once. One problem
alone takes the same way with seven idle places: its steps are so short that a kernel of its own would not be faster.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .cone_algebra import LAMBDA, apply, apply_rows, quadratic, quotient, room, scaling, triangular
from .cone_rows import WIDTH, backward, factor, forward, gather, gram, load, splat, spread
from .vector import larger, magnitude, select, smaller, store

OPTIMAL, INFEASIBLE, UNBOUNDED, INACCURATE, INVALID = 0, 1, 2, 3, 4
BALANCE, COUPLING = -1, -2
"""Kinds of rows; a limit's row has the column of its slack instead."""
STEP = 0.985
PATIENCE = 6
TOLERANCE = 1e-9
"""Relative residuals and duality gap at which a problem counts as solved."""
ACCEPTABLE = 1e-6
"""What still counts as solved where rounding stops the method earlier."""
EXTRAS = 7
"""Entries of an answer after x, y and z: status, primal and dual value, primal and dual residual, steps, size."""

X, Z, C, SQUARE, RD, RH, CH, QH, U, V, U0, D, E, VECTORS = 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20
"""Vectors of columns, behind those of the scaling: x, z, c, Q, the dual residual, that, c and 2 Q x / τ scaled, scaled
directions, and room for what becomes Δx and Δz."""
B, RP, Y, Y0, DY, UNIT, SHORTS = 0, 1, 2, 3, 4, 5, 6
"""Vectors of rows: b, the primal residual, y, its directions, and what rows were divided by."""
TAU, KAPPA, LEAST, SINCE, NORM_B, NORM_C, STEPS, SIZE, KEPT = 0, 1, 2, 3, 4, 5, 6, 7, 8
PRIMAL, DUAL, ERROR_P, ERROR_D, WORST, MU, BY, CX, PROOF, RAY, RG, QUAD, STATE = 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24  # fmt: skip
"""The state of a problem, the four figures of its best iterate, and what `_measure` finds."""


@kernel(borrow=True)
def _fetch(lane, columns, right, wrench, cones, slack, floor, begin, warm, A, V_, R, K):  # type: ignore[no-untyped-def]
    """Put a problem in a place: its right-hand side in units of its size, and where it starts."""
    n, rows = A.shape[0], A.shape[1]
    square = 0.0
    for r in range(rows):
        t = right[r, 0]
        for q in range(wrench.shape[0]):
            t += right[r, 1 + q] * wrench[q]
        R[B, r, lane] = t
        if slack[r] == BALANCE:
            square += t * t
    scale = np.sqrt(square)
    if scale < floor:
        scale = floor
    K[SIZE, lane] = scale
    if scale == 0.0:
        scale = 1.0
    largest = 0.0
    for r in range(rows):
        t = R[B, r, lane] / scale if scale < np.inf else 0.0  # what is not finite is answered as INVALID
        unit = max(1.0, abs(t)) if slack[r] >= 0 else 1.0
        R[B, r, lane], R[UNIT, r, lane] = t / unit, unit
        largest = max(largest, abs(t / unit))
        share = 1.0 / unit
        for j in range(n):
            A[j, r, lane] = columns[j, r] * share
        if slack[r] >= 0:
            A[slack[r], r, lane] = columns[slack[r], r]
    K[NORM_B, lane], largest = largest, 0.0
    K[TAU, lane], K[LEAST, lane], K[SINCE, lane], K[STEPS, lane] = 1.0, np.inf, 0.0, 0.0
    cold = 1.0 if warm <= 0.0 or begin[2 * n + rows] != OPTIMAL else warm
    s, i, dot = 0, 0, 0.0
    for j in range(n):
        V_[C, j, lane], V_[SQUARE, j, lane] = columns[j, rows], columns[j, rows + 1]
        largest = max(largest, abs(columns[j, rows]))
        e = 0.0
        if j == s:
            e, s, i = cold, s + cones[i], i + 1
        x, z = e, e
        if cold < 1.0:
            x += (1.0 - cold) * begin[j]
            z += (1.0 - cold) * begin[n + rows + j]
        V_[X, j, lane], V_[Z, j, lane] = x, z
        dot += x * z
    for r in range(rows):
        R[Y, r, lane] = (1.0 - cold) * begin[n + r] * R[UNIT, r, lane] if cold < 1.0 else 0.0
    K[NORM_C, lane], K[KAPPA, lane] = largest, dot / cones.shape[0]


@kernel(inline=True)
def _measure(A, V_, R, K, degree):  # type: ignore[no-untyped-def]
    """Residuals of all places, and the numbers that decide about them."""
    tau, kappa = load(K, TAU), load(K, KAPPA)
    spread(A, R, Y, V_, RD)
    gather(A, V_, X, R, RP)
    mu, quad, cx, by = tau * kappa, splat(0.0), splat(0.0), splat(0.0)
    ep, ed, proof, ray = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    for j in range(A.shape[0]):
        x, z, c, ay = load(V_, X, j), load(V_, Z, j), load(V_, C, j), load(V_, RD, j)
        qx = load(V_, SQUARE, j) * x
        t = qx + c * tau - z - ay
        store(V_, RD, j, t)
        ed = larger(magnitude(t), ed)
        proof = larger(magnitude(z + ay), proof)
        ray = larger(magnitude(qx), ray)
        mu += x * z
        cx += c * x
        quad += qx * x
    for r in range(A.shape[1]):
        ax, b = load(R, RP, r), load(R, B, r)
        t = ax - b * tau
        store(R, RP, r, t)
        ep = larger(magnitude(t), ep)
        ray = larger(magnitude(ax), ray)
        by += b * load(R, Y, r)
    share = 1.0 / tau
    mu *= 1.0 / degree
    half = 0.5 * quad * share
    primal, dual = (cx + half) * share, (by - half) * share
    gap = magnitude(primal - dual) / larger(0.01, smaller(magnitude(primal), magnitude(dual)))
    ep, ed = ep * share / (1.0 + load(K, NORM_B)), ed * share / (1.0 + load(K, NORM_C))
    store(K, PRIMAL, primal)
    store(K, DUAL, dual)
    store(K, ERROR_P, ep)
    store(K, ERROR_D, ed)
    store(K, WORST, larger(larger(ep, ed), gap + 0.0 * mu))  # NaN of any kind stays
    store(K, MU, mu)
    store(K, BY, by)
    store(K, CX, cx)
    store(K, PROOF, proof)
    store(K, RAY, ray)
    store(K, RG, kappa + cx - by + quad * share)
    store(K, QUAD, quad)


@kernel(inline=True)
def _keep(V_, R, K, best):  # type: ignore[no-untyped-def]
    """Remember the best iterate of each place and its figures; may be called again without a step between."""
    n, rows = V_.shape[1], R.shape[1]
    worst, least, since = load(K, WORST), load(K, LEAST), load(K, SINCE)
    better = worst < least
    store(K, SINCE, select(better, select(worst > 0.5 * least, since - 1.0, 0.0), since))
    store(K, LEAST, select(better, worst, least))
    share = 1.0 / load(K, TAU)
    for j in range(n):
        store(best, j, select(better, load(V_, X, j) * share, load(best, j)))
        store(best, n + rows + j, select(better, load(V_, Z, j) * share, load(best, n + rows + j)))
    for r in range(rows):
        store(best, n + r, select(better, load(R, Y, r) * share, load(best, n + r)))
    for r in range(4):
        store(K, KEPT + r, select(better, load(K, PRIMAL + r), load(K, KEPT + r)))


@kernel(borrow=True)
def _verdict(lane, limit, K):  # type: ignore[no-untyped-def]
    """The status of a place, −1 while it is open."""
    if not K[SIZE, lane] < np.inf:
        return INVALID
    if K[LEAST, lane] <= TOLERANCE:
        return OPTIMAL
    dead = K[KAPPA, lane] > K[TAU, lane]
    stop = K[STEPS, lane] >= limit or not (K[MU, lane] > 1e-40) or (K[SINCE, lane] > PATIENCE and not dead)
    enough = ACCEPTABLE if stop else TOLERANCE
    if dead and K[PROOF, lane] <= enough * K[BY, lane]:
        return INFEASIBLE
    if dead and K[RAY, lane] <= -enough * K[CX, lane]:
        return UNBOUNDED
    if stop:
        return OPTIMAL if K[LEAST, lane] <= ACCEPTABLE else INACCURATE
    return -1


@kernel(borrow=True)
def _give(lane, code, A, slack, V_, R, K, best, out):  # type: ignore[no-untyped-def]
    """Write the answer of a place; x is put back onto the balance rows, which are orthonormal, to the last digits."""
    n, rows = V_.shape[1], R.shape[1]
    m = 2 * n + rows
    for j in range(m):
        out[j] = 0.0 if code == INVALID else best[j, lane]
    for j in range(4):
        out[m + 1 + j] = K[KEPT + j, lane]
    for r in range(rows):
        if slack[r] == BALANCE and code != INVALID:
            t = R[B, r, lane]
            for j in range(n):
                t -= A[j, r, lane] * out[j]
            for j in range(n):
                out[j] += A[j, r, lane] * t
    if code in (INFEASIBLE, UNBOUNDED):
        over = 1.0 / K[BY, lane] if code == INFEASIBLE else -1.0 / K[CX, lane]
        for j in range(n):
            out[j], out[n + rows + j] = V_[X, j, lane] * over, V_[Z, j, lane] * over
        for r in range(rows):
            out[n + r] = R[Y, r, lane] * over
        out[m + 1] = out[m + 2] = np.inf if code == INFEASIBLE else -np.inf
        out[m + 3] = out[m + 4] = over * (K[PROOF, lane] if code == INFEASIBLE else K[RAY, lane])
    for r in range(rows):
        out[n + r] /= R[UNIT, r, lane]
    nothing = K[SIZE, lane] == 0.0 and code != OPTIMAL  # of no size, but rays have one
    out[m], out[m + 5], out[m + 6] = code, K[STEPS, lane], 1.0 if nothing else K[SIZE, lane]


@kernel(borrow=True)
def _direction(phase, rest, A, L, S, V_, R, cones):  # type: ignore[no-untyped-def]
    """Solve ``(1 + WQW) u − Âᵀ y = −d`` with ``Â u = b`` (phase 0) or ``−rest rp``; what the last row makes of it."""
    if L.shape[0] > 0:
        triangular(V_, cones, L, D, False)
    gather(A, V_, D, R, DY)
    for r in range(A.shape[1]):
        right = load(R, B, r) if phase == 0 else -(rest * load(R, RP, r))
        store(R, DY, r, load(R, DY, r) + right)
    forward(S, 0, A.shape[1], R, DY)
    backward(S, 0, A.shape[1], R, DY)
    spread(A, R, DY, V_, U)
    for j in range(A.shape[0]):
        store(V_, U, j, load(V_, U, j) - load(V_, D, j))
    if L.shape[0] > 0:
        triangular(V_, cones, L, U, True)
    t = splat(0.0)
    for j in range(A.shape[0]):
        t += (load(V_, CH, j) + load(V_, QH, j)) * load(V_, U, j)
    for r in range(A.shape[1]):
        t -= load(R, B, r) * load(R, DY, r)
    return t


@kernel(inline=True)
def _prepare(A, Ah, S, W, L, V_, R, cones, share):  # type: ignore[no-untyped-def]
    """Scaling and factors at the current point."""
    scaling(V_, cones, X, Z)
    apply_rows(V_, cones, A, Ah)
    apply(V_, cones, 1.0, C, CH)
    apply(V_, cones, 1.0, RD, RH)
    for j in range(A.shape[0]):
        store(V_, QH, j, splat(0.0))
    if L.shape[0] > 0:
        for j in range(A.shape[0]):
            store(V_, E, j, 2.0 * load(V_, SQUARE, j) * load(V_, X, j) * share)
        apply(V_, cones, 1.0, E, QH)
        quadratic(V_, cones, SQUARE, W, L, Ah)
    gram(Ah, S)
    factor(S, 0, A.shape[1])


@kernel(inline=True)
def _advance(A, Ah, S, W, L, V_, R, K, cones):  # type: ignore[no-untyped-def]
    """One step of all places: the direction of the embedding's constant, predictor, corrector."""
    n, rows = A.shape[0], A.shape[1]
    tau, kappa, mu, rg, quad = load(K, TAU), load(K, KAPPA), load(K, MU), load(K, RG), load(K, QUAD)
    share = 1.0 / tau
    _prepare(A, Ah, S, W, L, V_, R, cones, share)
    sigma, dtau, dkappa, alpha = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    den, dk = splat(1.0), kappa * tau
    for phase in range(3):
        rest = 1.0 - sigma
        if phase == 2:
            quotient(V_, cones, U, V, sigma * mu, E)
            dk = kappa * tau + dtau * dkappa - sigma * mu
        for j in range(n):
            if phase == 0:
                store(V_, D, j, load(V_, CH, j))
            else:
                t = load(V_, LAMBDA, j) if phase == 1 else load(V_, LAMBDA, j) + load(V_, E, j)
                store(V_, V, j, t)
                store(V_, D, j, t + rest * load(V_, RH, j))
        t = _direction(phase, rest, Ah, L, S, V_, R, cones)
        if phase == 0:
            den = t - kappa * share - quad * share * share
            for j in range(n):
                store(V_, U0, j, load(V_, U, j))
            for r in range(rows):
                store(R, Y0, r, load(R, DY, r))
            continue
        dtau = (dk * share - rest * rg - t) / den
        dkappa = -(dk + kappa * dtau) * share
        for j in range(n):
            t = load(V_, U, j) + dtau * load(V_, U0, j)
            store(V_, U, j, t)
            store(V_, V, j, -load(V_, V, j) - t)
        for r in range(rows):
            store(R, DY, r, load(R, DY, r) + dtau * load(R, Y0, r))
        if L.shape[0] > 0:  # where W stretches Q, the dual equation gives more digits of Δz than complementarity
            apply(V_, cones, 1.0, U, D)
            spread(A, R, DY, V_, E)
            for j in range(n):
                t = load(V_, SQUARE, j) * load(V_, D, j) + load(V_, C, j) * dtau + rest * load(V_, RD, j)
                store(V_, E, j, t - load(V_, E, j))
            apply(V_, cones, 1.0, E, V)
        need = larger(larger(room(V_, cones, U, V), -dtau * share), larger(-dkappa / kappa, 1e-30))
        alpha = 1.0 / need
        if phase == 1:
            t = 1.0 - smaller(alpha, 1.0)
            sigma = t * t
    alpha = smaller(STEP * alpha, 1.0)
    if L.shape[0] == 0:
        apply(V_, cones, 1.0, U, D)
        apply(V_, cones, -1.0, V, E)
    _move(alpha, tau + alpha * dtau, kappa + alpha * dkappa, V_, R, K)


@kernel(inline=True)
def _move(alpha, tau, kappa, V_, R, K):  # type: ignore[no-untyped-def]
    """Go a step where it leads on, and keep numbers near one: the embedding is homogeneous."""
    good = alpha > 1e-9
    t = larger(tau, kappa)
    scale = select(t < 1e-3, 1.0 / t, select(t > 1e3, 1.0 / t, 1.0))
    store(K, TAU, select(good, scale * tau, load(K, TAU)))
    store(K, KAPPA, select(good, scale * kappa, load(K, KAPPA)))
    store(K, SINCE, select(good, load(K, SINCE) + 1.0, 99.0))
    store(K, STEPS, load(K, STEPS) + 1.0)
    for j in range(V_.shape[1]):
        a, b = load(V_, X, j), load(V_, Z, j)
        store(V_, X, j, select(good, scale * (a + alpha * load(V_, D, j)), a))
        store(V_, Z, j, select(good, scale * (b + alpha * load(V_, E, j)), b))
    for r in range(R.shape[1]):
        a = load(R, Y, r)
        store(R, Y, r, select(good, scale * (a + alpha * load(R, DY, r)), a))


@kernel(borrow=True)
def _run(
    columns, right, wrench, cones, slack, floor, begin, warm, chain, limit, out, A, Ah, S, W, L, V_, R, K, best, problem,
    last,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """The work of `solve` in its scratch: eight places, each of which takes the next problem when its own is done."""
    count = out.shape[0]
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
                code = _verdict(lane, limit, K) if p >= 0 else -1
                if code < 0:
                    continue
                _give(lane, code, A, slack, V_, R, K, best, out[p])
                left -= 1
            p = p + 1 if chain else following
            following += 1
            problem[lane] = -1
            if p < (last[lane] if chain else count):
                problem[lane], fresh = p, True
                earlier = out[p - 1] if chain and p > lane * stride else begin[p if begin.shape[0] > 1 else 0]
                share = warm if not chain or p > lane * stride else 0.0
                _fetch(lane, columns[p if columns.shape[0] > 1 else 0], right[p if right.shape[0] > 1 else 0],
                       wrench[p if wrench.shape[0] > 1 else 0], cones, slack, floor, earlier, share, A, V_, R, K)  # fmt: skip
        if fresh:
            first = False
        elif left > 0:
            _advance(A, Ah, S, W, L, V_, R, K, cones)
        if left > 0:
            _measure(A, V_, R, K, cones.shape[0] + 1.0)
            _keep(V_, R, K, best)


@kernel
def solve(columns, right, wrench, cones, slack, floor, begin, warm, chain, limit, out):  # type: ignore[no-untyped-def]
    """Solve N problems into ``out (N, 2 n + rows + EXTRAS)``: x, y, z and what follows them.

    ``columns (N, n, rows + 2)``: of A, c and Q; ``right (N, rows, 1 + p)``, ``wrench (N, p)``: ``b = right (1, wrench)``;
    axes of length 1 are shared. *cones*: odd sizes. ``slack (rows,)``: kinds of rows; b is counted in units of the
    norm of its balance rows, at least *floor*, and the row of a limit in units of the limit where that is larger.
    With *warm* > 0 problems start from earlier answers ``begin (N, …)``, moved by that share towards the middle of the
    cones, or, if *chain*, from their predecessors. For INFEASIBLE, y and z are the certificate ``Aᵀ y + z = 0``,
    ``bᵀ y = 1``; for UNBOUNDED, x is a ray with ``A x = 0``, ``cᵀ x = −1``.
    """
    n, rows = columns.shape[1], right.shape[1]
    widest, curved = 1, False
    for i in range(cones.shape[0]):
        widest = max(widest, cones[i])
    for p in range(columns.shape[0]):
        for j in range(n):
            curved |= columns[p, j, rows + 1] != 0.0
    A, Ah, S = np.zeros((n, rows, WIDTH)), np.empty((n, rows, WIDTH)), np.empty((rows, rows, WIDTH))
    W, L = np.empty((widest, widest, WIDTH)), np.empty((n if curved else 0, widest, WIDTH))
    V_, R, K, best = np.ones((VECTORS, n, WIDTH)), np.ones((SHORTS, rows, WIDTH)), np.ones((STATE, WIDTH)), np.zeros((2 * n + rows, WIDTH))  # fmt: skip
    problem, last = np.full(WIDTH, -1), np.zeros(WIDTH, np.int64)
    _run(
        columns, right, wrench, cones, slack, floor, begin, warm, chain, limit, out, A, Ah, S, W, L, V_, R, K, best, problem,
        last,
    )  # fmt: skip
