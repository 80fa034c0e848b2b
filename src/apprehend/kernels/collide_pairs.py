"""Signed distance of one pair of convex shapes at many poses."""

from __future__ import annotations

from ._jit import kernel
from .gjk import compose, relative
from .gjk_depth import new_pair_space, signed_distance


@kernel
def pair_many(ints, floats, points, first, around, A, B, start, stop, distance, out):
    """Shapes 0 and 1 carried by poses ``A, B (N, 12)``: signed distance, witness points (2, 3) and normal in world axes."""
    space = new_pair_space()
    TA, TB = space.world[0], space.world[1]
    for i in range(start, stop):
        compose(A[i], floats[0, 8:20], TA)
        compose(B[i], floats[1, 8:20], TB)
        relative(TA, TB, space.rel)
        for c in range(3):
            space.axis[c] = 0.0
        space.hints[0], space.hints[1] = 0, 0
        distance[i] = signed_distance(ints, floats, points, first, around, 0, 1, space.rel, space)
        for c in range(3):
            for k in range(2):
                p = space.near[k]
                out[i, 3 * k + c] = TA[3 * c] * p[0] + TA[3 * c + 1] * p[1] + TA[3 * c + 2] * p[2] + TA[9 + c]
            n = space.axis
            out[i, 6 + c] = TA[3 * c] * n[0] + TA[3 * c + 1] * n[1] + TA[3 * c + 2] * n[2]
