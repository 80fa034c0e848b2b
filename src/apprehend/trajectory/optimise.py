"""Trading arc length, bending energy and motion time (T, the three factors of time-optimal motion)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, as_array
from ..errors import InputError
from .geometry import arc_length, bending_energy
from .limits import Limits
from .path import as_waypoints
from .spline import Spline, chord_knots
from .timing import Timing, time_optimal

_FACTORS = ("length", "bending", "time")
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True, eq=False)
class Compromise:
    """A spline and its three factors: arc length (rad or m), bending energy, and time-optimal duration (s)."""

    path: Spline
    timing: Timing
    length: float
    bending: float
    time: float
    weights: tuple[float, float, float]

    @property
    def factors(self) -> Array:
        """``(length, bending, time)``."""
        return np.array([self.length, self.bending, self.time])


def optimise(
    waypoints: ArrayLike,
    limits: Limits | Any,
    *,
    weights: ArrayLike = (1.0, 1.0, 1.0),
    freedom: ArrayLike = 0.0,
    grid: int = 100,
    iterations: int = 40,
) -> Compromise:
    """The spline near *waypoints* ``(M, n)`` with the least weighted sum of length, bending energy and time.

    Inner via points may move by up to *freedom* (scalar, ``(n,)`` or ``(M − 2, n)``) in every coordinate, and the
    knots move too; the ends stay. Each factor is divided by its value for the chord-length spline through the
    waypoints, which is where the search starts (bounded quasi-Newton with differences), so that *weights* ``(3,)``
    compare them.
    """
    problem = _Problem(waypoints, limits, freedom, grid)
    return problem.best(_weights(weights), iterations)


def pareto(
    waypoints: ArrayLike, limits: Limits | Any, *, freedom: ArrayLike = 0.0, count: int = 10, grid: int = 100,
    iterations: int = 25,
) -> list[Compromise]:  # fmt: skip
    """Compromises of which none is worse than another in all three factors, for *count* weightings and the three pure
    ones; sorted by time. Draw them with `plot_pareto`.
    """
    if count < 0:
        raise InputError(f"count is {count}; expected a number of weightings ≥ 0")
    problem = _Problem(waypoints, limits, freedom, grid)
    weights = [np.array(w, dtype=np.float64) + 0.01 for w in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    # evenly over the triangle of weightings
    for i in range(count):
        u, v = np.sqrt((i + 0.5) / count), (i * 0.6180339887498949) % 1.0
        weights.append(np.array([1.0 - u, u * (1.0 - v), u * v]) + 0.01)
    found = [problem.best(w / w.sum(), iterations) for w in weights]
    keep = nondominated(np.array([c.factors for c in found]))
    return sorted((c for c, k in zip(found, keep) if k), key=lambda c: c.time)


def nondominated(factors: ArrayLike) -> BoolArray:
    """Which rows of *factors* ``(K, m)`` no other row undercuts in one column without exceeding it in another."""
    f = as_array(factors, "factors")
    better = (f[:, None] <= f[None]).all(axis=2) & (f[:, None] < f[None]).any(axis=2)
    return np.asarray(~better.any(axis=0))


def _weights(weights: ArrayLike) -> Array:
    w = as_array(weights, "weights")
    if w.shape != (3,) or w.min() < 0.0 or w.max() <= 0.0:
        raise InputError(f"weights is {w.tolist()}; expected three numbers ≥ 0 for {', '.join(_FACTORS)}, not all zero")
    return np.asarray(w / w.sum())


class _Problem:
    def __init__(self, waypoints: ArrayLike, limits: Limits | Any, freedom: ArrayLike, grid: int) -> None:
        self.points = as_waypoints(waypoints, "waypoints")
        m, n = self.points.shape
        if m < 3:
            raise InputError("optimise needs at least one via point between the ends: three waypoints")
        room = as_array(freedom, "freedom")
        if room.min() < 0.0:
            raise InputError(f"freedom is {room.min():.6g}; expected distances ≥ 0")
        try:
            self.room = np.broadcast_to(room, (m - 2, n))
        except ValueError as error:
            raise InputError(f"freedom has shape {room.shape}; expected a number, ({n},) or ({m - 2}, {n})") from error
        self.limits, self.grid = Limits.read(limits), grid
        self.chord = np.diff(chord_knots(self.points))
        self.scale = self.factors(self.spline(np.zeros(self.size)))
        # a straight line bends nowhere: measure bending against one turn per length then
        self.scale[1] = max(self.scale[1], 1e-9 / self.scale[0])

    @property
    def size(self) -> int:
        return int(self.room.size + self.chord.size)

    def spline(self, z: Array) -> Spline:
        points = self.points.copy()
        points[1:-1] += z[: self.room.size].reshape(self.room.shape) * self.room
        steps = self.chord * np.exp(z[self.room.size :])
        knots = np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])
        knots[-1] = 1.0
        return Spline(points, knots)

    def factors(self, path: Spline) -> Array:
        """Length and bending by fixed quadrature, time by the certified timing."""
        h = np.diff(path.breaks)
        s = (path.breaks[:-1, None] + h[:, None] * np.linspace(0.0, 1.0, 5)[:-1]).ravel()
        width = np.repeat(h / 4.0, 4)
        x = s[:, None] + width[:, None] * 0.5 * (_NODES + 1.0)
        weight = width[:, None] * 0.5 * _WEIGHTS
        first, second = path(x, 1), path(x, 2)
        square = np.maximum((first**2).sum(axis=-1), 1e-300)
        across = second - ((first * second).sum(axis=-1) / square)[..., None] * first
        length = float((np.sqrt(square) * weight).sum())
        bending = float(((across**2).sum(axis=-1) / square**1.5 * weight).sum())
        return np.array([length, bending, self.timing(path).duration])

    def timing(self, path: Spline) -> Timing:
        return time_optimal(path, self.limits, grid=self.grid).require_success()

    def best(self, weights: Array, iterations: int) -> Compromise:
        from scipy.optimize import Bounds, minimize

        bound = np.concatenate([np.ones(self.room.size), np.full(self.chord.size, 1.5)])
        bound[: self.room.size][self.room.ravel() == 0.0] = 0.0
        found = minimize(
            lambda z: float(weights @ (self.factors(self.spline(z)) / self.scale)), np.zeros(self.size),
            method="L-BFGS-B", bounds=Bounds(-bound, bound), options={"maxiter": iterations, "eps": 1e-5},
        )  # fmt: skip
        path = self.spline(found.x)
        timing = self.timing(path)
        a, b, c = (float(w) for w in weights)
        return Compromise(path, timing, arc_length(path), bending_energy(path), timing.duration, (a, b, c))
