"""What stands on the table: points of depth images above a plane, in connected groups."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..errors import InputError
from .camera import DepthImage

CONNECT = 0.012  # m between neighbouring points of one object


@dataclass(frozen=True)
class Plane:
    """The points with ``normal · p = offset``; *normal* (3,) is a unit vector that points to the free side."""

    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    offset: float = 0.0

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.normal))
        if not (np.isfinite(self.offset) and abs(length - 1.0) < 1e-6):
            raise InputError(
                f"a plane has normal {self.normal} and offset {self.offset}; the normal must have length 1"
            )

    def height(self, points: Array) -> Array:
        """Signed heights (...) of points (..., 3) above the plane, in m."""
        return np.asarray(points @ np.array(self.normal) - self.offset)


@dataclass(frozen=True, eq=False)
class Group:
    """Points (N, 3) of one object in the world, where each was seen from, and the pixels of each view that show it."""

    points: Array
    eyes: Array  # (N, 3)
    masks: tuple[BoolArray, ...]

    def sample(self, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """At most *count* of the points, and unit vectors from them to where they were seen from."""
        pick = slice(None) if len(self.points) <= count else np.sort(rng.choice(len(self.points), count, replace=False))
        points = self.points[pick]
        toward = self.eyes[pick] - points
        return points, toward / np.linalg.norm(toward, axis=1, keepdims=True)


def groups_above(views: Sequence[DepthImage], plane: Plane, clearance: float, region: Array | None) -> list[Group]:
    """Connected groups of points higher than *clearance* above the plane, the largest first.

    *region* (2, 3): only points between its rows, lower and upper corner in the world, count.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    clouds, eyes, masks = [], [], []
    for view in views:
        points = view.points()
        keep = view.valid & (plane.height(points) > clearance)
        if region is not None:
            keep &= ((points >= region[0]) & (points <= region[1])).all(axis=-1)
        clouds.append(points[keep])
        eyes.append(np.tile(view.pose[:3, 3], (int(keep.sum()), 1)))
        masks.append(keep)
    cloud, eye = np.concatenate(clouds), np.concatenate(eyes)
    if not len(cloud):
        return []
    cells, inverse = np.unique(np.floor(cloud / CONNECT).astype(np.int64), axis=0, return_inverse=True)
    inverse = inverse.ravel()
    pairs = _neighbours(cells)
    n = len(cells)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    label = connected_components(graph, directed=False)[1][inverse]
    sizes = np.bincount(label)
    starts = np.cumsum([0, *(len(c) for c in clouds)])
    out = []
    for k in np.argsort(-sizes, kind="stable"):
        mine = label == k
        own = []
        for i, mask in enumerate(masks):
            part = np.zeros_like(mask)
            part[mask] = mine[starts[i] : starts[i + 1]]
            own.append(part)
        out.append(Group(cloud[mine], eye[mine], tuple(own)))
    return out


def _neighbours(cells: IntArray) -> IntArray:
    """Pairs of occupied cells that touch at a face, an edge or a corner."""
    from scipy.spatial import cKDTree

    pairs = cKDTree(cells.astype(np.float64)).query_pairs(1.8, output_type="ndarray")
    return np.asarray(pairs, dtype=np.int64)
