"""The surface of a body as perception needs it: nearest points, first hits of rays, visible samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array, IntArray
from ..kernels import depth, rays
from ..parallel import over_ranges

if TYPE_CHECKING:
    from ..bodies import Body

SAMPLES = 600


class ModelSurface:
    """Answers queries in the frame of the body."""

    def __init__(self, body: Body) -> None:
        self.body = body
        vertices = np.ascontiguousarray(body.vertices, dtype=np.float64)
        faces = np.ascontiguousarray(body.faces, dtype=np.int64)
        self.tree = rays.Tree(*rays.build(vertices, faces))
        points, inward, _ = body.sample_surface(SAMPLES, np.random.default_rng(0))
        self.points: Array = points
        self.outward: Array = -inward
        self.hull: Array = _extreme_points(vertices)

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Closest surface points (N, 3) and distances (N,) of points (N, 3)."""
        p = np.ascontiguousarray(points)
        out, distance, face = np.empty_like(p), np.empty(len(p)), np.empty(len(p), dtype=np.int64)
        over_ranges(lambda a, b: rays.nearest(self.tree, p[a:b], out[a:b], distance[a:b], face[a:b]), len(p), grain=512)
        return out, distance

    def nearest_facing(self, points: Array, toward: Array) -> tuple[Array, Array]:
        """Closest points (N, 3) to *points* on the side that faces the directions *toward* (N, 3), and distances (N,).

        A thin wall then never swaps its sides. For a mesh that does not enclose a volume, and so has no
        outside, any side counts.
        """
        p, w = np.ascontiguousarray(points), np.ascontiguousarray(toward)
        if not self.body.watertight:
            return self.nearest(p)
        out, distance = np.empty_like(p), np.empty(len(p))
        over_ranges(
            lambda a, b: depth.nearest_facing(self.tree, p[a:b], w[a:b], out[a:b], distance[a:b]), len(p), grain=512
        )
        return out, distance

    def first_hits(self, origin: Array, directions: Array) -> Array:
        """Smallest t (N,) at which ``origin + t direction`` meets the surface; inf where it does not."""
        o, d = np.ascontiguousarray(origin), np.ascontiguousarray(directions)
        times = np.empty(len(d))
        over_ranges(lambda a, b: depth.first_hits(self.tree, o, d[a:b], times[a:b]), len(d), grain=512)
        return times


def _extreme_points(vertices: Array) -> Array:
    """Corners of the convex hull (all vertices where it is flat)."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners: IntArray = np.asarray(ConvexHull(vertices).vertices, dtype=np.int64)
    except QhullError:
        return vertices
    return np.asarray(vertices[corners])
