"""Cells of a six-dimensional grid over poses, and the scores that samples of a chain leave in them.

A position falls into a cubic voxel. An orientation falls into one of ``4 k³`` cells of the unit quaternions with
q and −q as one: the largest component picks one of four faces of the hypercube, and the angles ``atan(x / largest)``
of the other three, each within ±π/4, are cut into k equal parts. An edge of a cell is a turn of about π/k. With
k = 0 there is one cell: orientations are not told apart.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .chain import at, chain_block, jacobian_block, lane_buffer, load_block
from .lanes import LANES
from .linalg import entry, factor_block

YOSHIKAWA = 0
MU1 = 1
MU2 = 2
MU3 = 3

SWEEPS = 5  # of Jacobi's method: relative errors of eigenvalues of 6 × 6 matrices are then below 1e-8


class PoseGrid(NamedTuple):
    """Where the cells are: lower corner (3,) in m, cells per metre, voxels along each axis, and k."""

    origin: np.ndarray
    per_metre: float
    nx: int
    ny: int
    nz: int
    k: int


@kernel
def orientation_cell(R, k):
    """Number of the cell of a rotation ``R (9,)``, row-major."""
    if k == 0:
        return 0
    w = 1.0 + R[0] + R[4] + R[8]
    x = 1.0 + R[0] - R[4] - R[8]
    y = 1.0 - R[0] + R[4] - R[8]
    z = 1.0 - R[0] - R[4] + R[8]
    wx, wy, wz = R[7] - R[5], R[2] - R[6], R[3] - R[1]
    xy, xz, yz = R[1] + R[3], R[2] + R[6], R[5] + R[7]
    # products 4 q_i q_j: those of the row of the largest component are that component's multiples of the others
    if w >= x and w >= y and w >= z:
        face, d, a, b, c = 0, w, wx, wy, wz
    elif x >= y and x >= z:
        face, d, a, b, c = 1, x, wx, xy, xz
    elif y >= z:
        face, d, a, b, c = 2, y, wy, xy, yz
    else:
        face, d, a, b, c = 3, z, wz, xz, yz
    scale = 2.0 * k / math.pi
    i = min(max(int(math.atan(a / d) * scale + 0.5 * k), 0), k - 1)
    j = min(max(int(math.atan(b / d) * scale + 0.5 * k), 0), k - 1)
    h = min(max(int(math.atan(c / d) * scale + 0.5 * k), 0), k - 1)
    return ((face * k + i) * k + j) * k + h


@kernel
def pose_cell(grid, x, y, z, R):
    """Number of the cell of a pose, or −1 outside the grid."""
    i = math.floor((x - grid.origin[0]) * grid.per_metre)
    j = math.floor((y - grid.origin[1]) * grid.per_metre)
    h = math.floor((z - grid.origin[2]) * grid.per_metre)
    if i < 0 or j < 0 or h < 0 or i >= grid.nx or j >= grid.ny or h >= grid.nz:
        return -1
    turns = 4 * grid.k * grid.k * grid.k if grid.k else 1
    return ((i * grid.ny + j) * grid.nz + h) * turns + orientation_cell(R, grid.k)


@kernel
def _frame_of(poses, n, base, p, R):
    """Row n of ``poses (N, 16)`` in the frame of ``base (12)`` (rotation row-major, translation); whether it is a pose.

    A pose has a rotation within 1e-6 and the last row (0, 0, 0, 1).
    """
    T = poses[n]
    worst = abs(T[12]) + abs(T[13]) + abs(T[14]) + abs(T[15] - 1.0)
    for i in range(3):
        for j in range(i + 1):
            product = T[i] * T[j] + T[4 + i] * T[4 + j] + T[8 + i] * T[8 + j]
            worst = max(worst, abs(product - (1.0 if i == j else 0.0)))
    for r in range(3):
        p[r] = 0.0
        for c in range(3):
            p[r] += base[3 * c + r] * (T[4 * c + 3] - base[9 + c])
            R[3 * r + c] = base[r] * T[c] + base[3 + r] * T[4 + c] + base[6 + r] * T[8 + c]
    right = R[0] * (R[4] * R[8] - R[5] * R[7]) - R[1] * (R[3] * R[8] - R[5] * R[6]) + R[2] * (R[3] * R[7] - R[4] * R[6])
    return worst <= 1e-6 and right > 0.0 and math.isfinite(p[0] + p[1] + p[2])


@kernel
def pose_cells(grid, base, poses, start, stop, out):
    """Cells ``out (N,)`` of rows start … stop of ``poses (N, 16)``; returns whether all of them are poses."""
    p, R = np.empty(3), np.empty(9)
    good = True
    for n in range(start, stop):
        fine = _frame_of(poses, n, base, p, R)
        good = good and fine
        out[n] = pose_cell(grid, p[0], p[1], p[2], R) if fine else -1
    return good


@kernel
def gram_block(jacobian, columns, first, rows, length, A):
    """Packed triangle of ``A = J Jᵀ`` of *rows* rows from *first*; rows of ω count times *length*."""
    L = LANES
    for i in range(rows):
        for j in range(i + 1):
            a = entry(i, j)
            for lane in range(L):
                A[a + lane] = 0.0
            for c in range(columns):
                one = at(c, 6) + (first + i) * L
                two = at(c, 6) + (first + j) * L
                for lane in range(L):
                    A[a + lane] += jacobian[one + lane] * jacobian[two + lane]
            factor = (length if first + i >= 3 else 1.0) * (length if first + j >= 3 else 1.0)
            for lane in range(L):
                A[a + lane] *= factor


@kernel
def eigenvalue_range(A, rows, lane, S):
    """Smallest and largest eigenvalue of one lane's symmetric matrix, by Jacobi's rotations in ``S (rows, rows)``."""
    for i in range(rows):
        for j in range(i + 1):
            S[i, j] = S[j, i] = A[entry(i, j) + lane]
    for _ in range(SWEEPS):
        for p in range(rows - 1):
            for q in range(p + 1, rows):
                off = S[p, q]
                if off == 0.0:
                    continue
                theta = 0.5 * (S[q, q] - S[p, p]) / off
                t = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(theta * theta + 1.0))
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for i in range(rows):
                    a, b = S[i, p], S[i, q]
                    S[i, p], S[i, q] = c * a - s * b, s * a + c * b
                for i in range(rows):
                    a, b = S[p, i], S[q, i]
                    S[p, i], S[q, i] = c * a - s * b, s * a + c * b
    low, high = S[0, 0], S[0, 0]
    for i in range(1, rows):
        low, high = min(low, S[i, i]), max(high, S[i, i])
    return max(low, 0.0), high


@kernel
def measure_block(A, rows, measure, scratch, S, out):
    """A measure of manipulability from ``A = J Jᵀ`` (overwritten), ``out (LANES)``; 0 where it is singular."""
    if measure in (MU1, MU2):
        for lane in range(LANES):
            low, high = eigenvalue_range(A, rows, lane, S)
            out[lane] = low if measure == MU1 else (low / high if high > 0.0 else 0.0)
        return
    factor_block(A, rows, scratch)
    for lane in range(LANES):
        out[lane] = A[lane]
    for i in range(1, rows):
        ii = entry(i, i)
        for lane in range(LANES):
            out[lane] *= A[ii + lane]
    for lane in range(LANES):
        value = out[lane]
        if not value > 0.0:  # a singular matrix may leave a NaN
            value = 0.0
        out[lane] = math.sqrt(value) if measure == YOSHIKAWA else value


@kernel
def random_rows(seed, first, start, stop, home, free, lower, upper, q):
    """Random joint vectors in rows start … stop of ``q (N, n)``: *free* coordinates uniform in their ranges, others home.

    Row i is a function of *seed* and of ``first + i`` alone (splitmix64's mixing of a counter), so the samples do not
    depend on how they are spread over threads.
    """
    k = free.shape[0]
    golden, one, two = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
    for i in range(start, stop):
        for j in range(home.shape[0]):
            q[i, j] = home[j]
        for j in range(k):
            z = np.uint64(seed) + golden * np.uint64((first + i) * k + j + 1)
            z = (z ^ (z >> np.uint64(30))) * one
            z = (z ^ (z >> np.uint64(27))) * two
            z = z ^ (z >> np.uint64(31))
            u = np.float64(np.int64(z >> np.uint64(11))) * 1.1102230246251565e-16
            q[i, free[j]] = lower[j] + u * (upper[j] - lower[j])


@kernel
def sample_cells(model, q, start, stop, grid, first, rows, length, measure, cells, values):
    """Cells and manipulability of rows start … stop of joint vectors ``q (N, n)``."""
    k = model.free.shape[0]
    buffer = lane_buffer(q.shape[1])
    scratch, result = lane_buffer(1), lane_buffer(1)
    pose, axes, jacobian = lane_buffer(12), lane_buffer(6 * model.kind.shape[0]), lane_buffer(6 * k)
    A = lane_buffer(rows * (rows + 1) // 2)
    S, R = np.empty((rows, rows)), np.empty(9)
    L = LANES
    for block in range(start, stop, L):
        load_block(q, block, stop, buffer)
        chain_block(model, buffer, scratch, pose, axes)
        jacobian_block(model, pose, axes, jacobian)
        if k >= rows:
            gram_block(jacobian, k, first, rows, length, A)
            measure_block(A, rows, measure, scratch, S, result)
        else:
            result[:] = 0.0
        for lane in range(min(L, stop - block)):
            for j in range(9):
                R[j] = pose[j * L + lane]
            cells[block + lane] = pose_cell(grid, pose[9 * L + lane], pose[10 * L + lane], pose[11 * L + lane], R)
            values[block + lane] = result[lane]


@kernel
def keep_best(cells, values, per_value, low, high, hits, best):
    """Enter samples into the cells low … high: count them (up to 255), and keep the highest rounded value."""
    for n in range(cells.shape[0]):
        cell = cells[n]
        if low <= cell < high:
            if hits[cell] < 255:
                hits[cell] += 1
            level = min(int(values[n] * per_value + 0.5), 255)
            if level > best[cell]:
                best[cell] = level


@kernel
def placement_scores(grid, hits, best, targets, bases, start, stop, out):
    """The worst target's level + 1 for each base, ``out (B,)``; 0 where one of the targets cannot be reached.

    *targets* ``(m, 16)`` are poses in the world, *bases* ``(B, 12)`` rotations, row-major, and translations.
    """
    p, R = np.empty(3), np.empty(9)
    for b in range(start, stop):
        worst = 256
        for t in range(targets.shape[0]):
            _frame_of(targets, t, bases[b], p, R)
            cell = pose_cell(grid, p[0], p[1], p[2], R)
            if cell < 0 or hits[cell] == 0:
                worst = 0
                break
            worst = min(worst, best[cell] + 1)
        out[b] = worst
