"""Convex sets of wrenches, known by their support points: the farthest one along a direction, and a first simplex."""

from __future__ import annotations

import numpy as np

from ._jit import kernel

POINTS, UNION, SUM, BASES, CAP_UNION, CAP_SUM = 0, 1, 2, 3, 4, 5
"""Kinds of sets: hull of points (rows of *base*); hull of the union of cone bases and the origin (L1); sum of the hulls
of groups of cone bases, the origin added to each (L∞); hull of the cone bases alone; union and sum of caps: forces in
the cone of length at most one. Of a cap, *base* is the wrench of the unit normal force, ``spread[0]`` and
``spread[1]`` those of unit tangential forces, and ``spread[2, 0]`` is µ."""
BOX, SAME = 1, 2
"""Flags of a base: its third half-axis is limited on its own; it belongs to the group of the base before it."""


@kernel
def support(kind, base, spread, flags, shift, u, out):  # type: ignore[no-untyped-def]
    """Support value of the set along *u*, and the point that attains it.

    ``base (k, d)``: points, or axes of cone bases; ``spread (k, 3, d)``: half-axes of each base; a base is
    ``axis + Σ s_j half_j`` with ``‖s‖ ≤ 1``, or with the flag BOX in ``flags (k,)`` ``s₀² + s₁² ≤ 1, |s₂| ≤ 1``. The
    whole set is moved by ``−shift``.
    """
    value = _support(kind, base, spread, flags, u, out)
    for j in range(u.shape[0]):
        out[j] -= shift[j]
        value -= shift[j] * u[j]
    return value


@kernel
def _support(kind, base, spread, flags, u, out):  # type: ignore[no-untyped-def]
    d = u.shape[0]
    best, chosen, total = -np.inf, 0, 0.0
    if kind == POINTS:
        for i in range(base.shape[0]):
            v = 0.0
            for j in range(d):
                v += base[i, j] * u[j]
            if v > best:
                best, chosen = v, i
        for j in range(d):
            out[j] = base[chosen, j]
        return best
    for j in range(d):
        out[j] = 0.0
    if kind >= CAP_UNION:
        return _support_caps(kind == CAP_SUM, base, spread, u, out)
    for i in range(base.shape[0]):
        if kind == SUM and i > 0 and not flags[i] & SAME:
            if best > 0.0:
                total += best
                _reach(base[chosen], spread[chosen], flags[chosen], u, out)
            best = -np.inf
        v, s0, s1, s2 = 0.0, 0.0, 0.0, 0.0
        for j in range(d):
            v += base[i, j] * u[j]
            s0 += spread[i, 0, j] * u[j]
            s1 += spread[i, 1, j] * u[j]
            s2 += spread[i, 2, j] * u[j]
        if flags[i] & BOX:
            v += np.sqrt(s0 * s0 + s1 * s1) + abs(s2)
        else:
            v += np.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
        if v > best:
            best, chosen = v, i
    if best > 0.0 or kind == BASES:  # else the origin, which belongs to the other sets
        _reach(base[chosen], spread[chosen], flags[chosen], u, out)
        total += best
    return total


@kernel
def _support_caps(add, base, spread, u, out):  # type: ignore[no-untyped-def]
    d = u.shape[0]
    best, total = 0.0, 0.0
    for i in range(base.shape[0]):
        n, x, y, mu = 0.0, 0.0, 0.0, spread[i, 2, 0]
        for j in range(d):
            n += base[i, j] * u[j]
            x += spread[i, 0, j] * u[j]
            y += spread[i, 1, j] * u[j]
        t = np.sqrt(x * x + y * y)
        if n > 0.0 and t <= mu * n:  # the direction lies in the cone
            value = np.sqrt(n * n + t * t)
            a, b = n / value, 1.0 / value
        else:  # the nearest edge of the cone
            a = 1.0 / np.sqrt(1.0 + mu * mu)
            value, b = a * (n + mu * t), (a * mu / t if t > 0.0 else 0.0)
        if value <= 0.0 or (not add and value <= best):
            continue
        if not add:
            best = value
            for j in range(d):
                out[j] = 0.0
        total += value
        for j in range(d):
            out[j] += a * base[i, j] + b * (x * spread[i, 0, j] + y * spread[i, 1, j])
    return total if add else best


@kernel
def _reach(axis, half, flags, u, out):  # type: ignore[no-untyped-def]
    """Add to *out* the point of a base that is farthest along *u*."""
    s0, s1, s2 = 0.0, 0.0, 0.0
    for j in range(out.shape[0]):
        s0 += half[0, j] * u[j]
        s1 += half[1, j] * u[j]
        s2 += half[2, j] * u[j]
    if flags & BOX:
        n = np.sqrt(s0 * s0 + s1 * s1)
        s2 = 1.0 if s2 > 0.0 else (-1.0 if s2 < 0.0 else 0.0)
    else:
        n = np.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
        s2 = s2 / n if n > 0.0 else 0.0
    s0, s1 = (s0 / n, s1 / n) if n > 0.0 else (0.0, 0.0)
    for j in range(out.shape[0]):
        out[j] += axis[j] + s0 * half[0, j] + s1 * half[1, j] + s2 * half[2, j]


@kernel
def first_simplex(kind, base, spread, flags, shift, d, points, scale):  # type: ignore[no-untyped-def]
    """Corners of a first simplex in ``points[0 … d]``: False if the set is flat to within *scale*."""
    axes = np.zeros((d, d))
    u, low, high = np.empty(d), np.empty(d), np.empty(d)
    u[:] = 0.0
    u[0] = 1.0
    support(kind, base, spread, flags, shift, u, points[0])
    for i in range(d):
        best = 0.0
        for trial in range(d):  # directions square to the span so far
            for j in range(d):
                u[j] = 1.0 if j == trial else 0.0
            for m in range(i):
                t = axes[m, trial]
                for j in range(d):
                    u[j] -= t * axes[m, j]
            n = 0.0
            for j in range(d):
                n += u[j] * u[j]
            if n < 1e-4:
                continue
            for j in range(d):
                u[j] /= np.sqrt(n)
            for _ in range(2):
                support(kind, base, spread, flags, shift, u, high)
                t = 0.0
                for j in range(d):
                    t += u[j] * (high[j] - points[0, j])
                if abs(t) > best:
                    best = abs(t)
                    for j in range(d):
                        low[j] = high[j]
                for j in range(d):
                    u[j] = -u[j]
        if best <= scale:
            return False
        for j in range(d):
            points[i + 1, j] = low[j]
            axes[i, j] = low[j] - points[0, j]
        for _ in range(2):
            for m in range(i):
                t = 0.0
                for j in range(d):
                    t += axes[i, j] * axes[m, j]
                for j in range(d):
                    axes[i, j] -= t * axes[m, j]
        n = 0.0
        for j in range(d):
            n += axes[i, j] * axes[i, j]
        for j in range(d):
            axes[i, j] /= np.sqrt(n)
    return True
