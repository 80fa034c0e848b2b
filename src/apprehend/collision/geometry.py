"""What every kind of geometry has in common, and their arrays for the kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_pose
from ..errors import InputError
from ..kernels.collide import Shapes
from ..kernels.gjk import HULL
from ..kernels.obstacle import sort_tree

ROUND_OFF = 1e-9
"""Bounds of shapes are enlarged by this share, so that rounding never makes them too small."""

LEAF = 6
"""Points or shapes in a leaf of a tree, at most."""


class Geometry:
    """A shape at a pose in the frame of what carries it (a link, a body, or the world).

    Derived dataclasses have the fields and properties below; layout of the arrays: `apprehend.kernels.gjk`.
    """

    kind: int
    size: Array
    radius: float
    points: Array  # (V, 3)
    pose: Array  # (4, 4)

    @property
    def half(self) -> Array:
        """Half extents (3,) of the box about the shape's origin, in the shape's frame, that holds it."""
        raise NotImplementedError

    @property
    def ball(self) -> tuple[Array, float]:
        """Centre (3,) and radius of a sphere that holds the shape, in the carrier's frame."""
        raise NotImplementedError

    def at(self, pose: ArrayLike) -> Self:
        """The same shape carried along by *pose* (4, 4): ``pose @ self.pose``."""
        T = as_pose(pose, "pose")
        if T.shape != (4, 4):
            raise InputError(f"pose has shape {T.shape}; expected one (4, 4) pose")
        return replace(self, pose=T @ self.pose)  # type: ignore[type-var]

    @property
    def neighbours(self) -> list[list[int]]:
        """For every vertex of a hull, the vertices that share an edge with it; empty where nothing is climbed."""
        return []

    @property
    def leaves(self) -> Sequence[Geometry]:
        """The convex shapes of a union."""
        return ()

    @property
    def values(self) -> Array:
        """Header and values of a field."""
        return np.zeros(0)


def positive(what: str, *values: float) -> None:
    """Raise `InputError` unless all *values* are positive and finite."""
    numbers = [v for v in values if isinstance(v, int | float | np.number) and np.isfinite(v) and v > 0.0]
    if len(numbers) < len(values):
        given = ", ".join(f"{v:g}" if isinstance(v, int | float | np.number) else repr(v) for v in values)
        raise InputError(f"{what} must be positive, in m; got {given}")


class _Point(Geometry):
    """A point at the origin."""

    kind, size, radius, points, pose = HULL, np.zeros(3), 0.0, np.zeros((1, 3)), np.eye(4)

    @property
    def half(self) -> Array:
        """Nothing."""
        return np.zeros(3)

    @property
    def ball(self) -> tuple[Array, float]:
        """A point."""
        return np.zeros(3), 0.0


class _Packer:
    """Collects rows."""

    def __init__(self, count: int) -> None:
        self.ints: list[list[int]] = []
        self.floats: list[Array] = []
        self.points: list[Array] = [np.zeros((0, 3))]
        self.ends: list[IntArray] = []  # of the neighbours of each vertex
        self.around: list[int] = []
        self.trees: list[Array] = [np.zeros((0, 4))]
        self.grids: list[Array] = [np.zeros(0)]
        self.leaves: list[Geometry] = []
        self.first_leaf = count
        self.vertices, self.balls, self.numbers = 0, 0, 0

    def add(self, shape: Geometry) -> None:
        """One more row."""
        points, first, count, size = shape.points, self.vertices, len(shape.points), shape.size
        if shape.leaves:
            order, size = self.tree(
                np.array([leaf.ball[0] for leaf in shape.leaves]), np.array([leaf.ball[1] for leaf in shape.leaves])
            )
            first, count = self.first_leaf + len(self.leaves), len(order)
            self.leaves += [shape.leaves[i] for i in order]
        elif shape.kind != HULL and count:
            order, size = self.tree(points, np.zeros(count))
            points = points[order]
        elif len(shape.values):
            first, count = self.numbers, 0
            self.grids.append(shape.values)
            self.numbers += len(shape.values)
        near = shape.neighbours or [[]] * len(points)
        self.ends.append(len(self.around) + np.cumsum([len(n) for n in near], dtype=np.int64))
        self.around += [i for n in near for i in n]
        self.points.append(points)
        self.vertices += len(points)
        centre, reach = shape.ball
        self.ints.append([shape.kind, first, count, -1])
        rest = [shape.radius, *centre, reach, *shape.pose[:3, :3].ravel(), *shape.pose[:3, 3], *shape.half]
        self.floats.append(np.array([*size, *rest]))

    def tree(self, centres: Array, radii: Array) -> tuple[IntArray, Array]:
        """Sort balls into a tree of balls: their order, and where the tree is."""
        count = len(centres)
        levels = max(0, math.ceil(math.log2(count / LEAF)))
        balls, order = np.zeros((2 ** (levels + 1) - 1, 4)), np.arange(count, dtype=np.int64)
        sort_tree(centres, radii, levels, order, balls, 0)
        self.trees.append(balls)
        size = np.array([float(self.balls), float(levels), 0.0])
        self.balls += len(balls)
        return order, size


def pack(shapes: Sequence[Geometry]) -> Shapes:
    """Arrays for kernels (layout: `apprehend.kernels.gjk`)."""
    packer = _Packer(len(shapes))
    for shape in shapes:
        packer.add(shape)
    leaves = list(packer.leaves)
    for leaf in leaves:
        packer.add(leaf)
    packer.add(_Point())
    special = packer.balls + packer.numbers > 0
    ends = np.concatenate([np.zeros(1, np.int64), *packer.ends])
    return Shapes(
        ints=np.array(packer.ints, np.int64),
        floats=np.array(packer.floats),
        points=np.concatenate(packer.points),
        graph=np.concatenate([ends + len(ends), np.array(packer.around, np.int64)]),
        trees=np.concatenate(packer.trees) if special else None,
        grids=np.concatenate(packer.grids) if special else None,
    )
