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
from .lanes import LANES, fma
from .sphere_near import BOX, CYLINDER, at, mark_near, near, near_node, to_box, to_cylinder, to_grid, to_spheres
from .vector import floor, load, select, some, splat, store

WHOLE_TURNS = 1e4  # joint values above this, in rad, are left to the exact check: lanes reduce angles to 1e5 only


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
    ready: np.ndarray  # (K,) int64: what is in place of a node: 0 nothing, 1 the ball around it, 2 its spheres
    order: np.ndarray  # (C + B,) int64: rows of ``meets``, and C + rows of ``selves``: what was hit last comes first


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
        np.arange(model.meets.shape[0] + model.selves.shape[0]),
    )


@kernel(borrow=True, splice=True)
def sine_cosine(x):
    """As `lanes.sincos`, of sixteen angles in registers."""
    k = floor(x * 0.6366197723675814 + 0.5)
    r = fma(-k, splat(1.5707963267341256), x)
    r = fma(-k, splat(6.077100506303966e-11), r)
    r = fma(-k, splat(2.0222662487959506e-21), r)
    z = r * r
    s = z * 1.58969099521155010221e-10 + -2.50507602534068634195e-08
    s = s * z + 2.75573137070700676789e-06
    s = s * z + -1.98412698298579493134e-04
    s = s * z + 8.33333333332248946124e-03
    s = s * z + -1.66666666666666324348e-01
    s = r + r * z * s
    c = z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09
    c = c * z + -2.75573143513906633035e-07
    c = c * z + 2.48015872894767294178e-05
    c = c * z + -1.38888888888741095749e-03
    c = c * z + 4.16666666666666019037e-02
    c = 1.0 - 0.5 * z + z * z * c
    half = floor(0.5 * k)
    odd = k - 2.0 * half
    sign = 1.0 - 2.0 * (half - 2.0 * floor(0.5 * half))
    swap = odd > 0.5
    return sign * select(swap, c, s), sign * (1.0 - 2.0 * odd) * select(swap, s, c)


@kernel(borrow=True)
def turn_lanes(joint, q, d, P, T):
    """Frames ``T (12 LANES,)`` of a revolute joint from those of its parent; its values are in ``q`` from *d* on."""
    L = LANES
    s, c = sine_cosine(joint[12] * load(q, d) + joint[13])
    for k in range(3):
        r = 3 * k * L
        p0, p1, p2 = load(P, r), load(P, r + L), load(P, r + 2 * L)
        u = p0 * joint[0] + p1 * joint[3] + p2 * joint[6]
        v = p0 * joint[1] + p1 * joint[4] + p2 * joint[7]
        t = (9 + k) * L
        store(T, r, u * c + v * s)
        store(T, r + L, v * c - u * s)
        store(T, r + 2 * L, p0 * joint[2] + p1 * joint[5] + p2 * joint[8])
        store(T, t, load(P, t) + p0 * joint[9] + p1 * joint[10] + p2 * joint[11])


@kernel(borrow=True)
def slide_lanes(joint, q, d, P, T):
    """As `turn_lanes`, for a prismatic joint."""
    L = LANES
    slide = joint[12] * load(q, d) + joint[13]
    for k in range(3):
        r = 3 * k * L
        p0, p1, p2 = load(P, r), load(P, r + L), load(P, r + 2 * L)
        w = p0 * joint[2] + p1 * joint[5] + p2 * joint[8]
        t = (9 + k) * L
        store(T, r, p0 * joint[0] + p1 * joint[3] + p2 * joint[6])
        store(T, r + L, p0 * joint[1] + p1 * joint[4] + p2 * joint[7])
        store(T, r + 2 * L, w)
        store(T, t, load(P, t) + p0 * joint[9] + p1 * joint[10] + p2 * joint[11] + slide * w)


@kernel(borrow=True)
def move_lanes(links, joints, q, poses):
    """Moved frames ``poses (m + 1, 12 LANES)`` of all joints; the last row is the world's frame."""
    for i in range(links.shape[0]):
        p = links[i, 0] if links[i, 0] >= 0 else links.shape[0]
        if links[i, 1] == 0:
            turn_lanes(joints[i], q, at(links[i, 2], 1), poses[p], poses[i])
        else:
            slide_lanes(joints[i], q, at(links[i, 2], 1), poses[p], poses[i])


@kernel(borrow=True, splice=True)
def carry_point(poses, carrier, x, y, z, out, k):
    """Point (x, y, z) of the moved frame *carrier* (−1: the world) into components 3k … 3k + 2 of *out*."""
    L = LANES
    P, t = poses[carrier], at(k, 3)
    for c in range(3):
        r = 3 * c * L
        moved = load(P, r) * x + load(P, r + L) * y + load(P, r + 2 * L) * z
        store(out, t + c * L, moved + load(P, (9 + c) * L))


@kernel(borrow=True, splice=True)
def ready_ball(model, own, k):
    """Put the ball around node *k* in place, once per block."""
    if own.ready[k] == 0:
        own.ready[k] = 1
        parts, nodes = model.parts, model.nodes
        carry_point(own.poses, parts[k, 0], nodes[k, 0], nodes[k, 1], nodes[k, 2], own.balls, k)


@kernel(borrow=True, splice=True)
def ready_node(model, own, k):
    """Put the spheres of node *k* in place, once per block."""
    if own.ready[k] < 2:
        own.ready[k] = 2
        parts, spheres = model.parts, model.spheres
        for s in range(parts[k, 1], parts[k, 2]):
            carry_point(own.poses, parts[k, 0], spheres[s, 0], spheres[s, 1], spheres[s, 2], own.centres, s)


@kernel(borrow=True, splice=True)
def count_flags(flags, row):
    """Number of lanes with a flag."""
    total = 0.0
    for lane in range(LANES):
        total += flags[row * LANES + lane]
    return int(total)


@kernel(borrow=True, splice=True)
def mark_fixed(model, own, k, o, rate, margin, resolution):
    """Mark the lanes in which spheres of node *k* are near fixed shape *o*; whether there are any."""
    parts, spheres, fixed, flags, centres = model.parts, model.spheres, model.fixed, own.flags, own.centres
    ready_node(model, own, k)
    found = False
    first, end = parts[k, 1], parts[k, 2]
    grown = margin + fixed[o, 15]
    if fixed[o, 16] == BOX:
        for s in range(first, end):
            found |= mark_near(to_box(fixed, o, centres, s), spheres[s, 3] + grown, rate, resolution, flags)
    elif fixed[o, 16] == CYLINDER:
        for s in range(first, end):
            found |= mark_near(to_cylinder(fixed, o, centres, s), spheres[s, 3] + grown, rate, resolution, flags)
    else:
        for s in range(first, end):
            to_grid(model, o, centres, s, flags)
            found |= mark_near(load(flags, 3 * LANES), spheres[s, 3] + margin, rate, resolution, flags)
    return found


@kernel(borrow=True, splice=True)
def near_nodes(model, own, a, b, rate, margin, resolution):
    """Whether the balls around two moving nodes may be near one another in any lane."""
    ready_ball(model, own, a)
    ready_ball(model, own, b)
    radius = model.nodes[a, 3] + model.nodes[b, 3] + margin
    return some(near(to_spheres(own.balls, a, own.balls, b), radius, rate, resolution, own.flags))


@kernel(borrow=True, splice=True)
def mark_selves(model, own, a, b, rate, margin, resolution):
    """Mark the lanes in which spheres of two moving nodes are near one another; whether there are any."""
    parts, spheres, nodes, flags = model.parts, model.spheres, model.nodes, own.flags
    ready_node(model, own, a)
    ready_node(model, own, b)
    found = False
    for i in range(parts[a, 1], parts[a, 2]):
        radius = spheres[i, 3] + nodes[b, 3] + margin
        if some(near(to_spheres(own.centres, i, own.balls, b), radius, rate, resolution, flags)):
            for j in range(parts[b, 1], parts[b, 2]):
                radius = spheres[i, 3] + spheres[j, 3] + margin
                found |= mark_near(to_spheres(own.centres, i, own.centres, j), radius, rate, resolution, flags)
    return found


@kernel(borrow=True, splice=True)
def come_first(order, i):
    """Move entry *i* to the front."""
    c = order[i]
    for j in range(i, 0, -1):
        order[j] = order[j - 1]
    order[0] = c


@kernel(borrow=True)
def hit_lanes(model, own, rates, margin, resolution, enough):
    """Hits of the sixteen configurations in ``own.q``: rows 0 (hard) and 1 (soft) of ``flags``.

    Soft hits are those of spheres grown by what *rates* move in half a piece (row 2 of ``flags``), unless that is less
    than *resolution*. Stops once *enough* lanes are hit hard; what hit them is asked first next time.
    """
    meets, selves, flags, order = model.meets, model.selves, own.flags, own.order
    B, C = selves.shape[0], meets.shape[0]
    move_lanes(model.links, model.joints, own.q, own.poses)
    own.ready[:] = 0
    for lane in range(2 * LANES):
        flags[lane] = 0.0
    for i in range(B + C):
        c = order[i]
        if c < C:
            k, o = meets[c, 0], meets[c, 1]
            rate = rates[B + k]
            ready_ball(model, own, k)
            close = near_node(model, own, k, o, rate, margin, resolution)
            if close:
                mark_fixed(model, own, k, o, rate, margin, resolution)
        else:
            a, b = selves[c - C, 0], selves[c - C, 1]
            rate = rates[c - C]
            close = near_nodes(model, own, a, b, rate, margin, resolution)
            if close:
                mark_selves(model, own, a, b, rate, margin, resolution)
        if close and count_flags(flags, 0) >= enough:
            come_first(order, i)
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
