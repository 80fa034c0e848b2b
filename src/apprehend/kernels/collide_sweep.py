"""How far straight motions in joint space are proven free: conservative advancement over exact convex pieces."""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .collide import block_rates, forget, make_space, node_gap, pair_gap, place


@kernel(borrow=True)
def ahead(model, space, rate, margin, tolerance, wanted):
    """Part of a motion from the placed configuration on that is certainly free, at most *wanted*; and what ends it.

    Conservative advancement (Mirtich 1996): no pair can lose more than its distance to *margin* at the *rate* of its
    block. The answer ``(part, pair)`` has pair −1, or is 0 with a pair that is nearer than *margin* + *tolerance*.
    """
    pairs, arrays, poses, shapes = model.pairs, model.shapes, space.poses, space.shapes
    memory, ws, big, stack = space.memory, space.ws, space.big, space.stack
    space.used[0] = 1.0
    blocks, nodes, balls = model.blocks, model.nodes, space.balls
    part, near = wanted, margin + tolerance
    for block in range(blocks.shape[0]):
        speed = rate[block]
        need = max(margin + part * speed, near)
        if node_gap(nodes, balls, blocks[block, 0], blocks[block, 1]) > need:
            continue
        for p in range(blocks[block, 2], blocks[block, 3]):
            a, b = pairs[p, 0], pairs[p, 1]
            lower, _ = pair_gap(arrays, a, b, poses, shapes, memory[p], ws, big, stack, need, -1.0, 1e-9)
            if lower > need:
                continue
            if lower <= near:
                return 0.0, p
            if speed > 0.0:
                part = min(part, (lower - margin) / speed)
                need = max(margin + part * speed, near)
    return part, -1


@kernel
def sweep(model, qa, qb, margin, tolerance, start, stop, until, pair):
    """``until[i]``: the part of ``qa[i] → qb[i]`` that is certainly free, and the pair that ends it (−1: it is 1)."""
    n = qa.shape[1]
    space, rate, q = make_space(model), np.empty(model.blocks.shape[0]), np.empty(n)
    for i in range(start, stop):
        forget(space)
        block_rates(model, qa[i], qb[i], rate)
        t = 0.0
        while True:
            for j in range(n):
                q[j] = qa[i, j] + t * (qb[i, j] - qa[i, j])
            place(model, q, space)
            part, pair[i] = ahead(model, space, rate, margin, tolerance, 1.0 - t)
            t = t + part
            if pair[i] >= 0 or t >= 1.0 - 1e-15:
                break
        until[i] = t if pair[i] >= 0 else 1.0
