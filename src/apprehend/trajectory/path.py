"""Geometric paths in joint space: where to go, not yet when."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from .piecewise import Piecewise


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

    def __call__(self, s: ArrayLike, order: int = 0) -> Array:
        """The derivative *order* at *s*."""


class PolynomialPath(Piecewise):
    """A path made of polynomials: its ranges are proven, and its timing can be certified between grid points."""

    _variable = "s"


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
