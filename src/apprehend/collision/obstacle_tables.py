"""Obstacles in scene files: ``[[obstacle]]`` tables, and the files that hold what is too large for a table.

::

    [[obstacle]]
    name = "floor"
    half_space = [0, 0, 1]          # normal, out of the solid; its face goes through the origin of the pose
    pose = {xyz = [0, 0, -0.02]}    # optional

Instead of ``half_space``: ``box = [x, y, z]``, ``sphere = radius``, ``cylinder``, ``capsule`` or ``cone =
[radius, length]``, ``ellipsoid = [radii]``, ``hull = [[x, y, z], …]``; ``cloud = "points.npy"`` (or .npz, .ply, .xyz,
.csv) with ``radius`` and ``spacing``; ``mesh = "part.stl"`` with ``as = "pieces"``, ``"surface"`` or ``"field"`` (then
``spacing``) and ``units``; ``geometry = "file.npz"`` as written by this package.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import DescriptionError, suggestion
from ..files import replace_file
from ..kernels.gjk import BOX, CONE, CYLINDER, ELLIPSOID
from .geometry import Geometry
from .obstacles import Cloud, Grid, HalfSpace, Union
from .scene import Obstacle
from .shapes import Convex
from .table import Table, pose_text, quoted

SIMPLE = {"box": 3, "cylinder": 2, "capsule": 2, "cone": 2, "ellipsoid": 3, "half_space": 3}
FILES = ("cloud", "mesh", "geometry")
KINDS = (*SIMPLE, "sphere", "hull", *FILES)
OBSTACLE = ("name", "pose", "rgba", "friction", *KINDS, "radius", "spacing", "as", "units")
OPTIONS = {"radius": ("cloud", "hull"), "spacing": ("cloud", "mesh"), "as": ("mesh",), "units": ("mesh",)}
WAYS = ("pieces", "surface", "field")
MAKE = {"box": Convex.box, "cylinder": Convex.cylinder, "capsule": Convex.capsule, "cone": Convex.cone}


def read(table: Table, folder: Path) -> Obstacle:
    """The obstacle of one ``[[obstacle]]`` table; raises `DescriptionError` that names table, key and remedy."""
    kinds = [k for k in KINDS if k in table]
    if len(kinds) != 1:
        found = " and ".join(kinds) if kinds else "none"
        raise DescriptionError(f"{table.where} needs one of {', '.join(KINDS)}; it has {found}")
    kind = kinds[0]
    for key, where in OPTIONS.items():
        if key in table and kind not in where:
            raise DescriptionError(f"{table.where}: {key} belongs to {' or '.join(where)}, not to {kind}")
    T = table.pose("pose") if "pose" in table else np.eye(4)
    options: dict[str, Any] = {}
    if "rgba" in table:
        options["rgba"] = table.colour("rgba")
    if "friction" in table:
        options["friction"] = table.number("friction", 0.0, at_least=0.0)
    origin = {key: table.values[key] for key in (kind, *OPTIONS) if key in table} | {"pose": T}
    if kind in FILES:
        origin[kind] = str((folder / table.need_text(kind)).resolve())
    return Obstacle.of(table.need_text("name"), _geometry(table, kind, folder), T, origin=origin, **options)


def _geometry(table: Table, kind: str, folder: Path) -> object:
    if kind == "half_space":
        return HalfSpace.through((0.0, 0.0, 0.0), table.numbers(kind, 3))
    if kind == "ellipsoid":
        return Convex.ellipsoid(table.numbers(kind, 3))
    if kind == "box":
        return Convex.box(table.numbers(kind, 3))
    if kind in MAKE:
        radius, length = (float(x) for x in table.numbers(kind, 2))
        return MAKE[kind](radius, length)  # type: ignore[operator]
    if kind == "sphere":
        return Convex.sphere(table.number(kind, 0.0))
    if kind == "hull":
        return Convex.hull(table.values[kind], table.number("radius", 0.0, at_least=0.0))
    path = folder / table.need_text(kind)
    if kind == "cloud":
        spacing = table.number("spacing", 0.0, at_least=0.0) if "spacing" in table else None
        return Cloud.of(read_points(path), table.number("radius", 0.0, at_least=0.0), spacing=spacing)
    if kind == "geometry":
        return load_geometry(path)
    return _mesh(table, path)


def _mesh(table: Table, path: Path) -> object:
    from ..bodies import Body

    way = table.text("as", "pieces")
    if way not in WAYS:
        raise table.error("as", f"one of {', '.join(map(repr, WAYS))}")
    if "spacing" in table and way != "field":
        raise DescriptionError(f'{table.where}: spacing belongs to as = "field"')
    body = Body.load(path, units=table.text("units"))
    if way == "surface":
        return Union.surface(body.vertices, body.faces)
    if way == "field":
        return Grid.of(body.distance_field(table.number("spacing", 0.002, at_least=0.0)))
    return body


def read_points(path: Path) -> Array:
    """Points ``(N, 3)`` of a file: .npy, .npz (its array ``points``, or the only one), .ply, .xyz, .txt or .csv."""
    if not path.is_file():
        near = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        raise DescriptionError(f"there is no file of points {path}.{suggestion(path.name, near)}")
    try:
        if path.suffix == ".npy":
            return np.asarray(np.load(path, allow_pickle=False), dtype=np.float64)
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as data:
                names = [name for name in data.files if name == "points"] or data.files
                return np.asarray(data[names[0]], dtype=np.float64)
        if path.suffix == ".ply":
            import trimesh

            loaded: Any = trimesh.load(path, process=False)
            return np.asarray(loaded.vertices, dtype=np.float64)
        if path.suffix in (".xyz", ".txt", ".csv"):
            rows = np.loadtxt(path, delimiter="," if path.suffix == ".csv" else None, ndmin=2)
            return np.asarray(rows[:, :3], dtype=np.float64)
    except (OSError, ValueError, IndexError, AttributeError, zipfile.BadZipFile) as error:
        raise DescriptionError(f"{path} holds no readable points: {error}") from error
    raise DescriptionError(f"{path} is of an unknown kind; points are read from .npy, .npz, .ply, .xyz, .txt and .csv")


# --- writing -------------------------------------------------------------------------------------------------------
def lines(obstacle: Obstacle, path: Path) -> list[str]:
    """The table of an obstacle in the scene file *path*; geometry without an origin goes into a file beside it."""
    out = ["", "[[obstacle]]", f"name = {quoted(obstacle.name)}"]
    origin: Mapping[str, object] | None = obstacle.origin or _in_words(obstacle.shapes)
    if origin is None:
        file = path.parent / f"{path.stem}_{obstacle.name}.npz"
        save_geometry(obstacle.shapes, file)
        origin = {"geometry": str(file), "pose": np.eye(4)}
    for key, value in origin.items():
        if isinstance(value, np.ndarray):
            out.append(f"{key} = {pose_text(value)}")
        elif key in FILES:
            file = Path(str(value))
            beside = path.parent.resolve()
            near = file.resolve().is_relative_to(beside)
            out.append(f"{key} = {quoted(file.resolve().relative_to(beside).as_posix() if near else file)}")
        else:
            out.append(f"{key} = {quoted(value) if isinstance(value, str) else value}")
    return [*out, f"rgba = {[float(c) for c in obstacle.rgba]}", f"friction = {float(obstacle.friction)!r}"]


def _in_words(shapes: tuple[Geometry, ...]) -> Mapping[str, object] | None:
    """The keys of a table for one simple shape; None for what needs a file."""
    if len(shapes) != 1:
        return None
    shape, pose = shapes[0], {"pose": shapes[0].pose}
    if isinstance(shape, HalfSpace):
        return {"half_space": [0.0, 0.0, 1.0]} | pose
    if shape.kind == BOX:
        return {"box": (2.0 * shape.size).tolist()} | pose
    if shape.kind == ELLIPSOID:
        return {"ellipsoid": shape.size.tolist()} | pose
    if shape.kind in (CYLINDER, CONE):
        name = "cylinder" if shape.kind == CYLINDER else "cone"
        return {name: [float(shape.size[0]), 2.0 * float(shape.size[1])]} | pose
    if isinstance(shape, Convex) and len(shape.points) <= 2 and not shape.points[:, :2].any() and shape.radius > 0.0:
        low, high = float(shape.points[:, 2].min()), float(shape.points[:, 2].max())
        if len(shape.points) == 1 and high == 0.0:
            return {"sphere": shape.radius} | pose
        if low == -high:
            return {"capsule": [shape.radius, high - low]} | pose
    return None


def save_geometry(shapes: tuple[Geometry, ...], path: Path) -> None:
    """Write geometry of any kind to an ``.npz`` file."""
    arrays: dict[str, Any] = {"count": len(shapes)}
    for i, shape in enumerate(shapes):
        numbers = [shape.radius, getattr(shape, "spacing", 0.0)]
        arrays |= {f"kind_{i}": type(shape).__name__, f"pose_{i}": shape.pose, f"numbers_{i}": numbers}
        if isinstance(shape, Convex):
            arrays |= {f"core_{i}": shape.kind, f"size_{i}": shape.size, f"faces_{i}": shape.faces}
        if len(shape.points):
            arrays[f"points_{i}"] = shape.points
        if isinstance(shape, Grid):
            arrays[f"samples_{i}"] = shape.samples
        if isinstance(shape, Union):
            arrays |= _union_arrays(shape, i)
    with replace_file(path) as work:
        np.savez_compressed(work, **arrays)


def _union_arrays(shape: Union, i: int) -> dict[str, Any]:
    """The parts of a union, laid end to end."""
    parts = shape.shapes
    return {
        f"parts_{i}": [(p.kind, len(p.points), len(p.faces)) for p in parts],
        f"places_{i}": np.array([p.pose for p in parts]),
        f"sizes_{i}": np.array([[*p.size, p.radius] for p in parts]),
        f"points_{i}": np.concatenate([p.points for p in parts]),
        f"faces_{i}": np.concatenate([p.faces for p in parts]),
    }


def load_geometry(path: Path) -> tuple[Geometry, ...]:
    """Read what `save_geometry` wrote."""
    try:
        with np.load(path, allow_pickle=False) as data:
            return tuple(_load_one(data, i) for i in range(int(data["count"])))
    except FileNotFoundError:
        raise DescriptionError(f"there is no file of geometry {path}") from None
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise DescriptionError(f"{path} holds no geometry that this package wrote: {error}") from error


def _load_one(data: Any, i: int) -> Geometry:
    kind, pose, (radius, spacing) = str(data[f"kind_{i}"]), data[f"pose_{i}"], data[f"numbers_{i}"].tolist()
    if kind == "HalfSpace":
        return HalfSpace(pose, radius)
    if kind == "Cloud":
        return Cloud(data[f"points_{i}"], radius, pose)
    if kind == "Grid":
        return Grid(data[f"samples_{i}"], spacing, pose)
    if kind == "Convex":
        points = data[f"points_{i}"] if f"points_{i}" in data.files else np.zeros((0, 3))
        return Convex(int(data[f"core_{i}"]), data[f"size_{i}"], radius, points, data[f"faces_{i}"], pose)
    if kind != "Union":
        raise ValueError(f"unknown kind {kind!r}")
    counts, sizes, places = data[f"parts_{i}"], data[f"sizes_{i}"], data[f"places_{i}"]
    p = np.split(data[f"points_{i}"], np.cumsum(counts[:-1, 1]))
    f = np.split(data[f"faces_{i}"], np.cumsum(counts[:-1, 2]))
    parts = [
        Convex(int(counts[k, 0]), sizes[k, :3], float(sizes[k, 3]), p[k], f[k], places[k]) for k in range(len(counts))
    ]
    return Union(tuple(parts), pose)
