"""The free space between two sets of triangles along one direction, on a grid of parallel lines."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Array, BoolArray


class Grid(NamedTuple):
    """Lines along the first axis, through the centres of a regular grid over the second and third."""

    start: Array  # (2,), centre of the first cell
    cell: Array  # (2,), size of a cell
    shape: tuple[int, int]

    @classmethod
    def over(cls, low: Array, high: Array, cell: float) -> Grid:
        """The grid that fills the rectangle from *low* to *high* ``(2,)`` with cells of at most *cell*."""
        counts = np.maximum(np.ceil((high - low) / cell - 1e-9).astype(int), 1)
        size = (high - low) / counts
        return cls(low + 0.5 * size, size, (int(counts[0]), int(counts[1])))

    def centres(self) -> tuple[Array, Array]:
        """Coordinates of the lines, each of the grid's shape."""
        axes = [s + c * np.arange(n) for s, c, n in zip(self.start, self.cell, self.shape, strict=True)]
        y, z = np.meshgrid(axes[0], axes[1], indexing="ij")
        return y, z


def extent_along_lines(triangles: Array, grid: Grid) -> tuple[Array, Array]:
    """Smallest and largest first coordinate at which each line of *grid* meets ``triangles (T, 3, 3)``.

    Lines that meet none get (+inf, −inf).
    """
    low = np.full(grid.shape, np.inf)
    high = np.full(grid.shape, -np.inf)
    if not len(triangles):
        return low, high
    plane = (triangles[:, :, 1:] - grid.start) / grid.cell  # in cells
    first = np.maximum(np.ceil(plane.min(axis=1) - 1e-9), 0).astype(int)
    last = np.minimum(np.floor(plane.max(axis=1) + 1e-9), np.array(grid.shape) - 1).astype(int)
    counts = np.maximum(last - first + 1, 0)
    total = counts[:, 0] * counts[:, 1]
    which = np.repeat(np.arange(len(triangles)), total)
    if not len(which):
        return low, high
    inside = np.arange(len(which)) - np.repeat(np.cumsum(total) - total, total)
    i = first[which, 0] + inside // counts[which, 1]
    j = first[which, 1] + inside % counts[which, 1]
    a, b, c = plane[which, 0], plane[which, 1], plane[which, 2]
    p = np.stack([i, j], axis=1) - a
    u, v = b - a, c - a
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (p[:, 0] * v[:, 1] - p[:, 1] * v[:, 0]) / area
        t = (u[:, 0] * p[:, 1] - u[:, 1] * p[:, 0]) / area
        hit = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9) & (np.abs(area) > 1e-12)
    which, i, j, s, t = which[hit], i[hit], j[hit], s[hit], t[hit]
    x0, x1, x2 = triangles[which, 0, 0], triangles[which, 1, 0], triangles[which, 2, 0]
    x = x0 + s * (x1 - x0) + t * (x2 - x0)
    np.minimum.at(low, (i, j), x)
    np.maximum.at(high, (i, j), x)
    return low, high


def largest_patch(mask: BoolArray) -> BoolArray:
    """The largest connected part of *mask* (neighbours along rows and columns)."""
    from scipy import ndimage

    labels, count = ndimage.label(mask)
    if count <= 1:
        return mask
    sizes = np.bincount(labels.ravel())[1:]
    patch: BoolArray = labels == 1 + int(np.argmax(sizes))
    return patch
