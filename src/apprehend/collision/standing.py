"""What stands still, as rows for the sphere kernels (layout: `apprehend.kernels.sphere`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, BoolArray, IntArray
from ..kernels import sphere_near
from ..kernels.gjk import BOX, CYLINDER, HALF_SPACE, HULL
from .geometry import Geometry, joined
from .obstacles import Cloud, Grid, Union

FEW = 64
"""Unions of no more shapes than this are taken apart; others get a table of cells."""


class Standing(NamedTuple):
    """O rows that stand for some shapes; first cells count from the first of these rows."""

    rows: Array  # (O, 17), see `SphereModel.fixed`
    cells: NDArray[np.float32]
    counts: IntArray  # (O, 3): cells of a grid along its axes
    exactly: BoolArray  # (O,): whether a row is the shape itself
    numbers: IntArray  # (O,): the shape that a row stands for
    boxes: Array  # (O, 15): pose and half extents of a box around the shape; infinite for a half-space
    shapes: int  # how many there are


def standing(shapes: Sequence[Geometry]) -> Standing:
    """The rows of *shapes*."""
    whole = [(part, g) for g, shape in enumerate(shapes) for part in _taken_apart(shape)]
    rows, cells, counts, exactly = [], [np.zeros(0, np.float32)], [], []
    for shape, _ in whole:
        row, bounds, exact = _row(shape)
        row[13] = sum(map(len, cells)) if bounds.size else row[13]
        rows.append(row)
        cells.append(bounds.ravel())
        counts.append(bounds.shape)
        exactly.append(exact)
    boxes = [[*s.pose[:3, :3].ravel(), *s.pose[:3, 3], *s.half] for s, _ in whole]
    return Standing(
        np.array(rows), joined(cells), np.array(counts, np.int64), np.array(exactly), np.array([g for _, g in whole]),
        np.array(boxes), len(shapes),
    )  # fmt: skip


def join(all_of: Sequence[Standing]) -> Standing:
    """Rows one after the other; shapes still count within each of them."""
    if len(all_of) < 2:
        return all_of[0] if all_of else NOTHING
    rows, cells, *rest, shapes = zip(*all_of, strict=True)
    fixed = np.concatenate(rows)
    first = np.cumsum([0, *map(len, cells[:-1])])
    fixed[:, 13] += np.where(fixed[:, 16] == sphere_near.GRID, np.repeat(first, [len(r) for r in rows]), 0)
    counts, exactly, numbers, boxes = (np.concatenate(arrays) for arrays in rest)
    return Standing(fixed, joined(cells), counts, exactly, numbers, boxes, sum(shapes))


NOTHING = Standing(
    np.zeros((0, 17)), np.zeros(0, np.float32), np.zeros((0, 3), np.int64), np.zeros(0, np.bool_),
    np.zeros(0, np.int64), np.zeros((0, 15)), 0,
)  # fmt: skip


def _taken_apart(shape: Geometry) -> Sequence[Geometry]:
    if isinstance(shape, Union) and len(shape.shapes) <= FEW:
        return [part.at(shape.pose) for part in shape.shapes]
    return [shape]


def _row(shape: Geometry) -> tuple[Array, NDArray[np.float32], bool]:
    """A row of ``SphereModel.fixed``, its cells, and whether it is exact."""
    row = np.zeros(17)
    row[:9], row[9:12] = shape.pose[:3, :3].ravel(), shape.pose[:3, 3]
    cells, exactly = np.zeros((0, 0, 0), np.float32), True
    if isinstance(shape, Cloud | Grid | Union):
        corner, side, cells = shape.cells
        row[9:12] += shape.pose[:3, :3] @ corner
        row[12], row[16], exactly = 1.0 / side, sphere_near.GRID, False
    elif shape.kind == BOX:
        row[12:16] = *shape.size, shape.radius
    elif shape.kind == CYLINDER:
        row[12:17] = shape.size[0], shape.size[0], shape.size[1], shape.radius, sphere_near.CYLINDER
    elif shape.kind == HALF_SPACE:
        row[16] = sphere_near.HALF_SPACE
    else:
        half = shape.half - shape.radius
        exactly = shape.kind == HULL and len(shape.points) <= 2
        if exactly:  # a point, or a segment along an axis of its box
            half = np.where(half < 1e-12, 0.0, half)
            exactly = int((half > 0.0).sum()) == len(shape.points) - 1
        row[12:15], row[15] = half, shape.radius
    return row, cells, exactly


def gaps(boxes: Array, points: Array) -> Array:
    """Lower bounds ``(P, O)`` on the distances of ``points (P, 3)`` to what stands in ``boxes (O, 15)``."""
    local = np.einsum("oij,poi->poj", boxes[:, :9].reshape(-1, 3, 3), points[:, None] - boxes[:, 9:12])
    out = np.maximum(np.abs(local) - boxes[:, 12:], 0.0)
    distance: Array = np.sqrt(np.einsum("poj,poj->po", out, out))
    endless = np.isinf(boxes[:, 12])
    distance[:, endless] = local[:, endless, 2]
    return distance
