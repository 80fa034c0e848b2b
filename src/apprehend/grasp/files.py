"""Grasps from files: contacts as JSON or CSV."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..bodies import Body
from ..errors import ApprehendError, InputError
from .contact import Contact, ContactModel
from .grasp import Grasp

COLUMNS = ("x", "y", "z", "nx", "ny", "nz")
"""Columns that a CSV file must have, in m; ``friction``, ``model`` and ``torsion`` are optional."""
MOST_BYTES = 20_000_000


def read_grasp(path: str | Path, *, friction: float = 0.6, model: str = "coulomb", torsion: float = 0.0) -> Grasp:
    """The grasp in a file; *friction*, *model* and *torsion* are what rows without their own have.

    JSON: ``{"contacts": [{"position": [x, y, z], "normal": [x, y, z], "friction", "model", "torsion", "tangent"}, …],
    "reference": [x, y, z], "length": r, "body": "mesh.obj", "mass": kg}``, all but the contacts optional; *body* is
    looked up beside the file. CSV: a header with the columns `COLUMNS`. Normals point into the body and are
    normalised. Raises `InputError` that names the file and the contact.
    """
    file = Path(path)
    defaults = {"friction": friction, "model": model, "torsion": torsion}
    try:
        if file.stat().st_size > MOST_BYTES:
            raise InputError(f"{file} has {file.stat().st_size / 1e6:.0f} MB; a list of contacts may have 20 MB")
        text = file.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file} cannot be read: {getattr(error, 'strerror', None) or error}") from error
    suffix = file.suffix.lower()
    if suffix == ".csv":
        return Grasp(_csv(text, file, defaults))
    if suffix != ".json":
        raise InputError(f"{file} is neither .json nor .csv; contacts are read from these")
    try:
        data = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"{file}:{error.lineno}: not JSON: {error.msg}") from error
    if not isinstance(data, dict) or not isinstance(data.get("contacts"), list):
        raise InputError(f'{file}: expected an object with a list "contacts"')
    contacts = [_contact(row, f"{file}: contact {i}", defaults) for i, row in enumerate(data["contacts"])]
    body = None
    if data.get("body") is not None:
        mesh = file.parent / str(data["body"])
        body = Body.load(mesh, mass=data.get("mass"))
    return Grasp(contacts, body, reference=data.get("reference"), length=data.get("length"))


def _csv(text: str, file: Path, defaults: Mapping[str, Any]) -> list[Contact]:
    rows = csv.DictReader(text.splitlines())
    names = [name.strip() for name in rows.fieldnames or ()]
    missing = [c for c in COLUMNS if c not in names]
    if missing:
        raise InputError(f"{file}: no column {', '.join(missing)}; a header {', '.join(COLUMNS)} is needed")
    contacts = []
    for row in rows:
        cells = {(k or "").strip(): (v or "").strip() for k, v in row.items() if not isinstance(v, list)}
        where = f"{file}:{rows.line_num}"
        given: dict[str, Any] = {"model": cells["model"]} if cells.get("model") else {}
        try:
            given["position"] = [float(cells[c]) for c in COLUMNS[:3]]
            given["normal"] = [float(cells[c]) for c in COLUMNS[3:]]
            for name in ("friction", "torsion"):
                if cells.get(name):
                    given[name] = float(cells[name])
        except ValueError as error:
            raise InputError(f"{where}: {error}") from error
        contacts.append(_contact(given, where, defaults))
    return contacts


def _contact(row: Any, where: str, defaults: Mapping[str, Any]) -> Contact:
    if not isinstance(row, dict) or "position" not in row or "normal" not in row:
        raise InputError(f'{where}: expected an object with "position" and "normal"')
    known = {"position", "normal", "tangent", *defaults}
    unknown = sorted(set(row) - known)
    if unknown:
        raise InputError(f"{where}: unknown field {unknown[0]!r}; there are {', '.join(sorted(known))}")
    values = {**defaults, **row}
    try:
        normal = np.asarray(values["normal"], dtype=np.float64)
        length = float(np.linalg.norm(normal))
        tangent = None if row.get("tangent") is None else np.asarray(row["tangent"], dtype=np.float64)
        return Contact(
            np.asarray(values["position"], dtype=np.float64),
            normal / length if length > 0.0 else normal,
            float(values["friction"]),
            ContactModel(values["model"]) if values["model"] in {m.value for m in ContactModel} else values["model"],
            float(values["torsion"]),
            tangent,
        )
    except (TypeError, ValueError) as error:
        if isinstance(error, ApprehendError):
            raise InputError(f"{where}: {error}") from error
        raise InputError(f"{where}: {error}") from error
