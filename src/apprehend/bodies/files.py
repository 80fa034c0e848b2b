"""Models on disk: one ``.npz`` with a kind, read without executing anything that is in it."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError, MeshError
from ..files import replace_file


def write(path: str | Path, kind: str, **arrays: Any) -> Path:
    """Write *arrays* under their names, with the *kind* of the model, as one compressed ``.npz``."""
    target = Path(path)
    if target.suffix.lower() != ".npz":
        raise InputError(f"{target}: the ending {target.suffix!r} is none of a {kind}; expected .npz")
    with replace_file(target) as work, work.open("wb") as stream:
        np.savez_compressed(stream, **{"kind": np.array(kind), **arrays})
    return target


def read(path: str | Path, kind: str, *names: str) -> dict[str, Any]:
    """The arrays of a file that `write` wrote; it must hold a model of this *kind*, and arrays of these *names*."""
    target = Path(path)
    try:
        with np.load(target, allow_pickle=False) as data:
            found = {name: data[name] for name in data.files}
    except FileNotFoundError:
        raise InputError(f"{target} does not exist") from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{target} cannot be read as a model: {error}") from error
    if str(found.get("kind")) != kind:
        raise InputError(
            f"{target} holds {str(found['kind']) if 'kind' in found else 'no model'!r}; expected a {kind!r}"
        )
    missing = [name for name in names if name not in found]
    if missing:
        raise InputError(f"{target} lacks {', '.join(map(repr, missing))}: the file is damaged")
    return {k: v[()] if v.ndim == 0 else v for k, v in found.items()}


def write_mesh(path: str | Path, vertices: Array, faces: IntArray) -> Path:
    """Write a mesh in metres (``.obj``, ``.stl``, ``.ply``, ``.glb`` or ``.off``), under a temporary name first."""
    import trimesh

    from .load import FORMATS

    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise MeshError(f"{path}: the ending {path.suffix!r} is not a mesh format; expected {', '.join(FORMATS)}")
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    options: dict[str, Any] = {"digits": 9} if path.suffix.lower() == ".obj" else {}
    data: Any = mesh.export(file_type=path.suffix.lower()[1:], **options)
    with replace_file(path) as work:
        work.write_bytes(data.encode() if isinstance(data, str) else data)
    return path
