"""Jerk-limited motion: from state to state, and timing along a path."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from .constraints import Rows
from .limits import Limits
from .motion import Trajectory
from .path import Path, PolynomialPath, as_polynomial
from .piecewise import RANGE_TOLERANCE, Piecewise
from .timing import Timing, composed, time_optimal

_SYNCHRONIZATION = ("time", "phase", "none")


def state_to_state(
    q0: ArrayLike,
    qf: ArrayLike,
    limits: Limits | Any,
    *,
    v0: ArrayLike | None = None,
    vf: ArrayLike | None = None,
    a0: ArrayLike | None = None,
    af: ArrayLike | None = None,
    synchronization: str = "time",
    duration: float | None = None,
) -> Trajectory:
    """The fastest motion between two states within velocity, acceleration and jerk limits (by the library Ruckig).

    States are position, velocity, acceleration ``(n,)`` (rest by default). All coordinates arrive together:
    ``synchronization="time"``, or along a straight line where that is possible (``"phase"``); ``"none"`` lets every
    coordinate arrive as soon as it can. *duration* asks for at least that many seconds.
    """
    import ruckig

    limits = Limits.read(limits)
    start, end = np.atleast_1d(as_array(q0, "q0")), np.atleast_1d(as_array(qf, "qf"))
    if start.shape != end.shape or start.ndim != 1:
        raise InputError(f"q0 has shape {start.shape} and qf {end.shape}; expected the same (n,)")
    if synchronization not in _SYNCHRONIZATION:
        raise InputError(f"synchronization is {synchronization!r}; expected one of {', '.join(_SYNCHRONIZATION)}")
    n = start.size
    given = ruckig.InputParameter(n)
    given.current_position, given.target_position = start.tolist(), end.tolist()
    given.current_velocity, given.target_velocity = _state(v0, "v0", n), _state(vf, "vf", n)
    given.current_acceleration, given.target_acceleration = _state(a0, "a0", n), _state(af, "af", n)
    for name, (low, high) in (
        ("velocity", ("min_velocity", "max_velocity")),
        ("acceleration", ("min_acceleration", "max_acceleration")),
        ("jerk", (None, "max_jerk")),
    ):  # fmt: skip
        pairs = limits.pairs(name, n)
        if name != "velocity" and not np.isfinite(pairs).all():
            raise InputError(
                f"limits.{name} is not finite; a jerk-limited motion needs all of velocity, acceleration, jerk"
            )
        if low is None and not np.array_equal(-pairs[:, 0], pairs[:, 1]):
            raise InputError("limits.jerk must be the same in both directions")
        setattr(given, high, pairs[:, 1].tolist())
        if low is not None:
            setattr(given, low, pairs[:, 0].tolist())
    given.synchronization = getattr(
        ruckig.Synchronization, {"time": "Time", "phase": "Phase", "none": "No"}[synchronization]
    )
    if duration is not None:
        given.minimum_duration = float(duration)
    made = ruckig.Trajectory(n)
    try:
        outcome = ruckig.Ruckig(n).calculate(given, made)
    except ruckig.RuckigError as error:  # it validates its input
        raise InputError(f"the states cannot be joined within the limits: {error}") from error
    if outcome not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise InputError(f"the states cannot be joined within the limits: ruckig answers {outcome.name}")
    return _collect(made, n)


def _collect(made: Any, n: int) -> Trajectory:
    """Ruckig's profiles as one piecewise cubic on the union of their switching times."""
    total = float(made.duration)
    if total <= 0.0:
        raise InputError("q0 and qf are the same state; there is nothing to move")
    edges = [np.array([0.0, total])]
    for profile in made.profiles[0]:
        edges.append(np.cumsum([*profile.brake.t, *profile.t, *profile.accel.t]))
    times = distinct(np.clip(np.concatenate(edges), 0.0, total))
    middle = 0.5 * (times[:-1] + times[1:])
    # the state at the middle of an interval gives its cubic: the jerk is constant around it
    jets = np.empty((4, middle.size, n))
    for i, (m, d) in enumerate(zip(middle, 0.25 * np.diff(times))):
        jets[:3, i] = made.at_time(float(m))[:3]
        before, after = (np.asarray(made.at_time(float(m + sign * d))[2]) for sign in (-1.0, 1.0))
        jets[3, i] = (after - before) / (2.0 * d)
    return Trajectory(times, np.stack([_around(middle, times[:-1], list(jets[:, :, j])) for j in range(n)], axis=-1))


def _state(value: ArrayLike | None, name: str, n: int) -> list[float]:
    array = np.zeros(n) if value is None else as_array(value, name)
    if array.shape not in ((), (n,)):
        raise InputError(f"{name} has shape {array.shape}; expected ({n},)")
    found: list[float] = np.broadcast_to(array, (n,)).tolist()
    return found


def jerk_limited(
    path: Path, limits: Limits | Any, *, grid: int | ArrayLike = 200, least: int = 1, trials: int = 60
) -> Trajectory:
    """A motion along *path*, from rest to rest, within velocity, acceleration and jerk limits that are proven.

    The time-optimal law s(t) of `time_optimal` is averaged over a sliding window w, which turns its steps of path
    acceleration into ramps: ``d³s̃/dt³ = (s̈(t + w/2) − s̈(t − w/2))/w``. The motion stays exactly on the path. What
    still exceeds a limit afterwards, by the proven extrema, is met by stretching time. The window, and the velocity
    and acceleration limits of the law that is averaged, are searched for the least duration (*trials* of a simplex
    search). Along a straight line the motion is the double-S profile, the optimum; on curved paths it need not be the
    fastest one, and its excess over `time_optimal` without a jerk limit bounds what is left.
    """
    from scipy.optimize import minimize

    curve, limits = as_polynomial(path), Limits.read(limits)
    jerk = limits.pairs("jerk", curve.n)
    if not np.isfinite(jerk).all():
        j = int(np.argmin(np.isfinite(jerk).all(axis=1)))
        raise InputError(f"limits.jerk[{j}] is {jerk[j].tolist()}; jerk_limited needs a finite one for each coordinate")
    if not curve.smooth:
        raise InputError(
            "the path is not C²: its acceleration would jump at any speed, so that no jerk limit can be kept; use a "
            "Spline, or round the corners with rounded(points, deviation)"
        )
    way = _straight_way(curve)
    if way is not None:
        return _along_line(curve(curve.interval[0]), way, limits)
    cap = _PathJerk(np.abs(jerk).min(axis=1))
    vlim, alim = limits.pairs("velocity", curve.n), limits.pairs("acceleration", curve.n)

    def law(faster: float, slower: float, peak: Array) -> Timing:
        velocity = np.stack([np.maximum(vlim[:, 0], -peak * slower), np.minimum(vlim[:, 1], peak * slower)], axis=1)
        scaled = Limits(velocity=velocity, acceleration=alim * faster)
        return time_optimal(curve, scaled, grid=grid, least=least, constraints=[cap]).require_success()

    first = law(1.0, 1.0, np.full(curve.n, np.inf))
    total = float(first.t[-1])
    peak = np.maximum(first.motion.extrema(1).magnitude, 1e-9)

    def motion(z: Array, tolerance: float = 1e-3) -> Trajectory:
        timing = law(float(np.exp(np.clip(z[1], -8.0, 2.5))), float(np.exp(-abs(z[2]))), peak)
        return _stretched(_averaged(timing, total * float(np.exp(np.clip(z[0], -7.0, 3.0)))), limits, tolerance)

    slower = (0.0, 0.15, 0.4, 0.8)
    sweep = [np.array([w, min(-w, 0.0), v]) for w in np.linspace(-5.0, 2.0, 11) for v in slower]
    durations = [motion(z).duration for z in sweep]
    # the duration has several local minima: search from the best of the sweep, and from the best with another window
    first_start = sweep[int(np.argmin(durations))]
    others = [i for i, z in enumerate(sweep) if abs(z[0] - first_start[0]) > 0.8]
    starts = first_start, sweep[min(others, key=lambda i: durations[i])]
    found = []
    for start in starts:
        simplex = start + np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 0.3]])
        found.append(minimize(
            lambda z: motion(z).duration, start, method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": max(trials // 2, 4), "fatol": 1e-4 * total, "xatol": 1e-3},
        ))  # fmt: skip
    return motion(min(found, key=lambda f: float(f.fun)).x, RANGE_TOLERANCE)


def _straight_way(path: PolynomialPath) -> Array | None:
    """From the start to the end ``(n,)`` of a path that runs straight from one to the other; None of others."""
    way = np.asarray(path(path.interval[1]) - path(path.interval[0]))
    size = float(np.linalg.norm(way))
    if size == 0.0:
        return None
    along = path.coefficients @ (way / size**2)
    across = path.coefficients[:, 1:] - along[:, 1:, None] * way
    off = across * np.diff(path.breaks)[:, None, None] ** np.arange(1.0, path.degree + 1.0)[:, None]
    if float(np.abs(off).max(initial=0.0)) > 1e-12 * size:
        return None
    onward = PolynomialPath(path.breaks, along[:, :, None]).extrema(1)
    return way if float(onward.lower[0]) >= -1e-12 * float(onward.upper[0]) else None


def _along_line(start: Array, way: Array, limits: Limits) -> Trajectory:
    """The fastest motion from *start* straight along *way* ``(n,)``: the double-S profile."""
    shares = []
    for name in ("velocity", "acceleration", "jerk"):
        pairs = limits.pairs(name, way.size)
        with np.errstate(divide="ignore", invalid="ignore"):
            forward = np.where(way > 0.0, pairs[:, 1] / way, np.where(way < 0.0, pairs[:, 0] / way, np.inf)).min()
            backward = np.where(way > 0.0, pairs[:, 0] / way, np.where(way < 0.0, pairs[:, 1] / way, -np.inf)).max()
        shares.append([backward, forward])
    shares[2] = [-min(-shares[2][0], shares[2][1]), min(-shares[2][0], shares[2][1])]
    if not np.isfinite(shares[1]).all():
        raise InputError("limits.acceleration is infinite along the line; a jerk-limited motion needs a finite one")
    law = state_to_state(0.0, 1.0, Limits(*(np.array([s]) for s in shares)))
    coefficients = law.coefficients * way
    coefficients[:, 0] += start
    return Trajectory(law.breaks, coefficients)


class _PathJerk:
    """``|d³q/ds³| ṡ³ ≤ jerk`` as a bound on ``x = ṡ²`` alone."""

    def __init__(self, jerk: Array) -> None:
        self.jerk = jerk

    def rows(self, path: PolynomialPath, s: Array) -> Rows:
        """One row: x over its largest value."""
        B = (np.abs(path(s, 3)) / self.jerk).max(axis=-1, keepdims=True) ** (2.0 / 3.0)
        zero = np.zeros_like(B)
        # the motion is proven as a whole in the end: no errors here
        error = np.zeros((s.shape[0], 1, 3))
        return Rows(zero, B, zero, np.full(1, -np.inf), np.ones(1), ("jerk of the path",), error)


def _averaged(timing: Timing, w: float) -> Trajectory:
    """The motion whose s(t) is the mean of the given one over [t − w/2, t + w/2]."""
    t = timing.t
    # s extended by rest on both sides, and its integral
    edges = np.concatenate([[-2.0 * w], t, [t[-1] + 2.0 * w]])
    pieces = np.zeros((edges.size - 1, 4))
    pieces[1:-1, 1:] = timing.timing / np.array([1.0, 2.0, 3.0])
    pieces[0, 1], pieces[-1, 1] = timing.grid[0], timing.grid[-1]
    h = np.diff(edges)
    area = ((pieces[:, 3] * h + pieces[:, 2]) * h + pieces[:, 1]) * h
    pieces[:, 0] = np.concatenate([[0.0], np.cumsum(area)[:-1]])
    integral = Piecewise(edges, pieces[:, :, None])
    breaks = distinct(np.concatenate([t - 0.5 * w, t + 0.5 * w]))
    middle = 0.5 * (breaks[:-1] + breaks[1:])
    jets = [(integral(middle + 0.5 * w, k) - integral(middle - 0.5 * w, k))[:, 0] / w for k in range(4)]
    law = Piecewise(breaks - breaks[0], _around(middle, breaks[:-1], jets)[:, :, None])
    return composed(timing.path, *split_at(law, timing.path.breaks[1:-1]))


def distinct(times: Array) -> Array:
    """*times* in order, without near-duplicates."""
    times = np.unique(times)
    span = times[-1] - times[0]
    keep = np.concatenate([[True], np.diff(times) > 1e-12 * span])
    kept: Array = times[keep]
    kept[-1] = times[-1]
    return kept


def _around(middle: Array, left: Array, jets: list[Array]) -> Array:
    """Cubics about *left* from value and derivatives at *middle*."""
    z, factorial = left - middle, (1.0, 1.0, 2.0, 6.0)
    rows = [
        sum((jets[p] * z ** (p - k) / factorial[p - k] for p in range(k, 4)), np.zeros_like(z)) / factorial[k]
        for k in range(4)
    ]
    return np.stack(rows, axis=1)


def split_at(law: Piecewise, values: Array) -> tuple[Array, Array]:
    """Split the cubics of the increasing *law* s(t) where it passes *values*: breaks and coefficients ``(N, 4)``."""
    low, high = (np.full(values.size, x) for x in law.interval)
    t = np.interp(values, law(law.breaks)[:, 0], law.breaks)
    for _ in range(80):  # Newton's iteration, halving where it leaves the bracket
        wrong, speed = law(t)[:, 0] - values, law(t, 1)[:, 0]
        low, high = np.where(wrong < 0.0, t, low), np.where(wrong < 0.0, high, t)
        step = t - np.divide(wrong, speed, out=np.full(values.size, np.inf), where=speed > 0.0)
        following = np.where((step > low) & (step < high), step, 0.5 * (low + high))
        if np.abs(following - t).max(initial=0.0) <= 1e-15 * (law.interval[1] - law.interval[0]):
            break
        t = following
    breaks = distinct(np.concatenate([law.breaks, t]))
    middle = 0.5 * (breaks[:-1] + breaks[1:])
    return breaks, _around(middle, breaks[:-1], [law(middle, k)[:, 0] for k in range(4)])


def _stretched(motion: Trajectory, limits: Limits, tolerance: float) -> Trajectory:
    """*motion*, slowed down as little as brings its proven extrema within *limits*."""
    factor = 1.0
    for order, name in ((1, "velocity"), (2, "acceleration"), (3, "jerk")):
        pairs = limits.pairs(name, motion.n)
        found = motion.extrema(order, tolerance)
        ratio = np.maximum(found.upper / pairs[:, 1], found.lower / pairs[:, 0])
        factor = max(factor, float(ratio.max()) ** (1.0 / order))
    return motion.stretched(factor * (1.0 + 1e-12)) if factor > 1.0 else motion
