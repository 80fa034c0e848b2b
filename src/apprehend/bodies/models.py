"""The models of a body, by name and as methods: block world, wireframe, surface, volume, simplified, 2-D (K)."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

from numpy.typing import ArrayLike

from ..arrays import Array
from ..errors import unknown_name
from .queries import Queries

if TYPE_CHECKING:
    from .deviation import Deviation
    from .index import MeshIndex
    from .outline import Outline
    from .primitives import Boxes, Capsules, ConvexPieces, Spheres
    from .surface_mesh import SurfaceMesh
    from .voxels import Voxels
    from .wireframe import Wireframe

MODELS = ("surface", "simplified", "wireframe", "blocks", "boxes", "spheres", "capsules", "convex", "voxels", "field")
"""Names of models for `Models.model`: blocks are boxes along the axes, field the zero surface of a distance field."""


class Model(Protocol):
    """What the models have in common: they can be compared with the body, and written."""

    def deviation(self, body: MeshIndex) -> Deviation:
        """How much the model differs from a body."""
        ...


class Models(Queries):
    """Conversions of a body into other models. Each model has ``deviation``, and `Models.deviation` asks for it."""

    com: Array
    extents: Any
    convex_pieces: Any

    def boxes(self, count: int = 1, *, oriented: bool = True) -> Boxes:
        """Block world: at most *count* enclosing boxes; along the axes of the body unless *oriented*."""
        from .primitives import Boxes

        return Boxes.around(self.index, count, oriented=oriented)

    def spheres(self, count: int = 24) -> Spheres:
        """At most *count* enclosing spheres."""
        from .primitives import Spheres

        return Spheres.around(self.index, count)

    def capsules(self, count: int = 1) -> Capsules:
        """At most *count* enclosing capsules."""
        from .primitives import Capsules

        return Capsules.around(self.index, count)

    def convex(self) -> ConvexPieces:
        """The convex pieces (`Body.convex_pieces`) as a model."""
        from .primitives import ConvexPieces

        return ConvexPieces(tuple(self.convex_pieces))

    def wireframe(self, angle: float = math.radians(30.0), *, rings: int | None = None) -> Wireframe:
        """Edges at which faces meet at more than *angle* rad, and *rings* sections per axis (None: if needed)."""
        from .wireframe import Wireframe

        return Wireframe.of(self.index, angle, rings)

    def simplified(self, faces: int) -> SurfaceMesh:
        """The surface with about *faces* triangles."""
        from .surface_mesh import thinned

        return thinned(self.index, faces)

    def voxels(self, resolution: float | None = None, rule: str = "enclosing") -> Voxels:
        """Cubes of side *resolution* m (None: 1/40 of the size) that enclose the body, or whose centres are in it."""
        return self.distance_field(self._step(resolution), margin=0.0).voxels(rule)

    def field_surface(self, resolution: float | None = None, level: float = 0.0) -> SurfaceMesh:
        """The surface at distance *level* m by a distance field of *resolution* m: closed, also if this one is not."""
        step = self._step(resolution)
        return self.distance_field(step, margin=max(level, 0.0) + 2.0 * step).surface(level)

    def section(self, origin: ArrayLike | None = None, normal: ArrayLike = (0.0, 0.0, 1.0)) -> Outline:
        """The section with the plane through *origin* (None: the centre of mass) with *normal*, as a planar figure."""
        from .section import section

        return section(self.index, self.com if origin is None else origin, normal)

    def silhouette(self, direction: ArrayLike = (0.0, 0.0, 1.0)) -> Outline:
        """The projection along *direction*, as a planar figure seen from its tip."""
        from .section import silhouette

        return silhouette(self.index, direction)

    def deviation(self, model: Model) -> Deviation:
        """What is lost between this body and a *model* of it: bounds that hold."""
        return model.deviation(self.index)

    def model(self, name: str, count: int | None = None, resolution: float | None = None) -> Any:
        """The model of that *name* (see `MODELS`), of at most *count* shapes or faces, or of a *resolution* in m."""
        makers: dict[str, Callable[[], Any]] = {
            "surface": lambda: self._surface,
            "simplified": lambda: self.simplified(count or 500),
            "wireframe": self.wireframe,
            "blocks": lambda: self.boxes(count or 1, oriented=False),
            "boxes": lambda: self.boxes(count or 1),
            "spheres": lambda: self.spheres(count or 24),
            "capsules": lambda: self.capsules(count or 4),
            "convex": self.convex,
            "voxels": lambda: self.voxels(resolution),
            "field": lambda: self.field_surface(resolution),
        }
        if name not in makers:
            unknown_name("model", name, MODELS)
        return makers[name]()

    @cached_property
    def _surface(self) -> SurfaceMesh:
        from .surface_mesh import SurfaceMesh

        return SurfaceMesh(self.vertices, self.faces)

    def _step(self, resolution: float | None) -> float:
        return float(self.extents.max()) / 40.0 if resolution is None else resolution
