"""Constraints on the motion of frames: values, their derivatives by q, and steps onto them.

Three kinds of *items*: the angle between an axis of a frame and a direction, a point in the axes of a box, and the
rotation vector of a frame against a rotation. Each has values with a lower and an upper bound. What depends on the frame
alone is given in the moved frame of the joint that carries it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .collide import move_joints
from .lanes import LANES
from .so3 import inverse_left_jacobian_one, log_one

UPRIGHT = 0
INSIDE = 1
TURNED = 2

POINT, BOX, FROM, LOW, HIGH, SLACK = 9, 12, 21, 24, 27, 30

STEPS = 20  # of Newton's method

ROOM = 128  # pieces of a motion that may wait to be looked at


class ConstrainModel(NamedTuple):
    """Arrays: m joints that move the constrained frames, I items, n coordinates."""

    links: np.ndarray  # (m, 3) int64: parent, kind, coordinate
    joints: np.ndarray  # (m, 14): place, multiplier, offset
    items: np.ndarray  # (I, 3) int64: kind, carrier (−1: the world), first value
    floats: (
        np.ndarray
    )  # (I, 33), in the carrier the frame's rotation (9) and the axis or point (3); then the axes of the
    #  box or the rotation to keep (9), the box's origin or the direction (3), lower and upper bounds, slacks (3 each)
    levers: np.ndarray  # (I, m): how far the axis, point or rotation moves at most per unit of each joint
    moving: np.ndarray  # (n,): 1 for coordinates that a projection may change, else 0


class ConstrainSpace(NamedTuple):
    """Scratch of one thread; lane buffers are flat, component c of lane l at ``c * LANES + l``."""

    poses: np.ndarray  # (m, 12)
    value: np.ndarray  # (3 I,)
    error: np.ndarray  # (3 I,)
    rows: np.ndarray  # (3 I, n)
    gram: np.ndarray  # (3 I, 3 I)
    solved: np.ndarray  # (3 I,)
    step: np.ndarray  # (2, n)
    small: np.ndarray  # (18,)
    lane_q: np.ndarray  # n components
    lane_poses: np.ndarray  # (m + 1, 12 LANES), the world's frame last
    lane_vector: np.ndarray  # 3 components
    slack: np.ndarray  # I components: of each item, how far its vector is from the bounds
    angle: np.ndarray  # I components: of each rotation
    bend: np.ndarray  # (I, 3)
    queue: np.ndarray  # (ROOM, 2): begin and end of pieces


@kernel
def constrain_space(model, n):
    """Fresh scratch."""
    m, count = model.links.shape[0], model.items.shape[0]
    lane_poses = np.zeros((m + 1, 12 * LANES))
    for k in (0, 4, 8):
        for lane in range(LANES):
            lane_poses[m, k * LANES + lane] = 1.0
    r = 3 * count
    return ConstrainSpace(
        np.zeros((m, 12)), np.zeros(r), np.zeros(r), np.zeros((r, n)), np.zeros((r, r)), np.zeros(r), np.zeros((2, n)),
        np.zeros(18), np.zeros(n * LANES), lane_poses, np.zeros(3 * LANES), np.zeros(count * LANES),
        np.zeros(count * LANES), np.zeros((count, 3)), np.zeros((ROOM, 2)),
    )  # fmt: skip


@kernel(borrow=True)
def turn(poses, carrier, x, y, z):
    """The direction (x, y, z) of a carrier (−1: the world) in the world."""
    if carrier < 0:
        return x, y, z
    T = poses[carrier]
    return T[0] * x + T[1] * y + T[2] * z, T[3] * x + T[4] * y + T[5] * z, T[6] * x + T[7] * y + T[8] * z


@kernel(borrow=True)
def shift(poses, carrier):
    """The origin of a carrier."""
    if carrier < 0:
        return 0.0, 0.0, 0.0
    return poses[carrier, 9], poses[carrier, 10], poses[carrier, 11]


@kernel(borrow=True)
def rotation_from(f, a0, a1, a2, b0, b1, b2, c0, c1, c2, out):
    """``Rᵀ T P`` into ``out (9,)``: R the rotation to keep, P that of the frame in its carrier, T by rows."""
    for j in range(3):
        x, y, z = f[j], f[3 + j], f[6 + j]
        u, v, w = a0 * x + a1 * y + a2 * z, b0 * x + b1 * y + b2 * z, c0 * x + c1 * y + c2 * z
        for i in range(3):
            out[3 * i + j] = f[BOX + i] * u + f[BOX + 3 + i] * v + f[BOX + 6 + i] * w


@kernel(borrow=True)
def measure(model, q, space):
    """The values of all items at ``q (n,)`` into ``space.value``; unused ones stay zero."""
    items, floats, poses, value, R = model.items, model.floats, space.poses, space.value, space.small
    move_joints(model.links, model.joints, q, poses)
    for i in range(items.shape[0]):
        kind, carrier, f = items[i, 0], items[i, 1], floats[i]
        if kind == TURNED:
            if carrier < 0:
                rotation_from(f, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, R)
            else:
                T = poses[carrier]
                rotation_from(f, T[0], T[1], T[2], T[3], T[4], T[5], T[6], T[7], T[8], R)
            value[3 * i], value[3 * i + 1], value[3 * i + 2] = log_one(R)
            continue
        x, y, z = turn(poses, carrier, f[POINT], f[POINT + 1], f[POINT + 2])
        if kind == INSIDE:
            px, py, pz = shift(poses, carrier)
            x, y, z = x + px - f[FROM], y + py - f[FROM + 1], z + pz - f[FROM + 2]
            for k in range(3):
                value[3 * i + k] = f[BOX + k] * x + f[BOX + 3 + k] * y + f[BOX + 6 + k] * z
        else:
            ux, uy, uz = f[FROM], f[FROM + 1], f[FROM + 2]
            nx, ny, nz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
            value[3 * i] = math.atan2(math.sqrt(nx * nx + ny * ny + nz * nz), x * ux + y * uy + z * uz)


@kernel(borrow=True)
def beyond(model, space, tight):
    """How far the values of `measure` are beyond the bounds narrowed by *tight* slacks, at most; ≤ 0: not."""
    floats, value = model.floats, space.value
    worst = -1e300
    for i in range(floats.shape[0]):
        for k in range(3):
            v, s = value[3 * i + k], tight * floats[i, SLACK + k]
            worst = max(worst, floats[i, LOW + k] + s - v, v - floats[i, HIGH + k] + s)
    return worst


@kernel(borrow=True)
def upright_normal(f, poses, carrier):
    """Unit vector about which the axis leaves its direction; any where it has none."""
    x, y, z = turn(poses, carrier, f[POINT], f[POINT + 1], f[POINT + 2])
    ux, uy, uz = f[FROM], f[FROM + 1], f[FROM + 2]
    nx, ny, nz = uy * z - uz * y, uz * x - ux * z, ux * y - uy * x
    s = math.sqrt(nx * nx + ny * ny + nz * nz)
    if s > 1e-9:
        return nx / s, ny / s, nz / s
    if abs(ux) < 0.7:
        s = math.sqrt(uy * uy + uz * uz)
        return 0.0, uz / s, -uy / s
    s = math.sqrt(ux * ux + uz * uz)
    return -uz / s, 0.0, ux / s


@kernel(borrow=True)
def derive(model, i, k, space, row):
    """Derivative by q ``row (n,)`` of value *k* of item *i*, where `measure` put the frames."""
    links, joints, moving, poses = model.links, model.joints, model.moving, space.poses
    kind, carrier, f = model.items[i, 0], model.items[i, 1], model.floats[i]
    for j in range(row.shape[0]):
        row[j] = 0.0
    gx, gy, gz, px, py, pz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if kind == UPRIGHT:
        gx, gy, gz = upright_normal(f, poses, carrier)
    elif kind == TURNED:
        value, V = space.value, space.small
        inverse_left_jacobian_one(value[3 * i], value[3 * i + 1], value[3 * i + 2], V)
        a, b, c = V[3 * k], V[3 * k + 1], V[3 * k + 2]
        gx = f[BOX] * a + f[BOX + 1] * b + f[BOX + 2] * c
        gy = f[BOX + 3] * a + f[BOX + 4] * b + f[BOX + 5] * c
        gz = f[BOX + 6] * a + f[BOX + 7] * b + f[BOX + 8] * c
    else:
        gx, gy, gz = f[BOX + k], f[BOX + 3 + k], f[BOX + 6 + k]
        px, py, pz = turn(poses, carrier, f[POINT], f[POINT + 1], f[POINT + 2])
        ox, oy, oz = shift(poses, carrier)
        px, py, pz = px + ox, py + oy, pz + oz
    j = carrier
    while j >= 0:
        T = poses[j]
        zx, zy, zz = T[2], T[5], T[8]
        if kind != INSIDE:
            rate = gx * zx + gy * zy + gz * zz if links[j, 1] == 0 else 0.0
        elif links[j, 1] == 0:
            x, y, z = px - T[9], py - T[10], pz - T[11]
            rate = gx * (zy * z - zz * y) + gy * (zz * x - zx * z) + gz * (zx * y - zy * x)
        else:
            rate = gx * zx + gy * zy + gz * zz
        c = links[j, 2]
        row[c] += joints[j, 12] * moving[c] * rate
        j = links[j, 0]


@kernel(borrow=True)
def least_step(rows, error, count, step, gram, y):
    """``step[0] = Jᵀ (J Jᵀ + λ)⁻¹ error`` over the columns whose ``step[1]`` is 1; λ falls with the error."""
    n = rows.shape[1]
    damping = 1e-9
    for r in range(count):
        damping += 1e-3 * error[r] * error[r]
    for r in range(count):
        for t in range(r + 1):
            total = damping if r == t else 0.0
            for j in range(n):
                total += rows[r, j] * rows[t, j] * step[1, j]
            for u in range(t):
                total -= gram[r, u] * gram[t, u]
            gram[r, t] = math.sqrt(max(total, 1e-300)) if r == t else total / gram[t, t]
        total = error[r]
        for u in range(r):
            total -= gram[r, u] * y[u]
        y[r] = total / gram[r, r]
    for b in range(count):
        r = count - 1 - b
        total = y[r]
        for u in range(r + 1, count):
            total -= gram[u, r] * y[u]
        y[r] = total / gram[r, r]
    for j in range(n):
        total = 0.0
        for r in range(count):
            total += rows[r, j] * y[r]
        step[0, j] = total * step[1, j]


@kernel(borrow=True)
def project_one(model, q, lower, upper, space):
    """Move ``q (n,)`` by Newton's steps until all bounds hold with 1.5 slacks to spare; whether they do.

    Steps aim at two slacks. Coordinates that a step would carry beyond their limits stay there, and the step is
    found again without them.
    """
    items, floats, value = model.items, model.floats, space.value
    rows, error, step = space.rows, space.error, space.step
    n = q.shape[0]
    for j in range(n):
        q[j] = min(max(q[j], lower[j]), upper[j])
    for _ in range(STEPS):
        measure(model, q, space)
        if beyond(model, space, 1.5) <= 0.0:
            return True
        count = 0
        for i in range(items.shape[0]):
            for k in range(3):
                v, s = value[3 * i + k], 2.0 * floats[i, SLACK + k]
                low, high = floats[i, LOW + k] + s, floats[i, HIGH + k] - s
                if v < low or v > high:
                    error[count] = low - v if v < low else high - v
                    derive(model, i, k, space, rows[count])
                    count += 1
        for j in range(n):
            step[1, j] = 1.0
        for _ in range(3):
            least_step(rows, error, count, step, space.gram, space.solved)
            held = False
            for j in range(n):
                ahead = q[j] + step[0, j]
                if ahead < lower[j] or ahead > upper[j]:
                    ahead = lower[j] if ahead < lower[j] else upper[j]
                    for r in range(count):
                        error[r] -= rows[r, j] * (ahead - q[j])
                    q[j], step[0, j], step[1, j] = ahead, 0.0, 0.0
                    held = True
            if not held:
                break
        for j in range(n):
            q[j] = min(max(q[j] + step[0, j], lower[j]), upper[j])
    return False


@kernel
def project_many(model, q, lower, upper, start, stop, good):
    """`project_one` on rows of ``q (N, n)``; ``good[i]``: whether it worked."""
    space = constrain_space(model, q.shape[1])
    for i in range(start, stop):
        good[i] = project_one(model, q[i], lower, upper, space)


@kernel
def values_many(model, q, start, stop, out):
    """Values ``out (N, 3 I)`` at ``q (N, n)``."""
    space = constrain_space(model, q.shape[1])
    for i in range(start, stop):
        measure(model, q[i], space)
        for k in range(out.shape[1]):
            out[i, k] = space.value[k]
