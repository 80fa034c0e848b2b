"""Tables of a scene file, which say where they stood when something in them is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Array
from ..conventions import DEGREE
from ..errors import DescriptionError, suggestion
from .rotations import matrix_quaternion, quaternion_matrix, rpy_matrix

POSE = ("xyz", "rpy", "rpy_deg", "wxyz")

FAR = 100.0
"""What is farther away than this, in m, stands in no scene: the unit is wrong."""

TURN = 6.3
"""Angles that are larger than this, in rad, are degrees."""


class Table:
    """One table of the file with its place, so that every message can say where it stood."""

    def __init__(self, values: object, where: str, allowed: tuple[str, ...]):
        if not isinstance(values, Mapping):
            raise DescriptionError(f"{where} is {values!r}; expected a table with the keys {', '.join(allowed)}")
        for key in values:
            if key not in allowed:
                hint = suggestion(key, allowed) or f" Known keys: {', '.join(allowed)}."
                raise DescriptionError(f"{where} has an unknown key {key!r}.{hint}")
        self.values: Mapping[str, Any] = values
        self.where = where

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def error(self, key: str, expected: str) -> DescriptionError:
        """The error for a key whose value is not what is *expected*."""
        return DescriptionError(f"{self.where}: {key} is {self.values.get(key)!r}; expected {expected}")

    def text(self, key: str, default: str | None = None) -> str | None:
        """A string."""
        if key not in self.values:
            return default
        if not isinstance(self.values[key], str) or not self.values[key]:
            raise self.error(key, "a text in quotes")
        return str(self.values[key])

    def need_text(self, key: str) -> str:
        """A string that must be there."""
        value = self.text(key)
        if value is None:
            raise DescriptionError(f"{self.where} has no {key!r}; it needs one")
        return value

    def number(self, key: str, default: float, *, at_least: float = -np.inf) -> float:
        """A finite number."""
        if key not in self.values:
            return default
        value = self.values[key]
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value) or value < at_least:
            raise self.error(key, "a finite number" + (f", {at_least:g} or more" if np.isfinite(at_least) else ""))
        return float(value)

    def flag(self, key: str, default: bool) -> bool:
        """true or false."""
        value = self.values.get(key, default)
        if not isinstance(value, bool):
            raise self.error(key, "true or false")
        return value

    def colour(self, key: str) -> tuple[float, ...]:
        """A colour with its opacity, four numbers from 0 to 1."""
        values = self.numbers(key, 4)
        if values.min() < 0.0 or values.max() > 1.0:
            raise self.error(key, "red, green, blue and opacity, each from 0 to 1")
        return tuple(float(c) for c in values)

    def numbers(self, key: str, count: int) -> Array:
        """A list of *count* finite numbers that must be there."""
        value = self.values.get(key)
        good = isinstance(value, list) and len(value) == count
        if not good or any(
            isinstance(v, bool) or not isinstance(v, int | float) or not np.isfinite(v) for v in value or []
        ):
            raise self.error(key, f"a list of {count} finite numbers")
        return np.array(value, dtype=np.float64)

    def pose(self, key: str) -> Array:
        """A pose that must be there: ``{xyz, rpy_deg | rpy | wxyz}``."""
        if key not in self.values:
            raise DescriptionError(f"{self.where} has no {key!r}; expected a pose such as {{xyz = [0.5, 0, 0.1]}}")
        table = Table(self.values[key], f"{self.where}, {key}", POSE)
        turns = [k for k in POSE[1:] if k in table]
        if len(turns) > 1:
            raise DescriptionError(f"{table.where} has both {turns[0]} and {turns[1]}; give one rotation")
        T = np.eye(4)
        if "wxyz" in table:
            quaternion = table.numbers("wxyz", 4)
            norm = float(np.linalg.norm(quaternion))
            if abs(norm - 1.0) > 1e-3:
                raise DescriptionError(f"{table.where}: wxyz has length {norm:.4g}; a rotation is a unit quaternion")
            T[:3, :3] = quaternion_matrix(quaternion / norm)
        elif turns:
            angles = table.numbers(turns[0], 3)
            if turns[0] == "rpy" and np.abs(angles).max() > TURN:
                raise table.error("rpy", "angles in radians, at most one turn; degrees are given as rpy_deg")
            T[:3, :3] = rpy_matrix(angles * (DEGREE if turns[0] == "rpy_deg" else 1.0))
        if "xyz" in table:
            T[:3, 3] = table.numbers("xyz", 3)
            if np.abs(T[:3, 3]).max() > FAR:
                raise table.error("xyz", f"a place in metres, at most {FAR:g} m from the origin; is it in millimetres?")
        return T


def quoted(text: object) -> str:
    """A text as TOML writes it."""
    escaped = str(text).replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'


def pose_text(T: Array) -> str:
    """A pose as TOML writes it."""
    return f"{{xyz = {T[:3, 3].tolist()}, wxyz = {matrix_quaternion(T[:3, :3]).tolist()}}}"
