"""Straight motions in joint space: sixteen pieces at a time on lanes, exact shapes where spheres do not decide.

A motion is cut into pieces; a piece is free if nothing in its middle is nearer than what can be moved in half of it.
Spheres on lanes clear nearly all; for the pairs of nodes that they leave open the exact shapes are asked, and the plane
that separates them bounds for how much of the motion they stay apart (`still_apart`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .collide import CENTRE, DONE, CollideSpace, make_space, pair_gap
from .gjk import AXIS, HALF_SPACE, difference
from .lanes import LANES
from .sphere import SphereSpace, carry_point, move_lanes, ready_node, sphere_space
from .sphere_near import HALF_SPACE as NO_BOX
from .sphere_near import at, near_fixed, near_grid, near_sphere

QUEUE = 4096
DEEP = QUEUE - 1024
"""With more pieces than this the last ones come first, so that the queue never overflows."""


class EdgeSpace(NamedTuple):
    """Scratch of one thread."""

    exact: CollideSpace
    lanes: SphereSpace
    bounds: np.ndarray  # (K, 4): a ball around the bounding spheres of a node in all lanes
    middle: np.ndarray  # (LANES,): middles of the pieces
    state: np.ndarray  # (LANES,): 0 free all along the piece, 1 open, 2 hit in the middle
    rates: np.ndarray  # (B + K,): of pairs of nodes, of nodes against the world
    speed: np.ndarray  # (m,): of the joints along the motion
    turning: np.ndarray  # (1,): sum of what revolute joints turn
    queue: np.ndarray  # (QUEUE, 2): begin and end of pieces
    order: np.ndarray  # (C,) int64: rows of ``meets``, the more often hit the earlier


@kernel
def edge_space(exact, lanes, n):
    """Fresh scratch."""
    K, m, B = lanes.parts.shape[0], lanes.links.shape[0], lanes.selves.shape[0]
    return EdgeSpace(
        make_space(exact), sphere_space(lanes, n), np.empty((K, 4)), np.zeros(LANES), np.zeros(LANES),
        np.zeros(B + K), np.empty(m), np.zeros(1), np.empty((QUEUE, 2)), np.arange(lanes.meets.shape[0]),
    )  # fmt: skip


@kernel
def motion_rates(model, qa, qb, rates, speed, turning):
    """How fast pairs of nodes, and nodes and the world, can approach along ``qa → qb``, per unit of the motion."""
    links, joints, nodes, selves = model.links, model.joints, model.nodes, model.selves
    m, B = links.shape[0], selves.shape[0]
    turning[0] = 0.0
    for i in range(m):
        speed[i] = joints[i, 12] * (qb[links[i, 2]] - qa[links[i, 2]])
        if links[i, 1] == 0:
            turning[0] += abs(speed[i])
    for p in range(B):
        a, b = selves[p, 0], selves[p, 1]
        total = 0.0
        for i in range(m):
            if selves[p, 2 + i] == 0:
                total += abs(speed[i]) * (nodes[a, 5 + i] + nodes[b, 5 + i])
        rates[p] = total
    for k in range(nodes.shape[0]):
        total = 0.0
        for i in range(m):
            total += abs(speed[i]) * nodes[k, 5 + i]
        rates[B + k] = total


@kernel
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


@kernel
def may_meet(bounds, k, fixed, o, more):
    """Whether the ball around node *k*, grown by *more*, meets the box around a fixed shape."""
    px, py, pz = bounds[k, 0] - fixed[o, 9], bounds[k, 1] - fixed[o, 10], bounds[k, 2] - fixed[o, 11]
    dx = max(abs(fixed[o, 0] * px + fixed[o, 3] * py + fixed[o, 6] * pz) - fixed[o, 12], 0.0)
    dy = max(abs(fixed[o, 1] * px + fixed[o, 4] * py + fixed[o, 7] * pz) - fixed[o, 13], 0.0)
    dz = max(abs(fixed[o, 2] * px + fixed[o, 5] * py + fixed[o, 8] * pz) - fixed[o, 14], 0.0)
    reach = bounds[k, 3] + fixed[o, 15] + more
    return dx * dx + dy * dy + dz * dz <= reach * reach


@kernel
def put_shapes(model, lanes, space, k, lane):
    """Put the exact shapes of node *k* where they are in one lane; their poses follow on demand."""
    L = LANES
    carrier = lanes.parts[k, 0]
    P, T = space.lanes.poses, space.exact.poses
    shapes, floats = space.exact.shapes, model.shapes.floats
    for c in range(12):
        T[carrier, c] = P[carrier, c * L + lane]
    for g in range(lanes.owns[k, 0], lanes.owns[k, 1]):
        x, y, z = floats[g, 4], floats[g, 5], floats[g, 6]
        for i in range(3):
            shapes[g, CENTRE + i] = (
                T[carrier, 3 * i] * x + T[carrier, 3 * i + 1] * y + T[carrier, 3 * i + 2] * z + T[carrier, 9 + i]
            )
        shapes[g, DONE] = 0.0


@kernel
def drift(lanes, space, carrier, both, lane, ball, r, nx, ny, nz):
    """Motion along the unit vector n of the *ball* on *carrier*: of its centre, and what turning adds.

    Per unit of the motion, in one lane; joints that carry both things (row *both* of ``selves``) do not count.
    """
    L = LANES
    links, selves, poses, speed = lanes.links, lanes.selves, space.lanes.poses, space.speed
    x, y, z = ball[CENTRE], ball[CENTRE + 1], ball[CENTRE + 2]
    along, wx, wy, wz = 0.0, 0.0, 0.0, 0.0
    j = carrier
    while j >= 0:
        if both < 0 or selves[both, 2 + j] == 0:
            v = speed[j]
            ax, ay, az = poses[j, 2 * L + lane], poses[j, 5 * L + lane], poses[j, 8 * L + lane]
            if links[j, 1] == 0:
                px, py, pz = x - poses[j, 9 * L + lane], y - poses[j, 10 * L + lane], z - poses[j, 11 * L + lane]
                along += v * (nx * (ay * pz - az * py) + ny * (az * px - ax * pz) + nz * (ax * py - ay * px))
                wx += v * ax
                wy += v * ay
                wz += v * az
            else:
                along += v * (nx * ax + ny * ay + nz * az)
        j = links[j, 0]
    cx, cy, cz = ny * wz - nz * wy, nz * wx - nx * wz, nx * wy - ny * wx
    return along, r * math.sqrt(cx * cx + cy * cy + cz * cz)


@kernel
def still_apart(model, lanes, space, a, b, both, lane, g, h, margin, rate):
    """For how much of the motion shapes *g* and *h* stay farther apart than *margin*, by the plane found last.

    The gap along its normal n is a lower bound of the distance. It shrinks by no more than V t + A t² / 2: V is the
    speed along n in this lane, and A = 2 S R bounds accelerations, S what all joints turn, R the bound *rate* on speeds.
    """
    ints, floats, points, graph = model.shapes.ints, model.shapes.floats, model.shapes.points, model.shapes.graph
    if ints[g, 0] >= HALF_SPACE or ints[h, 0] >= HALF_SPACE:
        return 0.0
    shapes, ws = space.exact.shapes, space.exact.ws
    vx, vy, vz = ws[AXIS, 0], ws[AXIS, 1], ws[AXIS, 2]
    norm = math.sqrt(vx * vx + vy * vy + vz * vz)
    if norm < 1e-12:
        return 0.0
    vx, vy, vz = vx / norm, vy / norm, vz / norm
    difference(ints, floats, points, graph, g, h, -vx, -vy, -vz, ws, ws[0])
    gap = vx * ws[0, 0] + vy * ws[0, 1] + vz * ws[0, 2] - floats[g, 3] - floats[h, 3] - margin
    if gap <= 0.0:
        return 0.0
    T = shapes[g]
    nx = T[0] * vx + T[1] * vy + T[2] * vz
    ny = T[3] * vx + T[4] * vy + T[5] * vz
    nz = T[6] * vx + T[7] * vy + T[8] * vz
    speed, turning = drift(lanes, space, lanes.parts[a, 0], both, lane, T, floats[g, 7], nx, ny, nz)
    if b >= 0:
        other, more = drift(lanes, space, lanes.parts[b, 0], both, lane, shapes[h], floats[h, 7], nx, ny, nz)
        speed -= other
        turning += more
    V = abs(speed) + turning
    return 2.0 * gap / (V + math.sqrt(V * V + 4.0 * space.turning[0] * rate * gap) + 1e-300)


@kernel
def middle_marked(marks):
    """The marked lane nearest to the middle of the marked range, or −1."""
    first, last = -1, -1
    for lane in range(LANES):
        if marks[lane] > 0.0:
            first = lane if first < 0 else first
            last = lane
    best = first
    for lane in range(max(first, 0), last + 1):
        if marks[lane] > 0.0 and abs(2 * lane - first - last) < abs(2 * best - first - last):
            best = lane
    return best


@kernel
def settle(model, lanes, space, a, b, both, first, stride, count, margin, rate, resolution, stop):
    """Ask the exact shapes of nodes *a* and *b* (−1: fixed) in the lanes that are marked; whether any of them touch.

    *count* pairs of shapes from *first* on, each *stride* after the last. What is known in one lane speaks for as much
    of the motion around it as the shapes need to meet. What stays open is noted in ``state``.
    """
    L = LANES
    pairs, arrays, poses, shapes = model.pairs, model.shapes, space.exact.poses, space.exact.shapes
    memory, ws, big, stack = space.exact.memory, space.exact.ws, space.exact.big, space.exact.stack
    flags, middle, state = space.lanes.flags, space.middle, space.state
    marks, half = flags[L : 2 * L], flags[2 * L : 3 * L]
    touched = False
    while True:
        lane = middle_marked(marks)
        if lane < 0:
            return touched
        marks[lane] = 0.0
        put_shapes(model, lanes, space, a, lane)
        if b >= 0:
            put_shapes(model, lanes, space, b, lane)
        need = margin + (rate * half[lane] if rate * half[lane] > resolution else 0.0)
        still = 1e300
        for i in range(count):
            p = first + i * stride
            g, h = pairs[p, 0], pairs[p, 1]
            lower, upper = pair_gap(arrays, g, h, poses, shapes, memory[p], ws, big, stack, need, margin, 0.05)
            if lower <= margin and upper <= margin:
                if stop:
                    return True
                touched = True
                state[lane] = 2.0
                still = -1.0
                break
            if rate > 0.0:
                t = (lower - margin) / rate
                if lower <= need and t < still:
                    t = max(t, still_apart(model, lanes, space, a, b, both, lane, g, h, margin, rate))
                still = min(still, t)
        if still < 0.0:
            continue
        if still < half[lane] and rate * half[lane] > resolution:
            state[lane] = max(state[lane], 1.0)
        for i in range(L):
            if abs(middle[i] - middle[lane]) + half[i] <= still:
                marks[i] = 0.0


@kernel
def clear_marks(flags):
    """No lane is marked."""
    for lane in range(2 * LANES):
        flags[lane] = 0.0


@kernel
def marked_fixed(lanes, space, k, o, rate, margin, resolution):
    """Mark the lanes in which spheres of node *k* may meet fixed shape *o*; whether there are any."""
    parts, spheres, nodes, fixed, own = lanes.parts, lanes.spheres, lanes.nodes, lanes.fixed, space.lanes
    flags, balls, centres = own.flags, own.balls, own.centres
    grid = fixed[o, 16] >= NO_BOX
    radius = nodes[k, 3] + margin
    if grid:
        near = near_grid(lanes, o, balls, k, radius, rate, resolution, flags, False)
    else:
        near = near_fixed(fixed, o, balls, k, radius, rate, resolution, flags, False)
    if not near:
        return False
    ready_node(parts, spheres, own.poses, centres, own.ready, k)
    clear_marks(flags)
    near = False
    for s in range(parts[k, 1], parts[k, 2]):
        radius = spheres[s, 3] + margin
        if grid:
            near |= near_grid(lanes, o, centres, s, radius, rate, resolution, flags, True)
        else:
            near |= near_fixed(fixed, o, centres, s, radius, rate, resolution, flags, True)
    return near


@kernel
def marked_selves(lanes, space, a, b, rate, margin, resolution):
    """As `marked_fixed`, for the spheres of two moving nodes."""
    parts, spheres, nodes, own = lanes.parts, lanes.spheres, lanes.nodes, space.lanes
    flags, balls, centres, poses = own.flags, own.balls, own.centres, own.poses
    if not near_sphere(balls, a, balls, b, nodes[a, 3] + nodes[b, 3] + margin, rate, resolution, flags, False):
        return False
    ready_node(parts, spheres, poses, centres, own.ready, a)
    ready_node(parts, spheres, poses, centres, own.ready, b)
    clear_marks(flags)
    near = False
    for i in range(parts[a, 1], parts[a, 2]):
        radius = spheres[i, 3] + nodes[b, 3] + margin
        if near_sphere(centres, i, balls, b, radius, rate, resolution, flags, False):
            for j in range(parts[b, 1], parts[b, 2]):
                radius = spheres[i, 3] + spheres[j, 3] + margin
                near |= near_sphere(centres, i, centres, j, radius, rate, resolution, flags, True)
    return near


@kernel
def note(state, flags):
    """Merge the marks of a pair whose spheres are exact into the state of the lanes; whether any lane is hit."""
    hit = 0.0
    for lane in range(LANES):
        state[lane] = max(state[lane], flags[lane] + flags[LANES + lane])
        hit = max(hit, flags[lane])
    return hit > 0.0


@kernel
def block_hit(model, lanes, space, margin, resolution, stop):
    """Whether any lane hits something; fills ``state``. With *stop* at the first hit: the state is incomplete then."""
    parts, nodes, owns, own = lanes.parts, lanes.nodes, lanes.owns, space.lanes
    meets, selves, exactly, fixed = lanes.meets, lanes.selves, lanes.exactly, lanes.fixed
    flags, state, order, bounds, rates = own.flags, space.state, space.order, space.bounds, space.rates
    B = selves.shape[0]
    move_lanes(lanes.links, lanes.joints, own.q, own.poses)
    widest = 0.0
    for lane in range(LANES):
        widest = max(widest, flags[2 * LANES + lane])
        state[lane] = 0.0
    for k in range(parts.shape[0]):
        own.ready[k] = 0
        carry_point(own.poses, parts[k, 0], nodes[k, 0], nodes[k, 1], nodes[k, 2], own.balls, k)
        bound(own.balls, k, nodes[k, 3] + margin, bounds)
    found = False
    for i in range(meets.shape[0]):
        c = order[i]
        k, o = meets[c, 0], meets[c, 1]
        rate = rates[B + k]
        if fixed[o, 16] < NO_BOX and not may_meet(bounds, k, fixed, o, rate * widest):
            continue
        if not marked_fixed(lanes, space, k, o, rate, margin, resolution):
            continue
        if exactly[c]:
            touch = note(state, flags)
        else:
            count = owns[k, 1] - owns[k, 0]
            first, stride = meets[c, 2], meets[c, 3]
            touch = settle(model, lanes, space, k, -1, -1, first, stride, count, margin, rate, resolution, stop)
        if touch:
            found = True
            if i > 0:
                order[i], order[i - 1] = order[i - 1], c
            if stop:
                return True
    for p in range(B):
        a, b = selves[p, 0], selves[p, 1]
        rate = rates[p]
        x, y, z = bounds[a, 0] - bounds[b, 0], bounds[a, 1] - bounds[b, 1], bounds[a, 2] - bounds[b, 2]
        r = bounds[a, 3] + bounds[b, 3] + rate * widest
        if x * x + y * y + z * z > r * r or not marked_selves(lanes, space, a, b, rate, margin, resolution):
            continue
        if exactly[meets.shape[0] + p]:
            touch = note(state, flags)
        else:
            first, count = lanes.ranges[p, 0], lanes.ranges[p, 1] - lanes.ranges[p, 0]
            touch = settle(model, lanes, space, a, b, p, first, 1, count, margin, rate, resolution, stop)
        if touch:
            found = True
            if stop:
                return True
    return found


@kernel
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


@kernel
def edge_blocked(exact, lanes, qa, qb, margin, resolution, space):
    """Whether the straight motion ``qa → qb`` hits anything.

    Pieces that are not certainly free are cut in two, down to movements of *resolution*; the coarse ones come first,
    since a hit ends the check.
    """
    motion_rates(lanes, qa, qb, space.rates, space.speed, space.turning)
    queue, q, middle, half = space.queue, space.lanes.q, space.middle, space.lanes.flags[2 * LANES : 3 * LANES]
    queue[0, 0], queue[0, 1] = 0.0, 1.0
    head, count = 0, 1
    while count > 0:
        head, count, used = next_pieces(space, head, count)
        for j in range(qa.shape[0]):
            a, d = qa[j], qb[j] - qa[j]
            t = at(j, 1)
            for lane in range(LANES):
                q[t + lane] = a + middle[lane] * d
        if block_hit(exact, lanes, space, margin, resolution, True):
            return True
        for lane in range(used):
            if space.state[lane] > 0.0:
                slot = (head + count) % QUEUE
                queue[slot, 0], queue[slot, 1] = middle[lane] - half[lane], middle[lane]
                slot = (head + count + 1) % QUEUE
                queue[slot, 0], queue[slot, 1] = middle[lane], middle[lane] + half[lane]
                count += 2
    return False
