"""Collision of a kinematic tree with itself and with fixed shapes: exact convex pieces, one configuration at a time.

Shapes are rows as in `gjk`; the fourth entry of a row of ``ints`` is the tree's joint that carries the shape (−1: the
world). Shapes belong to *nodes* (links, attached bodies, obstacles); a node has a bounding sphere in its carrier.
*Blocks* are pairs of nodes that may touch each other, each with a range of pairs of shapes. Three tests follow one
another: bounding spheres of the nodes, bounding sphere of one shape against the oriented box of the other, and GJK
that stops as soon as the question is decided.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .gjk import compose, gjk, relative
from .gjk_depth import PairSpace, new_pair_space, signed_distance
from .tree import TreeModel, tree_single

WORLD = -1
QUEUE = 4096


class CollideModel(NamedTuple):
    """Arrays of one robot in its surroundings."""

    tree: TreeModel
    ints: np.ndarray  # (G, 4) int64
    floats: np.ndarray  # (G, 20)
    points: np.ndarray  # (V, 3)
    first: np.ndarray  # (V + 1,) int64
    around: np.ndarray  # (E,) int64
    half: np.ndarray  # (G, 3): half extents of the box around a shape, in the shape's frame
    carrier: np.ndarray  # (K,) int64: joint that carries a node, −1: the world
    balls: np.ndarray  # (K, 4): bounding sphere of a node in its carrier
    reach: np.ndarray  # (K, m): how far a point of the node moves at most per unit of the joint's value
    common: (
        np.ndarray
    )  # (B, m) uint8: whether a joint carries both nodes of a block (then it moves neither against the other)
    blocks: np.ndarray  # (B, 4) int64: node, node, first pair, end of pairs
    pairs: np.ndarray  # (P, 2) int64: shapes


class CollideSpace(NamedTuple):
    """Scratch of one thread."""

    poses: np.ndarray  # (m, 12)
    shapes: np.ndarray  # (G, 12), in the world
    centres: np.ndarray  # (G, 3), of the shapes' bounding spheres, in the world
    balls: np.ndarray  # (K, 3), centres of the nodes' bounding spheres, in the world
    axes: np.ndarray  # (P, 3), last separating direction of every pair
    hints: np.ndarray  # (P, 2) int64
    q: np.ndarray  # (n,)
    rate: np.ndarray  # (B,)
    queue: np.ndarray  # (QUEUE, 2)
    pair: PairSpace


@kernel
def make_space(model, n):
    """Fresh scratch for *model* with *n* coordinates."""
    G, K, P = model.ints.shape[0], model.carrier.shape[0], model.pairs.shape[0]
    pair = new_pair_space()
    return CollideSpace(
        np.zeros((model.tree.kind.shape[0], 12)),
        np.zeros((G, 12)),
        np.zeros((G, 3)),
        np.zeros((K, 3)),
        np.zeros((P, 3)),
        np.zeros((P, 2), np.int64),
        np.zeros(n),
        np.zeros(model.blocks.shape[0]),
        np.empty((QUEUE, 2)),
        pair,
    )


@kernel
def place_point(T, x, y, z, out):
    """``out = T (x, y, z)`` for a pose (12,)."""
    for k in range(3):
        out[k] = T[3 * k] * x + T[3 * k + 1] * y + T[3 * k + 2] * z + T[9 + k]


@kernel
def place(model, q, space, everything):
    """Put the tree at *q*: poses of joints, bounding spheres, shapes; fixed shapes only when *everything*."""
    tree_single(model.tree, q, space.poses)
    for k in range(model.carrier.shape[0]):
        c = model.carrier[k]
        if c >= 0:
            place_point(space.poses[c], model.balls[k, 0], model.balls[k, 1], model.balls[k, 2], space.balls[k])
        elif everything:
            for i in range(3):
                space.balls[k, i] = model.balls[k, i]
    for g in range(model.ints.shape[0]):
        c = model.ints[g, 3]
        f = model.floats[g]
        if c >= 0:
            place_point(space.poses[c], f[4], f[5], f[6], space.centres[g])
            space.shapes[g, 0] = 2.0  # not composed yet: no rotation has such an entry
        elif everything:
            for i in range(3):
                space.centres[g, i] = f[4 + i]
            for i in range(12):
                space.shapes[g, i] = f[8 + i]


@kernel
def shape_pose(model, g, space):
    """World pose of shape *g*, composed on demand."""
    if space.shapes[g, 0] == 2.0:
        compose(space.poses[model.ints[g, 3]], model.floats[g, 8:20], space.shapes[g])


@kernel
def ball_to_box(model, a, b, space):
    """Distance between the bounding sphere of shape *a* and the oriented box of shape *b*; a lower bound for the pair."""
    T = space.shapes[b]
    x, y, z = space.centres[a, 0] - T[9], space.centres[a, 1] - T[10], space.centres[a, 2] - T[11]
    dx = max(abs(T[0] * x + T[3] * y + T[6] * z) - model.half[b, 0], 0.0)
    dy = max(abs(T[1] * x + T[4] * y + T[7] * z) - model.half[b, 1], 0.0)
    dz = max(abs(T[2] * x + T[5] * y + T[8] * z) - model.half[b, 2], 0.0)
    return math.sqrt(dx * dx + dy * dy + dz * dz) - model.floats[a, 7]


@kernel
def ball_to_ball(model, a, b, space):
    """Distance between the bounding spheres of two shapes."""
    x = space.centres[a, 0] - space.centres[b, 0]
    y = space.centres[a, 1] - space.centres[b, 1]
    z = space.centres[a, 2] - space.centres[b, 2]
    return math.sqrt(x * x + y * y + z * z) - model.floats[a, 7] - model.floats[b, 7]


@kernel
def node_gap(model, block, space):
    """Distance between the bounding spheres of the nodes of a block."""
    a, b = model.blocks[block, 0], model.blocks[block, 1]
    x = space.balls[a, 0] - space.balls[b, 0]
    y = space.balls[a, 1] - space.balls[b, 1]
    z = space.balls[a, 2] - space.balls[b, 2]
    return math.sqrt(x * x + y * y + z * z) - model.balls[a, 3] - model.balls[b, 3]


@kernel
def pair_gap(model, p, space, above, below, gap):
    """Bounds on the distance of pair *p*: decided against *above* and *below*, or within a relative *gap*.

    The upper bound is meaningless when the lower one exceeds *above*. Overlap is 0, 0.
    """
    a, b = model.pairs[p, 0], model.pairs[p, 1]
    low = ball_to_ball(model, a, b, space)
    if low > above:
        return low, low
    shape_pose(model, b, space)
    low = ball_to_box(model, a, b, space)
    if low > above:
        return low, low
    shape_pose(model, a, space)
    low = ball_to_box(model, b, a, space)
    if low > above:
        return low, low
    grown = model.floats[a, 3] + model.floats[b, 3]
    s = space.pair
    relative(space.shapes[a], space.shapes[b], s.rel)
    _, lower, upper = gjk(
        model.ints, model.floats, model.points, model.first, model.around, a, b, s.rel,
        s.simplex, s.bary, space.axes[p], space.hints[p], above + grown, below + grown, gap,
    )  # fmt: skip
    return lower - grown, upper - grown


@kernel
def first_hit(model, space, margin):
    """The first pair of shapes nearer than or at *margin* in the placed model, or −1."""
    for block in range(model.blocks.shape[0]):
        if node_gap(model, block, space) > margin:
            continue
        for p in range(model.blocks[block, 2], model.blocks[block, 3]):
            lower, upper = pair_gap(model, p, space, margin, margin, 1e-12)
            if not lower > margin and upper <= margin:
                return p
    return -1


@kernel
def check_many(model, q, margin, start, stop, out):
    """``out[i]`` = colliding pair of ``q[i]`` or −1."""
    space = make_space(model, q.shape[1])
    place(model, q[start], space, True)
    for i in range(start, stop):
        place(model, q[i], space, False)
        out[i] = first_hit(model, space, margin)


@kernel
def block_rates(model, qa, qb, space):
    """How fast the nodes of every block can approach each other along ``qa → qb``, per unit of the whole motion."""
    tree = model.tree
    m = tree.kind.shape[0]
    moved = 0.0
    for i in range(m):
        moved = max(moved, abs(qb[tree.coordinate[i]] - qa[tree.coordinate[i]]))
    for block in range(model.blocks.shape[0]):
        a, b = model.blocks[block, 0], model.blocks[block, 1]
        rate = 0.0
        for i in range(m):
            if model.common[block, i] == 0:
                c = tree.coordinate[i]
                rate += abs(tree.gain[i, 0] * (qb[c] - qa[c])) * (model.reach[a, i] + model.reach[b, i])
        space.rate[block] = rate


@kernel
def covered(model, space, margin, resolution, wanted):
    """Part of a motion around the placed configuration that is certainly free, at most *wanted*; negative: a hit.

    A hit is answered as −1 − pair.
    """
    radius = wanted
    for block in range(model.blocks.shape[0]):
        rate = space.rate[block]
        if rate == 0.0 and wanted < 1.0:
            continue  # nothing moves here: settled by the first configuration
        need = margin + radius * rate
        if node_gap(model, block, space) > need:
            continue
        for p in range(model.blocks[block, 2], model.blocks[block, 3]):
            lower, upper = pair_gap(model, p, space, need, margin, 0.2)
            if lower > need:
                continue
            if upper <= margin:
                return -1.0 - p
            if rate > 0.0:
                radius = min(radius, max(lower - margin, resolution) / rate)
                need = margin + radius * rate
    return radius


@kernel
def edge_hit(model, qa, qb, margin, resolution, space):
    """Whether the straight motion ``qa → qb`` is free: −1, or the pair that is hit and where.

    Configurations are checked from the middle outwards; each covers the part of the motion around it in which no pair
    can lose more than its distance to *margin*, or *resolution* if that is more. Returns ``(pair, s)``.
    """
    n = qa.shape[0]
    block_rates(model, qa, qb, space)
    q = space.q
    for end in range(2):  # the ends first: they also settle what does not move at all
        for j in range(n):
            q[j] = qa[j] if end == 0 else qb[j]
        place(model, q, space, end == 0)
        radius = covered(model, space, margin, resolution, 1.0)
        if radius < 0.0:
            return int(-1.0 - radius), float(end)
        if radius >= 1.0:
            return -1, 0.0
        if end == 0:
            low = radius
        else:
            high = 1.0 - radius
    queue = space.queue
    head, count = 0, 0
    if low < high:
        queue[0, 0], queue[0, 1] = low, high
        count = 1
    while count > 0:
        if count < QUEUE - 128:
            k = head
            head = (head + 1) % QUEUE
        else:
            k = (head + count - 1) % QUEUE
        count -= 1
        low, high = queue[k, 0], queue[k, 1]
        middle = 0.5 * (low + high)
        for j in range(n):
            q[j] = qa[j] + middle * (qb[j] - qa[j])
        place(model, q, space, False)
        radius = covered(model, space, margin, resolution, 0.5 * (high - low) + 1e-12)
        if radius < 0.0:
            return int(-1.0 - radius), middle
        if middle - radius > low:
            k = (head + count) % QUEUE
            queue[k, 0], queue[k, 1] = low, middle - radius
            count += 1
        if middle + radius < high:
            k = (head + count) % QUEUE
            queue[k, 0], queue[k, 1] = middle + radius, high
            count += 1
    return -1, 0.0


@kernel
def edges_many(model, qa, qb, margin, resolution, start, stop, out, where):
    """``out[i]`` = pair hit on the straight motion ``qa[i] → qb[i]``, at ``where[i]`` in 0 … 1; −1: free."""
    space = make_space(model, qa.shape[1])
    place(model, qa[start], space, True)
    for i in range(start, stop):
        out[i], where[i] = edge_hit(model, qa[i], qb[i], margin, resolution, space)


@kernel
def measure(model, p, space, out, best, within):
    """Signed distance of pair *p* and whether ``out (9,)`` was written: only when it is below *best* and *within*.

    ``out``: the witness points on both shapes and the unit normal from the second to the first, in the world.
    """
    enough = max(min(best, within), 0.0)
    lower, _ = pair_gap(model, p, space, enough, -1.0, 1e-3)
    if lower > enough:
        return lower, False
    a, b = model.pairs[p, 0], model.pairs[p, 1]
    shape_pose(model, a, space)
    shape_pose(model, b, space)
    s = space.pair
    relative(space.shapes[a], space.shapes[b], s.rel)
    for c in range(3):
        s.axis[c] = space.axes[p, c]
    s.hints[0], s.hints[1] = 0, 0
    d = signed_distance(model.ints, model.floats, model.points, model.first, model.around, a, b, s.rel, s)
    if d >= best:
        return d, False
    T = space.shapes[a]
    for k in range(2):
        for c in range(3):
            out[3 * k + c] = (
                T[3 * c] * s.near[k, 0] + T[3 * c + 1] * s.near[k, 1] + T[3 * c + 2] * s.near[k, 2] + T[9 + c]
            )
    for c in range(3):
        out[6 + c] = T[3 * c] * s.axis[0] + T[3 * c + 1] * s.axis[1] + T[3 * c + 2] * s.axis[2]
    return d, True


@kernel
def nearest(model, space, out):
    """Smallest signed distance over all pairs of the placed model, its pair, and ``out (9,)`` as in `measure`."""
    best, pair = 1e300, -1
    for block in range(model.blocks.shape[0]):
        if node_gap(model, block, space) >= best:
            continue
        for p in range(model.blocks[block, 2], model.blocks[block, 3]):
            d, written = measure(model, p, space, out, best, 1e300)
            if written:
                best, pair = d, p
    return best, pair


@kernel
def distance_many(model, q, start, stop, distance, pair, out):
    """`nearest` for every row of ``q``."""
    space = make_space(model, q.shape[1])
    place(model, q[start], space, True)
    for i in range(start, stop):
        place(model, q[i], space, False)
        distance[i], pair[i] = nearest(model, space, out[i])


@kernel
def hits_of_blocks(model, q, margin, start, stop, hits):
    """For every block, the number of rows of ``q`` in which its nodes touch: ``hits (B,)`` is added to."""
    space = make_space(model, q.shape[1])
    place(model, q[start], space, True)
    for i in range(start, stop):
        place(model, q[i], space, False)
        for block in range(model.blocks.shape[0]):
            if node_gap(model, block, space) > margin:
                continue
            for p in range(model.blocks[block, 2], model.blocks[block, 3]):
                lower, upper = pair_gap(model, p, space, margin, margin, 1e-12)
                if not lower > margin and upper <= margin:
                    hits[block] += 1
                    break


@kernel
def block_gaps(model, q, within, distance, out):
    """Signed distance of every block at one ``q (n,)``: ``distance (B,)``, ``out (B, 9)`` as in `nearest`.

    Blocks farther apart than *within* get a lower bound above it, and no points.
    """
    space = make_space(model, q.shape[0])
    place(model, q, space, True)
    for block in range(model.blocks.shape[0]):
        distance[block] = node_gap(model, block, space)
        if distance[block] > within:
            continue
        best = 1e300
        for p in range(model.blocks[block, 2], model.blocks[block, 3]):
            d, _ = measure(model, p, space, out[block], best, within)
            best = min(best, d)
        distance[block] = best
