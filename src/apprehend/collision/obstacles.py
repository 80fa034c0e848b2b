"""Geometry that is no convex core: half-spaces, point clouds, distance fields, surfaces and other unions of shapes."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_shaped, as_vector
from ..errors import InputError
from ..kernels.gjk import CLOUD, FIELD, HALF_SPACE, TREE
from ..kernels.grid_search import HEADER
from .cells import CellTable, around, within
from .geometry import ROUND_OFF, Geometry, pose_free, positive
from .shapes import Convex, hulls

if TYPE_CHECKING:
    from ..bodies import Body

NOTHING = np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class HalfSpace(Geometry):
    """All points with ``normal · p ≤ offset``: a floor, a wall, a ceiling. Make one with `through`."""

    pose: Array = field(default_factory=lambda: np.eye(4))  # z of its frame is the normal, the origin lies on the face
    radius: float = 0.0
    kind: int = HALF_SPACE
    size: Array = field(default_factory=lambda: np.zeros(3))
    points: Array = field(default_factory=lambda: NOTHING)

    @staticmethod
    def through(point: ArrayLike = (0.0, 0.0, 0.0), normal: ArrayLike = (0.0, 0.0, 1.0)) -> HalfSpace:
        """The half-space behind the plane through *point* (3,), whose *normal* (3,) points out of the solid."""
        p, n = as_vector(as_array(point, "point"), "point", 3), as_vector(as_array(normal, "normal"), "normal", 3)
        length = float(np.linalg.norm(n))
        if length < 1e-12:
            raise InputError(f"the normal of a half-space is {n.tolist()}; expected a direction, not zero")
        z = n / length
        x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
        x /= np.linalg.norm(x)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), z * (z @ p)
        return HalfSpace(pose)

    @property
    def normal(self) -> Array:
        """Unit vector (3,) out of the solid."""
        return self.pose[:3, 2]

    @property
    def offset(self) -> float:
        """Distance of the face from the origin along the normal, in m."""
        return float(self.normal @ self.pose[:3, 3])

    @property
    def half(self) -> Array:
        """Infinite."""
        return np.full(3, np.inf)

    @property
    def ball(self) -> tuple[Array, float]:
        """Infinite."""
        return self.pose[:3, 3], np.inf


@dataclass(frozen=True, eq=False)
class Cloud(Geometry):
    """Points ``(N, 3)``, each the centre of a ball of *radius* in m, such as a depth camera sees."""

    points: Array
    radius: float = 0.0
    pose: Array = field(default_factory=lambda: np.eye(4))
    kind: int = CLOUD
    size: Array = field(default_factory=lambda: np.zeros(3))

    @staticmethod
    def of(points: ArrayLike, radius: float = 0.0, *, spacing: float | None = None) -> Cloud:
        """A cloud of ``(..., 3)`` points; those with NaN (where a camera saw nothing) are left out.

        With *spacing* in m, all points in a cube of that side are replaced by their mean, and *radius* grows by the
        cube's diagonal, so that the balls still hold every point.
        """
        p = as_shaped(points, "points", 3, finite=False).reshape(-1, 3)
        p = p[~np.isnan(p).any(axis=1)]
        if not len(p):
            raise InputError("a cloud needs at least one point that is not NaN")
        as_array(p, "points")
        if not (np.isfinite(radius) and radius >= 0.0):
            raise InputError(f"the radius of a cloud is {radius}; expected 0 or more, in m")
        if spacing is not None:
            positive("the spacing of a cloud", spacing)
            cell, number = np.unique(np.floor(p / spacing), axis=0, return_inverse=True)
            count = np.bincount(number.ravel(), minlength=len(cell))
            sums = [np.bincount(number.ravel(), weights=p[:, c], minlength=len(cell)) for c in range(3)]
            means = np.stack(sums, axis=1) / count[:, None]
            away = np.linalg.norm(p - means[number.ravel()], axis=1).max()
            p, radius = means, radius + float(away)
        return Cloud(np.ascontiguousarray(p), float(radius))

    @pose_free
    def middle(self) -> Array:
        """Centre of the box around the points, in the cloud's frame."""
        return np.asarray(0.5 * (self.points.min(axis=0) + self.points.max(axis=0)))

    @pose_free
    def half(self) -> Array:
        """Half extents of the box about the cloud's origin."""
        return np.asarray(np.abs(self.points).max(axis=0) * (1.0 + ROUND_OFF) + self.radius)

    @pose_free
    def reach(self) -> float:
        """Radius of a ball about the middle that holds all."""
        return float(np.linalg.norm(self.points - self.middle, axis=1).max()) * (1.0 + ROUND_OFF) + self.radius

    @property
    def ball(self) -> tuple[Array, float]:
        """A sphere that holds all."""
        return self.pose[:3, :3] @ self.middle + self.pose[:3, 3], self.reach

    @pose_free
    def cells(self) -> CellTable:
        """Lower bounds on distances, for the sphere kernels."""
        return around(self.points, self.points, self.radius)


@dataclass(frozen=True, eq=False)
class Union(Geometry):
    """Several convex shapes as one: a mesh in convex pieces, or (`surface`) triangle by triangle.

    The signed distance to a union is the least of those to its shapes; it is a surface, and nothing is inside it,
    where its shapes are flat.
    """

    shapes: tuple[Convex, ...]
    pose: Array = field(default_factory=lambda: np.eye(4))
    radius: float = 0.0
    kind: int = TREE
    size: Array = field(default_factory=lambda: np.zeros(3))
    points: Array = field(default_factory=lambda: NOTHING)

    @staticmethod
    def of(shapes: Sequence[Geometry] | Body) -> Union:
        """Of convex shapes, or of the convex pieces of a body."""
        parts = tuple(shapes) if isinstance(shapes, Sequence) else hulls(shapes.convex_pieces)
        if not parts:
            raise InputError("a union needs at least one shape")
        convex = tuple(part for part in parts if isinstance(part, Convex))
        if len(convex) < len(parts):
            other = next(part for part in parts if not isinstance(part, Convex))
            raise InputError(f"a union is made of convex shapes; a {type(other).__name__} is none")
        return Union(convex)

    @staticmethod
    def surface(vertices: ArrayLike, faces: ArrayLike) -> Union:
        """The triangles ``faces (F, 3)`` of ``vertices (V, 3)``, without what they enclose."""
        p, f = as_shaped(vertices, "vertices", 3), np.asarray(faces)
        if f.ndim != 2 or f.shape[1:] != (3,) or not len(f) or not np.issubdtype(f.dtype, np.integer):
            raise InputError(f"faces have shape {f.shape} of {f.dtype}; expected (F, 3) whole numbers, one at least")
        if f.min() < 0 or f.max() >= len(p):
            raise InputError(f"faces name vertex {int(f.max() if f.max() >= len(p) else f.min())}; there are {len(p)}")
        corners = p[f]
        centres = corners.mean(axis=1)
        poses = np.tile(np.eye(4), (len(f), 1, 1))
        poses[:, :3, 3] = centres
        local = np.ascontiguousarray(corners - centres[:, None])
        return Union(tuple(Convex(0, points=q, pose=T) for q, T in zip(local, poses, strict=True)))

    @property
    def leaves(self) -> Sequence[Geometry]:
        """The shapes."""
        return self.shapes

    @pose_free
    def half(self) -> Array:
        """Half extents of the box about the union's origin."""
        ends = [np.abs(s.pose[:3, 3]) + np.abs(s.pose[:3, :3]) @ s.half for s in self.shapes]
        return np.asarray(np.max(ends, axis=0))

    @pose_free
    def around(self) -> tuple[Array, float]:
        """A ball that holds all, in the union's frame."""
        centres, radii = np.array([s.ball[0] for s in self.shapes]), np.array([s.ball[1] for s in self.shapes])
        middle = 0.5 * ((centres - radii[:, None]).min(axis=0) + (centres + radii[:, None]).max(axis=0))
        return middle, float((np.linalg.norm(centres - middle, axis=1) + radii).max()) * (1.0 + ROUND_OFF)

    @property
    def ball(self) -> tuple[Array, float]:
        """A sphere that holds all."""
        middle, reach = self.around
        return self.pose[:3, :3] @ middle + self.pose[:3, 3], reach

    @pose_free
    def cells(self) -> CellTable:
        """Lower bounds on distances, for the sphere kernels."""
        reach = np.array([np.abs(s.pose[:3, :3]) @ s.half for s in self.shapes])
        centres = np.array([s.pose[:3, 3] for s in self.shapes])
        return around(centres - reach, centres + reach, 0.0)


@dataclass(frozen=True, eq=False)
class Grid(Geometry):
    """A sampled signed distance field: *samples* ``(nx, ny, nz)``, negative inside, *spacing* m apart.

    Its frame lies in the middle of the grid. Between the nodes it is trilinear; beyond the grid, with p the nearest
    point of the grid, it is √(|x − p|² + d(p)²): never more than the distance, and short of it by less than d(p).
    Make one with `of`.
    """

    samples: Array
    spacing: float
    pose: Array = field(default_factory=lambda: np.eye(4))
    radius: float = 0.0
    kind: int = FIELD
    size: Array = field(default_factory=lambda: np.zeros(3))
    points: Array = field(default_factory=lambda: NOTHING)

    @staticmethod
    def of(values: Any, spacing: float | None = None, origin: ArrayLike = (0.0, 0.0, 0.0)) -> Grid:
        """From values ``(nx, ny, nz)`` at ``origin + spacing (i, j, k)``, or from a distance field of a body."""
        if hasattr(values, "values") and hasattr(values, "origin"):
            values, spacing, origin = values.values, float(values.spacing), values.origin
        v, o = as_array(values, "values"), as_vector(as_array(origin, "origin"), "origin", 3)
        if v.ndim != 3 or min(v.shape) < 2:
            raise InputError(f"values have shape {v.shape}; expected (nx, ny, nz) with at least 2 along each axis")
        if spacing is None:
            raise InputError("values of a field need their spacing, in m")
        positive("the spacing of a field", spacing)
        border = min(float(v.take(i, axis).min()) for axis in range(3) for i in (0, -1))
        if border <= 0.0:
            raise InputError(
                f"the field is {border:g} m on the border of its grid; expected positive values there, with the whole "
                "solid inside the grid"
            )
        pose = np.eye(4)
        pose[:3, 3] = o + 0.5 * spacing * (np.array(v.shape) - 1.0)
        return Grid(v.copy(), float(spacing), pose)

    @pose_free
    def steepness(self) -> float:
        """A Lipschitz constant of the interpolated field: 1 for an exact distance, a little more near its ridges."""
        most = np.zeros(tuple(n - 1 for n in self.samples.shape))
        for axis in range(3):
            slope = np.abs(np.diff(self.samples, axis=axis)) / self.spacing
            for other in range(3):
                if other != axis:
                    a, b = (np.take(slope, range(k, slope.shape[other] - 1 + k), other) for k in (0, 1))
                    slope = np.maximum(a, b)
            most += slope**2
        return max(1.0, float(np.sqrt(most.max())))

    @pose_free
    def values(self) -> Array:
        """Header and values for the kernels."""
        v = self.samples
        header = np.zeros(HEADER)
        header[:5] = self.spacing, *v.shape, self.steepness
        return np.concatenate([header, v.ravel()])

    @property
    def half(self) -> Array:
        """Half extents of the grid."""
        return 0.5 * self.spacing * (np.array(self.samples.shape) - 1.0)

    @property
    def ball(self) -> tuple[Array, float]:
        """A sphere that holds the grid."""
        return self.pose[:3, 3], float(np.linalg.norm(self.half))

    @pose_free
    def cells(self) -> CellTable:
        """Lower bounds on distances, for the sphere kernels."""
        return within(self.samples, self.spacing, self.steepness)

    @functools.cached_property
    def crossings(self) -> Cloud:
        """Where the edges of the grid cross the surface: a cloud at most a spacing wide between its points."""
        v, found = self.samples, []
        for axis in range(3):
            n = v.shape[axis] - 1
            a, b = v.take(range(n), axis), v.take(range(1, n + 1), axis)
            where = np.argwhere((a <= 0.0) != (b <= 0.0)).astype(np.float64)
            index = tuple(where.astype(int).T)
            where[:, axis] += a[index] / (a[index] - b[index])
            found.append(where)
        points = np.concatenate(found) * self.spacing - self.half
        if not len(points):
            raise InputError("the field has no surface: it is positive everywhere")
        return Cloud(points, 0.0, self.pose)


KNOWN: WeakKeyDictionary[object, tuple[Geometry, ...]] = WeakKeyDictionary()
"""The shapes of the bodies and fields that are in use, which are values."""


def as_geometry(thing: object, name: str = "shape") -> tuple[Geometry, ...]:
    """Geometry, a sequence of it, a body (its convex pieces) or a body's distance field, as geometry."""
    if isinstance(thing, Geometry):
        return (thing,)
    if hasattr(thing, "convex_pieces"):
        if thing not in KNOWN:
            KNOWN[thing] = hulls(thing.convex_pieces)
        return KNOWN[thing]
    if hasattr(thing, "values") and hasattr(thing, "spacing") and hasattr(thing, "origin"):
        if thing not in KNOWN:
            KNOWN[thing] = (Grid.of(thing),)
        return KNOWN[thing]
    if isinstance(thing, Sequence) and thing and not isinstance(thing, str):
        return tuple(part for item in thing for part in as_geometry(item, name))
    raise InputError(
        f"{name} is {type(thing).__name__}; expected a Convex, HalfSpace, Cloud, Union, Grid, a Body, a distance "
        "field, or a non-empty sequence of these"
    )
