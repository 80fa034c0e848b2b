"""Many targets through the lanes of `ik_chain`: a lane that is done with a start takes the next one at once.

The starts of a target are numbered: first the caller's guess (if there is one), then the nearest entries of a table
of known configurations, then random ones, which depend only on the seed and the start's number. The answer to a
target consists of the solutions of its lowest-numbered successful starts. So it does not depend on what else is in the batch,
nor on threads, nor on which of the two drivers ran.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .ik_box import box_error, turn_columns
from .ik_chain import (
    AGE,
    ERR,
    FLAG,
    PAST,
    SIN,
    TARGET,
    WORK,
    L,
    add_columns,
    advance,
    columns,
    forward,
    gram,
    hold_limits,
    pose_error,
    solve_dual,
)

TURN = 2.0 * math.pi


@kernel(borrow=True)
def uniform(seed, start, j):
    """A number in [0, 1) that depends on the three arguments only (splitmix64 on their mixture)."""
    x = (
        np.uint64(seed)
        + np.uint64(start) * np.uint64(0xD1342543DE82EF95)
        + np.uint64(j + 1) * np.uint64(0xDA942042E4DD58B5)
    )
    for _ in range(2):
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        x = x ^ (x >> np.uint64(31))
    return float(x >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@kernel(borrow=True)
def load_start(chain, guesses, table, order, seed, target, start, q, l):
    """Start number *start* of *target* into lane *l* of ``q``."""
    k = chain.lower.shape[0]
    given = 1 if guesses.shape[0] else 0
    if start < given:
        for c in range(k):
            q[c * L + l] = min(max(guesses[target, c], chain.lower[c]), chain.upper[c])
    elif start < given + order.shape[1]:
        row = order[target, start - given]
        for c in range(k):
            q[c * L + l] = table[row, c]
    else:
        for c in range(k):
            low = chain.low[c]
            q[c * L + l] = low + (chain.high[c] - low) * uniform(seed, start, c)


@kernel(borrow=True)
def load_target(targets, target, w, l):
    """Rotation and position of *target* into lane *l*."""
    for i in range(12):
        w[TARGET + i * L + l] = targets[target, i]


@kernel(borrow=True)
def is_new(chain, q, l, found, count, distinct):
    """Whether lane *l* differs from all solutions found so far by more than *distinct* in some coordinate."""
    for s in range(count):
        far = False
        for c in range(chain.lower.shape[0]):
            d = q[c * L + l] - found[s, c]
            if not math.isfinite(chain.upper[c]):
                d -= TURN * math.floor(d / TURN + 0.5)
            if abs(d) > distinct:
                far = True
        if not far:
            return False
    return True


@kernel(borrow=True)
def evaluate(chain, q, axes, w, tolerance, partial, free_axis):
    """Pose, error and flags of all lanes."""
    forward(chain, q, axes, w)
    if partial:  # stalling is judged by the error in the box: the whole pose's must not move the mark
        for l in range(L):
            w[SIN + l] = w[PAST + l]
    pose_error(w, tolerance[0], tolerance[3])
    if partial:
        for l in range(L):
            w[PAST + l] = w[SIN + l]
        box_error(w, chain.tool, tolerance, free_axis)


@kernel(borrow=True)
def newton(chain, q, axes, w, J, step, partial):
    """One step of all lanes."""
    k = chain.lower.shape[0]
    if chain.kind.shape[0] == k:
        columns(chain.kind, chain.gain, chain.column, axes, w, J)
    else:
        add_columns(chain, axes, w, J)
    if partial:
        turn_columns(w, chain.tool, J, k)
    hold_limits(chain, q, w, J)
    gram(w, J, k)
    solve_dual(w)
    advance(chain, q, w, J, step)


@kernel(borrow=True)
def rest_lane(w, l):
    """A lane without work: its target is the identity, its error is never looked at."""
    for i in range(12):
        w[TARGET + i * L + l] = 1.0 if i % 4 == 0 and i < 9 else 0.0
    w[AGE + l] = -1e15
    w[PAST + l] = 1e300


@kernel(borrow=True)
def fresh_lane(w, l):
    """A lane that has just taken a start: no step in this round, its error belongs to the old one."""
    w[AGE + l] = 0.0
    w[PAST + l] = 1e300
    for r in range(6):
        w[ERR + r * L + l] = 0.0


@kernel
def solve_queue(
    chain, targets, first, last, guesses, table, order, seed, starts, tolerance, partial, free_axis, distinct, out,
    count, used,
):  # fmt: skip
    """Solve ``targets[first:last] (N, 12)``; each lane works on a target of its own until it is finished.

    ``out (N, s, k)`` takes up to s distinct solutions, ``count (N)`` how many, ``used (N)`` the starts taken.
    """
    k = chain.lower.shape[0]
    wanted = out.shape[1]
    q = np.zeros(k * L)
    axes = np.zeros(6 * chain.kind.shape[0] * L)
    J = np.zeros(6 * k * L)
    step = np.zeros(k * L)
    w = np.zeros(WORK)
    owner = np.full(L, -1)
    number = np.zeros(L, np.int64)
    following = first
    working = 0
    for l in range(L):
        rest_lane(w, l)
        if following < last:
            owner[l] = following
            following += 1
            working += 1
            load_target(targets, owner[l], w, l)
            load_start(chain, guesses, table, order, seed, owner[l], 0, q, l)
            fresh_lane(w, l)
    while working > 0:
        evaluate(chain, q, axes, w, tolerance, partial, free_axis)
        events = 0.0
        for l in range(L):
            events += w[FLAG + l]
        if events > 0.0:
            for l in range(L):
                t = owner[l]
                if w[FLAG + l] == 0.0 or t < 0:
                    continue
                if w[FLAG + l] == 1.0 and is_new(chain, q, l, out[t], count[t], distinct):
                    for c in range(k):
                        out[t, count[t], c] = q[c * L + l]
                    count[t] += 1
                number[l] += 1
                if count[t] >= wanted or number[l] >= starts:
                    used[t] = number[l]
                    number[l] = 0
                    if following < last:
                        owner[l] = following
                        following += 1
                        load_target(targets, owner[l], w, l)
                    else:
                        owner[l] = -1
                        working -= 1
                        rest_lane(w, l)
                        continue
                load_start(chain, guesses, table, order, seed, owner[l], number[l], q, l)
                fresh_lane(w, l)
        newton(chain, q, axes, w, J, step, partial)


@kernel
def solve_wide(
    chain, targets, first, last, guesses, table, order, seed, starts, tolerance, partial, free_axis, distinct, out,
    count, used,
):  # fmt: skip
    """As `solve_queue`, but all lanes work on one target after the other, each on a start of its own: for few targets."""
    k = chain.lower.shape[0]
    wanted = out.shape[1]
    q = np.zeros(k * L)
    axes = np.zeros(6 * chain.kind.shape[0] * L)
    J = np.zeros(6 * k * L)
    step = np.zeros(k * L)
    w = np.zeros(WORK)
    number = np.zeros(L, np.int64)
    state = np.zeros(starts, np.int64)  # of each start: 0 open, 1 given up, 2 solved
    solved = np.zeros((starts, k))
    one = np.zeros(k * L)
    for t in range(first, last):
        state[:] = 0
        following = 0
        settled = 0
        for l in range(L):
            rest_lane(w, l)
            number[l] = -1
            if following < starts:
                number[l] = following
                following += 1
                load_target(targets, t, w, l)
                load_start(chain, guesses, table, order, seed, t, number[l], q, l)
                fresh_lane(w, l)
        while settled < starts and count[t] < wanted:
            evaluate(chain, q, axes, w, tolerance, partial, free_axis)
            for l in range(L):
                if w[FLAG + l] == 0.0 or number[l] < 0:
                    continue
                state[number[l]] = 2 if w[FLAG + l] == 1.0 else 1
                for c in range(k):
                    solved[number[l], c] = q[c * L + l]
                if following < starts:
                    number[l] = following
                    following += 1
                    load_start(chain, guesses, table, order, seed, t, number[l], q, l)
                    fresh_lane(w, l)
                else:
                    number[l] = -1
                    rest_lane(w, l)
            while settled < starts and state[settled] != 0 and count[t] < wanted:
                if state[settled] == 2:
                    for c in range(k):
                        one[c * L] = solved[settled, c]
                    if is_new(chain, one, 0, out[t], count[t], distinct):
                        for c in range(k):
                            out[t, count[t], c] = solved[settled, c]
                        count[t] += 1
                settled += 1
            newton(chain, q, axes, w, J, step, partial)
        used[t] = settled
