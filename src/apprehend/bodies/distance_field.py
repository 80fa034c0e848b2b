"""`DistanceField`: the signed distance of a body on a regular grid, for millions of questions a second."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, BoolArray, as_shaped
from ..errors import InputError
from ..kernels import distance_field as kernels
from ..kernels import winding
from ..kernels.distance_field import Field
from ..parallel import over_ranges
from . import files
from .index import MeshIndex

if TYPE_CHECKING:
    from .surface_mesh import SurfaceMesh
    from .voxels import Voxels

MOST_POINTS = 2**28
"""Most grid points of a field: 1 GiB of float32."""

GRAIN = 4096
"""Queries that are worth a thread of their own."""

REACH = 0.05
"""How far the grid reaches beyond the body unless told otherwise, as a share of the body's largest extent."""


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Signed distances in m on a grid, negative inside; ``values[i, j, k]`` at ``origin + spacing (i, j, k)``.

    At the grid points the distance is exact (rounded to float32). Between them it is trilinear, and since a distance
    changes no faster than one moves, the error of Σ wᵢ d(cᵢ) at x is at most Σ wᵢ |x − cᵢ| ≤ √3/2 times the spacing:
    `error`. (That worst case occurs only where several parts of the surface are equally near; before a plane the
    interpolant is exact, and outside of the body it exceeds the distance r by no more than 3 spacing² / 8 r.)
    `bounds` brackets each single answer. Outside of the grid see `distance`.

    The sign is that of `MeshIndex`: inside is where the generalised winding number is above one half, so meshes with
    holes have an inside too. There the distance jumps from one sign to the other across a hole, and `error` holds but
    for the cells in which it does.
    """

    origin: Array
    """``(3,)``, the first grid point."""
    spacing: float
    """Distance of neighbouring grid points in m."""
    values: NDArray[np.float32]
    """``(nx, ny, nz)``."""
    closed: bool = True
    """Whether the mesh was closed."""
    name: str = "body"

    @classmethod
    def of(cls, index: MeshIndex, resolution: float = 0.002, margin: float | None = None, name: str = "body") -> Self:
        """The field of a mesh: grid points every *resolution* m, reaching *margin* m (at least two cells) beyond it.

        Raises `InputError` if the grid would have more than `MOST_POINTS` points.
        """
        points = index.tree.triangles.reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        origin, shape = _grid(low, high, resolution, margin, name)
        values = np.zeros(shape, dtype=np.float32)
        winding.scan(index.tree.triangles, origin, float(resolution), values)
        if index.caps is not None:
            winding.scan(index.caps[0].triangles, origin, float(resolution), values)
        rows = index.frames

        def signs(a: int, b: int) -> None:
            winding.accumulate(values, a, b)
            if index.caps is not None:
                winding.grid_without_caps(*index.caps, origin, float(resolution), values, a, b)

        over_ranges(signs, shape[0], 4)
        over_ranges(
            lambda a, b: kernels.fill(index.tree, rows, origin, float(resolution), values, a, b), (shape[0] + 1) // 2, 2
        )
        return cls(origin, float(resolution), values, index.closed, name)

    @cached_property
    def kernel(self) -> Field:
        """The field as kernels take it (`apprehend.kernels.distance_field.sample`)."""
        return Field(self.origin, self.spacing, self.values)

    @property
    def upper(self) -> Array:
        """The last grid point, ``(3,)``."""
        return np.asarray(self.origin + self.spacing * (np.array(self.values.shape) - 1))

    @cached_property
    def error(self) -> float:
        """Largest difference in m from the exact signed distance within the grid: √3/2 spacing, and rounding."""
        rounding = float(np.abs(self.values).max()) * 2.0**-23
        return 0.5 * math.sqrt(3.0) * self.spacing + rounding

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance ``(...)`` of *points* ``(..., 3)``, in the frame of the body.

        Outside of the grid, with q the nearest point of the grid's box, it is √(|x − q|² + d(q)²): as the body lies
        within the box, that is never more than the distance (but for `error`), and short of it by less than d(q).
        """
        p = as_shaped(points, "points", 3)
        flat = p.reshape(-1, 3)
        out = np.empty(len(flat))
        over_ranges(lambda a, b: kernels.distances(self.kernel, flat[a:b], out[a:b]), len(flat), GRAIN)
        return out.reshape(p.shape[:-1])

    def distance_and_gradient(self, points: ArrayLike) -> tuple[Array, Array]:
        """`distance` and its gradient ``(..., 3)``, the derivative of just these values: constant length only nearly.

        Within a cell the gradient is continuous; from cell to cell it jumps by an amount that shrinks with the spacing.
        """
        p = as_shaped(points, "points", 3)
        flat = p.reshape(-1, 3)
        out, slope = np.empty(len(flat)), np.empty_like(flat)
        over_ranges(lambda a, b: kernels.gradients(self.kernel, flat[a:b], out[a:b], slope[a:b]), len(flat), GRAIN)
        return out.reshape(p.shape[:-1]), slope.reshape(p.shape)

    def gradient(self, points: ArrayLike) -> Array:
        """Gradient ``(..., 3)`` of `distance`: near the surface, about the outward normal."""
        return self.distance_and_gradient(points)[1]

    def bounds(self, points: ArrayLike) -> tuple[Array, Array]:
        """Lower and upper bound ``(...)`` of the exact signed distance at *points* ``(..., 3)`` within the grid.

        They are max d(cᵢ) − |x − cᵢ| and min d(cᵢ) + |x − cᵢ| over the corners cᵢ of the cell. For a closed mesh.
        """
        p = as_shaped(points, "points", 3)
        flat = p.reshape(-1, 3)
        outside = ((flat < self.origin) | (flat > self.upper)).any(axis=1)
        if outside.any():
            raise InputError(
                f"point {flat[np.argmax(outside)].tolist()} is outside the grid from {self.origin.tolist()} to "
                f"{self.upper.tolist()}; build the field with a larger margin"
            )
        low, high = np.empty(len(flat)), np.empty(len(flat))
        over_ranges(lambda a, b: kernels.brackets(self.kernel, flat[a:b], low[a:b], high[a:b]), len(flat), GRAIN)
        return low.reshape(p.shape[:-1]), high.reshape(p.shape[:-1])

    def inside(self, points: ArrayLike) -> BoolArray:
        """Whether `distance` is negative."""
        within: BoolArray = self.distance(points) < 0.0
        return within

    def surface(self, level: float = 0.0) -> SurfaceMesh:
        """The surface at distance *level* m: every point of it is within `error` of that distance.

        With *level* = `error` it contains the body. Walls thinner than the spacing may get lost at a level of 0.
        """
        from .surface_mesh import level_set

        return level_set(self.values, self.origin, self.spacing, level)

    def voxels(self, rule: str = "enclosing") -> Voxels:
        """Cubes around the grid points: those that may touch the body, or (``"centres"``) whose centre is inside."""
        from .voxels import Voxels

        return Voxels.of(self, rule)

    def save(self, path: str | Path) -> Path:
        """Write the field as ``.npz``; `load` reads it."""
        return files.write(
            path,
            "distance field",
            origin=self.origin,
            spacing=self.spacing,
            values=self.values,
            closed=self.closed,
            name=self.name,
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The field that `save` wrote."""
        data = files.read(path, "distance field", "origin", "spacing", "values", "closed", "name")
        values = np.ascontiguousarray(data["values"], dtype=np.float32)
        spacing = float(data["spacing"])
        if values.ndim != 3 or min(values.shape) < 2 or not np.isfinite(values).all() or not spacing > 0.0:
            raise InputError(f"{path}: the values of the distance field have shape {values.shape}; the file is damaged")
        return cls(as_shaped(data["origin"], "origin", 3), spacing, values, bool(data["closed"]), str(data["name"]))


def _grid(
    low: Array, high: Array, resolution: float, margin: float | None, name: str
) -> tuple[Array, tuple[int, int, int]]:
    """First grid point and number of grid points along each axis; the body is in the middle."""
    if not (math.isfinite(resolution) and resolution > 0.0):
        raise InputError(f"resolution is {resolution}; expected a positive length in m, such as 0.002")
    extents = high - low
    if margin is None:
        margin = REACH * float(extents.max())
    if not (math.isfinite(margin) and margin >= 0.0):
        raise InputError(f"margin is {margin}; expected zero or a length in m")
    reach = max(margin, 2.0 * resolution)
    cells = np.ceil((extents + 2.0 * reach) / resolution)
    count = float(np.prod(cells + 1.0))
    if count > MOST_POINTS:
        fits = resolution * (count / MOST_POINTS) ** (1.0 / 3.0)
        shown = " × ".join(f"{int(c) + 1}" for c in cells)
        raise InputError(
            f"a distance field of {name} at {resolution:g} m has {shown} = {count:.3g} grid points "
            f"({4e-9 * count:.3g} GB); at most {MOST_POINTS:.3g} fit. "
            f"Give a resolution of {1.01 * fits:.2g} m or more, or a smaller margin"
        )
    origin = 0.5 * (low + high) - 0.5 * resolution * cells
    return np.ascontiguousarray(origin), (int(cells[0]) + 1, int(cells[1]) + 1, int(cells[2]) + 1)
