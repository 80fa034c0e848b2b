"""`Voxels`: a body as cubes of a regular grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_shaped, choice
from ..errors import InputError
from . import files, topology
from .deviation import Deviation, farthest_outside
from .distance_field import DistanceField
from .index import MeshIndex
from .mass import solid
from .primitives import Boxes
from .surface_mesh import SurfaceMesh

RULES = ("enclosing", "centres")


@dataclass(frozen=True, eq=False)
class Voxels:
    """Cubes of side *spacing*; ``filled[i, j, k]`` is the one centred at ``origin + spacing (i, j, k)``.

    By the rule ``"enclosing"`` every cube is filled that the body may touch: those whose centre is within √3/2 of the
    side of it. They contain the body, and none of their points is farther from it than √3 times the side. By the rule
    ``"centres"`` a cube is filled if its centre is inside: the volume is right on average and no point sticks out by
    more than √3/2 of the side, but walls thinner than the side may get lost.
    """

    origin: Array
    spacing: float
    filled: BoolArray
    rule: str = "enclosing"

    @classmethod
    def of(cls, field: DistanceField, rule: str = "enclosing") -> Self:
        """The voxels around the grid points of a distance field."""
        choice(rule, "rule", RULES)
        limit = 0.5 * math.sqrt(3.0) * field.spacing * (1.0 + 1e-6) if rule == "enclosing" else 0.0
        return cls(field.origin, field.spacing, field.values <= limit, rule)

    def __len__(self) -> int:
        return int(self.filled.sum())

    @property
    def volume(self) -> float:
        """Volume of the filled cubes in m³."""
        return len(self) * self.spacing**3

    def inside(self, points: ArrayLike) -> BoolArray:
        """Whether *points* ``(..., 3)`` lie in a filled cube."""
        p = as_shaped(points, "points", 3)
        index = np.floor((p - self.origin) / self.spacing + 0.5)
        within = np.asarray(((index >= 0) & (index < self.filled.shape)).all(axis=-1))
        i, j, k = np.moveaxis(np.where(within[..., None], index, 0.0).astype(np.int64), -1, 0)
        found: BoolArray = within & self.filled[i, j, k]
        return found

    @cached_property
    def surface(self) -> SurfaceMesh:
        """The outer faces of the cubes, each as two triangles; closed."""
        padded = np.pad(self.filled, 1)
        quads = []
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            for sign in (-1, 1):
                bare = padded & ~np.roll(padded, -sign, axis=axis)
                cube = np.argwhere(bare) - 1
                corner = np.repeat(2 * cube[:, None], 4, axis=1)  # in half cubes
                corner[:, :, axis] += sign
                corner[:, :, u] += np.array([-1, 1, 1, -1]) if sign > 0 else np.array([-1, -1, 1, 1])
                corner[:, :, v] += np.array([-1, -1, 1, 1]) if sign > 0 else np.array([-1, 1, 1, -1])
                quads.append(corner)
        corners = np.concatenate(quads)
        if not len(corners):
            raise InputError("no voxel is filled: the body is thinner than the voxels; give a smaller resolution")
        points, inverse = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        four: IntArray = inverse.reshape(-1, 4).astype(np.int64)
        faces = np.concatenate([four[:, [0, 1, 2]], four[:, [0, 2, 3]]])
        return SurfaceMesh(*topology.compact(self.origin + 0.5 * self.spacing * points, faces))

    @property
    def mesh(self) -> tuple[Array, IntArray]:
        """Vertices and faces of `surface`."""
        return self.surface.mesh

    def boxes(self) -> Boxes:
        """The same volume as few boxes along the axes: block world. Runs along z grow along y, then along x."""
        left = self.filled.copy()
        found = []
        for i, j, k in np.argwhere(left):
            if not left[i, j, k]:
                continue
            end = [int(i) + 1, int(j) + 1, int(k) + 1]
            while end[2] < left.shape[2] and left[i, j, end[2]]:
                end[2] += 1
            while end[1] < left.shape[1] and left[i, end[1], k : end[2]].all():
                end[1] += 1
            while end[0] < left.shape[0] and left[end[0], j : end[1], k : end[2]].all():
                end[0] += 1
            left[i : end[0], j : end[1], k : end[2]] = False
            found.append(((int(i), int(j), int(k)), end))
        low, high = (np.array([pair[s] for pair in found], dtype=np.float64).reshape(-1, 3) for s in (0, 1))
        poses = np.tile(np.eye(4), (len(found), 1, 1))
        poses[:, :3, 3] = self.origin + self.spacing * (0.5 * (low + high) - 0.5)
        return Boxes(poses, self.spacing * (high - low))

    def deviation(self, body: MeshIndex) -> Deviation:
        """How much the cubes differ from *body*: outward the proven bound; inward by search."""
        encloses = self.rule == "enclosing"
        outward = math.sqrt(3.0) * self.spacing * (1.0 if encloses else 0.5)
        inward = 0.0
        if not encloses:
            inward = farthest_outside(body.vertices[body.faces], self.surface.index)
        volume = max(solid(body.capped.vertices, body.capped.faces).volume, 0.0)
        return Deviation(outward * (1.0 + 1e-6), inward, encloses, self.volume, volume)

    def save(self, path: str | Path) -> Path:
        """Write the voxels as ``.npz`` (`load` reads it), or their outer faces as a mesh (``.obj``, ``.stl``, …)."""
        if Path(path).suffix.lower() not in (".npz", ""):
            return self.surface.save(path)
        return files.write(
            path,
            "voxels",
            origin=self.origin,
            spacing=self.spacing,
            filled=np.packbits(self.filled),
            shape=np.array(self.filled.shape),
            rule=self.rule,
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The voxels that `save` wrote."""
        data = files.read(path, "voxels", "origin", "spacing", "filled", "shape", "rule")
        shape = tuple(int(n) for n in data["shape"])
        filled = np.unpackbits(data["filled"], count=int(np.prod(shape))).astype(bool).reshape(shape)
        return cls(as_shaped(data["origin"], "origin", 3), float(data["spacing"]), filled, str(data["rule"]))
