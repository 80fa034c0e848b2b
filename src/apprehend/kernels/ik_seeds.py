"""Starts for inverse kinematics: for every target the nearest entries of a table of known configurations.

A configuration with its pose known is a good start for a pose near by. The squared distance of two poses,
‖p − p'‖² + w² ‖R − R'‖² (Frobenius), is a constant minus twice a dot product of 12 numbers, so scanning the table costs
twelve multiply-adds per entry and lane. The table is cut into groups, and the best of every group is kept: that many
starts, without sorting or branches.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .ik_chain import POS, ROT, WORK, L, forward


@kernel
def chain_features(chain, q, out):
    """Rotation (9) and position (3) in the chain's own form, ``out (N, 12)``, of ``q (N, k)``."""
    count, k = q.shape
    buffer = np.zeros(k * L)
    axes = np.zeros(6 * chain.kind.shape[0] * L)
    w = np.zeros(WORK)
    for first in range(0, count, L):
        for l in range(L):
            row = min(first + l, count - 1)
            for c in range(k):
                buffer[c * L + l] = q[row, c]
        forward(chain, buffer, axes, w)
        for l in range(min(L, count - first)):
            for i in range(9):
                out[first + l, i] = w[ROT + i * L + l]
            for i in range(3):
                out[first + l, 9 + i] = w[POS + i * L + l]


@kernel(borrow=True)
def chain_targets(poses, before, tool, reach, first, last, out):
    """Poses ``(N, 16)`` in the world as targets ``out (N, 12)`` of a chain: rotation (9), position (3) over the reach."""
    for i in range(first, last):
        T = poses[i]
        for r in range(3):
            x = y = z = p = 0.0
            for k in range(3):
                b = before[k, r]
                x += b * T[4 * k]
                y += b * T[4 * k + 1]
                z += b * T[4 * k + 2]
                p += b * (T[4 * k + 3] - before[k, 3])
            for c in range(3):
                out[i, 3 * r + c] = x * tool[c, 0] + y * tool[c, 1] + z * tool[c, 2]
            out[i, 9 + r] = p / reach


@kernel
def nearest_starts(table, half, targets, first, last, order):
    """Best entry of every group for ``targets[first:last] (N, 12)``, nearest first, in ``order (N, groups)``.

    *table* ``(M, 12)`` holds the entries' features with the weights (not their roots) multiplied in, and *half* ``(M)`` half the squared
    norm; the score to be largest is their dot product minus half. Group g is rows g·M/groups and on.
    """
    groups = order.shape[1]
    share = table.shape[0] // groups
    f = np.empty(12 * L)
    score = np.empty(L)
    index = np.empty(L)
    scores = np.empty((groups, L))
    indices = np.empty((groups, L))
    for block in range(first, last, L):
        for l in range(L):
            t = min(block + l, last - 1)
            for i in range(12):
                f[i * L + l] = targets[t, i]
        for g in range(groups):
            for l in range(L):
                score[l] = -1e300
                index[l] = 0.0
            for e in range(g * share, (g + 1) * share):
                t0, t1, t2, t3 = table[e, 0], table[e, 1], table[e, 2], table[e, 3]
                t4, t5, t6, t7 = table[e, 4], table[e, 5], table[e, 6], table[e, 7]
                t8, t9, t10, t11 = table[e, 8], table[e, 9], table[e, 10], table[e, 11]
                h = half[e]
                number = float(e)
                for l in range(L):
                    v = (
                        t0 * f[l]
                        + t1 * f[L + l]
                        + t2 * f[2 * L + l]
                        + t3 * f[3 * L + l]
                        + t4 * f[4 * L + l]
                        + t5 * f[5 * L + l]
                        + t6 * f[6 * L + l]
                        + t7 * f[7 * L + l]
                        + t8 * f[8 * L + l]
                        + t9 * f[9 * L + l]
                        + t10 * f[10 * L + l]
                        + t11 * f[11 * L + l]
                        - h
                    )
                    better = v > score[l]
                    score[l] = v if better else score[l]
                    index[l] = number if better else index[l]
            for l in range(L):
                scores[g, l] = score[l]
                indices[g, l] = index[l]
        for l in range(min(L, last - block)):
            for g in range(groups):
                v = scores[g, l]
                number = indices[g, l]
                at = g
                while at > 0 and scores[at - 1, l] < v:
                    scores[at, l] = scores[at - 1, l]
                    indices[at, l] = indices[at - 1, l]
                    at -= 1
                scores[at, l] = v
                indices[at, l] = number
            for g in range(groups):
                order[block + l, g] = int(indices[g, l])


@kernel(borrow=True)
def residuals(reached, wanted, first, last, out):
    """Distance and angle ``out (N, 2)`` between rows of poses ``(N, 16)``."""
    for i in range(first, last):
        a = reached[i]
        b = wanted[i]
        distance = 0.0
        for k in range(3):
            distance += (a[4 * k + 3] - b[4 * k + 3]) ** 2
        trace = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6]
        trace += a[8] * b[8] + a[9] * b[9] + a[10] * b[10]
        # rotation a·bᵀ: entry (r, s) = Σ a[r, ·] b[s, ·]
        x = a[8] * b[4] + a[9] * b[5] + a[10] * b[6] - a[4] * b[8] - a[5] * b[9] - a[6] * b[10]
        y = a[0] * b[8] + a[1] * b[9] + a[2] * b[10] - a[8] * b[0] - a[9] * b[1] - a[10] * b[2]
        z = a[4] * b[0] + a[5] * b[1] + a[6] * b[2] - a[0] * b[4] - a[1] * b[5] - a[2] * b[6]
        out[i, 0] = math.sqrt(distance)
        out[i, 1] = math.atan2(math.sqrt(x * x + y * y + z * z), trace - 1.0)
