"""`smooth`: corners of a path cut by subdivision towards a cubic B-spline, as far as that stays free."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped
from ..collision import CollisionModel
from ..errors import InputError
from .constraints import PathConstraint
from .keeping import Constraints

ROUNDS = 4
"""Subdivisions: corners become arcs of up to 2⁴ chords."""

STRAIGHT = 1e-9
"""Vertices that are no farther from the line between their neighbours are dropped, in rad or m."""


def smooth(
    model: CollisionModel,
    path: ArrayLike,
    *,
    rounds: int = ROUNDS,
    constraints: Sequence[PathConstraint] = (),
) -> Array:
    """A path ``(M', n)`` with the same ends and rounded corners, every motion of it free as *path*'s are.

    Each round puts a vertex into the middle of every segment and moves every old vertex v to (a + 6 v + b) / 8, a and b
    its old neighbours: Lane & Riesenfeld's subdivision, whose limit is the uniform cubic B-spline (C²) of the path.
    Where the moved vertex or the motions to it are not free or violate *constraints*, the old one stays.
    """
    points = as_shaped(path, "path", model.robot.n)
    if points.ndim != 2 or not len(points):
        raise InputError(f"path has shape {points.shape}; expected (M, {model.robot.n})")
    keep = Constraints(model.robot, constraints)
    for _ in range(rounds):
        if len(points) < 3:
            break
        middles = 0.5 * (points[:-1] + points[1:])
        left, right = middles[:-1], middles[1:]
        moved = 0.25 * (left + 2.0 * points[1:-1] + right)
        free = model.edges_free(left, moved) & model.edges_free(moved, right)
        if constraints:
            free &= keep.hold(left, moved) & keep.hold(moved, right)
        inner = np.where(free[:, None], moved, points[1:-1])
        out = np.empty((2 * len(points) - 1, points.shape[1]))
        out[0], out[-1] = points[0], points[-1]
        out[1::2], out[2:-1:2] = middles, inner
        points = without_straight(out)
    return points.copy()


def without_straight(points: Array) -> Array:
    """The vertices that turn, and the ends."""
    kept = [0]
    for i in range(1, len(points) - 1):
        a, b = points[kept[-1]], points[i + 1]
        along, way = b - a, points[i] - a
        length = float(along @ along)
        aside = way - along * (float(way @ along) / length if length > 0.0 else 0.0)
        if float(np.abs(aside).max()) > STRAIGHT:
            kept.append(i)
    return points[[*kept, len(points) - 1]] if len(points) > 1 else points
