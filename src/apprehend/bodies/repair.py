"""Make a triangle mesh closed and consistently wound where that can be done, and say what was done.

The steps, each taken only if the mesh needs it: drop collapsed and doubled faces, weld close vertices, turn faces so
that neighbours run alike, cap holes, turn parts that face inwards, unite parts that overlap.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Array, IntArray
from . import topology
from .mass import solid

WELD = 1e-5
"""Vertices closer than this fraction of the diagonal are welded if the mesh is open."""

OVERLAP = 1e-6
"""Parts are united if that hides more than this fraction of the surface."""

CRUMB = 1e-6
"""Closed parts with less than this fraction of the volume are dropped."""


@dataclass(frozen=True, eq=False)
class Mended:
    """A mesh with what was done to it."""

    vertices: Array
    faces: IntArray
    repairs: tuple[str, ...] = ()

    def then(self, vertices: Array, faces: IntArray, note: str) -> Mended:
        """The next state, with *note* appended."""
        return Mended(vertices, faces, (*self.repairs, note))

    @property
    def closed(self) -> bool:
        """Whether the surface has no boundary."""
        return topology.is_closed(self.faces)


def plural(count: int, noun: str) -> str:
    """``1 face``, ``2 faces``, ``2 vertices``."""
    if count == 1:
        return f"1 {noun}"
    return f"{count} {noun[:-2]}ices" if noun.endswith("vertex") else f"{count} {noun}s"


def mend(vertices: Array, faces: IntArray) -> Mended:
    """Repair ``vertices (V, 3)``, ``faces (F, 3)``; the result may still be open (`Mended.closed`)."""
    mesh = _dropped(Mended(vertices, faces))
    if len(mesh.faces) and not mesh.closed:
        mesh = _capped(_wound(_welded(mesh)))
    if len(mesh.faces) and mesh.closed:
        mesh = _united(_outward(_swept(mesh)))
    return mesh


def _dropped(mesh: Mended) -> Mended:
    """Identical vertices are one (STL repeats them by design, which is no defect); collapsed faces go."""
    vertices, faces = topology.weld(mesh.vertices, mesh.faces, 0.0)
    lost = len(mesh.faces) - len(faces)
    mesh = replace(mesh, vertices=vertices, faces=faces)
    if lost:
        mesh = mesh.then(vertices, faces, f"dropped {plural(lost, 'face')} with repeated corners")
    kept = topology.without_flaps(faces)
    if len(kept) < len(faces):
        number = (len(faces) - len(kept)) // 2
        mesh = mesh.then(
            *topology.compact(vertices, kept), f"dropped {plural(number, 'flap')} (a face and its reverse)"
        )
    return mesh


def _welded(mesh: Mended) -> Mended:
    distance = WELD * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    vertices, faces = topology.weld(mesh.vertices, mesh.faces, distance)
    gone = len(mesh.vertices) - len(vertices)
    if gone and len(faces):
        mesh = mesh.then(vertices, faces, f"welded {plural(gone, 'vertex')} closer than {distance * 1e6:.2g} µm")
    _, first = np.unique(np.sort(mesh.faces, axis=1), axis=0, return_index=True)
    doubled = len(mesh.faces) - len(first)
    if doubled:
        keep = mesh.faces[np.sort(first)]
        mesh = mesh.then(*topology.compact(mesh.vertices, keep), f"dropped {plural(doubled, 'doubled face')}")
    return mesh


def _wound(mesh: Mended) -> Mended:
    faces, turned = topology.wind_alike(mesh.faces)
    if turned:
        return mesh.then(mesh.vertices, faces, f"turned {plural(turned, 'face')} to run like the neighbours")
    return mesh


def _capped(mesh: Mended) -> Mended:
    """Close every hole by a flat cap if its rim allows one, else by a fan around the rim's centre."""
    loops = [loop for loop in topology.boundary_loops(mesh.faces) if len(loop) >= 3]
    two_sided = bool(topology.adjacency(mesh.faces)[2].all())  # a Möbius band has no side to cap
    if not loops or not two_sided:
        return mesh
    vertices, caps, longest = mesh.vertices, [], 0.0
    for loop in loops:
        rim = mesh.vertices[loop]
        longest = max(longest, float(np.linalg.norm(rim - np.roll(rim, -1, axis=0), axis=1).sum()))
        cap = _flat_cap(rim)
        if cap is None:
            n = len(vertices)
            vertices = np.vstack([vertices, rim.mean(axis=0)])
            caps.append(np.array([[a, b, n] for a, b in zip(loop, loop[1:] + loop[:1])], dtype=np.int64))
        else:
            caps.append(np.asarray(loop, dtype=np.int64)[cap])
    faces = np.vstack([mesh.faces, *caps])
    note = f"capped {plural(len(loops), 'hole')} (longest rim {longest * 1e3:.3g} mm)"
    if topology.is_closed(faces):
        return mesh.then(vertices, faces, note)
    return mesh


def _flat_cap(rim: Array) -> IntArray | None:
    """Triangles over the rim ``(n, 3)``, by its best plane; None if it crosses itself there."""
    if len(rim) == 3:
        return np.array([[0, 1, 2]], dtype=np.int64)
    import manifold3d

    centred = rim - rim.mean(axis=0)
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)  # twice the vector area
    length = float(np.linalg.norm(normal))
    if length < 1e-12 * float(np.ptp(rim, axis=0).max()) ** 2:
        return None
    normal /= length
    u = np.linalg.svd(normal[None])[2][1]
    flat = np.stack([centred @ u, centred @ np.cross(normal, u)], axis=1)
    scale = float(np.abs(flat).max())
    try:
        cap = np.asarray(manifold3d.triangulate([flat / scale], 1e-9), dtype=np.int64)
    except (RuntimeError, ValueError):
        return None
    if len(cap) != len(rim) - 2:
        return None
    a, b, c = (flat[cap[:, k]] for k in range(3))
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    return cap if abs(area.sum() - 0.5 * length) < 1e-6 * length and area.min() > -1e-9 * length else None


def _parts(mesh: Mended) -> tuple[list[IntArray], Array]:
    """The faces of every part, and its signed volume in m³."""
    label = topology.components(mesh.faces)
    order = np.argsort(label, kind="stable")
    parts = np.split(mesh.faces[order], np.cumsum(np.bincount(label))[:-1])
    corners = mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0)
    volumes = np.bincount(label, np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)
    return parts, np.asarray(volumes, dtype=np.float64)


def _swept(mesh: Mended) -> Mended:
    """Drop parts of next to no volume."""
    parts, volumes = _parts(mesh)
    crumbs = np.abs(volumes) < CRUMB * np.abs(volumes).max()
    if not crumbs.any():
        return mesh
    kept = np.concatenate([part for part, crumb in zip(parts, crumbs) if not crumb])
    note = f"dropped {plural(int(crumbs.sum()), 'crumb')} of next to no volume"
    return mesh.then(*topology.compact(mesh.vertices, kept), note)


def _outward(mesh: Mended) -> Mended:
    """Turn parts that face inwards, unless they are cavities: inside another part, and meant to be hollow."""
    parts, volumes = _parts(mesh)
    low, high = _boxes(mesh.vertices, parts)
    turned = 0
    for k in np.flatnonzero(volumes < 0.0):
        point = mesh.vertices[parts[k][0, 0]]
        around = (volumes > 0.0) & (low <= point).all(axis=1) & (point <= high).all(axis=1)
        if not any(_inside(mesh.vertices, parts[j], point) for j in np.flatnonzero(around)):
            parts[k] = parts[k][:, ::-1]
            turned += 1
    if not turned:
        return mesh
    return mesh.then(mesh.vertices, np.concatenate(parts), f"turned {plural(turned, 'part')} that faced inwards")


def _boxes(vertices: Array, parts: list[IntArray]) -> tuple[Array, Array]:
    """Lower and upper corners ``(k, 3)`` of the boxes around *parts*."""
    points = [vertices[part.reshape(-1)] for part in parts]
    return np.array([p.min(axis=0) for p in points]), np.array([p.max(axis=0) for p in points])


def _inside(vertices: Array, faces: IntArray, point: Array) -> bool:
    """Whether *point* lies inside a closed mesh: its winding number, by solid angles (Van Oosterom & Strackee)."""
    return bool(abs(solid_angles(vertices[faces] - point).sum()) > 2.0 * np.pi)


def solid_angles(corners: Array) -> Array:
    """Signed solid angle of triangles ``corners (F, 3, 3)`` seen from the origin (Van Oosterom & Strackee 1983).

    tan(Ω/2) = a·(b×c) / (|a||b||c| + (a·b)|c| + (b·c)|a| + (c·a)|b|)
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    numerator = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a)))
    return np.asarray(2.0 * np.arctan2(numerator, la * lb * lc + ab * lc + bc * la + ca * lb))


def _united(mesh: Mended) -> Mended:
    """Parts that touch or overlap become one surface; parts that do not are left as they are."""
    parts, volumes = _parts(mesh)
    if len(parts) < 2 or not _any_meet(*_boxes(mesh.vertices, parts)):
        return mesh
    solids = [topology.compact(mesh.vertices, part) for part in parts]
    united = union([p for p, v in zip(solids, volumes) if v > 0.0], [p for p, v in zip(solids, volumes) if v < 0.0])
    if united is None or area(*united) > (1.0 - OVERLAP) * area(mesh.vertices, mesh.faces):
        return mesh
    before, after = volumes.sum(), solid(*united).volume
    note = f"united {len(parts)} parts that touch or overlap (volume {before * 1e6:.4g} to {after * 1e6:.4g} cm³)"
    return mesh.then(*united, note)


def _any_meet(low: Array, high: Array) -> bool:
    """Whether any two boxes meet: those that do along x, swept in order, are compared along y and z."""
    order = np.argsort(low[:, 0], kind="stable")
    low, high = low[order], high[order]
    for i in range(len(low) - 1):
        near = slice(i + 1, int(np.searchsorted(low[:, 0], high[i, 0], side="right")))
        if ((low[near, 1:] <= high[i, 1:]) & (low[i, 1:] <= high[near, 1:])).all(axis=1).any():
            return True
    return False


def area(vertices: Array, faces: IntArray) -> float:
    """Area of the surface in m²."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def union(
    parts: list[tuple[Array, IntArray]], cavities: list[tuple[Array, IntArray]] | None = None
) -> tuple[Array, IntArray] | None:
    """The union of closed *parts* less the *cavities* (wound inwards), or None where one is not a 2-manifold."""
    import manifold3d

    whole = [as_manifold(*part) for part in parts]
    holes = [as_manifold(part[0], part[1][:, ::-1]) for part in cavities or []]
    if any(m is None for m in whole + holes):
        return None
    result = manifold3d.Manifold.batch_boolean(whole, manifold3d.OpType.Add)
    if holes:
        result = result - manifold3d.Manifold.batch_boolean(holes, manifold3d.OpType.Add)
    return topology.weld(*mesh_of(result), 0.0)


def as_manifold(vertices: Array, faces: IntArray) -> Any:
    """The mesh as a `manifold3d.Manifold`, or None where it is not a 2-manifold."""
    import manifold3d

    mesh = manifold3d.Mesh64(np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.uint64))
    found = manifold3d.Manifold(mesh)
    return found if found.status() == manifold3d.Error.NoError else None


def mesh_of(manifold: Any) -> tuple[Array, IntArray]:
    """Vertices ``(V, 3)`` and faces ``(F, 3)`` of a `manifold3d.Manifold`."""
    mesh = manifold.to_mesh64()
    vertices = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3]
    return vertices, np.asarray(mesh.tri_verts).astype(np.int64)
