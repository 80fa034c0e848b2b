"""Signed distance of one pair of shapes at many poses."""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .gjk import (
    AXIS,
    CLOUD,
    FIELD,
    HALF_SPACE,
    NEAR,
    PLACE_A,
    PLACE_B,
    REL,
    compose,
    relative,
)
from .gjk_depth import depth_scratch, pair_scratch
from .grid_search import field_at
from .obstacle import any_distance, obstacle_stack


@kernel
def pair_many(shapes, A, B, start, stop, distance, out):
    """Shapes 0 and 1 carried by poses ``A, B (N, 12)``: signed distance, witness points (2, 3) and normal in world axes."""
    ints, floats, points, graph, trees, grids = shapes
    ws, big, stack = pair_scratch(), depth_scratch(), obstacle_stack()
    TA, TB = ws[PLACE_A], ws[PLACE_B]
    for i in range(start, stop):
        compose(A[i], floats[0, 8:20], TA)
        compose(B[i], floats[1, 8:20], TB)
        relative(TA, TB, ws[REL])
        for c in range(5):
            ws[AXIS, c] = 0.0
        distance[i] = any_distance(ints, floats, points, graph, trees, grids, 0, 1, ws, big, 1e300, stack)
        report(TA, ws, out[i])


@kernel
def each_many(shapes, A, B, start, stop, distance, out):
    """The same where shape 0 is a cloud or a union."""
    ints, floats, points, graph, trees, grids = shapes
    ws, big, stack, outer, item = pair_scratch(), depth_scratch(), obstacle_stack(), obstacle_stack(), np.empty(12)
    for i in range(start, stop):
        compose(A[i], floats[0, 8:20], ws[PLACE_A])
        compose(B[i], floats[1, 8:20], ws[PLACE_B])
        distance[i] = each_of(ints, floats, points, graph, trees, grids, ws, big, stack, outer, item, out[i])


@kernel(borrow=True)
def each_of(ints, floats, points, graph, trees, grids, ws, big, stack, outer, item, out):
    """The least distance of a part of shape 0, a cloud or a union, at ``ws[PLACE_A]`` to shape 1 at ``ws[PLACE_B]``."""
    TA, TB, rel = ws[PLACE_A], ws[PLACE_B], ws[REL]
    first, count, cloud = ints[0, 1], ints[0, 2], ints[0, 0] == CLOUD
    root, levels, ra = int(floats[0, 0]), int(floats[0, 1]), floats[0, 3]
    best, other = 1e300, ints.shape[0] - 1
    outer[0, 0], outer[0, 1], outer[0, 2] = -1e300, 0.0, 0.0
    top = 1
    while top:
        top -= 1
        if outer[top, 0] >= best:
            continue
        level, i = int(outer[top, 1]), int(outer[top, 2])
        if level < levels:
            width = 1 << (level + 1)
            for k in range(2):
                ball = trees[root + width - 1 + 2 * i + k]
                outer[top + k, 0] = ball_bound(ints, floats, grids, TA, TB, ball[0], ball[1], ball[2]) - ball[3] - ra
                outer[top + k, 1], outer[top + k, 2] = level + 1, 2 * i + k
            if outer[top, 0] < outer[top + 1, 0]:
                for c in range(3):
                    outer[top, c], outer[top + 1, c] = outer[top + 1, c], outer[top, c]
            top += 2
            continue
        for k in range(first + ((count * i) >> level), first + ((count * (i + 1)) >> level)):
            if cloud:
                for c in range(12):
                    item[c] = TA[c]
                for c in range(3):
                    item[9 + c] += (
                        TA[3 * c] * points[k, 0] + TA[3 * c + 1] * points[k, 1] + TA[3 * c + 2] * points[k, 2]
                    )
                low = ball_bound(ints, floats, grids, TA, TB, points[k, 0], points[k, 1], points[k, 2]) - ra
            else:
                other = k
                compose(TA, floats[k, 8:20], item)
                x, y, z, reach = floats[k, 4], floats[k, 5], floats[k, 6], floats[k, 7]
                low = ball_bound(ints, floats, grids, TA, TB, x, y, z) - reach - ra
            if low >= best:
                continue
            relative(item, TB, rel)
            for c in range(5):
                ws[AXIS, c] = 0.0
            above = best + ra if best < 1e300 else best
            d = any_distance(ints, floats, points, graph, trees, grids, other, 1, ws, big, above, stack) - ra
            if d < best:
                best = d
                for c in range(3):
                    ws[NEAR, c] -= ra * ws[AXIS, c]
                report(item, ws, out)
    return best


@kernel(borrow=True)
def ball_bound(ints, floats, grids, TA, TB, x, y, z):
    """A lower bound on the distance between a point in the frame *TA* and shape 1, placed at *TB*."""
    u = TA[0] * x + TA[1] * y + TA[2] * z + TA[9] - TB[9]
    v = TA[3] * x + TA[4] * y + TA[5] * z + TA[10] - TB[10]
    w = TA[6] * x + TA[7] * y + TA[8] * z + TA[11] - TB[11]
    px, py, pz = TB[0] * u + TB[3] * v + TB[6] * w, TB[1] * u + TB[4] * v + TB[7] * w, TB[2] * u + TB[5] * v + TB[8] * w
    if ints[1, 0] == HALF_SPACE:
        return pz - floats[1, 3]
    if ints[1, 0] == FIELD:
        return field_at(grids, ints[1, 1], px, py, pz)
    dx, dy, dz = abs(px) - floats[1, 20], abs(py) - floats[1, 21], abs(pz) - floats[1, 22]
    ax, ay, az = max(dx, 0.0), max(dy, 0.0), max(dz, 0.0)
    return math.sqrt(ax * ax + ay * ay + az * az) + min(max(max(dx, dy), dz), 0.0)


@kernel(borrow=True)
def report(TA, ws, out):
    """``out (9,)``: witness points on both shapes and the normal, from the frame of the first at *TA* into the world."""
    near, n = ws[NEAR], ws[AXIS]
    for c in range(3):
        for k in range(2):
            x, y, z = near[3 * k], near[3 * k + 1], near[3 * k + 2]
            out[3 * k + c] = TA[3 * c] * x + TA[3 * c + 1] * y + TA[3 * c + 2] * z + TA[9 + c]
        out[6 + c] = TA[3 * c] * n[0] + TA[3 * c + 1] * n[1] + TA[3 * c + 2] * n[2]
