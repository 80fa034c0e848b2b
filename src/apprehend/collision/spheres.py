"""Spheres that cover a shape: nothing of it sticks out, and how far they stick out is measured."""

from __future__ import annotations

import hashlib
import heapq
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..bodies.cache import cache_folder
from ..bodies.fit import ball
from ..files import replace_file
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
    known = shape.known
    if (most, small) not in known:
        known[most, small] = _cover(shape, most, small)
    balls = known[most, small]
    centres = balls[:, :3] @ shape.pose[:3, :3].T + shape.pose[:3, 3]
    return np.column_stack([centres, balls[:, 3] + shape.radius])


def _cover(shape: Convex, most: int, small: float) -> Array:
    points, edges = _outline(shape)
    key = hashlib.sha256(f"2:{most}:{small}:{FINE}:{len(edges)}".encode())
    key.update(points.tobytes())
    kept = cache_folder("spheres") / f"{key.hexdigest()[:32]}.npz"
    balls = _read(kept)
    if balls is None:
        balls = _split(points, edges, most, max(small, FINE * float(shape.half.min() - shape.radius)))
        with replace_file(kept) as work:
            np.savez(work, balls=balls)
    return balls


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


def _read(path: Path) -> Array | None:
    try:
        with np.load(path, allow_pickle=False) as data:
            balls: Array = data["balls"]
        return balls
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
        return None


def _outline(shape: Convex) -> tuple[Array, list[tuple[int, int]]]:
    """Points whose hull contains the core, and its edges (empty: every pair of points)."""
    if shape.kind == HULL:
        if not len(shape.faces):
            return shape.points, []
        ends, j = shape.graph
        i = np.repeat(np.arange(len(ends)), np.diff(ends, prepend=0))
        return shape.points, [(int(a), int(b)) for a, b in zip(i[i < j], j[i < j])]
    if shape.kind in (CYLINDER, CONE):
        angle = np.arange(SIDES) * (2.0 * np.pi / SIDES)
        radius, height = shape.size[0] / np.cos(np.pi / SIDES), shape.size[1]
        ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(SIDES, -height)])
        top = ring * [1.0, 1.0, -1.0] if shape.kind == CYLINDER else np.array([[0.0, 0.0, height]])
        return np.concatenate([ring, top]), []
    half = shape.size if shape.kind == BOX else shape.half
    return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half, []


def _split(points: Array, edges: list[tuple[int, int]], most: int, enough: float) -> Array:
    """Cut the hull of *points* until *most* parts or no sphere is larger than *enough*."""
    count = 0
    heap: list[tuple[float, int, Array, Array, list[tuple[int, int]]]] = []

    def push(part: Array, its_edges: list[tuple[int, int]]) -> None:
        nonlocal count
        centre, radius = ball(part)
        heapq.heappush(heap, (-radius, count, centre, part, its_edges))
        count += 1

    push(points, edges)
    while len(heap) < most and -heap[0][0] > enough:
        _, _, _, part, its_edges = heapq.heappop(heap)
        low, high = part.min(axis=0), part.max(axis=0)
        axis = int(np.argmax(high - low))
        middle = 0.5 * (low[axis] + high[axis])
        pairs = np.array(its_edges) if its_edges else np.array(np.triu_indices(len(part), 1)).T
        a, b = part[pairs[:, 0]], part[pairs[:, 1]]
        across = (a[:, axis] - middle) * (b[:, axis] - middle) < 0.0
        a, b = a[across], b[across]
        t = (middle - a[:, axis]) / (b[:, axis] - a[:, axis])
        section = a + t[:, None] * (b - a)
        section[:, axis] = middle
        for side in (part[part[:, axis] <= middle], part[part[:, axis] >= middle]):
            push(*_corners(np.concatenate([side, section])))
    return np.array([[*centre, -negative] for negative, _, centre, _, _ in heap])


def _corners(points: Array) -> tuple[Array, list[tuple[int, int]]]:
    """The corners of the hull of *points* and its edges; few or flat points stay as they are."""
    from scipy.spatial import ConvexHull, QhullError

    points = np.unique(points, axis=0)
    if len(points) <= 16:
        return points, []
    try:
        hull = ConvexHull(points)
    except QhullError:
        return _flat_corners(points), []
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    triangles = number[hull.simplices]
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    return points[hull.vertices], [(int(i), int(j)) for i, j in np.unique(sides, axis=0)]


def _flat_corners(points: Array) -> Array:
    """The corners of points in one plane, or the ends of points on one line."""
    from scipy.spatial import ConvexHull, QhullError

    along = (points - points.mean(axis=0)) @ np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    try:
        return np.asarray(points[ConvexHull(along[:, :2]).vertices])
    except QhullError:
        return np.asarray(points[[int(along[:, 0].argmin()), int(along[:, 0].argmax())]])


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
