"""Motions in time: `Trajectory` and what can be done with it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_own
from ..errors import InputError
from .limits import _ORDERS, LimitReport, Limits, LimitStatus
from .piecewise import Piecewise

MOST_SAMPLES = 10_000_000
"""More are refused: a step in the wrong unit, rather than a file of gigabytes."""


@dataclass(frozen=True)
class Samples:
    """A motion at discrete times: ``t (M,)`` and ``(M, n)`` arrays of its first derivatives."""

    t: Array
    position: Array
    velocity: Array
    acceleration: Array
    jerk: Array


class Trajectory(Piecewise):
    """A motion ``motion(t, order)`` from t = 0 to ``motion.duration``, in n coordinates (T, trajectories).

    ``motion(t)`` is the position ``(..., n)`` at times ``t (...)``; ``order`` 1, 2, 3 give velocity, acceleration and
    jerk. Every motion of this package is piecewise polynomial in time, so its largest velocity, acceleration and jerk
    are proven (`extrema`), not sampled.
    """

    _variable = "t"

    @property
    def duration(self) -> float:
        """Time from start to end in seconds."""
        return float(self.breaks[-1] - self.breaks[0])

    @property
    def start(self) -> Array:
        """Position at t = 0, ``(n,)``."""
        return self(self.interval[0])

    @property
    def end(self) -> Array:
        """Position at the end, ``(n,)``."""
        return self(self.interval[1])

    def sample(self, dt: float | None = None, count: int | None = None) -> Samples:
        """Values at a fixed rate *dt* (the last step may be shorter) or at *count* ≥ 2 evenly spaced times."""
        if (dt is None) == (count is None):
            raise InputError("sample needs either dt (seconds between samples) or count (number of samples)")
        t0, t1 = self.interval
        if dt is not None:
            if not dt > 0.0:
                raise InputError(f"dt is {dt}; expected a positive time in seconds")
            if self.duration / dt > MOST_SAMPLES:
                raise InputError(
                    f"dt is {dt} s, which makes {self.duration / dt:.3g} samples of {self.duration:.4g} s; at most "
                    f"{MOST_SAMPLES:.0e} are allowed: choose a larger dt"
                )
            steps = int(np.ceil(self.duration / dt - 1e-9))
            t = np.append(t0 + dt * np.arange(max(steps, 1)), t1)
        else:
            assert count is not None
            if count < 2:
                raise InputError(f"count is {count}; expected at least 2 samples")
            t = np.linspace(t0, t1, count)
        return Samples(t, self(t), self(t, 1), self(t, 2), self(t, 3))

    def check(self, limits: Limits | Any, tolerance: float = 1e-9) -> LimitReport:
        """Prove that every limit is kept at all times, or name the worst place.

        *tolerance* is the relative excess that still counts as kept (rounding); the report states the excess.
        """
        limits = Limits.read(limits)
        worst: tuple[float, str, int, float, float, float] | None = None
        for order, name in enumerate(_ORDERS):
            pairs = limits.pairs(name, self.n)
            if not np.isfinite(pairs).any():
                continue
            found = self.extrema(order)
            size = np.where(np.isfinite(pairs).all(axis=1), np.abs(pairs).max(axis=1), 1.0)
            size = np.where(np.isfinite(size) & (size > 0.0), size, 1.0)
            for excess, at, value, bound in (
                ((found.upper - pairs[:, 1]) / size, found.at_upper, found.upper, pairs[:, 1]),
                ((pairs[:, 0] - found.lower) / size, found.at_lower, found.lower, pairs[:, 0]),
            ):
                j = int(excess.argmax())
                if worst is None or excess[j] > worst[0]:
                    worst = (float(excess[j]), name, j, float(at[j]), float(value[j]), float(bound[j]))
        if worst is None:
            raise InputError("limits holds no finite bound; there is nothing to check")
        status = LimitStatus.SUCCESS if worst[0] <= tolerance else LimitStatus.VIOLATED
        return LimitReport(status, max(worst[0], 0.0), *worst[1:])

    def stretched(self, factor: float) -> Trajectory:
        """The same path in *factor* times the time: velocities shrink by it, accelerations by its square."""
        if not factor > 0.0 or not np.isfinite(factor):
            raise InputError(f"factor is {factor}; expected a positive number (2 doubles the duration)")
        powers = float(factor) ** -np.arange(self.degree + 1.0)
        return self._like(self.breaks * factor, self.coefficients * powers[None, :, None])

    def reversed(self) -> Trajectory:
        """The motion run backwards."""
        h = np.diff(self.breaks)
        out = np.zeros_like(self.coefficients)
        for p in range(self.degree + 1):
            binomial = 1.0
            for r in range(p + 1):
                out[:, r] += self.coefficients[:, p] * binomial * (h ** (p - r))[:, None] * (-1.0) ** r
                binomial *= (p - r) / (r + 1)
        t0, t1 = self.interval
        return self._like((t0 + t1 - self.breaks)[::-1], out[::-1])

    def then(self, *others: Trajectory) -> Trajectory:
        """This motion followed by *others*; see `concatenate`."""
        return concatenate((self, *others))

    def select(self, coordinates: ArrayLike) -> Trajectory:
        """The motion of some coordinates only, by index."""
        return self._like(self.breaks, self.coefficients[:, :, np.asarray(coordinates, dtype=np.int64)])

    def _like(self, breaks: Array, coefficients: Array) -> Trajectory:
        return Trajectory(breaks, coefficients)


def concatenate(motions: Iterable[Trajectory], tolerance: float = 1e-6) -> Trajectory:
    """One motion after the other, the first starting at t = 0.

    Each must begin where the one before ends, in position and in velocity, within *tolerance* (relative to
    1 + |value|); a gap raises `InputError` with its size.
    """
    parts = list(motions)
    if not parts:
        raise InputError("concatenate needs at least one motion")
    for i, (a, b) in enumerate(zip(parts[:-1], parts[1:], strict=True)):
        if a.n != b.n:
            raise InputError(f"motion {i} has {a.n} coordinates and motion {i + 1} has {b.n}; they must agree")
        for order, what in ((0, "position"), (1, "velocity")):
            end, start = a(a.interval[1], order), b(b.interval[0], order)
            gap = np.abs(start - end) / (1.0 + np.abs(end))
            j = int(gap.argmax())
            if gap[j] > tolerance:
                raise InputError(
                    f"motion {i + 1} starts with {what} {start[j]:.9g} in coordinate {j}, but motion {i} ends with "
                    f"{end[j]:.9g}; insert a motion between them"
                )
    degree = max(p.degree for p in parts)
    time, breaks, pieces = 0.0, [np.zeros(1)], []
    for part in parts:
        breaks.append(part.breaks[1:] - part.breaks[0] + time)
        time += part.duration
        padded = np.zeros((part.coefficients.shape[0], degree + 1, part.n))
        padded[:, : part.degree + 1] = part.coefficients
        pieces.append(padded)
    return Trajectory(np.concatenate(breaks), np.concatenate(pieces))


def pause(position: ArrayLike, duration: float) -> Trajectory:
    """Standing still at *position* ``(n,)`` for *duration* seconds."""
    position = np.atleast_1d(as_own(position, "position"))
    if not duration > 0.0:
        raise InputError(f"duration is {duration}; expected a positive time in seconds")
    return Trajectory([0.0, duration], position[None, None, :])
