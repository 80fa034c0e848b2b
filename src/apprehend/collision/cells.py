"""Tables of lower bounds on the distance to clouds, fields and unions: one number for each cell of a grid."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..errors import InputError
from .geometry import Geometry
from .obstacles import Cloud, Grid, Union

MOST = 1_000_000
"""Most cells of a table, about."""

FINEST = 0.004
"""Smallest side of a cell in m."""


def cell_table(shape: Geometry) -> tuple[Array, float, Array]:
    """The corner (3,) of a grid in the shape's frame, the side of its cells, and a bound for each cell (float32).

    No point of a cell is nearer to the shape than the bound, and no point outside the grid nearer than the bound of
    the nearest cell and the distance to it make it.
    """
    if isinstance(shape, Grid):
        low = shape.samples
        for axis in range(3):
            n = low.shape[axis] - 1
            low = np.minimum(low.take(range(n), axis), low.take(range(1, n + 1), axis))
        return -shape.half, shape.spacing, _rounded_down(low / shape.steepness)
    if isinstance(shape, Cloud):
        return _around(shape.points, shape.points, shape.radius)
    if isinstance(shape, Union):
        reach = [np.abs(s.pose[:3, :3]) @ s.half for s in shape.shapes]
        centres = np.array([s.pose[:3, 3] for s in shape.shapes])
        return _around(centres - reach, centres + reach, 0.0)
    raise InputError(f"there is no table of cells for a {type(shape).__name__}")


def _around(low: Array, high: Array, radius: float) -> tuple[Array, float, Array]:
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
    near = np.zeros(tuple(count), dtype=bool)
    for a, b in np.unique(np.stack([first, last], axis=1), axis=0):
        near[a[0] - 1 : b[0] + 2, a[1] - 1 : b[1] + 2, a[2] - 1 : b[2] + 2] = True  # and the cells that touch them
    return corner, side, _rounded_down(distance_transform_edt(~near) * side - radius)


def _rounded_down(bounds: Array) -> Array:
    return np.ascontiguousarray(bounds - 1e-6 * np.abs(bounds), dtype=np.float32)
