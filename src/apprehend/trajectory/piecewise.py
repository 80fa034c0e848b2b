"""Piecewise polynomials in n coordinates: the one representation of joint paths and of motions in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from ..kernels import path as kernels

RANGE_TOLERANCE = 1e-12
"""Largest gap, relative to the largest magnitude, between a proven extremum and a value that is attained."""


@dataclass(frozen=True)
class Extrema:
    """Proven range of a function per coordinate, and where its ends are attained.

    The function never leaves ``[lower, upper]``, and comes within `RANGE_TOLERANCE` of both.
    """

    lower: Array
    upper: Array
    at_lower: Array
    at_upper: Array

    @property
    def magnitude(self) -> Array:
        """Largest absolute value per coordinate, ``(n,)``."""
        return np.maximum(np.abs(self.lower), np.abs(self.upper))


class Piecewise:
    """A polynomial on every interval between *breaks* ``(K + 1,)``.

    Parameters
    ----------
    breaks
        Strictly increasing, ``(K + 1,)``.
    coefficients
        ``(K, D + 1, n)``: low order first, in the local variable ``x − breaks[k]``.
    """

    _variable = "x"

    def __init__(self, breaks: ArrayLike, coefficients: ArrayLike) -> None:
        self.breaks: Array = as_array(breaks, "breaks")
        self.coefficients: Array = as_array(coefficients, "coefficients")
        if self.breaks.ndim != 1 or self.breaks.size < 2:
            raise InputError(f"breaks has shape {self.breaks.shape}; expected (K + 1,) with K ≥ 1")
        steps = np.diff(self.breaks)
        if steps.min() <= 0.0:
            k = int(steps.argmin())
            raise InputError(
                f"breaks must increase strictly; breaks[{k}] = {self.breaks[k]:.9g} is followed by "
                f"{self.breaks[k + 1]:.9g}"
            )
        if self.coefficients.ndim != 3 or self.coefficients.shape[0] != steps.size or 0 in self.coefficients.shape:
            raise InputError(
                f"coefficients has shape {self.coefficients.shape}; expected ({steps.size}, degree + 1, n), "
                "one row of polynomials per interval"
            )

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.coefficients.shape[2])

    @property
    def degree(self) -> int:
        """Degree of the pieces."""
        return int(self.coefficients.shape[1]) - 1

    @property
    def interval(self) -> tuple[float, float]:
        """First and last value of the variable."""
        return float(self.breaks[0]), float(self.breaks[-1])

    def __call__(self, x: ArrayLike, order: int = 0) -> Array:
        """The derivative *order* at *x* ``(...)``, shape ``(..., n)``; right limits at the breaks."""
        order = check_order(order)
        values = as_array(x, self._variable)
        start, end = self.interval
        slack = 1e-9 * (1.0 + abs(end - start))
        flat = values.reshape(-1)
        if flat.size and (flat.min() < start - slack or flat.max() > end + slack):
            bad = float(flat[int(np.argmax(np.maximum(start - flat, flat - end)))])
            raise InputError(f"{self._variable} = {bad:.9g} lies outside [{start:.9g}, {end:.9g}]")
        out = np.empty((flat.size, self.n))
        kernels.evaluate(self.breaks, self.coefficients, np.clip(flat, start, end), order, out)
        return out.reshape(*values.shape, self.n)

    def extrema(self, order: int = 0, tolerance: float = RANGE_TOLERANCE) -> Extrema:
        """Proven range of the derivative *order* over the whole interval (Bernstein coefficients, subdivided).

        It is attained within *tolerance*, relative to the largest magnitude.
        """
        order = check_order(order)
        upper, at_upper, lower, at_lower = (np.empty(self.n) for _ in range(4))
        kernels.upper_bound(self.breaks, self.coefficients, order, 1.0, tolerance, upper, at_upper)
        kernels.upper_bound(self.breaks, self.coefficients, order, -1.0, tolerance, lower, at_lower)
        return Extrema(-lower, upper, at_lower, at_upper)

    def jumps(self, order: int) -> Array:
        """Jump of the derivative *order* at every inner break, ``(K − 1, n)``."""
        order = check_order(order)
        right = self.coefficients[1:, order] * _factorial(order) if order <= self.degree else 0.0
        h = np.diff(self.breaks)[:-1, None]
        left = np.zeros((h.shape[0], self.n))
        for p in range(self.degree, order - 1, -1):
            left = left * h + self.coefficients[:-1, p] * (_factorial(p) / _factorial(p - order))
        return np.asarray(right - left)

    def continuity(self, tolerance: float = 1e-9) -> int:
        """Largest k such that the function is Cᵏ: no derivative up to k jumps by more than *tolerance* × its size.

        The size is the largest magnitude of the derivative, for every coordinate by itself. −1 stands for a jump in the
        value itself; a single polynomial answers its degree.
        """
        for order in range(self.degree + 1):
            size = self.extrema(order, 1e-3).magnitude
            # what rounding of the value itself makes of a derivative
            noise = 1e-7 * np.abs(self.coefficients[:, 0]).max(axis=0) / float(np.diff(self.breaks).min()) ** order
            if (np.abs(self.jumps(order)) > tolerance * (size + noise)).any():
                return order - 1
        return self.degree

    def shifted(self, offset: float) -> Self:
        """The same function with its variable moved by *offset*."""
        return self._like(self.breaks + offset, self.coefficients)

    def _like(self, breaks: Array, coefficients: Array) -> Self:
        made = type(self).__new__(type(self))
        Piecewise.__init__(made, breaks, coefficients)
        return made


def _factorial(k: int) -> float:
    return float(np.prod(np.arange(1, k + 1)))


def check_order(order: int) -> int:
    """*order* of a derivative if it is a whole number ≥ 0."""
    if not isinstance(order, (int, np.integer)) or order < 0:
        raise InputError(f"order is {order!r}; expected a whole number ≥ 0 (0 is the value itself)")
    return int(order)


def hermite(breaks: Array, derivatives: Array) -> Array:
    """Coefficients ``(K, 2m, n)`` of the pieces that meet given values and derivatives at both ends.

    *derivatives* ``(m, K + 1, n)`` holds the value and its derivatives up to order m − 1 at every break; the pieces
    have degree 2m − 1 (m = 2: cubic, 3: quintic, 4: septic).
    """
    m, _, n = derivatives.shape
    h = np.diff(breaks)[:, None]
    count = h.shape[0]
    degree = 2 * m - 1
    out = np.zeros((count, degree + 1, n))
    powers = [h**p for p in range(degree + 1)]
    for p in range(m):
        out[:, p] = derivatives[p, :-1] / _factorial(p)
    # the upper half in units of h: solve for the scaled coefficients at the right end
    matrix = np.array([[_factorial(p) / _factorial(p - r) for p in range(m, degree + 1)] for r in range(m)])
    rhs = np.empty((m, count, n))
    for r in range(m):
        taylor = sum(out[:, p] * powers[p - r] * (_factorial(p) / _factorial(p - r)) for p in range(r, m))
        rhs[r] = (derivatives[r, 1:] - taylor) * powers[r]
    scaled = np.linalg.solve(matrix, rhs.reshape(m, -1)).reshape(m, count, n)
    for i, p in enumerate(range(m, degree + 1)):
        out[:, p] = scaled[i] / powers[p]
    return out
