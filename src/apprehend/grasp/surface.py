"""A triangle mesh that answers rays and nearest-point queries in batches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_array, as_shaped, spread
from ..errors import InputError, MeshError
from ..kernels import rays
from ..parallel import over_ranges


@dataclass(frozen=True, eq=False)
class Crossings:
    """Where rays cross a surface, each row sorted by distance; entries from ``counts`` on are padding.

    ``times (N, K)``: t of ``origin + t direction`` (inf as padding); ``faces (N, K)`` (−1 as padding);
    ``entering (N, K)``: whether the ray passes against the face normal; ``counts (N,)``.
    """

    times: Array
    faces: IntArray
    entering: BoolArray
    counts: IntArray


class Surface:
    """The surface of a mesh: ``vertices (V, 3)``, ``faces (F, 3)`` with normals by the right-hand rule.

    Rays are watertight (see `kernels.rays`): a ray through a closed mesh never slips between two faces.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        self.vertices: Array = as_shaped(vertices, "vertices", 3).reshape(-1, 3)
        self.faces: IntArray = np.ascontiguousarray(faces, dtype=np.int64).reshape(-1, 3)
        if not len(self.faces):
            raise MeshError("the mesh has no faces; a surface needs at least one triangle")
        if self.faces.min() < 0 or self.faces.max() >= len(self.vertices):
            raise MeshError(
                f"faces refer to vertex {int(self.faces.max())}, but there are {len(self.vertices)} vertices (0-based)"
            )
        corners = self.vertices[self.faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(cross, axis=1)
        self.areas: Array = 0.5 * length
        self.normals: Array = cross / np.maximum(length, 1e-300)[:, None]
        self.tree = rays.Tree(*rays.build(self.vertices, self.faces))

    def crossings(
        self, origins: ArrayLike, directions: ArrayLike, low: float = 0.0, high: float = np.inf, capacity: int = 16
    ) -> Crossings:
        """Every crossing of the rays ``origins (N, 3)``, ``directions (N, 3)`` with ``low <= t <= high``."""
        o = as_shaped(origins, "origins", 3).reshape(-1, 3)
        d = spread(as_shaped(directions, "directions", 3), o.shape)
        if not (d != 0.0).any(axis=1).all():
            raise InputError("a ray direction is zero; every direction needs a length")
        n = len(o)
        while True:
            times = np.full((n, capacity), np.inf)
            faces = np.full((n, capacity), -1, np.int64)
            signs = np.zeros((n, capacity), np.int64)
            counts = np.zeros(n, np.int64)

            def work(a: int, b: int) -> None:
                rays.cast(
                    self.tree, o[a:b], d[a:b], float(low), float(high),
                    times[a:b], faces[a:b], signs[a:b], counts[a:b],  # noqa: B023
                )  # fmt: skip

            over_ranges(work, n, 256)
            most = int(counts.max(initial=0))
            if most <= capacity:
                return Crossings(times, faces, signs > 0, counts)
            capacity = 2 * most

    def nearest(self, points: ArrayLike) -> tuple[Array, Array, IntArray]:
        """Closest points ``(N, 3)`` of the surface, their distances ``(N,)`` and their faces ``(N,)``."""
        p = as_shaped(points, "points", 3).reshape(-1, 3)
        out, distance, faces = np.empty_like(p), np.empty(len(p)), np.empty(len(p), np.int64)
        over_ranges(lambda a, b: rays.nearest(self.tree, p[a:b], out[a:b], distance[a:b], faces[a:b]), len(p), 256)
        return out, distance, faces

    def contains(self, points: ArrayLike) -> BoolArray:
        """Whether points lie inside a closed surface: the crossings of one ray each are odd in number."""
        p = as_array(points, "points").reshape(-1, 3)
        direction = np.array([0.5377, 0.3621, 0.7613])
        inside: BoolArray = self.crossings(p, direction).counts % 2 == 1
        return inside
