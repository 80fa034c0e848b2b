"""The largest ball in a convex set of wrenches, from support points only: a growing polytope in up to 6 dimensions.

A simplicial polytope inside the set grows where its nearest facet is: the support point along that facet's normal
either shows that the facet lies on the boundary, or becomes a new corner (the expanding polytope algorithm of van den
Bergen 2001, in any dimension). The distance of the nearest facet is a lower bound of the radius at every step, the
support value along its normal an upper bound. The plane of a new facet is the combination of the two planes that meet
at its ridge, so that it costs a few operations, not a linear system; the last one is computed afresh.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .hull_support import BASES, POINTS, SUM, UNION, first_simplex, support

__all__ = ["BASES", "CLOSED", "FLAT", "FULL", "OUTSIDE", "POINTS", "SUM", "UNION", "closed", "grow", "support"]

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


@kernel
def grow(
    kind, base, spread, box, shift, tolerance, whole, steps, points, corners, near, planes, alive, codes, answer, worst
):  # type: ignore[no-untyped-def]
    """Radius of the largest ball about the origin in the set, between two bounds.

    Work arrays: ``points (P, d)``, ``corners, near (F, d)`` (int64), ``planes (F, d + 1)``, ``alive (F,)`` (int64),
    ``codes (P,)`` (random int64). *tolerance*: wanted ``upper − lower`` relative to upper. *whole*: complete the hull
    (of points). *answer* ``(6,)``: lower, upper, number of facets in use, volume and mean facet distance (*whole*
    only), steps. *worst* ``(d,)``: unit direction that attains upper.
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
    if not first_simplex(kind, base, spread, box, shift, d, points, 1e-9 * size):
        return FLAT
    inside, u, p = np.zeros(d), np.empty(d), np.empty(d)
    rows = np.empty((d, d))
    for i in range(d + 1):
        for j in range(d):
            inside[j] += points[i, j] / (d + 1.0)
    for f in range(d + 1):  # facet f lacks corner f; its neighbour across the ridge without corner i is facet i
        k = 0
        for i in range(d + 1):
            if i != f:
                corners[f, k], near[f, k] = i, i
                k += 1
        good, offset = _plane(points, corners, f, inside, u, rows)
        if not good:
            return FLAT
        for j in range(d):
            planes[f, j] = u[j]
        planes[f, d] = offset
        alive[f] = 1  # 1: in use, 2: in use and known to be on the boundary, 0: free
    used, count = d + 1, d + 1
    free = np.empty(room, np.int64)
    spare = 0
    seen = np.zeros(room, np.int64)
    stack, visible = np.empty(room, np.int64), np.empty(room, np.int64)
    height = np.empty(room)
    slots = 1
    while slots < 4 * room:
        slots *= 2
    key, owner, stamp = np.empty(slots, np.int64), np.empty(slots, np.int64), np.zeros(slots, np.int64)
    upper = np.inf
    for step in range(1, steps + 1):
        answer[5] = step
        nearest, lower = -1, np.inf
        for f in range(used):
            if alive[f] == 1 or (alive[f] == 2 and not whole):
                if planes[f, d] < lower:
                    nearest, lower = f, planes[f, d]
        if nearest < 0:
            break
        for j in range(d):
            u[j] = planes[nearest, j]
        value = support(kind, base, spread, box, shift, u, p)
        if value < upper:
            upper = value
            for j in range(d):
                worst[j] = u[j]
        if value <= rounding and not whole:
            answer[0], answer[1] = min(lower, value), value
            return OUTSIDE
        if value - lower <= rounding * 10.0 or (not whole and upper - lower <= tolerance * upper):
            if not whole:
                good, offset = _plane(points, corners, nearest, inside, u, rows)
                if good and kind == POINTS:
                    lower = offset
                    upper = support(kind, base, spread, box, shift, u, p)
                    for j in range(d):
                        worst[j] = u[j]
                answer[0], answer[1], answer[2] = lower, max(upper, lower), used - spare
                return CLOSED
            alive[nearest] = 2
            continue
        if count >= points.shape[0]:
            answer[0], answer[1], answer[2] = lower, upper, used - spare
            return FULL
        corner = count
        for j in range(d):
            points[corner, j] = p[j]
        count += 1
        # facets that the new corner sees, from the nearest one on
        top, seen_count = 1, 0
        stack[0] = nearest
        seen[nearest] = 2 * step + 1
        height[nearest] = value - lower
        first_new = -1
        horizon = 0
        while top:
            top -= 1
            f = stack[top]
            visible[seen_count] = f
            seen_count += 1
            for i in range(d):
                g = near[f, i]
                if seen[g] < 2 * step:
                    t = -planes[g, d]
                    for j in range(d):
                        t += planes[g, j] * p[j]
                    height[g] = t
                    seen[g] = 2 * step + (1 if t > rounding else 0)
                    if t > rounding:
                        stack[top] = g
                        top += 1
                if seen[g] == 2 * step:
                    horizon += 1
        if used - spare + horizon > room:
            answer[0], answer[1], answer[2] = lower, upper, used - spare
            return FULL
        for v in range(seen_count):
            f = visible[v]
            total = 0
            for i in range(d):
                total += codes[corners[f, i]]
            for i in range(d):
                g = near[f, i]
                if seen[g] != 2 * step:
                    continue
                if spare:
                    spare -= 1
                    new = free[spare]
                else:
                    new = used
                    used += 1
                first_new = new
                seen[new] = 0
                alive[new] = 1
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
                ridge = total - codes[corners[f, i]]
                for j in range(d):
                    if j == i:
                        continue
                    k = ridge - codes[corners[f, j]]
                    slot = (k ^ (k >> 29)) & (slots - 1)
                    while stamp[slot] == step and key[slot] != k:
                        slot = (slot + 1) & (slots - 1)
                    if stamp[slot] == step:
                        other = owner[slot] // d
                        near[new, j] = other
                        near[other, owner[slot] % d] = new
                    else:
                        stamp[slot], key[slot], owner[slot] = step, k, new * d + j
        for v in range(seen_count):
            alive[visible[v]] = 0
            free[spare] = visible[v]
            spare += 1
        if first_new < 0:
            answer[0], answer[1] = lower, upper
            return FULL
    if not whole:
        answer[0], answer[1], answer[2] = lower, upper, used - spare
        return FULL
    lower, volume, mean, facets = np.inf, 0.0, 0.0, 0
    for f in range(used):
        if alive[f] == 0:
            continue
        good, offset = _plane(points, corners, f, inside, u, rows)
        if not good:
            continue
        facets += 1
        mean += offset
        if offset < lower:
            lower = offset
            for j in range(d):
                worst[j] = u[j]
        for i in range(d):
            for j in range(d):
                rows[i, j] = points[corners[f, i], j]
        volume += (1.0 if offset > 0.0 else -1.0) * abs(_determinant(rows, d))
    for j in range(2, d + 1):
        volume /= j
    answer[0], answer[1], answer[2], answer[3], answer[4] = lower, lower, facets, volume, mean / max(facets, 1)
    return CLOSED


@kernel
def closed(base, spread, box, points, corners, near, planes, alive, codes, verdict, worst):  # type: ignore[no-untyped-def]
    """Whether the origin is inside the hull of the cone bases of each grasp: ``base (N, k, d)``, ``spread (N, k, 3, d)``, ``box (N, k)``.

    *verdict* ``(N,)``: an outcome of `grow`, CLOSED meaning force closure; *worst* ``(N, d)``: for OUTSIDE a direction
    along which no contact can push.
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
            BASES, base[n], spread[n], box[n], shift, 1.0 - 1e-9, False, 200, points, corners, near, planes, alive,
            codes, answer, worst[n],
        )  # fmt: skip
        if verdict[n] == CLOSED and answer[0] <= 1e-9 * size:
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
