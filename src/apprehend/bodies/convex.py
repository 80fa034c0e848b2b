"""Convex pieces of a body, for contact and collision: approximate convex decomposition (CoACD), kept on disk.

The mesh is reduced first, since a scan has far more triangles than the decomposition needs; how far the pieces' outer
surface is from the body's surface is then measured on the full mesh, so the stated error covers every step.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Array, IntArray
from ..files import replace_file
from . import topology
from .cache import cache_folder
from .mass import solid
from .surface import sample, unit_normals

Piece = tuple[Array, IntArray]
"""Vertices ``(V, 3)`` and faces ``(F, 3)`` of one convex polyhedron, wound outwards."""

CONCAVITY = 0.003
"""Concavity in m that a piece may keep, before `FINEST` and `COARSEST` bound it."""
FINEST, COARSEST = 0.02, 0.08
"""Bounds of the concavity relative to half of the body's largest extent, CoACD's own unit."""
MANY = 16
"""A body that needs more pieces than this at the coarsest setting is left at it."""
REDUCED_FACES = 1200
"""Triangles that are kept for the decomposition."""
PIECE_VERTICES = 128
"""About the most vertices that a piece has."""
CONVEX_FILL = 0.97
"""A closed body that fills this share of its hull, and lies within `CONCAVITY` of it, is its own convex piece."""
SAMPLES = 4000
"""Points on either surface at which the error is measured."""
_RECIPE = f"1:{CONCAVITY}:{FINEST}:{COARSEST}:{REDUCED_FACES}:{PIECE_VERTICES}:{CONVEX_FILL}:{MANY}"


@dataclass(frozen=True, eq=False)
class ConvexParts:
    """The pieces, and the largest distance found between their outer surface and the body's, in m."""

    pieces: tuple[Piece, ...]
    error: float


def decompose(vertices: Array, faces: IntArray, closed: bool) -> ConvexParts:
    """Convex pieces that cover the mesh; from the cache if the same mesh was decomposed before."""
    key = hashlib.sha256(_RECIPE.encode())
    for array in (vertices, faces):
        key.update(np.ascontiguousarray(array).tobytes())
    kept = cache_folder("convex") / f"{key.hexdigest()[:32]}.npz"
    parts = _read(kept)
    if parts is None:
        parts = _decompose(vertices, faces, closed)
        _write(kept, parts)
    return parts


def _decompose(vertices: Array, faces: IntArray, closed: bool) -> ConvexParts:
    if closed:
        whole = hull(vertices)
        if solid(vertices, faces).volume >= CONVEX_FILL * solid(*whole).volume:
            piece = _thinned(whole)
            error = distance_between([piece], vertices, faces)
            if error <= CONCAVITY:
                return ConvexParts((piece,), error)
    reduced = _reduced(vertices, faces, REDUCED_FACES)
    closed = closed and topology.is_closed(reduced[1])
    finest = float(np.clip(2.0 * CONCAVITY / float(np.ptp(vertices, axis=0).max()), FINEST, COARSEST))
    found = _coacd(*reduced, closed, COARSEST)
    if closed and len(found) <= MANY and finest < COARSEST:
        found = _coacd(*reduced, closed, finest)
    pieces = tuple(_thinned(hull(points)) for points in found if _solid_enough(points))
    if not pieces:
        return ConvexParts((), float("inf"))
    return ConvexParts(pieces, distance_between(list(pieces), vertices, faces))


def _coacd(vertices: Array, faces: IntArray, closed: bool, threshold: float) -> list[Array]:
    import coacd

    coacd.set_log_level("off")
    pieces = coacd.run_coacd(
        coacd.Mesh(vertices, faces),
        threshold=threshold,
        preprocess_mode="off" if closed else "on",
        preprocess_resolution=30,
        resolution=1000,
        mcts_nodes=10,
        mcts_iterations=40,
        mcts_max_depth=2,
    )
    return [np.asarray(v, dtype=np.float64) for v, _ in pieces]


def _solid_enough(points: Array) -> bool:
    """Whether *points* span a volume that a hull can be made of."""
    if len(points) < 4:
        return False
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[2] > 1e-5 * spread[0])


def _thinned(piece: Piece) -> Piece:
    if len(piece[0]) <= 2 * PIECE_VERTICES:
        return piece
    return hull(_reduced(*piece, 2 * PIECE_VERTICES)[0])


def _reduced(vertices: Array, faces: IntArray, count: int) -> Piece:
    if len(faces) <= count:
        return vertices, faces
    import fast_simplification

    centre, scale = vertices.mean(axis=0), float(np.ptp(vertices))
    v, f = fast_simplification.simplify(
        ((vertices - centre) / scale).astype(np.float32), faces.astype(np.int32), target_count=count
    )
    return np.asarray(v, dtype=np.float64) * scale + centre, np.asarray(f, dtype=np.int64)


def hull(points: Array) -> Piece:
    """The convex hull of *points* as a closed mesh wound outwards."""
    from scipy.spatial import ConvexHull

    found = ConvexHull(points)
    corners = points[found.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normals, found.equations[:, :3]) < 0.0
    faces = found.simplices.astype(np.int64)
    faces[inward] = faces[inward][:, ::-1]
    return topology.compact(points, faces)


def distance_between(pieces: list[Piece], vertices: Array, faces: IntArray) -> float:
    """Largest distance found between the surface of the union of *pieces* and the mesh.

    Two questions, at `SAMPLES` points each: how far is the outer surface of the pieces from the mesh (a piece that
    fills a hollow), and how far is the mesh from the pieces where it sticks out of them.
    """
    mesh = vertices[faces]
    triangles = [v[f] for v, f in pieces]
    planes = [_planes(t) for t in triangles]
    seam = 1e-3 * float(np.ptp(vertices, axis=0).max())
    rng = np.random.default_rng(0)
    skin = []
    share = max(50, SAMPLES // len(pieces))
    for i, t in enumerate(triangles):
        points = np.vstack([_spread(t, share, rng)[0], t.reshape(-1, 3)])
        hidden = np.zeros(len(points), dtype=bool)
        for j, other in enumerate(planes):
            if j != i:
                hidden |= _beyond(points, other) < seam
        skin.append(points[~hidden])
    out = np.vstack([_spread(mesh, SAMPLES, rng)[0], vertices[:: max(1, len(vertices) // SAMPLES)]])
    out = out[np.min([_beyond(out, p) for p in planes], axis=0) > 0.0]
    return max(_farthest(np.vstack(skin), mesh), _farthest(out, np.concatenate(triangles)))


def _planes(triangles: Array) -> Array:
    """Outward unit normals and offsets ``(F, 4)`` of the faces: n·x ≤ d inside."""
    normals = unit_normals(triangles)
    return np.column_stack([normals, np.einsum("ij,ij->i", normals, triangles[:, 0])])


def _beyond(points: Array, planes: Array) -> Array:
    """How far *points* are beyond the farthest of the *planes*; negative inside."""
    return np.asarray((points @ planes[:, :3].T - planes[:, 3]).max(axis=1))


def _farthest(points: Array, target: Array) -> float:
    """Largest distance of *points* from the triangles *target*.

    In a large mesh the nearest triangle is looked for among those that own the nearest sample points, so the value
    is, if anything, too large.
    """
    from scipy.spatial import cKDTree

    if not len(points):
        return 0.0
    if len(target) <= 100:
        return float(np.sqrt(point_triangle_squared(points[:, None, :], target[None]).min(axis=1).max()))
    probes, owner = _spread(target, 5 * SAMPLES, np.random.default_rng(1))
    probes = np.vstack([probes, target.reshape(-1, 3)])
    owner = np.r_[owner, np.repeat(np.arange(len(target)), 3)]
    _, near = cKDTree(probes).query(points, k=12)
    squared = point_triangle_squared(points[:, None, :], target[owner[near]])
    return float(np.sqrt(squared.min(axis=1).max()))


def _spread(triangles: Array, n: int, rng: np.random.Generator) -> tuple[Array, IntArray]:
    areas = 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    points, _, face = sample(triangles, areas, np.zeros_like(triangles[:, 0]), n, rng)
    return points, face


def point_triangle_squared(points: Array, triangles: Array) -> Array:
    """Squared distances of ``points (..., 3)`` from ``triangles (..., 3, 3)``, broadcast.

    The foot on the plane if it falls inside the triangle, else the nearest of the three edges.
    """
    a, b, c = triangles[..., 0, :], triangles[..., 1, :], triangles[..., 2, :]
    best = np.full(np.broadcast_shapes(points.shape, a.shape)[:-1], np.inf)
    inside = np.ones_like(best, dtype=bool)
    normal = np.cross(b - a, c - a)
    for p, q in ((a, b), (b, c), (c, a)):
        along, to = q - p, points - p
        length2 = np.einsum("...i,...i->...", along, along)
        t = np.clip(np.einsum("...i,...i->...", to, along) / np.maximum(length2, 1e-300), 0.0, 1.0)
        rest = to - t[..., None] * along
        best = np.minimum(best, np.einsum("...i,...i->...", rest, rest))
        inside &= np.einsum("...i,...i->...", np.cross(along, to), normal) > 0.0
    size2 = np.einsum("...i,...i->...", normal, normal)
    height = np.einsum("...i,...i->...", points - a, normal)
    return np.where(inside, height**2 / np.maximum(size2, 1e-300), best)


def _write(path: Path, parts: ConvexParts) -> None:
    arrays = {"error": np.array(parts.error), "count": np.array(len(parts.pieces))}
    for i, (v, f) in enumerate(parts.pieces):
        arrays[f"v{i}"], arrays[f"f{i}"] = v, f
    try:
        with replace_file(path) as work:
            np.savez(work, **arrays)  # type: ignore[arg-type]
    except OSError:
        return  # a cache that cannot be written only costs time


def _read(path: Path) -> ConvexParts | None:
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as data:
            pieces = tuple((data[f"v{i}"], data[f"f{i}"]) for i in range(int(data["count"])))
            return ConvexParts(pieces, float(data["error"]))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None  # missing, or damaged: computed again
