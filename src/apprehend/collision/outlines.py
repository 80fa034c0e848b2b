"""Geometry as triangles, for pictures."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, IntArray
from ..kernels.gjk import support
from .geometry import Geometry, pack
from .obstacles import Cloud, Grid, HalfSpace, Union
from .shapes import Convex

DIRECTIONS = 400
PATCH = 1.5
"""Half a side in m of the square that stands for a half-space."""

MOST = 3000
"""Most points of a cloud that are drawn."""

SPECK = 0.002
"""Radius in m at which bare points are drawn."""


def triangles(shape: Geometry) -> tuple[Array, IntArray]:
    """Vertices ``(V, 3)`` in the carrier's frame and faces ``(F, 3)``; round shapes approximated from inside.

    Half-spaces become a square patch, clouds octahedra, fields the points where they cross their grid.
    """
    if isinstance(shape, Grid):
        return triangles(Cloud(shape.crossings.points, 0.25 * shape.spacing, shape.pose))
    if isinstance(shape, HalfSpace):
        local = PATCH * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
        faces = np.array([[0, 1, 2], [0, 2, 3]])
    elif isinstance(shape, Cloud):
        step = -(-len(shape.points) // MOST)
        corners = max(shape.radius, SPECK) * np.concatenate([np.eye(3), -np.eye(3)])
        one = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
        points = shape.points[::step]
        local = (points[:, None] + corners).reshape(-1, 3)
        faces = (6 * np.arange(len(points))[:, None, None] + one).reshape(-1, 3)
    elif isinstance(shape, Union):
        parts = [triangles(part) for part in shape.shapes]
        starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
        local = np.concatenate([vertices for vertices, _ in parts])
        faces = np.concatenate([part + start for (_, part), start in zip(parts, starts, strict=True)])
    else:
        local, faces = _convex(shape)
    return local @ shape.pose[:3, :3].T + shape.pose[:3, 3], faces.astype(np.int64)


def _convex(shape: Geometry) -> tuple[Array, IntArray]:
    """The hull of the farthest points in many directions."""
    if isinstance(shape, Convex) and shape.radius == 0.0 and (len(shape.faces) or len(shape.points) == 3):
        return shape.points, shape.faces if len(shape.faces) else np.array([[0, 1, 2]])
    i = np.arange(DIRECTIONS) + 0.5  # a spiral of even density
    z, turn = 1.0 - 2.0 * i / DIRECTIONS, np.pi * (1.0 + np.sqrt(5.0)) * i
    ways = np.column_stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z])
    arrays = pack((shape,))[:4]
    far = np.array([support(*arrays, 0, *d, 0.0)[:3] for d in ways]) + shape.radius * ways
    if np.linalg.matrix_rank(far - far.mean(axis=0), tol=1e-9) < 3:
        far = np.concatenate([far, far + 1e-4 * ways])
    hull = Convex.hull(far)
    return hull.points @ hull.pose[:3, :3].T + hull.pose[:3, 3], hull.faces
