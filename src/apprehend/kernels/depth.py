"""What a depth camera sees of a triangle mesh: first hits of rays, and nearest points on the side that faces it."""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .rays import DEPTH, _nearest_on_triangle, push_nearer_last


@kernel
def first_hits(tree, origin, directions, times):  # type: ignore[no-untyped-def]
    """Smallest t > 0 with ``origin + t direction`` on the mesh, per direction; inf where there is none.

    *tree* is a `rays.Tree`. The triangle test is that of Möller and Trumbore (1997).
    """
    stack = np.empty(DEPTH, np.int64)
    entry = np.empty(DEPTH)
    ox, oy, oz = origin[0], origin[1], origin[2]
    for n in range(directions.shape[0]):
        dx, dy, dz = directions[n, 0], directions[n, 1], directions[n, 2]
        ix = 1.0 / dx if dx != 0.0 else 1e300
        iy = 1.0 / dy if dy != 0.0 else 1e300
        iz = 1.0 / dz if dz != 0.0 else 1e300
        best = 1e300
        stack[0], entry[0] = 0, 0.0
        top = 1
        while top:
            top -= 1
            if entry[top] >= best:
                continue
            node = stack[top]
            first = tree.children[node, 0]
            if first >= 0:
                for k in range(2):
                    child = tree.children[node, 1 - k]
                    box = tree.boxes[child]
                    a, b = (box[0] - ox) * ix, (box[3] - ox) * ix
                    near, far = min(a, b), max(a, b)
                    a, b = (box[1] - oy) * iy, (box[4] - oy) * iy
                    near, far = max(near, min(a, b)), min(far, max(a, b))
                    a, b = (box[2] - oz) * iz, (box[5] - oz) * iz
                    near, far = max(near, min(a, b)), min(far, max(a, b))
                    if near <= far and far > 0.0 and near < best:
                        stack[top], entry[top] = child, near
                        top += 1
                continue
            first = -first - 1
            for i in range(first, first + tree.children[node, 1]):
                p = tree.triangles[i]
                ax, ay, az = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[1, 2] - p[0, 2]
                bx, by, bz = p[2, 0] - p[0, 0], p[2, 1] - p[0, 1], p[2, 2] - p[0, 2]
                px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
                det = ax * px + ay * py + az * pz
                if det == 0.0:
                    continue
                sx, sy, sz = ox - p[0, 0], oy - p[0, 1], oz - p[0, 2]
                u = (sx * px + sy * py + sz * pz) / det
                if u < -1e-12 or u > 1.0 + 1e-12:
                    continue
                qx, qy, qz = sy * az - sz * ay, sz * ax - sx * az, sx * ay - sy * ax
                v = (dx * qx + dy * qy + dz * qz) / det
                if v < -1e-12 or u + v > 1.0 + 1e-12:
                    continue
                t = (bx * qx + by * qy + bz * qz) / det
                if 0.0 < t < best:
                    best = t
        times[n] = best if best < 1e300 else np.inf


@kernel
def nearest_facing(tree, points, toward, out, distance):  # type: ignore[no-untyped-def]
    """Closest point to each of *points* on triangles whose outward side faces *toward* ``(N, 3)``, and its distance.

    Where no triangle faces that way the distance is inf and the point itself is returned.
    """
    stack = np.empty(DEPTH, np.int64)
    lower = np.empty(DEPTH)
    trial = np.empty(3)
    for n in range(points.shape[0]):
        p = points[n]
        wx, wy, wz = toward[n, 0], toward[n, 1], toward[n, 2]
        best = np.inf
        out[n] = p
        stack[0], lower[0] = 0, 0.0
        top = 1
        while top:
            top -= 1
            if lower[top] >= best:
                continue
            node = stack[top]
            first = tree.children[node, 0]
            if first >= 0:
                top = push_nearer_last(tree, node, p, stack, lower, top)
                continue
            first = -first - 1
            for i in range(first, first + tree.children[node, 1]):
                c = tree.triangles[i]
                ax, ay, az = c[1, 0] - c[0, 0], c[1, 1] - c[0, 1], c[1, 2] - c[0, 2]
                bx, by, bz = c[2, 0] - c[0, 0], c[2, 1] - c[0, 1], c[2, 2] - c[0, 2]
                facing = wx * (ay * bz - az * by) + wy * (az * bx - ax * bz) + wz * (ax * by - ay * bx)
                if facing <= 0.0:
                    continue
                squared = _nearest_on_triangle(p, c, trial)
                if squared < best:
                    best = squared
                    out[n] = trial
        distance[n] = np.sqrt(best)
