"""Small meshes that explain: friction cones, arrows, tubes along a path."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray
from ..bodies import shapes

Mesh = tuple[Array, IntArray]


def along(direction: ArrayLike, at: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """A pose ``(4, 4)`` at a point whose z axis runs along *direction*."""
    z = np.asarray(direction, dtype=np.float64)
    z = z / np.linalg.norm(z)
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    T[:3, 3] = at
    return T


def friction_cone(point: ArrayLike, normal: ArrayLike, friction: float, length: float) -> Mesh:
    """The cone of the forces that a finger can pass on at *point*, drawn on the finger's side of the surface.

    Its tip is the contact, its axis the inward *normal* reversed, its half angle arctan µ (G 2.1.1).
    """
    radius = length * math.tan(min(math.atan(friction), math.radians(80.0)))
    mesh = shapes.revolve([(0.0, 0.0), (max(radius, 1e-4), length), (0.0, length)], 32)
    return placed(mesh, along(-np.asarray(normal, dtype=np.float64), point))


def ball(at: ArrayLike, radius: float) -> Mesh:
    """A small ball at a point."""
    vertices, faces = shapes.sphere(radius)
    return vertices + np.asarray(at, dtype=np.float64), faces


def arrow(start: ArrayLike, vector: ArrayLike, radius: float) -> Mesh:
    """An arrow from *start* along *vector*."""
    length = float(np.linalg.norm(np.asarray(vector, dtype=np.float64)))
    head = min(6.0 * radius, 0.5 * length)
    profile = [(0.0, 0.0), (radius, 0.0), (radius, length - head), (2.4 * radius, length - head), (0.0, length)]
    return placed(shapes.revolve(profile, 20), along(vector, start))


def tube(points: Array, radius: float) -> Mesh | None:
    """A round line through *points* ``(n, 3)``; None if they are all at one place."""
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    keep = np.r_[True, np.cumsum(step) > 0.0]
    spaced = [points[0]]
    for p in points[keep]:
        if np.linalg.norm(p - spaced[-1]) >= 2.0 * radius:
            spaced.append(p)
    if len(spaced) < 2:
        return None
    curve = np.array(spaced)
    start = curve[1] - curve[0]
    across = np.eye(3)[int(np.abs(start).argmin())]
    return shapes.sweep(curve, shapes.circle(radius, 10), 1.0, across)


def placed(mesh: Mesh, T: Array) -> Mesh:
    """The mesh moved by ``T (4, 4)``."""
    return np.asarray(mesh[0] @ T[:3, :3].T + T[:3, 3]), mesh[1]
