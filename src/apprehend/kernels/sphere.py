"""Spheres on lanes: sixteen configurations of a robot at once against itself and what stands around it.

Every link is covered by spheres. Sixteen configurations lie side by side, so that the innermost loop is one vector
instruction. (Motions: `lane_edges`.)

Fixed shapes are boxes or cylinders grown by a radius (a sphere is a grown point, a capsule a grown segment),
half-spaces, and grids: a table of lower bounds on the distance to a cloud, a field or a union, one for each cell. For
other shapes the box around them stands in. A model *decides* when its spheres and fixed shapes are the exact geometry;
otherwise "free" is certain and the rest is left to the exact check.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .lanes import LANES, sincos
from .sphere_near import HALF_SPACE, at, near_fixed, near_grid, near_sphere


class SphereModel(NamedTuple):
    """Arrays: m joints, S spheres, K nodes, B pairs of nodes, O fixed shapes, C pairs of a node and a fixed shape."""

    links: np.ndarray  # (m, 3) int64: parent, kind, coordinate
    joints: np.ndarray  # (m, 14): place, multiplier, offset
    spheres: np.ndarray  # (S, 4): centre in the carrier, radius; sorted by node
    nodes: np.ndarray  # (K, 5 + m): bounding sphere, (unused), farthest motion per unit of each joint
    parts: np.ndarray  # (K, 3) int64: carrier, first sphere, end
    selves: np.ndarray  # (B, 2 + m) int64: node, node, whether a joint carries both
    fixed: np.ndarray  # (O, 17): pose (12), half extents or radius and half length (3), growing radius, kind; a grid:
    #  pose of its corner, cells per m, first cell, unused, the share by which bounds shrink with distance, kind
    meets: np.ndarray  # (C, 4) int64: node, fixed shape, the first pair of exact shapes that it stands for, from one
    #  such pair to the next
    owns: np.ndarray  # (K, 2) int64: first exact shape, end
    ranges: np.ndarray  # (B, 2) int64: first pair of exact shapes, end
    exactly: np.ndarray  # (C + B,) int64: whether the spheres of a row of ``meets`` or ``selves`` are the exact shapes
    decides: np.ndarray  # (1,) int64
    shapes: np.ndarray  # (O, 3) int64: cells of a grid along its axes
    cells: np.ndarray  # float32: least distances of the points of each cell


class SphereSpace(NamedTuple):
    """Scratch of one thread; lane buffers are flat, component c of lane l at ``c * LANES + l``."""

    q: np.ndarray  # n components
    poses: np.ndarray  # (m + 1, 12 LANES), the world's frame last
    balls: np.ndarray  # 3 K
    centres: np.ndarray  # 3 S
    flags: np.ndarray  # 4 rows of LANES: hard hits, soft hits, half width of the pieces, scratch
    ready: np.ndarray  # (K,) int64: whether the centres of a node are in place


@kernel
def sphere_space(model, n):
    """Fresh scratch."""
    K, S, m = model.parts.shape[0], model.spheres.shape[0], model.links.shape[0]
    poses = np.zeros((m + 1, 12 * LANES))
    for k in (0, 4, 8):
        for lane in range(LANES):
            poses[m, k * LANES + lane] = 1.0
    return SphereSpace(
        np.zeros(n * LANES),
        poses,
        np.empty(3 * K * LANES),
        np.empty(3 * S * LANES),
        np.zeros(4 * LANES),
        np.zeros(K, np.int64),
    )


@kernel(borrow=True)
def turn_lanes(joint, q, d, P, T):
    """Frames ``T (12 LANES,)`` of a revolute joint from those of its parent; its values are in ``q`` from *d* on."""
    L = LANES
    m, o = joint[12], joint[13]
    a0, a1, a2, a3, a4, a5 = joint[0], joint[1], joint[2], joint[3], joint[4], joint[5]
    a6, a7, a8, x, y, z = joint[6], joint[7], joint[8], joint[9], joint[10], joint[11]
    for lane in range(L):
        s, c = sincos(m * q[d + lane] + o)
        p0, p1, p2 = P[lane], P[L + lane], P[2 * L + lane]
        u, v = p0 * a0 + p1 * a3 + p2 * a6, p0 * a1 + p1 * a4 + p2 * a7
        T[lane] = u * c + v * s
        T[L + lane] = v * c - u * s
        T[2 * L + lane] = p0 * a2 + p1 * a5 + p2 * a8
        T[9 * L + lane] = P[9 * L + lane] + p0 * x + p1 * y + p2 * z
        p0, p1, p2 = P[3 * L + lane], P[4 * L + lane], P[5 * L + lane]
        u, v = p0 * a0 + p1 * a3 + p2 * a6, p0 * a1 + p1 * a4 + p2 * a7
        T[3 * L + lane] = u * c + v * s
        T[4 * L + lane] = v * c - u * s
        T[5 * L + lane] = p0 * a2 + p1 * a5 + p2 * a8
        T[10 * L + lane] = P[10 * L + lane] + p0 * x + p1 * y + p2 * z
        p0, p1, p2 = P[6 * L + lane], P[7 * L + lane], P[8 * L + lane]
        u, v = p0 * a0 + p1 * a3 + p2 * a6, p0 * a1 + p1 * a4 + p2 * a7
        T[6 * L + lane] = u * c + v * s
        T[7 * L + lane] = v * c - u * s
        T[8 * L + lane] = p0 * a2 + p1 * a5 + p2 * a8
        T[11 * L + lane] = P[11 * L + lane] + p0 * x + p1 * y + p2 * z


@kernel(borrow=True)
def slide_lanes(joint, q, d, P, T):
    """As `turn_lanes`, for a prismatic joint."""
    L = LANES
    m, o = joint[12], joint[13]
    a0, a1, a2, a3, a4, a5 = joint[0], joint[1], joint[2], joint[3], joint[4], joint[5]
    a6, a7, a8, x, y, z = joint[6], joint[7], joint[8], joint[9], joint[10], joint[11]
    for k in range(3):
        r = 3 * k * L
        for lane in range(L):
            p0, p1, p2 = P[r + lane], P[r + L + lane], P[r + 2 * L + lane]
            w = p0 * a2 + p1 * a5 + p2 * a8
            T[r + lane] = p0 * a0 + p1 * a3 + p2 * a6
            T[r + L + lane] = p0 * a1 + p1 * a4 + p2 * a7
            T[r + 2 * L + lane] = w
            moved = P[(9 + k) * L + lane] + p0 * x + p1 * y + p2 * z
            T[(9 + k) * L + lane] = moved + (m * q[d + lane] + o) * w


@kernel(borrow=True)
def move_lanes(links, joints, q, poses):
    """Moved frames ``poses (m + 1, 12 LANES)`` of all joints; the last row is the world's frame."""
    for i in range(links.shape[0]):
        p = links[i, 0] if links[i, 0] >= 0 else links.shape[0]
        if links[i, 1] == 0:
            turn_lanes(joints[i], q, at(links[i, 2], 1), poses[p], poses[i])
        else:
            slide_lanes(joints[i], q, at(links[i, 2], 1), poses[p], poses[i])


@kernel(borrow=True)
def carry_point(poses, carrier, x, y, z, out, k):
    """Point (x, y, z) of the moved frame *carrier* (−1: the world) into components 3k … 3k + 2 of *out*."""
    L = LANES
    P, t = poses[carrier], at(k, 3)
    for c in range(3):
        r = 3 * c * L
        for lane in range(L):
            moved = P[r + lane] * x + P[r + L + lane] * y + P[r + 2 * L + lane] * z
            out[t + c * L + lane] = moved + P[(9 + c) * L + lane]


@kernel(borrow=True)
def ready_node(parts, spheres, poses, centres, ready, k):
    """Put the spheres of node *k* in place, once per block."""
    if ready[k] == 0:
        ready[k] = 1
        for s in range(parts[k, 1], parts[k, 2]):
            carry_point(poses, parts[k, 0], spheres[s, 0], spheres[s, 1], spheres[s, 2], centres, s)


@kernel(borrow=True)
def count_flags(flags, row):
    """Number of lanes with a flag."""
    total = 0.0
    for lane in range(LANES):
        total += flags[row * LANES + lane]
    return int(total)


@kernel(borrow=True)
def hit_lanes(model, space, rates, margin, resolution, enough):
    """Hits of the sixteen configurations in ``space.q``: rows 0 (hard) and 1 (soft) of ``flags``.

    Soft hits are those of spheres grown by what *rates* move in half a piece (row 2 of ``flags``), unless that is less
    than *resolution*. Stops once *enough* lanes are hit hard.
    """
    parts, spheres, nodes = model.parts, model.spheres, model.nodes
    fixed, meets, selves = model.fixed, model.meets, model.selves
    poses, balls, centres, ready = space.poses, space.balls, space.centres, space.ready
    flags = space.flags
    B = selves.shape[0]
    move_lanes(model.links, model.joints, space.q, poses)
    for k in range(parts.shape[0]):
        ready[k] = 0
        carry_point(poses, parts[k, 0], nodes[k, 0], nodes[k, 1], nodes[k, 2], balls, k)
    for lane in range(2 * LANES):
        flags[lane] = 0.0
    for c in range(meets.shape[0]):
        k, o = meets[c, 0], meets[c, 1]
        rate = rates[B + k]
        if fixed[o, 16] >= HALF_SPACE:
            if near_grid(model, o, balls, k, nodes[k, 3] + margin, rate, resolution, flags, False):
                ready_node(parts, spheres, poses, centres, ready, k)
                for s in range(parts[k, 1], parts[k, 2]):
                    near_grid(model, o, centres, s, spheres[s, 3] + margin, rate, resolution, flags, True)
                if count_flags(flags, 0) >= enough:
                    return
        elif near_fixed(fixed, o, balls, k, nodes[k, 3] + margin, rate, resolution, flags, False):
            ready_node(parts, spheres, poses, centres, ready, k)
            for s in range(parts[k, 1], parts[k, 2]):
                near_fixed(fixed, o, centres, s, spheres[s, 3] + margin, rate, resolution, flags, True)
            if count_flags(flags, 0) >= enough:
                return
    for p in range(B):
        a, b = selves[p, 0], selves[p, 1]
        rate = rates[p]
        if near_sphere(balls, a, balls, b, nodes[a, 3] + nodes[b, 3] + margin, rate, resolution, flags, False):
            ready_node(parts, spheres, poses, centres, ready, a)
            ready_node(parts, spheres, poses, centres, ready, b)
            for i in range(parts[a, 1], parts[a, 2]):
                reach = spheres[i, 3] + nodes[b, 3] + margin
                if near_sphere(centres, i, balls, b, reach, rate, resolution, flags, False):
                    for j in range(parts[b, 1], parts[b, 2]):
                        radius = spheres[i, 3] + spheres[j, 3] + margin
                        near_sphere(centres, i, centres, j, radius, rate, resolution, flags, True)
            if count_flags(flags, 0) >= enough:
                return


@kernel
def check_lanes(model, q, margin, start, stop, out):
    """``out[i]``: 1 where some spheres of ``q[i]`` meet, else 0."""
    n = q.shape[1]
    space = sphere_space(model, n)
    flags, lanes, still = space.flags, space.q, np.zeros(model.selves.shape[0] + model.parts.shape[0])
    for first in range(start, stop, LANES):
        for lane in range(LANES):
            row = min(first + lane, stop - 1)
            for j in range(n):
                lanes[j * LANES + lane] = q[row, j]
        hit_lanes(model, space, still, margin, 0.0, LANES)
        for lane in range(min(LANES, stop - first)):
            out[first + lane] = int(flags[lane])
