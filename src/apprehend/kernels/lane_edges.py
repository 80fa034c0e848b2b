"""Straight motions in joint space: sixteen pieces at a time on lanes, exact shapes where spheres do not decide.

A motion is cut into pieces; a piece is free if nothing in its middle is nearer than what can be moved in half of it.
Spheres on lanes clear nearly all; for the pairs of nodes that they leave open the exact shapes are asked, and the plane
that separates them bounds for how much of the motion they stay apart (`lane_exact`).
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .collide import make_space
from .lane_exact import QUEUE, EdgeSpace, settle
from .lanes import LANES
from .sphere import (
    come_first,
    count_flags,
    hit_lanes,
    mark_fixed,
    mark_selves,
    move_lanes,
    near_nodes,
    ready_ball,
    sphere_space,
)
from .sphere_near import HALF_SPACE, at, near_node

DEEP = QUEUE - 1024
"""With more pieces than this the last ones come first, so that the queue never overflows."""


@kernel
def motion_weights(model):
    """What each joint adds to the rates of `motion_rates`, per unit of its speed."""
    nodes, selves = model.nodes, model.selves
    m, B, K = model.links.shape[0], selves.shape[0], nodes.shape[0]
    weights = np.zeros((m, B + K))
    for i in range(m):
        for p in range(B):
            if selves[p, 2 + i] == 0:
                weights[i, p] = nodes[selves[p, 0], 5 + i] + nodes[selves[p, 1], 5 + i]
        for k in range(K):
            weights[i, B + k] = nodes[k, 5 + i]
    return weights


@kernel
def edge_space(exact, lanes, n):
    """Fresh scratch."""
    K, m, B = lanes.parts.shape[0], lanes.links.shape[0], lanes.selves.shape[0]
    return EdgeSpace(
        make_space(exact), sphere_space(lanes, n), np.empty((K, 4)), np.zeros(LANES), np.zeros(LANES),
        np.zeros(B + K), np.empty(m), np.zeros(1), np.empty((QUEUE, 2)), motion_weights(lanes),
    )  # fmt: skip


@kernel(borrow=True)
def motion_rates(model, qa, qb, space):
    """How fast pairs of nodes, and nodes and the world, can approach along ``qa → qb``, per unit of the motion."""
    links, joints, weights, rates, speed = model.links, model.joints, space.weights, space.rates, space.speed
    turning = 0.0
    rates[:] = 0.0
    for i in range(links.shape[0]):
        speed[i] = joints[i, 12] * (qb[links[i, 2]] - qa[links[i, 2]])
        s = abs(speed[i])
        if s > 0.0:
            turning += s if links[i, 1] == 0 else 0.0
            for p in range(rates.shape[0]):
                rates[p] += s * weights[i, p]
    space.turning[0] = turning


@kernel(borrow=True)
def bound(balls, k, radius, out):
    """A ball around the balls of *radius* about the centres of node *k*."""
    L = LANES
    t = at(k, 3)
    total = 0.0
    for c in range(3):
        low, high = balls[t + c * L], balls[t + c * L]
        for lane in range(L):
            low = min(low, balls[t + c * L + lane])
            high = max(high, balls[t + c * L + lane])
        out[k, c] = 0.5 * (low + high)
        total += (high - low) ** 2
    out[k, 3] = 0.5 * math.sqrt(total) + radius


@kernel(borrow=True)
def may_meet(bounds, k, fixed, o, more):
    """Whether the ball around node *k*, grown by *more*, meets the box around a fixed shape."""
    px, py, pz = bounds[k, 0] - fixed[o, 9], bounds[k, 1] - fixed[o, 10], bounds[k, 2] - fixed[o, 11]
    dx = max(abs(fixed[o, 0] * px + fixed[o, 3] * py + fixed[o, 6] * pz) - fixed[o, 12], 0.0)
    dy = max(abs(fixed[o, 1] * px + fixed[o, 4] * py + fixed[o, 7] * pz) - fixed[o, 13], 0.0)
    dz = max(abs(fixed[o, 2] * px + fixed[o, 5] * py + fixed[o, 8] * pz) - fixed[o, 14], 0.0)
    reach = bounds[k, 3] + fixed[o, 15] + more
    return dx * dx + dy * dy + dz * dz <= reach * reach


@kernel(borrow=True)
def clear_marks(flags):
    """No lane is marked."""
    for lane in range(2 * LANES):
        flags[lane] = 0.0


@kernel(borrow=True)
def note(state, flags):
    """Merge the marks of a pair whose spheres are exact into the state of the lanes; whether any lane is hit."""
    hit = 0.0
    for lane in range(LANES):
        state[lane] = max(state[lane], flags[lane] + flags[LANES + lane])
        hit = max(hit, flags[lane])
    return hit > 0.0


@kernel(borrow=True)
def block_hit(model, lanes, space, margin, resolution):
    """Whether any lane hits something; if not, ``state`` says which pieces are open."""
    nodes, owns, own = lanes.nodes, lanes.owns, space.lanes
    meets, selves, exactly, fixed = lanes.meets, lanes.selves, lanes.exactly, lanes.fixed
    flags, state, order, bounds, rates = own.flags, space.state, own.order, space.bounds, space.rates
    B, C = selves.shape[0], meets.shape[0]
    none, one = np.int64(-1), np.int64(1)  # as literals they would be types of their own, and compile everything twice
    move_lanes(lanes.links, lanes.joints, own.q, own.poses)
    widest = 0.0
    for lane in range(LANES):
        widest = max(widest, flags[2 * LANES + lane])
        state[lane] = 0.0
    for k in range(nodes.shape[0]):
        own.ready[k] = 0
        ready_ball(lanes, own, k)
        bound(own.balls, k, nodes[k, 3] + margin, bounds)
    for i in range(B + C):
        c = order[i]
        if c < C:
            k, o = meets[c, 0], meets[c, 1]
            rate = rates[B + k]
            if fixed[o, 16] < HALF_SPACE and not may_meet(bounds, k, fixed, o, rate * widest):
                continue
            if not near_node(lanes, own, k, o, rate, margin, resolution):
                continue
            clear_marks(flags)
            if not mark_fixed(lanes, own, k, o, rate, margin, resolution):
                continue
            if exactly[c]:
                touch = note(state, flags)
            else:
                count = owns[k, 1] - owns[k, 0]
                first, stride = meets[c, 2], meets[c, 3]
                touch = settle(model, lanes, space, k, none, none, first, stride, count, margin, rate, resolution)
        else:
            p = c - C
            a, b = selves[p, 0], selves[p, 1]
            rate = rates[p]
            x, y, z = bounds[a, 0] - bounds[b, 0], bounds[a, 1] - bounds[b, 1], bounds[a, 2] - bounds[b, 2]
            r = bounds[a, 3] + bounds[b, 3] + rate * widest
            if x * x + y * y + z * z > r * r or not near_nodes(lanes, own, a, b, rate, margin, resolution):
                continue
            clear_marks(flags)
            if not mark_selves(lanes, own, a, b, rate, margin, resolution):
                continue
            if exactly[c]:
                touch = note(state, flags)
            else:
                first, count = lanes.ranges[p, 0], lanes.ranges[p, 1] - lanes.ranges[p, 0]
                touch = settle(model, lanes, space, a, b, p, first, one, count, margin, rate, resolution)
        if touch:
            come_first(order, i)
            return True
    return False


@kernel(borrow=True)
def next_pieces(space, head, count):
    """Take up to sixteen pieces out of the queue, cut into equal parts where there are fewer of them.

    Returns the new head and count of the queue and the number of pieces; idle lanes repeat the first.
    """
    queue, middle, half = space.queue, space.middle, space.lanes.flags[2 * LANES : 3 * LANES]
    taken = min(count, LANES)
    parts = LANES // taken
    used = 0
    for i in range(taken):
        slot = (head + i) % QUEUE if count <= DEEP else (head + count - 1 - i) % QUEUE
        low, step = queue[slot, 0], (queue[slot, 1] - queue[slot, 0]) / parts
        for j in range(parts):
            middle[used] = low + (j + 0.5) * step
            half[used] = 0.5 * step + 1e-12
            used += 1
    for lane in range(used, LANES):
        middle[lane], half[lane] = middle[0], half[0]
    return (head + taken) % QUEUE if count <= DEEP else head, count - taken, used


@kernel(borrow=True)
def edge_blocked(exact, lanes, qa, qb, margin, resolution, space):
    """Whether the straight motion ``qa → qb`` hits anything.

    Pieces that are not certainly free are cut in two, down to movements of *resolution*; the coarse ones come first,
    since a hit ends the check.
    """
    motion_rates(lanes, qa, qb, space)
    queue, q, middle, half = space.queue, space.lanes.q, space.middle, space.lanes.flags[2 * LANES : 3 * LANES]
    decides = lanes.decides[0] == 1
    state = space.lanes.flags[LANES : 2 * LANES] if decides else space.state
    queue[0, 0], queue[0, 1] = 0.0, 1.0
    head, count = 0, 1
    while count > 0:
        head, count, used = next_pieces(space, head, count)
        for j in range(qa.shape[0]):
            a, d = qa[j], qb[j] - qa[j]
            t = at(j, 1)
            for lane in range(LANES):
                q[t + lane] = a + middle[lane] * d
        if decides:
            hit_lanes(lanes, space.lanes, space.rates, margin, resolution, 1)
            if count_flags(space.lanes.flags, 0) > 0:
                return True
        elif block_hit(exact, lanes, space, margin, resolution):
            return True
        for lane in range(used):
            if state[lane] > 0.0:
                slot = (head + count) % QUEUE
                queue[slot, 0], queue[slot, 1] = middle[lane] - half[lane], middle[lane]
                slot = (head + count + 1) % QUEUE
                queue[slot, 0], queue[slot, 1] = middle[lane], middle[lane] + half[lane]
                count += 2
    return False
