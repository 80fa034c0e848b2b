"""A body in parts, cut by planes so that simple shapes around the parts fit closely and leave nothing out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, IntArray
from . import fit, repair

PLACES = (0.5, 0.35, 0.65, 0.2, 0.8)
"""Where cuts across the sides of the box around a part are tried."""

ENOUGH = 0.02
"""Parts are not cut further once their shapes exceed them by less than this share of the body's volume."""

Cost = Callable[[Array], float]
"""About the volume of the shape around a part, from the extents ``(3,)`` of its box."""


@dataclass(frozen=True, eq=False)
class _Part:
    """Triangles ``(F, 3, 3)``, the solid that they bound (None: there is none), and how much its shape exceeds it."""

    triangles: Array
    solid: Any
    excess: float

    @classmethod
    def of(cls, triangles: Array, solid: Any, cost: Cost) -> _Part:
        low, high = _box(triangles)
        return cls(triangles, solid, cost(high - low) - (float(solid.volume()) if solid is not None else 0.0))


def partitions(
    vertices: Array, faces: IntArray, count: int, cost: Cost, sticks_out: Callable[[Array], float] | None = None
) -> Iterator[list[Array]]:
    """Finer and finer partitions of a body, up to *count* parts: the corners ``(V, 3)`` of the parts' convex hulls.

    The hulls of each partition contain the body together. The part whose shape *sticks_out* most (of the corners of
    its hull; None: whose shape exceeds it by the largest volume) is cut, across the axis of the body's smallest box
    where the two shapes become smallest. A closed 2-manifold is cut as a solid, so that its parts have the faces of
    the cuts, and pieces that come apart are parts of their own. Of another mesh the surface is cut (and contained), no
    more. Parts that stay are the same arrays in the next partition.
    """
    corners = fit.hull_points(vertices[faces].reshape(-1, 3))
    yield [corners]
    if count == 1:
        return
    turn = fit.block(corners).pose[:3, :3]
    turned = vertices @ turn
    solid = repair.as_manifold(turned, faces)
    if solid is not None and solid.volume() <= 0.0:
        solid = None
    found, hulls = [_Part.of(turned[faces], solid, cost)], [corners]
    enough = ENOUGH * float(solid.volume()) if solid is not None else 0.0
    while len(found) < count:
        worth = [
            (part.excess if sticks_out is None else sticks_out(its)) if part.excess > enough else -np.inf
            for part, its in zip(found, hulls)
        ]
        k = int(np.argmax(worth))
        if worth[k] == -np.inf:
            return
        pieces = _divided(found[k], cost, count - len(found) + 1)
        if len(pieces) < 2:
            return
        found[k : k + 1] = pieces
        hulls[k : k + 1] = [fit.hull_points(piece.triangles.reshape(-1, 3)) @ turn.T for piece in pieces]
        yield list(hulls)


def _divided(part: _Part, cost: Cost, most: int) -> list[_Part]:
    """The part in two, or more if they come apart and there is room for at most *most*."""
    low, high = _box(part.triangles)
    best: tuple[float, int, float] | None = None
    for axis in np.argsort(low - high).tolist():
        for share in PLACES:
            place = float(low[axis] + share * (high[axis] - low[axis]))
            sides = cut(part.triangles, axis, place)
            if min(map(len, sides)) == 0:
                continue
            price = sum(cost(np.subtract(*_box(side)[::-1])) for side in sides)
            if best is None or price < 0.999 * best[0]:
                best = (price, axis, place)
    if best is None:
        return [part]
    _, axis, place = best
    if part.solid is None:
        return [_Part.of(side, None, cost) for side in cut(part.triangles, axis, place)]
    pieces: list[Any] = []
    for side in part.solid.split_by_plane(np.eye(3)[axis], place):
        apart = [p for p in side.decompose() if p.num_tri()]
        pieces += apart if len(apart) + 1 <= most else [side]
    return [_Part.of(v[f], piece, cost) for piece in pieces if piece.num_tri() for v, f in [repair.mesh_of(piece)]]


def cut(triangles: Array, axis: int, place: float) -> tuple[Array, Array]:
    """The surface ``(F, 3, 3)`` below and above a plane across *axis*; triangles that it crosses are divided."""
    height = triangles[:, :, axis] - place
    below, above = (height <= 0.0).all(axis=1), (height >= 0.0).all(axis=1)
    crossed = ~below & ~above
    corners, upper = triangles[crossed], height[crossed] > 0.0
    lonely_above = upper.sum(axis=1) == 1
    first = np.argmax(upper == lonely_above[:, None], axis=1)  # the corner that is alone on its side
    order = (first[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    h = np.take_along_axis(height[crossed], order, axis=1)
    p, q, r = corners[:, 0], corners[:, 1], corners[:, 2]
    pq = p + (h[:, 0] / (h[:, 0] - h[:, 1]))[:, None] * (q - p)
    pr = p + (h[:, 0] / (h[:, 0] - h[:, 2]))[:, None] * (r - p)
    pq[:, axis] = pr[:, axis] = place
    lone = np.stack([p, pq, pr], axis=1)
    rest = np.stack([np.stack([pq, q, r], axis=1), np.stack([pq, r, pr], axis=1)], axis=1)
    sides = []
    for whole, own in ((below, ~lonely_above), (above, lonely_above)):
        sides.append(np.concatenate([triangles[whole], lone[own], rest[~own].reshape(-1, 3, 3)]))
    return sides[0], sides[1]


def _box(triangles: Array) -> tuple[Array, Array]:
    return triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
