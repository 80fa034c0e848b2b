"""A mesh as a few convex hulls that contain it: cut by planes where that saves the most volume.

Each part of the surface goes, with the rim of the cut, into a hull of its own, so that the hulls together hold the
whole surface: nothing is ever called free that touches it. (A finer decomposition, for contact, is that of `bodies`.)
"""

from __future__ import annotations

import contextlib
import hashlib
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..arrays import Array, IntArray
from ..bodies.cache import cache_folder
from ..bodies.fit import extreme
from ..bodies.parts import cut
from ..files import replace_file

PARTS = 8
"""Most hulls for one mesh."""

WORTH = 0.03
"""Share of the first hull's volume that a cut must save."""

PLACES = (0.2, 0.35, 0.5, 0.65, 0.8)
"""Where cuts across the sides of the box around a part are tried."""


KEPT = 2000
"""Most meshes that the cache remembers; the oldest are forgotten first."""


class Part(NamedTuple):
    """A part of a surface: the triangles ``faces (F, 3)`` of ``points (V, 3)``."""

    points: Array
    faces: IntArray


def split(vertices: Array, faces: IntArray) -> tuple[Array, ...]:
    """Points of the hulls of the parts, ``(V, 3)`` each; from the cache where the same mesh was split before."""
    key = hashlib.sha256(f"4:{PARTS}:{WORTH}:{PLACES}".encode())
    key.update(np.ascontiguousarray(vertices).tobytes())
    key.update(np.ascontiguousarray(faces).tobytes())
    kept = cache_folder("parts") / f"{key.hexdigest()[:32]}.npz"
    try:
        with np.load(kept, allow_pickle=False) as data:
            return tuple(data[f"arr_{i}"] for i in range(len(data.files)))
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
        pass
    parts = tuple(_split(vertices, faces))
    with replace_file(kept) as work:
        np.savez(work, *parts)
    _forget(kept.parent)
    return parts


def _forget(folder: Path) -> None:
    """Remove the oldest files of *folder* beyond `KEPT`."""
    files = list(folder.glob("*.npz"))
    if len(files) > KEPT:
        with contextlib.suppress(OSError):  # another process forgets, too
            for file in sorted(files, key=lambda f: f.stat().st_mtime)[: len(files) - KEPT]:
                file.unlink()


def _split(vertices: Array, faces: IntArray) -> list[Array]:
    """The greedy cuts of a surface."""
    used, index = np.unique(faces, return_inverse=True)
    corners = vertices[used]
    turn = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)[2].T
    parts = [Part(corners @ turn, index.reshape(-1, 3))]
    whole = volume(parts[0].points)
    cuts = [best_cut(parts[0])]
    while len(parts) < PARTS:
        k = int(np.argmax([saved for saved, _, _ in cuts]))
        saved, axis, place = cuts[k]
        if saved < WORTH * whole:
            break
        parts[k : k + 1] = divided(parts[k], axis, place)
        cuts[k : k + 1] = [best_cut(part) for part in parts[k : k + 2]]
    return [np.unique(part.points, axis=0) @ turn.T for part in parts]


def divided(part: Part, axis: int, place: float) -> list[Part]:
    """The part below and above a plane across *axis*; triangles that it crosses are divided."""
    points, faces = part
    height = points[faces, axis] - place
    below, above = (height <= 0.0).all(axis=1), (height >= 0.0).all(axis=1)
    sides = []
    for whole, corners in zip((below, above), cut(points[faces[~below & ~above]], axis, place), strict=True):
        used, index = np.unique(faces[whole], return_inverse=True)
        new = np.arange(3 * len(corners)).reshape(-1, 3) + len(used)
        sides.append(
            Part(np.concatenate([points[used], corners.reshape(-1, 3)]), np.concatenate([index.reshape(-1, 3), new]))
        )
    return sides


def best_cut(part: Part) -> tuple[float, int, float]:
    """The cut across one axis that saves the most hull volume: how much, the axis, and where.

    The hull of what lies on one side of a plane is that of the slabs between the planes on that side, and of the rim
    of the cut; so each point is looked at but once per axis. Of slabs with many corners the farthest ones along
    directions all around speak for the others.
    """
    points, faces = part
    low, high = points.min(axis=0), points.max(axis=0)
    before = volume(points)
    best = (0.0, 0, 0.0)
    for axis in range(3):
        places = low[axis] + np.array(PLACES) * (high[axis] - low[axis])
        slab = np.searchsorted(places, points[:, axis])
        slabs = [extreme(corners_of(points[slab == k])) for k in range(len(places) + 1)]
        height = points[faces, axis]
        least, most = height.min(axis=1), height.max(axis=1)
        for k, place in enumerate(places.tolist()):
            crossed = (least < place) & (most > place)
            ends = cut(points[faces[crossed]], axis, place)[0].reshape(-1, 3)
            rim = corners_of(ends[ends[:, axis] == place], [a for a in range(3) if a != axis])
            sides = [np.concatenate([*some, rim]) for some in (slabs[: k + 1], slabs[k + 1 :])]
            saved = before - volume(sides[0]) - volume(sides[1])
            if saved > best[0]:
                best = (saved, axis, place)
    return best


def corners_of(points: Array, axes: Sequence[int] = (0, 1, 2)) -> Array:
    """The corners of the hull of *points*, seen along *axes*; of flat or few points, all of them."""
    from scipy.spatial import ConvexHull, QhullError

    if len(points) <= len(axes) + 1:
        return points
    try:
        return np.asarray(points[ConvexHull(points[:, axes]).vertices])
    except QhullError:
        return points


def volume(points: Array) -> float:
    """Volume of the convex hull of ``points (V, 3)``; 0 for flat sets."""
    from scipy.spatial import ConvexHull, QhullError

    if len(points) < 4:
        return 0.0
    try:
        return float(ConvexHull(points).volume)
    except QhullError:
        return 0.0
