"""Read a mesh file from a stranger: size bounds first, then the geometry, then whether it can be a body.

Only geometry is read: no materials, no textures, no file that the mesh refers to. Coordinates stay as in the file
but for the unit.
"""

from __future__ import annotations

import difflib
import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError, MeshError

FORMATS = (".obj", ".stl", ".ply", ".glb", ".off")
"""The mesh formats that are read."""

MAX_BYTES = 256 * 2**20
"""Largest mesh file that is read."""

MAX_FACES = 2_000_000
"""Most triangles that a mesh may have."""

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}
"""Length units that a mesh file may be in, in metres."""

LARGEST, SMALLEST = 5.0, 1e-3
"""A body to be handled has its largest extent between these, in metres; outside, the unit is in doubt."""


def read_mesh(path: str | Path, units: str | None = None) -> tuple[Array, IntArray]:
    """``vertices (V, 3)`` in metres and ``faces (F, 3)`` of the mesh at *path*, checked but not repaired.

    *units* is one of `UNITS`. Without it metres are assumed, and a size that no hand could handle is refused.
    """
    if units is not None and units not in UNITS:
        raise InputError(f"units is {units!r}; expected one of {', '.join(map(repr, UNITS))}")
    path = Path(path).expanduser()
    data = _bytes_of(path)
    vertices, faces = _parse(data, path)
    check_mesh(vertices, faces, str(path))
    if units is None:
        _check_size(vertices[faces.reshape(-1)], path)
    return vertices * UNITS[units or "m"], faces


def _bytes_of(path: Path) -> bytes:
    if path.suffix.lower() not in FORMATS:
        raise MeshError(f"{path}: the ending {path.suffix!r} is not a mesh format; expected {', '.join(FORMATS)}")
    if path.is_dir():
        raise MeshError(f"{path} is a folder; expected a mesh file ({', '.join(FORMATS)})")
    if not path.is_file():
        raise MeshError(f"{path} does not exist.{_neighbours(path)}")
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise MeshError(
            f"{path} has {size / 2**20:.0f} MiB; at most {MAX_BYTES // 2**20} MiB are read: decimate the mesh"
        )
    if size == 0:
        raise MeshError(f"{path} is empty (0 bytes)")
    try:
        return path.read_bytes()
    except OSError as error:
        raise MeshError(f"{path} cannot be read: {error.strerror}") from error


def _neighbours(path: Path) -> str:
    if not path.parent.is_dir():
        return f" Its folder {path.parent} does not exist either."
    names = sorted(p.name for p in path.parent.iterdir() if p.suffix.lower() in FORMATS)
    close = difflib.get_close_matches(path.name, names, n=3, cutoff=0.4)
    if close:
        return f" Did you mean {' or '.join(repr(n) for n in close)}?"
    if names:
        return f" Meshes in that folder: {', '.join(names[:8])}{' …' if len(names) > 8 else ''}."
    return f" There is no mesh in {path.parent}."


def _parse(data: bytes, path: Path) -> tuple[Array, IntArray]:
    import trimesh

    kind = path.suffix.lower()[1:]
    if kind == "glb":
        _check_glb(data, path)
    options: dict[str, Any] = {"skip_materials": True} if kind == "obj" else {}
    try:
        # from memory: no resolver, so that a file can not make us open another one
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False, **options)
        parts = [g for g in scene.dump(concatenate=False) if isinstance(g, trimesh.Trimesh)]
    except Exception as error:  # a parser may fail in any way on a broken file
        raise MeshError(f"{path} is not a readable {kind.upper()} mesh ({type(error).__name__}: {error})") from error
    parts = [p for p in parts if len(p.faces)]
    if not parts:
        raise MeshError(
            f"{path} holds no triangles: a point cloud, or an empty scene? Points become an obstacle by "
            "collision.Cloud.of(points), but no body"
        )
    offsets = np.cumsum([0, *(len(p.vertices) for p in parts)])
    vertices = np.vstack([np.asarray(p.vertices, dtype=np.float64) for p in parts])
    faces = np.vstack([np.asarray(p.faces, dtype=np.int64) + o for p, o in zip(parts, offsets)])
    return vertices, faces


def _check_glb(data: bytes, path: Path) -> None:
    """Refuse a GLB whose tables claim more elements than the file has bytes: a few bytes could fill the memory."""
    try:
        length = int.from_bytes(data[12:16], "little")
        header = json.loads(data[20 : 20 + length])
        counts = [accessor["count"] for accessor in header.get("accessors", ())]
        largest = max(map(int, counts), default=0)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise MeshError(f"{path} is not a readable GLB mesh ({type(error).__name__}: {error})") from error
    if largest > len(data):
        raise MeshError(f"{path} claims {largest} elements in {len(data)} bytes: the file is damaged or hostile")


def check_mesh(vertices: Array, faces: IntArray, where: str) -> None:
    """Raise `MeshError` unless the arrays are a mesh of finite vertices that spans a volume."""
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise MeshError(f"{where}: vertices have shape {vertices.shape}; expected (V, 3)")
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise MeshError(f"{where}: faces have shape {faces.shape}; expected (F, 3) with F ≥ 1")
    if len(faces) > MAX_FACES:
        raise MeshError(f"{where} has {len(faces)} triangles; at most {MAX_FACES} are read: decimate the mesh")
    if faces.min() < 0 or faces.max() >= len(vertices):
        bad = int(np.flatnonzero((faces < 0).any(axis=1) | (faces >= len(vertices)).any(axis=1))[0])
        raise MeshError(f"{where}: face {bad} is {faces[bad].tolist()}, but there are {len(vertices)} vertices")
    used = np.unique(faces)
    broken = used[~np.isfinite(vertices[used]).all(axis=1)]
    if len(broken):
        i = int(broken[0])
        raise MeshError(
            f"{where}: vertex {i} is {vertices[i].tolist()}; every coordinate must be finite. Re-export the mesh"
        )
    points = vertices[used]
    extents = np.ptp(points, axis=0)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
    if spread[0] == 0.0:
        raise MeshError(f"{where}: all vertices coincide; a body needs a volume")
    if spread[2] < 1e-7 * spread[0]:
        raise MeshError(
            f"{where} is flat (extents {_sizes(extents)} m): a body needs a volume. "
            "Give the sheet a thickness, or export the closed solid"
        )


def _sizes(extents: Array) -> str:
    return " × ".join(f"{x:.3g}" for x in extents)


def _check_size(points: Array, path: Path) -> None:
    extents = np.ptp(points, axis=0)
    size = float(extents.max())
    if SMALLEST <= size <= LARGEST:
        return
    names = {"mm": "millimetres", "cm": "centimetres", "in": "inches", "m": "metres"}
    # the unit under which the thing is nearest to the size of a hand; millimetres are the commonest
    fitting = [u for u, factor in UNITS.items() if u != "m" and SMALLEST <= size * factor <= LARGEST]
    guess = min(fitting, key=lambda u: abs(np.log(size * UNITS[u] / 0.15)) - (u == "mm"), default=None)
    if guess is not None:
        real = _sizes(extents * UNITS[guess])
        hint = f"{names[guess]}? Pass units={guess!r} ({real} m)"
    elif size < SMALLEST:
        hint = "was it scaled twice? Re-export it in metres"
    else:
        hint = "re-export it in metres"
    raise MeshError(
        f"{path} is {_sizes(extents)} m large, which is no object for a hand ({SMALLEST:g} to {LARGEST:g} m): {hint}; "
        "or pass units='m' if it really has that size"
    )
