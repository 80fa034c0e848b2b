"""Tables of lower bounds on the distance to clouds, fields and unions: one number for each cell of a grid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, IntArray

MOST = 1_000_000
"""Most cells of a table, about."""

FINEST = 0.004
"""Smallest side of a cell in m."""


class CellTable(NamedTuple):
    """A grid in the frame of a shape, and a bound for each cell.

    No point of a cell is nearer to the shape than the bound, and no point outside the grid nearer than the bound of
    the nearest cell and the distance to it make it.
    """

    corner: Array  # (3,)
    side: float  # of a cell
    bounds: NDArray[np.float32]  # (nx, ny, nz)


def within(samples: Array, spacing: float, steepness: float) -> CellTable:
    """The table of a field that is sampled at the corners of the cells."""
    low = samples
    for axis in range(3):
        n = low.shape[axis] - 1
        low = np.minimum(low.take(range(n), axis), low.take(range(1, n + 1), axis))
    return CellTable(-0.5 * spacing * (np.array(samples.shape) - 1.0), spacing, _rounded_down(low / steepness))


def around(low: Array, high: Array, radius: float) -> CellTable:
    """The table for boxes from ``low (N, 3)`` to ``high (N, 3)``, grown by *radius*."""
    from scipy.ndimage import distance_transform_edt

    corner, end = low.min(axis=0), high.max(axis=0)
    extent = np.maximum(end - corner, FINEST)
    side = max(FINEST, float((np.prod(extent) / MOST) ** (1.0 / 3.0)), float(extent.max()) / MOST)
    while np.prod(np.floor(extent / side) + 5.0) > 2.0 * MOST:  # thin sets, for which the rim counts
        side *= 1.26
    corner = corner - 2.0 * side
    count = np.floor((end - corner) / side).astype(np.int64) + 3
    first, last = (np.floor((p - corner) / side).astype(np.int64) for p in (low, high))
    near = _covered(first, last, count)
    return CellTable(corner, side, _rounded_down(distance_transform_edt(~near) * side - radius))


def _covered(first: IntArray, last: IntArray, count: IntArray) -> NDArray[np.bool_]:
    """The cells from ``first (N, 3)`` to ``last (N, 3)`` of each box, and those that touch them.

    A box adds one to all cells beyond its first corner, and takes it away beyond its others: sums along the axes.
    """
    steps = np.zeros(tuple(count + 1), np.int64)
    a, b = first - 1, last + 2
    for corner in range(8):
        side = [(corner >> axis) & 1 for axis in range(3)]
        place = np.ravel_multi_index(tuple(np.where(side, b, a).T), steps.shape)
        many = np.bincount(place, minlength=steps.size).reshape(steps.shape)
        steps += -many if sum(side) % 2 else many
    for axis in range(3):
        np.cumsum(steps, axis=axis, out=steps)
    covered: NDArray[np.bool_] = steps[:-1, :-1, :-1] > 0
    return covered


def _rounded_down(bounds: Array) -> NDArray[np.float32]:
    return np.ascontiguousarray(bounds - 1e-6 * np.abs(bounds), dtype=np.float32)
