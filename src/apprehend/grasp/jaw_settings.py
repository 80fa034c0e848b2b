"""The arguments of jaw planning, checked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_pose, as_shaped
from ..errors import InputError


@dataclass(frozen=True)
class Settings:
    """What `plan` was asked for, checked."""

    friction: float
    max_force: float
    clearance: float
    standoff: float
    samples: int
    angles: int
    cone_margin: float
    compliance: float
    safety: float
    acceleration: float
    room: float
    approach: Array | None
    approach_tolerance: float
    table: Array  # (K, 4)
    apart: tuple[float, float]


def checked(s: Settings, n: int) -> Settings:
    """The settings themselves, or `InputError` for the first that has no meaning."""
    for name, value in (("n", n), ("samples", s.samples), ("angles", s.angles)):
        if int(value) != value or value < 1:
            raise InputError(f"{name} is {value}; expected a whole number, 1 or more")
    for name in ("friction", "max_force", "standoff", "compliance", "safety"):
        value = getattr(s, name)
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name} is {value}; expected a finite number above zero")
    for name in ("clearance", "acceleration", "cone_margin", "room"):
        value = getattr(s, name)
        if not (np.isfinite(value) and value >= 0.0):
            raise InputError(f"{name if name != 'room' else 'table_clearance'} is {value}; expected zero or more")
    return s


def directions(value: ArrayLike | None) -> Array | None:
    """Unit approach directions ``(K, 3)``."""
    if value is None:
        return None
    d = as_shaped(value, "approach", 3).reshape(-1, 3)
    length = np.linalg.norm(d, axis=1, keepdims=True)
    if not len(d) or (length < 1e-12).any():
        raise InputError("approach contains no direction, or one of length zero; expected (K, 3) directions")
    unit: Array = d / length
    return unit


def half_spaces(value: ArrayLike | None) -> Array:
    """Rows (n, d) with unit n of the half-spaces ``n·x ≥ d``, from a pose on a table or from rows."""
    if value is None:
        return np.empty((0, 4))
    rows = as_array(getattr(value, "matrix", value), "table")
    if rows.shape == (4, 4) and np.array_equal(rows[3], [0.0, 0.0, 0.0, 1.0]):
        T = as_pose(rows, "table")
        return np.concatenate([T[2, :3], [-T[2, 3]]])[None]
    rows = as_shaped(rows, "table", 4).reshape(-1, 4)
    length = np.linalg.norm(rows[:, :3], axis=1, keepdims=True)
    if (length < 1e-12).any():
        raise InputError("table has a half-space whose normal is zero; expected rows (nx, ny, nz, d) with n·x ≥ d free")
    unit: Array = rows / length
    return unit
