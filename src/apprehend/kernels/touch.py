"""Distance of convex shapes from a triangle mesh, exact, with the nearest points: many shapes at many poses."""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .gjk import AXIS, NEAR, REL, ROWS, gjk, witnesses
from .rays import DEPTH

GAP = 1e-7
"""Relative accuracy of a distance."""


@kernel(fast=False)
def _enclose(pose, half, box):  # type: ignore[no-untyped-def]
    """The box along the mesh's axes around a shape's own box of half extents *half* at *pose*."""
    for i in range(3):
        e = 0.0
        for k in range(3):
            e += abs(pose[i, k]) * half[k]
        box[i], box[i + 3] = pose[i, 3] - e, pose[i, 3] + e


@kernel(fast=False)
def _apart(a, b):  # type: ignore[no-untyped-def]
    """Squared distance of two boxes along the axes."""
    total = 0.0
    for k in range(3):
        d = max(a[k] - b[k + 3], b[k] - a[k + 3], 0.0)
        total += d * d
    return total


@kernel(fast=False)
def _from_centre(pose, box):  # type: ignore[no-untyped-def]
    """Squared distance of the shape's origin from a box."""
    total = 0.0
    for k in range(3):
        d = max(box[k] - pose[k, 3], pose[k, 3] - box[k + 3], 0.0)
        total += d * d
    return total


@kernel(fast=False)
def _behind(plane, box, best):  # type: ignore[no-untyped-def]
    """Whether a box lies at least *best* behind the plane ``n·x = d`` that the shape does not cross."""
    reach = 0.0
    for k in range(3):
        reach += plane[k] * (box[k + 3] if plane[k] > 0.0 else box[k])
    return plane[3] - reach >= best


@kernel(fast=False)
def _to_shape(pose, triangle, points, first, box):  # type: ignore[no-untyped-def]
    """The triangle's corners in the frame of the shape, into ``points[first:]``, and its box along the mesh's axes."""
    for k in range(3):
        box[k] = min(triangle[0, k], triangle[1, k], triangle[2, k])
        box[k + 3] = max(triangle[0, k], triangle[1, k], triangle[2, k])
    for c in range(3):
        x, y, z = triangle[c, 0] - pose[0, 3], triangle[c, 1] - pose[1, 3], triangle[c, 2] - pose[2, 3]
        for k in range(3):
            points[first + c, k] = pose[0, k] * x + pose[1, k] * y + pose[2, k] * z


@kernel(fast=False)
def distances(tree, ints, floats, points, graph, poses, wanted, within, distance, near):  # type: ignore[no-untyped-def]
    """Distance of each shape from the surface: ``poses (N, S, 4, 4)`` T_mesh_shape of the S shapes (`gjk` has their
    layout; the last row is the triangle, its corners the last three of *points*, which are overwritten).

    Only ``wanted (N, S)`` are looked at; others, and what is farther than *within*, get *within*. *distance*
    ``(N, S)`` is 0 or less where they overlap; *near* ``(N, S, 2, 3)``: the nearest points on shape and mesh, in the
    frame of the mesh.
    """
    N, S = poses.shape[0], poses.shape[1]
    first = points.shape[0] - 3
    corners = points.copy()
    ws = np.zeros((ROWS, 12))
    box, small, plane = np.empty(6), np.empty(6), np.zeros(4)
    stack, lower = np.empty(DEPTH, np.int64), np.empty(DEPTH)
    ws[REL, 0], ws[REL, 4], ws[REL, 8] = 1.0, 1.0, 1.0
    for n in range(N):
        for s in range(S):
            distance[n, s] = within
            if not wanted[n, s]:
                continue
            pose, radius, best = poses[n, s], floats[s, 3], within
            _enclose(pose, floats[s, 20:23], box)
            plane[:] = 0.0
            plane[3] = -np.inf
            stack[0], lower[0] = 0, _apart(box, tree.boxes[0])
            top = 1
            while top:
                top -= 1
                if lower[top] >= max(best, 0.0) ** 2 or best <= 0.0:
                    continue
                node = stack[top]
                if _behind(plane, tree.boxes[node], best):
                    continue
                child = tree.children[node, 0]
                if child >= 0:
                    other = tree.children[node, 1]
                    if _from_centre(pose, tree.boxes[child]) < _from_centre(pose, tree.boxes[other]):
                        child, other = other, child
                    stack[top], lower[top] = child, _apart(box, tree.boxes[child])
                    stack[top + 1], lower[top + 1] = other, _apart(box, tree.boxes[other])
                    top += 2
                    continue
                child = -child - 1
                for t in range(child, child + tree.children[node, 1]):
                    _to_shape(pose, tree.triangles[t], corners, first, small)
                    if best <= 0.0 or _apart(box, small) >= best * best or _behind(plane, small, best):
                        continue
                    for c in range(5):
                        ws[AXIS, c] = 0.0
                    rows, _, upper = gjk(ints, floats, corners, graph, s, S, ws, best + radius, 0.0, GAP)
                    if rows == 0 or upper - radius >= best:
                        continue
                    best = upper - radius
                    if rows == 4 or upper <= 0.0:
                        best = -radius
                        continue
                    witnesses(ws, rows)
                    for i in range(3):
                        near[n, s, 0, i], near[n, s, 1, i] = pose[i, 3], pose[i, 3]
                        for k in range(3):
                            on = ws[NEAR, k] - radius * ws[AXIS, k] / upper
                            near[n, s, 0, i] += pose[i, k] * on
                            near[n, s, 1, i] += pose[i, k] * ws[NEAR, 3 + k]
                    plane[3] = 0.0
                    for i in range(3):
                        plane[i] = 0.0
                        for k in range(3):
                            plane[i] += pose[i, k] * ws[AXIS, k] / upper
                        plane[3] += plane[i] * near[n, s, 0, i]
            distance[n, s] = best
