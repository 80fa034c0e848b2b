"""Kernels for the inverse dynamics of a tree, on lanes: the recursive Newton–Euler algorithm in the joints' own frames.

Gravity enters as an upward acceleration of the root.

Per joint, `motion_block` keeps `WIDTH` components on lanes: rotation to the parent's frame (9, row-major), place in
the parent's frame (3), then, in the joint's own frame, angular velocity, angular acceleration, acceleration of the
origin, force and moment (3 each). The slot after the last joint is the root, in the world: its force and moment are
what the tree exerts on its foundation.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .chain import PRISMATIC, REVOLUTE, at, lane_buffer, load_block, store_block, within_sincos, wrap_angles
from .lanes import LANES, sincos

WIDTH = 27


@kernel(borrow=True)
def _turned(place, i, q, coordinate, multiplier, offset, state):
    """Rotation and place of revolute joint i in its parent's frame."""
    L = LANES
    r00, r01, r02 = place[i, 0], place[i, 1], place[i, 2]
    r10, r11, r12 = place[i, 3], place[i, 4], place[i, 5]
    r20, r21, r22 = place[i, 6], place[i, 7], place[i, 8]
    x, y, z = place[i, 9], place[i, 10], place[i, 11]
    t = at(i, WIDTH)
    d = at(coordinate, 1)
    for lane in range(L):
        s, c = sincos(multiplier * q[d + lane] + offset)
        state[t + lane] = r00 * c + r01 * s
        state[t + L + lane] = r01 * c - r00 * s
        state[t + 2 * L + lane] = r02
        state[t + 3 * L + lane] = r10 * c + r11 * s
        state[t + 4 * L + lane] = r11 * c - r10 * s
        state[t + 5 * L + lane] = r12
        state[t + 6 * L + lane] = r20 * c + r21 * s
        state[t + 7 * L + lane] = r21 * c - r20 * s
        state[t + 8 * L + lane] = r22
        state[t + 9 * L + lane] = x
        state[t + 10 * L + lane] = y
        state[t + 11 * L + lane] = z


@kernel(borrow=True)
def _shifted(place, i, q, coordinate, multiplier, offset, state):
    """Rotation and place of prismatic joint i in its parent's frame."""
    L = LANES
    t = at(i, WIDTH)
    d = at(coordinate, 1)
    for k in range(9):
        value = place[i, k]
        for lane in range(L):
            state[t + k * L + lane] = value
    for k in range(3):
        axis = place[i, 3 * k + 2]
        origin = place[i, 9 + k]
        for lane in range(L):
            state[t + (9 + k) * L + lane] = origin + axis * (multiplier * q[d + lane] + offset)


@kernel(borrow=True)
def _accelerate(i, parent, turning, multiplier, qd, qdd, coordinate, carrier, state):
    """Angular velocity and acceleration of joint i and acceleration of its origin, from its parent's.

    *turning* is 1 for a revolute joint and 0 for a prismatic one; speed and acceleration are *multiplier* times those of
    its *coordinate*. The parent's part goes through *carrier* (9): a loop on one array at
    two offsets known at run time does not vectorise.
    """
    L = LANES
    t = at(i, WIDTH)
    s = at(parent, WIDTH)
    d = at(coordinate, 1)
    sliding = 1.0 - turning
    for c in range(9 * L):
        carrier[c] = state[s + 12 * L + c]
    for lane in range(L):
        wx = carrier[lane]
        wy = carrier[L + lane]
        wz = carrier[2 * L + lane]
        ax = carrier[3 * L + lane]
        ay = carrier[4 * L + lane]
        az = carrier[5 * L + lane]
        x = state[t + 9 * L + lane]
        y = state[t + 10 * L + lane]
        z = state[t + 11 * L + lane]
        # ω × r, then acceleration of the joint's place: a + α × r + ω × (ω × r)
        ux = wy * z - wz * y
        uy = wz * x - wx * z
        uz = wx * y - wy * x
        bx = carrier[6 * L + lane] + ay * z - az * y + wy * uz - wz * uy
        by = carrier[7 * L + lane] + az * x - ax * z + wz * ux - wx * uz
        bz = carrier[8 * L + lane] + ax * y - ay * x + wx * uy - wy * ux
        r00 = state[t + lane]
        r01 = state[t + L + lane]
        r02 = state[t + 2 * L + lane]
        r10 = state[t + 3 * L + lane]
        r11 = state[t + 4 * L + lane]
        r12 = state[t + 5 * L + lane]
        r20 = state[t + 6 * L + lane]
        r21 = state[t + 7 * L + lane]
        r22 = state[t + 8 * L + lane]
        rate = multiplier * qd[d + lane]
        rate_rate = multiplier * qdd[d + lane]
        w0 = r00 * wx + r10 * wy + r20 * wz
        w1 = r01 * wx + r11 * wy + r21 * wz
        w2 = r02 * wx + r12 * wy + r22 * wz
        state[t + 12 * L + lane] = w0
        state[t + 13 * L + lane] = w1
        state[t + 14 * L + lane] = w2 + turning * rate
        state[t + 15 * L + lane] = r00 * ax + r10 * ay + r20 * az + turning * w1 * rate
        state[t + 16 * L + lane] = r01 * ax + r11 * ay + r21 * az - turning * w0 * rate
        state[t + 17 * L + lane] = r02 * ax + r12 * ay + r22 * az + turning * rate_rate
        state[t + 18 * L + lane] = r00 * bx + r10 * by + r20 * bz + 2.0 * sliding * w1 * rate
        state[t + 19 * L + lane] = r01 * bx + r11 * by + r21 * bz - 2.0 * sliding * w0 * rate
        state[t + 20 * L + lane] = r02 * bx + r12 * by + r22 * bz + sliding * rate_rate


@kernel(borrow=True)
def _load(i, inertia, state):
    """Force and moment that move the body of joint i as it moves (Newton and Euler about the frame's origin)."""
    L = LANES
    t = at(i, WIDTH)
    mass = inertia[i, 0]
    hx, hy, hz = inertia[i, 1], inertia[i, 2], inertia[i, 3]
    xx, xy, xz = inertia[i, 4], inertia[i, 5], inertia[i, 6]
    yy, yz, zz = inertia[i, 7], inertia[i, 8], inertia[i, 9]
    for lane in range(L):
        wx = state[t + 12 * L + lane]
        wy = state[t + 13 * L + lane]
        wz = state[t + 14 * L + lane]
        ax = state[t + 15 * L + lane]
        ay = state[t + 16 * L + lane]
        az = state[t + 17 * L + lane]
        bx = state[t + 18 * L + lane]
        by = state[t + 19 * L + lane]
        bz = state[t + 20 * L + lane]
        ux = wy * hz - wz * hy
        uy = wz * hx - wx * hz
        uz = wx * hy - wy * hx
        lx = xx * wx + xy * wy + xz * wz
        ly = xy * wx + yy * wy + yz * wz
        lz = xz * wx + yz * wy + zz * wz
        state[t + 21 * L + lane] = mass * bx + ay * hz - az * hy + wy * uz - wz * uy
        state[t + 22 * L + lane] = mass * by + az * hx - ax * hz + wz * ux - wx * uz
        state[t + 23 * L + lane] = mass * bz + ax * hy - ay * hx + wx * uy - wy * ux
        state[t + 24 * L + lane] = xx * ax + xy * ay + xz * az + wy * lz - wz * ly + hy * bz - hz * by
        state[t + 25 * L + lane] = xy * ax + yy * ay + yz * az + wz * lx - wx * lz + hz * bx - hx * bz
        state[t + 26 * L + lane] = xz * ax + yz * ay + zz * az + wx * ly - wy * lx + hx * by - hy * bx


@kernel(borrow=True)
def _hand_down(i, parent, multiplier, armature, turning, qdd, coordinate, load, state, tau):
    """Add joint i's torque to *tau* at its coordinate, and its force and moment, through *load* (6), to its parent's."""
    L = LANES
    t = at(i, WIDTH)
    s = at(parent, WIDTH)
    d = at(coordinate, 1)
    rotor = armature * multiplier * multiplier
    sliding = multiplier * (1.0 - turning)
    turning *= multiplier
    for lane in range(L):
        x = state[t + 9 * L + lane]
        y = state[t + 10 * L + lane]
        z = state[t + 11 * L + lane]
        f0 = state[t + 21 * L + lane]
        f1 = state[t + 22 * L + lane]
        f2 = state[t + 23 * L + lane]
        n0 = state[t + 24 * L + lane]
        n1 = state[t + 25 * L + lane]
        n2 = state[t + 26 * L + lane]
        tau[d + lane] += turning * n2 + sliding * f2 + rotor * qdd[d + lane]
        r00 = state[t + lane]
        r01 = state[t + L + lane]
        r02 = state[t + 2 * L + lane]
        r10 = state[t + 3 * L + lane]
        r11 = state[t + 4 * L + lane]
        r12 = state[t + 5 * L + lane]
        r20 = state[t + 6 * L + lane]
        r21 = state[t + 7 * L + lane]
        r22 = state[t + 8 * L + lane]
        fx = r00 * f0 + r01 * f1 + r02 * f2
        fy = r10 * f0 + r11 * f1 + r12 * f2
        fz = r20 * f0 + r21 * f1 + r22 * f2
        load[lane] = fx
        load[L + lane] = fy
        load[2 * L + lane] = fz
        load[3 * L + lane] = r00 * n0 + r01 * n1 + r02 * n2 + y * fz - z * fy
        load[4 * L + lane] = r10 * n0 + r11 * n1 + r12 * n2 + z * fx - x * fz
        load[5 * L + lane] = r20 * n0 + r21 * n1 + r22 * n2 + x * fy - y * fx
    for c in range(6 * L):
        state[s + 21 * L + c] += load[c]


@kernel(borrow=True)
def inverse_block(model, q, qd, qdd, gravity, scratch, state, tau):
    """Torques ``tau (n * LANES)`` of one block; ``scratch (9 * LANES)``, ``state ((m + 1) * WIDTH * LANES)``."""
    L = LANES
    m = model.kind.shape[0]
    gain = model.gain
    root = at(m, WIDTH)
    for j in range(WIDTH * L):
        state[root + j] = 0.0
    for k in range(3):
        for lane in range(L):
            state[root + (18 + k) * L + lane] = -gravity[k]
    near = within_sincos(q, model)
    for i in range(m):
        c = model.coordinate[i]
        multiplier = gain[i, 0]
        turning = 1.0
        if model.kind[i] == PRISMATIC:
            turning = 0.0
            _shifted(model.place, i, q, c, multiplier, gain[i, 1], state)
        elif near:
            _turned(model.place, i, q, c, multiplier, gain[i, 1], state)
        else:
            wrap_angles(q, c, multiplier, gain[i, 1], scratch)
            _turned(model.place, i, scratch, 0, 1.0, 0.0, state)
        parent = model.parent[i]
        _accelerate(i, m if parent < 0 else parent, turning, multiplier, qd, qdd, c, scratch, state)
        _load(i, model.inertia, state)
    for j in range(tau.shape[0]):
        tau[j] = 0.0
    for r in range(m):
        i = m - 1 - r
        turning = 1.0 if model.kind[i] == REVOLUTE else 0.0
        parent = model.parent[i]
        parent = m if parent < 0 else parent
        _hand_down(i, parent, gain[i, 0], model.armature[i], turning, qdd, model.coordinate[i], scratch, state, tau)


@kernel
def inverse_dynamics(model, q, qd, qdd, gravity, start, stop, out):
    """Torques ``out (N, n)`` of rows start … stop of q, q̇, q̈, each ``(N, n)``; q̇ or q̈ without rows are zero.

    Returns 4 * row + (1, 2 or 3 for q, q̇ or q̈) of the first input that is not finite, or −1.
    """
    n = q.shape[1]
    m = model.kind.shape[0]
    bq = lane_buffer(n)
    bqd = np.zeros(n * LANES)
    bqdd = np.zeros(n * LANES)
    scratch = lane_buffer(9)
    state = lane_buffer((m + 1) * WIDTH)
    tau = lane_buffer(n)
    where = np.arange(n) * LANES
    bad = -1
    for first in range(start, stop, LANES):
        row = load_block(q, first, stop, bq)
        if row >= 0 and bad < 0:
            bad = 4 * row + 1
        if qd.shape[0]:
            row = load_block(qd, first, stop, bqd)
            if row >= 0 and bad < 0:
                bad = 4 * row + 2
        if qdd.shape[0]:
            row = load_block(qdd, first, stop, bqdd)
            if row >= 0 and bad < 0:
                bad = 4 * row + 3
        inverse_block(model, bq, bqd, bqdd, gravity, scratch, state, tau)
        store_block(tau, where, first, stop, out, 0)
    return bad
