"""Kernel for the Coriolis matrix of a tree: one configuration after the other, in axes of the world."""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .chain import REVOLUTE
from .tree import tree_single


@kernel
def _spatial_inertia(ten, T, origin, out):
    """6 × 6 inertia about *origin* in axes of the world, rows (v, ω), of ten parameters in the frame *T* (12)."""
    p = np.empty(3)
    g = np.empty(3)
    I = np.empty((3, 3))
    I[0, 0], I[0, 1], I[0, 2] = ten[4], ten[5], ten[6]
    I[1, 0], I[1, 1], I[1, 2] = ten[5], ten[7], ten[8]
    I[2, 0], I[2, 1], I[2, 2] = ten[6], ten[8], ten[9]
    for a in range(3):
        p[a] = T[9 + a] - origin[a]
        g[a] = T[3 * a] * ten[1] + T[3 * a + 1] * ten[2] + T[3 * a + 2] * ten[3]
    pp = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
    pg = p[0] * g[0] + p[1] * g[1] + p[2] * g[2]
    for a in range(3):
        for b in range(3):
            total = 0.0
            for k in range(3):
                for m in range(3):
                    total += T[3 * a + k] * I[k, m] * T[3 * b + m]
            total -= ten[0] * p[a] * p[b] + p[a] * g[b] + g[a] * p[b]
            if a == b:
                total += ten[0] * pp + 2.0 * pg
            out[3 + a, 3 + b] = total
            out[a, b] = ten[0] if a == b else 0.0
    hx, hy, hz = g[0] + ten[0] * p[0], g[1] + ten[0] * p[1], g[2] + ten[0] * p[2]
    # momentum (m v − h × ω, I ω + h × v)
    out[0, 3], out[0, 4], out[0, 5] = 0.0, hz, -hy
    out[1, 3], out[1, 4], out[1, 5] = -hz, 0.0, hx
    out[2, 3], out[2, 4], out[2, 5] = hy, -hx, 0.0
    for a in range(3):
        for b in range(3):
            out[3 + a, b] = out[b, 3 + a]


@kernel
def _cross(V, out):
    """``ad_V`` for rows (v, ω): ``[[ω̂, v̂], [0, ω̂]]``; its negative transpose acts on wrenches."""
    out[:] = 0.0
    for h in (0, 3):
        out[h, h + 1], out[h, h + 2] = -V[5], V[4]
        out[h + 1, h], out[h + 1, h + 2] = V[5], -V[3]
        out[h + 2, h], out[h + 2, h + 1] = -V[4], V[3]
    out[0, 4], out[0, 5] = -V[2], V[1]
    out[1, 3], out[1, 5] = V[2], -V[0]
    out[2, 3], out[2, 4] = -V[1], V[0]


@kernel
def _wrench_cross(h, out):
    """The matrix with ``out m = −ad_mᵀ h`` for every twist m: h = (f, τ) gives ``[[0, −f̂], [−f̂, −τ̂]]``."""
    out[:] = 0.0
    for a, b, s in ((0, 3, 0), (3, 0, 0), (3, 3, 3)):
        out[a, b + 1], out[a, b + 2] = h[s + 2], -h[s + 1]
        out[a + 1, b], out[a + 1, b + 2] = -h[s + 2], h[s]
        out[a + 2, b], out[a + 2, b + 1] = h[s + 1], -h[s]


@kernel
def coriolis_matrix(model, q, qd, out):
    """``C (N, n, n)`` of rows of q, q̇ ``(N, n)``, with ``Ṁ − 2 C`` antisymmetric; returns the first bad row, or −1.

    ``C = Σ Jᵀ (I J̇ + B J)`` over the bodies, with ``B = ½ (V×* I − I V× + (I V)×̄*)`` (Echeandia and Wensing, 2021).
    """
    m = model.kind.shape[0]
    n = q.shape[1]
    poses = np.empty((m, 12))
    xi = np.zeros((m, 6))
    rate = np.zeros((m, 6))
    V = np.zeros((m, 6))
    I = np.empty((6, 6))
    X = np.empty((6, 6))
    W = np.empty((6, 6))
    B = np.empty((6, 6))
    origin = np.zeros(3)
    if m:
        origin[:] = model.place[0, 9:12]
    bad = -1
    for row in range(q.shape[0]):
        wrong = tree_single(model, q[row], poses)
        for j in range(n):
            wrong |= not math.isfinite(qd[row, j])
        if wrong and bad < 0:
            bad = row
        C = out[row]
        C[:] = 0.0
        for i in range(m):
            T = poses[i]
            zx, zy, zz = T[2], T[5], T[8]
            x, y, z = T[9] - origin[0], T[10] - origin[1], T[11] - origin[2]
            xi[i] = 0.0
            if model.kind[i] == REVOLUTE:
                xi[i, 0], xi[i, 1], xi[i, 2] = y * zz - z * zy, z * zx - x * zz, x * zy - y * zx
                xi[i, 3], xi[i, 4], xi[i, 5] = zx, zy, zz
            else:
                xi[i, 0], xi[i, 1], xi[i, 2] = zx, zy, zz
            V[i] = 0.0
            if model.parent[i] >= 0:
                V[i] = V[model.parent[i]]
            _cross(V[i], X)
            for a in range(6):
                total = 0.0
                for b in range(6):
                    total += X[a, b] * xi[i, b]
                rate[i, a] = total
            for a in range(6):
                V[i, a] += model.gain[i, 0] * qd[row, model.coordinate[i]] * xi[i, a]
            _spatial_inertia(model.inertia[i], T, origin, I)
            _cross(V[i], X)
            momentum = np.zeros(6)
            for a in range(6):
                for b in range(6):
                    momentum[a] += I[a, b] * V[i, b]
            _wrench_cross(momentum, W)
            for a in range(6):
                for b in range(6):
                    total = W[a, b]
                    for k in range(6):
                        total -= X[k, a] * I[k, b] + I[a, k] * X[k, b]
                    B[a, b] = 0.5 * total
            _project(model, i, xi, rate, I, B, C)
    return bad


@kernel
def _project(model, body, xi, rate, I, B, C):
    """Add ``Jᵀ (I J̇ + B J)`` of one body, whose Jacobian has a column for each joint that carries it."""
    F = np.empty(6)
    j = body
    while j >= 0:
        for a in range(6):
            F[a] = 0.0
            for b in range(6):
                F[a] += I[a, b] * rate[j, b] + B[a, b] * xi[j, b]
        i = body
        while i >= 0:
            total = 0.0
            for a in range(6):
                total += xi[i, a] * F[a]
            C[model.coordinate[i], model.coordinate[j]] += total * model.gain[i, 0] * model.gain[j, 0]
            i = model.parent[i]
        j = model.parent[j]
