"""Constraints known by samples: their rows on the grid, and a bound on what they do between the samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Array, BoolArray
from ..errors import InputError
from .constraints import Constraint, PowerLimits
from .path import PolynomialPath

_QUARTERS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
REMAINDER = 2.0
"""Factor on the error of the quadratic interpolant measured at the quarter points.

For a function with a constant third derivative the largest error is 1.03 times that at the quarters; the rest is for
its change over the interval."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """Rows ``lo ≤ A u + B x + C ≤ hi`` at the start, middle and end of N intervals.

    ``values (N, 3, E, 3)``, ``bounds (N, E, 2)``, ``error (N, E, 3)`` bounds of the interpolation errors of A, B, C,
    ``power (E,)`` marks rows whose bound is divided by the path speed.
    """

    values: Array
    bounds: Array
    error: Array
    power: BoolArray
    names: tuple[str, ...]

    def tightened(self, margins: Array, bound: Array | None) -> Sampled:
        """Bounds narrowed by *margins* ``(N, E)``, power rows divided by the path speed squared *bound* ``(N,)``.

        Without *bound* the power rows are left out; with it, a row that keeps x below it is added.
        """
        bounds = self.bounds.copy()
        if bound is None:
            bounds[:, self.power] = [-np.inf, np.inf]
        else:
            bounds[:, self.power] /= np.sqrt(np.maximum(bound, 1e-300))[:, None, None]
        bounds[..., 0] += margins
        bounds[..., 1] -= margins
        if bound is None or not self.power.any():
            return replace(self, bounds=bounds)
        n, _, e, _ = self.values.shape
        values = np.zeros((n, 3, e + 1, 3))
        values[:, :, :e] = self.values
        values[:, :, e, 1] = 1.0
        extra = np.stack([np.full(n, -np.inf), bound], axis=1)[:, None]
        return replace(
            self, values=values, bounds=np.concatenate([bounds, extra], axis=1), names=(*self.names, "the power limit")
        )

    def remainder(self, x: Array, grid: Array) -> Array:
        """Bound ``(N, E)`` on what the rows deviate from their interpolants at the speeds squared *x* ``(N + 1,)``."""
        u = np.abs(np.diff(x) / (2.0 * np.diff(grid)))
        top = np.maximum(x[1:], x[:-1])
        found: Array = self.error[..., 0] * u[:, None] + self.error[..., 1] * top[:, None] + self.error[..., 2]
        return found

    def power_share(self, x: Array, grid: Array) -> Array:
        """Largest share ``(N,)`` of the power used in every interval at the speeds squared *x*, at least 1 %."""
        u = np.diff(x) / (2.0 * np.diff(grid))
        at = np.stack([x[:-1], 0.5 * (x[:-1] + x[1:]), x[1:]], axis=1)[:, :, None]
        A, B, C = np.moveaxis(self.values[:, :, self.power], -1, 0)
        power = np.abs(A * u[:, None, None] + B * at + C) * np.sqrt(at)
        return np.asarray(np.maximum((power / self.bounds[:, None, self.power, 1]).max(axis=(1, 2)), 1e-2))

    def share(self, margins: Array) -> float:
        """The largest margin as a share of its bound."""
        size = np.abs(self.bounds).min(axis=2)
        return float((margins / np.where(np.isfinite(size) & (size > 0.0), size, np.inf)).max(initial=0.0))


def sample(path: PolynomialPath, grid: Array, constraints: Sequence[Constraint]) -> Sampled:
    """Sample *constraints* at the quarters of every interval of *grid*."""
    h = np.diff(grid)
    count = h.size
    if path.smooth:  # neighbours share their ends
        s = np.append((grid[:-1, None] + h[:, None] * _QUARTERS[:4]).ravel(), grid[-1])
        index = 4 * np.arange(count)[:, None] + np.arange(5)
    else:  # left limits at the right ends
        table = grid[:-1, None] + h[:, None] * _QUARTERS
        table[:, 4] = np.nextafter(grid[1:], -np.inf)
        s, index = table.ravel(), np.arange(5 * count).reshape(count, 5)
    parts = [c.rows(path, s) for c in constraints]
    for constraint, part in zip(constraints, parts):
        bad = ~np.isfinite(part.A).all(axis=1) | ~np.isfinite(part.B).all(axis=1) | ~np.isfinite(part.C).all(axis=1)
        if bad.any():
            raise InputError(f"{type(constraint).__name__} is not finite at s = {s[int(bad.argmax())]:.6g} of the path")
    table = np.stack([np.concatenate([getattr(p, c) for p in parts], axis=1) for c in "ABC"], axis=-1)[index]
    start, left, middle, right, end = (table[:, i] for i in range(5))
    # the quadratic through start, middle and end at the quarters
    wrong = np.maximum(
        np.abs(left - (0.375 * start + 0.75 * middle - 0.125 * end)),
        np.abs(right - (-0.125 * start + 0.75 * middle + 0.375 * end)),
    )
    bounds = np.stack([np.concatenate([p.lower for p in parts]), np.concatenate([p.upper for p in parts])], axis=1)
    size = np.array([len(p.names) for p in parts])
    return Sampled(
        values=np.ascontiguousarray(np.stack([start, middle, end], axis=1)),
        bounds=np.broadcast_to(bounds, (count, *bounds.shape)).copy(),
        error=REMAINDER * wrong,
        power=np.repeat([isinstance(c, PowerLimits) for c in constraints], size),
        names=tuple(name for p in parts for name in p.names),
    )
