"""The motion of a pick-and-place operation with its four conditions (T)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_vector
from ..errors import InputError
from .limits import Limits
from .motion import Trajectory

_NAMES = ("pick", "lift-off", "set-down", "place")


def pick_and_place(
    points: ArrayLike,
    durations: ArrayLike | None = None,
    *,
    limits: Limits | Any | None = None,
    v0: ArrayLike | None = None,
    a0: ArrayLike | None = None,
    vf: ArrayLike | None = None,
    af: ArrayLike | None = None,
) -> Trajectory:
    """The motion pick → lift-off → set-down → place through *points* ``(4, n)``.

    T's conditions: (a) at the pick, position, velocity *v0* and acceleration *a0* are given (rest by default);
    (b) at the lift-off and (c) at the set-down the position is given and the motion is continuous up to its
    acceleration; (d) at the place, as at the pick, *vf* and *af*. These are exactly met by a quartic, a cubic and a
    quartic.

    *durations* ``(3,)`` of the segments; or *limits*, then the shares of the segments are searched for the shortest
    motion whose proven extrema keep the limits (rest at both ends only: time is scaled).
    """
    q = as_array(points, "points")
    if q.ndim != 2 or q.shape[0] != 4:
        raise InputError(f"points has shape {q.shape}; expected (4, n): {', '.join(_NAMES)}")
    n = q.shape[1]
    ends = np.zeros((4, n))
    for i, (name, value) in enumerate((("v0", v0), ("a0", a0), ("vf", vf), ("af", af))):
        if value is not None:
            ends[i] = as_vector(value, name, n)
    if (durations is None) == (limits is None):
        raise InputError("pick_and_place needs either durations (3,) or limits")
    if durations is not None:
        h = as_vector(durations, "durations", 3)
        if h.min() <= 0.0 or not np.isfinite(h).all():
            raise InputError(f"durations is {h.tolist()}; expected three positive times in seconds")
        return _quartic_cubic_quartic(q, h, ends)
    if ends.any():
        raise InputError("with limits the motion starts and ends at rest; give durations for other end states")
    return _fastest(q, Limits.read(limits))


def _quartic_cubic_quartic(q: Array, h: Array, ends: Array) -> Trajectory:
    """Solve the 14 conditions for the 14 coefficients, for all coordinates at once."""
    sizes = (5, 4, 5)
    first = np.concatenate([[0], np.cumsum(sizes)])
    rows, rhs = np.zeros((14, 14)), np.zeros((14, q.shape[1]))

    def derivative(piece: int, t: float, order: int) -> Array:
        row = np.zeros(14)
        for p in range(order, sizes[piece]):
            row[first[piece] + p] = np.prod(np.arange(p - order + 1, p + 1)) * t ** (p - order)
        return row

    conditions = [
        (derivative(0, 0.0, 0), q[0]), (derivative(0, 0.0, 1), ends[0]), (derivative(0, 0.0, 2), ends[1]),
        (derivative(2, h[2], 0), q[3]), (derivative(2, h[2], 1), ends[2]), (derivative(2, h[2], 2), ends[3]),
    ]  # fmt: skip
    for k in (0, 1):
        conditions += [(derivative(k, h[k], 0), q[k + 1]), (derivative(k + 1, 0.0, 0), q[k + 1])]
        conditions += [
            (derivative(k, h[k], order) - derivative(k + 1, 0.0, order), np.zeros(q.shape[1])) for order in (1, 2)
        ]
    for i, (row, value) in enumerate(conditions):
        rows[i], rhs[i] = row, value
    found = np.linalg.solve(rows, rhs)
    coefficients = np.zeros((3, 5, q.shape[1]))
    for k in range(3):
        coefficients[k, : sizes[k]] = found[first[k] : first[k + 1]]
    return Trajectory(np.concatenate([[0.0], np.cumsum(h)]), coefficients)


def _fastest(q: Array, limits: Limits) -> Trajectory:
    from scipy.optimize import minimize

    lengths = np.linalg.norm(np.diff(q, axis=0), axis=1)
    if lengths.min() <= 1e-12:
        k = int(lengths.argmin())
        raise InputError(f"{_NAMES[k]} and {_NAMES[k + 1]} coincide; the four points must differ")
    n = q.shape[1]
    bounds = [(order, limits.pairs(name, n)) for order, name in ((1, "velocity"), (2, "acceleration"), (3, "jerk"))]
    if not any(np.isfinite(pairs).any() for _, pairs in bounds):
        raise InputError("limits holds no finite bound on velocity, acceleration or jerk")

    def scaled(z: Array) -> Trajectory:
        motion = _quartic_cubic_quartic(q, np.exp(np.clip(z, -4.0, 4.0)), np.zeros((4, n)))
        factor = 0.0
        for order, pairs in bounds:
            found = motion.extrema(order)
            ratio = np.maximum(found.upper / pairs[:, 1], found.lower / pairs[:, 0]).max()
            factor = max(factor, float(ratio) ** (1.0 / order))
        return motion.stretched(factor * (1.0 + 1e-12))

    start = np.log(lengths / lengths.mean()) * 0.5
    found = minimize(lambda z: scaled(z).duration, start, method="Nelder-Mead", options={"maxfev": 200, "xatol": 1e-3})
    return scaled(found.x)
