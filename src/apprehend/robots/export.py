"""Descriptions written as files: URDF (with an SRDF beside it) and MJCF, whole or not at all.

What a format cannot say is never dropped in silence: `save_urdf` and `save_mjcf` return it as sentences.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from ..arrays import choice
from ..errors import InputError
from ..files import replace_file
from .description import Description
from .dh import DHChain
from .export_mjcf import mjcf_text
from .export_urdf import srdf_text, urdf_text
from .meshes import read_mesh

MESHES = ("copy", "refer", "omit")


def save_urdf(description: Description, path: str | Path, meshes: str = "copy") -> tuple[str, ...]:
    """Write *description* as URDF, and its allowed pairs and home posture as SRDF beside it.

    *meshes*: ``"copy"`` the files into a folder ``meshes`` beside *path*, ``"refer"`` to them where they are, or
    ``"omit"`` them. Returns what URDF cannot say, one sentence each.
    """
    path = _checked(path, meshes, ".urdf")
    names = _Meshes(path, meshes, (".dae", ".obj", ".stl", ".ply"))
    text, lost = urdf_text(description, names.name)
    names.write()
    _write(path, text.encode())
    extra = srdf_text(description)
    if extra:
        _write(path.with_suffix(".srdf"), extra.encode())
    return lost


def save_mjcf(description: Description, path: str | Path, meshes: str = "copy") -> tuple[str, ...]:
    """Write *description* as MJCF. Meshes of types that MuJoCo does not read are converted to OBJ when copied.

    *meshes* as in `save_urdf`. Returns what MJCF cannot say, one sentence each.
    """
    path = _checked(path, meshes, ".xml")
    names = _Meshes(path, meshes, (".obj", ".stl"), strict_stl=True)
    text, lost = mjcf_text(description, names.name)
    names.write()
    _write(path, text.encode())
    return lost


def save_dh(table: DHChain, path: str | Path) -> None:
    """Write a DH table as TOML, in m and rad; `read_dh` reads it back exactly (inertias are not part of it,
    and a home posture only if it names every joint).
    """
    path = _checked(path, "omit", ".toml")
    bounds = ("lower", "upper", "velocity", "acceleration", "effort")
    columns = ["name", "type", "theta", "d", "a", "alpha", "flip", *bounds]
    resting = all(name in table.home for name in table.names)
    columns += ["home"] if resting else []
    rows = []
    for i, name in enumerate(table.names):
        values = [table.theta[i], table.d[i], table.a[i], table.alpha[i]]
        limits = [getattr(table.limits[i], bound) for bound in bounds]
        numbers = [*map(_number, values), str(table.flip[i]).lower(), *map(_number, limits)]
        numbers += [_number(table.home[name])] if resting else []
        rows.append(f"  [{', '.join([_quoted(name), _quoted(table.types[i].value), *numbers])}],")
    lines = ['kind = "dh"', f"name = {_quoted(table.name)}", f"convention = {_quoted(table.convention)}"]
    lines += [f"columns = [{', '.join(map(_quoted, columns))}]", "rows = [", *rows, "]"]
    for what, T in (("base", table.base), ("tool", table.tool)):
        if not np.array_equal(T, np.eye(4)):
            lines.append(f"{what} = [{', '.join(str([float(x) for x in row]) for row in T)}]")
    _write(path, ("\n".join(lines) + "\n").encode())


def _number(value: float) -> str:
    return repr(float(value))


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _checked(path: str | Path, meshes: str, suffix: str) -> Path:
    choice(meshes, "meshes", MESHES)
    path = Path(path)
    if path.suffix.lower() != suffix:
        raise InputError(f"path is {str(path)!r}; expected a name that ends in {suffix}")
    return path


class _Meshes:
    """Names of mesh files in an exported description, and the copies that the names demand."""

    def __init__(self, path: Path, how: str, readable: tuple[str, ...], *, strict_stl: bool = False) -> None:
        self.folder = path.parent / "meshes"
        self.how = how
        self.readable = readable
        self.strict_stl = strict_stl
        self.copies: dict[Path, str] = {}

    def name(self, mesh: Path) -> str | None:
        """The name under which the description refers to *mesh*; None to leave the shape out."""
        if self.how == "omit":
            return None
        if self.how == "refer":
            return str(mesh.resolve())
        if mesh not in self.copies:
            suffix = mesh.suffix.lower()
            convert = suffix not in self.readable or (suffix == ".stl" and self.strict_stl and not _binary(mesh))
            stem, ending, number = mesh.stem, ".obj" if convert else suffix, 1
            while f"{stem}{ending}" in self.copies.values():
                number += 1
                stem = f"{mesh.stem}_{number}"
            self.copies[mesh] = f"{stem}{ending}"
        return f"meshes/{self.copies[mesh]}"

    def write(self) -> None:
        """Copy or convert the files."""
        if self.copies:
            self.folder.mkdir(parents=True, exist_ok=True)
        for mesh, name in self.copies.items():
            target = self.folder / name
            if target.exists() and target.samefile(mesh):
                continue
            if target.suffix == mesh.suffix.lower():
                shutil.copyfile(mesh, target)
            else:
                vertices, faces = read_mesh(mesh)
                lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
                lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
                _write(target, ("\n".join(lines) + "\n").encode())


def _write(path: Path, data: bytes) -> None:
    with replace_file(path) as work:
        work.write_bytes(data)


def _binary(stl: Path) -> bool:
    """Whether an STL file is binary: its size is what its count of faces demands, and MuJoCo reads that many."""
    with stl.open("rb") as file:
        head = file.read(84)
    count = int.from_bytes(head[80:84], "little") if len(head) == 84 else 0
    return stl.stat().st_size == 84 + 50 * count and count <= 200_000
