"""Sections and silhouettes: a body cut by a plane, and its shadow on one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_shaped
from ..errors import InputError
from .index import MeshIndex
from .outline import Outline, cross_section
from .repair import as_manifold


def plane_frame(origin: ArrayLike, normal: ArrayLike, name: str = "normal") -> Array:
    """T_body_plane ``(4, 4)``: z along *normal*, y as far up (along z of the body, else y) as the plane allows."""
    z = as_shaped(normal, name, 3)
    length = float(np.linalg.norm(z))
    if length == 0.0:
        raise InputError(f"{name} is zero; give a direction")
    z = z / length
    up = np.array([0.0, 1.0, 0.0]) if abs(z[2]) > 0.999 else np.array([0.0, 0.0, 1.0])
    x = np.cross(up, z)
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), as_shaped(origin, "origin", 3)
    return T


def section(index: MeshIndex, origin: ArrayLike, normal: ArrayLike) -> Outline:
    """The section of a surface with the plane through *origin* ``(3,)`` with *normal* ``(3,)``: exact, seen from above.

    Corners in the plane count as above it, so that every line that is met is crossed.
    """
    T = plane_frame(origin, normal)
    height = (index.vertices - T[:3, 3]) @ T[:3, 2]
    above = height >= 0.0
    faces = index.faces[above[index.faces].any(axis=1) & ~above[index.faces].all(axis=1)]
    upper = above[faces]
    lonely_above = upper.sum(axis=1) == 1
    first = np.argmax(upper == lonely_above[:, None], axis=1)
    p, q, r = (np.take_along_axis(faces, ((first + k) % 3)[:, None], axis=1)[:, 0] for k in range(3))
    start = np.where(lonely_above[:, None], np.stack([p, q], axis=1), np.stack([p, r], axis=1))
    end = np.where(lonely_above[:, None], np.stack([p, r], axis=1), np.stack([p, q], axis=1))
    edges, number = np.unique(np.sort(np.concatenate([start, end]), axis=1), axis=0, return_inverse=True)
    a, b = edges[:, 0], edges[:, 1]
    t = height[a] / np.where(height[a] == height[b], 1.0, height[a] - height[b])
    points = index.vertices[a] + t[:, None] * (index.vertices[b] - index.vertices[a])
    flat = (points - T[:3, 3]) @ T[:3, :2]
    pairs = number.reshape(2, -1).T
    loops, lines = _chained(pairs)
    closed = tuple(kept for loop in loops if len(kept := _distinct(flat[loop])) >= 3)
    return Outline(closed, T, tuple(flat[line] for line in lines))


def _chained(pairs: IntArray) -> tuple[list[list[int]], list[list[int]]]:
    """Directed segments ``(S, 2)`` joined to closed loops and open lines of points."""
    onward: dict[int, list[int]] = {}
    entered: dict[int, int] = {}
    for a, b in pairs.tolist():
        onward.setdefault(a, []).append(b)
        entered[b] = entered.get(b, 0) + 1
    loops, lines = [], []
    starts = [a for a in onward for _ in range(len(onward[a]) - entered.get(a, 0))]
    for start in starts + list(onward):
        while onward.get(start):
            path = [start]
            while onward.get(path[-1]):
                path.append(onward[path[-1]].pop())
                if path[-1] == start:
                    break
            if path[-1] == start:
                loops.append(path[:-1])
            else:
                lines.append(path)
    return loops, lines


def _distinct(loop: Array) -> Array:
    """The polygon without corners that repeat the one before."""
    return np.asarray(loop[(loop != np.roll(loop, 1, axis=0)).any(axis=1)])


def silhouette(index: MeshIndex, direction: ArrayLike) -> Outline:
    """The shadow of a surface along *direction* ``(3,)`` on the plane through the origin, seen against it.

    Corners are rounded to 1e-8 of the body's size. Seen from the tip of *direction*, as with `section`.
    """
    import manifold3d

    T = plane_frame(np.zeros(3), direction, "direction")
    local = index.vertices @ T[:3, :3]
    centre, size = local.mean(axis=0), float(np.ptp(local, axis=0).max())
    unit = (local - centre) / size
    solid = as_manifold(unit, index.faces) if index.closed else None
    if solid is not None:
        polygons = solid.project().to_polygons()
        found = cross_section(polygons, manifold3d.FillRule.Positive)
    else:
        corners = unit[index.faces][:, :, :2]
        u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        turned = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        found = cross_section(list(corners[np.abs(turned) > 1e-16]), manifold3d.FillRule.NonZero)
        found = cross_section(found.to_polygons(), manifold3d.FillRule.Positive)
    loops = tuple(np.asarray(p, dtype=np.float64) * size + centre[:2] for p in found.to_polygons())
    return Outline(loops, T)
