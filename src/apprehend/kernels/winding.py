"""Inside or outside: winding numbers of triangle meshes, on points and on grids.

A closed mesh is crossed by a ray towards +z; leaving counts +1, entering −1. A triangle is crossed where its
projection along z winds round the point, and that is summed over its edges by a rule that depends on the edge alone:
what one triangle of an edge gains, its neighbour loses, whatever the rounding. So nothing slips through an edge or a
corner. An open mesh is closed with caps over its rims first; the generalised winding number (Jacobson, Kavan &
Sorkine-Hornung 2013) is that of the closed mesh less the caps' solid angles over 4π.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .rays import DEPTH

FAR = 3.0
"""A cluster of cap triangles counts as one dipole from this many of its radii on."""


@kernel(fast=False)
def _crossing(ax, ay, bx, by, y):
    """Where the line y = const crosses the edge a → b: its x, and +1 upwards, −1 downwards, 0 if it does not."""
    if ay <= y < by:
        return ax + (y - ay) * ((bx - ax) / (by - ay)), 1
    if by <= y < ay:
        return bx + (y - by) * ((ax - bx) / (ay - by)), -1
    return 0.0, 0


@kernel(fast=False)
def _height(t, x, y):
    """z of the plane of triangle *t* at (x, y), kept within the triangle's own range."""
    e1, e2 = t[1] - t[0], t[2] - t[0]
    nx, ny, nz = e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0]
    low, high = min(t[0, 2], t[1, 2], t[2, 2]), max(t[0, 2], t[1, 2], t[2, 2])
    if nz == 0.0:
        return low
    z = t[0, 2] - ((x - t[0, 0]) * nx + (y - t[0, 1]) * ny) / nz
    return min(max(z, low), high)


@kernel(fast=False)
def scan(triangles, origin, spacing, values):
    """Add to ``values (nx, ny, nz)``, at the first grid point above each crossing, the change of the winding number.

    Summed up along z (`accumulate`) these are the winding numbers of the grid points.
    """
    nx, ny, nz = values.shape
    for f in range(triangles.shape[0]):
        t = triangles[f]
        low, high = min(t[0, 1], t[1, 1], t[2, 1]), max(t[0, 1], t[1, 1], t[2, 1])
        j0 = max(0, math.floor((low - origin[1]) / spacing))
        j1 = min(ny - 1, math.ceil((high - origin[1]) / spacing))
        for j in range(j0, j1 + 1):
            y = origin[1] + spacing * j
            lowest, highest = nx, 0
            sign = 0
            for e in range(3):
                a, b = t[e], t[(e + 1) % 3]
                x, way = _crossing(a[0], a[1], b[0], b[1], y)
                if way != 0:
                    count = min(max(math.ceil((x - origin[0]) / spacing), 0), nx)  # grid points left of it
                    if count > highest or (count == highest and sign == 0):
                        sign = way
                    lowest, highest = min(lowest, count), max(highest, count)
            for i in range(lowest, highest):
                x = origin[0] + spacing * i
                k = math.ceil((_height(t, x, y) - origin[2]) / spacing)
                if k < nz:
                    values[i, j, max(k, 0)] -= sign


@kernel
def accumulate(values, first, last):
    """Sum up along z the layers ``first ≤ i < last``."""
    for i in range(first, last):
        for j in range(values.shape[1]):
            for k in range(1, values.shape[2]):
                values[i, j, k] += values[i, j, k - 1]


@kernel(fast=False)
def count(tree, points, out):
    """Add to ``out (N,)`` the signed number of crossings of the ray from each point towards +z."""
    stack = np.empty(DEPTH, np.int64)
    for n in range(points.shape[0]):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        stack[0] = 0
        top, total = 1, 0
        while top:
            top -= 1
            node = stack[top]
            box = tree.boxes[node]
            if x < box[0] or x > box[3] or y < box[1] or y > box[4] or z > box[5]:
                continue
            first = tree.children[node, 0]
            if first >= 0:
                stack[top], stack[top + 1] = first, tree.children[node, 1]
                top += 2
                continue
            first = -first - 1
            for i in range(first, first + tree.children[node, 1]):
                t = tree.triangles[i]
                turns = 0
                for e in range(3):
                    a, b = t[e], t[(e + 1) % 3]
                    at, way = _crossing(a[0], a[1], b[0], b[1], y)
                    if way != 0 and x < at:
                        turns += way
                if turns != 0 and _height(t, x, y) > z:
                    total += turns
        out[n] += total


@kernel
def solid_angle(t, x, y, z):
    """Signed solid angle of a triangle seen from a point (Van Oosterom & Strackee 1983)."""
    ax, ay, az = t[0, 0] - x, t[0, 1] - y, t[0, 2] - z
    bx, by, bz = t[1, 0] - x, t[1, 1] - y, t[1, 2] - z
    cx, cy, cz = t[2, 0] - x, t[2, 1] - y, t[2, 2] - z
    la, lb = math.sqrt(ax * ax + ay * ay + az * az), math.sqrt(bx * bx + by * by + bz * bz)
    lc = math.sqrt(cx * cx + cy * cy + cz * cz)
    up = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    ab, bc, ca = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az
    return 2.0 * math.atan2(up, la * lb * lc + ab * lc + bc * la + ca * lb)


@kernel
def dipoles(tree):
    """For every node of *tree* ``(M, 8)``: centre of its area, area vector, radius about that centre, and area."""
    boxes, children = tree.boxes, tree.children
    out = np.zeros((boxes.shape[0], 8))
    for node in range(boxes.shape[0] - 1, -1, -1):  # children follow their parents
        row = out[node]
        first = children[node, 0]
        if first >= 0:
            for child in (first, children[node, 1]):
                for k in range(3):
                    row[k] += out[child, 7] * out[child, k]
                    row[3 + k] += out[child, 3 + k]
                row[7] += out[child, 7]
        else:
            first = -first - 1
            for i in range(first, first + children[node, 1]):
                t = tree.triangles[i]
                ux, uy, uz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
                vx, vy, vz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
                nx, ny, nz = 0.5 * (uy * vz - uz * vy), 0.5 * (uz * vx - ux * vz), 0.5 * (ux * vy - uy * vx)
                area = math.sqrt(nx * nx + ny * ny + nz * nz)
                for k in range(3):
                    row[k] += area * (t[0, k] + t[1, k] + t[2, k]) / 3.0
                row[3] += nx
                row[4] += ny
                row[5] += nz
                row[7] += area
        far = 0.0
        for k in range(3):
            low, high = boxes[node, k], boxes[node, 3 + k]
            row[k] = row[k] / row[7] if row[7] > 0.0 else 0.5 * (low + high)
            far += max(row[k] - low, high - row[k]) ** 2
        row[6] = math.sqrt(far)
    return out


@kernel
def caps_at(tree, moments, exact, stack, x, y, z):
    """Winding number of the triangles of *tree* at a point; unless *exact*, far clusters count as dipoles."""
    stack[0] = 0
    top, total = 1, 0.0
    while top:
        top -= 1
        node = stack[top]
        m = moments[node]
        dx, dy, dz = m[0] - x, m[1] - y, m[2] - z
        squared = dx * dx + dy * dy + dz * dz
        if not exact and squared > FAR * FAR * m[6] * m[6]:
            total += (dx * m[3] + dy * m[4] + dz * m[5]) / (squared * math.sqrt(squared))
            continue
        first = tree.children[node, 0]
        if first >= 0:
            stack[top], stack[top + 1] = first, tree.children[node, 1]
            top += 2
            continue
        first = -first - 1
        for i in range(first, first + tree.children[node, 1]):
            total += solid_angle(tree.triangles[i], x, y, z)
    return total / (4.0 * math.pi)


@kernel
def without_caps(tree, moments, exact, points, out):
    """Subtract the winding number of the caps from ``out (N,)`` at ``points (N, 3)``."""
    stack = np.empty(DEPTH, np.int64)
    for n in range(points.shape[0]):
        out[n] -= caps_at(tree, moments, exact, stack, points[n, 0], points[n, 1], points[n, 2])


@kernel
def grid_without_caps(tree, moments, origin, spacing, values, first, last):
    """Subtract the winding number of the caps from the layers ``first ≤ i < last`` of a grid."""
    stack = np.empty(DEPTH, np.int64)
    for i in range(first, last):
        for j in range(values.shape[1]):
            for k in range(values.shape[2]):
                x, y, z = origin[0] + spacing * i, origin[1] + spacing * j, origin[2] + spacing * k
                values[i, j, k] -= caps_at(tree, moments, False, stack, x, y, z)
