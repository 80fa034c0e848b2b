"""Linear motion with parabolic blends (T, Lineare Funktion mit parabolischen Übergängen)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, as_array, as_vector
from ..errors import InputError
from .motion import Trajectory
from .path import as_waypoints


def blend(
    q0: ArrayLike,
    qf: ArrayLike,
    duration: float | None = None,
    *,
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
) -> Trajectory:
    """Constant acceleration, constant velocity, constant deceleration; rest at both ends.

    Exactly two of *duration*, *velocity* and *acceleration* are given (magnitudes, scalar or ``(n,)``):

    - duration and acceleration: ``t_b = T/2 − √(a²T² − 4 |a| |Δ|)/(2 |a|)`` with ``Δ = θf − θ0``, where the
      acceleration of the first blend has the sign of Δ (T leaves signs and magnitudes out); feasible iff
      ``|a| ≥ 4 |Δ|/T²``;
    - duration and velocity: ``t_b = T − |Δ|/v``; feasible iff ``|Δ|/T ≤ v ≤ 2 |Δ|/T``;
    - velocity and acceleration: the fastest motion on the straight line from q0 to qf; all coordinates share its time
      law.

    With a given duration every coordinate has its own blend time, so that the path is straight only if these agree.
    """
    start, end = np.atleast_1d(as_array(q0, "q0")), np.atleast_1d(as_array(qf, "qf"))
    if start.shape != end.shape or start.ndim != 1:
        raise InputError(f"q0 has shape {start.shape} and qf {end.shape}; expected the same (n,)")
    if sum(v is not None for v in (duration, velocity, acceleration)) != 2:
        raise InputError("blend needs exactly two of duration, velocity and acceleration; the third follows")
    n, distance = start.size, np.abs(end - start)
    if duration is None:
        v, a = _positive(velocity, "velocity", n), _positive(acceleration, "acceleration", n)
        if not distance.any():
            raise InputError("q0 equals qf; give a duration for a motion that stands still")
        with np.errstate(divide="ignore"):
            return straight(start, end, float((v / distance).min()), *2 * (float((a / distance).min()),))
    T = float(duration)
    if not (np.isfinite(T) and T > 0.0):
        raise InputError(f"duration is {duration}; expected a positive time in seconds")
    if acceleration is not None:
        a = _positive(acceleration, "acceleration", n)
        _refuse(a < 4.0 * distance / T**2 * (1.0 - 1e-12), "acceleration", a, "at least", 4.0 * distance / T**2)
        root = np.sqrt(np.maximum(a**2 * T**2 - 4.0 * a * distance, 0.0))
        t_b = np.where(distance > 0.0, 2.0 * distance / (a * T + root), 0.0)  # T's formula, without cancellation
        size = np.where(distance > 0.0, a, 0.0)
    else:
        v = _positive(velocity, "velocity", n)
        _refuse((v < distance / T * (1.0 - 1e-12)) & (distance > 0), "velocity", v, "at least", distance / T)
        _refuse((v > 2.0 * distance / T * (1.0 + 1e-12)) & (distance > 0), "velocity", v, "at most", 2.0 * distance / T)
        t_b = np.where(distance > 0.0, T - distance / v, 0.0)
        if (t_b[distance > 0.0] <= 0.0).any():
            j = int(np.argmax((t_b <= 0.0) & (distance > 0.0)))
            raise InputError(f"velocity[{j}] = {v[j]:.6g} leaves no time to accelerate; give more than |Δ|/duration")
        size = np.divide(v, t_b, out=np.zeros(n), where=t_b > 0.0)
    return _blended(start, np.sign(end - start) * size, t_b, T)


def _blended(start: Array, a: Array, t_b: Array, T: float) -> Trajectory:
    """Each coordinate accelerates with *a* for *t_b*, cruises, and decelerates over the last *t_b* of *T*."""
    breaks = _merge(np.concatenate([[0.0, T], t_b, T - t_b]), T)
    t = breaks[:-1, None]
    middle = 0.5 * (breaks[:-1] + breaks[1:])[:, None]
    cruise, late = (middle >= t_b) & (middle < T - t_b), middle >= T - t_b
    v = a * t_b
    position = np.where(late, start + v * (T - t_b) - 0.5 * a * (T - t) ** 2, start + 0.5 * a * t**2)
    position = np.where(cruise, start + v * (t - 0.5 * t_b), position)
    speed = np.where(late, a * (T - t), np.where(cruise, v, a * t))
    bend = np.where(late, -0.5 * a, np.where(cruise, 0.0, 0.5 * a))
    return Trajectory(breaks, np.stack([position, speed, np.broadcast_to(bend, speed.shape)], axis=1))


def _merge(times: Array, T: float) -> Array:
    """Sorted times without near-duplicates, with 0 and T exactly."""
    times = np.sort(np.clip(times, 0.0, T))
    kept = [0.0]
    for t in times:
        if t - kept[-1] > 1e-12 * T and T - t > 1e-12 * T:
            kept.append(float(t))
    return np.array([*kept, T])


def straight(q0: Array, qf: Array, speed: float, up: float, down: float) -> Trajectory:
    """The fastest rest-to-rest motion ``q0 + (qf − q0) s(t)`` with ``ṡ ≤ speed``, ``−down ≤ s̈ ≤ up``."""
    peak = min(speed, float(np.sqrt(2.0 * up * down / (up + down))))
    t1, t3 = peak / up, peak / down
    s1, s3 = 0.5 * peak * t1, 0.5 * peak * t3
    t2 = max(1.0 - s1 - s3, 0.0) / peak
    if t2 <= 1e-12 * (t1 + t3):
        t = np.array([0.0, t1, t1 + t3])
        s = np.array([[0.0, 0.0, 0.5 * up], [1.0 - s3, peak, -0.5 * down]])
    else:
        t = np.array([0.0, t1, t1 + t2, t1 + t2 + t3])
        s = np.array([[0.0, 0.0, 0.5 * up], [s1, peak, 0.0], [1.0 - s3, peak, -0.5 * down]])
    coefficients = s[:, :, None] * (qf - q0)
    coefficients[:, 0] += q0
    return Trajectory(t, coefficients)


def blend_through(points: ArrayLike, durations: ArrayLike, acceleration: ArrayLike) -> Trajectory:
    """Straight segments with parabolic blends near the via points (T; the formulas are Craig's, ch. 7.3).

    *points* ``(M, n)``, *durations* ``(M − 1,)`` between them, *acceleration* the magnitude in the blends (scalar or
    ``(n,)``). The motion rests at the first and last point, reaches both exactly, and passes near the inner ones:
    around point k it changes from velocity ``v_{k−1}`` to ``v_k`` over ``t_k = |v_k − v_{k−1}|/a``.

    It is feasible iff no two blends overlap; `InputError` names the segment, the coordinate, and the least
    acceleration that would do for it.
    """
    q = as_waypoints(points)
    m, n = q.shape
    T = as_vector(durations, "durations", m - 1)
    if T.min() <= 0.0:
        raise InputError(f"durations[{int(T.argmin())}] is {T.min():.6g}; expected positive times in seconds")
    a = _positive(acceleration, "acceleration", n)
    if m == 2:
        return blend(q[0], q[1], float(T[0]), acceleration=a)
    delta = np.diff(q, axis=0)
    v = delta / T[:, None]
    t = np.zeros((m, n))
    for k, step, span in ((0, delta[0], T[0]), (m - 1, delta[-1], T[-1])):
        least = 2.0 * np.abs(step) / span**2
        _refuse(a < least * (1.0 - 1e-12), "acceleration", a, "at least", least)
        root = np.sqrt(np.maximum(span**2 - 2.0 * np.abs(step) / a, 0.0))
        t[k] = 2.0 * np.abs(step) / (a * (span + root))  # = T − √(T² − 2|Δ|/a)
    v[0] = delta[0] / (T[0] - 0.5 * t[0])
    v[-1] = delta[-1] / (T[-1] - 0.5 * t[-1])
    t[1:-1] = np.abs(np.diff(v, axis=0)) / a
    return _via(q, T, v, t)


def _via(q: Array, T: Array, v: Array, t: Array) -> Trajectory:
    """Assemble the blends of `blend_through`: velocities *v* per segment, blend times *t* per point."""
    n = q.shape[1]
    clock = np.concatenate([[0.0], np.cumsum(T)])
    begin, stop = clock[:, None] - 0.5 * t, clock[:, None] + 0.5 * t
    begin[0], stop[0] = 0.0, t[0]
    begin[-1], stop[-1] = clock[-1] - t[-1], clock[-1]
    cruise = begin[1:] - stop[:-1]
    if cruise.min() < -1e-12 * T.max():
        k, j = (int(i) for i in np.unravel_index(cruise.argmin(), cruise.shape))
        raise InputError(
            f"the blends of segment {k} overlap in coordinate {j} by {-cruise[k, j]:.6g} s; raise the acceleration "
            f"or the duration of that segment ({T[k]:.6g} s)"
        )
    breaks = _merge(np.concatenate([begin.ravel(), stop.ravel()]), float(clock[-1]))
    middle = 0.5 * (breaks[:-1] + breaks[1:])
    coefficients = np.zeros((middle.size, 3, n))
    speeds = np.concatenate([np.zeros((1, n)), v, np.zeros((1, n))])
    for j in range(n):
        velocity = np.zeros(middle.size + 1)
        bend = np.zeros(middle.size)
        for i, tau in enumerate(middle):
            inside = np.flatnonzero((tau >= begin[:, j]) & (tau < stop[:, j]))
            if inside.size:
                k = int(inside[0])
                bend[i] = (speeds[k + 1, j] - speeds[k, j]) / t[k, j]
                velocity[i] = speeds[k, j] + bend[i] * (breaks[i] - begin[k, j])
            else:
                velocity[i] = speeds[int(np.searchsorted(begin[:, j], tau)), j]
        h = np.diff(breaks)
        coefficients[:, 0, j] = q[0, j] + np.concatenate([[0.0], np.cumsum(velocity[:-1] * h + 0.5 * bend * h**2)[:-1]])
        coefficients[:, 1, j] = velocity[:-1]
        coefficients[:, 2, j] = 0.5 * bend
    return Trajectory(breaks, coefficients)


def _positive(value: ArrayLike | None, name: str, n: int) -> Array:
    array = as_vector(np.inf if value is None else value, name, n)
    if not (np.isfinite(array).all() and array.min() > 0.0):
        j = int(np.argmin(np.where(np.isfinite(array), array, -1.0)))
        raise InputError(
            f"{name}[{j}] is {array[j]:.6g}; expected a positive magnitude (the sign follows from qf − q0)"
        )
    return array


def _refuse(wrong: BoolArray, name: str, value: Array, relation: str, bound: Array) -> None:
    if wrong.any():
        j = int(np.argmax(wrong))
        raise InputError(f"{name}[{j}] is {value[j]:.6g}; this motion needs {relation} {bound[j]:.6g}")


__all__ = ["blend", "blend_through", "straight"]
