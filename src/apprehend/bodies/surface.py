"""Points on a triangle mesh: even sampling, and normals that also faces without area have."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, IntArray


def unit_normals(triangles: Array) -> Array:
    """Unit normals ``(F, 3)`` of ``triangles (F, 3, 3)``; a degenerate one copies the sound one nearest to it."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normals, axis=1)
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    sound = length > 1e-10 * longest**2
    normals[sound] /= length[sound, None]
    if not sound.all():
        from scipy.spatial import cKDTree

        centres = triangles.mean(axis=1)
        _, nearest = cKDTree(centres[sound]).query(centres[~sound])
        normals[~sound] = normals[sound][nearest]
    return np.asarray(normals)


def sample(
    triangles: Array, areas: Array, normals: Array, n: int, rng: np.random.Generator
) -> tuple[Array, Array, IntArray]:
    """*n* points of uniform density over the area, their inward normals, and the faces they lie on.

    Within a face the point is (1 − √u) a + √u (1 − v) b + √u v c with u, v uniform in [0, 1).
    """
    cumulative = np.cumsum(areas)
    face = np.searchsorted(cumulative, rng.random(n) * cumulative[-1], side="right").astype(np.int64)
    face = np.minimum(face, len(areas) - 1)
    root, v = np.sqrt(rng.random(n)), rng.random(n)
    weights = np.stack([1.0 - root, root * (1.0 - v), root * v], axis=1)
    return np.einsum("ni,nij->nj", weights, triangles[face]), -normals[face], face
