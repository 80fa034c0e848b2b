"""The catalogue: names of robots and hands whose files come with installed wheels, and what their files lack.

Nothing is fetched, and no wheel's code is run: files are found by the installed distribution's place. Every value that
the catalogue changes against the file is reported as a `Repair` with its source.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import metadata
from math import isfinite
from pathlib import Path
from typing import Any

from ..errors import DescriptionError, MissingDependencyError, unknown_name
from .description import Description, Joint, JointType, Repair

KINDS = ("arm", "hand", "arm-with-hand", "dual-arm", "mobile", "humanoid", "legged", "example")


@dataclass(frozen=True)
class Entry:
    """One robot or hand of the catalogue."""

    name: str
    kind: str
    summary: str
    licence: str
    wheel: str
    path: str
    extra: str = ""
    root: str = ""
    without: str = ""
    like: str = ""
    hand: str = ""
    tool: str = ""
    incomplete: str = ""
    inertias: str = ""
    home: Mapping[str, float] = field(default_factory=dict)
    limits: tuple[Mapping[str, Any], ...] = ()

    @property
    def installed(self) -> bool:
        """Whether the wheel that holds the file is installed."""
        return self._find() is not None

    def _find(self) -> Path | None:
        if not self.wheel:
            path = Path(__file__).parent / self.path
            return path if path.is_file() else None
        try:
            path = Path(str(metadata.distribution(self.wheel).locate_file(self.path)))
        except metadata.PackageNotFoundError:
            return None
        return path if path.is_file() else None

    def file(self) -> Path:
        """The description file; `MissingDependencyError` with the command to install it if the wheel is absent."""
        path = self._find()
        if path is not None:
            return path
        what = f"apprehend[{self.extra}]" if self.extra else self.wheel
        raise MissingDependencyError(
            f"robot {self.name!r} comes with the wheel {self.wheel!r}, which is not installed or lacks {self.path}; "
            f"install it with: pip install '{what}'"
        )


@cache
def entries() -> Mapping[str, Entry]:
    """The catalogue: name → entry, in the order of the file."""
    text = (Path(__file__).parent / "catalogue.toml").read_text(encoding="utf-8")
    table = tomllib.loads(text)
    rows = {name: {**table.get(str(row.get("like")), {}), **row} for name, row in table.items()}
    return {name: Entry(name=name, **{**row, "limits": tuple(row.get("limits", ()))}) for name, row in rows.items()}


def names(kind: str | None = None) -> tuple[str, ...]:
    """Names in the catalogue, all or those of one *kind*."""
    if kind is not None and kind not in KINDS:
        unknown_name("kind", kind, KINDS, "the catalogue")
    return tuple(e.name for e in entries().values() if kind in (None, e.kind))


def entry(name: str) -> Entry:
    """The entry of that *name*, or `UnknownNameError` with what is close."""
    if name not in entries():
        unknown_name("robot", name, entries(), "the catalogue (and no such file exists)")
    return entries()[name]


def applied(entry: Entry, description: Description) -> Description:
    """*description* with the entry's name, home, tool and limits; every changed limit is reported."""
    repairs = list(description.repairs)
    joints = list(description.joints)
    for row in entry.limits:
        pattern = re.compile(str(row["joints"]))
        hits = [i for i, j in enumerate(joints) if j.type is not JointType.FIXED and pattern.fullmatch(j.name)]
        if not hits and not entry.like:
            raise DescriptionError(f"catalogue entry {entry.name!r}: no joint matches {row['joints']!r}")
        said = []
        for i in hits:
            joints[i], changed = _limited(joints[i], row)
            said += changed
        if said:
            where, problem = f"catalogue entry {entry.name!r}", "the file lacks limits, or has placeholders"
            repairs.append(Repair(where, problem, f"took {', '.join(said)} ({row['source']})"))
    home = {n: v for n, v in entry.home.items() if n in {j.name for j in joints}}
    unknown = entry.home.keys() - home.keys()
    if unknown and not entry.like:
        raise DescriptionError(f"catalogue entry {entry.name!r}: home names unknown joints {sorted(unknown)}")
    for what, link in (("tool frame", entry.tool), ("base link of the hand", entry.hand)):
        if link and link not in description.links and not entry.like:
            raise DescriptionError(f"catalogue entry {entry.name!r}: the {what} {link!r} does not exist")
    hand, tool = (link if link in description.links else "" for link in (entry.hand, entry.tool))
    return replace(
        description,
        name=entry.name,
        joints=tuple(joints),
        home={**description.home, **home},
        hand=hand or description.hand,
        tool=tool or description.tool,
        repairs=tuple(repairs),
    )


def _limited(joint: Joint, row: Mapping[str, Any]) -> tuple[Joint, list[str]]:
    """*joint* with the limits of a catalogue row, and what that changes, in words."""
    changes = {k: float(v) for k, v in row.items() if k in ("lower", "upper", "velocity", "acceleration", "effort")}
    said = []
    for kind, value in changes.items():
        old = getattr(joint.limits, kind)
        if value != old:
            instead = f" instead of {old:g}" if isfinite(old) else ""
            said.append(f"{joint.name} {kind} {value:g}{instead}")
    return replace(joint, limits=replace(joint.limits, **changes)), said
