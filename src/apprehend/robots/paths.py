"""Where mesh files lie: ``package://``, ``file://``, absolute and relative names, kept inside the allowed folders.

Allowed are the package that the description belongs to (the nearest folder above it with a ``package.xml``; else its
own folder, and the one above where its own is named like a part of a package: ``urdf``, ``robots``, …), the folders
of packages that its names refer to, and every folder that the caller passes as ``packages``.
"""

from __future__ import annotations

import os
import sysconfig
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from urllib.parse import unquote

from ..errors import DescriptionError, MeshError

Packages = Mapping[str, str | Path] | Sequence[str | Path] | str | Path | None
"""``{package name: its folder}``, or folders that hold packages or meshes."""

MESH_SUFFIXES = (".dae", ".glb", ".gltf", ".obj", ".off", ".ply", ".stl")
_SUBFOLDERS = {"urdf", "robots", "robot", "models", "model", "mjcf", "xml", "description", "xacro", "sdf"}


@cache
def shared_folders() -> tuple[Path, ...]:
    """Folders in which installed wheels keep packages named by ``package://``."""
    site = [Path(p) for p in {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")} if p]
    candidates = [s / "cmeel.prefix" / "share" for s in site] + site
    return tuple(p for p in candidates if p.is_dir())


def _environment_folders() -> list[Path]:
    folders = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
    for variable in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"):
        folders += [Path(p) / "share" for p in os.environ.get(variable, "").split(os.pathsep) if p]
    return folders


def _package_root(folder: Path) -> Path:
    """The folder that a description in *folder* may reach into."""
    for candidate in (folder, *list(folder.parents)[:3]):
        if (candidate / "package.xml").is_file():
            return candidate
    for site in shared_folders():
        if folder.is_relative_to(site) and folder != site:  # what comes with a wheel stays within that wheel
            return site / folder.relative_to(site).parts[0]
    above = folder.parent
    return above if folder.name.lower() in _SUBFOLDERS and above != above.parent and above != Path.home() else folder


class MeshPaths:
    """Resolves the mesh names of one description file."""

    def __init__(self, source: Path, packages: Packages) -> None:
        self.folder = source.resolve().parent
        self.named: dict[str, Path] = {}
        self._roots: dict[str, list[Path]] = {}
        self._folders: dict[Path, Path] = {}
        self.guessed: dict[str, Path] = {}
        """Packages that were not found by name, and the folder that was taken for them."""
        self.folders: list[Path] = []
        if isinstance(packages, Mapping):
            self.named = {str(k): Path(v).resolve() for k, v in packages.items()}
        elif isinstance(packages, (str, Path)):
            self.folders = [Path(packages).resolve()]
        elif packages is not None:
            self.folders = [Path(p).resolve() for p in packages]
        self.allowed = [_package_root(self.folder), *self.folders, *self.named.values()]

    def resolve(self, name: str, where: str) -> Path:
        """The existing file that *name* means; *where* is the place in the description, for messages."""
        scheme, _, rest = name.partition("://") if "://" in name else ("", "", name)
        rest = unquote(rest) if scheme else rest
        if scheme in ("package", "model"):
            package, _, inner = rest.lstrip("/").partition("/")
            roots = self._package_folders(package)
            candidates = [(root / inner, (root, *self.allowed)) for root in roots]
            if not roots and (self.allowed[0] / inner).is_file():  # the package goes by another name here
                self.guessed.setdefault(package, self.allowed[0])
                candidates = [(self.allowed[0] / inner, tuple(self.allowed))]
        elif scheme in ("", "file"):
            inner, package = rest, ""
            allowed = (*self.allowed, *shared_folders())
            candidates = [(base / rest, allowed) for base in (self.folder, *self.folders)]
        else:
            raise DescriptionError(
                f"{where}: mesh {name!r}: the scheme {scheme}:// is not read; expected package:// or a file"
            )
        candidates += [(folder / Path(inner).name, tuple(self.allowed)) for folder in self.folders]
        if not candidates:
            raise MeshError(
                f"{where}: mesh {name!r}: no folder of the package {package!r} was found; "
                f"pass packages={{{package!r}: folder}}, or meshes='ignore' to load without geometry"
            )
        refused: Path | None = None
        for path, allowed in candidates:
            real = self._real(path)
            if not any(real.is_relative_to(a) for a in allowed):
                refused = refused or real
            elif real.is_file():
                return self._readable(real, name, where)
        if refused is not None:
            raise DescriptionError(
                f"{where}: mesh {name!r} is {refused}, outside the allowed folders "
                f"({', '.join(str(a) for a in candidates[0][1])}); refused. "
                "If it is meant, pass packages=folder of the meshes"
            )
        tried = ", ".join(dict.fromkeys(str(path.resolve()) for path, _ in candidates))
        raise MeshError(
            f"{where}: mesh {name!r} does not exist (looked for {tried}); "
            "pass packages=folder of the meshes, or meshes='ignore' to load without geometry"
        )

    def may_read(self, path: Path) -> bool:
        """Whether the resolved *path* lies in an allowed folder."""
        return any(path.is_relative_to(a) for a in self.allowed)

    def _readable(self, path: Path, name: str, where: str) -> Path:
        if path.suffix.lower() not in MESH_SUFFIXES:
            raise MeshError(f"{where}: mesh {name!r}: files of type {path.suffix or 'none'!r} are not read; "
                            f"expected one of {', '.join(MESH_SUFFIXES)}")  # fmt: skip
        return path

    def _real(self, path: Path) -> Path:
        """*path* without symbolic links and ``..``; folders are resolved once."""
        folder = self._folders.get(path.parent)
        if folder is None:
            folder = self._folders[path.parent] = path.parent.resolve()
        real = folder / path.name
        return real.resolve() if path.name == ".." or real.is_symlink() else real

    def _package_folders(self, package: str) -> list[Path]:
        if package not in self._roots:
            self._roots[package] = self._find_package(package)
        return self._roots[package]

    def _find_package(self, package: str) -> list[Path]:
        if package in self.named:
            return [self.named[package]]
        candidates = [f / package for f in self.folders] + [f for f in self.folders if f.name == package]
        for above in (self.folder, *self.folder.parents):
            if above.name == package:
                candidates.append(above)
            elif (above / package).is_dir() and above != above.parent:
                candidates.append(above / package)
        candidates += [f / package for f in (*_environment_folders(), *shared_folders())]
        found: list[Path] = []
        for candidate in candidates:
            if package not in ("", ".", "..") and candidate.is_dir() and candidate.resolve() not in found:
                found.append(candidate.resolve())
        return found
