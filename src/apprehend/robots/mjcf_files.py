"""Which files an MJCF model reads, checked before the simulator opens any of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..errors import DescriptionError
from .markup import Document, local, read_text
from .paths import MeshPaths

MAX_FILES = 200
"""Most files that one model may include."""
MAX_COPIES = 10_000
"""Most copies that nested replications may make."""
MAX_PIXELS = 50_000_000
"""Most entries of a height field or a texture."""


def check_files(path: Path, paths: MeshPaths) -> Document:
    """Parse *path* and all that it includes; refuse entities, circles, and files outside the allowed folders.

    Returns the parsed main file. Raises `DescriptionError` with file and line.
    """
    main = Document(read_text(path), path)
    if local(main.root) != "mujoco":
        main.fail(main.root, f"expected <mujoco> as the outermost element of an MJCF, found <{local(main.root)}>")
    folders = {path.parent}
    documents: list[Document] = []
    _collect(main, path.parent, (path.resolve(),), paths, documents)
    for document in documents:
        for element in document.root.iter("compiler"):
            for key in ("meshdir", "texturedir", "assetdir"):
                if element.get(key):
                    folders.add(path.parent / element.get(key))
    for document in documents:
        for element in document.root.iter():
            for key, name in element.attrib.items():
                if key.startswith("file") and local(element) != "include" and name:
                    _check(document, element, str(name), [f / str(name) for f in folders], paths)
    return main


def _collect(
    document: Document, folder: Path, chain: tuple[Path, ...], paths: MeshPaths, documents: list[Document]
) -> None:
    documents.append(document)
    if len(documents) > MAX_FILES:
        raise DescriptionError(f"{chain[0]}: includes more than {MAX_FILES} files")
    _bounded(document)
    for element in document.root.iter("include", "model"):
        name = element.get("file")
        if name is None:
            continue
        candidates = [folder / name, document.source.parent / name]
        _check(document, element, name, candidates, paths)
        found = next((c for c in candidates if c.is_file()), None)
        if found is None:
            document.fail(element, f"includes {name!r}, which does not exist (looked for {candidates[0]})")
        if found.resolve() in chain:
            document.fail(element, f"includes {name!r}, which includes this file again")
        _collect(Document(read_text(found), found), folder, (*chain, found.resolve()), paths, documents)


def _bounded(document: Document) -> None:
    """Refuse models that a few bytes make huge."""
    for element in document.root.iter("replicate", "composite", "flexcomp", "hfield", "texture"):
        size, at = 1.0, element
        while at is not None:
            for key in ("count", "nrow", "ncol", "width", "height"):
                for word in (at.get(key) or "").split():
                    try:
                        size *= max(1.0, float(word))
                    except ValueError:
                        document.fail(at, f"<{local(at)}>: {key}={at.get(key)!r} is not numbers")
            at = at.getparent()
        limit = MAX_PIXELS if local(element) in ("hfield", "texture") else MAX_COPIES
        if size > limit:
            document.fail(element, f"<{local(element)}> makes {size:.3g} of one; a description may have {limit}")


def _check(document: Document, element: Any, name: str, candidates: list[Path], paths: MeshPaths) -> None:
    real = [c.resolve() for c in candidates]
    inside = [paths.may_read(r) for r in real]
    for path, allowed in zip(real, inside, strict=True):
        if not allowed and (path.exists() or not any(inside)):
            document.fail(
                element,
                f"file {name!r} is {path}, outside the allowed folders "
                f"({', '.join(str(a) for a in paths.allowed)}); refused. If it is meant, pass packages=its folder",
            )
