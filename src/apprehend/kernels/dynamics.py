"""Kernels for the dynamics of a tree, on lanes: inverse dynamics, mass matrix, forward dynamics.

Inverse dynamics is the recursive Newton–Euler algorithm in the joints' own frames; the mass matrix the composite rigid
body algorithm in axes of the world, where inertias add without being turned at every joint. Gravity enters as an
upward acceleration of the root.

Per joint, `motion_block` keeps `WIDTH` components on lanes: rotation to the parent's frame (9, row-major), place in
the parent's frame (3), then, in the joint's own frame, angular velocity, angular acceleration, acceleration of the
origin, force and moment (3 each). The slot after the last joint is the root, in the world: its force and moment are
what the tree exerts on its foundation.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .chain import PRISMATIC, REVOLUTE, at, load_block, within_sincos, wrap_angles
from .lanes import LANES, sincos
from .linalg import entry, factor_block, solve_block
from .tree import tree_block

WIDTH = 27


@kernel
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


@kernel
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


@kernel
def _accelerate(i, parent, turning, rate, rate_rate, state):
    """Angular velocity and acceleration of joint i and acceleration of its origin, from its parent's.

    *turning* is 1 for a revolute joint and 0 for a prismatic one; *rate* and *rate_rate* (LANES) its speed and
    acceleration.
    """
    L = LANES
    t = at(i, WIDTH)
    s = at(parent, WIDTH)
    sliding = 1.0 - turning
    for lane in range(L):
        wx = state[s + 12 * L + lane]
        wy = state[s + 13 * L + lane]
        wz = state[s + 14 * L + lane]
        ax = state[s + 15 * L + lane]
        ay = state[s + 16 * L + lane]
        az = state[s + 17 * L + lane]
        x = state[t + 9 * L + lane]
        y = state[t + 10 * L + lane]
        z = state[t + 11 * L + lane]
        # ω × r, then acceleration of the joint's place: a + α × r + ω × (ω × r)
        ux = wy * z - wz * y
        uy = wz * x - wx * z
        uz = wx * y - wy * x
        bx = state[s + 18 * L + lane] + ay * z - az * y + wy * uz - wz * uy
        by = state[s + 19 * L + lane] + az * x - ax * z + wz * ux - wx * uz
        bz = state[s + 20 * L + lane] + ax * y - ay * x + wx * uy - wy * ux
        r00 = state[t + lane]
        r01 = state[t + L + lane]
        r02 = state[t + 2 * L + lane]
        r10 = state[t + 3 * L + lane]
        r11 = state[t + 4 * L + lane]
        r12 = state[t + 5 * L + lane]
        r20 = state[t + 6 * L + lane]
        r21 = state[t + 7 * L + lane]
        r22 = state[t + 8 * L + lane]
        qd = rate[lane]
        qdd = rate_rate[lane]
        w0 = r00 * wx + r10 * wy + r20 * wz
        w1 = r01 * wx + r11 * wy + r21 * wz
        w2 = r02 * wx + r12 * wy + r22 * wz
        state[t + 12 * L + lane] = w0
        state[t + 13 * L + lane] = w1
        state[t + 14 * L + lane] = w2 + turning * qd
        state[t + 15 * L + lane] = r00 * ax + r10 * ay + r20 * az + turning * w1 * qd
        state[t + 16 * L + lane] = r01 * ax + r11 * ay + r21 * az - turning * w0 * qd
        state[t + 17 * L + lane] = r02 * ax + r12 * ay + r22 * az + turning * qdd
        state[t + 18 * L + lane] = r00 * bx + r10 * by + r20 * bz + 2.0 * sliding * w1 * qd
        state[t + 19 * L + lane] = r01 * bx + r11 * by + r21 * bz - 2.0 * sliding * w0 * qd
        state[t + 20 * L + lane] = r02 * bx + r12 * by + r22 * bz + sliding * qdd


@kernel
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


@kernel
def _hand_down(i, parent, state):
    """Add force and moment of joint i to its parent's."""
    L = LANES
    t = at(i, WIDTH)
    s = at(parent, WIDTH)
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
        state[s + 21 * L + lane] += fx
        state[s + 22 * L + lane] += fy
        state[s + 23 * L + lane] += fz
        state[s + 24 * L + lane] += r00 * n0 + r01 * n1 + r02 * n2 + y * fz - z * fy
        state[s + 25 * L + lane] += r10 * n0 + r11 * n1 + r12 * n2 + z * fx - x * fz
        state[s + 26 * L + lane] += r20 * n0 + r21 * n1 + r22 * n2 + x * fy - y * fx


@kernel
def inverse_block(model, q, qd, qdd, gravity, scratch, state, tau):
    """Torques ``tau (n * LANES)`` of one block; ``scratch (2 * LANES)``, ``state ((m + 1) * WIDTH * LANES)``."""
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
    rate = scratch[:L]
    rate_rate = scratch[L:]
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
            wrap_angles(q, c, multiplier, gain[i, 1], rate)
            _turned(model.place, i, rate, 0, 1.0, 0.0, state)
        d = at(c, 1)
        for lane in range(L):
            rate[lane] = multiplier * qd[d + lane]
            rate_rate[lane] = multiplier * qdd[d + lane]
        parent = model.parent[i]
        _accelerate(i, m if parent < 0 else parent, turning, rate, rate_rate, state)
        _load(i, model.inertia, state)
    for j in range(tau.shape[0]):
        tau[j] = 0.0
    for r in range(m):
        i = m - 1 - r
        row = at(i, WIDTH) + (26 if model.kind[i] == REVOLUTE else 23) * L
        d = at(model.coordinate[i], 1)
        multiplier = gain[i, 0]
        armature = model.armature[i] * multiplier * multiplier
        for lane in range(L):
            tau[d + lane] += multiplier * state[row + lane] + armature * qdd[d + lane]
        parent = model.parent[i]
        _hand_down(i, m if parent < 0 else parent, state)


@kernel
def inverse_dynamics(model, q, qd, qdd, gravity, start, stop, out):
    """Torques ``out (N, n)`` of rows start … stop of q, q̇, q̈, each ``(N, n)``; q̇ or q̈ without rows are zero.

    Returns 4 * row + (1, 2 or 3 for q, q̇ or q̈) of the first input that is not finite, or −1.
    """
    n = q.shape[1]
    m = model.kind.shape[0]
    bq = np.empty(n * LANES)
    bqd = np.zeros(n * LANES)
    bqdd = np.zeros(n * LANES)
    scratch = np.empty(2 * LANES)
    state = np.empty((m + 1) * WIDTH * LANES)
    tau = np.empty(n * LANES)
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
        for lane in range(min(LANES, stop - first)):
            for j in range(n):
                out[first + lane, j] = tau[j * LANES + lane]
    return bad


@kernel
def _inertia_in_world(i, inertia, origin, poses, composite):
    """The ten inertia parameters of joint i's body about *origin*, in axes of the world."""
    L = LANES
    p = at(i, 12)
    t = at(i, 10)
    mass = inertia[i, 0]
    hx, hy, hz = inertia[i, 1], inertia[i, 2], inertia[i, 3]
    xx, xy, xz = inertia[i, 4], inertia[i, 5], inertia[i, 6]
    yy, yz, zz = inertia[i, 7], inertia[i, 8], inertia[i, 9]
    ox, oy, oz = origin[0], origin[1], origin[2]
    for lane in range(L):
        r00 = poses[p + lane]
        r01 = poses[p + L + lane]
        r02 = poses[p + 2 * L + lane]
        r10 = poses[p + 3 * L + lane]
        r11 = poses[p + 4 * L + lane]
        r12 = poses[p + 5 * L + lane]
        r20 = poses[p + 6 * L + lane]
        r21 = poses[p + 7 * L + lane]
        r22 = poses[p + 8 * L + lane]
        x = poses[p + 9 * L + lane] - ox
        y = poses[p + 10 * L + lane] - oy
        z = poses[p + 11 * L + lane] - oz
        gx = r00 * hx + r01 * hy + r02 * hz
        gy = r10 * hx + r11 * hy + r12 * hz
        gz = r20 * hx + r21 * hy + r22 * hz
        # R I
        a0 = r00 * xx + r01 * xy + r02 * xz
        a1 = r00 * xy + r01 * yy + r02 * yz
        a2 = r00 * xz + r01 * yz + r02 * zz
        b0 = r10 * xx + r11 * xy + r12 * xz
        b1 = r10 * xy + r11 * yy + r12 * yz
        b2 = r10 * xz + r11 * yz + r12 * zz
        c0 = r20 * xx + r21 * xy + r22 * xz
        c1 = r20 * xy + r21 * yy + r22 * yz
        c2 = r20 * xz + r21 * yz + r22 * zz
        # shift: with s = mass p + 2 R h, I gains (p · s) 1 minus the symmetric part of p sᵀ
        sx = mass * x + 2.0 * gx
        sy = mass * y + 2.0 * gy
        sz = mass * z + 2.0 * gz
        composite[t + lane] = mass
        composite[t + L + lane] = gx + mass * x
        composite[t + 2 * L + lane] = gy + mass * y
        composite[t + 3 * L + lane] = gz + mass * z
        composite[t + 4 * L + lane] = a0 * r00 + a1 * r01 + a2 * r02 + y * sy + z * sz
        composite[t + 5 * L + lane] = a0 * r10 + a1 * r11 + a2 * r12 - 0.5 * (x * sy + y * sx)
        composite[t + 6 * L + lane] = a0 * r20 + a1 * r21 + a2 * r22 - 0.5 * (x * sz + z * sx)
        composite[t + 7 * L + lane] = b0 * r10 + b1 * r11 + b2 * r12 + x * sx + z * sz
        composite[t + 8 * L + lane] = b0 * r20 + b1 * r21 + b2 * r22 - 0.5 * (y * sz + z * sy)
        composite[t + 9 * L + lane] = c0 * r20 + c1 * r21 + c2 * r22 + x * sx + y * sy


@kernel
def _axis_and_momentum(i, turning, origin, poses, composite, screw):
    """Unit twist of joint i about *origin*, and the momentum that it gives to all that it carries; 12 components."""
    L = LANES
    p = at(i, 12)
    t = at(i, 10)
    o = at(i, 12)
    ox, oy, oz = origin[0], origin[1], origin[2]
    sliding = 1.0 - turning
    for lane in range(L):
        zx = poses[p + 2 * L + lane]
        zy = poses[p + 5 * L + lane]
        zz = poses[p + 8 * L + lane]
        x = poses[p + 9 * L + lane] - ox
        y = poses[p + 10 * L + lane] - oy
        z = poses[p + 11 * L + lane] - oz
        wx = turning * zx
        wy = turning * zy
        wz = turning * zz
        vx = y * wz - z * wy + sliding * zx
        vy = z * wx - x * wz + sliding * zy
        vz = x * wy - y * wx + sliding * zz
        mass = composite[t + lane]
        hx = composite[t + L + lane]
        hy = composite[t + 2 * L + lane]
        hz = composite[t + 3 * L + lane]
        xy = composite[t + 5 * L + lane]
        xz = composite[t + 6 * L + lane]
        yz = composite[t + 8 * L + lane]
        screw[o + lane] = vx
        screw[o + L + lane] = vy
        screw[o + 2 * L + lane] = vz
        screw[o + 3 * L + lane] = wx
        screw[o + 4 * L + lane] = wy
        screw[o + 5 * L + lane] = wz
        screw[o + 6 * L + lane] = mass * vx + wy * hz - wz * hy
        screw[o + 7 * L + lane] = mass * vy + wz * hx - wx * hz
        screw[o + 8 * L + lane] = mass * vz + wx * hy - wy * hx
        screw[o + 9 * L + lane] = composite[t + 4 * L + lane] * wx + xy * wy + xz * wz + hy * vz - hz * vy
        screw[o + 10 * L + lane] = xy * wx + composite[t + 7 * L + lane] * wy + yz * wz + hz * vx - hx * vz
        screw[o + 11 * L + lane] = xz * wx + yz * wy + composite[t + 9 * L + lane] * wz + hx * vy - hy * vx


@kernel
def mass_block(model, q, origin, scratch, poses, composite, screw, M):
    """Mass matrix of one block: a packed triangle (see `linalg`).

    Buffers on lanes: ``scratch (1)``, ``poses (12 m)``, ``composite (10 m)``, ``screw (12 m)``.
    """
    L = LANES
    m = model.kind.shape[0]
    tree_block(model, q, scratch, poses)
    for i in range(m):
        _inertia_in_world(i, model.inertia, origin, poses, composite)
    for j in range(M.shape[0]):
        M[j] = 0.0
    for r in range(m):
        i = m - 1 - r
        parent = model.parent[i]
        if parent >= 0:
            s = at(parent, 10)
            t = at(i, 10)
            for lane in range(10 * L):
                composite[s + lane] += composite[t + lane]
        _axis_and_momentum(i, 1.0 if model.kind[i] == REVOLUTE else 0.0, origin, poses, composite, screw)
    for i in range(m):
        c = model.coordinate[i]
        f = at(i, 12)
        diagonal = entry(c, c)
        gain = model.gain[i, 0]
        armature = model.armature[i] * gain * gain
        for lane in range(L):
            M[diagonal + lane] += armature
        j = i
        while j >= 0:
            b = model.coordinate[j]
            g = gain * model.gain[j, 0]
            if i != j and b == c:
                g *= 2.0
            s = at(j, 12)
            e = entry(max(b, c), min(b, c))
            for lane in range(L):
                M[e + lane] += g * (
                    screw[s + lane] * screw[f + 6 * L + lane]
                    + screw[s + L + lane] * screw[f + 7 * L + lane]
                    + screw[s + 2 * L + lane] * screw[f + 8 * L + lane]
                    + screw[s + 3 * L + lane] * screw[f + 9 * L + lane]
                    + screw[s + 4 * L + lane] * screw[f + 10 * L + lane]
                    + screw[s + 5 * L + lane] * screw[f + 11 * L + lane]
                )
            j = model.parent[j]


@kernel
def mass_matrix(model, q, start, stop, out):
    """Mass matrices ``out (N, n, n)`` of rows start … stop of ``q (N, n)``; returns the first row not finite, or −1."""
    n = q.shape[1]
    m = model.kind.shape[0]
    buffer = np.empty(n * LANES)
    scratch = np.empty(LANES)
    poses = np.empty(12 * m * LANES)
    composite = np.empty(10 * m * LANES)
    screw = np.empty(12 * m * LANES)
    M = np.empty(n * (n + 1) // 2 * LANES)
    origin = np.zeros(3)
    if m:
        origin[:] = model.place[0, 9:12]
    bad = -1
    for first in range(start, stop, LANES):
        row = load_block(q, first, stop, buffer)
        if row >= 0 and bad < 0:
            bad = row
        mass_block(model, buffer, origin, scratch, poses, composite, screw, M)
        for lane in range(min(LANES, stop - first)):
            for i in range(n):
                for j in range(i + 1):
                    value = M[entry(i, j) + lane]
                    out[first + lane, i, j] = value
                    out[first + lane, j, i] = value
    return bad


@kernel
def forward_dynamics(model, q, qd, tau, gravity, start, stop, out):
    """Accelerations ``out (N, n)`` of rows start … stop of q, q̇, τ, each ``(N, n)``: M q̈ = τ − (C q̇ + g).

    Returns ``(bad, row, coordinate)``: bad as `inverse_dynamics` has it (3 for τ), and the first row whose mass matrix
    is singular with the coordinate at which that shows, or −1, −1.
    """
    n = q.shape[1]
    m = model.kind.shape[0]
    bq = np.empty(n * LANES)
    bqd = np.empty(n * LANES)
    btau = np.empty(n * LANES)
    zero = np.zeros(n * LANES)
    scratch = np.empty(2 * LANES)
    state = np.empty((m + 1) * WIDTH * LANES)
    bias = np.empty(n * LANES)
    poses = np.empty(12 * m * LANES)
    composite = np.empty(10 * m * LANES)
    screw = np.empty(12 * m * LANES)
    M = np.empty(n * (n + 1) // 2 * LANES)
    size = np.empty(n * LANES)
    origin = np.zeros(3)
    if m:
        origin[:] = model.place[0, 9:12]
    bad = -1
    singular = -1
    coordinate = -1
    for first in range(start, stop, LANES):
        row = load_block(q, first, stop, bq)
        if row >= 0 and bad < 0:
            bad = 4 * row + 1
        row = load_block(qd, first, stop, bqd)
        if row >= 0 and bad < 0:
            bad = 4 * row + 2
        row = load_block(tau, first, stop, btau)
        if row >= 0 and bad < 0:
            bad = 4 * row + 3
        inverse_block(model, bq, bqd, zero, gravity, scratch, state, bias)
        mass_block(model, bq, origin, scratch, poses, composite, screw, M)
        for i in range(n):
            d = entry(i, i)
            for lane in range(LANES):
                size[i * LANES + lane] = M[d + lane]
        factor_block(M, n)
        for j in range(n * LANES):
            btau[j] -= bias[j]
        solve_block(M, n, btau)
        for lane in range(min(LANES, stop - first)):
            for i in range(n):
                if not M[entry(i, i) + lane] > 1e-14 * size[i * LANES + lane] and singular < 0:
                    singular = first + lane
                    coordinate = i
                out[first + lane, i] = btau[i * LANES + lane]
    return bad, singular, coordinate
