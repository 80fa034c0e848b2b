"""Rows of prioritised tasks: errors and Jacobians on lanes.

A list of tasks reaches the kernels as `TaskList`, and the numbers that may differ from problem to problem as
``data (N or 1, T, 16)`` (targets: poses as 4 × 4, or vectors) and ``goal (N or 1, T, n)`` (joint values).

==============  ===========  ========================================================================================
field           shape        meaning (T tasks, R rows, n coordinates)
==============  ===========  ========================================================================================
``kind``        (T,) int64   one of the constants below
``frame``       (T, 2)       numbers of the frames, −1 where there is none
``row``         (T + 1,)     first row of each task; the last entry is R
``point``       (T, 3)       a point in the (first) frame
``axis``        (T, 3)       a unit vector in the (first) frame
``weight``      (R,)         of each row; 0 leaves the row out
``gain``        (T,)         share of the error that one step is asked to remove
``pick``        (R,)         coordinate of a joint row
==============  ===========  ========================================================================================

Errors are those that the step shall remove: J dq = gain · e. Rotation errors are rotation vectors.
Lane buffers are flat: entry (r, c) of a Jacobian with n columns is at ``(r * n + c) * L``, component i of a pose at
``i * L``. What branches (angles, tangents) runs lane by lane on few numbers; all that grows with n runs on all lanes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .chain import REVOLUTE
from .lanes import LANES
from .vector import larger, load, root, splat, store

L = LANES

POSE = 0  # data: pose
POSITION = 1  # data: pose of axes at the place where `point` shall be, in which the rows are measured
ORIENTATION = 2  # data: pose, of which the rotation counts
DIRECTION = 3  # data[:3]: vector of the world along which `axis` shall point
LOOK_AT = 4  # data[:3]: point of the world that the ray from `point` along `axis` shall meet
COM = 5  # data[:3]
RELATIVE = 6  # data: pose of frame 1 in frame 0
JOINTS = 7  # goal: values
DESCENT = 8  # goal: the step itself


class TaskList(NamedTuple):
    """Arrays of a list of tasks; see the head of this module."""

    kind: np.ndarray
    frame: np.ndarray
    row: np.ndarray
    point: np.ndarray
    axis: np.ndarray
    weight: np.ndarray
    gain: np.ndarray
    pick: np.ndarray


@kernel(borrow=True)
def frame_block(tree, poses, frame, X):
    """Pose ``X (12 * L)`` of a frame from the moved frames of the joints ``poses (12 * m * L)``."""
    joint = tree.frame_joint[frame]
    place = tree.frame_place[frame]
    if joint < 0:
        for i in range(12):
            store(X, i * L, splat(place[i]))
        return
    o = 12 * joint * L
    for r in range(3):
        a0, a1, a2 = load(poses, o + 3 * r * L), load(poses, o + (3 * r + 1) * L), load(poses, o + (3 * r + 2) * L)
        for c in range(3):
            store(X, (3 * r + c) * L, a0 * place[c] + a1 * place[3 + c] + a2 * place[6 + c])
        p = load(poses, o + (9 + r) * L)
        store(X, (9 + r) * L, p + a0 * place[9] + a1 * place[10] + a2 * place[11])


@kernel(borrow=True)
def moving_block(tree, poses, frame, point, G, n, sign):
    """Add *sign* times the velocity of ``point (3 * L)`` of the world fixed to *frame*, and its angular velocity, to
    ``G (6, n, L)``."""
    joint = tree.frame_joint[frame]
    px, py, pz = load(point, 0), load(point, L), load(point, 2 * L)
    while joint >= 0:
        o = 12 * joint * L
        c = tree.coordinate[joint] * L
        g = sign * tree.gain[joint, 0]
        ax, ay, az = g * load(poses, o + 2 * L), g * load(poses, o + 5 * L), g * load(poses, o + 8 * L)
        vx, vy, vz = ax, ay, az
        if tree.kind[joint] == REVOLUTE:
            dx = px - load(poses, o + 9 * L)
            dy = py - load(poses, o + 10 * L)
            dz = pz - load(poses, o + 11 * L)
            vx, vy, vz = ay * dz - az * dy, az * dx - ax * dz, ax * dy - ay * dx
            store(G, 3 * n * L + c, load(G, 3 * n * L + c) + ax)
            store(G, 4 * n * L + c, load(G, 4 * n * L + c) + ay)
            store(G, 5 * n * L + c, load(G, 5 * n * L + c) + az)
        store(G, c, load(G, c) + vx)
        store(G, n * L + c, load(G, n * L + c) + vy)
        store(G, 2 * n * L + c, load(G, 2 * n * L + c) + vz)
        joint = tree.parent[joint]


@kernel
def rotation_vectors(A, B, out):
    """Rotation vectors ``out (3 * L)`` of A Bᵀ (from B to A, world axes); exact up to and at a half turn."""
    d = np.empty(3)
    for l in range(L):
        x = y = z = 0.0
        trace = 0.0
        for k in range(3):
            a0, a1, a2 = A[k * L + l], A[(3 + k) * L + l], A[(6 + k) * L + l]
            b0, b1, b2 = B[k * L + l], B[(3 + k) * L + l], B[(6 + k) * L + l]
            x += a2 * b1 - a1 * b2
            y += a0 * b2 - a2 * b0
            z += a1 * b0 - a0 * b1
            trace += a0 * b0 + a1 * b1 + a2 * b2
        s = math.sqrt(x * x + y * y + z * z)  # 2 sin θ
        f = 0.5
        if s > 1e-7:
            f = math.atan2(s, trace - 1.0) / s
        elif trace < 0.0:
            # a half turn about a: A Bᵀ = 2 a aᵀ − 1; its largest diagonal entry gives a without cancellation
            f = 0.0
            best = 0
            for i in range(3):
                d[i] = 0.0
                for k in range(3):
                    d[i] += A[(3 * i + k) * L + l] * B[(3 * i + k) * L + l]
                if d[i] > d[best]:
                    best = i
            norm = math.sqrt(max(0.5 * (d[best] + 1.0), 1e-300))
            for i in range(3):
                entry = 0.0
                for k in range(3):
                    entry += A[(3 * i + k) * L + l] * B[(3 * best + k) * L + l]
                out[i * L + l] = math.pi * (norm if i == best else 0.5 * entry / norm)
        if f != 0.0:
            out[l], out[L + l], out[2 * L + l] = f * x, f * y, f * z


@kernel(borrow=True)
def turned_block(R, G, first, v, J, e, r, n):
    """Rows r … r + 2 of J and e: ``Rᵀ`` times rows first … of G and the vector ``v (3 * L)``."""
    for k in range(3):
        x, y, z = load(R, k * L), load(R, (3 + k) * L), load(R, (6 + k) * L)
        store(e, (r + k) * L, x * load(v, 0) + y * load(v, L) + z * load(v, 2 * L))
        for c in range(n):
            a = load(G, (first * n + c) * L)
            b = load(G, ((first + 1) * n + c) * L)
            d = load(G, ((first + 2) * n + c) * L)
            store(J, ((r + k) * n + c) * L, x * a + y * b + z * d)


@kernel(borrow=True)
def tangents(a, d, U, e, r):
    """Two tangents ``U (6 * L)`` at the unit vectors ``a (3 * L)``, and the turn from a to d along them, rows r, r + 1."""
    for l in range(L):
        a0, a1, a2 = a[l], a[L + l], a[2 * L + l]
        x = 1.0 if abs(a0) <= abs(a1) and abs(a0) <= abs(a2) else 0.0
        y = 1.0 if x == 0.0 and abs(a1) <= abs(a2) else 0.0
        z = 1.0 - x - y
        dot = a0 * x + a1 * y + a2 * z
        norm = 1.0 / math.sqrt(1.0 - dot * dot)
        u0, u1, u2 = (x - dot * a0) * norm, (y - dot * a1) * norm, (z - dot * a2) * norm
        v0, v1, v2 = a1 * u2 - a2 * u1, a2 * u0 - a0 * u2, a0 * u1 - a1 * u0
        U[l], U[L + l], U[2 * L + l] = u0, u1, u2
        U[3 * L + l], U[4 * L + l], U[5 * L + l] = v0, v1, v2
        d0, d1, d2 = d[l], d[L + l], d[2 * L + l]
        x, y, z = a1 * d2 - a2 * d1, a2 * d0 - a0 * d2, a0 * d1 - a1 * d0
        sine = math.sqrt(x * x + y * y + z * z)
        cosine = a0 * d0 + a1 * d1 + a2 * d2
        if sine > 1e-12:
            f = math.atan2(sine, cosine) / sine
            e[r * L + l] = f * (u0 * x + u1 * y + u2 * z)
            e[(r + 1) * L + l] = f * (v0 * x + v1 * y + v2 * z)
        else:
            e[r * L + l] = 0.0 if cosine > 0.0 else math.pi  # exactly opposite: about the first tangent
            e[(r + 1) * L + l] = 0.0


@kernel(borrow=True)
def tangent_rows(U, G, J, r, n):
    """Rows r, r + 1 of J: the angular velocities in rows 3 … 5 of G along the tangents."""
    for h in range(2):
        x, y, z = load(U, 3 * h * L), load(U, (3 * h + 1) * L), load(U, (3 * h + 2) * L)
        for c in range(n):
            a, b, d = load(G, (3 * n + c) * L), load(G, (4 * n + c) * L), load(G, (5 * n + c) * L)
            store(J, ((r + h) * n + c) * L, x * a + y * b + z * d)


@kernel(borrow=True)
def unit_block(v):
    """Scale ``v (3 * L)`` to length one."""
    x, y, z = load(v, 0), load(v, L), load(v, 2 * L)
    f = 1.0 / larger(root(x * x + y * y + z * z), 1e-300)
    store(v, 0, x * f)
    store(v, L, y * f)
    store(v, 2 * L, z * f)


@kernel(borrow=True)
def sight_block(D, point, d, G, n):
    """Unit vectors ``d (3 * L)`` from *point* to D; rows 3 … 5 of G become the velocity relative to that line.

    The line itself turns with −d × v / length, where v is the velocity of *point*, rows 0 … 2 of G.
    """
    x, y, z = load(D, 0) - load(point, 0), load(D, L) - load(point, L), load(D, 2 * L) - load(point, 2 * L)
    f = 1.0 / larger(root(x * x + y * y + z * z), 1e-9)
    x, y, z = x * f, y * f, z * f
    store(d, 0, x)
    store(d, L, y)
    store(d, 2 * L, z)
    for c in range(n):
        a, b, w = load(G, c * L), load(G, (n + c) * L), load(G, (2 * n + c) * L)
        store(G, (3 * n + c) * L, load(G, (3 * n + c) * L) + f * (y * w - z * b))
        store(G, (4 * n + c) * L, load(G, (4 * n + c) * L) + f * (z * a - x * w))
        store(G, (5 * n + c) * L, load(G, (5 * n + c) * L) + f * (x * b - y * a))


@kernel
def com_block(tree, poses, D, J, e, r, n):
    """Rows r … r + 2: the centre of mass towards ``D (3 * L)``."""
    m = tree.kind.shape[0]
    mass = np.empty(m + 1)
    S = np.empty(3 * (m + 1) * L)  # mass × centre of what hangs on each joint
    for i in range(m + 1):
        body = tree.inertia[i]
        mass[i] = body[0]
        for k in range(3):
            for l in range(L):
                if i < m:
                    o = 12 * i * L + l
                    v = body[0] * poses[o + (9 + k) * L]
                    v += poses[o + 3 * k * L] * body[1] + poses[o + (3 * k + 1) * L] * body[2]
                    S[(3 * i + k) * L + l] = v + poses[o + (3 * k + 2) * L] * body[3]
                else:
                    S[(3 * i + k) * L + l] = body[1 + k]
    for i in range(m - 1, -1, -1):
        p = tree.parent[i] if tree.parent[i] >= 0 else m
        mass[p] += mass[i]
        for k in range(3 * L):
            S[3 * p * L + k] += S[3 * i * L + k]
    for k in range(3):
        for l in range(L):
            e[(r + k) * L + l] = D[k * L + l] - S[(3 * m + k) * L + l] / mass[m]
        J[(r + k) * n * L : (r + k + 1) * n * L] = 0.0
    for i in range(m):
        c = tree.coordinate[i]
        g = tree.gain[i, 0] / mass[m]
        P = poses[12 * i * L : 12 * (i + 1) * L]
        for l in range(L):
            ax, ay, az = g * P[2 * L + l], g * P[5 * L + l], g * P[8 * L + l]
            x, y, z = mass[i] * ax, mass[i] * ay, mass[i] * az
            if tree.kind[i] == REVOLUTE:
                dx = S[3 * i * L + l] - mass[i] * P[9 * L + l]
                dy = S[(3 * i + 1) * L + l] - mass[i] * P[10 * L + l]
                dz = S[(3 * i + 2) * L + l] - mass[i] * P[11 * L + l]
                x, y, z = ay * dz - az * dy, az * dx - ax * dz, ax * dy - ay * dx
            J[(r * n + c) * L + l] += x
            J[((r + 1) * n + c) * L + l] += y
            J[((r + 2) * n + c) * L + l] += z


@kernel
def frame_rows(tree, tasks, t, D, poses, n, X, G, v, a, U, J, e):
    """Rows of a task on one frame."""
    kind = tasks.kind[t]
    r = tasks.row[t]
    frame_block(tree, poses, tasks.frame[t, 0], X)
    p0, p1, p2 = tasks.point[t, 0], tasks.point[t, 1], tasks.point[t, 2]
    x0, x1, x2 = tasks.axis[t, 0], tasks.axis[t, 1], tasks.axis[t, 2]
    point = U  # free until the tangents are needed
    for k in range(3):
        c0, c1, c2 = load(X, 3 * k * L), load(X, (3 * k + 1) * L), load(X, (3 * k + 2) * L)
        store(point, k * L, load(X, (9 + k) * L) + c0 * p0 + c1 * p1 + c2 * p2)
        store(a, k * L, c0 * x0 + c1 * x1 + c2 * x2)
    G[:] = 0.0
    moving_block(tree, poses, tasks.frame[t, 0], point, G, n, 1.0)
    if kind in (POSE, POSITION):
        for k in range(3):
            store(v, k * L, load(D, (9 + k) * L) - load(point, k * L))
        turned_block(D, G, 0, v, J, e, r, n)
    if kind in (POSE, ORIENTATION):
        rotation_vectors(D, X, v)
        turned_block(D, G, 3, v, J, e, r + 3 if kind == POSE else r, n)
    elif kind == DIRECTION:
        unit_block(D)
        tangents(a, D, U, e, r)
        tangent_rows(U, G, J, r, n)
    elif kind == LOOK_AT:
        sight_block(D, point, v, G, n)
        tangents(a, v, U, e, r)
        tangent_rows(U, G, J, r, n)


@kernel
def relative_rows(tree, tasks, t, D, poses, n, X, Y, G, v, J, e):
    """Rows of a task on one frame relative to another, in the axes of the other."""
    r = tasks.row[t]
    frame_block(tree, poses, tasks.frame[t, 0], X)
    frame_block(tree, poses, tasks.frame[t, 1], Y)
    G[:] = 0.0
    point = Y[9 * L : 12 * L]
    moving_block(tree, poses, tasks.frame[t, 0], point, G, n, -1.0)
    moving_block(tree, poses, tasks.frame[t, 1], point, G, n, 1.0)
    wanted = np.empty(9 * L)
    for l in range(L):
        for i in range(3):
            x0, x1, x2 = X[3 * i * L + l], X[(3 * i + 1) * L + l], X[(3 * i + 2) * L + l]
            for j in range(3):
                wanted[(3 * i + j) * L + l] = x0 * D[j * L + l] + x1 * D[(3 + j) * L + l] + x2 * D[(6 + j) * L + l]
            p = X[(9 + i) * L + l] + x0 * D[9 * L + l] + x1 * D[10 * L + l] + x2 * D[11 * L + l]
            v[i * L + l] = p - Y[(9 + i) * L + l]
    turned_block(X, G, 0, v, J, e, r, n)
    rotation_vectors(wanted, Y, v)
    turned_block(X, G, 3, v, J, e, r + 3, n)


@kernel(borrow=True)
def load_data(data, t, first, last, D):
    """Targets of task t for the problems from *first* on into ``D (12 * L)``: rotation or vector (9), position (3)."""
    if data.shape[0] == 1:
        for r in range(3):
            store(D, (9 + r) * L, splat(data[0, t, 4 * r + 3]))
            for c in range(3):
                store(D, (3 * r + c) * L, splat(data[0, t, 4 * r + c]))
        return
    for l in range(L):
        row = min(first + l, last - 1)
        for r in range(3):
            D[(9 + r) * L + l] = data[row, t, 4 * r + 3]
            for c in range(3):
                D[(3 * r + c) * L + l] = data[row, t, 4 * r + c]


@kernel
def task_block(tree, tasks, data, goal, q, first, last, poses, J, e):
    """Jacobian ``J (R, n, L)`` and errors ``e (R, L)`` of all tasks for the problems first … of a batch.

    ``q (n * L)``, ``poses`` as `tree.tree_block` gives them. Rows are weighted, errors times their gains.
    """
    n = q.shape[0] // L
    X, Y, D = np.empty(12 * L), np.empty(12 * L), np.empty(12 * L)
    G = np.empty(6 * n * L)
    v, a, U = np.empty(3 * L), np.empty(3 * L), np.empty(6 * L)
    for t in range(tasks.kind.shape[0]):
        kind = tasks.kind[t]
        if kind < JOINTS:
            load_data(data, t, first, last, D)
        if kind < COM:
            frame_rows(tree, tasks, t, D, poses, n, X, G, v, a, U, J, e)
        elif kind == COM:
            com_block(tree, poses, D, J, e, tasks.row[t], n)
        elif kind == RELATIVE:
            relative_rows(tree, tasks, t, D, poses, n, X, Y, G, v, J, e)
        else:
            for i in range(tasks.row[t], tasks.row[t + 1]):
                J[i * n * L : (i + 1) * n * L] = 0.0
                c = tasks.pick[i]
                for l in range(L):
                    row = min(first + l, last - 1) if goal.shape[0] > 1 else 0
                    J[(i * n + c) * L + l] = 1.0
                    e[i * L + l] = goal[row, t, c] - q[c * L + l] if kind == JOINTS else goal[row, t, c]
        for i in range(tasks.row[t], tasks.row[t + 1]):
            w = tasks.weight[i]
            store(e, i * L, load(e, i * L) * (w * tasks.gain[t]))
            if w != 1.0:
                for k in range(i * n, (i + 1) * n):
                    store(J, k * L, load(J, k * L) * w)
