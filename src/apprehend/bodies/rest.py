"""How a body comes to rest on a plane: the minima of its height, exactly, from its convex hull.

Let H(u) = max over the hull's vertices of (v − c)·u be the height of the centre of mass c above a table whose normal
points along −u. Its minima over the directions u are the facets that contain the foot of c: the poses at rest. Its
saddles are the edges that contain the foot of c, with that foot inside both neighbouring facets: the ways to tip from
one pose to another. The body falls from any other facet across the edge that the foot lies beyond (quasi-static, no
sliding, no inertia; Goldberg, Mirtich, Zhuang, Craig, Carlisle & Canny 1999, *Part pose statistics*), so a pose has
the probability of the solid angles, seen from c, of all facets that end in it.

Minima that are separated by a lower rise than a given roughness are one pose: a scanned or faceted round side would
otherwise be hundreds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, IntArray
from .repair import solid_angles

COPLANAR = 1e-9
"""Neighbouring hull triangles are one facet if their planes differ by less than this (relative to the radius)."""


@dataclass(frozen=True, eq=False)
class RestPose:
    """A pose at rest on the plane z = 0."""

    pose: Array
    """``(4, 4)`` T_plane_body; the centre of mass is above the plane's origin, the lowest point at z = 0."""
    probability: float
    """Chance to end here after a drop from a random orientation, quasi-statically."""
    tip_angle: float
    """Smallest rotation that makes it fall into another pose, in rad."""
    tip_rise: float
    """How far the centre of mass must rise for that, in m; times m g it is the energy."""
    com_height: float
    """Height of the centre of mass above the plane, in m."""

    @property
    def up(self) -> Array:
        """The direction in the body that points up, ``(3,)``."""
        return np.array(self.pose[2, :3])


@dataclass(frozen=True, eq=False)
class _Facets:
    """Facets of the hull about the centre of mass, and their edges."""

    points: Array  # (P, 3) relative to the centre of mass
    normals: Array  # (K, 3) outward
    heights: Array  # (K,)
    weights: Array  # (K,) share of the solid angle
    edges: IntArray  # (E, 4): facet a, facet b, point p, point q


def stable_poses(vertices: Array, com: Array, roughness: float) -> list[RestPose]:
    """All resting poses of the hull of *vertices*, the likeliest first; see the module."""
    facets = _facets(vertices - com)
    feet = _feet(facets)
    sink = _sinks(facets, *feet[:2])
    return _poses(facets, com, *_merged(facets, feet, sink, roughness))


def _facets(points: Array) -> _Facets:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import ConvexHull

    scale = float(np.abs(points).max())
    hull = ConvexHull(points)
    triangles = hull.simplices.astype(np.int64)
    normals, heights = hull.equations[:, :3], -hull.equations[:, 3]
    n = len(triangles)
    one = np.repeat(np.arange(n), 3)
    two = hull.neighbors.reshape(-1).astype(np.int64)
    level = (np.abs(normals[one] - normals[two]).max(axis=1) < COPLANAR) & (
        np.abs(heights[one] - heights[two]) < COPLANAR * scale
    )
    graph = coo_array((np.ones(level.sum(), dtype=np.int8), (one[level], two[level])), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    weights = np.bincount(label, np.abs(solid_angles(points[triangles])), count)
    # neighbour k of a triangle lies opposite its corner k
    ends = np.stack([triangles[:, [1, 2]], triangles[:, [2, 0]], triangles[:, [0, 1]]], axis=1).reshape(-1, 2)
    border = (label[one] != label[two]) & (one < two)
    edges = np.column_stack([label[one[border]], label[two[border]], ends[border]]).astype(np.int64)
    return _Facets(points, normals[first], heights[first], weights / weights.sum(), edges)


def _feet(facets: _Facets) -> tuple[Array, Array, Array, Array]:
    """Per edge: how far the foot of c on facet a, and on b, lies beyond it (outward positive), the height over the
    edge, and the direction (E, 3) of the foot on the edge; height −1 where the edge is no saddle.
    """
    a, b, p, q = facets.edges.T
    start, along = facets.points[p], facets.points[q] - facets.points[p]
    length = np.linalg.norm(along, axis=1)
    along = along / length[:, None]
    beyond = []
    for side, other in ((a, b), (b, a)):
        outward = np.cross(along, facets.normals[side])
        outward *= np.sign(np.einsum("ij,ij->i", outward, facets.normals[other]))[:, None]
        beyond.append(-np.einsum("ij,ij->i", start, outward))
    t = -np.einsum("ij,ij->i", start, along)
    foot = start + t[:, None] * along
    height = np.linalg.norm(foot, axis=1)
    saddle = (beyond[0] <= 0.0) & (beyond[1] <= 0.0) & (t >= 0.0) & (t <= length)
    return beyond[0], beyond[1], np.where(saddle, height, -1.0), foot


def _sinks(facets: _Facets, beyond_a: Array, beyond_b: Array) -> IntArray:
    """The facet at rest in which the fall from each facet ends."""
    a, b = facets.edges[:, 0], facets.edges[:, 1]
    source, target = np.r_[a, b], np.r_[b, a]
    excess = np.r_[beyond_a, beyond_b]
    tolerance = 1e-12 * float(facets.heights.max())
    order = np.argsort(excess, kind="stable")  # the largest excess is written last
    order = order[excess[order] > tolerance]
    following = np.arange(len(facets.heights))
    following[source[order]] = target[order]
    # falling lowers the centre of mass; where rounding hides it, the facet counts as at rest
    uphill = facets.heights[following] > facets.heights
    following[uphill] = np.flatnonzero(uphill)
    same = facets.heights[following] == facets.heights
    following[same] = np.minimum(following[same], np.flatnonzero(same))
    while True:
        further = following[following]
        if np.array_equal(further, following):
            return following
        following = further


def _merged(
    facets: _Facets, feet: tuple[Array, Array, Array, Array], sink: IntArray, roughness: float
) -> tuple[IntArray, list[tuple[int, int, float, int]]]:
    """Basins joined across saddles that rise less than *roughness* above the shallower one (0-dim. persistence).

    Returns the basin of each facet, named by its lowest facet, and the saddles that are left:
    ``(basin, basin, height, edge)``, lowest first.
    """
    heights, saddles = facets.heights, feet[2]
    root = {int(f): int(f) for f in np.unique(sink)}

    def find(f: int) -> int:
        while root[f] != f:
            root[f] = root[root[f]]
            f = root[f]
        return f

    candidates = np.flatnonzero(saddles >= 0.0)
    candidates = candidates[np.argsort(saddles[candidates], kind="stable")]
    ends = [
        (int(sink[facets.edges[e, 0]]), int(sink[facets.edges[e, 1]]), float(saddles[e]), int(e)) for e in candidates
    ]
    for a, b, height, _ in ends:
        low, high = sorted((find(a), find(b)), key=lambda f: (heights[f], f))
        if low != high and height - heights[high] < roughness:
            root[high] = low
    left = [(find(a), find(b), height, e) for a, b, height, e in ends if find(a) != find(b)]
    return np.array([find(int(f)) for f in sink]), left


def _poses(facets: _Facets, com: Array, basin: IntArray, left: list[tuple[int, int, float, int]]) -> list[RestPose]:
    escape: dict[int, tuple[float, int]] = {}
    for a, b, height, edge in left:
        escape.setdefault(a, (height, edge))
        escape.setdefault(b, (height, edge))
    poses = []
    for f in np.unique(basin).tolist():
        height = float(facets.heights[f])
        if f in escape:
            rise = max(escape[f][0] - height, 0.0)
            angle = float(np.arccos(np.clip(height / escape[f][0], -1.0, 1.0)))
        else:  # a single basin: it always comes back
            rise, angle = float(np.linalg.norm(facets.points, axis=1).max()) - height, float(np.pi)
        T = np.eye(4)
        T[:3, :3] = _turn_down(facets.normals[f])
        T[:3, 3] = -T[:3, :3] @ com
        T[2, 3] -= float((facets.points @ T[2, :3]).min())
        probability = float(facets.weights[basin == f].sum())
        poses.append(RestPose(T, probability, angle, rise, height))
    return sorted(poses, key=lambda p: -p.probability)


def _turn_down(direction: Array) -> Array:
    """A rotation that maps the unit vector *direction* to −z: the shortest one, or for a vector that points up the
    shortest to +z and half a turn about x, so that nothing is divided by a small number."""
    x, y, z = direction / np.linalg.norm(direction)
    up = z > 0.0
    axis = np.array([y, -x, 0.0]) if up else np.array([-y, x, 0.0])  # direction × ±z
    K = np.array([[0.0, 0.0, axis[1]], [0.0, 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    R = np.eye(3) + K + K @ K / (1.0 + abs(z))
    return np.asarray(np.diag([1.0, -1.0, -1.0]) @ R if up else R)
