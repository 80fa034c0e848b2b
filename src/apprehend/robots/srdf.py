"""SRDF: which pairs of links may touch, and named postures, for the URDF of the same robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from .description import Description
from .markup import Document, local, plain_children, read_text


@dataclass(frozen=True)
class Semantics:
    """What an SRDF adds: *allowed* pairs of links, and *postures* (name → joint → value)."""

    allowed: frozenset[frozenset[str]]
    postures: Mapping[str, Mapping[str, float]]
    source: Path


def read_srdf(path: str | Path) -> Semantics:
    """Read an SRDF file; raises `DescriptionError` with file and line."""
    path = Path(path)
    return _read(Document(read_text(path), path), path)


def parse_srdf(text: str | bytes, source: str | Path = "srdf") -> Semantics:
    """Read SRDF from a text; *source* is what errors call it."""
    return _read(Document(text.encode() if isinstance(text, str) else text, source), Path(source))


def _read(doc: Document, path: Path) -> Semantics:
    if local(doc.root) != "robot":
        doc.fail(doc.root, f"expected <robot> as the outermost element of an SRDF, found <{local(doc.root)}>")
    pairs = set()
    for element in plain_children(doc.root, "disable_collisions"):
        pair = frozenset(doc.attribute(element, key, "disable_collisions") for key in ("link1", "link2"))
        if len(pair) == 2:
            pairs.add(pair)
    postures: dict[str, dict[str, float]] = {}
    for state in plain_children(doc.root, "group_state"):
        name = doc.attribute(state, "name", "group_state")
        posture = postures.setdefault(name, {})
        for joint in plain_children(state, "joint"):
            words = (joint.get("value") or "").split()
            if len(words) == 1:  # several numbers are a floating base, which is not part of a posture here
                posture[doc.attribute(joint, "name", name)] = doc.number(joint, "value", f"posture {name!r}")
    return Semantics(frozenset(pairs), postures, path)


def beside(description: Description) -> Path | None:
    """The SRDF that belongs to a URDF file: of the same stem or robot name, in its folder or in ``../srdf``."""
    if description.source is None:
        return None
    folder = description.source.parent
    for stem in (description.source.stem, description.name):
        for candidate in (folder / f"{stem}.srdf", folder.parent / "srdf" / f"{stem}.srdf"):
            if candidate.is_file():
                return candidate
    return None


def allowed_within(semantics: Semantics, description: Description) -> frozenset[frozenset[str]]:
    """The allowed pairs whose links both exist in *description*."""
    return frozenset(p for p in semantics.allowed if p <= description.links.keys())
