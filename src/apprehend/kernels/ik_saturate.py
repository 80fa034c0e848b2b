"""Bounds of one level on lanes: a dual active-set method in the space of the coordinates, pivoted by the sweep operator.

The level minimises ‖A z − r‖² + λ²‖z‖² over z with low ≤ dq + N z ≤ high. With H = AᵀA + λ² 1 = L Lᵀ, G = L⁻¹ Nᵀ and
M = GᵀG, the optimum is y = y₀ − M µ, where y₀ is the one without bounds and µ holds a multiplier for every coordinate:
positive at its upper bound, negative at its lower one, zero between. That is a linear complementarity problem with a
matrix of n × n, so all lanes can work on theirs at once: every round takes one coordinate of each lane into the set W of
those at a bound, or lets one go (Goldfarb and Idnani 1983), and sweeps T on it, which holds
−M_WW⁻¹, M_WW⁻¹ M_WF and M_FF − M_FW M_WW⁻¹ M_WF. What differs between lanes is chosen by masks.

The digits that the factor 1/λ² in M costs are won back at the end: u = H⁻¹Nᵀµ gets the smallest correction that brings
what is held to its bounds. So y = dq + N (z − u) leaves all levels above as they are and meets the bounds, both to the
last digits; a lane of which that cannot be said is reported.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .lanes import LANES
from .vector import larger, load, select, some, splat, store

L = LANES
MET = 1e-11  # a bound that is passed by less is met
NEARLY = 1e-7  # a bound that depends on those held, and is passed by less, is left to the correction at the end
CLOSE = 1e-11  # after which no bound is passed by more; the rest is cut off
DISTINCT = 1e-8  # share of a unit row of N that must be left for a coordinate to be corrected by itself
DEPENDENT = 1e-12  # share of a diagonal entry of M that must be left for its coordinate to be held as well


class SaturateWork(NamedTuple):
    """Scratch memory for `saturate` with n coordinates."""

    G: np.ndarray  # (n, n, L)
    T: np.ndarray  # (n (n + 1) / 2, L) lower triangle
    own: np.ndarray  # (n, L) diagonal of M
    mu: np.ndarray  # (n, L)
    held: np.ndarray  # (n, L) 0 between the bounds, 1 at the upper, −1 at the lower
    column: np.ndarray  # (n, L)
    scaled: np.ndarray  # (n, L)
    move: np.ndarray  # (n, L)


@kernel
def saturate_work(n):
    """Scratch memory for `saturate`."""
    v = n * L
    return SaturateWork(
        np.empty(n * v), np.empty((n + 1) * v // 2 + L), np.empty(v), np.empty(v), np.empty(v), np.empty(v), np.empty(v),
        np.empty(v),
    )  # fmt: skip


@kernel
def compliance(H, N, n, width, work):
    """``G = L⁻¹ Nᵀ`` and ``T = M = GᵀG`` from the factor of `normal_equations`."""
    G, T = work.G, work.T
    t = 0
    for i in range(n):
        for c in range(width):
            g = load(N, (i * n + c) * L)
            for k in range(c):
                g = g - load(H, (c * n + k) * L) * load(G, (i * n + k) * L)
            store(G, (i * n + c) * L, g * load(H, (c * n + c) * L))
        for j in range(i + 1):
            s = splat(0.0)
            for c in range(width):
                s = s + load(G, (i * n + c) * L) * load(G, (j * n + c) * L)
            store(T, t * L, s)
            t += 1
            if i == j:
                store(work.own, i * L, s)


@kernel
def column_of(T, index, n, column):
    """``column (n, L)`` of T, another one on every lane; zero where *index* is negative."""
    for i in range(n):
        store(column, i * L, splat(0.0))
    index = load(index, 0)
    t = 0
    for i in range(n):
        here = index == float(i)
        mine = splat(0.0)
        for j in range(i):
            x = load(T, t * L)
            t += 1
            mine = select(index == float(j), x, mine)
            store(column, j * L, select(here, x, load(column, j * L)))
        store(column, i * L, select(here, load(T, t * L), mine))
        t += 1


@kernel
def sweep(T, choice, n, column, scaled):
    """Sweep T on coordinate ``choice[:L]`` of every lane, back where ``choice[L:]`` is −1; negative: not at all."""
    index, sign = load(choice, 0), load(choice, L)
    pivot = splat(1.0)
    for i in range(n):
        pivot = select(index == float(i), load(column, i * L), pivot)
    pivot = 1.0 / pivot
    signed = sign * pivot
    for i in range(n):
        s = select(index == float(i), -pivot, load(column, i * L) * signed)
        store(scaled, i * L, s)
    t = 0
    for i in range(n):
        here = index == float(i)
        x = load(column, i * L) * pivot
        f = load(scaled, i * L)
        for j in range(i + 1):
            v = load(T, t * L) - x * load(column, j * L)
            v = select(index == float(j), f, v)
            store(T, t * L, select(here, load(scaled, j * L), v))
            t += 1


@kernel
def rounds(y, low, high, n, work, irregular):
    """Dual active-set rounds on all lanes until no bound is passed; updates y, µ and *held*."""
    mu, held, column = work.mu, work.held, work.column
    choice = np.empty(2 * L)
    entering, side = splat(-1.0), splat(0.0)
    for _ in range(6 * n + 6):
        # the coordinate that is farthest beyond its bounds, on lanes that are not in the midst of one
        most = select(entering < 0.0, MET, math.inf)
        for i in range(n):
            v = load(y, i * L)
            over, under = v - load(high, i * L), load(low, i * L) - v
            far = larger(over, under)
            more = (far > most) & (load(held, i * L) == 0.0)
            most = select(more, far, most)
            entering = select(more, float(i), entering)
            side = select(more, select(over > under, 1.0, -1.0), side)
        entering = select(load(irregular, 0) == 0.0, entering, -1.0)
        on = entering >= 0.0
        if not some(on):
            return
        store(choice, 0, entering)
        column_of(work.T, choice, n, column)
        # how far until it is at its bound, or until a multiplier vanishes
        diagonal, whole, excess = splat(0.0), splat(0.0), splat(0.0)
        partial, leaving = splat(math.inf), splat(-1.0)
        for i in range(n):
            here = entering == float(i)
            c, h = load(column, i * L), load(held, i * L)
            bound = select(side > 0.0, load(high, i * L), load(low, i * L))
            diagonal = select(here, c, diagonal)
            whole = select(here, load(work.own, i * L), whole)
            excess = select(here, side * (load(y, i * L) - bound), excess)
            rate = h * side * c
            falls = rate > 1e-12
            t = larger(h * load(mu, i * L), 0.0) / select(falls, rate, 1.0)
            sooner = falls & (t < partial)
            partial = select(sooner, t, partial)
            leaving = select(sooner, float(i), leaving)
        free = diagonal > DEPENDENT * whole
        full = select(free, larger(excess, 0.0) / select(free, diagonal, 1.0), math.inf)
        takes = full <= partial
        stuck = on & ~free & (leaving < 0.0)
        store(irregular, 0, select(stuck & (excess > NEARLY), 1.0, load(irregular, 0)))
        moves = on & ~stuck
        amount = select(moves, side * select(takes, full, partial), 0.0)
        index = select(moves, select(takes, entering, leaving), -1.0)
        for i in range(n):
            here = entering == float(i)
            c, h, v = load(column, i * L), load(held, i * L), load(y, i * L)
            fixed = h != 0.0
            v = select(fixed, v, v - amount * c)
            bound = select(side > 0.0, load(high, i * L), load(low, i * L))
            store(y, i * L, select(here & stuck, bound, v))  # what little is left over is cut off
            m = load(mu, i * L)
            m = select(fixed, m - amount * c, m)
            m = select(here, m + amount, m)
            mine = index == float(i)
            store(mu, i * L, select(mine & ~takes, 0.0, m))
            store(held, i * L, select(mine, select(takes, side, 0.0), h))
        store(choice, 0, index)
        store(choice, L, select(takes, 1.0, -1.0))
        column_of(work.T, choice, n, column)
        sweep(work.T, choice, n, column, work.scaled)
        entering = select(takes | stuck, -1.0, entering)
    store(irregular, 0, select(entering >= 0.0, 1.0, load(irregular, 0)))


@kernel
def combination(H, n, width, work):
    """``u = H⁻¹ Nᵀ µ`` into *move*."""
    G, mu, u = work.G, work.mu, work.move
    for c in range(width):
        s = splat(0.0)
        for i in range(n):
            s = s + load(G, (i * n + c) * L) * load(mu, i * L)
        store(u, c * L, s)
    for c in range(width - 1, -1, -1):
        s = load(u, c * L)
        for k in range(c + 1, width):
            s = s - load(H, (k * n + c) * L) * load(u, k * L)
        store(u, c * L, s * load(H, (c * n + c) * L))


@kernel
def place(dq, N, z, n, width, y, work):
    """``y = dq + N (z − u)``."""
    for i in range(n):
        s = load(dq, i * L)
        for c in range(width):
            s = s + load(N, (i * n + c) * L) * (load(z, c * L) - load(work.move, c * L))
        store(y, i * L, s)


@kernel
def meet_bounds(y, low, high, N, n, width, work):
    """Correct u so that what is held is at its bound to the last digit: the smallest correction within N.

    µ holds what is missing, and then (N_W N_Wᵀ)⁻¹ times it, by sweeps of N Nᵀ on the held coordinates.
    """
    T, held, column, miss = work.T, work.held, work.column, work.mu
    t = 0
    for i in range(n):
        h, v = load(held, i * L), load(y, i * L)
        bound = select(h > 0.0, load(high, i * L), load(low, i * L))
        store(miss, i * L, select(h != 0.0, v - bound, 0.0))
        for j in range(i + 1):
            s = splat(0.0)
            for c in range(width):
                s = s + load(N, (i * n + c) * L) * load(N, (j * n + c) * L)
            store(T, t * L, s)
            t += 1
    for k in range(n):
        d = load(T, (k * (k + 1) // 2 + k) * L)
        on = (load(held, k * L) != 0.0) & (d > DISTINCT)
        store(held, k * L, select(on, 1.0, 0.0))
        pivot = select(on, 1.0 / select(on, d, 1.0), 0.0)
        for i in range(n):
            store(column, i * L, load(T, (i * (i + 1) // 2 + k if i > k else k * (k + 1) // 2 + i) * L))
        t = 0
        for i in range(n):
            x = load(column, i * L) * pivot
            for j in range(i + 1):
                v = load(T, t * L)
                if i == k and j == k:
                    v = select(on, -pivot, v)
                elif i == k or j == k:
                    v = select(on, v * pivot, v)
                else:
                    v = v - x * load(column, j * L)
                store(T, t * L, v)
                t += 1
    for i in range(n):
        s = splat(0.0)
        for j in range(n):
            v = load(T, (i * (i + 1) // 2 + j if i > j else j * (j + 1) // 2 + i) * L)
            s = s - v * select(load(held, j * L) != 0.0, load(miss, j * L), 0.0)
        store(column, i * L, select(load(held, i * L) != 0.0, s, 0.0))
    for c in range(width):
        s = load(work.move, c * L)
        for i in range(n):
            s = s + load(N, (i * n + c) * L) * load(column, i * L)
        store(work.move, c * L, s)


@kernel
def saturate(dq, low, high, N, H, z, n, width, y, work, irregular):
    """From the optimum without bounds ``y = dq + N z`` to the one within them, on all lanes that are not *irregular*."""
    compliance(H, N, n, width, work)
    work.mu[:] = 0.0
    work.held[:] = 0.0
    rounds(y, low, high, n, work, irregular)
    combination(H, n, width, work)
    place(dq, N, z, n, width, y, work)
    meet_bounds(y, low, high, N, n, width, work)
    place(dq, N, z, n, width, y, work)
    bad = load(irregular, 0)
    for i in range(n):
        v = load(y, i * L)
        over = larger(v - load(high, i * L), load(low, i * L) - v)
        bad = select(over <= CLOSE, bad, 1.0)
    store(irregular, 0, bad)
