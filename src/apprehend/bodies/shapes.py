"""Closed triangle meshes of simple solids: boxes, surfaces of revolution, sweeps along a curve."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray
from ..errors import InputError

Mesh = tuple[Array, IntArray]

SIDES = 64
"""Sides of a round solid."""


def box(size: ArrayLike) -> Mesh:
    """A box of full extents *size* (3,), centred at the origin."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return corners * np.asarray(size, dtype=np.float64), np.array(faces, dtype=np.int64)


def cylinder(radius: float, height: float, sides: int = SIDES) -> Mesh:
    """A cylinder along z, centred at the origin."""
    h = 0.5 * height
    return revolve([(0.0, -h), (radius, -h), (radius, h), (0.0, h)], sides)


def sphere(radius: float) -> Mesh:
    """A sphere about the origin as an icosphere of 1280 faces."""
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)


def revolve(profile: ArrayLike, sides: int = SIDES) -> Mesh:
    """The solid of revolution about z of a *profile* ``(n, 2)`` of (radius, z), from the axis at the bottom around
    the outside to the axis at the top; a profile that turns inwards makes a hollow.
    """
    points = np.asarray(profile, dtype=np.float64)
    if len(points) < 3 or points[0, 0] != 0.0 or points[-1, 0] != 0.0 or (points[1:-1, 0] <= 0.0).any():
        raise InputError("profile must start and end on the axis (radius 0) and have positive radii between")
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings = np.concatenate([np.column_stack([r * ring, np.full(sides, z)]) for r, z in points[1:-1]])
    vertices = np.vstack([rings, [0.0, 0.0, points[0, 1]], [0.0, 0.0, points[-1, 1]]])
    bottom, top = len(rings), len(rings) + 1
    return vertices, _tube_faces(len(points) - 2, sides, bottom, top)


def sweep(curve: ArrayLike, section: ArrayLike, scale: ArrayLike, across: Array) -> Mesh:
    """A closed rod: the planar *section* ``(m, 2)``, counter-clockwise, carried along the *curve* ``(n, 3)``.

    The section's frame starts with its first axis along *across* ``(3,)`` and is carried without twist (double
    reflection, Wang et al. 2008); *scale* ``(n,)`` or ``(n, 2)`` sizes it.
    """
    points, flat = np.asarray(curve, dtype=np.float64), np.asarray(section, dtype=np.float64)
    n, m = len(points), len(flat)
    factors = np.asarray(scale, dtype=np.float64)
    sizes = np.broadcast_to(factors[:, None] if factors.ndim == 1 else factors, (n, 2))
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    u = across - (across @ tangent[0]) * tangent[0]
    u /= np.linalg.norm(u)
    rings = []
    for i in range(n):
        if i:
            step = points[i] - points[i - 1]
            mirrored = u - 2.0 * (step @ u) / (step @ step) * step
            ahead = tangent[i - 1] - 2.0 * (step @ tangent[i - 1]) / (step @ step) * step
            turn = tangent[i] - ahead
            u = mirrored - 2.0 * (turn @ mirrored) / max(turn @ turn, 1e-300) * turn
        v = np.cross(tangent[i], u)
        local = flat * sizes[i]
        rings.append(points[i] + local[:, :1] * u + local[:, 1:] * v)
    vertices = np.vstack([*rings, points[0], points[-1]])
    return vertices, _tube_faces(n, m, n * m, n * m + 1)


def circle(radius: float, sides: int = 24) -> Array:
    """A circular section for `sweep`."""
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _tube_faces(rings: int, sides: int, start: int, end: int) -> IntArray:
    """Faces of *rings* consecutive rings of *sides* vertices, closed by fans to the vertices *start* and *end*."""
    i = np.arange(sides)
    j = (i + 1) % sides
    faces = [np.stack([np.full(sides, start), j, i], axis=1)]
    for k in range(rings - 1):
        a, b, c, d = k * sides + i, k * sides + j, (k + 1) * sides + i, (k + 1) * sides + j
        faces += [np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)]
    last = (rings - 1) * sides
    faces.append(np.stack([np.full(sides, end), last + i, last + j], axis=1))
    return np.concatenate(faces).astype(np.int64)
