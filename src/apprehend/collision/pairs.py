"""Signed distance of two pieces of geometry of any kind, at many poses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_pose
from ..kernels import collide_pairs
from ..kernels.gjk import CLOUD, FIELD, HALF_SPACE
from ..parallel import over_ranges
from .geometry import Geometry, pack
from .obstacles import Grid, Union, as_geometry

GRAIN = 64


@dataclass(frozen=True, eq=False)
class Separation:
    """Signed distance of two shapes, and where."""

    distance: Array
    """``(...)`` in m; negative: the length of the shortest translation that separates them."""
    points: Array
    """``(..., 2, 3)`` the nearest (or deepest) points of the first and the second, in the world."""
    normal: Array
    """``(..., 3)`` unit vector from the second to the first: the way to move the first clear."""


def signed_distance(a: object, b: object, T_a: ArrayLike, T_b: ArrayLike) -> Separation:
    """Distance of *a* at *T_a* ``(..., 4, 4)`` and *b* at *T_b*, batches broadcast.

    Each is a `Convex`, a `HalfSpace`, a `Cloud`, a `Union` (a mesh as convex pieces or as triangles), a `Grid` or a
    body's distance field, a body (its convex pieces), or a sequence of convex shapes.

    - Convex cores: Gilbert, Johnson & Keerthi 1988 where they are apart, the expanding polytope of van den Bergen 2001
      where they overlap: exact to rounding between polytopes, to about 1e-11 of the size with curved ones (where a
      small thing sits at the centre of a round one of equal widths, its depth may be 3e-5 of the size too large).
    - Unions and clouds: the least distance over their parts; where parts overlap, the depth of the deepest pair.
    - Fields: the least value of the interpolated field on the other shape, by branch and bound to 1 % of the spacing
      or half a per cent of itself; the depth is that of the deepest point. It is as exact as the samples; beyond the
      grid it is a lower bound (see `Grid`), to 2 %. Of two fields, the first
      is taken as the points where its surface crosses the edges of its grid.
    - Two half-spaces overlap without bound (−inf) unless their faces are opposite and parallel within 1e-9.
    """
    first, second = _one(a, "a"), _one(b, "b")
    if _rank(first) > _rank(second) or (_rank(first) == _rank(second) == CLOUD and _parts(first) > _parts(second)):
        back = signed_distance(second, first, T_b, T_a)
        return Separation(back.distance, np.ascontiguousarray(back.points[..., ::-1, :]), -back.normal)
    if isinstance(first, Grid):
        first = first.crossings
    TA, TB = np.broadcast_arrays(as_pose(T_a, "T_a"), as_pose(T_b, "T_b"))
    shape, count = TA.shape[:-2], math.prod(TA.shape[:-2])
    if first.kind == HALF_SPACE:
        return _half_spaces(TA @ first.pose, TB @ second.pose)
    poses = [np.empty((count, 12)) for _ in range(2)]
    for flat, T in zip(poses, (TA, TB), strict=True):
        rows = T.reshape(count, 4, 4)
        flat[:, :9], flat[:, 9:] = rows[:, :3, :3].reshape(count, 9), rows[:, :3, 3]
    arrays = pack((first, second))
    distance, out = np.zeros(count), np.zeros((count, 9))
    work = collide_pairs.each_many if first.kind >= CLOUD else collide_pairs.pair_many
    if count:
        over_ranges(lambda start, stop: work(arrays, *poses, start, stop, distance, out), count, GRAIN)
    return Separation(distance.reshape(shape), out[:, :6].reshape(*shape, 2, 3), out[:, 6:].reshape(*shape, 3))


def _one(thing: object, name: str) -> Geometry:
    parts = as_geometry(thing, name)
    return parts[0] if len(parts) == 1 else Union.of(parts)


def _parts(shape: Geometry) -> int:
    return len(shape.leaves) or len(shape.points)


def _rank(shape: Geometry) -> int:
    """The kernels want a convex shape first, then a cloud or union, then a field, then a half-space."""
    if shape.kind == HALF_SPACE:
        return CLOUD + 2
    if shape.kind == FIELD:
        return CLOUD + 1
    return CLOUD if shape.kind >= CLOUD else 0


def _half_spaces(A: Array, B: Array) -> Separation:
    """Two half-spaces: a gap, or an overlap, where their faces look at each other."""
    n = B[..., :3, 2]
    gap = np.einsum("...i,...i->...", n, A[..., :3, 3] - B[..., :3, 3])
    opposite = np.linalg.norm(A[..., :3, 2] + n, axis=-1) < 1e-9
    on_b = A[..., :3, 3] - gap[..., None] * n
    points = np.stack([A[..., :3, 3], on_b], axis=-2)
    return Separation(np.where(opposite, gap, -np.inf), points, np.array(n))
