"""Signed distance of one pair of convex shapes at many poses."""

from __future__ import annotations

from ._jit import kernel
from .gjk import AXIS, NEAR, PLACE_A, PLACE_B, REL, compose, relative
from .gjk_depth import depth_scratch, pair_scratch, signed_distance


@kernel
def pair_many(ints, floats, points, graph, A, B, start, stop, distance, out):
    """Shapes 0 and 1 carried by poses ``A, B (N, 12)``: signed distance, witness points (2, 3) and normal in world axes."""
    ws, big = pair_scratch(), depth_scratch()
    TA = ws[PLACE_A]
    for i in range(start, stop):
        compose(A[i], floats[0, 8:20], TA)
        compose(B[i], floats[1, 8:20], ws[PLACE_B])
        relative(TA, ws[PLACE_B], ws[REL])
        for c in range(5):
            ws[AXIS, c] = 0.0
        distance[i] = signed_distance(ints, floats, points, graph, 0, 1, ws, big)
        report(TA, ws, out[i])


@kernel
def report(TA, ws, out):
    """``out (9,)``: witness points on both shapes and the normal, from the frame of the first at *TA* into the world."""
    near, n = ws[NEAR], ws[AXIS]
    for c in range(3):
        for k in range(2):
            x, y, z = near[3 * k], near[3 * k + 1], near[3 * k + 2]
            out[3 * k + c] = TA[3 * c] * x + TA[3 * c + 1] * y + TA[3 * c + 2] * z + TA[9 + c]
        out[6 + c] = TA[3 * c] * n[0] + TA[3 * c + 1] * n[1] + TA[3 * c + 2] * n[2]
