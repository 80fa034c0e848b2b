"""The arguments of planning for hands with several fingers, checked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..errors import InputError


@dataclass(frozen=True)
class HandSettings:
    """What `plan` was asked for."""

    friction: float
    methods: tuple[str, ...]
    samples: int
    table: Array  # (K, 4)
    acceleration: float
    safety: float
    apart: tuple[float, float]
    max_force: float
    approach: Array | None
    approach_tolerance: float
    clearance: float
    table_clearance: float
    standoff: float


def checked_hand(s: HandSettings, n: int) -> HandSettings:
    """The settings themselves, or `InputError` for the first that has no meaning."""
    for name, count in (("n", n), ("samples", s.samples)):
        if int(count) != count or count < 1:
            raise InputError(f"{name} is {count}; expected a whole number, 1 or more")
    for name in ("friction", "safety"):
        value = getattr(s, name)
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name} is {value}; expected a finite number above zero")
    for name in ("acceleration", "clearance", "table_clearance", "standoff"):
        value = getattr(s, name)
        if not (np.isfinite(value) and value >= 0.0):
            raise InputError(f"{name} is {value}; expected zero or more")
    if not s.max_force > 0.0:
        raise InputError(f"max_force is {s.max_force}; expected a number above zero")
    return s
