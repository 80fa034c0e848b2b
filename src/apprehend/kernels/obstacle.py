"""Distance of a convex shape to what is not a convex core: half-spaces, fields, point clouds, unions of shapes.

Layout of shapes as in `gjk`. The last row of ``ints`` is a point at the origin, which stands for the points of clouds
and for places in fields. The points of a cloud and the shapes of a union are sorted so that a balanced binary tree
needs no pointers: node i of level l has those from ⌊N i / 2ˡ⌋ to ⌊N (i + 1) / 2ˡ⌋, and row 2ˡ − 1 + i of its part of
``trees (T, 4)`` is a ball (centre, radius) that holds them.

Where there is neither field nor cloud nor union, ``trees`` and ``grids`` are None: kernels are then compiled without
what follows the question whether they are.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .gjk import AXIS, BEST, CLOUD, HALF_SPACE, KEEP, NEAR, REL, compose, gjk, support
from .gjk_signed import signed_distance
from .grid_search import STACK, field_gap

WITHIN = 0.01
"""A field's value on a shape is sought to this share of the spacing."""


@kernel(fast=False)
def obstacle_stack():
    """Scratch of one thread for `obstacle_gap`."""
    return np.empty((STACK, 6))


@kernel(fast=False, borrow=True)
def half_space_distance(ints, floats, points, graph, a, b, ws):
    """Signed distance of *a* to half-space *b*, the pose of which in a is ``ws[REL]``; witnesses as `signed_distance`."""
    rel, near = ws[REL], ws[NEAR]
    nx, ny, nz = rel[2], rel[5], rel[8]
    x, y, z, _ = support(ints, floats, points, graph, a, -nx, -ny, -nz, 0.0)
    d = nx * (x - rel[9]) + ny * (y - rel[10]) + nz * (z - rel[11])
    ra, rb = floats[a, 3], floats[b, 3]
    near[0], near[1], near[2] = x - ra * nx, y - ra * ny, z - ra * nz
    near[3], near[4], near[5] = x - (d - rb) * nx, y - (d - rb) * ny, z - (d - rb) * nz
    ws[AXIS, 0], ws[AXIS, 1], ws[AXIS, 2] = nx, ny, nz
    return d - ra - rb


@kernel(fast=False, borrow=True)
def box_gap(floats, a, x, y, z):
    """A lower bound on the signed distance between a point in the frame of *a* and the shape."""
    dx, dy, dz = abs(x) - floats[a, 20], abs(y) - floats[a, 21], abs(z) - floats[a, 22]
    px, py, pz = max(dx, 0.0), max(dy, 0.0), max(dz, 0.0)
    return math.sqrt(px * px + py * py + pz * pz) + min(max(max(dx, dy), dz), 0.0)


@kernel(fast=False, borrow=True)
def tree_gap(ints, floats, points, graph, trees, a, b, ws, big, above, below, gap, exact, stack):
    """Bounds on the distance of *a* to cloud or tree *b*, the pose of which in a is ``ws[REL]``.

    Stops where it is known to be above *above*, or at most *below*; *gap* as in `gjk`. *exact*: the signed distance
    and its witnesses instead, as `signed_distance`.
    """
    first, count = ints[b, 1], ints[b, 2]
    root, levels = int(floats[b, 0]), int(floats[b, 1])
    rb = floats[b, 3]
    keep, rel, best_row = ws[KEEP], ws[REL], ws[BEST]
    cloud = ints[b, 0] == CLOUD
    other = ints.shape[0] - 1
    for c in range(12):
        keep[c] = rel[c]
    for c in range(9):
        rel[c] = 1.0 if c % 4 == 0 else 0.0
        best_row[c] = 0.0
    lower, upper = 1e300, 1e300
    top = push_ball(trees, root, 0, 0, floats, a, keep, rb, stack, 0)
    while top:
        top -= 1
        bound, level, i = stack[top, 0], int(stack[top, 1]), int(stack[top, 2])
        if bound > above or bound >= upper:
            lower = min(lower, bound)
            continue
        if level < levels:
            width = 1 << (level + 1)
            top = push_ball(trees, root + width - 1, level + 1, 2 * i, floats, a, keep, rb, stack, top)
            top = push_ball(trees, root + width - 1, level + 1, 2 * i + 1, floats, a, keep, rb, stack, top)
            if stack[top - 2, 0] < stack[top - 1, 0]:
                for c in range(3):
                    stack[top - 1, c], stack[top - 2, c] = stack[top - 2, c], stack[top - 1, c]
            continue
        for k in range(first + ((count * i) >> level), first + ((count * (i + 1)) >> level)):
            if cloud:
                x, y, z = points[k, 0], points[k, 1], points[k, 2]
                for c in range(3):
                    rel[9 + c] = keep[3 * c] * x + keep[3 * c + 1] * y + keep[3 * c + 2] * z + keep[9 + c]
                low = box_gap(floats, a, rel[9], rel[10], rel[11]) - rb
            else:
                other = k
                compose(keep, floats[k, 8:20], rel)
                low = box_gap(floats, a, rel[9], rel[10], rel[11]) - rb - floats[k, 7]
            if low > above or low >= upper:
                lower = min(lower, low)
                continue
            for c in range(5):
                ws[AXIS, c] = 0.0
            if exact:
                low = signed_distance(ints, floats, points, graph, a, other, ws, big) - rb
                high = low
            else:
                grown = floats[a, 3] + floats[other, 3] + rb
                _, low, high = gjk(ints, floats, points, graph, a, other, ws, above + grown, below + grown, gap)
                low, high = low - grown, high - grown
            lower = min(lower, low)
            if high < upper:
                upper = high
                if exact:
                    for c in range(3):
                        best_row[c], best_row[3 + c] = ws[NEAR, c], ws[NEAR, 3 + c] + rb * ws[AXIS, c]
                        best_row[6 + c] = ws[AXIS, c]
            if upper <= below:
                top = 0
                break
    for c in range(12):
        rel[c] = keep[c]
    for c in range(6):
        ws[NEAR, c] = best_row[c]
    for c in range(3):
        ws[AXIS, c] = best_row[6 + c]
    return lower, upper


@kernel(fast=False, borrow=True)
def push_ball(trees, row, level, i, floats, a, keep, radius, stack, top):
    """Push node *i* of a level with a lower bound on its distance to shape *a*; returns the new top."""
    x, y, z = trees[row + i, 0], trees[row + i, 1], trees[row + i, 2]
    u = keep[0] * x + keep[1] * y + keep[2] * z + keep[9]
    v = keep[3] * x + keep[4] * y + keep[5] * z + keep[10]
    w = keep[6] * x + keep[7] * y + keep[8] * z + keep[11]
    stack[top, 0] = box_gap(floats, a, u, v, w) - trees[row + i, 3] - radius
    stack[top, 1], stack[top, 2] = level, i
    return top + 1


@kernel(fast=False, borrow=True)
def obstacle_gap(ints, floats, points, graph, trees, grids, a, b, ws, big, above, below, gap, stack):
    """Bounds on the distance of *a* to *b*, which is a half-space, a cloud or a field; see `gjk` for the rest."""
    kind = ints[b, 0]
    if kind == HALF_SPACE:
        d = half_space_distance(ints, floats, points, graph, a, b, ws)
        return d, d
    if trees is None:
        return 0.0, 0.0
    if kind >= CLOUD:
        return tree_gap(ints, floats, points, graph, trees, a, b, ws, big, above, below, gap, False, stack)
    slack = WITHIN * grids[ints[b, 1]]
    return field_gap(ints, floats, points, graph, grids, a, b, ws, above, below, slack, stack)


@kernel(fast=False, borrow=True)
def any_distance(ints, floats, points, graph, trees, grids, a, b, ws, big, above, stack):
    """As `signed_distance`, where *b* may be of any kind; where it is above *above*, something above is answered."""
    kind = ints[b, 0]
    if kind == HALF_SPACE:
        return half_space_distance(ints, floats, points, graph, a, b, ws)
    if kind < HALF_SPACE:
        return signed_distance(ints, floats, points, graph, a, b, ws, big)
    if trees is None:
        return 0.0
    if kind >= CLOUD:
        return tree_gap(ints, floats, points, graph, trees, a, b, ws, big, above, -1e300, 0.0, True, stack)[1]
    slack = WITHIN * grids[ints[b, 1]]
    return field_gap(ints, floats, points, graph, grids, a, b, ws, above, -1e300, slack, stack)[1]


@kernel(fast=False, borrow=True)
def sort_tree(points, radii, levels, order, trees, first):
    """Sort ``points (N, 3)`` (through *order*) into a balanced tree of *levels* and fill its balls from row *first*."""
    count = points.shape[0]
    for level in range(levels + 1):
        width = 1 << level
        for i in range(width):
            begin, end = (count * i) >> level, (count * (i + 1)) >> level
            ball = trees[first + width - 1 + i]
            axis, widest = 0, -1.0
            for c in range(3):
                low, high = 1e300, -1e300
                for k in range(begin, end):
                    low = min(low, points[order[k], c] - radii[order[k]])
                    high = max(high, points[order[k], c] + radii[order[k]])
                ball[c] = 0.5 * (low + high) if end > begin else 0.0
                if high - low > widest:
                    axis, widest = c, high - low
            reach = 0.0
            for k in range(begin, end):
                p = points[order[k]]
                d = (p[0] - ball[0]) ** 2 + (p[1] - ball[1]) ** 2 + (p[2] - ball[2]) ** 2
                reach = max(reach, math.sqrt(d) + radii[order[k]])
            ball[3] = reach * (1.0 + 1e-12)
            if level < levels:
                select(points, order, begin, end, (count * (2 * i + 1)) >> (level + 1), axis)


@kernel(fast=False, borrow=True)
def select(points, order, begin, end, middle, axis):
    """Partition ``order[begin:end]`` so that what precedes *middle* is not greater along *axis* (Hoare's FIND)."""
    low, high = begin, end - 1
    while low < high:
        pivot = points[order[(low + high) // 2], axis]
        i, j = low, high
        while i <= j:
            while points[order[i], axis] < pivot:
                i += 1
            while points[order[j], axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            break
