"""Time-optimal motion along a path, with limits that are proven to hold between the grid points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, as_array
from ..errors import InputError
from ..kernels import path as path_kernels
from ..kernels import timing as kernels
from ..result import Result, Status
from .limits import Limits
from .motion import Trajectory
from .path import PolynomialPath

MARGIN = 1e-11
"""Relative margin inside every limit that absorbs the rounding of the arithmetic."""


class TimingStatus(Status):
    """Outcome of `time_optimal`."""

    SUCCESS = "The motion keeps every limit at all times and is as fast as the grid allows."
    INFEASIBLE = "No speed along the path keeps the limits at some place."
    START_SPEED = "The given start speed cannot be continued within the limits."
    END_SPEED = "The given end speed cannot be reached within the limits."
    STALLED = "The limits force the motion to a standstill in the middle of the path."


@dataclass(frozen=True)
class Timing(Result):
    """Answer of `time_optimal`: the motion, its speed profile over the grid, and where it fails if it does.

    ``motion`` is a `Trajectory` (``require_success`` first); ``grid (N + 1,)`` and ``speed (N + 1,)`` hold s and ṡ;
    ``t (N + 1,)`` the times. ``s`` and ``reason`` name the place and the constraint of a failure.
    """

    status: TimingStatus
    path: PolynomialPath
    grid: Array
    speed: Array
    t: Array
    timing: Array
    s: float = float("nan")
    reason: str = ""

    def explain(self) -> str:
        """The outcome, with the place and the constraint of a failure."""
        return self.status.value if self.success else f"{self.status.value} At s = {self.s:.6g}: {self.reason}"

    @property
    def duration(self) -> float:
        """Seconds from start to end."""
        self.require_success()
        return float(self.t[-1])

    @property
    def motion(self) -> Trajectory:
        """The motion in time; raises `UnsuccessfulError` with the reason where there is none."""
        self.require_success()
        return composed(self.path, self.t, self.timing)


def composed(path: PolynomialPath, t: Array, timing: Array) -> Trajectory:
    """``q(s(t))`` as a piecewise polynomial: *timing* ``(N, E + 1)`` holds s on every interval of *t* ``(N + 1,)``."""
    out = np.empty((timing.shape[0], path.degree * (timing.shape[1] - 1) + 1, path.n))
    path_kernels.compose(path.breaks, path.coefficients, t, timing, out)
    return Trajectory(t, out)


def time_optimal(
    path: PolynomialPath,
    limits: Limits | Any,
    *,
    grid: int | ArrayLike = 200,
    start_speed: float = 0.0,
    end_speed: float = 0.0,
    least: int = 1,
) -> Timing:
    """The fastest motion along *path* within velocity and acceleration *limits*.

    The grid holds every break of the path, so that between grid points the path is one polynomial and the path
    acceleration is constant. The limits are imposed on the Bernstein coefficients of velocity² and acceleration, whose
    hull contains the functions: the motion keeps the limits at all times, not only at the grid points.

    *grid* is the number of intervals (at least *least* per piece of the path) or the grid itself; ``start_speed`` and
    ``end_speed`` are ṡ
    at the ends. At a kink of the path (a jump of the tangent) the motion comes to rest.
    """
    limits = Limits.read(limits)
    vlim, alim = limits.pairs("velocity", path.n), limits.pairs("acceleration", path.n)
    for name, speed in (("start_speed", start_speed), ("end_speed", end_speed)):
        if not (np.isfinite(speed) and speed >= 0.0):
            raise InputError(f"{name} is {speed}; expected ṡ ≥ 0 along the path")
    bounded = np.isfinite(alim).all(axis=1) | (np.abs(path.coefficients[:, 1:]).max(axis=(0, 1)) == 0.0)
    if not bounded.all():
        j = int(np.argmin(bounded))
        raise InputError(
            f"limits.acceleration[{j}] is {alim[j].tolist()}; a time-optimal motion needs a finite acceleration limit "
            "for every moving coordinate: pass Limits(velocity=…, acceleration=…)"
        )
    s = _grid(path, grid, least)
    extra = np.empty((s.size - 1, 0, 3))
    return _solve(path, s, vlim * (1.0 - MARGIN), alim * (1.0 - MARGIN), extra, start_speed, end_speed)


def _solve(
    path: PolynomialPath, s: Array, vlim: Array, alim: Array, extra: Array, start_speed: float, end_speed: float
) -> Timing:
    count, size = s.size - 1, 4 * path.n * path.degree + extra.shape[1]
    upper, lower = np.empty((count, size, 2)), np.empty((count, size, 2))
    counts, cap = np.empty((count, 2), dtype=np.int64), np.empty((count, 2))
    kernels.rows(
        path.breaks, path.coefficients, s, vlim, alim, extra, _binomials(2 * path.degree), upper, lower, counts, cap
    )
    x, alpha, beta = np.zeros(count + 1), np.empty(count + 1), np.empty(count + 1)
    status, stage = kernels.profile(
        s,
        upper,
        lower,
        counts,
        cap,
        _pinned(path, s),
        start_speed**2,
        end_speed**2,
        extra.shape[1] == 0,
        beta,
        alpha,
        x,
    )
    t, timing = np.zeros(count + 1), np.zeros((count, 3))
    if status == kernels.OK:
        kernels.times(s, x, t, timing)
        return Timing(TimingStatus.SUCCESS, path, s, np.sqrt(x), t, timing)
    place = float(s[min(stage, count)])
    if status == kernels.START:
        return Timing(
            TimingStatus.START_SPEED, path, s, np.sqrt(x), t, timing, place,
            f"start_speed is {start_speed:.6g}; expected at least {np.sqrt(max(alpha[0], 0.0)):.6g} and at most "
            f"{np.sqrt(max(beta[0], 0.0)):.6g}",
        )  # fmt: skip
    kind = {kernels.END: TimingStatus.END_SPEED, kernels.STALLED: TimingStatus.STALLED}
    return Timing(
        kind.get(status, TimingStatus.INFEASIBLE), path, s, np.sqrt(x), t, timing, place,
        f"end_speed is {end_speed:.6g}" if status == kernels.END else "the limits contradict each other here",
    )  # fmt: skip


def _grid(path: PolynomialPath, grid: int | ArrayLike, least: int = 1) -> Array:
    """The grid with every break of the path in it."""
    breaks = path.breaks
    if isinstance(grid, (int, np.integer)):
        if grid < 1:
            raise InputError(f"grid is {grid}; expected a number of intervals ≥ 1, or the grid points")
        lengths = np.diff(breaks)
        parts = np.maximum(np.ceil(lengths / lengths.sum() * int(grid) - 1e-9), least).astype(np.int64)
        step = np.repeat(lengths / parts, parts)
        offset = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
        return np.append(np.repeat(breaks[:-1], parts) + offset * step, breaks[-1])
    points = as_array(grid, "grid")
    start, end = path.interval
    if points.ndim != 1 or points.size < 2 or np.diff(points).min() <= 0.0 or points[0] != start or points[-1] != end:
        raise InputError(f"grid must increase strictly from {start:.9g} to {end:.9g}, the interval of the path")
    merged = np.union1d(points, breaks)
    # grid points that nearly coincide with a break give way to it
    near = np.diff(merged, append=np.inf) < 1e-12 * (end - start)
    return merged[~near | np.isin(merged, breaks)]


def _pinned(path: PolynomialPath, s: Array) -> BoolArray:
    """Grid points where the tangent jumps: the motion must rest there."""
    pinned = np.zeros(s.size, dtype=np.bool_)
    if path.breaks.size > 2:
        size = np.abs(path(path.breaks[1:-1], 1)).max(axis=1)
        kinks = np.abs(path.jumps(1)).max(axis=1) > 1e-9 * (1.0 + size)
        pinned[np.searchsorted(s, path.breaks[1:-1][kinks])] = True
    return pinned


def _binomials(size: int) -> Array:
    table = np.zeros((size + 1, size + 1))
    table[:, 0] = 1.0
    for i in range(1, size + 1):
        table[i, 1:] = table[i - 1, 1:] + table[i - 1, :-1]
    return table
