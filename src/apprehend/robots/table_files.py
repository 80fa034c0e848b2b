"""Chains written as tables in TOML: Denavit–Hartenberg (``kind = "dh"``) and twists (``kind = "twists"``).

A DH file::

    kind = "dh"
    name = "armar1"
    convention = "standard"              # or "modified"
    units = { length = "mm", angle = "deg" }      # default m and rad
    columns = ["theta", "d", "a", "alpha"]        # in any order; further: name, type, flip, lower, upper, velocity, …
    rows = [[0, 0, 30, -90], …]
    base = { xyz = [0, 0, 1], rpy = [0, 0, 0] }   # optional; also tool
    # or, instead of columns and rows, tables [[joint]] with these keys, and mass, com, inertia

A file of twists has a home pose and, for each joint, its twist (v, ω), linear part first, in the base frame or
(``frame = "body"``) in the end frame: T(q) = exp(ξ₁q₁) ⋯ exp(ξₙqₙ) T(0) (G 1.5).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Never

import numpy as np

from ..arrays import Array, choice
from ..errors import DescriptionError, suggestion
from .description import Description, Inertial, Joint, JointLimits, JointType, Link, Repair
from .dh import CONVENTIONS, DHChain
from .inertia import check, nearest
from .markup import read_text
from .poses import from_rpy, shift
from .tree import check_limits

DH_COLUMNS = ("theta", "d", "a", "alpha")
_LIMITS = ("lower", "upper", "velocity", "acceleration", "effort")
_DYNAMICS = ("damping", "friction", "armature")
_OPTIONAL = ("name", "type", "home", *_LIMITS)
_TYPES = {"revolute": JointType.REVOLUTE, "prismatic": JointType.PRISMATIC, "continuous": JointType.CONTINUOUS}
_LENGTHS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2}
_ANGLES = {"rad": 1.0, "deg": math.pi / 180.0}


def read_table(path: str | Path, *, inertias: str = "repair") -> Description:
    """Read a TOML file of either kind; raises `DescriptionError` with the file, the joint and the key.

    *inertias* that no body can have are ``"repair"``-ed, ``"keep"``-ed (both are reported), or ``"refuse"``-d.
    """
    choice(inertias, "inertias", ("repair", "keep", "refuse"))
    path = Path(path)
    data = _parsed(path)
    if data.get("kind") == "twists":
        return _Table(path, data).twists()
    table = _Table(path, data, inertias)
    description = table.dh().description()
    return replace(description, source=path, repairs=tuple(table.repairs))


def read_dh(path: str | Path) -> DHChain:
    """Read a TOML file with ``kind = "dh"`` as the table that it is."""
    path = Path(path)
    return _Table(path, _parsed(path)).dh()


def _parsed(path: Path) -> Mapping[str, Any]:
    try:
        data = tomllib.loads(read_text(path).decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DescriptionError(f"{path}: not TOML: {error}") from None
    if data.get("kind") not in ("dh", "twists"):
        raise DescriptionError(f"{path}: kind is {data.get('kind')!r}; expected 'dh' or 'twists'")
    return data


class _Table:
    def __init__(self, path: Path, data: Mapping[str, Any], inertias: str = "repair") -> None:
        self.inertias = inertias
        self.repairs: list[Repair] = []
        self.path = path
        self.data = data
        units = data.get("units", {})
        self.keys(units, "units", ("length", "angle"))
        self.length = self.one_of(units.get("length", "m"), "units.length", _LENGTHS)
        self.angle = self.one_of(units.get("angle", "rad"), "units.angle", _ANGLES)

    def fail(self, message: str) -> Never:
        raise DescriptionError(f"{self.path}: {message}")

    def keys(self, table: Any, where: str, allowed: Sequence[str], required: Sequence[str] = ()) -> None:
        """Check the keys of a table."""
        if not isinstance(table, Mapping):
            self.fail(f"{where} is {table!r}; expected a table with {', '.join(allowed)}")
        for key in table:
            if key not in allowed:
                self.fail(f"{where}: {key!r} is unknown; expected {', '.join(allowed)}.{suggestion(key, allowed)}")
        for key in required:
            if key not in table:
                self.fail(f"{where} lacks {key!r}; it needs {', '.join(required)}")

    def one_of(self, value: Any, where: str, table: Mapping[str, Any]) -> Any:
        if value not in table:
            self.fail(f"{where} is {value!r}; expected one of {', '.join(map(repr, table))}")
        return table[value]

    def number(self, value: Any, where: str) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            self.fail(f"{where} is {value!r}; expected a finite number")
        return float(value)

    def vector(self, value: Any, where: str, n: int) -> Array:
        if not isinstance(value, list) or len(value) != n:
            self.fail(f"{where} is {value!r}; expected {n} numbers")
        return np.array([self.number(x, f"{where}[{i}]") for i, x in enumerate(value)])

    def pose(self, value: Any, where: str) -> Array:
        """A pose ``{xyz, rpy}`` in the file's units, or a 4×4 matrix whose lengths are."""
        if value is None:
            return np.eye(4)
        if isinstance(value, list):
            if len(value) != 4:
                self.fail(f"{where} has {len(value)} rows; expected 4, or {{ xyz, rpy }}")
            T = np.stack([self.vector(row, f"{where}[{i}]", 4) for i, row in enumerate(value)])
            R = T[:3, :3]
            if np.abs(R.T @ R - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0 or (T[3] != [0, 0, 0, 1]).any():
                self.fail(f"{where} is not a homogeneous transform with a rotation")
            T[:3, 3] *= self.length
            return T
        self.keys(value, where, ("xyz", "rpy"))
        xyz = self.vector(value.get("xyz", [0.0, 0.0, 0.0]), f"{where}.xyz", 3)
        rpy = self.vector(value.get("rpy", [0.0, 0.0, 0.0]), f"{where}.rpy", 3)
        return from_rpy(self.length * xyz, self.angle * rpy)

    def rows(self, columns: Sequence[str], optional: Sequence[str]) -> list[Mapping[str, Any]]:
        """The rows as tables, from ``columns`` and ``rows`` or from ``[[joint]]``."""
        if "joint" in self.data:
            tables = self.data["joint"]
            if "columns" in self.data or "rows" in self.data:
                self.fail("has both [[joint]] tables and columns with rows; expected one of them")
            if not isinstance(tables, list):
                self.fail("joint is not a list of tables; write [[joint]]")
            for i, table in enumerate(tables):
                self.keys(table, f"joint {i + 1}", (*columns, *optional), columns)
            return list(tables)
        names, rows = self.data.get("columns"), self.data.get("rows")
        if not isinstance(names, list) or not isinstance(rows, list):
            self.fail("needs columns = [...] and rows = [[...], ...], or [[joint]] tables")
        missing = [c for c in columns if c not in names]
        if missing:
            self.fail(f"columns {names} lack {', '.join(map(repr, missing))}; a row needs {', '.join(columns)}")
        for column in names:
            if column not in (*columns, *optional):
                self.fail(f"column {column!r} is unknown; expected {', '.join((*columns, *optional))}."
                          f"{suggestion(str(column), (*columns, *optional))}")  # fmt: skip
        if len(set(names)) != len(names):
            self.fail(f"columns {names} name one twice")
        for i, row in enumerate(rows):
            if not isinstance(row, list) or len(row) != len(names):
                self.fail(f"row {i + 1} is {row!r}; expected {len(names)} values for {', '.join(names)}")
        return [dict(zip(names, row, strict=True)) for row in rows]

    def joint(self, row: Mapping[str, Any], i: int) -> tuple[str, JointType, JointLimits]:
        """Name, type and limits of row *i*."""
        name = row.get("name", f"joint{i + 1}")
        if not isinstance(name, str) or not name:
            self.fail(f"joint {i + 1}: name is {name!r}; expected text")
        type_: JointType = self.one_of(row.get("type", "revolute"), f"joint {name!r}: type", _TYPES)
        unit = self.length if type_ is JointType.PRISMATIC else self.angle
        given = {}
        for key in _LIMITS:
            if key in row:
                scale = 1.0 if key == "effort" else unit
                value = row[key]
                endless = isinstance(value, float) and math.isinf(value)
                given[key] = value if endless else scale * self.number(value, f"joint {name!r}: {key}")
        limits = JointLimits(**given)
        check_limits(limits, name, str(self.path))
        return name, type_, limits

    def homes(
        self, rows: Sequence[Mapping[str, Any]], names: Sequence[str], types: Sequence[JointType]
    ) -> dict[str, float]:
        found = {}
        for row, name, type_ in zip(rows, names, types, strict=True):
            if "home" in row:
                unit = self.length if type_ is JointType.PRISMATIC else self.angle
                found[name] = unit * self.number(row["home"], f"joint {name!r}: home")
        return found

    def unique(self, names: Sequence[str]) -> None:
        for i, name in enumerate(names):
            if name in names[:i]:
                self.fail(f"two joints are named {name!r}")
        if not names:
            self.fail("there is no joint; a chain needs at least one")

    def dh(self) -> DHChain:
        """The DH table of the file."""
        if self.data.get("kind") != "dh":
            self.fail(f"kind is {self.data.get('kind')!r}; expected 'dh'")
        self.keys(self.data, "the file", ("kind", "name", "convention", "units", "columns", "rows", "joint", "base",
                                          "tool", "source"), ("convention",))  # fmt: skip
        convention = self.one_of(self.data["convention"], "convention", {c: c for c in CONVENTIONS})
        rows = self.rows(DH_COLUMNS, (*_OPTIONAL, *_DYNAMICS, "flip", "mass", "com", "inertia"))
        joints = [self.joint(row, i) for i, row in enumerate(rows)]
        names = tuple(j[0] for j in joints)
        self.unique(names)
        scale = {"theta": self.angle, "alpha": self.angle, "d": self.length, "a": self.length}
        column = {
            key: np.array(
                [scale[key] * self.number(r[key], f"joint {n!r}: {key}") for r, n in zip(rows, names, strict=True)]
            )
            for key in DH_COLUMNS
        }
        flips = []
        for row, name in zip(rows, names, strict=True):
            if not isinstance(row.get("flip", False), bool):
                self.fail(f"joint {name!r}: flip is {row['flip']!r}; expected true or false")
            flips.append(bool(row.get("flip", False)))
        return DHChain(
            convention, names, tuple(j[1] for j in joints), column["theta"], column["d"], column["a"], column["alpha"],
            self.pose(self.data.get("base"), "base"), self.pose(self.data.get("tool"), "tool"), tuple(flips),
            tuple(j[2] for j in joints), tuple(self.inertial(r, n) for r, n in zip(rows, names, strict=True)),
            str(self.data.get("name", self.path.stem)), self.homes(rows, names, [j[1] for j in joints]),
            tuple({k: self.number(r[k], f"joint {n!r}: {k}") for k in _DYNAMICS if k in r}
                  for r, n in zip(rows, names, strict=True)),
        )  # fmt: skip

    def inertial(self, row: Mapping[str, Any], name: str) -> Inertial | None:
        """Mass (kg), centre (in the file's unit) and inertia (kg m²: xx, yy, zz, xy, xz, yz) in the link's frame."""
        if "mass" not in row:
            if "inertia" in row or "com" in row:
                self.fail(f"joint {name!r} has com or inertia but no mass")
            return None
        mass = self.number(row["mass"], f"joint {name!r}: mass")
        if mass < 0.0:
            self.fail(f"joint {name!r}: mass is {mass:g} kg; expected zero or more")
        com = self.length * self.vector(row.get("com", [0.0, 0.0, 0.0]), f"joint {name!r}: com", 3)
        given = self.vector(row.get("inertia", [0.0] * 6), f"joint {name!r}: inertia", 6)
        xx, yy, zz, xy, xz, yz = given
        inertial = Inertial(mass, com, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        problem = check(inertial)
        if problem and self.inertias == "refuse":
            self.fail(f"joint {name!r}: {problem}")
        if problem:
            kept = self.inertias == "keep"
            remedy = "kept it, as asked" if kept else "took the nearest that a rigid body can have"
            self.repairs.append(Repair(self.path.name, f"joint {name!r}: {problem}", remedy))
            return inertial if kept else nearest(inertial)
        return inertial

    def twists(self) -> Description:
        """The description of a product of exponentials."""
        self.keys(self.data, "the file", ("kind", "name", "frame", "units", "home", "joint", "columns", "rows",
                                          "source"), ("home",))  # fmt: skip
        home = self.pose(self.data["home"], "home")
        in_body = self.one_of(self.data.get("frame", "base"), "frame", {"base": False, "body": True})
        rows = self.rows(("v", "w"), _OPTIONAL)
        links, joints = {"base": Link("base")}, []
        previous, parent = np.eye(4), "base"
        for i, row in enumerate(rows):
            name, type_, limits = self.joint(row, i)
            v = self.length * self.vector(row["v"], f"joint {name!r}: v", 3)
            w = self.vector(row["w"], f"joint {name!r}: w", 3)
            if in_body:
                w = home[:3, :3] @ w
                v = home[:3, :3] @ v + np.cross(home[:3, 3], w)
            type_, axis, point = self.screw(name, row, type_, v, w)
            here = shift(point)
            links[f"link{i + 1}"] = Link(f"link{i + 1}")
            joints.append(Joint(name, type_, parent, f"link{i + 1}", shift(point - previous[:3, 3]), axis, limits))
            previous, parent = here, f"link{i + 1}"
        names = [j.name for j in joints]
        self.unique(names)
        links["tool"] = Link("tool")
        joints.append(Joint("to_tool", JointType.FIXED, parent, "tool", shift(-previous[:3, 3]) @ home))
        resting = self.homes(rows, names, [j.type for j in joints[:-1]])
        name = str(self.data.get("name", self.path.stem))
        return Description(name, "base", links, tuple(joints), home=resting, source=self.path, tool="tool")

    def screw(
        self, name: str, row: Mapping[str, Any], type_: JointType, v: Array, w: Array
    ) -> tuple[JointType, Array, Array]:
        """Type, axis and a point on it of a unit twist without pitch."""
        turning = float(np.linalg.norm(w))
        if turning < 1e-12:
            if row.get("type") in ("revolute", "continuous"):
                self.fail(f"joint {name!r} is {row['type']}, but its w is zero")
            speed = float(np.linalg.norm(v))
            if speed < 1e-12:
                self.fail(f"joint {name!r}: v and w are both zero; expected a twist")
            direction = v / self.length
            if abs(np.linalg.norm(direction) - 1.0) > 1e-6:
                self.fail(f"joint {name!r}: v has length {np.linalg.norm(direction):.6g}; a translation needs length 1")
            return JointType.PRISMATIC, v / speed, np.zeros(3)
        if type_ is JointType.PRISMATIC:
            self.fail(f"joint {name!r} is prismatic, but its w is not zero")
        if abs(turning - 1.0) > 1e-6:
            self.fail(f"joint {name!r}: w has length {turning:.6g}; expected 1 (divide v and w by it)")
        pitch = float(v @ w)
        if abs(pitch) > 1e-9 * max(1.0, float(np.linalg.norm(v))):
            self.fail(f"joint {name!r}: v · w is {pitch:.6g}: a helical joint with that pitch in m/rad; expected 0")
        return type_, w / turning, np.cross(w, v) / turning**2
