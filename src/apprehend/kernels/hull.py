"""The largest ball in a convex set of wrenches, from support points only: a growing polytope in up to 6 dimensions.

A simplicial polytope inside the set grows where its nearest facet is: the support point along that facet's normal
either shows that the facet lies on the boundary, or becomes a new corner (the expanding polytope algorithm of van den
Bergen 2001, in any dimension). The distance of the nearest facet is a lower bound of the radius at every step, the
support value along its normal an upper bound. The plane of a new facet is the combination of the two planes that meet
at its ridge, so that it costs a few operations, not a linear system; the last one is computed afresh.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .hull_support import BASES, BOX, CAP_SUM, CAP_UNION, POINTS, SAME, SUM, UNION, first_simplex, support

__all__ = [
    "BASES", "BOX", "CAP_SUM", "CAP_UNION", "CLOSED", "FLAT", "FULL", "OUTSIDE", "POINTS", "SAME", "SUM", "UNION", "grow",
    "separate", "support",
]  # fmt: skip

CLOSED, FLAT, OUTSIDE, FULL = 0, 1, 2, 3
"""Outcomes: interval found; the set does not span the space; the origin is not inside; no room or no steps left."""


@kernel
def _plane(points, corners, facet, inside, normal, rows):  # type: ignore[no-untyped-def]
    """Unit normal and offset of the hyperplane through a facet's corners, turned away from *inside*.

    Elimination with full pivoting on the ``d − 1`` edge vectors; False if the facet is degenerate.
    """
    d = normal.shape[0]
    order = np.arange(d)
    for i in range(1, d):
        for j in range(d):
            rows[i - 1, j] = points[corners[facet, i], j] - points[corners[facet, 0], j]
    for i in range(d - 1):
        pi, pj, pivot = i, i, 0.0
        for a in range(i, d - 1):
            for b in range(i, d):
                if abs(rows[a, b]) > pivot:
                    pi, pj, pivot = a, b, abs(rows[a, b])
        if pivot < 1e-14:
            return False, 0.0
        for b in range(d):
            rows[i, b], rows[pi, b] = rows[pi, b], rows[i, b]
        for a in range(d - 1):
            rows[a, i], rows[a, pj] = rows[a, pj], rows[a, i]
        order[i], order[pj] = order[pj], order[i]
        for a in range(i + 1, d - 1):
            f = rows[a, i] / rows[i, i]
            for b in range(i, d):
                rows[a, b] -= f * rows[i, b]
    normal[order[d - 1]] = 1.0
    for i in range(d - 2, -1, -1):
        t = rows[i, d - 1]
        for b in range(i + 1, d - 1):
            t += rows[i, b] * normal[order[b]]
        normal[order[i]] = -t / rows[i, i]
    length, offset, side = 0.0, 0.0, 0.0
    for j in range(d):
        length += normal[j] * normal[j]
    length = np.sqrt(length)
    for j in range(d):
        normal[j] /= length
        offset += normal[j] * points[corners[facet, 0], j]
        side += normal[j] * inside[j]
    if side > offset:
        for j in range(d):
            normal[j] = -normal[j]
        offset = -offset
    return True, offset


class Polytope(NamedTuple):
    """A simplicial polytope in d dimensions, with room for F facets, and what its growth needs.

    ``points (P, d)``; ``corners, near (F, d)``: a facet's corners, and its neighbours across the ridge without that
    corner; ``planes (F, d + 1)``: unit normal and offset; ``alive (F,)``: 1 in use, 2 in use and known to lie on the
    boundary, 0 free; ``codes (P,)`` random int64 that name ridges; ``inside (d,)`` a point inside. ``numbers``: facet
    slots used so far, points, free slots on the stack *free*, the newest facet. The rest is scratch: *seen* and
    *height* of the newest corner over each facet, and a hash table of ridges.
    """

    points: np.ndarray
    corners: np.ndarray
    near: np.ndarray
    planes: np.ndarray
    alive: np.ndarray
    codes: np.ndarray
    inside: np.ndarray
    numbers: np.ndarray
    free: np.ndarray
    seen: np.ndarray
    stack: np.ndarray
    visible: np.ndarray
    height: np.ndarray
    key: np.ndarray
    owner: np.ndarray
    stamp: np.ndarray
    rows: np.ndarray


@kernel(inline=True)
def _polytope(points, corners, near, planes, alive, codes):  # type: ignore[no-untyped-def]
    room, d = corners.shape
    slots = 1
    while slots < 4 * room:
        slots *= 2
    whole = np.int64
    return Polytope(
        points, corners, near, planes, alive, codes, np.zeros(d), np.zeros(4, whole), np.empty(room, whole),
        np.zeros(room, whole), np.empty(room, whole), np.empty(room, whole), np.empty(room), np.empty(slots, whole),
        np.empty(slots, whole), np.zeros(slots, whole), np.empty((d, d)),
    )  # fmt: skip


@kernel
def _start(hull, normal):  # type: ignore[no-untyped-def]
    """The simplex of the first d + 1 points; False if it is flat. Facet f lacks corner f; its neighbour across the
    ridge without corner i is facet i."""
    d = hull.inside.shape[0]
    for i in range(d + 1):
        for j in range(d):
            hull.inside[j] += hull.points[i, j] / (d + 1.0)
    for f in range(d + 1):
        k = 0
        for i in range(d + 1):
            if i != f:
                hull.corners[f, k], hull.near[f, k] = i, i
                k += 1
        good, offset = _plane(hull.points, hull.corners, f, hull.inside, normal, hull.rows)
        if not good:
            return False
        for j in range(d):
            hull.planes[f, j] = normal[j]
        hull.planes[f, d] = offset
        hull.alive[f] = 1
    hull.numbers[0], hull.numbers[1] = d + 1, d + 1
    return True


@kernel(inline=True)
def _nearest(hull, whole):  # type: ignore[no-untyped-def]
    """The facet in use that is nearest to the origin (not known to be on the boundary if *whole*), and its offset."""
    d = hull.inside.shape[0]
    nearest, lower = -1, np.inf
    for f in range(hull.numbers[0]):
        if hull.alive[f] == 1 or (hull.alive[f] == 2 and not whole):
            if hull.planes[f, d] < lower:
                nearest, lower = f, hull.planes[f, d]
    return nearest, lower


@kernel(inline=True)
def _look(hull, p, nearest, height, step, rounding):  # type: ignore[no-untyped-def]
    """Mark the facets that the new corner *p* sees, from the nearest one on; their number and that of ridges around."""
    d = p.shape[0]
    seen, stack = hull.seen, hull.stack
    top, count, horizon = 1, 0, 0
    stack[0] = nearest
    seen[nearest] = 2 * step + 1
    hull.height[nearest] = height
    while top:
        top -= 1
        f = stack[top]
        hull.visible[count] = f
        count += 1
        for i in range(d):
            g = hull.near[f, i]
            if seen[g] < 2 * step:
                t = -hull.planes[g, d]
                for j in range(d):
                    t += hull.planes[g, j] * p[j]
                hull.height[g] = t
                seen[g] = 2 * step + (1 if t > rounding else 0)
                if t > rounding:
                    stack[top] = g
                    top += 1
            if seen[g] == 2 * step:
                horizon += 1
    return count, horizon


@kernel(inline=True)
def _join(hull, new, f, i, ridge, step):  # type: ignore[no-untyped-def]
    """Link the facet *new*, made from facet *f* and its neighbour *i*, with those that share its other ridges."""
    d = hull.inside.shape[0]
    key, owner, stamp = hull.key, hull.owner, hull.stamp
    last = key.shape[0] - 1
    for j in range(d):
        if j == i:
            continue
        k = ridge - hull.codes[hull.corners[f, j]]
        slot = (k ^ (k >> 29)) & last
        while stamp[slot] == step and key[slot] != k:
            slot = (slot + 1) & last
        if stamp[slot] == step:
            other = owner[slot] // d
            hull.near[new, j] = other
            hull.near[other, owner[slot] % d] = new
        else:
            stamp[slot], key[slot], owner[slot] = step, k, new * d + j


@kernel(inline=True)
def _replace(hull, corner, count, step):  # type: ignore[no-untyped-def]
    """Put facets from the ridges around the *count* visible ones to the new *corner* in their place; False if none."""
    d = hull.inside.shape[0]
    planes, near, corners, height, numbers = hull.planes, hull.near, hull.corners, hull.height, hull.numbers
    made = False
    for v in range(count):
        f = hull.visible[v]
        total = 0
        for i in range(d):
            total += hull.codes[corners[f, i]]
        for i in range(d):
            g = near[f, i]
            if hull.seen[g] != 2 * step:
                continue
            if numbers[2]:
                numbers[2] -= 1
                new = hull.free[numbers[2]]
            else:
                new = numbers[0]
                numbers[0] += 1
            made = True
            hull.seen[new] = 0
            hull.alive[new] = 1
            hf, hg = height[f], height[g]
            length = 0.0
            for j in range(d):
                t = hf * planes[g, j] - hg * planes[f, j]
                planes[new, j] = t
                length += t * t
            length = np.sqrt(length)
            planes[new, d] = (hf * planes[g, d] - hg * planes[f, d]) / length
            for j in range(d):
                planes[new, j] /= length
                corners[new, j] = corners[f, j]
            corners[new, i] = corner
            near[new, i] = g
            for j in range(d):
                if near[g, j] == f:
                    near[g, j] = new
                    break
            _join(hull, new, f, i, total - hull.codes[corners[f, i]], step)
    for v in range(count):
        hull.alive[hull.visible[v]] = 0
        hull.free[numbers[2]] = hull.visible[v]
        numbers[2] += 1
    return made


@kernel
def _measure(hull, answer, worst, normal):  # type: ignore[no-untyped-def]
    """Radius, volume and mean facet distance of the finished hull."""
    d = worst.shape[0]
    lower, volume, mean, facets = np.inf, 0.0, 0.0, 0
    for f in range(hull.numbers[0]):
        if hull.alive[f] == 0:
            continue
        good, offset = _plane(hull.points, hull.corners, f, hull.inside, normal, hull.rows)
        if not good:
            continue
        facets += 1
        mean += offset
        if offset < lower:
            lower = offset
            for j in range(d):
                worst[j] = normal[j]
        for i in range(d):
            for j in range(d):
                hull.rows[i, j] = hull.points[hull.corners[f, i], j]
        volume += (1.0 if offset > 0.0 else -1.0) * abs(_determinant(hull.rows, d))
    for j in range(2, d + 1):
        volume /= j
    answer[0], answer[1], answer[2], answer[3], answer[4] = lower, lower, facets, volume, mean / max(facets, 1)


@kernel
def grow(
    kind,
    base,
    spread,
    flags,
    shift,
    tolerance,
    whole,
    steps,
    points,
    corners,
    near,
    planes,
    alive,
    codes,
    answer,
    worst,
):  # type: ignore[no-untyped-def]
    """Radius of the largest ball about the origin in the set, between two bounds.

    Work arrays as in `Polytope`: ``points (P, d)``, ``corners, near (F, d)``, ``planes (F, d + 1)``, ``alive (F,)``,
    ``codes (P,)``. *tolerance*: wanted ``upper − lower`` relative to upper. *whole*: complete the hull (of points).
    *answer* ``(6,)``: lower, upper, number of facets in use, volume and mean facet distance (*whole* only), steps.
    *worst* ``(d,)``: unit direction that attains upper.
    """
    room, d = corners.shape
    size = 0.0
    for i in range(base.shape[0]):
        t = 0.0
        for j in range(d):
            t += base[i, j] * base[i, j]
        size = max(size, np.sqrt(t))
    rounding = 1e-12 * size
    answer[:] = 0.0
    worst[:] = 0.0
    if not first_simplex(kind, base, spread, flags, shift, d, points, 1e-9 * size):
        return FLAT
    u, p = np.empty(d), np.empty(d)
    hull = _polytope(points, corners, near, planes, alive, codes)
    if not _start(hull, u):
        return FLAT
    numbers = hull.numbers
    upper, lower = np.inf, 0.0
    for step in range(1, steps + 1):
        answer[5] = step
        nearest, lower = _nearest(hull, whole)
        if nearest < 0:
            break
        for j in range(d):
            u[j] = planes[nearest, j]
        value = support(kind, base, spread, flags, shift, u, p)
        if value < upper:
            upper = value
            for j in range(d):
                worst[j] = u[j]
        if value <= rounding and not whole:
            answer[0], answer[1] = min(lower, value), value
            return OUTSIDE
        if value - lower <= rounding * 10.0 or (not whole and upper - lower <= tolerance * upper):
            if not whole:
                good, offset = _plane(points, corners, nearest, hull.inside, u, hull.rows)
                if good and kind == POINTS:
                    lower = offset
                    upper = support(kind, base, spread, flags, shift, u, p)
                    for j in range(d):
                        worst[j] = u[j]
                answer[0], answer[1], answer[2] = lower, max(upper, lower), numbers[0] - numbers[2]
                return CLOSED
            alive[nearest] = 2
            continue
        corner = numbers[1]
        if corner >= points.shape[0]:
            break
        for j in range(d):
            points[corner, j] = p[j]
        numbers[1] += 1
        count, horizon = _look(hull, p, nearest, value - lower, step, rounding)
        if numbers[0] - numbers[2] + horizon > room or not _replace(hull, corner, count, step):
            nearest = 0
            break
    answer[0], answer[1], answer[2] = lower, upper, numbers[0] - numbers[2]
    if not whole or nearest >= 0:
        return FULL
    _measure(hull, answer, worst, u)
    return CLOSED


@kernel
def separate(base, spread, flags, points, corners, near, planes, alive, codes, verdict, worst):  # type: ignore[no-untyped-def]
    """Directions along which no contact can push: ``base (N, k, d)``, ``spread (N, k, 3, d)``, ``flags (N, k)``.

    *verdict* ``(N,)``: OUTSIDE where the cone bases reach at most 2e-9 of their size along *worst* ``(N, d)``; else an
    outcome of `grow`.
    """
    answer, shift = np.empty(6), np.zeros(base.shape[2])
    for n in range(base.shape[0]):
        size = 0.0
        for i in range(base.shape[1]):
            t = 0.0
            for j in range(base.shape[2]):
                t += base[n, i, j] * base[n, i, j]
            size = max(size, np.sqrt(t))
        verdict[n] = grow(
            BASES, base[n], spread[n], flags[n], shift, 0.5, False, 200, points, corners, near, planes, alive, codes,
            answer, worst[n],
        )  # fmt: skip
        if verdict[n] != FLAT and answer[1] <= 2e-9 * size:
            verdict[n] = OUTSIDE


@kernel
def _determinant(rows, d):  # type: ignore[no-untyped-def]
    value = 1.0
    for i in range(d):
        pivot = i
        for a in range(i + 1, d):
            if abs(rows[a, i]) > abs(rows[pivot, i]):
                pivot = a
        if rows[pivot, i] == 0.0:
            return 0.0
        if pivot != i:
            for b in range(d):
                rows[i, b], rows[pivot, b] = rows[pivot, b], rows[i, b]
            value = -value
        value *= rows[i, i]
        for a in range(i + 1, d):
            f = rows[a, i] / rows[i, i]
            for b in range(i, d):
                rows[a, b] -= f * rows[i, b]
    return value
