"""Geometric paths in joint space: where to go, not yet when."""

from __future__ import annotations

from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from .piecewise import Piecewise, hermite


@runtime_checkable
class Path(Protocol):
    """What is followed: a curve ``path(s, order)`` in n coordinates over ``interval``.

    ``path(s)`` is the configuration ``(..., n)`` at ``s (...)`` and ``path(s, k)`` its k-th derivative by s. Any
    object with these three members is a path; those of this package are `PolynomialPath` and its children.
    """

    @property
    def n(self) -> int:
        """Number of coordinates."""

    @property
    def interval(self) -> tuple[float, float]:
        """First and last value of s."""

    def __call__(self, s: ArrayLike, order: int = 0, /) -> Array:
        """The derivative *order* at *s*."""


class PolynomialPath(Piecewise):
    """A path made of polynomials: its ranges are proven, and its timing can be certified between grid points."""

    _variable = "s"

    @cached_property
    def at_least_cubic(self) -> Array:
        """The coefficients, with zeros up to degree 3."""
        missing = 4 - self.coefficients.shape[1]
        return np.pad(self.coefficients, ((0, 0), (0, missing), (0, 0))) if missing > 0 else self.coefficients

    @cached_property
    def smooth(self) -> bool:
        """Whether the path is C² (its curvature does not jump)."""
        return self.continuity() >= min(2, self.degree)


def as_polynomial(path: Path, tolerance: float = 1e-8, pieces: int = 2**14) -> PolynomialPath:
    """*path* itself if it is made of polynomials, else quintic Hermite pieces that follow it.

    The pieces meet value and first two derivatives at their ends (the result is C² where the path is); intervals are
    halved until the middle and the quarters are met within *tolerance*. Raises `InputError` where *pieces* do not do.
    """
    if isinstance(path, PolynomialPath):
        return path
    if not isinstance(path, Path):
        raise InputError(
            f"path is {type(path).__name__}; expected a Path: path(s, order), path.interval, path.n (waypoints: "
            "Spline(waypoints) or polyline(waypoints))"
        )
    start, end = path.interval
    grid = np.linspace(start, end, 9)
    while True:
        states = np.stack([np.asarray(path(grid, order), dtype=np.float64) for order in range(3)])
        made = PolynomialPath(grid, hermite(grid, states))
        inner = (grid[:-1, None] + np.diff(grid)[:, None] * np.array([0.25, 0.5, 0.75])).ravel()
        error = np.abs(made(inner) - path(inner)).max(axis=1).reshape(-1, 3).max(axis=1)
        rough = error > tolerance
        if not rough.any():
            return made
        if grid.size > pieces or np.diff(grid)[rough].min() < 1e-9 * (end - start):
            k = int(error.argmax())
            raise InputError(
                f"the path is not smooth near s = {grid[k]:.6g}: {grid.size - 1} quintic pieces miss it by "
                f"{error[k]:.3g}"
            )
        grid = np.sort(np.concatenate([grid, 0.5 * (grid[:-1] + grid[1:])[rough]]))


def polyline(points: ArrayLike) -> PolynomialPath:
    """The straight segments through *points* ``(M, n)``, with s the Euclidean length travelled.

    Points that repeat their predecessor are dropped. It is only C⁰: time it with `follow`, which stops at the corners
    or rounds them.
    """
    points = as_waypoints(points)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    breaks = np.concatenate([[0.0], np.cumsum(lengths)])
    coefficients = np.stack([points[:-1], np.diff(points, axis=0) / lengths[:, None]], axis=1)
    return PolynomialPath(breaks, coefficients)


def as_waypoints(points: ArrayLike, name: str = "points") -> Array:
    """*points* as ``(M, n)`` with M ≥ 2, without immediate repetitions (closer than 1e-12)."""
    array = as_array(points, name)
    if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] < 1:
        raise InputError(f"{name} has shape {array.shape}; expected (M, n) with at least two points")
    keep = np.concatenate([[True], np.linalg.norm(np.diff(array, axis=0), axis=1) > 1e-12])
    kept: Array = array[keep]
    if kept.shape[0] < 2:
        raise InputError(f"all {array.shape[0]} {name} coincide; a path needs at least two different ones")
    return kept
