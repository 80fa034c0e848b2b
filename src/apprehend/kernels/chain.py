"""Kernels on one serial chain, from the root of a robot to one of its frames: pose and Jacobian, on lanes.

`ChainModel` is what a kernel sees of a chain. Fixed joints are merged away, the placement of the base is merged into
the first row of ``place``, and every moving joint has its own frame, turned so that the joint's axis is z. With m
moving joints and k coordinates that move the frame:

=============  ===========  ========================================================================================
field          shape        meaning
=============  ===========  ========================================================================================
``kind``       (m,) int64   0 revolute (or continuous), 1 prismatic, in order root → frame
``coordinate`` (m,) int64   index into the robot's joint vector q (n,)
``column``     (m,) int64   index into ``free``: the column of the chain's own Jacobian (6, k)
``gain``       (m, 2)       multiplier, offset: the joint's value is ``multiplier * q[coordinate] + offset``
``place``      (m + 1, 12)  rotation (row-major, 9) and translation (3): row i places the frame of joint i, at value 0,
                            in the moved frame of joint i − 1 (row 0: in the world); row m places the chain's end
                            in the moved frame of the last joint
``free``       (k,) int64   the coordinates that move the frame, ascending
=============  ===========  ========================================================================================

Joints that mimic appear as joints of their own with the driver's ``coordinate`` and ``column``.

Block kernels work on flat lane buffers: component c of lane l is at ``c * LANES + l``. A pose has 12 components
(rotation row-major, translation), the axes of joint i six (point on the axis, direction) from ``6 * i``, and
column c of a Jacobian six (linear, angular) from ``6 * c``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .lanes import LANES, sincos

REVOLUTE = 0
PRISMATIC = 1

SPATIAL = 0
BODY = 1
MIXED = 2

SINCOS_RANGE = 1e5

NATURAL = 0x7FFFFFFFFFFFFFFF
"""Mask that tells the compiler that an index is not negative, so that it need not count it from the end."""


class ChainModel(NamedTuple):
    """Arrays of one chain; see the head of this module."""

    kind: np.ndarray
    coordinate: np.ndarray
    column: np.ndarray
    gain: np.ndarray
    place: np.ndarray
    free: np.ndarray


@kernel
def lane_buffer(components):
    """An uninitialised flat lane buffer that begins on a cache line: no vector load then straddles two."""
    raw = np.empty(components * LANES + 8)
    start = ((64 - (raw.ctypes.data & 63)) & 63) >> 3
    return raw[start : start + components * LANES]


@kernel(borrow=True)
def load_block(q, first, count, out):
    """Rows ``first … first + LANES`` of ``q (N, n)`` into lanes ``out (n * LANES)``; past *count*, the last row again.

    Returns the first row that holds a NaN or an infinity, or −1.
    """
    n = q.shape[1]
    bad = -1
    for lane in range(LANES):
        row = min(first + lane, count - 1) & NATURAL
        total = 0.0
        for j in range(n):
            value = q[row, j]
            out[(j * LANES + lane) & NATURAL] = value
            total += value * 0.0
        if total != 0.0 and bad < 0:
            bad = row
    return bad


@kernel(borrow=True)
def wrap_angles(q, coordinate, multiplier, offset, value):
    """Angles of one joint on the lanes, brought within the range of `sincos` by whole turns."""
    for lane in range(LANES):
        v = multiplier * q[coordinate * LANES + lane] + offset
        value[lane] = math.atan2(math.sin(v), math.cos(v))


@kernel(inline=True)
def at(index, width):
    """Where item *index* of *width* components begins in a flat lane buffer.

    The mask tells the compiler that it is not negative; without it, Numba's handling of negative indices keeps the
    lane loops from vectorising.
    """
    return (index * width * LANES) & 0x7FFFFFFF


@kernel(borrow=True)
def within_sincos(q, model):
    """Whether every angle of a block ``q (n * LANES)`` is within the range of `sincos`: almost always."""
    total = 0.0
    for j in range(q.shape[0]):
        total += abs(q[j])
    bound = 0.0
    for i in range(model.gain.shape[0]):
        bound = max(bound, abs(model.gain[i, 0]) * total + abs(model.gain[i, 1]))
    return bound <= SINCOS_RANGE


@kernel(inline=True)
def numbers(place, i):
    """The twelve numbers of ``place[i]``."""
    return (
        place[i, 0], place[i, 1], place[i, 2], place[i, 3], place[i, 4], place[i, 5],
        place[i, 6], place[i, 7], place[i, 8], place[i, 9], place[i, 10], place[i, 11],
    )  # fmt: skip


@kernel(inline=True)
def row_through(pose, start, k, lane, e):
    """Row k of the product of the pose that begins at *start* of ``pose`` and the transform *e* of twelve numbers."""
    a0 = pose[start + 3 * k * LANES + lane]
    a1 = pose[start + (3 * k + 1) * LANES + lane]
    a2 = pose[start + (3 * k + 2) * LANES + lane]
    return (
        a0 * e[0] + a1 * e[3] + a2 * e[6],
        a0 * e[1] + a1 * e[4] + a2 * e[7],
        a0 * e[2] + a1 * e[5] + a2 * e[8],
        pose[start + (9 + k) * LANES + lane] + a0 * e[9] + a1 * e[10] + a2 * e[11],
    )


@kernel(inline=True)
def put_row(pose, start, k, lane, b0, b1, b2, p):
    """Row k of the pose that begins at *start* of ``pose``."""
    pose[start + 3 * k * LANES + lane] = b0
    pose[start + (3 * k + 1) * LANES + lane] = b1
    pose[start + (3 * k + 2) * LANES + lane] = b2
    pose[start + (9 + k) * LANES + lane] = p


@kernel(inline=True)
def revolve_block(place, i, q, coordinate, multiplier, offset, pose, axes):
    """Move ``pose (12 * LANES)`` through ``place[i]`` and a rotation about z; joint i's axis goes into *axes*.

    The angle is ``multiplier * q[coordinate] + offset``.
    """
    e = numbers(place, i)
    d = at(coordinate, 1)
    a = at(i, 6)
    for lane in range(LANES):
        s, c = sincos(multiplier * q[d + lane] + offset)
        for k in range(3):
            b0, b1, b2, p = row_through(pose, 0, k, lane, e)
            put_row(pose, 0, k, lane, b0 * c + b1 * s, b1 * c - b0 * s, b2, p)
            axes[a + k * LANES + lane] = p
            axes[a + (3 + k) * LANES + lane] = b2


@kernel(inline=True)
def slide_block(place, i, q, coordinate, multiplier, offset, pose, axes):
    """As `revolve_block`, for a translation along z."""
    e = numbers(place, i)
    d = at(coordinate, 1)
    a = at(i, 6)
    for lane in range(LANES):
        h = multiplier * q[d + lane] + offset
        for k in range(3):
            b0, b1, b2, p = row_through(pose, 0, k, lane, e)
            put_row(pose, 0, k, lane, b0, b1, b2, p + b2 * h)
            axes[a + k * LANES + lane] = p + b2 * h
            axes[a + (3 + k) * LANES + lane] = b2


@kernel(borrow=True)
def place_block(place, i, pose):
    """Multiply ``pose (12 * LANES)`` by the constant transform ``place[i]`` from the right."""
    e = numbers(place, i)
    for lane in range(LANES):
        for k in range(3):
            b0, b1, b2, p = row_through(pose, 0, k, lane, e)
            put_row(pose, 0, k, lane, b0, b1, b2, p)


@kernel(borrow=True)
def chain_block(model, q, value, pose, axes):
    """Pose of the chain's end and the axes of its joints, on one block.

    ``q (n * LANES)`` joint vectors; *value* ``(LANES)`` is scratch; results in ``pose (12 * LANES)`` and
    ``axes (6 * m * LANES)``.
    """
    m = model.kind.shape[0]
    place = model.place
    gain = model.gain
    coordinate = model.coordinate
    near = within_sincos(q, model)
    for k in range(12):
        one = 1.0 if k == 0 or k == 4 or k == 8 else 0.0
        for lane in range(LANES):
            pose[k * LANES + lane] = one
    for i in range(m):
        if model.kind[i] == PRISMATIC:
            slide_block(place, i, q, coordinate[i], gain[i, 0], gain[i, 1], pose, axes)
        elif near:
            revolve_block(place, i, q, coordinate[i], gain[i, 0], gain[i, 1], pose, axes)
        else:
            wrap_angles(q, coordinate[i], gain[i, 0], gain[i, 1], value)
            revolve_block(place, i, value, 0, 1.0, 0.0, pose, axes)
    place_block(place, m, pose)


@kernel(borrow=True)
def jacobian_block(model, pose, axes, jacobian):
    """Mixed Jacobian of the chain's own coordinates, ``jacobian (6 * k * LANES)``, from what `chain_block` gave."""
    L = LANES
    for j in range(6 * model.free.shape[0] * L):
        jacobian[j] = 0.0
    for i in range(model.kind.shape[0]):
        a = at(i, 6)
        c = at(model.column[i], 6)
        gain = model.gain[i, 0]
        if model.kind[i] == REVOLUTE:
            for lane in range(L):
                dx = pose[9 * L + lane] - axes[a + lane]
                dy = pose[10 * L + lane] - axes[a + L + lane]
                dz = pose[11 * L + lane] - axes[a + 2 * L + lane]
                zx = gain * axes[a + 3 * L + lane]
                zy = gain * axes[a + 4 * L + lane]
                zz = gain * axes[a + 5 * L + lane]
                jacobian[c + lane] += zy * dz - zz * dy
                jacobian[c + L + lane] += zz * dx - zx * dz
                jacobian[c + 2 * L + lane] += zx * dy - zy * dx
                jacobian[c + 3 * L + lane] += zx
                jacobian[c + 4 * L + lane] += zy
                jacobian[c + 5 * L + lane] += zz
        else:
            for lane in range(3 * L):
                jacobian[c + lane] += gain * axes[a + 3 * L + lane]


@kernel(borrow=True)
def turn_jacobian_block(pose, columns, reference, jacobian):
    """Change the reference of a mixed Jacobian of *columns* columns, in place.

    Spatial: ``v + p × ω``; body: both parts in the axes of the frame.
    """
    L = LANES
    for c in range(columns):
        column = jacobian[6 * c * L : 6 * (c + 1) * L]
        if reference == SPATIAL:
            for lane in range(L):
                x = pose[9 * L + lane]
                y = pose[10 * L + lane]
                z = pose[11 * L + lane]
                wx = column[3 * L + lane]
                wy = column[4 * L + lane]
                wz = column[5 * L + lane]
                column[lane] += y * wz - z * wy
                column[L + lane] += z * wx - x * wz
                column[2 * L + lane] += x * wy - y * wx
        elif reference == BODY:
            for h in (0, 3):
                part = column[h * L : (h + 3) * L]
                for lane in range(L):
                    x = part[lane]
                    y = part[L + lane]
                    z = part[2 * L + lane]
                    for k in range(3):
                        part[k * L + lane] = (
                            pose[k * L + lane] * x + pose[(3 + k) * L + lane] * y + pose[(6 + k) * L + lane] * z
                        )


@kernel(borrow=True)
def store_block(lanes, where, first, count, out, column):
    """Lanes into rows first … of ``out (N, w)``: entry *column* + j becomes the component that begins at ``where[j]``."""
    for lane in range(min(LANES, count - first)):
        row = (first + lane) & NATURAL
        for j in range(where.shape[0]):
            out[row, (column + j) & NATURAL] = lanes[(where[j] + lane) & NATURAL]


@kernel
def pose_buffer():
    """A pose on lanes (12) with a zero and a one behind it, so that `store_block` can write whole matrices."""
    pose = lane_buffer(14)
    for lane in range(LANES):
        pose[12 * LANES + lane] = 0.0
        pose[13 * LANES + lane] = 1.0
    return pose


@kernel
def pose_places():
    """Where `store_block` finds the 16 entries of a matrix in a `pose_buffer`."""
    where = np.empty(16, dtype=np.int64)
    for k in range(4):
        for j in range(3):
            where[4 * k + j] = (3 * k + j if k < 3 else 12) * LANES
        where[4 * k + 3] = (9 + k if k < 3 else 13) * LANES
    return where


@kernel
def chain_poses(model, q, start, stop, out):
    """Poses ``out (N, 16)`` of rows start … stop of ``q (N, n)``; returns the first row that is not finite, or −1."""
    buffer = lane_buffer(q.shape[1])
    value = lane_buffer(1)
    pose = pose_buffer()
    where = pose_places()
    axes = lane_buffer(6 * model.kind.shape[0])
    bad = -1
    for first in range(start, stop, LANES):
        row = load_block(q, first, stop, buffer)
        if row >= 0 and bad < 0:
            bad = row
        chain_block(model, buffer, value, pose, axes)
        store_block(pose, where, first, stop, out, 0)
    return bad


@kernel
def chain_jacobians(model, q, start, stop, reference, out, poses):
    """Jacobians ``out (N, 6 n)`` (and ``poses (N, 16)`` unless it has no rows) of rows start … stop of ``q (N, n)``.

    Columns of coordinates that do not move the frame are zero. Returns the first row that is not finite, or −1.
    """
    n = q.shape[1]
    k = model.free.shape[0]
    buffer = lane_buffer(n)
    value = lane_buffer(1)
    pose = pose_buffer()
    place = pose_places()
    axes = lane_buffer(6 * model.kind.shape[0])
    jacobian = lane_buffer(6 * k + 1)
    jacobian[6 * k * LANES :] = 0.0
    where = np.full(6 * n, 6 * k * LANES)
    for c in range(k):
        for r in range(6):
            where[r * n + model.free[c]] = (6 * c + r) * LANES
    bad = -1
    for first in range(start, stop, LANES):
        row = load_block(q, first, stop, buffer)
        if row >= 0 and bad < 0:
            bad = row
        chain_block(model, buffer, value, pose, axes)
        jacobian_block(model, pose, axes, jacobian)
        if reference != MIXED:
            turn_jacobian_block(pose, k, reference, jacobian)
        if poses.shape[0]:
            store_block(pose, place, first, stop, poses, 0)
        store_block(jacobian, where, first, stop, out, 0)
    return bad
