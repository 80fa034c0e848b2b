"""Spheres that cover a shape: nothing of it sticks out, and how far they stick out is measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..arrays import Array, IntArray
from ..kernels import cover as kernels
from ..kernels.gjk import BOX, CONE, CYLINDER, HULL
from ..kernels.tree import TreeModel
from .geometry import Geometry
from .shapes import Convex

MOST = 24
"""Most spheres for one convex shape."""

FINE = 1.25
"""A part is not split further once its sphere is no larger than this times the shape's smallest half extent."""

SMALL = 0.04
"""... or than this, in m."""

SIDES = 24
"""Sides of the prism around a cylinder or cone."""


def cover(shape: Convex, most: int = MOST, small: float = SMALL) -> Array:
    """Spheres ``(k, 4)`` (centre in the carrier's frame, radius) that cover the shape; k ≤ *most*.

    The shape's hull is cut in two, again and again, across the longest side of the part with the largest sphere; each
    part gets (nearly) the smallest sphere around its corners. The cover is conservative: it contains the whole shape.
    """
    if shape.kind == HULL and len(shape.points) == 1:
        return np.array([[*shape.pose[:3, 3], shape.radius]])
    known, key = shape.known, ("cover", most, small)
    if key not in known:
        points, edges, off = _outline(shape)
        enough = max(small, FINE * float(shape.half.min() - shape.radius))
        known[key] = _split(np.ascontiguousarray(points), edges, most, enough) + [0.0, 0.0, 0.0, off]
    balls: Array = known[key]
    centres = balls[:, :3] @ shape.pose[:3, :3].T + shape.pose[:3, 3]
    return np.column_stack([centres, balls[:, 3] + shape.radius])


class Covered(NamedTuple):
    """The spheres of something that moves."""

    balls: Array  # (k, 4)
    exactly: bool  # whether they are the shapes themselves
    around: Array  # (4,): a sphere that holds them all
    centre: Array  # (3,) and radius of a ball that nothing of it ever leaves
    radius: float


def covered(tree: TreeModel, carrier: int, shapes: Sequence[Geometry], small: float) -> Covered:
    """Spheres around *shapes* on joint *carrier* of a robot's *tree*.

    The ball that they never leave is about the first joint that moves them, as far as the links reach.
    """
    balls = np.concatenate([cover(shape, small=small) for shape in shapes if isinstance(shape, Convex)])
    exactly = all(shape.kind == HULL and len(shape.points) == 1 for shape in shapes)
    middle = 0.5 * ((balls[:, :3] - balls[:, 3:]).min(axis=0) + (balls[:, :3] + balls[:, 3:]).max(axis=0))
    reach = float((np.linalg.norm(balls[:, :3] - middle, axis=1) + balls[:, 3]).max()) * (1.0 + 1e-12)
    radius = float(np.linalg.norm(middle)) + reach
    while tree.kind[carrier] == 0 and tree.parent[carrier] >= 0:
        radius += float(np.linalg.norm(tree.place[carrier, 9:]))
        carrier = int(tree.parent[carrier])
    radius = radius * (1.0 + 1e-12) if tree.kind[carrier] == 0 else np.inf
    return Covered(balls, exactly, np.array([*middle, reach]), tree.place[carrier, 9:], radius)


def _split(points: Array, edges: IntArray, most: int, enough: float) -> Array:
    """Balls around the parts of a polytope that is cut until there are *most* or no ball is larger than *enough*."""
    parts, balls = [(points, edges)], np.empty((most, 4))
    kernels.ball_around(points, balls[0])
    while len(parts) < most:
        k = int(np.argmax(balls[: len(parts), 3]))
        points, edges = parts[k]
        low, high = points.min(axis=0), points.max(axis=0)
        axis = int(np.argmax(high - low))
        if balls[k, 3] <= enough or not low[axis] < high[axis]:
            break
        place, room = 0.5 * (low[axis] + high[axis]), len(points) + len(edges)
        number, order, angles = np.empty(len(points), np.int64), np.empty(room, np.int64), np.empty(room)
        halves = []
        for sign in (1.0, -1.0):
            out, sides = np.empty((room, 3)), np.empty((room + len(edges), 2), np.int64)
            count, m = kernels.half_of(points, edges, axis, place, sign, number, order, angles, out, sides)
            halves.append((out[:count], sides[:m]))
        kernels.ball_around(halves[0][0], balls[k])
        kernels.ball_around(halves[1][0], balls[len(parts)])
        parts[k] = halves[0]
        parts.append(halves[1])
    return balls[: len(parts)].copy()


def _outline(shape: Convex) -> tuple[Array, IntArray, float]:
    """Corners and edges of a polytope that contains the core, but for what sticks out of it by so much."""
    if shape.kind == HULL:
        return _corners(shape)
    if shape.kind in (CYLINDER, CONE):
        angle, k = np.arange(SIDES) * (2.0 * np.pi / SIDES), np.arange(SIDES)
        radius, height = shape.size[0] / np.cos(np.pi / SIDES), shape.size[1]
        ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(SIDES, -height)])
        around = np.stack([k, (k + 1) % SIDES], axis=1)
        if shape.kind == CONE:
            points = np.concatenate([ring, [[0.0, 0.0, height]]])
            return points, np.concatenate([around, np.stack([k, np.full(SIDES, SIDES)], axis=1)]), 0.0
        edges = np.concatenate([around, around + SIDES, np.stack([k, k + SIDES], axis=1)])
        return np.concatenate([ring, ring * [1.0, 1.0, -1.0]]), edges, 0.0
    half = shape.size if shape.kind == BOX else shape.half
    signs = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    edges = np.array([[i, i | bit] for bit in (1, 2, 4) for i in range(8) if not i & bit])
    return signs * half, edges, 0.0


def _corners(shape: Convex) -> tuple[Array, IntArray, float]:
    """The corners of a hull and its edges; what is flat becomes a polygon, or a segment, and what leaves its plane."""
    from scipy.spatial import ConvexHull, QhullError

    points = shape.points
    if len(shape.faces):
        last, j = shape.graph
        i = np.repeat(np.arange(len(last)), np.diff(last, prepend=0))
        return points, np.stack([i[i < j], j[i < j]], axis=1), 0.0
    middle = points.mean(axis=0)
    along = (points - middle) @ np.linalg.svd(points - middle, full_matrices=False)[2].T
    try:
        chosen = ConvexHull(along[:, :2]).vertices.astype(np.int64)
        off = float(np.abs(along[:, 2:]).max(initial=0.0))
    except (QhullError, ValueError):
        chosen = np.array([along[:, 0].argmin(), along[:, 0].argmax()])
        off = float(np.linalg.norm(along[:, 1:], axis=1).max(initial=0.0))
    k = np.arange(len(chosen) if len(chosen) > 2 else 1)
    off += float(np.abs(along[chosen, 2:]).max(initial=0.0)) if off else 0.0
    return points[chosen], np.stack([k, (k + 1) % len(chosen)], axis=1), 2.0 * off


def excess(balls: Array, shapes: tuple[Convex, ...], samples: int = 400) -> float:
    """Largest distance in m from a point on the outside of the spheres to the nearest of the *shapes*."""
    from .pairs import signed_distance

    i = np.arange(samples) + 0.5  # a spiral of even density
    z, turn = 1.0 - 2.0 * i / samples, np.pi * (1.0 + np.sqrt(5.0)) * i
    unit = np.column_stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z])
    points = (balls[:, None, :3] + balls[:, None, 3:] * unit).reshape(-1, 3)
    inside = (np.linalg.norm(points[:, None] - balls[None, :, :3], axis=2) < balls[None, :, 3] - 1e-9).any(axis=1)
    outer = points[~inside]
    places = np.tile(np.eye(4), (len(outer), 1, 1))
    places[:, :3, 3] = outer
    point = Convex.hull(np.zeros((1, 3)))
    nearest = [signed_distance(point, shape, places, np.eye(4)).distance for shape in shapes]
    return float(np.min(nearest, axis=0).max(initial=0.0))
