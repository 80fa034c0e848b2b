"""Numbers for people: rounded, with the unit that the name of the quantity implies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

MILLIMETRES = {
    "width", "opening", "slip", "moved", "pushed", "raised", "com_distance", "position_error", "width_error", "torsion",
    "clearance", "distance", "standoff", "depth", "error",
}  # fmt: skip
DEGREES = {"angle_error", "tilt", "angle", "turn"}
NEWTONS = {"force", "forces", "needed", "required_force"}
SECONDS = {"duration", "time", "simulated"}
KILOGRAMS = {"mass"}
MILLIRADIANS = {"tracking_error", "final_error"}
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
SHOWN = 8
"""Longest list of numbers that is written out."""


def number(value: float, digits: int) -> str:
    """*value* with so many decimals; a true minus; tiny values as ``< 0.01``."""
    if not math.isfinite(value):
        return "∞" if value > 0 else "−∞" if value < 0 else "–"
    step = 10.0**-digits
    if 0.0 < abs(value) < 0.5 * step:
        return f"< {step:.{digits}f}"
    return f"{value:.{digits}f}".replace("-", "−")


def quantity(name: str, value: Any) -> str:
    """*value* of the quantity *name* for a person to read: scaled to its customary unit, matrices in short."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        return ", ".join(f"{v} {k}" for k, v in value.items())
    factor, unit = _unit(name)
    if isinstance(value, (int, float)):
        return f"{significant(value * factor) if unit else scientific(value)}{unit}"
    if isinstance(value, list):
        if value and isinstance(value[0], list):
            rows, columns = len(value), len(value[0])
            if (rows, columns) == (4, 4):
                return f"at ({', '.join(significant(row[3]) for row in value[:3])}) m"
            return f"{rows} × {columns} numbers"
        if len(value) > SHOWN:
            return f"{len(value)} values"
        return ", ".join(significant(v * factor) if isinstance(v, (int, float)) else str(v) for v in value) + unit
    return str(value)


def significant(value: float) -> str:
    """Three significant digits; what is smaller than a thousandth is only said to be so."""
    if isinstance(value, int) or (float(value).is_integer() and abs(value) < 1e6):
        return str(int(value)).replace("-", "−")
    if 0.0 < abs(value) < 1e-3:
        return "< 0.001"
    text = f"{value:.3g}" if abs(value) < 1e3 else f"{value:.0f}"
    return text.replace("-", "−")


def scientific(value: float) -> str:
    """As `significant`, but tiny values with their power of ten."""
    if not 0.0 < abs(value) < 1e-3:
        return significant(value)
    mantissa, exponent = f"{value:.2e}".split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(SUPERSCRIPT)}".replace("-", "−")


def _unit(name: str) -> tuple[float, str]:
    if name in MILLIMETRES:
        return 1e3, " mm"
    if name in DEGREES:
        return 180.0 / math.pi, "°"
    if name in NEWTONS:
        return 1.0, " N"
    if name in SECONDS:
        return 1.0, " s"
    if name in KILOGRAMS:
        return 1.0, " kg"
    if name in MILLIRADIANS:
        return 1e3, " mrad"
    return 1.0, ""
