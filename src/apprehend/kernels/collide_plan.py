"""Two trees that grow towards each other through the free configurations (RRT-Connect), and shorter ways along a path.

Kuffner & LaValle 2000, *RRT-Connect*. Random numbers come in from the caller, so that the same generator gives the
same path. The trees are ``nodes (2, C, n)`` with ``parent (2, C)`` (−1: a root), filled up to ``count (2,)``.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .lane_edges import edge_blocked, edge_space

SHRINK = 0.97  # of a domain, with every motion that is blocked

PATIENCE = 25  # shortcuts in a row that bring nothing, before it is enough

CONNECTED = 1
FULL = 2
MORE = 0


@kernel(borrow=True)
def nearest_node(nodes, count, q):
    """The row of ``nodes[:count]`` nearest to *q*, and its distance."""
    best, row = 1e300, 0
    for i in range(count):
        d = 0.0
        for j in range(q.shape[0]):
            e = nodes[i, j] - q[j]
            d += e * e
        if d < best:
            best = d
            row = i
    return row, math.sqrt(best)


@kernel(borrow=True)
def extend(exact, lanes, nodes, parent, count, q, stride, greedy, margin, resolution, space):
    """Grow a tree towards *q* by steps of at most *stride*: one, or (*greedy*) as many as are free.

    Returns ``(new count, reached)``.
    """
    n = q.shape[0]
    row, left = nearest_node(nodes, count, q)
    while count < nodes.shape[0]:
        share = 1.0 if left <= stride else stride / left
        for j in range(n):
            nodes[count, j] = q[j] if share == 1.0 else nodes[row, j] + share * (q[j] - nodes[row, j])
        if left > 0.0 and edge_blocked(exact, lanes, nodes[row], nodes[count], margin, resolution, space):
            return count, False
        parent[count] = row
        row = count
        count += 1
        left -= share * left
        if share == 1.0:
            return count, True
        if not greedy:
            return count, False
    return count, False


@kernel
def grow(exact, lanes, nodes, parent, domain, count, samples, low, high, stride, widest, least, margin, resolution):
    """Grow both trees with the configurations ``samples (S, n)``, given as shares of the way from *low* to *high*.

    The smaller tree goes first. ``domain (2, C)``: how far from a node samples are of use to it. It is infinite until a
    motion from the node is blocked, and then shrinks from *widest* to *least* with every such motion (both relative to
    the diagonal of the box of samples), so that nodes at a wall do not try to pass it again and again (dynamic domain;
    Yershova, Jaillet, Siméon & LaValle 2005).
    Returns ``(status, samples used)``; when connected, the last node of each tree is the same configuration.
    """
    space = edge_space(exact, lanes, samples.shape[1])
    across = 0.0
    for j in range(samples.shape[1]):
        across += (high[j] - low[j]) ** 2
    widest, least = widest * math.sqrt(across), least * math.sqrt(across)
    for s in range(samples.shape[0]):
        for j in range(samples.shape[1]):
            samples[s, j] = low[j] + samples[s, j] * (high[j] - low[j])
        one = 0 if count[0] <= count[1] else 1
        row, far = nearest_node(nodes[one], count[one], samples[s])
        if far > domain[one, row]:
            continue
        before = count[one]
        count[one], _ = extend(
            exact, lanes, nodes[one], parent[one], before, samples[s], stride, False, margin, resolution, space
        )
        if count[one] == before:
            domain[one, row] = max(least, min(widest, SHRINK * domain[one, row]))
            continue
        if count[one] >= nodes.shape[1]:
            return FULL, s + 1
        other = 1 - one
        count[other], reached = extend(
            exact, lanes, nodes[other], parent[other], count[other], nodes[one, before], stride, True, margin,
            resolution, space,
        )  # fmt: skip
        if reached:
            return CONNECTED, s + 1
        if count[other] >= nodes.shape[1]:
            return FULL, s + 1
    return MORE, samples.shape[0]


@kernel(borrow=True)
def length(path, a, b):
    """Length of the polyline from vertex *a* to vertex *b*."""
    total = 0.0
    for i in range(a, b):
        d = 0.0
        for j in range(path.shape[1]):
            e = path[i + 1, j] - path[i, j]
            d += e * e
        total += math.sqrt(d)
    return total


@kernel(borrow=True)
def point_at(path, count, s, out):
    """The point at arc length *s*; returns the vertex before it."""
    for i in range(count - 1):
        d = length(path, i, i + 1)
        if s <= d or i == count - 2:
            t = min(s / d, 1.0) if d > 0.0 else 0.0
            for j in range(path.shape[1]):
                out[j] = path[i, j] + t * (path[i + 1, j] - path[i, j])
            return i
        s -= d
    return 0


@kernel(borrow=True)
def skip_vertices(exact, lanes, path, count, margin, resolution, space):
    """Drop vertices that a straight motion can pass by, the farthest leaps first; returns the new count."""
    n = path.shape[1]
    i = 0
    while i < count - 2:
        k = count - 1
        while k > i + 1:
            if not edge_blocked(exact, lanes, path[i], path[k], margin, resolution, space):
                break
            k -= 1
        gap = k - i - 1
        if gap > 0:
            for r in range(i + 1, count - gap):
                for j in range(n):
                    path[r, j] = path[r + gap, j]
            count -= gap
        i += 1
    return count


@kernel
def shortcut(exact, lanes, path, count, samples, margin, resolution):
    """Shorten ``path (C, n)`` of *count* vertices in place with pairs of random places ``samples (S, 2)`` in 0 … 1.

    Vertices that can be passed by go first; then straight motions between two random places on the path replace what
    lies between where they are free and shorter (Geraerts & Overmars 2007). Returns the new count.
    """
    n = path.shape[1]
    space = edge_space(exact, lanes, n)
    count = skip_vertices(exact, lanes, path, count, margin, resolution, space)
    a, b = np.empty(n), np.empty(n)
    rest = np.empty_like(path)
    vain = 0
    for s in range(samples.shape[0]):
        vain += 1
        if count < 3 or count + 2 > path.shape[0] or vain > PATIENCE:
            break
        total = length(path, 0, count - 1)
        low = min(samples[s, 0], samples[s, 1]) * total
        high = max(samples[s, 0], samples[s, 1]) * total
        i = point_at(path, count, low, a)
        k = point_at(path, count, high, b)
        if i == k:
            continue
        d = 0.0
        for j in range(n):
            d += (b[j] - a[j]) ** 2
        if math.sqrt(d) > (high - low) * (1.0 - 1e-3):
            continue
        if edge_blocked(exact, lanes, a, b, margin, resolution, space):
            continue
        vain = 0
        # vertices 0 … i, a, b, k + 1 … end
        tail = count - (k + 1)
        for r in range(tail):
            for j in range(n):
                rest[r, j] = path[k + 1 + r, j]
        for j in range(n):
            path[i + 1, j] = a[j]
            path[i + 2, j] = b[j]
        for r in range(tail):
            for j in range(n):
                path[i + 3 + r, j] = rest[r, j]
        count = i + 3 + tail
    return skip_vertices(exact, lanes, path, count, margin, resolution, space)
