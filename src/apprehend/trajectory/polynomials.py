"""Single polynomials between two states (T, cubic polynomials): cubic, quintic, septic, and minimum jerk."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from .motion import Trajectory
from .piecewise import hermite


def _states(duration: float, *pairs: tuple[str, ArrayLike | None, ArrayLike | None]) -> Trajectory:
    if not (np.isfinite(duration) and duration > 0.0):
        raise InputError(f"duration is {duration}; expected a positive time in seconds")
    start, end = (np.atleast_1d(as_array(v if v is not None else 0.0, n)) for n, v in zip(("q0", "qf"), pairs[0][1:]))
    if start.shape != end.shape or start.ndim != 1:
        raise InputError(f"q0 has shape {start.shape} and qf {end.shape}; expected the same (n,)")
    n = start.size
    states = np.empty((len(pairs), 2, n))
    for order, (name, a, b) in enumerate(pairs):
        for side, value in enumerate((a, b)):
            array = np.zeros(n) if value is None else as_array(value, f"{name} at the {('start', 'end')[side]}")
            if array.shape not in ((), (n,)):
                raise InputError(f"{name} has shape {array.shape}; expected ({n},)")
            states[order, side] = array
    return Trajectory([0.0, float(duration)], hermite(np.array([0.0, float(duration)]), states))


def cubic(
    q0: ArrayLike, qf: ArrayLike, duration: float, v0: ArrayLike | None = None, vf: ArrayLike | None = None
) -> Trajectory:
    """The cubic that meets position and velocity at both ends (T; the script calls its degree "order four").

    ``θ(t) = a0 + a1 t + a2 t² + a3 t³`` with ``a0 = θ0``, ``a1 = v0``, ``a2 = 3(θf − θ0)/T² − 2 v0/T − vf/T`` and
    ``a3 = −2(θf − θ0)/T³ + (v0 + vf)/T²``; rest at both ends by default.
    """
    return _states(duration, ("position", q0, qf), ("velocity", v0, vf))


def quintic(
    q0: ArrayLike,
    qf: ArrayLike,
    duration: float,
    v0: ArrayLike | None = None,
    vf: ArrayLike | None = None,
    a0: ArrayLike | None = None,
    af: ArrayLike | None = None,
) -> Trajectory:
    """The quintic that meets position, velocity and acceleration at both ends.

    Between states of rest it is the motion of least ``∫ jerk² dt``:
    ``θ0 + (θf − θ0)(10 τ³ − 15 τ⁴ + 6 τ⁵)`` with ``τ = t/T``.
    """
    return _states(duration, ("position", q0, qf), ("velocity", v0, vf), ("acceleration", a0, af))


def septic(
    q0: ArrayLike,
    qf: ArrayLike,
    duration: float,
    v0: ArrayLike | None = None,
    vf: ArrayLike | None = None,
    a0: ArrayLike | None = None,
    af: ArrayLike | None = None,
    j0: ArrayLike | None = None,
    jf: ArrayLike | None = None,
) -> Trajectory:
    """The polynomial of degree seven that also meets the jerk at both ends (least ``∫ snap² dt`` between rests)."""
    return _states(
        duration, ("position", q0, qf), ("velocity", v0, vf), ("acceleration", a0, af), ("jerk", j0, jf)
    )  # fmt: skip


def minimum_jerk(q0: ArrayLike, qf: ArrayLike, duration: float) -> Trajectory:
    """The motion of least ``∫ jerk² dt`` between two states of rest: the quintic."""
    return quintic(q0, qf, duration)


def squared_integral(motion: Trajectory, order: int) -> Array:
    """``∫ (dᵏq/dtᵏ)² dt`` per coordinate, exactly (the square is a polynomial)."""
    if order < 0:
        raise InputError(f"order is {order}; expected a whole number ≥ 0")
    total = np.zeros(motion.n)
    nodes, weights = np.polynomial.legendre.leggauss(max(motion.degree - order, 0) + 1)
    h = np.diff(motion.breaks)
    for z, w in zip(0.5 * (nodes + 1.0), 0.5 * weights):
        value = np.zeros((h.size, motion.n))
        for p in range(motion.degree, order - 1, -1):
            factor = float(np.prod(np.arange(p - order + 1, p + 1)))
            value = value * (z * h)[:, None] + factor * motion.coefficients[:, p]
        total += w * (h[:, None] * value**2).sum(axis=0)
    return total
