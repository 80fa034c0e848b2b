"""Velocities at via points (T): by hand from a Cartesian twist, by a heuristic, or for continuous acceleration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_shaped, choice
from ..errors import InputError
from .motion import Trajectory
from .piecewise import hermite

if TYPE_CHECKING:
    from ..kinematics import Robot

_METHODS = ("continuous", "heuristic", "rest")


def through(
    points: ArrayLike,
    times: ArrayLike,
    velocities: ArrayLike | str = "continuous",
    *,
    v0: ArrayLike | None = None,
    vf: ArrayLike | None = None,
) -> Trajectory:
    """Cubics through *points* ``(M, n)`` at *times* ``(M,)`` with the given velocities at the points.

    *velocities* is ``(M, n)``, or the name of a method of `via_velocities`.
    """
    q, t = _waypoints(points, times)
    if isinstance(velocities, str):
        v = via_velocities(q, t, velocities, v0=v0, vf=vf)
    else:
        v = as_shaped(velocities, "velocities", *q.shape)
        if v0 is not None or vf is not None:
            raise InputError("v0 and vf are part of the given velocities; leave them out")
    return Trajectory(t - t[0], hermite(t - t[0], np.stack([q, v])))


def via_velocities(
    points: ArrayLike,
    times: ArrayLike,
    method: str = "continuous",
    *,
    v0: ArrayLike | None = None,
    vf: ArrayLike | None = None,
) -> Array:
    """Velocities ``(M, n)`` at via *points* passed at *times*, with *v0*, *vf* (rest by default) at the ends.

    ``"heuristic"``: zero where the mean velocities before and after have different signs, else their mean.
    ``"continuous"``: those that make the acceleration continuous, by the tridiagonal system
    ``h_k v_{k−1} + 2 (h_{k−1} + h_k) v_k + h_{k−1} v_{k+1} = 3 (h_k m_{k−1} + h_{k−1} m_k)``, where h are the
    durations and m the mean velocities of the segments. ``"rest"``: stop at every point.
    """
    q, t = _waypoints(points, times)
    choice(method, "method", _METHODS)
    n = q.shape[1]
    v = np.zeros_like(q)
    for k, value, name in ((0, v0, "v0"), (-1, vf, "vf")):
        if value is not None:
            array = as_array(value, name)
            if array.shape not in ((), (n,)):
                raise InputError(f"{name} has shape {array.shape}; expected ({n},)")
            v[k] = array
    h = np.diff(t)
    m = np.diff(q, axis=0) / h[:, None]
    if method == "heuristic":
        v[1:-1] = np.where(m[:-1] * m[1:] > 0.0, 0.5 * (m[:-1] + m[1:]), 0.0)
    elif method == "continuous" and q.shape[0] > 2:
        from scipy.linalg import solve_banded

        rhs = 3.0 * (h[1:, None] * m[:-1] + h[:-1, None] * m[1:])
        rhs[0] -= h[1] * v[0]
        rhs[-1] -= h[-2] * v[-1]
        band = np.zeros((3, h.size - 1))
        band[1] = 2.0 * (h[:-1] + h[1:])
        band[0, 1:] = h[:-2]
        band[2, :-1] = h[2:]
        v[1:-1] = solve_banded((1, 1), band, rhs)
    return v


def cartesian_velocities(robot: Robot, frame: str, q: ArrayLike, twists: ArrayLike, damping: float = 1e-6) -> Array:
    """Joint velocities ``(M, n)`` that move *frame* with given *twists* ``(M, 6)`` = (v, ω) at joint vectors *q*.

    Least squares ``q̇ = Jᵗ (J Jᵗ + λ² 1)⁻¹ V`` with λ = *damping* times the largest singular value; raises `InputError`
    at a point where the twist is lost (its part in a singular direction exceeds 1 %).
    """
    q = as_shaped(q, "q", robot.n)
    V = as_shaped(twists, "twists", 6)
    q, V = np.broadcast_arrays(q, np.broadcast_to(V, (*q.shape[:-1], 6))) if q.ndim == 1 else (q, V)
    J = robot.jacobian(q, frame)
    u, s, vt = np.linalg.svd(J, full_matrices=False)
    size = damping * s[..., :1]
    inner = np.einsum("...ji,...j->...i", u, np.broadcast_to(V, (*J.shape[:-2], 6)))
    v = np.einsum("...ij,...i->...j", vt, s / (s**2 + size**2 + 1e-300) * inner)
    lost = np.linalg.norm(np.einsum("...ij,...j->...i", J, v) - V, axis=-1)
    allowed = 1e-2 * np.linalg.norm(V, axis=-1)
    if (lost > allowed + 1e-12).any():
        k = int(np.argmax(lost - allowed))
        raise InputError(
            f"the twist at point {k} cannot be made: {lost.reshape(-1)[k]:.3g} of it lies in a direction that "
            f"{frame!r} has lost there (singular configuration); choose another twist or another configuration"
        )
    return np.asarray(v)


def _waypoints(points: ArrayLike, times: ArrayLike) -> tuple[Array, Array]:
    q, t = as_array(points, "points"), as_array(times, "times")
    if q.ndim != 2 or q.shape[0] < 2:
        raise InputError(f"points has shape {q.shape}; expected (M, n) with M ≥ 2")
    if t.shape != (q.shape[0],):
        raise InputError(f"times has shape {t.shape}; expected ({q.shape[0]},), one per point")
    if np.diff(t).min() <= 0.0:
        k = int(np.diff(t).argmin())
        raise InputError(f"times must increase strictly; times[{k}] = {t[k]:.9g} is followed by {t[k + 1]:.9g}")
    return q, t
