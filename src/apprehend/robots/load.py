"""One door for every description: a catalogue name, a file, or ``menagerie:NAME``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import DescriptionError, expect_path
from . import catalogue
from .combine import subtree, without
from .description import Description
from .markup import Document, local, read_text
from .menagerie import PREFIX, menagerie_file
from .mjcf import read_mjcf
from .paths import Packages
from .srdf import allowed_within, beside, read_srdf
from .table_files import read_table
from .urdf import read_urdf

SUFFIXES = (".urdf", ".xml", ".mjcf", ".toml")


def load_description(
    name_or_path: str | Path,
    *,
    packages: Packages = None,
    meshes: str = "require",
    inertias: str = "repair",
    loops: str = "refuse",
) -> Description:
    """The description of a robot or hand.

    *name_or_path* is a name of the catalogue (``"ur5e"``, ``"panda"``, ``"robotiq_2f_85"``; see `catalogue`),
    ``"menagerie:NAME"``, or the path of a file: URDF (``.urdf``), MJCF (``.xml``), DH table or twists (``.toml``).
    *packages* are the folders of mesh names; *meshes* is ``"require"`` or ``"ignore"`` for missing mesh files;
    *inertias* is ``"repair"``, ``"keep"`` or ``"refuse"`` for values that no body can have; *loops* is ``"refuse"`` or
    ``"cut"`` for closed chains. An SRDF beside a URDF (same stem, or ``../srdf``) adds the pairs of links that may
    touch, and the posture named "home".
    """
    expect_path(name_or_path, "name_or_path", "a name of the catalogue, or the path of a description file")
    text = str(name_or_path)
    path = Path(name_or_path)
    options = Options(packages, meshes, inertias, loops)
    if text.startswith(PREFIX):
        return replace(read_file(menagerie_file(text[len(PREFIX) :]), options), name=text[len(PREFIX) :])
    is_name = isinstance(name_or_path, str) and not path.suffix and "/" not in text
    if is_name and (text in catalogue.entries() or not path.exists()):
        entry = catalogue.entry(text)
        if entry.inertias:
            options = replace(options, inertias=entry.inertias)
        description = read_file(entry.file(), options)
        if entry.root:
            description = subtree(description, entry.root)
        if entry.without:
            description = without(description, entry.without)
        return catalogue.applied(entry, description)
    return read_file(path, options)


@dataclass(frozen=True)
class Options:
    """How to read: see `load_description`."""

    packages: Packages = None
    meshes: str = "require"
    inertias: str = "repair"
    loops: str = "refuse"


def read_file(path: Path, options: Options) -> Description:
    """The description in a file, by its suffix; an ``.xml`` file may hold MJCF or URDF."""
    if path.is_dir():
        raise DescriptionError(f"{path} is a folder; expected a file of type {', '.join(SUFFIXES)}")
    suffix = path.suffix.lower()
    if suffix == ".xacro":
        stem = path.stem.removesuffix(".urdf")
        raise DescriptionError(f"{path} is a xacro file; expand it first: xacro {path.name} > {stem}.urdf")
    if suffix == ".xml" and local(Document(read_text(path), path).root) == "robot":
        suffix = ".urdf"
    if suffix == ".urdf":
        return _with_srdf(
            read_urdf(path, packages=options.packages, meshes=options.meshes, inertias=options.inertias,
                      loops=options.loops)
        )  # fmt: skip
    if suffix in (".xml", ".mjcf"):
        return read_mjcf(path, packages=options.packages, meshes=options.meshes, loops=options.loops)
    if suffix == ".toml":
        return read_table(path, inertias=options.inertias)
    if not path.exists():
        raise DescriptionError(f"{path} does not exist; expected a file, or a name of the catalogue such as 'panda'")
    raise DescriptionError(f"{path}: files of type {suffix!r} are not read; expected one of {', '.join(SUFFIXES)}")


def _with_srdf(description: Description) -> Description:
    """*description* with what an SRDF beside its file adds: pairs that may touch, and the posture named home."""
    srdf = beside(description)
    if srdf is None:
        return description
    semantics = read_srdf(srdf)
    joints = {j.name for j in description.joints}
    home = {n: v for n, v in semantics.postures.get("home", {}).items() if n in joints}
    allowed = description.allowed_collisions | allowed_within(semantics, description)
    return replace(description, home=home, allowed_collisions=allowed)
