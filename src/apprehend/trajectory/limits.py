"""Limits of a motion, and the proof that a motion keeps them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from ..result import Result, Status

_ORDERS = ("position", "velocity", "acceleration", "jerk")


@dataclass(frozen=True, eq=False)
class Limits:
    """Bounds on the derivatives of every coordinate; ``None`` leaves one out.

    Each is given as a scalar, as magnitudes ``(n,)``, or as pairs ``(n, 2)`` of lowest and highest value (*position*
    must be pairs). Infinite entries are no limit.
    """

    velocity: ArrayLike | None = None
    acceleration: ArrayLike | None = None
    jerk: ArrayLike | None = None
    position: ArrayLike | None = None

    def __post_init__(self) -> None:
        for name in _ORDERS:
            value = getattr(self, name)
            if isinstance(value, np.ndarray):  # the caller's own memory may change
                object.__setattr__(self, name, value.copy())

    @classmethod
    def read(cls, source: Any) -> Limits:
        """Limits from a `Limits`, a mapping, or any object with these attributes (such as ``robot.limits``)."""
        if isinstance(source, Limits):
            return source
        if isinstance(source, dict):
            unknown = set(source) - set(_ORDERS)
            if unknown:
                raise InputError(f"limits has the key {sorted(unknown)[0]!r}; expected {', '.join(_ORDERS)}")
            return cls(**source)
        values = {name: getattr(source, name, None) for name in _ORDERS}
        if all(v is None for v in values.values()):
            raise InputError(
                f"limits is {type(source).__name__}; expected Limits(velocity=…, acceleration=…), a mapping, "
                "or an object with these attributes"
            )
        lower, upper = getattr(source, "lower", None), getattr(source, "upper", None)
        if values["position"] is None and lower is not None and upper is not None:
            values["position"] = np.stack([lower, upper], axis=-1)
        return cls(**values)

    @property
    def bounded(self) -> bool:
        """Whether there is any finite bound."""
        given = [getattr(self, name) for name in _ORDERS]
        return any(v is not None and np.isfinite(np.asarray(v, dtype=np.float64)).any() for v in given)

    def pairs(self, name: str, n: int) -> Array:
        """The bounds *name* as ``(n, 2)`` pairs (lowest, highest); ±inf where there is none."""
        value = getattr(self, name)
        if value is None:
            return np.tile([-np.inf, np.inf], (n, 1))
        array = as_array(value, f"limits.{name}", finite=False)
        if np.isnan(array).any():
            raise InputError(f"limits.{name} contains NaN; leave a bound out with inf or None")
        if name == "position":
            if array.shape != (n, 2):
                raise InputError(f"limits.position has shape {array.shape}; expected ({n}, 2): lowest and highest")
            pairs = array
        elif array.ndim == 0 or array.shape == (n,):
            magnitude = np.broadcast_to(array, (n,))
            pairs = np.stack([-magnitude, magnitude], axis=1)
        elif array.shape == (n, 2):
            pairs = array
        else:
            raise InputError(f"limits.{name} has shape {array.shape}; expected a number, ({n},) or ({n}, 2)")
        wrong = pairs[:, 0] >= pairs[:, 1] if name == "position" else (pairs[:, 0] >= 0.0) | (pairs[:, 1] <= 0.0)
        if wrong.any():
            j = int(np.argmax(wrong))
            what = (
                "the lowest below the highest"
                if name == "position"
                else "a positive magnitude, or lowest < 0 < highest"
            )
            raise InputError(f"limits.{name}[{j}] is {pairs[j].tolist()}; expected {what}")
        return np.ascontiguousarray(pairs)


class LimitStatus(Status):
    """Whether a motion keeps its limits."""

    SUCCESS = "Every limit is kept at all times, which the bound of every piece proves."
    VIOLATED = "At least one limit is exceeded."


@dataclass(frozen=True)
class LimitReport(Result):
    """Answer of `Trajectory.check`.

    ``violation`` is the proven largest excess over any limit (0 where all are kept), relative to the limit's size;
    ``worst`` names the limit, coordinate, time, value and bound it belongs to.
    """

    status: LimitStatus
    violation: float
    limit: str
    coordinate: int
    time: float
    value: float
    bound: float

    def explain(self) -> str:
        """The verdict with the tightest place."""
        if self.success:
            place = f"{self.limit} of coordinate {self.coordinate} at t = {self.time:.6g} s"
            return f"{self.status.value} The tightest is {place}."
        return (
            f"{self.limit} of coordinate {self.coordinate} is {self.value:.9g} at t = {self.time:.6g} s; "
            f"the limit is {self.bound:.9g} (excess {self.violation:.3g} of it)"
        )
