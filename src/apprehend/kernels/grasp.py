"""Collision of convex pieces of a hand with a triangle mesh and with half-spaces, for many poses of the hand."""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .rays import DEPTH, _hits

POLYGON = 96
"""Room for the corners of a triangle clipped by a convex piece."""


@kernel
def _clipped(triangle, planes, first, last, margin, polygon, spare):  # type: ignore[no-untyped-def]
    """Whether a triangle meets the convex piece ``n·x ≤ d + margin``: clip it by every plane (Sutherland–Hodgman)."""
    for p in range(first, last):  # most triangles lie wholly outside one plane
        outside = True
        for j in range(3):
            v = planes[p, 0] * triangle[j, 0] + planes[p, 1] * triangle[j, 1] + planes[p, 2] * triangle[j, 2]
            if v <= planes[p, 3] + margin:
                outside = False
        if outside:
            return False
    count = 3
    for j in range(3):
        for k in range(3):
            polygon[j, k] = triangle[j, k]
    for p in range(first, last):
        a, b, c, d = planes[p, 0], planes[p, 1], planes[p, 2], planes[p, 3] + margin
        kept = 0
        for j in range(count):
            i = j - 1 if j else count - 1
            u = a * polygon[i, 0] + b * polygon[i, 1] + c * polygon[i, 2] - d
            v = a * polygon[j, 0] + b * polygon[j, 1] + c * polygon[j, 2] - d
            if (u < 0.0) != (v < 0.0) and kept < POLYGON:
                t = u / (u - v)
                for k in range(3):
                    spare[kept, k] = polygon[i, k] + t * (polygon[j, k] - polygon[i, k])
                kept += 1
            if v <= 0.0 and kept < POLYGON:
                for k in range(3):
                    spare[kept, k] = polygon[j, k]
                kept += 1
        if kept == 0:
            return False
        count = kept
        polygon, spare = spare, polygon
    return True


@kernel
def _box_outside(box, planes, first, last, margin):  # type: ignore[no-untyped-def]
    for p in range(first, last):
        value = -planes[p, 3] - margin
        for k in range(3):
            value += planes[p, k] * (box[k] if planes[p, k] > 0.0 else box[k + 3])
        if value > 0.0:
            return True
    return False


@kernel
def hand_hits(tree, poses, level, planes, plane_start, corners, corner_start, margins, table, table_margin, out):  # type: ignore[no-untyped-def]
    """First obstacle of each hand pose.

    ``poses (N, 4, 4)`` T_body_hand; ``level (N,)`` picks a posture; ``planes (L, P, 4)`` with ``n·x ≤ d`` and
    ``corners (L, V, 3)`` of the convex pieces in the hand frame; ``margins (pieces,)`` grow each piece;
    ``table (K, 4)`` keeps ``n·x ≥ d``. *out*: −1 free, i hit by piece i, ``pieces + k`` table k.
    """
    pieces = plane_start.shape[0] - 1
    moved = np.empty((planes.shape[1], 4))
    polygon, spare = np.empty((POLYGON + 1, 3)), np.empty((POLYGON + 1, 3))
    stack = np.empty(DEPTH, np.int64)
    for n in range(poses.shape[0]):
        T, g = poses[n], level[n]
        out[n] = -1
        for k in range(table.shape[0]):
            d = table[k, 3] + table_margin
            a0, a1, a2 = 0.0, 0.0, 0.0
            for i in range(3):
                a0 += table[k, i] * T[i, 0]
                a1 += table[k, i] * T[i, 1]
                a2 += table[k, i] * T[i, 2]
                d -= table[k, i] * T[i, 3]
            for v in range(corners.shape[1]):
                if a0 * corners[g, v, 0] + a1 * corners[g, v, 1] + a2 * corners[g, v, 2] < d:
                    out[n] = pieces + k
                    break
            if out[n] >= 0:
                break
        if out[n] >= 0:
            continue
        for p in range(planes.shape[1]):
            for i in range(3):
                moved[p, i] = T[i, 0] * planes[g, p, 0] + T[i, 1] * planes[g, p, 1] + T[i, 2] * planes[g, p, 2]
            moved[p, 3] = planes[g, p, 3] + moved[p, 0] * T[0, 3] + moved[p, 1] * T[1, 3] + moved[p, 2] * T[2, 3]
        for s in range(pieces):
            first, last = plane_start[s], plane_start[s + 1]
            stack[0] = 0
            top = 1
            while top and out[n] < 0:
                top -= 1
                node = stack[top]
                if _box_outside(tree.boxes[node], moved, first, last, margins[s]):
                    continue
                child = tree.children[node, 0]
                if child >= 0:
                    stack[top] = child
                    stack[top + 1] = tree.children[node, 1]
                    top += 2
                    continue
                child = -child - 1
                for i in range(child, child + tree.children[node, 1]):
                    if _clipped(tree.triangles[i], moved, first, last, margins[s], polygon, spare):
                        out[n] = s
                        break
            if out[n] >= 0:
                break


@kernel(fast=False)
def patches(tree, normals, poses, half_opening, half_y, half_z, cells, depth, out):  # type: ignore[no-untyped-def]
    """Where two flat pads come to rest on a surface, and over what patch they touch.

    ``poses (N, 4, 4)`` T_body_tcp with x from pad 1 to pad 0; *half_opening* ``(N,)``; pads reach ``±half_y``,
    ``±half_z``. A grid of ``cells × cells`` rays along x finds, between the open pads, the outermost surface on each
    side. A pad rests on the cell that stands out most and touches all that lie less than *depth* behind.
    *out* ``(N, 2, 10)`` for pad 0 and pad 1: resting x, centroid (x, y, z in the tcp frame), mean inward normal
    (body frame), covered fraction, mean distance from the centroid, count of cells.
    """
    grid = cells * cells
    reach = np.empty((2, grid))
    face = np.empty((2, grid), np.int64)
    origin, direction = np.empty(3), np.empty(3)
    times, faces, signs = np.empty(64), np.empty(64, np.int64), np.empty(64, np.int64)
    for n in range(poses.shape[0]):
        T, h = poses[n], half_opening[n]
        for c in range(grid):
            y = half_y * (2.0 * (c // cells) + 1.0 - cells) / cells
            z = half_z * (2.0 * (c % cells) + 1.0 - cells) / cells
            for k in range(3):
                direction[k] = T[k, 0]
                origin[k] = T[k, 3] + T[k, 1] * y + T[k, 2] * z - h * T[k, 0]
            found = min(_hits(tree, origin, direction, 0.0, 2.0 * h, times, faces, signs), 64)
            reach[0, c], reach[1, c] = -np.inf, np.inf
            face[0, c], face[1, c] = -1, -1
            for i in range(found):
                x = times[i] - h
                if signs[i] < 0 and x > reach[0, c]:
                    reach[0, c], face[0, c] = x, faces[i]
                if signs[i] > 0 and x < reach[1, c]:
                    reach[1, c], face[1, c] = x, faces[i]
        for pad in range(2):
            o = out[n, pad]
            o[:] = 0.0
            rest = -np.inf if pad == 0 else np.inf
            for c in range(grid):
                if face[pad, c] >= 0:
                    rest = max(rest, reach[0, c]) if pad == 0 else min(rest, reach[1, c])
            o[0] = rest
            count = 0
            for c in range(grid):
                if face[pad, c] >= 0 and abs(reach[pad, c] - rest) <= depth:
                    count += 1
                    o[1] += reach[pad, c]
                    o[2] += half_y * (2.0 * (c // cells) + 1.0 - cells) / cells
                    o[3] += half_z * (2.0 * (c % cells) + 1.0 - cells) / cells
                    for k in range(3):
                        o[4 + k] -= normals[face[pad, c], k]
            if count == 0:
                continue
            length = np.sqrt(o[4] ** 2 + o[5] ** 2 + o[6] ** 2)
            for k in range(3):
                o[1 + k] /= count
                o[4 + k] = o[4 + k] / length if length > 0.0 else 0.0
            own = (half_y * half_y + half_z * half_z) / (3.0 * grid)
            for c in range(grid):
                if face[pad, c] >= 0 and abs(reach[pad, c] - rest) <= depth:
                    y = half_y * (2.0 * (c // cells) + 1.0 - cells) / cells - o[2]
                    z = half_z * (2.0 * (c % cells) + 1.0 - cells) / cells - o[3]
                    o[8] += np.sqrt(y * y + z * z + own)
            o[7] = count / grid
            o[8] /= count
            o[9] = count
