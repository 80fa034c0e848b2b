"""The pose nearest to a target that cannot be reached: damped descent on lanes from many starts, within the limits.

The cost of a joint vector is ½ ‖Δp‖² + 1 − cos θ, with lengths over the chain's reach. Its gradient is −Jᵀ (Δp, sin θ · axis)
exactly, so a stationary point of the iteration is one of the cost. The damping of every lane falls after a step
that lowers the cost, and rises after one that does not, which is taken back (Levenberg–Marquardt).
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .ik_chain import (
    DUAL,
    ERR,
    LAMBDA,
    POS,
    ROT,
    SCALE,
    TARGET,
    WORK,
    L,
    add_columns,
    columns,
    forward,
    gram,
    hold_limits,
    solve_dual,
)
from .ik_queue import load_start, load_target, rest_lane

REST = 1e-14  # a relative gain below this, several times in a row, ends a start


@kernel(borrow=True)
def cost_block(w, cost):
    """Cost ``cost (L)`` and the error that is its negative gradient."""
    t, r = TARGET, ROT
    for l in range(L):
        total = 0.0
        for k in range(3):
            d = w[t + (9 + k) * L + l] - w[POS + k * L + l]
            w[ERR + k * L + l] = d
            total += d * d
        x = y = z = trace = 0.0
        for k in range(3):
            t0, t1, t2 = w[t + k * L + l], w[t + (3 + k) * L + l], w[t + (6 + k) * L + l]
            r0, r1, r2 = w[r + k * L + l], w[r + (3 + k) * L + l], w[r + (6 + k) * L + l]
            trace += t0 * r0 + t1 * r1 + t2 * r2
            x += t2 * r1 - t1 * r2
            y += t0 * r2 - t2 * r0
            z += t1 * r0 - t0 * r1
        w[ERR + 3 * L + l] = 0.5 * x
        w[ERR + 4 * L + l] = 0.5 * y
        w[ERR + 5 * L + l] = 0.5 * z
        cost[l] = 0.5 * total + 0.5 * (3.0 - trace)


@kernel(borrow=True)
def descend(chain, w, J, q, step):
    """``step = Jᵀ y``, shortened as a whole to half a radian, onto ``q``, clamped to the limits."""
    k = chain.lower.shape[0]
    for l in range(L):
        w[SCALE + l] = 0.5
    for c in range(k):
        for l in range(L):
            d = 0.0
            for r in range(6):
                d += J[(6 * c + r) * L + l] * w[DUAL + r * L + l]
            step[c * L + l] = d
            w[SCALE + l] = max(w[SCALE + l], abs(d))
    for c in range(k):
        for l in range(L):
            v = q[c * L + l] + step[c * L + l] * 0.5 / w[SCALE + l]
            q[c * L + l] = min(max(v, chain.lower[c]), chain.upper[c])


@kernel
def judge_step(l, k, cost, least, lowest, damping, idle, q, before):
    """Keep lane l's step if its cost fell, and trust the model more; else take it back, and trust it less.

    ``idle (L)`` counts steps that gained less than *least*, a step taken back as a third of one.
    """
    gain = lowest[l] - cost[l]
    if gain >= 0.0:
        idle[l] = idle[l] + 1.0 if gain < least else 0.0
        lowest[l] = cost[l]
        damping[l] = max(damping[l] * 0.25, 1e-9)
        for c in range(k):
            before[c * L + l] = q[c * L + l]
    else:
        damping[l] = min(damping[l] * 8.0, 1e6)
        idle[l] += 0.34
        for c in range(k):
            q[c * L + l] = before[c * L + l]


@kernel
def nearest_poses(chain, targets, first, last, guesses, table, order, seed, starts, most, best, best_cost):
    """Nearest joint vectors ``best (N, k)`` and their costs, from *starts* starts of at most *most* steps each."""
    k = chain.lower.shape[0]
    q, before, step = np.zeros(k * L), np.zeros(k * L), np.zeros(k * L)
    axes = np.zeros(6 * chain.kind.shape[0] * L)
    J = np.zeros(6 * k * L)
    w = np.zeros(WORK)
    cost, lowest, damping, idle, age = np.zeros(L), np.zeros(L), np.zeros(L), np.zeros(L), np.zeros(L)
    target = np.full(L, -1)
    job = first * starts
    for l in range(L):
        rest_lane(w, l)
    working = True
    while working:
        working = False
        for l in range(L):
            if target[l] < 0 and job < last * starts:
                t = job // starts
                target[l] = t
                load_target(targets, t, w, l)
                load_start(chain, guesses, table, order, seed, t, job - t * starts, q, l)
                job += 1
                lowest[l], damping[l], idle[l], age[l] = 1e300, 0.01, 0.0, 0.0
            if target[l] >= 0:
                working = True
        forward(chain, q, axes, w)
        cost_block(w, cost)
        for l in range(L):
            t = target[l]
            if t < 0:
                continue
            age[l] += 1.0
            judge_step(l, k, cost, REST * (0.01 + cost[l]), lowest, damping, idle, q, before)
            w[LAMBDA + l] = damping[l]
            if idle[l] > 3.0 or age[l] >= most:
                if lowest[l] < best_cost[t]:
                    best_cost[t] = lowest[l]
                    for c in range(k):
                        best[t, c] = before[c * L + l]
                target[l] = -1
        # a step that was taken back needs the Jacobian at the old place: one more pass of the arithmetic is cheap
        forward(chain, q, axes, w)
        cost_block(w, cost)
        if chain.kind.shape[0] == k:
            columns(chain.kind, chain.gain, chain.column, axes, w, J)
        else:
            add_columns(chain, axes, w, J)
        hold_limits(chain, q, w, J)
        gram(w, J, k)
        solve_dual(w)
        descend(chain, w, J, q, step)
