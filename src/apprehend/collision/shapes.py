"""Convex shapes for distance and collision, and how boxes, robot links and bodies are made of them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_shaped, as_vector
from ..errors import InputError
from ..kernels.gjk import BOX, CONE, CYLINDER, ELLIPSOID, HULL
from ..robots import load_shape_mesh
from ..robots.description import Link, Shape, ShapeKind
from .geometry import ROUND_OFF, Geometry, pose_free, positive

FILLED = 0.85
"""A closed mesh that fills this share of its convex hull is taken as the hull; others are cut into a few hulls."""


@dataclass(frozen=True, eq=False)
class Convex(Geometry):
    """A convex core grown by a radius, at a pose in the frame of what carries it (a link, a body, or the world).

    A sphere is a grown point and a capsule a grown segment; hulls are given by their vertices. Make one with `box`,
    `sphere`, `capsule`, `cylinder`, `cone`, `ellipsoid` or `hull`.
    """

    kind: int
    size: Array = field(default_factory=lambda: np.zeros(3))  # half extents, radius and half length, or radii
    radius: float = 0.0
    points: Array = field(default_factory=lambda: np.zeros((0, 3)))  # (V, 3) vertices of a hull in the shape's frame
    faces: IntArray = field(default_factory=lambda: np.zeros((0, 3), np.int64))  # (F, 3) of a hull, outward
    pose: Array = field(default_factory=lambda: np.eye(4))

    @staticmethod
    def box(size: ArrayLike) -> Convex:
        """A box of full extents (3,), centred."""
        half = 0.5 * as_vector(size, "size", 3)
        positive("the size of a box", *half)
        return Convex(BOX, half)

    @staticmethod
    def sphere(radius: float) -> Convex:
        """A sphere about the origin."""
        positive("the radius of a sphere", radius)
        return Convex(HULL, radius=float(radius), points=np.zeros((1, 3)))

    @staticmethod
    def capsule(radius: float, length: float) -> Convex:
        """A capsule along z, centred; *length* is that of the cylindrical part."""
        positive("the radius of a capsule", radius)
        if not (np.isfinite(length) and length >= 0.0):
            raise InputError(f"the length of a capsule is {length}; expected 0 or more, in m")
        return Convex(
            HULL, radius=float(radius), points=np.array([[0.0, 0.0, -0.5 * length], [0.0, 0.0, 0.5 * length]])
        )

    @staticmethod
    def cylinder(radius: float, length: float) -> Convex:
        """A cylinder along z, centred."""
        positive("radius and length of a cylinder", radius, length)
        return Convex(CYLINDER, np.array([radius, 0.5 * length, 0.0]))

    @staticmethod
    def cone(radius: float, length: float) -> Convex:
        """A cone along z with its tip at +length/2."""
        positive("radius and length of a cone", radius, length)
        return Convex(CONE, np.array([radius, 0.5 * length, 0.0]))

    @staticmethod
    def ellipsoid(radii: ArrayLike) -> Convex:
        """An ellipsoid of radii (3,) along its axes."""
        size = as_vector(radii, "radii", 3)
        positive("the radii of an ellipsoid", *size)
        return Convex(ELLIPSOID, size.copy())

    @staticmethod
    def hull(vertices: ArrayLike, radius: float = 0.0) -> Convex:
        """The convex hull of ``(V, 3)`` points, grown by *radius*; flat sets and single points are allowed."""
        points = as_shaped(vertices, "vertices", 3)
        if points.ndim != 2 or not len(points):
            raise InputError(f"vertices have shape {points.shape}; expected (V, 3) with at least one point")
        if not (np.isfinite(radius) and radius >= 0.0):
            raise InputError(f"the radius of a hull is {radius}; expected 0 or more, in m")
        turn, centre = _box_frame(points)
        local = (points - centre) @ turn
        kept, faces = _hull(local)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn, centre
        return Convex(HULL, radius=float(radius), points=np.ascontiguousarray(local[kept]), faces=faces, pose=pose)

    @pose_free
    def half(self) -> Array:
        """Half extents (3,) of the box about the shape's origin, in the shape's frame, that holds it."""
        if self.kind in (BOX, ELLIPSOID):
            half = self.size
        elif self.kind in (CYLINDER, CONE):
            half = np.array([self.size[0], self.size[0], self.size[1]])
        else:
            half = np.abs(self.points).max(axis=0)
        return np.asarray(half * (1.0 + ROUND_OFF) + self.radius)

    @pose_free
    def reach(self) -> float:
        """Radius of a sphere about the shape's origin that holds it."""
        if self.kind in (CYLINDER, CONE):
            core = math.hypot(self.size[0], self.size[1])
        elif self.kind == ELLIPSOID:
            core = float(self.size.max())
        else:
            core = float(np.linalg.norm(self.points if self.kind == HULL else self.half[None], axis=1).max())
        return core * (1.0 + ROUND_OFF) + self.radius

    @property
    def ball(self) -> tuple[Array, float]:
        """Centre (3,) and radius of a sphere that holds the shape, in the carrier's frame."""
        return self.pose[:3, 3], self.reach

    @pose_free
    def graph(self) -> tuple[IntArray, IntArray]:
        """Neighbours of the vertices of a hull: where those of each vertex end, and all of them, ascending."""
        count = len(self.points)
        if not count:
            return super().graph
        if len(self.faces):
            i, j = self.faces[:, [0, 1, 2, 1, 2, 0]], self.faces[:, [1, 2, 0, 0, 1, 2]]
            pairs = np.unique(i * count + j)
        else:  # a flat set: everything is near everything
            pairs = np.flatnonzero(~np.eye(count, dtype=bool))
        return np.cumsum(np.bincount(pairs // count, minlength=count)), pairs % count


def _box_frame(points: Array) -> tuple[Array, Array]:
    """A tight oriented box: rotation (3, 3) and centre (3,); principal axes or the given ones, whichever is smaller."""
    best: tuple[float, Array, Array] | None = None
    spread = points - points.mean(axis=0)
    for turn in (np.eye(3), np.linalg.eigh(spread.T @ spread)[1]):
        if np.linalg.det(turn) < 0.0:
            turn = turn * np.array([1.0, 1.0, -1.0])
        local = points @ turn
        low, high = local.min(axis=0), local.max(axis=0)
        volume = float(np.prod(high - low + 1e-6))
        if best is None or volume < 0.999 * best[0]:
            best = (volume, turn, turn @ (0.5 * (low + high)))
    assert best is not None
    return best[1], best[2]


def _hull(points: Array) -> tuple[IntArray, IntArray]:
    """Indices of the vertices of the convex hull and its faces among them; flat sets keep all points, without faces."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):  # flat, or too few
        return np.unique(points, axis=0, return_index=True)[1], np.zeros((0, 3), np.int64)
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    faces = number[hull.simplices].astype(np.int64)
    p = points[hull.vertices][faces]
    inward = np.einsum("fi,fi->f", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), hull.equations[:, :3]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return hull.vertices.astype(np.int64), faces


def hulls(pieces: Iterable[tuple[Array, IntArray]]) -> tuple[Convex, ...]:
    """Convex pieces ``(vertices, faces)`` as shapes."""
    return tuple(Convex.hull(vertices) for vertices, _ in pieces)


def mesh_hulls(vertices: Array, faces: IntArray) -> tuple[Convex, ...]:
    """A mesh as convex shapes that contain it: its hull where it is closed and fills that (`FILLED`), else a few."""
    from ..bodies.topology import is_closed
    from .split import split

    hull = Convex.hull(vertices)
    if not len(hull.faces) or (
        is_closed(faces) and _volume(vertices, faces) >= FILLED * _volume(hull.points, hull.faces)
    ):
        return (hull,)
    return tuple(Convex.hull(points) for points in split(vertices, faces))


def _volume(vertices: Array, faces: IntArray) -> float:
    corners = vertices[faces] - vertices.mean(axis=0)
    return float(np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)


def link_shapes(link: Link) -> tuple[Convex, ...]:
    """The collision geometry of a link, in the link's frame."""
    return tuple(convex for shape in link.collisions for convex in shape_convexes(shape))


def shape_convexes(shape: Shape) -> tuple[Convex, ...]:
    """One piece of collision geometry as convex shapes, in the link's frame."""
    if shape.kind is ShapeKind.MESH:
        return tuple(convex.at(shape.pose) for convex in mesh_hulls(*load_shape_mesh(shape)))
    if shape.kind is ShapeKind.BOX:
        return (Convex.box(shape.size).at(shape.pose),)
    if shape.kind is ShapeKind.SPHERE:
        return (Convex.sphere(shape.size[0]).at(shape.pose),)
    if shape.kind is ShapeKind.CYLINDER:
        return (Convex.cylinder(shape.size[0], shape.size[1]).at(shape.pose),)
    return (Convex.capsule(shape.size[0], shape.size[1]).at(shape.pose),)
