"""Signed distance of two convex shapes at many poses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_pose
from ..kernels import collide_pairs
from ..parallel import over_ranges
from .shapes import Convex, pack

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


def signed_distance(a: Convex, b: Convex, T_a: ArrayLike, T_b: ArrayLike) -> Separation:
    """Distance of *a* at *T_a* ``(..., 4, 4)`` and *b* at *T_b*, batches broadcast.

    Separated shapes: Gilbert, Johnson & Keerthi 1988; overlapping ones: the expanding polytope of van den Bergen 2001,
    which bounds the depth from both sides. Points, segments and polygons of both cores are exact to rounding; curved
    cores (cylinder, cone, ellipsoid) converge to 1e-9 of their size.
    """
    TA, TB = np.broadcast_arrays(as_pose(T_a, "T_a"), as_pose(T_b, "T_b"))
    shape, count = TA.shape[:-2], math.prod(TA.shape[:-2])
    poses = [np.empty((count, 12)) for _ in range(2)]
    for flat, T in zip(poses, (TA, TB), strict=True):
        rows = T.reshape(count, 4, 4)
        flat[:, :9], flat[:, 9:] = rows[:, :3, :3].reshape(count, 9), rows[:, :3, 3]
    arrays = pack((a, b))
    distance, out = np.zeros(count), np.zeros((count, 9))
    if count:
        over_ranges(
            lambda start, stop: collide_pairs.pair_many(*arrays, *poses, start, stop, distance, out), count, GRAIN
        )
    return Separation(distance.reshape(shape), out[:, :6].reshape(*shape, 2, 3), out[:, 6:].reshape(*shape, 3))
