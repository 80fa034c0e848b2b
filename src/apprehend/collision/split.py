"""A mesh as a few convex hulls that contain it: cut by planes where that saves the most volume.

Each part of the surface goes, with the rim of the cut, into a hull of its own, so that the hulls together hold the
whole surface: nothing is ever called free that touches it. (A finer decomposition, for contact, is that of `bodies`.)
"""

from __future__ import annotations

import hashlib
import zipfile

import numpy as np

from ..arrays import Array, IntArray
from ..bodies.cache import cache_folder
from ..bodies.parts import cut
from ..files import replace_file

PARTS = 8
"""Most hulls for one mesh."""

WORTH = 0.03
"""Share of the first hull's volume that a cut must save."""

PLACES = (0.2, 0.35, 0.5, 0.65, 0.8)
"""Where cuts across the sides of the box around a part are tried."""


def split(vertices: Array, faces: IntArray) -> tuple[Array, ...]:
    """Points of the hulls of the parts, ``(V, 3)`` each; from the cache where the same mesh was split before."""
    key = hashlib.sha256(f"3:{PARTS}:{WORTH}:{PLACES}".encode())
    key.update(np.ascontiguousarray(vertices).tobytes())
    key.update(np.ascontiguousarray(faces).tobytes())
    kept = cache_folder("parts") / f"{key.hexdigest()[:32]}.npz"
    try:
        with np.load(kept, allow_pickle=False) as data:
            return tuple(data[f"arr_{i}"] for i in range(len(data.files)))
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
        pass
    parts = tuple(_split(vertices[faces]))
    with replace_file(kept) as work:
        np.savez(work, *parts)
    return parts


def _split(triangles: Array) -> list[Array]:
    """The greedy cuts of a surface of triangles ``(F, 3, 3)``."""
    points = triangles.reshape(-1, 3)
    turn = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    parts = [triangles @ turn]
    whole = volume(parts[0])
    cuts = [best_cut(parts[0])]
    while len(parts) < PARTS:
        k = int(np.argmax([saved for saved, _, _ in cuts]))
        saved, low, high = cuts[k]
        if saved < WORTH * whole:
            break
        parts[k : k + 1] = [low, high]
        cuts[k : k + 1] = [best_cut(low), best_cut(high)]
    return [np.unique(part.reshape(-1, 3), axis=0) @ turn.T for part in parts]


def best_cut(triangles: Array) -> tuple[float, Array, Array]:
    """The cut across one axis that saves the most hull volume: how much, and the two parts."""
    points = triangles.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    before = volume(triangles)
    best = (0.0, triangles, triangles)
    for axis in range(3):
        for place in PLACES:
            sides = cut(triangles, axis, low[axis] + place * (high[axis] - low[axis]))
            if min(map(len, sides)) == 0:
                continue
            saved = before - volume(sides[0]) - volume(sides[1])
            if saved > best[0]:
                best = (saved, *sides)
    return best


def volume(triangles: Array) -> float:
    """Volume of the convex hull; 0 for flat parts."""
    from scipy.spatial import ConvexHull, QhullError

    points = np.unique(triangles.reshape(-1, 3), axis=0)
    if len(points) < 4:
        return 0.0
    try:
        return float(ConvexHull(points).volume)
    except QhullError:
        return 0.0
