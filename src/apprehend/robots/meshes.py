"""Mesh files of a description as plain triangles, in metres of the shape's own frame."""

from __future__ import annotations

import io
import re
import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array, IntArray
from ..errors import MeshError
from .description import Link, Shape, ShapeKind

MAX_BYTES = 512 * 1024 * 1024
"""Largest mesh file that is read."""


def load_shape_mesh(shape: Shape) -> tuple[Array, IntArray]:
    """Vertices ``(V, 3)`` and faces ``(F, 3)`` of a mesh shape, scaled to metres; ``shape.pose`` is *not* applied.

    Equal vertices are merged (STL repeats every corner); faces without area are kept. A COLLADA file's unit is applied
    and its up axis is not, as in every tool that displays URDF: the files are drawn in the axes of the link. All parts
    of a file are joined. A scale that mirrors turns the faces round, so that they keep looking outwards. Raises
    `MeshError` for files that are missing, unreadable, or without faces.
    """
    if shape.kind is not ShapeKind.MESH or shape.mesh is None:
        raise MeshError(f"shape {shape.name!r} is a {shape.kind.value}, not a mesh")
    vertices, faces = _cached(shape.mesh, _stamp(shape.mesh))
    scale = np.asarray(shape.size)
    if np.prod(scale) < 0:
        faces = faces[:, ::-1]
    return np.ascontiguousarray(vertices * scale), np.ascontiguousarray(faces)


def _stamp(path: Path) -> tuple[int, int]:
    """What tells one state of a file from another: time of change in ns and size; zeros for a file that is missing."""
    try:
        found = path.stat()
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


@lru_cache(maxsize=256)
def _cached(path: Path, stamp: tuple[int, int]) -> tuple[Array, IntArray]:
    """`read_mesh`, once for every state of a file: the hand, the collision checks and the simulation all ask."""
    return read_mesh(path)


def read_mesh(path: Path) -> tuple[Array, IntArray]:
    """Vertices ``(V, 3)`` and faces ``(F, 3)`` of a mesh file, merged, in the unit of the file (COLLADA: metres)."""
    import trimesh

    try:
        if path.stat().st_size > MAX_BYTES:
            raise MeshError(f"{path} has {path.stat().st_size / 1e6:.0f} MB; a mesh may have {MAX_BYTES / 1e6:.0f} MB")
        data = path.read_bytes()
    except OSError as error:
        raise MeshError(f"mesh {path} cannot be read: {error.strerror}") from error
    kind = path.suffix.lower().lstrip(".")
    unit = 1.0
    if kind == "dae":
        _refuse_entities(data, path)
        unit = _collada_unit(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            loaded: Any = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False, skip_materials=True)
        mesh = loaded.to_mesh()
        vertices = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
        faces = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
    except Exception as error:  # the readers of third parties raise anything
        raise MeshError(f"mesh {path} cannot be read as {kind}: {type(error).__name__}: {error}") from error
    if not len(faces):
        raise MeshError(f"mesh {path} has no faces")
    if not np.isfinite(vertices).all():
        raise MeshError(f"mesh {path} has vertices that are not finite")
    return _merged(vertices * unit, faces)


def _merged(vertices: Array, faces: IntArray) -> tuple[Array, IntArray]:
    """Equal vertices joined; unused ones dropped."""
    used, index = np.unique(vertices[faces.ravel()] + 0.0, axis=0, return_inverse=True)
    return used, index.reshape(-1, 3).astype(np.int64)


def _refuse_entities(data: bytes, path: Path) -> None:
    head = data.replace(b"\0", b"").upper()
    if b"<!DOCTYPE" in head or b"<!ENTITY" in head:
        raise MeshError(f"mesh {path} declares a DOCTYPE or entities, which is refused; remove the declaration")


def _collada_unit(data: bytes) -> float:
    """Metres per unit of a COLLADA file."""
    found = re.search(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']*)[\"']", data)
    try:
        unit = float(found.group(1)) if found else 1.0
    except ValueError:
        return 1.0
    return unit if unit > 0.0 else 1.0


def shape_surface(shape: Shape, segments: int = 32) -> tuple[Array, IntArray]:
    """The surface of any shape as triangles in the frame of its *link* (``shape.pose`` applied), in metres.

    Round shapes are approximated from inside with *segments* around the axis.
    """
    import trimesh

    if shape.kind is ShapeKind.MESH:
        vertices, faces = load_shape_mesh(shape)
    else:
        if shape.kind is ShapeKind.BOX:
            made = trimesh.creation.box(extents=shape.size)
        elif shape.kind is ShapeKind.SPHERE:
            made = trimesh.creation.icosphere(subdivisions=3, radius=shape.size[0])
        elif shape.kind is ShapeKind.CYLINDER:
            made = trimesh.creation.cylinder(radius=shape.size[0], height=shape.size[1], sections=segments)
        else:
            count = (segments, segments)
            made = trimesh.creation.capsule(radius=shape.size[0], height=shape.size[1], count=count)
            made.apply_translation(-made.bounds.mean(axis=0))
        vertices = np.asarray(made.vertices, dtype=np.float64)
        faces = np.asarray(made.faces, dtype=np.int64)
    return vertices @ shape.pose[:3, :3].T + shape.pose[:3, 3], faces


def link_surface(link: Link, *, visual: bool = False) -> tuple[Array, IntArray]:
    """All collision (or visual) shapes of *link* as one set of triangles in its frame; empty where there are none."""
    parts = [shape_surface(s) for s in (link.visuals if visual else link.collisions)]
    if not parts:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    starts = np.cumsum([0, *(len(v) for v, _ in parts[:-1])])
    faces = [f + start for (_, f), start in zip(parts, starts, strict=True)]
    return np.concatenate([v for v, _ in parts]), np.concatenate(faces)
