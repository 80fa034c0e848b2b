"""Signed distance fields: exact distances of a mesh on a regular grid, and queries between the grid points.

The grid is filled on lanes: a block of 2 × 2 × 4 grid points descends the triangle tree together, starting from the
triangles that were nearest to its neighbour, so that few boxes and triangles are left to look at. Every distance is
exact. Between the grid points the field is trilinear.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .rays import DEPTH, _nearest_on_triangle, push_nearer_last

LANES = 16
RUN = 1024
"""Points that `nearest` looks up one after another."""


class Field(NamedTuple):
    """What kernels need of a distance field: ``values[i, j, k]`` belongs to ``origin + spacing (i, j, k)``."""

    origin: np.ndarray  # (3,) float64
    spacing: float
    values: np.ndarray  # (nx, ny, nz) float32, negative inside; at least 2 along each axis


@kernel
def _cell(field, x, y, z):
    """Cell (i, j, k) of the nearest point of the grid's box, its place in the cell (0 … 1), and the way to it in m."""
    shape, inverse = field.values.shape, 1.0 / field.spacing
    u0, u1, u2 = (x - field.origin[0]) * inverse, (y - field.origin[1]) * inverse, (z - field.origin[2]) * inverse
    c0 = min(max(u0, 0.0), shape[0] - 1.0)
    c1 = min(max(u1, 0.0), shape[1] - 1.0)
    c2 = min(max(u2, 0.0), shape[2] - 1.0)
    i, j, k = min(int(c0), shape[0] - 2), min(int(c1), shape[1] - 2), min(int(c2), shape[2] - 2)
    d0, d1, d2 = (u0 - c0) * field.spacing, (u1 - c1) * field.spacing, (u2 - c2) * field.spacing
    return i, j, k, c0 - i, c1 - j, c2 - k, d0, d1, d2


@kernel
def sample(field, x, y, z):
    """The signed distance at a point of the field's frame; device function, never NaN for finite points.

    Inside the grid it is trilinear. Outside, with q the nearest point of the grid's box, it is √(|x − q|² + d(q)²):
    the body lies within the box, so this is never more than the distance, and short of it by less than d(q).
    """
    v = field.values
    i, j, k, a, b, c, d0, d1, d2 = _cell(field, x, y, z)
    p00 = v[i, j, k] + c * (v[i, j, k + 1] - v[i, j, k])
    p01 = v[i, j + 1, k] + c * (v[i, j + 1, k + 1] - v[i, j + 1, k])
    p10 = v[i + 1, j, k] + c * (v[i + 1, j, k + 1] - v[i + 1, j, k])
    p11 = v[i + 1, j + 1, k] + c * (v[i + 1, j + 1, k + 1] - v[i + 1, j + 1, k])
    p0 = p00 + b * (p01 - p00)
    p1 = p10 + b * (p11 - p10)
    value = p0 + a * (p1 - p0)
    out = d0 * d0 + d1 * d1 + d2 * d2
    if out > 0.0:
        return math.sqrt(out + value * value)
    return value


@kernel
def sample_gradient(field, x, y, z):
    """`sample` and its gradient ``(d, gx, gy, gz)``; within a cell the derivative of the trilinear interpolant."""
    v = field.values
    i, j, k, a, b, c, d0, d1, d2 = _cell(field, x, y, z)
    s00 = float(v[i, j, k + 1]) - float(v[i, j, k])
    s01 = float(v[i, j + 1, k + 1]) - float(v[i, j + 1, k])
    s10 = float(v[i + 1, j, k + 1]) - float(v[i + 1, j, k])
    s11 = float(v[i + 1, j + 1, k + 1]) - float(v[i + 1, j + 1, k])
    p00, p01 = v[i, j, k] + c * s00, v[i, j + 1, k] + c * s01
    p10, p11 = v[i + 1, j, k] + c * s10, v[i + 1, j + 1, k] + c * s11
    p0, p1 = p00 + b * (p01 - p00), p10 + b * (p11 - p10)
    value = p0 + a * (p1 - p0)
    inverse = 1.0 / field.spacing
    gx = (p1 - p0) * inverse
    gy = ((p01 - p00) + a * ((p11 - p10) - (p01 - p00))) * inverse
    s0, s1 = s00 + b * (s01 - s00), s10 + b * (s11 - s10)
    gz = (s0 + a * (s1 - s0)) * inverse
    if d0 != 0.0 or d1 != 0.0 or d2 != 0.0:  # on the box the point q does not move along the clamped axes
        far = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2 + value * value)
        gx = (d0 if d0 != 0.0 else value * gx) / far
        gy = (d1 if d1 != 0.0 else value * gy) / far
        gz = (d2 if d2 != 0.0 else value * gz) / far
        value = far
    return value, gx, gy, gz


@kernel
def distances(field, points, out):
    """`sample` at ``points (N, 3)``."""
    for n in range(points.shape[0]):
        out[n] = sample(field, points[n, 0], points[n, 1], points[n, 2])


@kernel
def gradients(field, points, out, slope):
    """`sample_gradient` at ``points (N, 3)`` into ``out (N,)`` and ``slope (N, 3)``."""
    for n in range(points.shape[0]):
        d, gx, gy, gz = sample_gradient(field, points[n, 0], points[n, 1], points[n, 2])
        out[n] = d
        slope[n, 0], slope[n, 1], slope[n, 2] = gx, gy, gz


@kernel(fast=False)
def frames(triangles):
    """Every triangle in a frame of its own ``(F, 21)``: corner, axes, and its three edges in its plane.

    The x axis runs along the first edge, z along the normal. An edge is given by its start, unit direction and length
    as (start x, start y, direction x, direction y, length); the first one starts at 0 along x, so only its length is.
    """
    count = triangles.shape[0]
    out = np.zeros((count, 21))
    for f in range(count):
        t, row = triangles[f], out[f]
        x, y, z, e = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
        length, other = 0.0, 0.0
        for k in range(3):
            row[k] = t[0, k]
            x[k], e[k] = t[1, k] - t[0, k], t[2, k] - t[0, k]
            length += x[k] * x[k]
            other += e[k] * e[k]
        length, other = math.sqrt(length), math.sqrt(other)
        if length > 0.0:
            x /= length
        elif other > 0.0:
            x[:] = e / other
        else:
            x[0] = 1.0
        u = x[0] * e[0] + x[1] * e[1] + x[2] * e[2]
        y[:] = e - u * x
        v = math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
        if v <= 1e-14 * other or v == 0.0:  # no area: any direction across
            m = 0
            for k in range(1, 3):
                if abs(x[k]) < abs(x[m]):
                    m = k
            y[:] = -x[m] * x
            y[m] += 1.0
            y /= math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
            v = 0.0
        else:
            y /= v
        z[0], z[1], z[2] = x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]
        for k in range(3):
            row[3 + k], row[6 + k], row[9 + k] = x[k], y[k], z[k]
        row[12] = length
        side = math.sqrt((u - length) ** 2 + v * v)
        row[13] = length
        row[14] = row[19] = -1.0  # edges without length
        if side > 0.0:
            row[14], row[15] = (u - length) / side, v / side
        row[16] = side
        row[17], row[18] = u, v
        side = math.sqrt(u * u + v * v)
        if side > 0.0:
            row[19], row[20] = -u / side, -v / side
    return out


@kernel
def _closer(row, face, px, py, pz, best, owner):
    """Lower *best* (squared distances) and set *owner* on the lanes to which the triangle *row* is nearer."""
    ax, ay, az = row[0], row[1], row[2]
    x0, x1, x2, y0, y1, y2, z0, z1, z2 = row[3], row[4], row[5], row[6], row[7], row[8], row[9], row[10], row[11]
    first, bx, bu, bv, second = row[12], row[13], row[14], row[15], row[16]
    cx, cy, cu, cv = row[17], row[18], row[19], row[20]
    third = math.sqrt(cx * cx + cy * cy)
    for l in range(LANES):
        qx, qy, qz = px[l] - ax, py[l] - ay, pz[l] - az
        x = qx * x0 + qy * x1 + qz * x2
        y = qx * y0 + qy * y1 + qz * y2
        z = qx * z0 + qy * z1 + qz * z2
        t = x - min(max(x, 0.0), first)
        d = t * t + y * y
        rx = x - bx
        side1 = bu * y - bv * rx
        t = rx * bu + y * bv
        t = t - min(max(t, 0.0), second)
        d = min(d, t * t + side1 * side1)
        rx, ry = x - cx, y - cy
        side2 = cu * ry - cv * rx
        t = rx * cu + ry * cv
        t = t - min(max(t, 0.0), third)
        d = min(d, t * t + side2 * side2)
        within = (y > 0.0) & (side1 > 0.0) & (side2 > 0.0)
        d = (0.0 if within else d) + z * z
        nearer = d < best[l]
        best[l] = d if nearer else best[l]
        owner[l] = face if nearer else owner[l]


@kernel
def _reaches(box, px, py, pz, best):
    """Number of lanes to which *box* may hold something nearer."""
    b0, b1, b2, b3, b4, b5 = box[0], box[1], box[2], box[3], box[4], box[5]
    count = 0
    for l in range(LANES):
        x = max(max(b0 - px[l], px[l] - b3), 0.0)
        y = max(max(b1 - py[l], py[l] - b4), 0.0)
        z = max(max(b2 - pz[l], pz[l] - b5), 0.0)
        count += 1 if x * x + y * y + z * z < best[l] else 0
    return count


@kernel
def _descend(tree, rows, px, py, pz, best, owner, centre, stack, lower):
    """Squared distances and nearest triangles of all lanes, starting from the *owner* of the first and the last one."""
    one, two = owner[0], owner[LANES - 1]
    for l in range(LANES):
        best[l] = np.inf
    _closer(rows[one], one, px, py, pz, best, owner)
    if two != one:
        _closer(rows[two], two, px, py, pz, best, owner)
    stack[0] = 0
    top = 1
    while top:
        top -= 1
        node = stack[top]
        if not _reaches(tree.boxes[node], px, py, pz, best):
            continue
        start = tree.children[node, 0]
        if start >= 0:
            top = push_nearer_last(tree, node, centre, stack, lower, top)
            continue
        start = -start - 1
        for t in range(start, start + tree.children[node, 1]):
            _closer(rows[t], t, px, py, pz, best, owner)


@kernel
def fill(tree, rows, origin, spacing, values, first, last):
    """Turn winding numbers on the grid into signed distances: ``values`` (float32), pairs of layers first ≤ b < last.

    *rows* are the `frames` of the tree's triangles. A winding number above one half is inside.
    """
    nx, ny, nz = values.shape
    px, py, pz = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    best, owner = np.empty(LANES), np.zeros(LANES, np.int64)
    centre, stack, lower = np.empty(3), np.empty(DEPTH, np.int64), np.empty(DEPTH)
    columns, runs = (ny + 1) // 2, (nz + 3) // 4
    for b in range(first, last):
        owner[:] = 0  # each layer for itself, so that the result does not depend on the range
        for column in range(columns):
            for step in range(runs):
                run = step if column % 2 == 0 else runs - 1 - step  # back and forth, so that neighbours follow
                for l in range(LANES):
                    px[l] = origin[0] + spacing * min(2 * b + l // 8, nx - 1)
                    py[l] = origin[1] + spacing * min(2 * column + (l // 4) % 2, ny - 1)
                    pz[l] = origin[2] + spacing * min(4 * run + l % 4, nz - 1)
                centre[0] = 0.5 * (px[0] + px[LANES - 1])
                centre[1] = 0.5 * (py[0] + py[LANES - 1])
                centre[2] = 0.5 * (pz[0] + pz[LANES - 1])
                _descend(tree, rows, px, py, pz, best, owner, centre, stack, lower)
                for l in range(LANES):
                    i, j, k = 2 * b + l // 8, 2 * column + (l // 4) % 2, 4 * run + l % 4
                    if i < nx and j < ny and k < nz:
                        d = math.sqrt(best[l])
                        values[i, j, k] = -d if values[i, j, k] > 0.5 else d


@kernel(fast=False)
def nearest(tree, rows, points, order, out, distance, faces, first, last):
    """`rays.nearest` on lanes: for runs first ≤ r < last of `RUN` points that follow each other in *order*.

    The better neighbours in *order* are neighbours in space, the faster.
    """
    px, py, pz = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    best, owner = np.empty(LANES), np.zeros(LANES, np.int64)
    centre, stack, lower = np.empty(3), np.empty(DEPTH, np.int64), np.empty(DEPTH)
    count = order.shape[0]
    for b in range(first * RUN // LANES, min(last * RUN, count + LANES - 1) // LANES):
        if b % (RUN // LANES) == 0:
            owner[:] = 0  # each run for itself, so that the result does not depend on the range
        centre[:] = 0.0
        for l in range(LANES):
            n = order[min(LANES * b + l, count - 1)]
            px[l], py[l], pz[l] = points[n, 0], points[n, 1], points[n, 2]
            for k in range(3):
                centre[k] += points[n, k] / LANES
        _descend(tree, rows, px, py, pz, best, owner, centre, stack, lower)
        for l in range(min(LANES, count - LANES * b)):
            n = order[LANES * b + l]
            distance[n] = math.sqrt(_nearest_on_triangle(points[n], tree.triangles[owner[l]], out[n]))
            faces[n] = tree.order[owner[l]]


@kernel
def brackets(field, points, low, high):
    """Bounds of the distance at ``points (N, 3)`` within the grid that follow from the corners of the cell alone."""
    v = field.values
    for n in range(points.shape[0]):
        u0 = (points[n, 0] - field.origin[0]) / field.spacing
        u1 = (points[n, 1] - field.origin[1]) / field.spacing
        u2 = (points[n, 2] - field.origin[2]) / field.spacing
        i = min(max(int(u0), 0), v.shape[0] - 2)
        j = min(max(int(u1), 0), v.shape[1] - 2)
        k = min(max(int(u2), 0), v.shape[2] - 2)
        low[n], high[n] = -np.inf, np.inf
        for corner in range(8):
            a, b, c = i + corner // 4, j + (corner // 2) % 2, k + corner % 2
            reach = field.spacing * math.sqrt((u0 - a) ** 2 + (u1 - b) ** 2 + (u2 - c) ** 2)
            reach += 1.2e-7 * abs(v[a, b, c])  # float32
            low[n] = max(low[n], v[a, b, c] - reach)
            high[n] = min(high[n], v[a, b, c] + reach)
