"""`MeshIndex`: exact questions to a triangle mesh, in batches: nearest points, winding numbers, signed distances."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_shaped
from ..kernels import distance_field as kernels
from ..kernels import rays, winding
from ..parallel import over_ranges
from . import topology

GRAIN = 256
"""Points that are worth a thread of their own."""

MANY = 4096
"""Points from which on it pays to sort them and to look for their nearest triangles on lanes."""


class Nearest(NamedTuple):
    """The points of a surface that are nearest to given points."""

    points: Array
    """``(..., 3)`` on the surface."""
    distance: Array
    """``(...)`` in m."""
    faces: IntArray
    """``(...)``, the face that each lies on."""


class MeshIndex:
    """The triangles ``vertices (V, 3)``, ``faces (F, 3)`` in a tree, for questions about many points at a time.

    Inside is where the generalised winding number w(x) = Σ Ω_f(x) / 4π is above one half (Jacobson, Kavan &
    Sorkine-Hornung 2013; Ω_f is the solid angle of a face). In a closed mesh w is an integer and inside means what it
    says; across the holes of an open one it goes smoothly from 1 to 0. It is computed without summing over the faces:
    the rims of the holes are capped by fans, the closed mesh is crossed by one ray, and the fans' solid angles are
    subtracted, which is exact.
    """

    def __init__(self, vertices: Array, faces: IntArray) -> None:
        self.vertices, self.faces = vertices, faces
        self.tree = rays.Tree(*rays.build(np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.int64)))

    @cached_property
    def frames(self) -> Array:
        """Every triangle of the tree in a frame of its own (`kernels.distance_field.frames`)."""
        return np.asarray(kernels.frames(self.tree.triangles))

    @cached_property
    def fans(self) -> tuple[Array, IntArray] | None:
        """Triangles that close the holes: all vertices and the middles of the rims, and the faces; None if closed."""
        if topology.is_closed(self.faces):
            return None
        points, triangles = [self.vertices], []
        count = len(self.vertices)
        for loop in topology.boundary_loops(self.faces):
            points.append(self.vertices[loop].mean(axis=0, keepdims=True))
            around = np.asarray(loop, dtype=np.int64)
            triangles.append(np.column_stack([np.full(len(loop), count), around, np.roll(around, -1)]))
            count += 1
        return (np.concatenate(points), np.concatenate(triangles)) if triangles else None

    @cached_property
    def caps(self) -> tuple[rays.Tree, Array] | None:
        """The `fans` as a tree with its dipoles; None for a closed mesh."""
        if self.fans is None:
            return None
        tree = rays.Tree(*rays.build(*self.fans))
        return tree, winding.dipoles(tree)

    @cached_property
    def capped(self) -> MeshIndex:
        """The same surface with its holes closed by `fans`; itself where it is closed."""
        if self.fans is None:
            return self
        return MeshIndex(self.fans[0], np.concatenate([self.faces, self.fans[1]]))

    @property
    def closed(self) -> bool:
        """Whether the mesh has no rim: every edge of a face is matched by one in the opposite direction."""
        return self.fans is None

    def nearest(self, points: ArrayLike) -> Nearest:
        """The nearest point of the surface to each of *points* ``(..., 3)``, its distance and its face."""
        p = as_shaped(points, "points", 3)
        flat = p.reshape(-1, 3)
        out, distance, faces = np.empty_like(flat), np.empty(len(flat)), np.empty(len(flat), np.int64)
        if len(flat) < MANY:
            over_ranges(
                lambda a, b: rays.nearest(self.tree, flat[a:b], out[a:b], distance[a:b], faces[a:b]), len(flat), GRAIN
            )
        else:
            order, rows = _along_a_curve(flat), self.frames
            over_ranges(
                lambda a, b: kernels.nearest(self.tree, rows, flat, order, out, distance, faces, a, b),
                -(-len(flat) // kernels.RUN),
            )
        shape = p.shape[:-1]
        return Nearest(out.reshape(p.shape), distance.reshape(shape), faces.reshape(shape))

    def winding_number(self, points: ArrayLike) -> Array:
        """The generalised winding number at *points* ``(..., 3)``: 1 inside and 0 outside of a closed mesh."""
        p = as_shaped(points, "points", 3)
        return self._winding(p.reshape(-1, 3), True).reshape(p.shape[:-1])

    def inside(self, points: ArrayLike) -> BoolArray:
        """Whether each of *points* ``(..., 3)`` lies inside: winding number above one half.

        Holes far away count as dipoles, an error of about 1 % of a winding number at most.
        """
        p = as_shaped(points, "points", 3)
        within: BoolArray = self._winding(p.reshape(-1, 3), False).reshape(p.shape[:-1]) > 0.5
        return within

    def _winding(self, points: Array, exact: bool) -> Array:
        out = np.zeros(len(points))
        caps = self.caps

        def work(a: int, b: int) -> None:
            winding.count(self.tree, points[a:b], out[a:b])
            if caps is not None:
                winding.count(caps[0], points[a:b], out[a:b])
                winding.without_caps(*caps, exact, points[a:b], out[a:b])

        over_ranges(work, len(points), GRAIN)
        return out

    def signed_distance(self, points: ArrayLike) -> Array:
        """Distance ``(...)`` of *points* ``(..., 3)`` from the surface in m, negative inside."""
        distance = self.nearest(points).distance
        return np.where(self.inside(points), -distance, distance)


def _along_a_curve(points: Array) -> IntArray:
    """The order of ``points (N, 3)`` along a Z-curve of 1024 cells a side, on which neighbours are near each other."""
    low = points.min(axis=0)
    cell = ((points - low) * (1023.0 / max(float(np.ptp(points, axis=0).max()), 1e-300))).astype(np.int64)
    key = np.zeros(len(points), np.int64)
    for bit in range(10):
        for k in range(3):
            key |= ((cell[:, k] >> bit) & 1) << (3 * bit + k)
    return np.argsort(key, kind="stable").astype(np.int64)
