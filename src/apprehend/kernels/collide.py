"""Collision of a kinematic tree with itself and with fixed shapes: exact convex pieces, one configuration at a time.

Shapes are rows as in `gjk`; the fourth entry of a row of ``ints`` is the tree's joint that carries the shape (−1: the
world). Shapes belong to *nodes* (links, attached bodies, obstacles); a node has a bounding sphere in its carrier.
*Blocks* are pairs of nodes that may not touch, each with a range of pairs of shapes. Three tests follow one another:
bounding spheres of the nodes, bounding sphere of one shape against the oriented box of the other, and GJK that stops
as soon as the question is decided.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .collide_pairs import report
from .gjk import AXIS, HALF_SPACE, REL, ROWS, compose, gjk, relative
from .gjk_depth import depth_scratch
from .obstacle import any_distance, obstacle_gap, obstacle_stack

CENTRE = 12  # columns of a placed shape: pose, centre of the bounding sphere, whether the pose is up to date
DONE = 15


class Shapes(NamedTuple):
    """Shapes as arrays; rows beyond those that the caller counts are parts of unions and, last, a point."""

    ints: np.ndarray  # (G, 4) int64
    floats: np.ndarray  # (G, 23)
    points: np.ndarray  # (V, 3)
    graph: np.ndarray  # int64
    trees: np.ndarray | None  # (T, 4)
    grids: np.ndarray | None


class CollideModel(NamedTuple):
    """Arrays of one robot in its surroundings: m joints, G shapes, K nodes, B blocks, P pairs of shapes."""

    links: np.ndarray  # (m, 3) int64: parent joint, kind (0 revolute, 1 prismatic), coordinate
    joints: np.ndarray  # (m, 14): place in the parent's moved frame (12), multiplier, offset
    shapes: Shapes  # see `gjk` and `obstacle`
    nodes: np.ndarray  # (K, 5 + m): bounding sphere in the carrier (4), carrier, farthest motion per unit of each joint
    blocks: np.ndarray  # (B, 4 + m) int64: node, node, first pair, end of pairs, whether a joint carries both
    pairs: np.ndarray  # (P, 2) int64: shapes


class CollideSpace(NamedTuple):
    """Scratch of one thread."""

    poses: np.ndarray  # (m, 12) moved frames
    shapes: np.ndarray  # (G, 16)
    balls: np.ndarray  # (K, 3), centres of the nodes' bounding spheres in the world
    memory: np.ndarray  # (P, 5): last separating direction of every pair, last vertices
    used: np.ndarray  # (1,): 0 while that memory is fresh
    ws: np.ndarray  # see `gjk`
    big: np.ndarray  # see `gjk_depth`
    stack: np.ndarray  # see `obstacle`


@kernel
def make_space(model):
    """Fresh scratch for *model*, with everything that stands still in place."""
    ints, floats, nodes = model.shapes.ints, model.shapes.floats, model.nodes
    shapes, balls = np.zeros((ints.shape[0], 16)), np.zeros((nodes.shape[0], 3))
    for k in range(nodes.shape[0]):
        for i in range(3):
            balls[k, i] = nodes[k, i]
    for g in range(ints.shape[0]):
        for i in range(12):
            shapes[g, i] = floats[g, 8 + i]
        for i in range(3):
            shapes[g, CENTRE + i] = floats[g, 4 + i]
        shapes[g, DONE] = 1.0
    poses = np.zeros((model.links.shape[0], 12))
    memory, ws = np.zeros((model.pairs.shape[0], 5)), np.zeros((ROWS, 12))
    return CollideSpace(poses, shapes, balls, memory, np.zeros(1), ws, depth_scratch(), obstacle_stack())


@kernel(borrow=True)
def forget(space):
    """Every pair starts afresh if any was asked for: so that answers don't depend on all that a thread did before."""
    if space.used[0] != 0.0:
        space.memory[:] = 0.0
        space.used[0] = 0.0


@kernel(borrow=True)
def move_joints(links, joints, q, poses):
    """Moved frames of all joints at ``q (n,)``."""
    for i in range(links.shape[0]):
        T = poses[i]
        if links[i, 0] < 0:
            for k in range(12):
                T[k] = joints[i, k]
        else:
            compose(poses[links[i, 0]], joints[i], T)
        value = joints[i, 12] * q[links[i, 2]] + joints[i, 13]
        if links[i, 1] == 0:
            s, c = math.sin(value), math.cos(value)
            for k in range(3):
                b0, b1 = T[3 * k], T[3 * k + 1]
                T[3 * k] = b0 * c + b1 * s
                T[3 * k + 1] = b1 * c - b0 * s
        else:
            for k in range(3):
                T[9 + k] += value * T[3 * k + 2]


@kernel(borrow=True)
def place(model, q, space):
    """Put the tree at *q*: poses of joints, bounding spheres of nodes and shapes; poses of shapes follow on demand."""
    ints, floats, nodes = model.shapes.ints, model.shapes.floats, model.nodes
    poses, shapes, balls = space.poses, space.shapes, space.balls
    move_joints(model.links, model.joints, q, poses)
    for k in range(nodes.shape[0]):
        carrier = int(nodes[k, 4])
        if carrier >= 0:
            T = poses[carrier]
            for i in range(3):
                balls[k, i] = (
                    T[3 * i] * nodes[k, 0] + T[3 * i + 1] * nodes[k, 1] + T[3 * i + 2] * nodes[k, 2] + T[9 + i]
                )
    for g in range(ints.shape[0]):
        if ints[g, 3] >= 0:
            T = poses[ints[g, 3]]
            x, y, z = floats[g, 4], floats[g, 5], floats[g, 6]
            for i in range(3):
                shapes[g, CENTRE + i] = T[3 * i] * x + T[3 * i + 1] * y + T[3 * i + 2] * z + T[9 + i]
            shapes[g, DONE] = 0.0


@kernel(borrow=True)
def finish(ints, floats, poses, shapes, g):
    """World pose of shape *g*, composed on demand."""
    if shapes[g, DONE] == 0.0:
        compose(poses[ints[g, 3]], floats[g, 8:20], shapes[g])
        shapes[g, DONE] = 1.0


@kernel(borrow=True)
def ball_to_box(floats, shapes, a, b):
    """Distance between the bounding sphere of shape *a* and the oriented box of shape *b*: a lower bound."""
    T, C = shapes[b], shapes[a]
    x, y, z = C[CENTRE] - T[9], C[CENTRE + 1] - T[10], C[CENTRE + 2] - T[11]
    dx = max(abs(T[0] * x + T[3] * y + T[6] * z) - floats[b, 20], 0.0)
    dy = max(abs(T[1] * x + T[4] * y + T[7] * z) - floats[b, 21], 0.0)
    dz = max(abs(T[2] * x + T[5] * y + T[8] * z) - floats[b, 22], 0.0)
    return math.sqrt(dx * dx + dy * dy + dz * dz) - floats[a, 7]


@kernel(borrow=True)
def ball_to_ball(floats, shapes, a, b):
    """Distance between the bounding spheres of two shapes."""
    x = shapes[a, CENTRE] - shapes[b, CENTRE]
    y = shapes[a, CENTRE + 1] - shapes[b, CENTRE + 1]
    z = shapes[a, CENTRE + 2] - shapes[b, CENTRE + 2]
    return math.sqrt(x * x + y * y + z * z) - floats[a, 7] - floats[b, 7]


@kernel(borrow=True)
def node_gap(nodes, balls, a, b):
    """Distance between the bounding spheres of two nodes."""
    x, y, z = balls[a, 0] - balls[b, 0], balls[a, 1] - balls[b, 1], balls[a, 2] - balls[b, 2]
    return math.sqrt(x * x + y * y + z * z) - nodes[a, 3] - nodes[b, 3]


@kernel(borrow=True)
def pair_gap(arrays, a, b, poses, shapes, memory, ws, big, stack, above, below, gap):
    """Bounds on the distance of shapes *a* and *b*: decided against *above* and *below*, or within a relative *gap*.

    The upper bound is meaningless when the lower one exceeds *above*. Overlapping cores count as touching.
    """
    ints, floats, points, graph, trees, grids = arrays
    low = ball_to_ball(floats, shapes, a, b)
    if low > above:
        return low, low
    finish(ints, floats, poses, shapes, b)
    low = ball_to_box(floats, shapes, a, b)
    if low > above:
        return low, low
    finish(ints, floats, poses, shapes, a)
    if ints[b, 0] >= HALF_SPACE:
        relative(shapes[a], shapes[b], ws[REL])
        return obstacle_gap(ints, floats, points, graph, trees, grids, a, b, ws, big, above, below, gap, stack)
    low = ball_to_box(floats, shapes, b, a)
    if low > above:
        return low, low
    grown = floats[a, 3] + floats[b, 3]
    relative(shapes[a], shapes[b], ws[REL])
    for c in range(5):
        ws[AXIS, c] = memory[c]
    _, lower, upper = gjk(ints, floats, points, graph, a, b, ws, above + grown, below + grown, gap)
    for c in range(5):
        memory[c] = ws[AXIS, c]
    return lower - grown, upper - grown


@kernel(borrow=True)
def block_hit(model, space, block, margin):
    """The first pair of shapes of a block that is nearer than or at *margin*, or −1."""
    pairs, arrays, poses, shapes = model.pairs, model.shapes, space.poses, space.shapes
    memory, ws, big, stack = space.memory, space.ws, space.big, space.stack
    for p in range(model.blocks[block, 2], model.blocks[block, 3]):
        a, b = pairs[p, 0], pairs[p, 1]
        lower, upper = pair_gap(arrays, a, b, poses, shapes, memory[p], ws, big, stack, margin, margin, 1e-12)
        if not lower > margin and upper <= margin:
            return p
    return -1


@kernel(borrow=True)
def first_hit(model, q, margin, space):
    """The first pair of shapes that is nearer than or at *margin* at ``q (n,)``, or −1."""
    blocks, nodes, balls = model.blocks, model.nodes, space.balls
    place(model, q, space)
    for block in range(blocks.shape[0]):
        if node_gap(nodes, balls, blocks[block, 0], blocks[block, 1]) <= margin:
            found = block_hit(model, space, block, margin)
            if found >= 0:
                return found
    return -1


@kernel
def check(model, q, margin, start, stop, out):
    """``out[i]`` = colliding pair of ``q[i]`` or −1."""
    space = make_space(model)
    for i in range(start, stop):
        out[i] = first_hit(model, q[i], margin, space)


@kernel
def count_hits(model, q, margin, start, stop, hits):
    """``hits (B,)``: in how many of ``q[start:stop]`` each block touches."""
    space = make_space(model)
    blocks, nodes, balls = model.blocks, model.nodes, space.balls
    for i in range(start, stop):
        place(model, q[i], space)
        for block in range(blocks.shape[0]):
            if node_gap(nodes, balls, blocks[block, 0], blocks[block, 1]) <= margin:
                hits[block] += 1 if block_hit(model, space, block, margin) >= 0 else 0


@kernel
def block_rates(model, qa, qb, rate):
    """How fast the nodes of every block can approach each other along ``qa → qb``, per unit of the whole motion."""
    links, joints, nodes, blocks = model.links, model.joints, model.nodes, model.blocks
    m = links.shape[0]
    moved = np.empty(m)
    for i in range(m):
        moved[i] = abs(joints[i, 12] * (qb[links[i, 2]] - qa[links[i, 2]]))
    for block in range(blocks.shape[0]):
        a, b = blocks[block, 0], blocks[block, 1]
        total = 0.0
        for i in range(m):
            if blocks[block, 4 + i] == 0:
                total += moved[i] * (nodes[a, 5 + i] + nodes[b, 5 + i])
        rate[block] = total


@kernel(borrow=True)
def covered(model, space, rate, margin, resolution, wanted):
    """Part of a motion around the placed configuration that is certainly free, at most *wanted*; negative: a hit.

    A hit is answered as −1 − pair.
    """
    pairs, arrays, poses, shapes = model.pairs, model.shapes, space.poses, space.shapes
    memory, ws, big, stack = space.memory, space.ws, space.big, space.stack
    blocks, nodes, balls = model.blocks, model.nodes, space.balls
    radius = wanted
    space.used[0] = 1.0
    for block in range(blocks.shape[0]):
        speed = rate[block]
        need = margin + radius * speed
        if node_gap(nodes, balls, blocks[block, 0], blocks[block, 1]) > need:
            continue
        for p in range(blocks[block, 2], blocks[block, 3]):
            a, b = pairs[p, 0], pairs[p, 1]
            lower, upper = pair_gap(arrays, a, b, poses, shapes, memory[p], ws, big, stack, need, margin, 0.2)
            if lower > need:
                continue
            if upper <= margin:
                return -1.0 - p
            if speed > 0.0:
                radius = min(radius, max(lower - margin, resolution) / speed)
                need = margin + radius * speed
    return radius


@kernel(borrow=True)
def measure(model, p, space, out, best, within):
    """Signed distance of pair *p* and whether ``out (9,)`` was written: only when it is below *best* and *within*.

    ``out``: the witness points on both shapes and the unit normal from the second to the first, in the world.
    """
    ints, floats, points, graph, trees, grids = model.shapes
    poses, shapes, memory = space.poses, space.shapes, space.memory
    ws, big, stack = space.ws, space.big, space.stack
    a, b = model.pairs[p, 0], model.pairs[p, 1]
    space.used[0] = 1.0
    enough = max(min(best, within), 0.0)
    lower, _ = pair_gap(model.shapes, a, b, poses, shapes, memory[p], ws, big, stack, enough, -1.0, 1e-3)
    if lower > enough:
        return lower, False
    finish(ints, floats, poses, shapes, a)
    finish(ints, floats, poses, shapes, b)
    relative(shapes[a], shapes[b], ws[REL])
    ws[AXIS, 3], ws[AXIS, 4] = 0.0, 0.0
    d = any_distance(ints, floats, points, graph, trees, grids, a, b, ws, big, best, stack)
    if d >= best:
        return d, False
    report(shapes[a], ws, out)
    return d, True


@kernel
def distances(model, q, every, start, stop, distance, pair, out):
    """Smallest signed distance over all pairs for every row of ``q``, its pair, and ``out (N, 9)`` as in `measure`.

    What is remembered of pairs serves *every* so many rows, here and below.
    """
    space = make_space(model)
    blocks, nodes, balls = model.blocks, model.nodes, space.balls
    for i in range(start, stop):
        if i % every == 0:
            forget(space)
        place(model, q[i], space)
        best, found = 1e300, -1
        for block in range(blocks.shape[0]):
            if node_gap(nodes, balls, blocks[block, 0], blocks[block, 1]) >= best:
                continue
            for p in range(blocks[block, 2], blocks[block, 3]):
                d, written = measure(model, p, space, out[i], best, 1e300)
                if written:
                    best, found = d, p
        distance[i], pair[i] = best, found


@kernel
def block_distances(model, q, within, every, start, stop, distance, pair, out):
    """The same for every block: ``distance, pair (N, B)``, ``out (N, B, 9)``.

    Blocks farther apart than *within* get a lower bound above it, and −1 as their pair.
    """
    space = make_space(model)
    blocks, nodes, balls = model.blocks, model.nodes, space.balls
    for i in range(start, stop):
        if i % every == 0:
            forget(space)
        place(model, q[i], space)
        for block in range(blocks.shape[0]):
            gap = node_gap(nodes, balls, blocks[block, 0], blocks[block, 1])
            distance[i, block], pair[i, block] = gap, -1
            if gap > within:
                continue
            best, least = 1e300, 1e300
            for p in range(blocks[block, 2], blocks[block, 3]):
                d, written = measure(model, p, space, out[i, block], best, within)
                least = min(least, d)
                if written:
                    best, pair[i, block] = d, p
            distance[i, block] = least


@kernel
def gradients(model, q, pair, points, start, stop, out):
    """Derivatives ``out (N, n)`` of the distances of `distances`, whose pairs and ``points (N, 9)`` are given.

    ∂d/∂q = nᵀ (J_a(p_a) − J_b(p_b)) with the witness points fixed to their shapes and the normal n from b to a.
    """
    links, joints, ints, pairs = model.links, model.joints, model.shapes.ints, model.pairs
    poses = np.zeros((links.shape[0], 12))
    for i in range(start, stop):
        for j in range(q.shape[1]):
            out[i, j] = 0.0
        if pair[i] < 0:
            continue
        move_joints(links, joints, q[i], poses)
        nx, ny, nz = points[i, 6], points[i, 7], points[i, 8]
        for side in range(2):
            sign = 1.0 - 2.0 * side
            joint = ints[pairs[pair[i], side], 3]
            while joint >= 0:
                T = poses[joint]
                zx, zy, zz = T[2], T[5], T[8]
                vx, vy, vz = zx, zy, zz
                if links[joint, 1] == 0:
                    x, y, z = (
                        points[i, 3 * side] - T[9],
                        points[i, 3 * side + 1] - T[10],
                        points[i, 3 * side + 2] - T[11],
                    )
                    vx, vy, vz = zy * z - zz * y, zz * x - zx * z, zx * y - zy * x
                out[i, links[joint, 2]] += sign * joints[joint, 12] * (nx * vx + ny * vy + nz * vz)
                joint = links[joint, 0]
