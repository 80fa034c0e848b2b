"""Kernels for the inertia of a tree, on lanes: mass matrix and forward dynamics.

The mass matrix is the composite rigid body algorithm in axes of the world, where inertias add without being turned at
every joint. Positions are taken from the place of the first joint, so that a far-away base costs no digits.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .chain import REVOLUTE, at, lane_buffer, load_block, store_block
from .dynamics import WIDTH, inverse_block
from .lanes import LANES
from .linalg import entry, factor_block, solve_block
from .tree import tree_through


@kernel(borrow=True)
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


@kernel(borrow=True)
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


@kernel(borrow=True)
def mass_block(model, q, origin, scratch, poses, composite, screw, M):
    """Mass matrix of one block: a packed triangle (see `linalg`).

    Buffers on lanes: ``scratch (13)``, ``poses (12 m)``, ``composite (10 m)``, ``screw (12 m)``.
    """
    L = LANES
    m = model.kind.shape[0]
    tree_through(model, q, scratch[12 * L :], scratch, poses)
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
            for c in range(10 * L):
                scratch[c] = composite[t + c]
            for c in range(10 * L):
                composite[s + c] += scratch[c]
        _axis_and_momentum(i, 1.0 if model.kind[i] == REVOLUTE else 0.0, origin, poses, composite, screw)
    for i in range(m):
        c = model.coordinate[i]
        f = at(i, 12)
        diagonal = entry(c, c)
        gain = model.gain[i, 0]
        armature = model.armature[i] * gain * gain
        if armature != 0.0:
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
    """Mass matrices ``out (N, n²)`` of rows start … stop of ``q (N, n)``; returns the first row not finite, or −1."""
    n = q.shape[1]
    m = model.kind.shape[0]
    buffer = lane_buffer(n)
    scratch = lane_buffer(13)
    poses = lane_buffer(12 * m)
    composite = lane_buffer(10 * m)
    screw = lane_buffer(12 * m)
    M = lane_buffer(n * (n + 1) // 2)
    origin = np.zeros(3)
    if m:
        origin[:] = model.place[0, 9:12]
    where = np.empty(n * n, dtype=np.int64)
    for i in range(n):
        for j in range(n):
            where[i * n + j] = entry(max(i, j), min(i, j))
    bad = -1
    for first in range(start, stop, LANES):
        row = load_block(q, first, stop, buffer)
        if row >= 0 and bad < 0:
            bad = row
        mass_block(model, buffer, origin, scratch, poses, composite, screw, M)
        store_block(M, where, first, stop, out, 0)
    return bad


@kernel(borrow=True)
def _keep_diagonal(M, n, size):
    """The diagonal of a packed triangle, ``size (n)``."""
    for i in range(n):
        d = entry(i, i)
        s = at(i, 1)
        for lane in range(LANES):
            size[s + lane] = M[d + lane]


@kernel(borrow=True)
def _without_inertia(M, n, size, lanes):
    """First lane and pivot of a factored mass matrix that vanish against the diagonal *size* before; or −1, −1."""
    count = 0.0
    for i in range(n):
        d = entry(i, i)
        s = at(i, 1)
        for lane in range(LANES):
            count += 0.0 if M[d + lane] > 1e-14 * size[s + lane] else 1.0
    if count > 0.0:
        for lane in range(lanes):
            for i in range(n):
                if not M[entry(i, i) + lane] > 1e-14 * size[i * LANES + lane]:
                    return lane, i
    return -1, -1


@kernel
def forward_dynamics(model, q, qd, tau, gravity, start, stop, out):
    """Accelerations ``out (N, n)`` of rows start … stop of q, q̇, τ, each ``(N, n)``: M q̈ = τ − (C q̇ + g).

    Returns ``(bad, row, coordinate)``: bad as `inverse_dynamics` has it (3 for τ), and the first row whose mass matrix
    is singular with the coordinate at which that shows, or −1, −1.
    """
    n = q.shape[1]
    m = model.kind.shape[0]
    bq = lane_buffer(n)
    bqd = lane_buffer(n)
    btau = lane_buffer(n)
    zero = np.zeros(n * LANES)
    scratch = lane_buffer(13)
    bias = lane_buffer(n)
    # the torques' state is done with when the mass matrix begins: one workspace for both stays in the nearest cache
    state = lane_buffer(max(WIDTH * (m + 1), 34 * m))
    poses = state[: 12 * m * LANES]
    composite = state[12 * m * LANES : 22 * m * LANES]
    screw = state[22 * m * LANES :]
    M = lane_buffer(n * (n + 1) // 2)
    size = lane_buffer(n)
    where = np.arange(n) * LANES
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
        _keep_diagonal(M, n, size)
        factor_block(M, n, scratch)
        for j in range(n * LANES):
            btau[j] -= bias[j]
        solve_block(M, n, btau, scratch)
        store_block(btau, where, first, stop, out, 0)
        if singular < 0:
            lane, coordinate = _without_inertia(M, n, size, min(LANES, stop - first))
            if lane >= 0:
                singular = first + lane
    return bad, singular, coordinate
