"""`SurfaceMesh`: a triangle mesh as a model of a body: thinned, or made of a field or of voxels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, IntArray
from ..errors import InputError
from . import files, topology
from .deviation import Deviation, farthest_from_mesh
from .index import MeshIndex
from .mass import solid


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """``vertices (V, 3)`` in m and ``faces (F, 3)``, counter-clockwise seen from outside; nothing is repaired."""

    vertices: Array
    faces: IntArray

    @cached_property
    def index(self) -> MeshIndex:
        """The triangles in a tree."""
        return MeshIndex(self.vertices, self.faces)

    @property
    def mesh(self) -> tuple[Array, IntArray]:
        """Vertices and faces."""
        return self.vertices, self.faces

    @property
    def closed(self) -> bool:
        """Whether the surface has no rim."""
        return topology.is_closed(self.faces)

    @property
    def volume(self) -> float:
        """Enclosed volume in m³; 0 for an open surface."""
        return solid(self.vertices, self.faces).volume if self.closed else 0.0

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance ``(...)`` of *points* ``(..., 3)``, negative inside (see `MeshIndex`)."""
        return self.index.signed_distance(points)

    def deviation(self, body: MeshIndex) -> Deviation:
        """How much this surface differs from that of *body*: largest distances from one to the other, both ways."""
        outward = farthest_from_mesh(self.vertices[self.faces], body)
        inward = farthest_from_mesh(body.vertices[body.faces], self.index)
        volume = max(solid(body.capped.vertices, body.capped.faces).volume, 0.0)
        return Deviation(outward, inward, False, self.volume, volume)

    def save(self, path: str | Path) -> Path:
        """Write the mesh (``.obj``, ``.stl``, ``.ply``, ``.glb`` or ``.off``)."""
        return files.write_mesh(path, self.vertices, self.faces)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The mesh at *path* in metres, unrepaired."""
        from .load import read_mesh

        return cls(*read_mesh(path, "m"))


def thinned(index: MeshIndex, faces: int) -> SurfaceMesh:
    """The surface with about *faces* triangles (quadric error decimation, Garland & Heckbert 1997)."""
    if faces < 4:
        raise InputError(f"faces is {faces}; a surface needs at least 4")
    if len(index.faces) <= faces:
        return SurfaceMesh(index.vertices, index.faces)
    import fast_simplification

    centre, scale = index.vertices.mean(axis=0), float(np.ptp(index.vertices))
    unit = ((index.vertices - centre) / scale).astype(np.float32)
    for haste in (2.0, 3.0, 4.0, 5.0, 7.0):  # the more patient, the closer, but it may not get there
        v, f = fast_simplification.simplify(unit, index.faces.astype(np.int32), target_count=faces, agg=haste)
        if len(f) <= 1.05 * faces:
            break
    return SurfaceMesh(*topology.compact(np.asarray(v, dtype=np.float64) * scale + centre, f.astype(np.int64)))


CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
"""Corners of a cell; corner 4 x + 2 y + z."""

TETRAHEDRA = np.array([[0, 4, 6, 7], [0, 6, 2, 7], [0, 2, 3, 7], [0, 3, 1, 7], [0, 1, 5, 7], [0, 5, 4, 7]])
"""The six tetrahedra of a cell around its diagonal (Kuhn); all have one orientation, and neighbours match."""


def level_set(values: NDArray[np.float32], origin: Array, spacing: float, level: float) -> SurfaceMesh:
    """The surface on which the piecewise linear interpolant of *values* on a grid is *level*, by marching tetrahedra.

    Every cell is divided into six tetrahedra, alike in all cells, so the surface is closed unless it leaves the grid.
    """
    below = values <= level
    active = np.zeros(tuple(n - 1 for n in values.shape), dtype=np.int64)
    nx, ny, nz = active.shape
    for x, y, z in CORNERS:
        active += below[x : x + nx, y : y + ny, z : z + nz]
    cells = np.argwhere((active > 0) & (active < 8))
    corner = (cells[:, None] + CORNERS) @ np.array([values.shape[1] * values.shape[2], values.shape[2], 1])
    tets = corner[:, TETRAHEDRA].reshape(-1, 4)
    flat = values.reshape(-1)
    inside = below.reshape(-1)[tets]
    count = inside.sum(axis=1)
    edges: list[IntArray] = []
    # one corner alone: a triangle on its three edges; turned round if it is the only one above
    for number, alone in ((1, True), (3, False)):
        some = count == number
        tet, lone = tets[some], np.argmax(inside[some] == alone, axis=1)
        others = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])[lone]
        tip = tet[np.arange(len(tet)), lone]
        rest = np.take_along_axis(tet, others, axis=1)
        if not alone:
            rest = rest[:, ::-1]
        edges.append(np.stack([np.repeat(tip[:, None], 3, axis=1), rest], axis=2))
    # two and two: a quadrilateral
    some = count == 2
    tet, within = tets[some], inside[some]
    order = np.argsort(~within, axis=1, kind="stable")  # the two inside come first
    a, b, c, d = np.take_along_axis(tet, order, axis=1).T
    odd = np.array([_odd(o) for o in order.tolist()], dtype=bool)
    c, d = np.where(odd, d, c), np.where(odd, c, d)
    quad = np.stack([np.stack(e, axis=1) for e in ((a, c), (a, d), (b, d), (b, c))], axis=1)
    edges += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    return _welded(np.concatenate(edges), flat, values.shape, origin, spacing, level)


def _odd(order: list[int]) -> bool:
    """Whether a permutation of four is odd."""
    return sum(order[i] > order[j] for i in range(4) for j in range(i + 1, 4)) % 2 == 1


def _welded(
    edges: IntArray, values: NDArray[np.float32], shape: tuple[int, ...], origin: Array, spacing: float, level: float
) -> SurfaceMesh:
    """Triangles whose corners lie on grid *edges* ``(F, 3, 2)``, with one vertex on each edge."""
    if not len(edges):
        least, most = (1e3 * float(v) for v in (values.min(), values.max()))
        raise InputError(
            f"the field takes values from {least:.3g} to {most:.3g} mm, so there is no surface at {1e3 * level:g} mm; "
            "where walls are thinner than the grid is fine, give a smaller resolution or a level above the error"
        )
    ends = np.sort(edges.reshape(-1, 2), axis=1)
    keys, inverse = np.unique(ends[:, 0] * values.size + ends[:, 1], return_inverse=True)
    low, high = keys // values.size, keys % values.size
    v0, v1 = values[low].astype(np.float64), values[high].astype(np.float64)
    t = (level - v0) / (v1 - v0)
    p0, p1 = (np.stack(np.unravel_index(i, shape), axis=1) for i in (low, high))
    points = origin + spacing * (p0 + t[:, None] * (p1 - p0))
    return SurfaceMesh(points, inverse.reshape(-1, 3).astype(np.int64))
