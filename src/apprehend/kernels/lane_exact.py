"""Exact shapes along a motion on lanes: which lanes touch, and for how much of the motion two shapes stay apart.

Part of `lane_edges`, which see; here is what it asks where spheres leave a pair of nodes open.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .collide import CENTRE, DONE, CollideSpace, pair_gap
from .gjk import AXIS, HALF_SPACE, difference
from .lanes import LANES
from .sphere import SphereSpace

QUEUE = 4096
"""Room for pieces of a motion."""


class EdgeSpace(NamedTuple):
    """Scratch of one thread."""

    exact: CollideSpace
    lanes: SphereSpace
    bounds: np.ndarray  # (K, 4): a ball around the bounding spheres of a node in all lanes
    middle: np.ndarray  # (LANES,): middles of the pieces
    state: np.ndarray  # (LANES,): 0 free all along the piece, 1 open
    rates: np.ndarray  # (B + K,): of pairs of nodes, of nodes against the world
    speed: np.ndarray  # (m,): of the joints along the motion
    turning: np.ndarray  # (1,): sum of what revolute joints turn
    queue: np.ndarray  # (QUEUE, 2): begin and end of pieces
    weights: np.ndarray  # (m, B + K): how fast pairs of nodes, and nodes and the world, can approach, per joint


@kernel(borrow=True)
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


@kernel(borrow=True)
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


@kernel(borrow=True)
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


@kernel(borrow=True)
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


@kernel(borrow=True)
def settle(model, lanes, space, a, b, both, first, stride, count, margin, rate, resolution):
    """Ask the exact shapes of nodes *a* and *b* (−1: fixed) in the lanes that are marked; whether any of them touch.

    *count* pairs of shapes from *first* on, each *stride* after the last. What is known in one lane speaks for as much
    of the motion around it as the shapes need to meet. What stays open is noted in ``state``.
    """
    L = LANES
    pairs, arrays, poses, shapes = model.pairs, model.shapes, space.exact.poses, space.exact.shapes
    memory, ws, big, stack = space.exact.memory, space.exact.ws, space.exact.big, space.exact.stack
    flags, middle, state = space.lanes.flags, space.middle, space.state
    marks, half = flags[L : 2 * L], flags[2 * L : 3 * L]
    space.exact.used[0] = 1.0
    while True:
        lane = middle_marked(marks)
        if lane < 0:
            return False
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
                return True
            if rate > 0.0:
                t = (lower - margin) / rate
                if lower <= need and t < still:
                    t = max(t, still_apart(model, lanes, space, a, b, both, lane, g, h, margin, rate))
                still = min(still, t)
        if still < half[lane] and rate * half[lane] > resolution:
            state[lane] = max(state[lane], 1.0)
        for i in range(L):
            if abs(middle[i] - middle[lane]) + half[i] <= still:
                marks[i] = 0.0
