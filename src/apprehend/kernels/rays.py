"""Rays against a triangle mesh: a bounding-volume tree, and a watertight triangle test.

The tree is built with the surface-area heuristic over bins. The triangle test is the one of Woop, Benthin and Wald
(Watertight Ray/Triangle Intersection, JCGT 2013): edges are tested in a sheared space, with the same arithmetic for
both triangles of an edge, so that no ray slips through a shared edge or vertex. It needs strict IEEE arithmetic.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._jit import kernel

LEAF = 4
BINS = 12
DEPTH = 96


class Tree(NamedTuple):
    """A bounding-volume tree. A leaf has ``children = (-first - 1, count)``; triangles lie in leaf order."""

    boxes: np.ndarray  # (M, 6) lower and upper corner
    children: np.ndarray  # (M, 2) int64
    triangles: np.ndarray  # (F, 3, 3)
    order: np.ndarray  # (F,) int64, index of each triangle in the caller's faces


@kernel(fast=False)
def build(vertices, faces):  # type: ignore[no-untyped-def]
    """The tree of a mesh with at least one face, as the four arrays of `Tree`."""
    count = faces.shape[0]
    corners = np.empty((count, 3, 3))
    centre = np.empty((count, 3))
    for f in range(count):
        for j in range(3):
            for k in range(3):
                corners[f, j, k] = vertices[faces[f, j], k]
        for k in range(3):
            low = min(corners[f, 0, k], corners[f, 1, k], corners[f, 2, k])
            high = max(corners[f, 0, k], corners[f, 1, k], corners[f, 2, k])
            centre[f, k] = 0.5 * (low + high)
    order = np.arange(count)
    boxes = np.empty((2 * count, 6))
    children = np.empty((2 * count, 2), np.int64)
    stack = np.empty((DEPTH, 4), np.int64)  # node, first, count, depth
    stack[0] = (0, 0, count, 0)
    top, used = 1, 1
    lower = np.empty((BINS, 6))
    number = np.empty(BINS, np.int64)
    cost = np.empty(BINS)
    while top:
        top -= 1
        node, first, n, depth = stack[top]
        box = boxes[node]
        _enclose(corners, order, first, n, box)
        if n <= LEAF:
            children[node, 0], children[node, 1] = -first - 1, n
            continue
        axis, low, high = _widest(centre, order, first, n)
        split = first + n // 2
        if high > low and depth < DEPTH - 32:
            scale = BINS * (1.0 - 1e-12) / (high - low)
            cut = _best_cut(corners, centre, order, first, n, axis, low, scale, lower, number, cost)
            i, j = first, first + n - 1
            while i <= j:
                if int((centre[order[i], axis] - low) * scale) < cut:
                    i += 1
                else:
                    order[i], order[j] = order[j], order[i]
                    j -= 1
            if first < i < first + n:
                split = i
        left, right = used, used + 1
        used += 2
        children[node, 0], children[node, 1] = left, right
        stack[top] = (left, first, split - first, depth + 1)
        stack[top + 1] = (right, split, first + n - split, depth + 1)
        top += 2
    sorted_corners = np.empty((count, 3, 3))
    for f in range(count):
        sorted_corners[f] = corners[order[f]]
    return boxes[:used].copy(), children[:used].copy(), sorted_corners, order


@kernel(fast=False)
def _enclose(corners, order, first, n, box):  # type: ignore[no-untyped-def]
    for k in range(3):
        box[k], box[k + 3] = np.inf, -np.inf
    for i in range(first, first + n):
        for j in range(3):
            for k in range(3):
                value = corners[order[i], j, k]
                box[k] = min(box[k], value)
                box[k + 3] = max(box[k + 3], value)


@kernel(fast=False)
def _widest(centre, order, first, n):  # type: ignore[no-untyped-def]
    axis, best_low, best_high = 0, 0.0, -1.0
    for k in range(3):
        low, high = np.inf, -np.inf
        for i in range(first, first + n):
            low = min(low, centre[order[i], k])
            high = max(high, centre[order[i], k])
        if high - low > best_high - best_low:
            axis, best_low, best_high = k, low, high
    return axis, best_low, best_high


@kernel(fast=False)
def _area(box):  # type: ignore[no-untyped-def]
    a, b, c = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return a * b + b * c + c * a


@kernel(fast=False)
def _best_cut(corners, centre, order, first, n, axis, low, scale, bins, number, cost):  # type: ignore[no-untyped-def]
    """First bin of the right child, by the surface-area heuristic."""
    number[:] = 0
    for b in range(BINS):
        for k in range(3):
            bins[b, k], bins[b, k + 3] = np.inf, -np.inf
    for i in range(first, first + n):
        f = order[i]
        b = int((centre[f, axis] - low) * scale)
        number[b] += 1
        for j in range(3):
            for k in range(3):
                bins[b, k] = min(bins[b, k], corners[f, j, k])
                bins[b, k + 3] = max(bins[b, k + 3], corners[f, j, k])
    box = np.empty(6)
    for side in range(2):
        for k in range(3):
            box[k], box[k + 3] = np.inf, -np.inf
        total = 0
        for step in range(BINS - 1):
            b = step if side == 0 else BINS - 1 - step
            total += number[b]
            for k in range(3):
                box[k] = min(box[k], bins[b, k])
                box[k + 3] = max(box[k + 3], bins[b, k + 3])
            if side == 0:
                cost[b + 1] = total * _area(box) if total else 0.0
            elif total:
                cost[b] += total * _area(box)
    best = 1
    for b in range(2, BINS):
        if cost[b] < cost[best]:
            best = b
    return best


@kernel(fast=False)
def _hits(tree, o, d, low, high, times, faces, signs):  # type: ignore[no-untyped-def]
    """Crossings with ``low <= t <= high`` in no order, merged where a shared edge is met twice; returns their number.

    ``signs`` is +1 where the ray enters (against the face normal), −1 where it leaves. A number above the capacity
    of *times* says that the surplus was dropped.
    """
    kz = 0
    if abs(d[1]) > abs(d[kz]):
        kz = 1
    if abs(d[2]) > abs(d[kz]):
        kz = 2
    kx, ky = (kz + 1) % 3, (kz + 2) % 3
    sx, sy, sz = d[kx] / d[kz], d[ky] / d[kz], 1.0 / d[kz]
    ix = 1.0 / d[0] if d[0] != 0.0 else 1e300
    iy = 1.0 / d[1] if d[1] != 0.0 else 1e300
    iz = 1.0 / d[2] if d[2] != 0.0 else 1e300
    stack = np.empty(DEPTH, np.int64)
    stack[0] = 0
    top, found, capacity = 1, 0, times.shape[0]
    while top:
        top -= 1
        node = stack[top]
        box = tree.boxes[node]
        a, b = (box[0] - o[0]) * ix, (box[3] - o[0]) * ix
        near, far = min(a, b), max(a, b)
        a, b = (box[1] - o[1]) * iy, (box[4] - o[1]) * iy
        near, far = max(near, min(a, b)), min(far, max(a, b))
        a, b = (box[2] - o[2]) * iz, (box[5] - o[2]) * iz
        near, far = max(near, min(a, b)), min(far, max(a, b))
        slack = 1e-14 * (abs(near) + abs(far))
        if near > far + slack or near > high + slack or far < low - slack:
            continue
        first = tree.children[node, 0]
        if first >= 0:
            stack[top] = first
            stack[top + 1] = tree.children[node, 1]
            top += 2
            continue
        first = -first - 1
        for i in range(first, first + tree.children[node, 1]):
            p = tree.triangles[i]
            az, bz, cz = p[0, kz] - o[kz], p[1, kz] - o[kz], p[2, kz] - o[kz]
            ax, ay = p[0, kx] - o[kx] - sx * az, p[0, ky] - o[ky] - sy * az
            bx, by = p[1, kx] - o[kx] - sx * bz, p[1, ky] - o[ky] - sy * bz
            cx, cy = p[2, kx] - o[kx] - sx * cz, p[2, ky] - o[ky] - sy * cz
            u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
            if (u < 0.0 or v < 0.0 or w < 0.0) and (u > 0.0 or v > 0.0 or w > 0.0):
                continue
            det = u + v + w
            if det == 0.0:
                continue
            t = (u * az + v * bz + w * cz) * sz / det
            if not (low <= t <= high):
                continue
            sign = 1 if det * sz > 0.0 else -1
            merged = False
            for j in range(min(found, capacity)):
                if signs[j] == sign and abs(times[j] - t) <= 1e-12 * (1.0 + abs(t)):
                    merged = True
            if not merged:
                if found < capacity:
                    times[found], faces[found], signs[found] = t, tree.order[i], sign
                found += 1
    return found


@kernel(fast=False)
def cast(tree, origins, directions, low, high, times, faces, signs, counts):  # type: ignore[no-untyped-def]
    """All crossings of each ray, sorted by t, into rows of *times*, *faces* and *signs* ``(N, capacity)``."""
    for n in range(origins.shape[0]):
        found = _hits(tree, origins[n], directions[n], low, high, times[n], faces[n], signs[n])
        counts[n] = found
        kept = min(found, times.shape[1])
        for i in range(1, kept):
            t, f, s = times[n, i], faces[n, i], signs[n, i]
            j = i - 1
            while j >= 0 and (times[n, j] > t or (times[n, j] == t and faces[n, j] > f)):
                times[n, j + 1], faces[n, j + 1], signs[n, j + 1] = times[n, j], faces[n, j], signs[n, j]
                j -= 1
            times[n, j + 1], faces[n, j + 1], signs[n, j + 1] = t, f, s


@kernel(fast=False)
def _nearest_on_triangle(p, tri, out):  # type: ignore[no-untyped-def]
    """Closest point of a triangle (Ericson, Real-Time Collision Detection, 5.1.5); returns the squared distance."""
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0
    for k in range(3):
        ab, ac = tri[1, k] - tri[0, k], tri[2, k] - tri[0, k]
        d1 += ab * (p[k] - tri[0, k])
        d2 += ac * (p[k] - tri[0, k])
        d3 += ab * (p[k] - tri[1, k])
        d4 += ac * (p[k] - tri[1, k])
        d5 += ab * (p[k] - tri[2, k])
        d6 += ac * (p[k] - tri[2, k])
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v, w = d1 / (d1 - d3) if d1 != d3 else 0.0, 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        v, w = 0.0, d2 / (d2 - d6) if d2 != d6 else 0.0
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        total = (d4 - d3) + (d5 - d6)
        w = (d4 - d3) / total if total != 0.0 else 0.0
        v = 1.0 - w
    else:
        total = va + vb + vc
        v, w = (vb / total, vc / total) if total != 0.0 else (0.0, 0.0)
    squared = 0.0
    for k in range(3):
        out[k] = tri[0, k] + v * (tri[1, k] - tri[0, k]) + w * (tri[2, k] - tri[0, k])
        squared += (out[k] - p[k]) ** 2
    return squared


@kernel
def push_nearer_last(tree, node, p, stack, lower, top):
    """Put both children of an inner *node* on the stack with their squared distances from p, the nearer on top."""
    a, b = tree.children[node, 0], tree.children[node, 1]
    da, db = 0.0, 0.0
    for k in range(3):
        e = max(tree.boxes[a, k] - p[k], p[k] - tree.boxes[a, k + 3], 0.0)
        da += e * e
        e = max(tree.boxes[b, k] - p[k], p[k] - tree.boxes[b, k + 3], 0.0)
        db += e * e
    if da < db:
        a, b, da, db = b, a, db, da
    stack[top], lower[top] = a, da
    stack[top + 1], lower[top + 1] = b, db
    return top + 2


@kernel(fast=False)
def nearest(tree, points, out, distance, faces):  # type: ignore[no-untyped-def]
    """Closest point of the surface to each point, its distance and its face."""
    stack = np.empty(DEPTH, np.int64)
    lower = np.empty(DEPTH)
    trial = np.empty(3)
    for n in range(points.shape[0]):
        p = points[n]
        best = np.inf
        stack[0], lower[0] = 0, 0.0
        top = 1
        while top:
            top -= 1
            if lower[top] >= best:
                continue
            node = stack[top]
            first = tree.children[node, 0]
            if first >= 0:
                top = push_nearer_last(tree, node, p, stack, lower, top)
                continue
            first = -first - 1
            for i in range(first, first + tree.children[node, 1]):
                squared = _nearest_on_triangle(p, tree.triangles[i], trial)
                if squared < best:
                    best = squared
                    out[n] = trial
                    faces[n] = tree.order[i]
        distance[n] = np.sqrt(best)
