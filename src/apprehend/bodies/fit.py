"""The smallest ball, box and capsule around points: none leaves a point out, each is nearly the smallest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Array

GROWN = 1e-9
"""Share by which a fitted shape is enlarged, so that rounding leaves no point out."""

NORMALS = 60
"""Directions of hull faces, the largest ones first, along which a side of the box is tried."""


PROBES = 300
"""Points from which orientations are chosen; sizes are fitted to all points."""


class Ball(NamedTuple):
    """Centre ``(3,)`` (or ``(2,)``) and radius."""

    centre: Array
    radius: float


class Block(NamedTuple):
    """Pose ``(4, 4)`` of the centre and full extents ``(3,)`` of a box."""

    pose: Array
    size: Array


class Capsule(NamedTuple):
    """The two ends ``(2, 3)`` of the segment, and the radius."""

    ends: Array
    radius: float


def hull_points(points: Array) -> Array:
    """The corners of the convex hull; of flat or few points, what there is of them."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):  # flat, or too few
        return np.unique(points, axis=0)


def extreme(points: Array) -> Array:
    """At most `PROBES` of *points* ``(V, 3)``: the farthest ones along directions all around."""
    if len(points) <= PROBES:
        return points
    i = np.arange(PROBES) + 0.5  # a spiral of even density
    z, turn = 1.0 - 2.0 * i / PROBES, np.pi * (1.0 + np.sqrt(5.0)) * i
    directions = np.stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z])
    return np.asarray(points[np.unique(np.argmax(points @ directions, axis=0))])


def ball(points: Array) -> Ball:
    """A ball around ``points (V, d)``: the smallest but for about 1 % (Bădoiu & Clarkson 2003)."""
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    best, radius = centre, np.inf
    columns = np.ascontiguousarray(points.T)
    for i in range(1, 100):
        squared = np.zeros(len(points))
        for column, middle in zip(columns, centre):
            squared += (column - middle) ** 2
        far = int(np.argmax(squared))
        if squared[far] < radius * radius:
            best, radius = centre, float(np.sqrt(squared[far]))
        centre = centre + (points[far] - centre) / (i + 1.0)
    return Ball(best, radius * (1.0 + GROWN) + 1e-12)


def aligned_block(points: Array) -> Block:
    """The box around *points* along the axes."""
    return _block(points, np.eye(3))


def block(points: Array) -> Block:
    """The smallest box found around *points* ``(V, 3)`` in any orientation.

    One side lies in turn along each of the large faces of the hull, its edges as the smallest rectangle around the
    projection demands (rotating calipers); the best box then tries its other sides. The smallest box of all need not
    have a side along a face (O'Rourke 1985), but is rarely much smaller.
    """
    from scipy.spatial import ConvexHull, QhullError

    spread = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    candidates = [np.eye(3)[k] for k in range(3)] + [spread[k] for k in range(len(spread))]
    try:
        hull = ConvexHull(points)
        corners = points[hull.simplices]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        rounded, inverse = np.unique(np.round(hull.equations[:, :3], 2), axis=0, return_inverse=True)
        weight = np.bincount(inverse.reshape(-1), area, len(rounded))
        first = np.zeros(len(rounded), dtype=np.int64)
        first[inverse.reshape(-1)[np.argsort(area)]] = np.argsort(area)  # the largest face of each direction
        candidates += list(hull.equations[first[np.argsort(-weight)[:NORMALS]], :3])
        points = points[hull.vertices]
    except QhullError:
        pass
    probes = extreme(points)
    best = _block(probes, np.eye(3))
    for normal in candidates:
        best = min(best, _block(probes, _turned(probes, normal)), key=_size)
    for _ in range(2):
        for axis in best.pose[:3, :3].T:
            best = min(best, _block(probes, _turned(probes, axis)), key=_size)
    return min(_block(points, best.pose[:3, :3]), _block(points, np.eye(3)), key=_size)


def _size(box: Block) -> float:
    """Volume, and half the surface where flat boxes have none."""
    a, b, c = box.size
    return float(a * b * c + 1e-9 * (a * b + b * c + c * a))


def _block(points: Array, axes: Array) -> Block:
    """The box with sides along the columns of *axes* ``(3, 3)``."""
    local = points @ axes
    low, high = local.min(axis=0), local.max(axis=0)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = axes, axes @ (0.5 * (low + high))
    return Block(pose, (high - low) * (1.0 + GROWN) + 1e-12)


def _turned(points: Array, normal: Array) -> Array:
    """Axes with z along *normal* and x along a side of the smallest rectangle around the projected *points*."""
    z = normal / np.linalg.norm(normal)
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    direction = rectangle_side(points @ np.stack([x, y], axis=1))
    u = direction[0] * x + direction[1] * y
    return np.stack([u, np.cross(z, u), z], axis=1)


def rectangle_side(points: Array) -> Array:
    """Direction ``(2,)`` of a side of the smallest rectangle around ``points (V, 2)``: one side is an edge's."""
    corners = flat_hull(points)
    edges = np.roll(corners, -1, axis=0) - corners
    length = np.linalg.norm(edges, axis=1)
    edges = edges[length > 0.0] / length[length > 0.0, None]
    if not len(edges):
        return np.array([1.0, 0.0])
    along = corners @ edges.T
    across = corners @ np.stack([-edges[:, 1], edges[:, 0]])
    return np.asarray(edges[int(np.argmin(np.ptp(along, axis=0) * np.ptp(across, axis=0)))])


def flat_hull(points: Array) -> Array:
    """Corners of the convex hull of ``points (V, 2)`` in order (Andrew's monotone chain for what Qhull refuses)."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):  # on a line, or fewer than three
        order = np.lexsort(points.T[::-1])
        return np.asarray(points[order[[0, -1]]])


def capsule(points: Array) -> Capsule:
    """A capsule around *points* ``(V, 3)``, small in volume.

    For a direction of the axis, the smallest circle around the projection places it, and the ends follow: they must
    reach z − √(r² − ρ²) for each point at height z and distance ρ. The direction starts at those of the smallest box
    and is improved by the downhill simplex method.
    """
    from scipy.optimize import minimize

    points = hull_points(points)
    probes = extreme(points)
    axes = block(points).pose[:3, :3]
    starts = [(around_axis(probes, axes[:, k]), axes[:, k]) for k in range(3)]
    _, axis = min(starts, key=lambda s: capsule_volume(s[0]))
    x, y = (v for v in axes.T if v is not axis and abs(float(v @ axis)) < 0.5)

    def volume(turn: Array) -> float:
        return capsule_volume(around_axis(probes, axis + turn[0] * x + turn[1] * y))

    found = minimize(
        volume,
        np.zeros(2),
        method="Nelder-Mead",
        options={"maxfev": 60, "initial_simplex": [[0.0, 0.0], [0.08, 0.0], [0.0, 0.08]], "xatol": 1e-3},
    )
    better = around_axis(points, axis + found.x[0] * x + found.x[1] * y)
    return min(around_axis(points, axis), better, key=capsule_volume)


def around_axis(points: Array, axis: Array) -> Capsule:
    """The capsule around *points* whose segment runs along *axis*."""
    z = axis / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    flat, height = points @ np.stack([x, y], axis=1), points @ z
    centre, radius = ball(flat)
    room = np.sqrt(np.maximum(radius**2 - ((flat - centre) ** 2).sum(axis=1), 0.0))
    low, high = float((height + room).min()), float((height - room).max())
    if low > high:  # one ball holds them all
        low = high = 0.5 * (low + high)
        radius = float(np.sqrt(((flat - centre) ** 2).sum(axis=1) + (height - low) ** 2).max()) * (1.0 + GROWN)
    foot = centre[0] * x + centre[1] * y
    return Capsule(np.stack([foot + low * z, foot + high * z]), radius * (1.0 + GROWN) + 1e-12)


def capsule_volume(shape: Capsule) -> float:
    """Volume in m³."""
    length = float(np.linalg.norm(shape.ends[1] - shape.ends[0]))
    return float(np.pi * shape.radius**2 * (length + 4.0 / 3.0 * shape.radius))
