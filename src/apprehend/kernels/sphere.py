"""Spheres on lanes: sixteen configurations of a robot at once against itself and what stands around it.

Every link is covered by spheres. Sixteen configurations lie side by side, so that the innermost loop is one vector
instruction; they are independent ones, or the middles of sixteen pieces of one motion. In the latter case spheres
grow by what they can move in half a piece: what is then free is free all along the piece.

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

PIECES = 2048
"""Largest number of pieces of a motion that wait to be checked."""

BATCHES = 3
"""Batches of sixteen pieces after which a model that does not decide leaves the rest to the exact check."""


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
    meets: np.ndarray  # (C, 2) int64: node, fixed shape
    decides: np.ndarray  # (1,) int64
    shapes: np.ndarray  # (O, 3) int64: cells of a grid along its axes
    cells: np.ndarray  # float32: least distances of the points of each cell


class SphereSpace(NamedTuple):
    """Scratch of one thread; lane buffers are flat, component c of lane l at ``c * LANES + l``."""

    q: np.ndarray  # n components
    poses: np.ndarray  # 12 m
    balls: np.ndarray  # 3 K
    centres: np.ndarray  # 3 S
    flags: np.ndarray  # 4 rows of LANES: hard hits, soft hits, half width of the pieces, scratch
    ready: np.ndarray  # (K,) int64: whether the centres of a node are in place
    rates: np.ndarray  # (B + K,): of pairs of nodes, of nodes against the world
    pieces: np.ndarray  # (PIECES, 2)
    split: np.ndarray  # (2, 2 LANES): pieces that were just cut in two


@kernel
def sphere_space(model, n):
    """Fresh scratch."""
    K, S = model.parts.shape[0], model.spheres.shape[0]
    return SphereSpace(
        np.zeros(n * LANES),
        np.empty(12 * model.links.shape[0] * LANES),
        np.empty(3 * K * LANES),
        np.empty(3 * S * LANES),
        np.zeros(4 * LANES),
        np.zeros(K, np.int64),
        np.zeros(model.selves.shape[0] + K),
        np.empty((PIECES, 2)),
        np.empty((2, 2 * LANES)),
    )


@kernel
def move_lanes(links, joints, q, poses):
    """Moved frames of all joints on lanes: ``poses`` has 12 components for each."""
    L = LANES
    for i in range(links.shape[0]):
        t = at(i, 12)
        if links[i, 0] < 0:
            for k in range(12):
                value = joints[i, k]
                for lane in range(L):
                    poses[t + k * L + lane] = value
        else:
            s = at(links[i, 0], 12)
            for k in range(3):
                for j in range(3):
                    x, y, z = joints[i, j], joints[i, 3 + j], joints[i, 6 + j]
                    for lane in range(L):
                        poses[t + (3 * k + j) * L + lane] = (
                            poses[s + 3 * k * L + lane] * x
                            + poses[s + (3 * k + 1) * L + lane] * y
                            + poses[s + (3 * k + 2) * L + lane] * z
                        )
                x, y, z = joints[i, 9], joints[i, 10], joints[i, 11]
                for lane in range(L):
                    poses[t + (9 + k) * L + lane] = (
                        poses[s + (9 + k) * L + lane]
                        + poses[s + 3 * k * L + lane] * x
                        + poses[s + (3 * k + 1) * L + lane] * y
                        + poses[s + (3 * k + 2) * L + lane] * z
                    )
        turn_or_slide(links[i, 1], joints[i, 12], joints[i, 13], q, links[i, 2], poses, i)


@kernel
def turn_or_slide(kind, multiplier, offset, q, coordinate, poses, i):
    """Move frame *i* by its joint: about its z (kind 0) or along it."""
    L = LANES
    t, d = at(i, 12), at(coordinate, 1)
    if kind == 0:
        for lane in range(L):
            s, c = sincos(multiplier * q[d + lane] + offset)
            for k in range(3):
                b0 = poses[t + 3 * k * L + lane]
                b1 = poses[t + (3 * k + 1) * L + lane]
                poses[t + 3 * k * L + lane] = b0 * c + b1 * s
                poses[t + (3 * k + 1) * L + lane] = b1 * c - b0 * s
    else:
        for lane in range(L):
            h = multiplier * q[d + lane] + offset
            for k in range(3):
                poses[t + (9 + k) * L + lane] += h * poses[t + (3 * k + 2) * L + lane]


@kernel
def carry_point(poses, carrier, x, y, z, out, k):
    """Point (x, y, z) of the moved frame *carrier* (−1: the world) into components 3k … 3k + 2 of *out*."""
    L = LANES
    t = at(k, 3)
    if carrier < 0:
        for lane in range(L):
            out[t + lane] = x
            out[t + L + lane] = y
            out[t + 2 * L + lane] = z
        return
    s = at(carrier, 12)
    for c in range(3):
        for lane in range(L):
            out[t + c * L + lane] = (
                poses[s + 3 * c * L + lane] * x
                + poses[s + (3 * c + 1) * L + lane] * y
                + poses[s + (3 * c + 2) * L + lane] * z
                + poses[s + (9 + c) * L + lane]
            )


@kernel
def ready_node(parts, spheres, poses, centres, ready, k):
    """Put the spheres of node *k* in place, once per block."""
    if ready[k] == 0:
        ready[k] = 1
        for s in range(parts[k, 1], parts[k, 2]):
            carry_point(poses, parts[k, 0], spheres[s, 0], spheres[s, 1], spheres[s, 2], centres, s)


@kernel
def count_flags(flags, row):
    """Number of lanes with a flag."""
    total = 0.0
    for lane in range(LANES):
        total += flags[row * LANES + lane]
    return int(total)


@kernel
def hit_lanes(model, space, margin, resolution, enough):
    """Hits of the sixteen configurations in ``space.q``: rows 0 (hard) and 1 (soft) of ``flags``.

    Stops once *enough* lanes are hit hard.
    """
    parts, spheres, nodes = model.parts, model.spheres, model.nodes
    fixed, meets, selves = model.fixed, model.meets, model.selves
    poses, balls, centres, ready = space.poses, space.balls, space.centres, space.ready
    flags, rates = space.flags, space.rates
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
    flags, lanes = space.flags, space.q
    for first in range(start, stop, LANES):
        for lane in range(LANES):
            row = min(first + lane, stop - 1)
            for j in range(n):
                lanes[j * LANES + lane] = q[row, j]
        hit_lanes(model, space, margin, 0.0, LANES)
        for lane in range(min(LANES, stop - first)):
            out[first + lane] = int(flags[lane])


@kernel
def motion_rates(model, qa, qb, rates):
    """How fast pairs of nodes, and nodes and the world, can approach along ``qa → qb``, per unit of the motion."""
    links, joints, nodes, selves = model.links, model.joints, model.nodes, model.selves
    m, B = links.shape[0], selves.shape[0]
    moved = np.empty(m)
    for i in range(m):
        moved[i] = abs(joints[i, 12] * (qb[links[i, 2]] - qa[links[i, 2]]))
    for p in range(B):
        total = 0.0
        for i in range(m):
            if selves[p, 2 + i] == 0:
                total += moved[i] * (nodes[selves[p, 0], 5 + i] + nodes[selves[p, 1], 5 + i])
        rates[p] = total
    for k in range(nodes.shape[0]):
        total = 0.0
        for i in range(m):
            total += moved[i] * nodes[k, 5 + i]
        rates[B + k] = total


@kernel
def edge_lanes(model, qa, qb, margin, resolution, space):
    """Check the straight motion ``qa → qb``: −1: hit (only where the model decides), else the number of open pieces.

    0 means free. Open pieces are in the first rows of ``space.pieces``: (begin, end) in 0 … 1.
    """
    n = qa.shape[0]
    decides = model.decides[0] == 1
    motion_rates(model, qa, qb, space.rates)
    pieces, flags, q = space.pieces, space.flags, space.q
    begin, end = space.split[0], space.split[1]
    count, open_count, batches = LANES, 0, 0
    for lane in range(LANES):  # the queue grows from the end of the array downwards, open pieces upwards
        slot = PIECES - 1 - lane
        pieces[slot, 0] = lane / LANES
        pieces[slot, 1] = (lane + 1) / LANES
    while count > 0:
        used = min(count, LANES)
        top = PIECES - count
        for lane in range(LANES):
            slot = top + min(lane, used - 1)
            middle = 0.5 * (pieces[slot, 0] + pieces[slot, 1])
            flags[2 * LANES + lane] = 0.5 * (pieces[slot, 1] - pieces[slot, 0]) + 1e-12
            for j in range(n):
                q[j * LANES + lane] = qa[j] + middle * (qb[j] - qa[j])
        hit_lanes(model, space, margin, resolution, 1 if decides else LANES)
        batches += 1
        if decides and count_flags(flags, 0) > 0:
            return -1
        if count_flags(flags, 1) == 0 and used == count:
            return open_count
        kept = count - used
        # what is still to do moves aside: split pieces are pushed on top of the rest
        fresh = 0
        for lane in range(used):
            slot = top + lane
            low, high = pieces[slot, 0], pieces[slot, 1]
            if flags[LANES + lane] == 0.0:
                continue
            if not decides and (flags[lane] > 0.0 or batches >= BATCHES):
                pieces[open_count, 0], pieces[open_count, 1] = low, high
                open_count += 1
                continue
            middle = 0.5 * (low + high)
            begin[fresh], end[fresh] = low, middle
            begin[fresh + 1], end[fresh + 1] = middle, high
            fresh += 2
        if open_count + kept + fresh > PIECES - 2 * LANES:  # never with sane limits: give up on lanes
            pieces[0, 0], pieces[0, 1] = 0.0, 1.0
            return -1 if decides else 1
        for i in range(fresh):
            slot = PIECES - kept - 1 - i
            pieces[slot, 0], pieces[slot, 1] = begin[i], end[i]
        count = kept + fresh
    return open_count


@kernel
def edges_lanes(model, qa, qb, margin, resolution, start, stop, out):
    """``out[i]``: what `edge_lanes` says about ``qa[i] → qb[i]``."""
    space = sphere_space(model, qa.shape[1])
    for i in range(start, stop):
        out[i] = edge_lanes(model, qa[i], qb[i], margin, resolution, space)
