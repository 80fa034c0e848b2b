"""What a body answers about points: nearest point of the surface, inside or outside, signed distance."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray
from .index import MeshIndex, Nearest

if TYPE_CHECKING:
    from .distance_field import DistanceField


class Queries:
    """Questions about points in the body's frame, all in batches ``(..., 3)``."""

    name: str
    vertices: Array
    faces: IntArray

    @cached_property
    def index(self) -> MeshIndex:
        """The triangles of the surface in a tree; made when the first question is asked."""
        return MeshIndex(self.vertices, self.faces)

    def closest_point(self, points: ArrayLike) -> Nearest:
        """The nearest point of the surface to each of *points* ``(..., 3)``, its distance and its face."""
        return self.index.nearest(points)

    def signed_distance(self, points: ArrayLike) -> Array:
        """Exact distance ``(...)`` of *points* ``(..., 3)`` from the surface in m, negative inside."""
        return self.index.signed_distance(points)

    def inside(self, points: ArrayLike) -> BoolArray:
        """Whether *points* ``(..., 3)`` lie inside: generalised winding number above one half (see `MeshIndex`)."""
        return self.index.inside(points)

    def distance_field(self, resolution: float = 0.002, *, margin: float | None = None) -> DistanceField:
        """Signed distances on a grid of *resolution* m that reaches *margin* m beyond the body (None: 5 % of its size).

        Exact at the grid points, trilinear between them, with a stated bound: see `bodies.DistanceField`.
        """
        from .distance_field import DistanceField

        return DistanceField.of(self.index, resolution, margin, self.name)
