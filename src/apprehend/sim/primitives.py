"""Convex pieces that are round: a sphere or a cylinder that was cut into triangles rolls on its true surface.

On the facets of its mesh a ball rocks from triangle to triangle, and gains and loses height that the real ball does
not. A piece whose corners all lie on one sphere, or on the rims of one cylinder, and that fills it, is simulated as
that sphere or cylinder.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array

TOLERANCE = 2e-3  # largest deviation of a corner, in radii
FULLNESS = 0.96  # least share of the round volume that the piece fills
CORNERS = 12  # fewest corners on a rim that count as round


@dataclass(frozen=True, eq=False)
class Round:
    """A sphere (*height* zero) or a cylinder about the z axis of *pose* (4, 4), in the frame of the piece."""

    pose: Array
    radius: float
    height: float = 0.0


def as_round(vertices: Array, volume: float) -> Round | None:
    """The sphere or cylinder that the convex piece with these corners stands for, or None."""
    return _sphere(vertices, volume) or _cylinder(vertices, volume)


def _sphere(vertices: Array, volume: float) -> Round | None:
    if len(vertices) < CORNERS**2 // 2:
        return None
    system = np.column_stack([2.0 * vertices, np.ones(len(vertices))])
    solution, _, rank, _ = np.linalg.lstsq(system, (vertices**2).sum(axis=1), rcond=None)
    if rank < 4:
        return None
    centre = solution[:3]
    distance = np.linalg.norm(vertices - centre, axis=1)
    radius = float(distance.mean())
    if np.abs(distance - radius).max() > TOLERANCE * radius or volume < FULLNESS * 4.0 / 3.0 * np.pi * radius**3:
        return None
    pose = np.eye(4)
    pose[:3, 3] = centre
    return Round(pose, radius)


def _cylinder(vertices: Array, volume: float) -> Round | None:
    if len(vertices) < 2 * CORNERS:
        return None
    middle = vertices.mean(axis=0)
    _, _, axes = np.linalg.svd(vertices - middle, full_matrices=False)
    for axis in np.concatenate([np.eye(3), axes]):
        along = (vertices - middle) @ axis
        top, bottom = along.max(), along.min()
        height = float(top - bottom)
        on_rim = [np.abs(along - end) < TOLERANCE * height for end in (bottom, top)]
        if not (on_rim[0] | on_rim[1]).all() or min(rim.sum() for rim in on_rim) < CORNERS:
            continue
        across = vertices - middle - along[:, None] * axis
        centre = 0.5 * (across.max(axis=0) + across.min(axis=0))
        distance = np.linalg.norm(across - centre, axis=1)
        radius = float(distance.max())
        outer = distance > 0.5 * radius  # the middle of a cap may carry a corner too
        if outer.sum() < 2 * CORNERS or np.abs(distance[outer] - radius).max() > TOLERANCE * radius:
            continue
        if volume < FULLNESS * np.pi * radius**2 * height:
            continue
        pose = np.eye(4)
        pose[:3, :3] = _frame(axis)
        pose[:3, 3] = middle + centre + axis * 0.5 * (top + bottom)
        return Round(pose, radius, height)
    return None


def _frame(z: Array) -> Array:
    """A rotation whose third column is *z*."""
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
