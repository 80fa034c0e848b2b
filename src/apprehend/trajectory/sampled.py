"""Constraints known by samples: quartics on every grid interval, and a bound on what they leave out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Array, BoolArray
from ..errors import InputError
from ..kernels.timing_cubic import WIDE
from .constraints import BERNSTEIN, Constraint, PowerLimits, Rows
from .path import PolynomialPath

ESTIMATE = 2.0
"""Factor on the error of a quartic measured half-way between its samples, for constraints that prove no bound."""
ROUNDING = 1e-12
"""Share of the values that is added to their errors, for the rounding of what computed them."""
_FIVE = np.linspace(0.0, 1.0, 5)
_HALVES = np.array([[np.prod([(x - b) / (a - b) for b in _FIVE if b != a]) for a in _FIVE] for x in _FIVE[:-1] + 0.125])
"""The quartic through five even samples, half-way between them."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """Rows ``lo ≤ A u + B x + C ≤ hi`` on N intervals, quartic in σ.

    ``samples (N, 5, E, 3)`` and Bernstein coefficients ``values (N, 5, E, 3)`` of A, B, C; ``bounds (N, E, 2)``;
    ``error (N, E, 3)`` bounds of what A, B, C differ from the quartics, ``rest (N, E, 3)`` the part of it that values
    do not hold yet (rows that are bounded on one side hold that of B and C). ``across (N, E, 2)`` as in
    `Rows`; ``power (E,)`` marks rows whose upper bound is divided by the path speed; ``proven`` says that no error is
    an estimate.
    """

    samples: Array
    values: Array
    bounds: Array
    error: Array
    rest: Array
    across: Array
    power: BoolArray
    names: tuple[str, ...]
    proven: bool

    def tightened(self, margins: Array | float, tangent: Array | None) -> Sampled:
        """Bounds narrowed by *margins* ``(N, E)``.

        Power rows are left out, or kept by the tangent of their bound ``P/√x ≥ P (3 − x/t)/(2 √t)`` at the path speeds
        squared t = *tangent* ``(N,)``.
        """
        bounds, values = self.bounds.copy(), self.values
        if self.power.any():
            values = values.copy()
            limit = bounds[:, self.power, 1]
            if tangent is None:
                bounds[:, self.power, 1] = np.inf
            else:
                values[:, :, self.power, 1] += (0.5 * limit / tangent[:, None] ** 1.5)[:, None]
                bounds[:, self.power, 1] = 1.5 * limit / np.sqrt(tangent)[:, None]
        bounds[..., 0] += margins
        bounds[..., 1] -= margins
        return replace(self, values=values, bounds=bounds)

    def in_blocks(self) -> tuple[Array, Array]:
        """``values (blocks, E · 15 · WIDE)`` and ``bounds (blocks, E · 2 · WIDE)`` as kernels read them."""
        count, _, e, _ = self.values.shape
        blocks = -(-count // WIDE)
        index = np.minimum(np.arange(blocks * WIDE), count - 1)
        values = self.values.transpose(2, 3, 1, 0).reshape(e * 15, count)[:, index].reshape(e * 15, blocks, WIDE)
        bounds = self.bounds.transpose(1, 2, 0).reshape(e * 2, count)[:, index].reshape(e * 2, blocks, WIDE)
        return (
            np.ascontiguousarray(values.transpose(1, 0, 2)).reshape(blocks, -1),
            np.ascontiguousarray(bounds.transpose(1, 0, 2)).reshape(blocks, -1),
        )

    def of_interval(self, i: int) -> Sampled:
        """The part that concerns interval *i*."""
        cut = slice(i, i + 1)
        return replace(
            self, samples=self.samples[cut], values=self.values[cut], bounds=self.bounds[cut], error=self.error[cut],
            rest=self.rest[cut], across=self.across[cut],
        )  # fmt: skip

    def remainder(self, x: Array, grid: Array, error: Array | None = None) -> Array:
        """Bound ``(N, E)`` on what the rows deviate from their quartics at the speeds squared *x* ``(N + 1,)``."""
        error = self.rest if error is None else error
        u = np.abs(np.diff(x) / (2.0 * np.diff(grid)))
        top = np.maximum(x[1:], x[:-1])
        found: Array = error[..., 0] * u[:, None] + error[..., 1] * top[:, None] + error[..., 2]
        rows = self.across.any(axis=(0, 2))
        if rows.any():
            # a vector of length r with the part o at right angles leaves √(r² − o²) to the rows
            size, across = self.bounds[:, rows, 1], self.across[:, rows]
            share = np.minimum((across[..., 0] * u[:, None] + across[..., 1] * top[:, None]) / size, 1.0)
            found[:, rows] += size * (1.0 - np.sqrt(1.0 - share**2))
        return found

    def excess(self, x: Array, grid: Array) -> float:
        """Bound of the largest excess over a limit at the speeds squared *x*, relative to the limit; 0: none."""
        u = (np.diff(x) / (2.0 * np.diff(grid)))[:, None, None]
        left = np.arange(5, -1, -1)[:, None] / 5.0
        right = np.arange(6)[:, None] / 5.0
        padded = np.pad(self.values, ((0, 0), (1, 1), (0, 0), (0, 0)))
        here, before = padded[:, 1:], padded[:, :-1]
        A, C = (left * here[..., k] + right * before[..., k] for k in (0, 2))
        B = left * here[..., 1] * x[:-1, None, None] + right * before[..., 1] * x[1:, None, None]
        value = A * u + B + C
        rest = self.remainder(x, grid)
        bounds = self.bounds
        over = np.maximum(value.max(axis=1) + rest - bounds[..., 1], bounds[..., 0] - value.min(axis=1) + rest)
        size = np.where(np.isfinite(bounds), np.abs(bounds), 0.0).max(axis=2)
        return float(np.maximum(over / np.maximum(size, 1e-300), 0.0).max(initial=0.0))

    def shares(self, margins: Array, x: Array, grid: Array) -> Array:
        """The share of a limit that every interval ``(N,)`` holds back: its *margins* ``(N, E)``, its errors at *x*."""
        size = np.abs(self.bounds).min(axis=2)
        size = np.where(np.isfinite(size) & (size > 0.0), size, np.inf)
        return np.asarray((np.maximum(margins, self.remainder(x, grid, self.error)) / size).max(axis=1, initial=0.0))


def sample(path: PolynomialPath, grid: Array, constraints: Sequence[Constraint]) -> Sampled:
    """Sample *constraints* at the quarters of every interval of *grid*."""
    s = grid[:-1, None] + np.diff(grid)[:, None] * _FIVE
    s[:, 4] = np.nextafter(grid[1:], -np.inf)  # the path may bend at the grid points: left limits
    parts = [c.rows(path, s) for c in constraints]
    for constraint, part in zip(constraints, parts):
        _check(constraint, part, s)
    samples = np.stack([np.concatenate([getattr(p, c) for p in parts], axis=2) for c in "ABC"], axis=-1)
    error = [p.error if p.error is not None else _estimated(path, s, c, p) for c, p in zip(constraints, parts)]
    bounds = np.stack([np.concatenate([p.lower for p in parts]), np.concatenate([p.upper for p in parts])], axis=1)
    size = [len(p.names) for p in parts]
    count, _, e, _ = samples.shape
    values = (BERNSTEIN @ samples.reshape(count, 5, 3 * e)).reshape(samples.shape)
    across = [p.across if p.across is not None else np.zeros((count, k, 2)) for p, k in zip(parts, size)]
    found = Sampled(
        samples=samples,
        values=values,
        bounds=np.broadcast_to(bounds, (count, *bounds.shape)).copy(),
        error=np.concatenate(error, axis=1) + ROUNDING * np.abs(samples).max(axis=1),
        rest=np.empty(0),
        across=np.concatenate(across, axis=1),
        power=np.repeat([isinstance(c, PowerLimits) for c in constraints], size),
        names=tuple(name for p in parts for name in p.names),
        proven=all(p.error is not None for p in parts),
    )
    return _held(found)


def _held(found: Sampled) -> Sampled:
    """With the errors of B and C of one-sided rows in their values: exact, since x ≥ 0."""
    values, bounds, rest = found.values, found.bounds, found.error.copy()
    for side, sign in ((1, 1.0), (0, -1.0)):
        rows = np.isinf(bounds[0, :, 1 - side]) & np.isfinite(bounds[0, :, side])
        values[:, :, rows, 1:] += sign * found.error[:, None, rows, 1:]
        rest[:, rows, 1:] = 0.0
    return replace(found, rest=rest)


def _check(constraint: Constraint, rows: Rows, s: Array) -> None:
    name, shape = type(constraint).__name__, (*s.shape, len(rows.names))
    for letter in "ABC":
        values = np.asarray(getattr(rows, letter))
        if values.shape != shape:
            raise InputError(f"{name} gives {letter} of shape {values.shape}; expected {shape}: places, rows")
        bad = ~np.isfinite(values).all(axis=2)
        if bad.any():
            raise InputError(f"{name} is not finite at s = {s[bad][0]:.6g} of the path")
    for letter in ("lower", "upper"):
        if np.shape(getattr(rows, letter)) != shape[2:]:
            raise InputError(f"{name} gives {letter} of shape {np.shape(getattr(rows, letter))}; expected {shape[2:]}")


def _estimated(path: PolynomialPath, s: Array, constraint: Constraint, rows: Rows) -> Array:
    """Estimated errors ``(N, E, 3)``: what the quartics miss half-way between their samples."""
    middle = 0.5 * (s[:, 0] + s[:, 4])
    halves = np.stack([np.linspace(s[:, 0], middle, 5, axis=1), np.linspace(middle, s[:, 4], 5, axis=1)], axis=1)
    finer = constraint.rows(path, halves.reshape(-1, 5))
    missed = []
    for letter in "ABC":
        at = np.asarray(getattr(finer, letter)).reshape(s.shape[0], 10, -1)[:, [1, 3, 6, 8]]
        missed.append(np.abs(at - _HALVES @ getattr(rows, letter)).max(axis=1))
    return ESTIMATE * np.stack(missed, axis=-1)
