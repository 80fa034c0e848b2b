"""The geometry of a curve in n coordinates: arc length, tangent, curvatures, bending energy (T).

Every function takes a curve: a `Path` or a `Trajectory`, anything with ``curve(x, order)`` and ``curve.interval``.
None of them depends on how fast the parameter runs, but for the parameter itself.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from .path import Path
from .piecewise import check_order

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


def arc_length(curve: Path, start: float | None = None, end: float | None = None, *, tolerance: float = 1e-12) -> float:
    """``L = ∫ |q'(x)| dx`` from *start* to *end* (the whole curve by default), to a relative *tolerance*."""
    return _integrate(curve, lambda x: np.linalg.norm(curve(x, 1), axis=-1), start, end, tolerance)


def bending_energy(
    curve: Path, start: float | None = None, end: float | None = None, *, tolerance: float = 1e-11
) -> float:
    """``E = ∫ κ² dL = ∫ κ(x)² |q'(x)| dx``."""

    def density(x: Array) -> Array:
        first, second = curve(x, 1), curve(x, 2)
        square = (first**2).sum(axis=-1)
        across = _across(first, second, square)
        found: Array = np.divide(
            (across**2).sum(axis=-1), square**1.5, out=np.zeros_like(square), where=square > 1e-200
        )
        return found

    return _integrate(curve, density, start, end, tolerance)


def tangent(curve: Path, x: ArrayLike) -> Array:
    """Unit tangent ``U = q'/|q'|`` at *x* ``(...)``, shape ``(..., n)``."""
    first = curve(x, 1)
    return np.asarray(first / np.sqrt(_moving(curve, x, first))[..., None])


def curvature(curve: Path, x: ArrayLike) -> Array:
    """``κ = |dU/dL| = √(|q'|² |q''|² − (q'·q'')²) / |q'|³`` at *x* ``(...)``.

    T prints the denominator as ``|q'|^{3/2}``; a circle of radius r shows that it is ``|q'|³``.
    """
    first, second = curve(x, 1), curve(x, 2)
    square = _moving(curve, x, first)
    return np.asarray(np.linalg.norm(_across(first, second, square), axis=-1) / square)


def torsion(curve: Path, x: ArrayLike) -> Array:
    """How fast the curve leaves its osculating plane at *x* ``(...)``: the second curvature.

    In three coordinates it has a sign, ``det(q', q'', q''')/|q' × q''|²``; otherwise it is
    ``|b₃| / (|b₁| |b₂|)`` with b₁, b₂, b₃ the derivatives q', q'', q''' made orthogonal in this order.
    """
    b1, b2, b3 = _orthogonal(curve, x)
    s1, s2 = (b1**2).sum(axis=-1), (b2**2).sum(axis=-1)
    if not (s2 > 0.0).all():
        raise InputError("torsion is not defined where the curvature is zero; the curve is straight there")
    size = np.sqrt((b3**2).sum(axis=-1) / (s1 * s2))
    if b1.shape[-1] == 3:
        size = np.copysign(size, np.linalg.det(np.stack([b1, b2, b3], axis=-2)))
    return np.asarray(size)


def _orthogonal(curve: Path, x: ArrayLike) -> tuple[Array, Array, Array]:
    first, second, third = curve(x, 1), curve(x, 2), curve(x, 3)
    square = _moving(curve, x, first)
    b2 = _across(first, second, square)
    b3 = _across(first, third, square)
    s2 = (b2**2).sum(axis=-1, keepdims=True)
    along = np.divide((b3 * b2).sum(axis=-1, keepdims=True), s2, out=np.zeros_like(s2), where=s2 > 0.0)
    return first, b2, b3 - along * b2


def _across(first: Array, vector: Array, square: Array) -> Array:
    """The part of *vector* across *first*, whose squared length is *square*."""
    along = np.divide((first * vector).sum(axis=-1), square, out=np.zeros_like(square), where=square > 0.0)
    return np.asarray(vector - along[..., None] * first)


def _moving(curve: Path, x: ArrayLike, first: Array) -> Array:
    square = np.asarray((first**2).sum(axis=-1))
    if not (square > 0.0).all():
        at = np.asarray(x, dtype=np.float64).reshape(-1)[int(square.reshape(-1).argmin())]
        raise InputError(f"the curve rests at {at:.6g}: its tangent is not defined there; ask beside it")
    return square


def _integrate(
    curve: Path, f: Callable[[Array], Array], start: float | None, end: float | None, tolerance: float
) -> float:
    """Adaptive Gauss–Legendre over the pieces of the curve."""
    low, high = curve.interval
    a = low if start is None else float(start)
    b = high if end is None else float(end)
    if not low <= a <= b <= high:
        raise InputError(f"the range [{a:.9g}, {b:.9g}] must increase and lie in [{low:.9g}, {high:.9g}]")
    breaks = getattr(curve, "breaks", np.linspace(a, b, 9))
    edges = np.unique(np.concatenate([[a], breaks[(breaks > a) & (breaks < b)], [b]]))
    left, right = edges[:-1], edges[1:]
    coarse = _gauss(f, left, right)
    total = 0.0
    for _ in range(40):
        if left.size == 0:
            break
        middle = 0.5 * (left + right)
        first, second = _gauss(f, left, middle), _gauss(f, middle, right)
        size = abs(total) + float(np.abs(first + second).sum()) + 1e-300
        done = np.abs(first + second - coarse) <= tolerance * size / max(left.size, 8)
        done |= right - left <= 1e-12 * (b - a)
        total += float((first + second)[done].sum())
        left, right, coarse = (
            np.concatenate([left[~done], middle[~done]]),
            np.concatenate([middle[~done], right[~done]]),
            np.concatenate([first[~done], second[~done]]),
        )
    return total + float(coarse.sum())


def _gauss(f: Callable[[Array], Array], left: Array, right: Array) -> Array:
    half = 0.5 * (right - left)
    x = 0.5 * (left + right)[:, None] + half[:, None] * _NODES
    values: Array = f(x) @ _WEIGHTS * half
    return values


class NaturalPath:
    """A path with its arc length as parameter (T, natural parameter): ``|dq/dL| = 1`` everywhere.

    It is a `Path` itself, with derivatives up to order 3; ``parameter(L)`` is the original one.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        low, high = path.interval
        if not high > low:
            raise InputError(f"the path has the interval [{low:.9g}, {high:.9g}]; expected a positive length")
        breaks = np.asarray(getattr(path, "breaks", np.linspace(low, high, 17)))
        self._s = np.concatenate([np.linspace(a, b, 17)[:-1] for a, b in zip(breaks[:-1], breaks[1:])] + [[high]])
        pieces = [arc_length(path, a, b, tolerance=1e-13) for a, b in zip(self._s[:-1], self._s[1:])]
        self._length = np.concatenate([[0.0], np.cumsum(pieces)])
        if self._length[-1] <= 0.0:
            raise InputError("the path has no length")

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return self.path.n

    @property
    def interval(self) -> tuple[float, float]:
        """0 and the length of the path."""
        return 0.0, float(self._length[-1])

    @cached_property
    def breaks(self) -> Array:
        """Lengths at the breaks of the original path."""
        inner = np.asarray(getattr(self.path, "breaks", self.path.interval))
        return np.asarray(np.interp(inner, self._s, self._length))

    def parameter(self, length: ArrayLike) -> Array:
        """The original parameter at *length* ``(...)``: Newton's iteration from a table, within its interval."""
        values = as_array(length, "length")
        end = self.interval[1]
        if values.size and (values.min() < -1e-9 * (1.0 + end) or values.max() > end * (1.0 + 1e-9)):
            raise InputError(f"length {values.min():.9g} … {values.max():.9g} lies outside [0, {end:.9g}]")
        flat = np.clip(values.reshape(-1), 0.0, end)
        k = np.clip(np.searchsorted(self._length, flat, side="right") - 1, 0, self._s.size - 2)
        low, high = self._s[k], self._s[k + 1]
        share = (flat - self._length[k]) / np.maximum(self._length[k + 1] - self._length[k], 1e-300)
        s = low + share * (high - low)
        for _ in range(30):
            found = self._length[k] + _gauss(lambda x: np.linalg.norm(self.path(x, 1), axis=-1), self._s[k], s)
            wrong = found - flat
            low, high = np.where(wrong < 0.0, s, low), np.where(wrong > 0.0, s, high)
            if np.abs(wrong).max(initial=0.0) <= 1e-14 * (1.0 + end):
                break
            speed = np.linalg.norm(self.path(s, 1), axis=-1)
            step = s - np.divide(wrong, speed, out=np.zeros_like(wrong), where=speed > 0.0)
            s = np.where((step > low) & (step < high), step, 0.5 * (low + high))
        return np.asarray(s.reshape(values.shape))

    def __call__(self, length: ArrayLike, order: int = 0, /) -> Array:
        """The derivative *order* ≤ 3 by arc length at *length* ``(...)``."""
        order = check_order(order)
        s = self.parameter(length)
        if order == 0:
            return self.path(s)
        first = self.path(s, 1)
        v = _moving(self.path, s, first)[..., None]
        if order == 1:
            return np.asarray(first / np.sqrt(v))
        second = self.path(s, 2)
        v1 = 2.0 * (first * second).sum(axis=-1, keepdims=True)
        if order == 2:
            return np.asarray(second / v - 0.5 * first * v1 / v**2)
        if order == 3:
            third = self.path(s, 3)
            v2 = 2.0 * ((second**2).sum(axis=-1, keepdims=True) + (first * third).sum(axis=-1, keepdims=True))
            bend = -0.5 * v2 / v**2.5 + v1**2 / v**3.5
            return np.asarray(third / v**1.5 - 1.5 * second * v1 / v**2.5 + first * bend)
        raise InputError(f"order is {order}; a natural parametrisation has derivatives up to 3")
