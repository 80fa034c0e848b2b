"""The geometry of a compiled MuJoCo model as shapes of a description."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..files import replace_file
from ..kernels._jit import _cache_root as cache_root
from .description import Shape, ShapeKind
from .poses import from_quaternion

Report = Callable[[str, str, str], None]
"""Takes what, the problem, and the remedy."""


def body_shapes(m: Any, body: int, path: Path, report: Report) -> tuple[tuple[Shape, ...], tuple[Shape, ...]]:
    """Visual and collision shapes of a body: geometry of groups 0 to 2 is seen, what has a contact type collides."""
    visuals, collisions = [], []
    for g in range(int(m.body_geomadr[body]), int(m.body_geomadr[body] + m.body_geomnum[body])):
        shape = _shape(m, g, path, report)
        if shape is None:
            continue
        if m.geom_contype[g] or m.geom_conaffinity[g]:
            collisions.append(shape)
        if m.geom_group[g] <= 2:
            visuals.append(shape)
    return tuple(visuals), tuple(collisions)


def _shape(m: Any, g: int, path: Path, report: Report) -> Shape | None:
    from mujoco import mjtGeom as kinds

    kind, size = int(m.geom_type[g]), [float(x) for x in m.geom_size[g]]
    pose, name = from_quaternion(m.geom_pos[g], m.geom_quat[g]), m.geom(g).name
    rgba = m.geom_rgba[g] if m.geom_matid[g] < 0 else m.mat_rgba[m.geom_matid[g]]
    color = (float(rgba[0]), float(rgba[1]), float(rgba[2]), float(rgba[3]))
    simple: dict[int, tuple[ShapeKind, tuple[float, ...]]] = {
        int(kinds.mjGEOM_BOX): (ShapeKind.BOX, (2 * size[0], 2 * size[1], 2 * size[2])),
        int(kinds.mjGEOM_SPHERE): (ShapeKind.SPHERE, (size[0],)),
        int(kinds.mjGEOM_CYLINDER): (ShapeKind.CYLINDER, (size[0], 2 * size[1])),
        int(kinds.mjGEOM_CAPSULE): (ShapeKind.CAPSULE, (size[0], 2 * size[1])),
    }
    if kind in simple:
        return Shape(simple[kind][0], simple[kind][1], pose, None, color, name)
    what = f"geom {name or g!r} of body {m.body(m.geom_bodyid[g]).name!r}"
    if kind == kinds.mjGEOM_MESH:
        k = int(m.geom_dataid[g])
        file = _mesh_file(m, k, path)
        if file is None:
            return Shape(ShapeKind.MESH, (1.0, 1.0, 1.0), pose, _kept_mesh(m, k), color, name)
        scale = (float(m.mesh_scale[k, 0]), float(m.mesh_scale[k, 1]), float(m.mesh_scale[k, 2]))
        pose = pose @ np.linalg.inv(from_quaternion(m.mesh_pos[k], m.mesh_quat[k]))
        return Shape(ShapeKind.MESH, scale, pose, file, color, name)
    if kind == kinds.mjGEOM_ELLIPSOID:
        growth, ball = _ball()
        report(what, "is an ellipsoid", f"took a polyhedron around it, at most {growth - 1.0:.1%} larger")
        return Shape(ShapeKind.MESH, (size[0], size[1], size[2]), pose, ball, color, name)
    report(what, "is a plane, a height field or another unbounded shape", "left it out")
    return None


def _mesh_file(m: Any, mesh: int, path: Path) -> Path | None:
    start = int(m.mesh_pathadr[mesh])
    if start < 0:
        return None
    text = m.paths[start : m.paths.index(b"\0", start)].decode()
    file = path.parent / text
    return file.resolve() if file.is_file() else None


def _kept_mesh(m: Any, mesh: int) -> Path:
    """A file in the cache for a mesh that the model holds without one: as compiled, in its own frame of inertia."""
    first, count = int(m.mesh_vertadr[mesh]), int(m.mesh_vertnum[mesh])
    start, faces = int(m.mesh_faceadr[mesh]), int(m.mesh_facenum[mesh])
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in m.mesh_vert[first : first + count].astype(float).tolist()]
    rows += [f"f {i + 1} {j + 1} {k + 1}" for i, j, k in m.mesh_face[start : start + faces].tolist()]
    return _kept("\n".join([*rows, ""]))


def _ball() -> tuple[float, Path]:
    """How far the corners of a polyhedron around the unit ball are from its centre, and a file with the polyhedron."""
    from trimesh.creation import icosphere

    mesh = icosphere(subdivisions=2)
    growth = 1.0 / float(np.einsum("fi,fi->f", mesh.face_normals, mesh.triangles[:, 0]).min())
    rows = [f"v {growth * x:.12f} {growth * y:.12f} {growth * z:.12f}" for x, y, z in mesh.vertices.tolist()]
    rows += [f"f {i + 1} {j + 1} {k + 1}" for i, j, k in mesh.faces.tolist()]
    return growth, _kept("\n".join([*rows, ""]))


def _kept(text: str) -> Path:
    """A file of the cache with this text."""
    key = hashlib.sha256(text.encode()).hexdigest()[:32]
    path = cache_root() / "mujoco" / f"{key}.obj"
    if not path.is_file():
        with replace_file(path) as work:
            work.write_text(text, encoding="utf-8")
    return path
