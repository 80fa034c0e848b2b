"""`Wireframe`: the edges that show a body's shape (K, Kantenmodell)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_pose
from ..errors import InputError, MeshError
from ..files import replace_file
from . import files, topology
from .deviation import Deviation, farthest_from_mesh
from .index import MeshIndex
from .section import section
from .surface import unit_normals

ANGLE = math.radians(30.0)
"""Faces that meet at a larger angle have an edge between them."""

RINGS = 3
"""Sections across each axis that help to show a body that has few edges."""

BARE = 0.15
"""A body has few edges if a vertex where it bends is farther from them than this share of its largest extent."""

BENT = math.radians(1.0)
"""Where faces meet at more than this angle the surface bends."""


@dataclass(frozen=True, eq=False)
class Wireframe:
    """Line segments: ``points (P, 3)`` in m and ``edges (E, 2)`` into them."""

    points: Array
    edges: IntArray

    @classmethod
    def of(cls, index: MeshIndex, angle: float = ANGLE, rings: int | None = None) -> Self:
        """The edges at which faces meet at more than *angle* rad, the rims of holes, and *rings* sections per axis.

        Without *rings* there are none where the edges pass near wherever the surface bends, and else `RINGS` (`BARE`):
        a ball has no edges. With an *angle* of 0 every edge between faces of two planes is kept.
        """
        if not 0.0 <= angle <= math.pi:
            raise InputError(f"angle is {angle}; expected 0 to π rad")
        vertices, faces = topology.weld(index.vertices, index.faces, 0.0)
        edges = feature_edges(vertices, faces, angle)
        if rings is None:
            rings = RINGS if _few(vertices, faces, edges) else 0
        points, pairs = [vertices], [edges]
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        for axis in range(3):
            for r in range(rings):
                origin = low + (r + 1.0) / (rings + 1.0) * (high - low)
                for loop in section(index, origin, np.eye(3)[axis]).polylines:
                    start = sum(map(len, points)) + np.arange(len(loop) - 1)
                    points.append(loop)
                    pairs.append(np.stack([start, start + 1], axis=1))
        return cls(*_compact(np.concatenate(points), np.concatenate(pairs)))

    def __len__(self) -> int:
        return len(self.edges)

    @property
    def length(self) -> float:
        """Length of all edges in m."""
        return float(np.linalg.norm(self.points[self.edges[:, 1]] - self.points[self.edges[:, 0]], axis=1).sum())

    @cached_property
    def polylines(self) -> tuple[Array, ...]:
        """The edges joined to lines ``(n, 3)`` that run on while exactly two meet; closed ones end where they start."""
        around: list[list[int]] = [[] for _ in self.points]
        for e, (a, b) in enumerate(self.edges.tolist()):
            around[a].append(e)
            around[b].append(e)
        unused = [True] * len(self.edges)
        edges = self.edges.tolist()

        def walk(start: int, edge: int) -> list[int]:
            line = [start]
            while True:
                unused[edge] = False
                a, b = edges[edge]
                line.append(b if line[-1] == a else a)
                onward = [e for e in around[line[-1]] if unused[e]]
                if len(around[line[-1]]) != 2 or not onward:
                    return line
                edge = onward[0]

        lines = []
        ends = [p for p in range(len(around)) if len(around[p]) not in (0, 2)]
        for start in ends + list(range(len(around))):  # closed lines last
            for edge in around[start]:
                if unused[edge]:
                    lines.append(self.points[walk(start, edge)])
        return tuple(lines)

    def distance(self, points: ArrayLike) -> Array:
        """Distance ``(...)`` of *points* ``(..., 3)`` from the nearest edge."""
        return self._index.nearest(points).distance

    @cached_property
    def _index(self) -> MeshIndex:
        if not len(self.edges):
            raise InputError("the wireframe has no edges; give a smaller angle, or rings")
        return MeshIndex(self.points, np.column_stack([self.edges, self.edges[:, 1]]))

    def at(self, pose: ArrayLike) -> Self:
        """The same wireframe moved by *pose* ``(4, 4)``."""
        T = as_pose(pose, "pose")
        return type(self)(self.points @ T[:3, :3].T + T[:3, 3], self.edges)

    def deviation(self, body: MeshIndex) -> Deviation:
        """The lines lie on the surface; inward is how far a point of the surface may be from the nearest line."""
        inward = farthest_from_mesh(body.vertices[body.faces], self._index)
        return Deviation(1e-9 * float(np.abs(self.points).max()), inward, False, 0.0, 0.0)

    def save(self, path: str | Path) -> Path:
        """Write the lines as ``.npz``, or as line elements of an ``.obj``; `load` reads both."""
        path = Path(path)
        if path.suffix.lower() != ".obj":
            return files.write(path, "wireframe", points=self.points, edges=self.edges)
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in self.points.tolist()]
        lines += [f"l {a + 1} {b + 1}" for a, b in self.edges.tolist()]
        with replace_file(path) as work:
            work.write_text("\n".join(lines) + "\n")
        return path

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The wireframe that `save` wrote."""
        path = Path(path)
        if path.suffix.lower() != ".obj":
            data = files.read(path, "wireframe", "points", "edges")
            return cls(np.asarray(data["points"], dtype=np.float64), np.asarray(data["edges"], dtype=np.int64))
        if not path.is_file():
            raise MeshError(f"{path} does not exist")
        points, edges = [], []
        for number, line in enumerate(path.read_text().splitlines(), 1):
            words = line.split()
            try:
                if words[:1] == ["v"]:
                    points.append([float(w) for w in words[1:4]])
                elif words[:1] == ["l"]:
                    ends = [int(w.split("/")[0]) for w in words[1:]]
                    edges += [[a - 1, b - 1] for a, b in zip(ends[:-1], ends[1:])]
            except ValueError as error:
                raise MeshError(f"{path}:{number}: {line!r} is no vertex or line element: {error}") from error
        pairs = np.array(edges, dtype=np.int64).reshape(-1, 2)
        if len(pairs) and not (pairs.min() >= 0 and pairs.max() < len(points)):
            raise MeshError(f"{path}: a line refers to vertex {int(pairs.max()) + 1}, but there are {len(points)}")
        return cls(np.array(points).reshape(-1, 3), pairs)


def feature_edges(vertices: Array, faces: IntArray, angle: float) -> IntArray:
    """Edges ``(E, 2)`` at which two faces meet at more than *angle*, or that do not belong to exactly two faces."""
    edges = np.sort(topology.directed_edges(faces), axis=1)
    keys, count = np.unique(edges, axis=0, return_counts=True)
    one, two, alike = topology.adjacency(faces)  # of the edges with two faces, in the same order
    normals = unit_normals(vertices[faces])
    cosine = np.einsum("ij,ij->i", normals[one], normals[two]) * np.where(alike, 1.0, -1.0)
    sharp = count != 2
    sharp[count == 2] = cosine < math.cos(angle) - 1e-12
    return np.asarray(keys[sharp])


def _few(vertices: Array, faces: IntArray, edges: IntArray) -> bool:
    """Whether *edges* leave large curved parts of the surface bare."""
    bent = vertices[np.unique(feature_edges(vertices, faces, BENT))]
    if not len(edges):
        return True
    near = BARE * float(np.ptp(vertices, axis=0).max())
    return bool(Wireframe(vertices, edges).distance(bent).max(initial=0.0) > near)


def _compact(points: Array, edges: IntArray) -> tuple[Array, IntArray]:
    if not len(edges):
        return np.empty((0, 3)), np.empty((0, 2), dtype=np.int64)
    used, inverse = np.unique(edges, return_inverse=True)
    return points[used], inverse.reshape(-1, 2).astype(np.int64)
