"""One door for every description: a catalogue name, a file, or ``menagerie:NAME``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..errors import DescriptionError
from . import catalogue
from .combine import subtree, without
from .description import Description
from .paths import Packages
from .srdf import allowed_within, beside, read_srdf
from .urdf import read_urdf

SUFFIXES = (".urdf",)


def load_description(
    name_or_path: str | Path, *, packages: Packages = None, meshes: str = "require", inertias: str = "repair"
) -> Description:
    """The description of a robot or hand.

    *name_or_path* is a name of the catalogue (``"ur5e"``, ``"panda"``, ``"robotiq_2f_85"``; see `catalogue`) or the
    path of a ``.urdf`` file. *packages* are the folders of mesh names, *meshes* is ``"require"`` or ``"ignore"`` for
    missing mesh files, *inertias* ``"repair"``, ``"keep"`` or ``"refuse"`` for values that no body can have. An SRDF
    beside a URDF (same stem, or ``../srdf``) adds the pairs of links that may touch.
    """
    text = str(name_or_path)
    path = Path(name_or_path)
    is_name = isinstance(name_or_path, str) and not path.suffix and "/" not in text
    if is_name and (text in catalogue.entries() or not path.exists()):
        entry = catalogue.entry(text)
        description = read_file(entry.file(), packages=packages, meshes=meshes, inertias=inertias)
        if entry.root:
            description = subtree(description, entry.root)
        if entry.without:
            description = without(description, entry.without)
        return catalogue.applied(entry, description)
    return read_file(path, packages=packages, meshes=meshes, inertias=inertias)


def read_file(path: Path, *, packages: Packages, meshes: str, inertias: str) -> Description:
    """The description in a file, with the allowed pairs of an SRDF beside it."""
    if path.is_dir():
        raise DescriptionError(f"{path} is a folder; expected a file of type {', '.join(SUFFIXES)}")
    suffix = path.suffix.lower()
    if suffix == ".xacro":
        raise DescriptionError(
            f"{path} is a xacro file; expand it first: xacro {path.name} > {path.stem.removesuffix('.urdf')}.urdf"
        )
    if suffix == ".urdf":
        description = read_urdf(path, packages=packages, meshes=meshes, inertias=inertias)
        srdf = beside(description)
        if srdf is not None:
            allowed = allowed_within(read_srdf(srdf), description)
            description = replace(description, allowed_collisions=description.allowed_collisions | allowed)
        return description
    if not path.exists():
        raise DescriptionError(f"{path} does not exist; expected a file, or a name of the catalogue such as 'panda'")
    raise DescriptionError(f"{path}: files of type {suffix!r} are not read; expected one of {', '.join(SUFFIXES)}")
