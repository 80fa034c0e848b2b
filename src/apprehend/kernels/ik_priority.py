"""Strict priorities under bounds: a cascade of least-squares problems, each in the null space of those above it.

Level k minimises ‖J_k dq − e_k‖² + λ² ‖dq − dq₍ₖ₋₁₎‖² over all dq with lower ≤ dq ≤ upper that leave J_i dq of every level
i < k as it is: Siciliano and Slotine (1991) with bounds, as in the hierarchical quadratic programs of Escande,
Mansard and Wieber (2014). Since the moves of a level lie in an orthonormal basis N of the null space of all rows
above, a lower level cannot disturb a higher one by more than rounding.

The bounds are kept by a primal active-set method: dq is feasible from the first moment on, every step is cut where
a coordinate meets its bound, that coordinate is then held (a Householder reflection takes its row out of the
basis), and let go again when its multiplier has the wrong sign. Whenever the method stops, all bounds hold and all higher
levels are undisturbed; the number of changes is limited by a small multiple of n.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel

RANK = 1e-10  # rows of a level shorter than this in the null space count as zero


class PriorityWork(NamedTuple):
    """Scratch memory for `prioritised` with n coordinates and R rows."""

    N: np.ndarray  # (n, n) basis of what the levels above leave free
    B: np.ndarray  # (n, n) the part of it that leaves held coordinates alone
    A: np.ndarray  # (R, n)
    H: np.ndarray  # (n, n)
    vector: np.ndarray  # (6, n)
    rest: np.ndarray  # (R,)
    held: np.ndarray  # (n,) int64: −1 at the lower bound, 1 at the upper, 0 free


@kernel
def priority_work(n, rows):
    """Scratch memory for `prioritised`."""
    return PriorityWork(
        np.zeros((n, n)), np.zeros((n, n)), np.zeros((rows, n)), np.zeros((n, n)), np.zeros((6, n)), np.zeros(rows),
        np.zeros(n, np.int64),
    )  # fmt: skip


@kernel(borrow=True)
def take_out(B, width, row, u):
    """Reflect the first *width* columns of B so that row *row* is zero but in the last of them; 1 if it is so short
    that there is nothing to take out."""
    norm = 0.0
    for c in range(width):
        norm += B[row, c] * B[row, c]
    if norm < RANK * RANK:
        return 1
    norm = math.sqrt(norm)
    last = B[row, width - 1]
    sign = 1.0 if last >= 0.0 else -1.0
    for c in range(width):
        u[c] = B[row, c]
    u[width - 1] += sign * norm
    beta = 1.0 / (norm * (norm + abs(last)))
    for i in range(B.shape[0]):
        dot = 0.0
        for c in range(width):
            dot += B[i, c] * u[c]
        dot *= beta
        for c in range(width):
            B[i, c] -= dot * u[c]
    return 0


@kernel(borrow=True)
def cholesky(H, n, tiny):
    """Factor the leading n × n of H in place (lower triangle)."""
    for i in range(n):
        for j in range(i):
            s = H[i, j]
            for k in range(j):
                s -= H[i, k] * H[j, k]
            H[i, j] = s * H[j, j]
        s = H[i, i]
        for k in range(i):
            s -= H[i, k] * H[i, k]
        H[i, i] = 1.0 / math.sqrt(max(s, tiny))  # the diagonal holds reciprocals


@kernel(borrow=True)
def back_solve(H, n, x):
    """Solve with the factor of `cholesky` in place."""
    for i in range(n):
        s = x[i]
        for k in range(i):
            s -= H[i, k] * x[k]
        x[i] = s * H[i, i]
    for i in range(n - 1, -1, -1):
        s = x[i]
        for k in range(i + 1, n):
            s -= H[k, i] * x[k]
        x[i] = s * H[i, i]


@kernel(borrow=True)
def shrink_null_space(J, first, last, N, width, A, u):
    """Take the rows first … last of J out of the first *width* columns of N; returns the width that is left.

    Householder reflections of the columns, the row with the longest rest first.
    """
    n = N.shape[0]
    for i in range(first, last):
        for c in range(width):
            s = 0.0
            for k in range(n):
                s += J[i, k] * N[k, c]
            A[i, c] = s
    for _ in range(last - first):
        best = -1
        longest = RANK * RANK
        for i in range(first, last):
            s = 0.0
            for c in range(width):
                s += A[i, c] * A[i, c]
            if s > longest:
                longest = s
                best = i
        if best < 0 or width == 0:
            break
        norm = math.sqrt(longest)
        end = A[best, width - 1]
        sign = 1.0 if end >= 0.0 else -1.0
        for c in range(width):
            u[c] = A[best, c]
        u[width - 1] += sign * norm
        beta = 1.0 / (norm * (norm + abs(end)))
        for i in range(n):
            dot = 0.0
            for c in range(width):
                dot += N[i, c] * u[c]
            dot *= beta
            for c in range(width):
                N[i, c] -= dot * u[c]
        for i in range(first, last):
            dot = 0.0
            for c in range(width):
                dot += A[i, c] * u[c]
            dot *= beta
            for c in range(width):
                A[i, c] -= dot * u[c]
        width -= 1
    return width


@kernel(borrow=True)
def level_step(J, e, first, last, damping, dq, start, B, s, work):
    """Direction ``vector[1]`` from dq to the damped minimiser of one level within the first s columns of B."""
    n = dq.shape[0]
    A, H, z, d = work.A, work.H, work.vector[0], work.vector[1]
    for i in range(first, last):
        rest = e[i]
        for c in range(n):
            rest -= J[i, c] * dq[c]
        work.rest[i] = rest
        for c in range(s):
            dot = 0.0
            for k in range(n):
                dot += J[i, k] * B[k, c]
            A[i, c] = dot
    for c in range(s):
        dot = 0.0
        for k in range(n):
            dot -= B[k, c] * (dq[k] - start[k])
        dot *= damping
        for i in range(first, last):
            dot += A[i, c] * work.rest[i]
        z[c] = dot
        for b in range(c + 1):
            dot = 0.0
            for i in range(first, last):
                dot += A[i, c] * A[i, b]
            H[c, b] = dot
        H[c, c] += damping
    cholesky(H, s, 1e-300)
    back_solve(H, s, z)
    for k in range(n):
        dot = 0.0
        for c in range(s):
            dot += B[k, c] * z[c]
        d[k] = dot


@kernel(borrow=True)
def wrong_multiplier(J, e, first, last, damping, dq, start, N, width, work):
    """The held coordinate whose bound pulls the wrong way most, or −1: all multipliers are right."""
    n = dq.shape[0]
    g, y, mu = work.vector[2], work.vector[3], work.vector[4]
    for k in range(n):
        g[k] = damping * (dq[k] - start[k])
    for i in range(first, last):
        rest = -e[i]
        for c in range(n):
            rest += J[i, c] * dq[c]
        for c in range(n):
            g[c] += J[i, c] * rest
    scale = 1e-300
    for c in range(width):
        dot = 0.0
        for k in range(n):
            dot += N[k, c] * g[k]
        y[c] = dot
        scale = max(scale, abs(dot))
    count = 0
    for k in range(n):
        if work.held[k] != 0:
            count += 1
    # (N_W N_Wᵀ) µ = N_W Nᵀ g for the rows W of the held coordinates
    H = work.H
    row = 0
    for k in range(n):
        if work.held[k] == 0:
            continue
        dot = 0.0
        for c in range(width):
            dot += N[k, c] * y[c]
        mu[row] = dot
        other = 0
        for j in range(k + 1):
            if work.held[j] == 0:
                continue
            dot = 0.0
            for c in range(width):
                dot += N[k, c] * N[j, c]
            H[row, other] = dot
            other += 1
        H[row, row] += 1e-14
        row += 1
    cholesky(H, count, 1e-16)
    back_solve(H, count, mu)
    worst = 1e-9 * scale
    found = -1
    row = 0
    for k in range(n):
        if work.held[k] == 0:
            continue
        pull = mu[row] * work.held[k]  # at the upper bound a positive gradient means: rather go back
        row += 1
        if pull > worst:
            worst = pull
            found = k
    return found


@kernel(borrow=True)
def prioritised(J, e, levels, damping, lower, upper, dq, work):
    """The step ``dq (n)`` of all levels: rows ``levels[k] … levels[k + 1]`` of ``J (R, n)``, ``e (R)`` are level k.

    Returns the number of changes of the active set.
    """
    n = dq.shape[0]
    N, B, held, d = work.N, work.B, work.held, work.vector[1]
    start = work.vector[5]
    for i in range(n):
        dq[i] = min(max(0.0, lower[i]), upper[i])
        for c in range(n):
            N[i, c] = 1.0 if i == c else 0.0
    width = n
    changes = 0
    for level in range(levels.shape[0] - 1):
        first, last = levels[level], levels[level + 1]
        if width == 0:
            break
        s = width
        for i in range(n):
            start[i] = dq[i]
            held[i] = 0
            for c in range(width):
                B[i, c] = N[i, c]
        for _ in range(6 * n + 6):
            level_step(J, e, first, last, damping, dq, start, B, s, work)
            share = 1.0
            block = -1
            for i in range(n):
                if held[i] != 0:
                    continue
                if d[i] > 0.0 and dq[i] + d[i] > upper[i]:
                    f = (upper[i] - dq[i]) / d[i]
                    if f < share:
                        share = f
                        block = i
                elif d[i] < 0.0 and dq[i] + d[i] < lower[i]:
                    f = (lower[i] - dq[i]) / d[i]
                    if f < share:
                        share = f
                        block = i
            for i in range(n):
                if held[i] == 0:
                    dq[i] = min(max(dq[i] + share * d[i], lower[i]), upper[i])
            if block >= 0:
                changes += 1
                held[block] = 1 if d[block] > 0.0 else -1
                dq[block] = upper[block] if d[block] > 0.0 else lower[block]
                if s > 0 and take_out(B, s, block, work.vector[0]) == 0:
                    s -= 1
                if s == 0:
                    free = wrong_multiplier(J, e, first, last, damping, dq, start, N, width, work)
                else:
                    continue
            else:
                any_held = False
                for i in range(n):
                    if held[i] != 0:
                        any_held = True
                if not any_held:
                    break
                free = wrong_multiplier(J, e, first, last, damping, dq, start, N, width, work)
            if free < 0:
                break
            changes += 1
            held[free] = 0
            s = width
            for i in range(n):
                for c in range(width):
                    B[i, c] = N[i, c]
            for i in range(n):
                if held[i] != 0 and s > 0 and take_out(B, s, i, work.vector[0]) == 0:
                    s -= 1
        if level < levels.shape[0] - 2:
            width = shrink_null_space(J, first, last, N, width, work.A, work.vector[0])
    return changes


@kernel(borrow=True)
def brake(distance, acceleration, dt):
    """The largest velocity from which braking by at most *acceleration* in whole steps of dt stays within *distance*.

    After a step at v the next are v − a dt, v − 2 a dt, …; their way is max_k dt [(k + 1) v − a dt k (k + 1) / 2], so
    v ≤ min_k [distance / dt + a dt k (k + 1) / 2] / (k + 1), smallest next to k ≈ sqrt(2 distance / a) / dt.
    """
    if distance <= 0.0:
        return 0.0
    if not math.isfinite(acceleration) or not math.isfinite(distance):
        return distance / dt
    k = math.floor(math.sqrt(2.0 * distance / acceleration) / dt)
    best = math.inf
    for i in range(4):
        j = max(k - 2.0 + i, 0.0)
        best = min(best, (distance / dt + 0.5 * acceleration * dt * j * (j + 1.0)) / (j + 1.0))
    return best


@kernel(borrow=True)
def step_bounds(q, lower, upper, speed, acceleration, before, dt, low, high):
    """Bounds ``low, high (n)`` of the step from the limits of position, velocity and acceleration.

    *before* ``(n)`` is the velocity of the last step; a step that brakes as hard as it may is always allowed.
    """
    for i in range(q.shape[0]):
        a = acceleration[i]
        fast = min(speed[i], brake(upper[i] - q[i], a, dt))
        slow = -min(speed[i], brake(q[i] - lower[i], a, dt))
        if math.isfinite(a):
            fast = min(fast, before[i] + a * dt)
            slow = max(slow, before[i] - a * dt)
            if slow > fast:  # no step keeps all: the position first, then the velocity, braking hardest
                fast = max(min(slow, (upper[i] - q[i]) / dt), min(fast, 0.0))
                slow = fast
        high[i] = min(fast * dt, upper[i] - q[i])
        low[i] = max(slow * dt, lower[i] - q[i])
        if high[i] < low[i]:
            high[i] = low[i] = min(max(0.0, lower[i] - q[i]), upper[i] - q[i])
