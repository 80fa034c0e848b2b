"""Whether constraints hold all along a straight motion in joint space: proven, on lanes.

Of every item there is a vector y that moves with the joints (an axis, a point, a rotation vector) and a convex set in
which it must stay. Let d be the distance of y from the border of the set. Along a motion over s in [0, 1] with
|y''| ≤ A, y is no farther than A (s − a)(b − s)/2 from the chord of a piece [a, b], and the distance of the chord from
the border is at least the mean of those at its ends, weighted. So the item holds on the piece if

    (1 − u) d_a + u d_b ≥ K u (1 − u) for all u in [0, 1],   K = A (b − a)²/2,   which is   √d_a + √d_b ≥ √K.

A motion that begins on the border and leaves it inwards is proven, too. For a point or an axis |y''| is bounded by
Σᵢⱼ |q̇ᵢ q̇ⱼ| l, l the lever of the outer of the two joints. For a rotation vector w of length θ and the angular velocity
ω, w' = V⁻¹ ω with |V⁻¹| ≤ c = (θ/2) / sin(θ/2) ≤ 1 + (π/2 − 1)(θ/π)², and |w''| ≤ c |ω'| + c (1/2 + θ/4) |ω|².
"""

from __future__ import annotations

import math

from ._jit import kernel
from .constrain import BOX, FROM, HIGH, INSIDE, LOW, POINT, ROOM, TURNED, constrain_space, rotation_from
from .lanes import LANES
from .so3 import log_one
from .sphere import carry_point, move_lanes

SHORTEST = 1e-5  # piece that is looked at

STEEP = 0.5 * math.pi - 1.0

HALF_TURN = 3.1  # rotation vectors longer than this may flip their sign


@kernel(borrow=True)
def bends(model, qa, qb, out):
    """Bounds along ``qa → qb`` for each item: of |y''| (a rotation: of |ω'|), of |ω|."""
    links, joints, levers = model.links, model.joints, model.levers
    for i in range(levers.shape[0]):
        total, turning = 0.0, 0.0
        for j in range(links.shape[0]):
            if levers[i, j] > 0.0:
                c = links[j, 2]
                v = abs(joints[j, 12] * (qb[c] - qa[c]))
                if links[j, 1] == 0:
                    own = 0.0 if model.items[i, 0] == TURNED else 0.5 * v
                    total += v * levers[i, j] * (own + turning)
                    turning += v
                else:
                    total += v * levers[i, j] * turning
        out[i, 0] = total if model.items[i, 0] == TURNED else 2.0 * total
        out[i, 1] = turning


@kernel(borrow=True)
def turned_slacks(f, T, space, i):
    """Slacks and angles of a rotation that is to be kept, from the frames T of its carrier."""
    L, R, slack, angle = LANES, space.small, space.slack, space.angle
    for lane in range(L):
        rotation_from(
            f, T[lane], T[L + lane], T[2 * L + lane], T[3 * L + lane], T[4 * L + lane], T[5 * L + lane],
            T[6 * L + lane], T[7 * L + lane], T[8 * L + lane], R,
        )  # fmt: skip
        x, y, z = log_one(R)
        least = min(x - f[LOW], f[HIGH] - x, y - f[LOW + 1], f[HIGH + 1] - y, z - f[LOW + 2], f[HIGH + 2] - z)
        slack[i * L + lane] = least
        angle[i * L + lane] = math.sqrt(x * x + y * y + z * z)


@kernel(borrow=True)
def upright_slacks(f, vector, slack, t):
    """Distances of an axis, given in the world, from the border of its cone, or of the half-space behind a wide one."""
    L = LANES
    ux, uy, uz = f[FROM], f[FROM + 1], f[FROM + 2]
    sine, cosine = math.sin(f[HIGH]), math.cos(f[HIGH])
    wide = cosine < 0.0
    for lane in range(L):
        x, y, z = vector[lane], vector[L + lane], vector[2 * L + lane]
        nx, ny, nz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
        along = x * ux + y * uy + z * uz
        across = math.sqrt(nx * nx + ny * ny + nz * nz)
        slack[t + lane] = along - cosine if wide else sine * along - cosine * across


@kernel(borrow=True)
def inside_slacks(f, vector, slack, t):
    """Distances of a point, given in the world, from the faces of its box."""
    L = LANES
    for lane in range(L):
        slack[t + lane] = 1e300
    for k in range(3):
        bx, by, bz = f[BOX + k], f[BOX + 3 + k], f[BOX + 6 + k]
        from_low = -(bx * f[FROM] + by * f[FROM + 1] + bz * f[FROM + 2]) - f[LOW + k]
        width = f[HIGH + k] - f[LOW + k]
        for lane in range(L):
            d = bx * vector[lane] + by * vector[L + lane] + bz * vector[2 * L + lane] + from_low
            slack[t + lane] = min(slack[t + lane], min(d, width - d))


@kernel(borrow=True)
def lane_slacks(model, space):
    """Slacks of all items in the sixteen configurations of ``space.lane_q``; the smallest."""
    items, floats, poses, vector, slack = model.items, model.floats, space.lane_poses, space.lane_vector, space.slack
    move_lanes(model.links, model.joints, space.lane_q, poses)
    world = model.links.shape[0]
    for i in range(items.shape[0]):
        kind, carrier, f = items[i, 0], items[i, 1] if items[i, 1] >= 0 else world, floats[i]
        t = (i * LANES) & 0x7FFFFFFF
        if kind == TURNED:
            turned_slacks(f, poses[carrier], space, i)
            continue
        carry_point(poses, carrier, f[POINT], f[POINT + 1], f[POINT + 2], vector, 0)
        if kind == INSIDE:
            inside_slacks(f, vector, slack, t)
        else:
            T = poses[carrier]
            for c in range(3):
                for lane in range(LANES):
                    vector[c * LANES + lane] -= T[(9 + c) * LANES + lane]
            upright_slacks(f, vector, slack, t)
    least = 1e300
    for k in range(slack.shape[0]):
        least = min(least, slack[k])
    return least


@kernel(borrow=True)
def piece_holds(model, space, lane, part):
    """Whether all items hold between two neighbouring lanes, *part* of the motion apart."""
    items, slack, angle, bend = model.items, space.slack, space.angle, space.bend
    for i in range(items.shape[0]):
        t = i * LANES + lane
        bound = bend[i, 0]
        both = math.sqrt(slack[t]) + math.sqrt(slack[t + 1])
        if items[i, 0] == TURNED:
            turning = bend[i, 1]
            widest = 0.5 * (angle[t] + angle[t + 1] + turning * part)
            if widest > HALF_TURN:
                if slack[t] + slack[t + 1] < 0.5 * math.pi * turning * part:
                    return False
                continue
            steep = 1.0 + STEEP * (widest / math.pi) ** 2
            bound = steep * (bound + (0.5 + 0.25 * widest) * turning * turning)
        if both * both < 0.5 * bound * part * part:
            return False
    return True


@kernel(borrow=True)
def holds(model, qa, qb, space):
    """Whether all constraints certainly hold along the straight motion ``qa → qb``, the ends included.

    Pieces between sixteen configurations that are not proven are cut into fifteen again, down to `SHORTEST`.
    """
    queue, q = space.queue, space.lane_q
    bends(model, qa, qb, space.bend)
    queue[0, 0], queue[0, 1] = 0.0, 1.0
    count = 1
    while count > 0:
        count -= 1
        low, part = queue[count, 0], (queue[count, 1] - queue[count, 0]) / (LANES - 1)
        for j in range(qa.shape[0]):
            a, d = qa[j], qb[j] - qa[j]
            t = (j * LANES) & 0x7FFFFFFF
            for lane in range(LANES):
                q[t + lane] = a + (low + lane * part) * d
        if not lane_slacks(model, space) >= 0.0:
            return False
        for lane in range(LANES - 1):
            if not piece_holds(model, space, lane, part):
                if part < SHORTEST or count >= ROOM:
                    return False
                queue[count, 0], queue[count, 1] = low + lane * part, low + (lane + 1) * part
                count += 1
    return True


@kernel
def holds_many(model, qa, qb, start, stop, out):
    """`holds` for motions ``qa[i] → qb[i]``."""
    space = constrain_space(model, qa.shape[1])
    for i in range(start, stop):
        out[i] = holds(model, qa[i], qb[i], space)
