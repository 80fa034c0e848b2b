"""How the links of a robot look: their visible shapes as coloured meshes, thinned to what a picture needs.

Colours come from the description, else from the materials of the mesh file, else a neutral grey.
"""

from __future__ import annotations

import hashlib
import io
import warnings
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array, IntArray
from ..bodies.cache import cache_folder
from ..errors import ApprehendError
from ..files import replace_file
from ..robots.description import Description, Shape, ShapeKind
from ..robots.meshes import load_shape_mesh, shape_surface
from .picture import smooth_normals

RGBA = tuple[float, float, float, float]
Piece = tuple[Array, IntArray, RGBA]

GREY: RGBA = (0.78, 0.79, 0.80, 1.0)
"""A link of which nobody says the colour."""
MOST_FACES = 6_000
"""A part with more triangles is thinned to this number."""


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh in the frame of its link, with one colour."""

    vertices: Array
    faces: IntArray
    rgba: RGBA

    @cached_property
    def normals(self) -> Array:
        """Corner normals ``(F, 3, 3)``, smooth where the surface is."""
        return smooth_normals(self.vertices, self.faces)


def link_parts(description: Description) -> Mapping[str, tuple[Part, ...]]:
    """For every link the parts that are seen: its visual shapes, or its collision shapes where there are none.

    A shape whose file cannot be read leaves the link without it: a picture with a gap says more than none.
    """
    looks: dict[str, tuple[Part, ...]] = {}
    anything = any(link.visuals for link in description.links.values())
    for name, link in description.links.items():
        parts: list[Part] = []
        for shape in link.visuals if anything else link.collisions:
            try:
                parts += _parts(shape)
            except ApprehendError:
                continue
        looks[name] = tuple(parts)
    return looks


def _parts(shape: Shape) -> list[Part]:
    if shape.kind is not ShapeKind.MESH or shape.mesh is None:
        vertices, faces = shape_surface(shape)
        return [Part(vertices, faces, shape.rgba or GREY)]
    R, p = shape.pose[:3, :3], shape.pose[:3, 3]
    return [Part(v @ R.T + p, f, shape.rgba or rgba) for v, f, rgba in _mesh_pieces(shape)]


def _mesh_pieces(shape: Shape) -> list[Piece]:
    """The thinned pieces of a mesh shape, from the cache if the same file was read before."""
    path = shape.mesh
    assert path is not None
    key = hashlib.sha256(f"1:{MOST_FACES}:{shape.size}:{shape.rgba is None}".encode())
    try:
        key.update(path.read_bytes())
        for other in sorted(path.parent.glob("*.mtl")):
            key.update(other.read_bytes())
    except OSError:
        return [_thinned(*load_shape_mesh(shape), GREY)]  # raises what is wrong with the file
    kept = cache_folder("looks") / f"{key.hexdigest()[:32]}.npz"
    pieces = _read(kept)
    if pieces is None:
        whole = load_shape_mesh(shape)
        found = _by_material(path, shape.size, whole[0]) if shape.rgba is None else None
        pieces = [_thinned(*piece) for piece in found or [(*whole, GREY)]]
        _write(kept, pieces)
    return pieces


def _read(path: Path) -> list[Piece] | None:
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as data:
            colours = data["rgba"].tolist()
            return [(data[f"v{i}"], data[f"f{i}"], tuple(c)) for i, c in enumerate(colours)]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None  # missing, or damaged: made again


def _write(path: Path, pieces: list[Piece]) -> None:
    arrays: dict[str, Any] = {"rgba": np.array([rgba for _, _, rgba in pieces])}
    for i, (v, f, _) in enumerate(pieces):
        arrays[f"v{i}"], arrays[f"f{i}"] = v, f
    try:
        with replace_file(path) as work:
            np.savez(work, **arrays)
    except OSError:
        return  # a cache that cannot be written only costs time


def _by_material(path: Path, scale: tuple[float, ...], whole: Array) -> list[Piece] | None:
    """The mesh of *path* in pieces of one colour each; None if they do not span the same box as its *whole*."""
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene: Any = trimesh.load_scene(path, process=False)
            meshes = [m for m in scene.dump(concatenate=False) if isinstance(m, trimesh.Trimesh) and len(m.faces)]
        pieces: dict[RGBA, list[tuple[Array, IntArray]]] = {}
        for mesh in meshes:
            vertices = np.asarray(mesh.vertices, dtype=np.float64) * scale
            pieces.setdefault(_colour(mesh), []).append((vertices, np.asarray(mesh.faces, dtype=np.int64)))
    except Exception:  # materials are decoration: any trouble with them means the plain mesh
        return None
    if not pieces:
        return None
    everything = np.vstack([v for group in pieces.values() for v, _ in group])
    span = np.abs([everything.min(axis=0) - whole.min(axis=0), everything.max(axis=0) - whole.max(axis=0)])
    if span.max() > 1e-5:
        return None
    turn = bool(np.prod(scale) < 0.0)
    return [(*_joined(group, turn), rgba) for rgba, group in pieces.items()]


def _colour(mesh: Any) -> RGBA:
    material = getattr(mesh.visual, "material", None)
    colour = getattr(material, "main_color", None) if material is not None else None
    if colour is None:
        colour = getattr(mesh.visual, "main_color", None)
    if colour is None:
        return GREY
    r, g, b = (float(c) / 255.0 for c in np.asarray(colour)[:3])
    return (r, g, b, 1.0)


def _joined(group: list[tuple[Array, IntArray]], turn: bool) -> tuple[Array, IntArray]:
    starts = np.cumsum([0, *(len(v) for v, _ in group)])
    faces = np.vstack([f + start for (_, f), start in zip(group, starts)])
    return np.vstack([v for v, _ in group]), faces[:, ::-1] if turn else faces


def _thinned(vertices: Array, faces: IntArray, rgba: RGBA) -> Piece:
    if len(faces) <= MOST_FACES:
        return vertices, faces, rgba
    import fast_simplification

    from ..bodies.topology import weld

    vertices, faces = weld(vertices, faces, 0.0)
    centre, size = vertices.mean(axis=0), float(np.ptp(vertices))
    v, f = fast_simplification.simplify(
        ((vertices - centre) / size).astype(np.float32), faces.astype(np.int32), target_count=MOST_FACES
    )
    return np.asarray(v, dtype=np.float64) * size + centre, np.asarray(f, dtype=np.int64), rgba
