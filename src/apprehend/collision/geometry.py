"""What every kind of geometry has in common, and their arrays for the kernels."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Generic, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, IntArray, as_pose
from ..errors import InputError
from ..kernels.collide import Shapes
from ..kernels.gjk import CLOUD, FIELD, HULL, TREE
from ..kernels.obstacle import sort_tree

ROUND_OFF = 1e-9
"""Bounds of shapes are enlarged by this share, so that rounding never makes them too small."""

AnyArray = NDArray[Any]

LEAF = 6
"""Points or shapes in a leaf of a tree, at most."""


Found = TypeVar("Found")


class pose_free(Generic[Found]):
    """A property that does not depend on the pose: found once, and shared by all copies at other poses."""

    def __init__(self, compute: Callable[[Any], Found]) -> None:
        self.compute, self.__doc__ = compute, compute.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, shape: Any, owner: type | None = None) -> Found:
        if shape is None:
            return self  # type: ignore[return-value]  # the class asks for its documentation
        known = shape.known
        if self.name not in known:
            known[self.name] = self.compute(shape)
        found: Found = known[self.name]
        return found


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

    @cached_property
    def known(self) -> dict[Any, Any]:
        """What `pose_free` properties have found so far."""
        return {}

    def at(self, pose: ArrayLike) -> Self:
        """The same shape carried along by *pose* (4, 4): ``pose @ self.pose``."""
        T = as_pose(pose, "pose")
        if T.shape != (4, 4):
            raise InputError(f"pose has shape {T.shape}; expected one (4, 4) pose")
        moved = replace(self, pose=T @ self.pose)  # type: ignore[type-var]
        moved.__dict__["known"] = self.known
        return moved

    @property
    def graph(self) -> tuple[IntArray, IntArray]:
        """Neighbours of the vertices of a hull: where those of each vertex end, and all of them; else none."""
        return np.zeros(len(self.points), np.int64), np.zeros(0, np.int64)

    @property
    def leaves(self) -> Sequence[Geometry]:
        """The convex shapes of a union."""
        return ()

    @property
    def values(self) -> Array:
        """Header and values of a field."""
        return np.zeros(0)

    @pose_free
    def form(self) -> Form:
        """What the rows of the shape say wherever it is."""
        size, points, tree = np.array(self.size), self.points, np.zeros((0, 4))
        count, leaves = len(points), tuple[Geometry, ...]()
        ends, around = self.graph
        if self.leaves:
            balls = [leaf.ball for leaf in self.leaves]
            order, size, tree = sorted_tree(np.array([c for c, _ in balls]), np.array([r for _, r in balls]))
            count, leaves = len(order), tuple(self.leaves[i] for i in order)
        elif self.kind != HULL and count:
            order, size, tree = sorted_tree(points, np.zeros(count))
            points = points[order]
        return Form(size, count, points, ends, around, tree, self.values, leaves)

    @pose_free
    def leaf_rows(self) -> Rows:
        """Rows of the shapes of a union, in the order of its tree."""
        return rows_of(self.form.leaves)


def positive(what: str, *values: float) -> None:
    """Raise `InputError` unless all *values* are positive and finite."""
    numbers = [v for v in values if isinstance(v, int | float | np.number) and np.isfinite(v) and v > 0.0]
    if len(numbers) < len(values):
        given = ", ".join(f"{v:g}" if isinstance(v, int | float | np.number) else repr(v) for v in values)
        raise InputError(f"{what} must be positive, in m; got {given}")


class Form(NamedTuple):
    """The pose-free part of a shape's rows."""

    size: Array  # (3,)
    number: int  # of points, or of the shapes of a union
    points: Array
    ends: IntArray  # (V,) where the neighbours of each vertex end
    around: IntArray
    tree: Array  # (T, 4)
    values: Array
    leaves: tuple[Geometry, ...]  # in the order of the tree


class Rows(NamedTuple):
    """Rows of some shapes; places in other arrays count from the first row, so that rows can be joined.

    First shapes of unions count among the shapes of all these unions, which are rows of their own.
    """

    ints: IntArray
    floats: Array
    points: Array
    ends: IntArray
    around: IntArray
    trees: Array
    values: Array


class Part(NamedTuple):
    """Rows of shapes, and of the shapes of the unions among them."""

    rows: Rows
    leaves: Rows


NOTHING = Rows(
    np.zeros((0, 4), np.int64), np.zeros((0, 23)), np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64),
    np.zeros((0, 4)), np.zeros(0),
)  # fmt: skip
POINT = NOTHING._replace(
    ints=np.array([[HULL, 0, 1, -1]]),
    floats=np.concatenate([np.zeros(8), np.eye(3).ravel(), np.zeros(6)])[None],
    points=np.zeros((1, 3)),
    ends=np.zeros(1, np.int64),
)
"""A point at the origin."""


def sorted_tree(centres: Array, radii: Array) -> tuple[IntArray, Array, Array]:
    """Sort balls into a tree of balls: their order, the size row of the shape that they make, and the tree."""
    count = len(centres)
    levels = max(0, math.ceil(math.log2(count / LEAF)))
    balls, order = np.zeros((2 ** (levels + 1) - 1, 4)), np.arange(count, dtype=np.int64)
    sort_tree(centres, radii, levels, order, balls, 0)
    return order, np.array([0.0, float(levels), 0.0]), balls


def rows_of(shapes: Sequence[Geometry], carrier: int = -1) -> Rows:
    """Rows of *shapes* on *carrier*."""
    return join_rows([_row(shape, carrier) for shape in shapes], [len(shape.form.leaves) for shape in shapes])


def _row(shape: Geometry, carrier: int) -> Rows:
    form, pose = shape.form, shape.pose
    centre, reach = shape.ball
    floats = np.empty((1, 23))
    floats[0, :3], floats[0, 3], floats[0, 4:7], floats[0, 7] = form.size, shape.radius, centre, reach
    floats[0, 8:17], floats[0, 17:20], floats[0, 20:] = pose[:3, :3].ravel(), pose[:3, 3], shape.half
    ints = np.array([[shape.kind, 0, form.number, carrier]])
    return Rows(ints, floats, form.points, form.ends, form.around, form.tree, form.values)


def part_of(shapes: Sequence[Geometry], carrier: int = -1) -> Part:
    """Rows of *shapes* on *carrier*, and of the shapes of unions among them."""
    leaves = [shape.leaf_rows for shape in shapes if shape.leaves]
    return Part(rows_of(shapes, carrier), join_rows(leaves, [0] * len(leaves)))


def join_rows(rows: Sequence[Rows], leaves: Sequence[int]) -> Rows:
    """Rows one after the other; *leaves* says how many shapes of unions belong to each."""
    if len(rows) < 2:
        return rows[0] if rows else NOTHING
    out = Rows(
        np.concatenate([r.ints for r in rows]),
        np.concatenate([r.floats for r in rows]),
        np.concatenate([r.points for r in rows]),
        np.concatenate([r.ends for r in rows]),
        np.concatenate([r.around for r in rows]),
        joined([r.trees for r in rows]),
        joined([r.values for r in rows]),
    )
    sizes = np.array([(len(r.points), len(r.values), n, len(r.trees), len(r.around)) for r, n in zip(rows, leaves)])
    before = np.cumsum(sizes, axis=0) - sizes
    place = np.repeat(before, [len(r.ints) for r in rows], axis=0)
    kind = out.ints[:, 0]
    out.ints[:, 1] += place[np.arange(len(kind)), PLACES[kind]]
    out.floats[:, 0] += np.where(kind >= CLOUD, place[:, 3], 0)
    np.add(out.ends, np.repeat(before[:, 4], sizes[:, 0]), out=out.ends)
    return out


PLACES = np.array([1 if kind == FIELD else 2 if kind == TREE else 0 for kind in range(TREE + 1)])
"""Which kind of place a row of each kind names first: a vertex, a value of a field, a shape of a union."""


def joined(arrays: Sequence[AnyArray]) -> AnyArray:
    """One after the other; without a copy where there is but one."""
    filled = [array for array in arrays if len(array)]
    return np.concatenate(filled) if len(filled) > 1 else filled[0] if filled else arrays[0]


def join(parts: Sequence[Part]) -> Part:
    """Parts one after the other."""
    rows = join_rows([p.rows for p in parts], [len(p.leaves.ints) for p in parts])
    leaves = [p.leaves for p in parts if len(p.leaves.ints)]
    return Part(rows, join_rows(leaves, [0] * len(leaves)))


def arrays_of(part: Part) -> Shapes:
    """Arrays for kernels (layout: `apprehend.kernels.gjk`): the shapes, those of unions, a point."""
    out = join_rows([part.rows, part.leaves, POINT], [0, 0, 0])
    out.ints[out.ints[:, 0] == TREE, 1] += len(part.rows.ints)
    special = len(out.trees) + len(out.values) > 0
    around = [np.zeros(1, np.int64), out.ends]
    return Shapes(
        ints=out.ints,
        floats=out.floats,
        points=out.points,
        graph=np.concatenate([np.concatenate(around) + len(out.ends) + 1, out.around]),
        trees=out.trees if special else None,
        grids=out.values if special else None,
    )


def pack(shapes: Sequence[Geometry]) -> Shapes:
    """Arrays for kernels of *shapes* alone."""
    return arrays_of(part_of(shapes))
