"""Time-optimal motion along a path, with limits that are proven to hold between the grid points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from ..kernels import path as path_kernels
from ..kernels import timing as kernels
from ..kernels import timing_rows as rows_of
from ..kernels.timing_cubic import WIDE
from ..kernels.timing_sampled import ROWS
from ..result import Result, Status
from .constraints import Constraint
from .limits import LimitReport, Limits
from .motion import Trajectory
from .path import Path, PolynomialPath, as_polynomial
from .sampled import Sampled, sample

MARGIN = 1e-11
"""Relative margin inside every limit that absorbs the rounding of the arithmetic."""
MARGIN_ROUNDS = 8
"""Rounds in which the margin of sampled constraints grows to what the speeds found need."""
POWER_ROUNDS = 24
"""Timings tried for power limits, each starting from the speeds of the one before."""
POWER_GAIN = 3e-4
"""Share of the duration below which a further one is not tried."""
WIDEST_MARGIN = 0.01
"""Share of a sampled limit that an interval may hold back before it is divided."""
SMALL_GRID = 64
"""Grids up to this size are refined before constraints are called infeasible."""
REFINEMENTS = 3
"""How often the intervals of a grid are divided for that."""


class TimingStatus(Status):
    """Outcome of `time_optimal`."""

    SUCCESS = "The motion keeps every limit at all times and is as fast as the grid allows."
    INFEASIBLE = "No speed along the path keeps the limits at some place."
    START_SPEED = "The given start speed cannot be continued within the limits."
    END_SPEED = "The given end speed cannot be reached within the limits."
    COARSE = "The constraints cannot be proven between the samples of this grid; a finer one is needed."
    STALLED = "The limits force the motion to a standstill in the middle of the path."


@dataclass(frozen=True, eq=False, repr=False)
class Timing(Result):
    """Answer of `time_optimal`: the motion, its speed profile over the grid, and where it fails if it does.

    ``grid (N + 1,)``, ``speed (N + 1,)`` and ``t (N + 1,)`` hold s, ṡ and the time at the grid points. ``s`` and
    ``reason`` name the place and the constraint of a failure; ``margin`` is the largest share of a sampled limit
    (torque, power, Cartesian) that was held back for what its functions do between the samples, which ``sampled``
    describes.
    """

    status: TimingStatus
    path: PolynomialPath
    limits: Limits
    grid: Array
    speed: Array
    t: Array
    timing: Array
    s: float | None = None
    reason: str = ""
    margin: float = 0.0
    sampled: Sampled | None = None

    def __repr__(self) -> str:
        what = f"{float(self.t[-1]):.6g} s, {self.grid.size - 1} intervals" if self.success else self.explain()
        return f"Timing({what})"

    def explain(self) -> str:
        """The outcome, with the place and the constraint of a failure."""
        return self.status.value if self.success else f"{self.status.value} At s = {self.s:.6g}: {self.reason}"

    @property
    def duration(self) -> float:
        """Seconds from start to end."""
        self.require_success()
        return float(self.t[-1])

    @cached_property
    def motion(self) -> Trajectory:
        """The motion in time; raises `UnsuccessfulError` with the reason where there is none."""
        self.require_success()
        return composed(self.path, self.t, self.timing)

    def __call__(self, t: ArrayLike, order: int = 0) -> Array:
        """The motion itself, ``motion(t, order)``: position, velocity, … at times ``t (...)``; see `Trajectory`."""
        return self.motion(t, order)

    @cached_property
    def report(self) -> LimitReport:
        """The proof that velocity and acceleration keep their limits at all times, with the largest excess."""
        return self.motion.check(self.limits)

    @cached_property
    def violation(self) -> float:
        """Largest excess over any limit at any time, relative to the limit: a proven bound, at most 1e-9.

        It covers the sampled constraints too; for those that state no error of their own see `proven`.
        """
        kept = self.report.violation if self.limits.bounded else 0.0
        self.require_success()
        return kept if self.sampled is None else max(kept, self.sampled.excess(self.speed**2, self.grid))

    @property
    def proven(self) -> bool:
        """Whether `violation` is proven: it is, but for constraints of the caller's that estimate what they do between
        the samples (`Rows.error`)."""
        return self.sampled is None or self.sampled.proven


def profile_timing(path: PolynomialPath, limits: Limits, grid: Array, x: Array) -> Timing:
    """The timing with a known profile of squared speeds *x* on *grid*."""
    t, timing = np.zeros(grid.size), np.zeros((grid.size - 1, 3))
    kernels.times(grid, x, t, timing)
    return Timing(TimingStatus.SUCCESS, path, limits, grid, np.sqrt(x), t, timing)


def composed(path: PolynomialPath, t: Array, timing: Array) -> Trajectory:
    """``q(s(t))`` as a piecewise polynomial: *timing* ``(N, E + 1)`` holds s on every interval of *t* ``(N + 1,)``."""
    out = np.empty((timing.shape[0], path.degree * (timing.shape[1] - 1) + 1, path.n))
    path_kernels.compose(path.breaks, path.coefficients, t, timing, out)
    return Trajectory(t, out)


def time_optimal(
    path: Path,
    limits: Limits | Any,
    *,
    constraints: Sequence[Constraint] = (),
    grid: int | ArrayLike = 200,
    start_speed: float = 0.0,
    end_speed: float = 0.0,
    least: int = 1,
) -> Timing:
    """The fastest motion along *path* within velocity and acceleration *limits* and further *constraints*.

    The grid holds every break of the path, so that between grid points the path is one polynomial and the path
    acceleration is constant. The limits are imposed on the Bernstein coefficients of velocity² and acceleration, whose
    hull contains the functions: the motion keeps the limits at all times, not only at the grid points. *constraints*
    (`TorqueLimits`, `PowerLimits`, `CartesianSpeed`, `CartesianAcceleration`) are interpolated between samples, with a
    margin for the remainder.

    *grid* is the number of intervals (at least *least* per piece of the path) or the grid itself; ``start_speed`` and
    ``end_speed`` are ṡ at the ends. At a kink of the path (a jump of the tangent) the motion comes to rest. A path
    that is not made of polynomials is replaced by one (`as_polynomial`); one that leaves limits of position is
    answered with the place.
    """
    curve = as_polynomial(path)
    limits = Limits.read(limits)
    vlim, alim = limits.pairs("velocity", curve.n), limits.pairs("acceleration", curve.n)
    for name, speed in (("start_speed", start_speed), ("end_speed", end_speed)):
        if not (np.isfinite(speed) and speed >= 0.0):
            raise InputError(f"{name} is {speed}; expected ṡ ≥ 0 along the path")
    if not constraints and not np.isfinite(alim).all():
        _refuse_unbounded(curve, alim)
    outside = _outside(curve, limits) if limits.position is not None else None
    if outside is not None:
        return outside
    if least < 1:
        raise InputError(f"least is {least}; expected a number of intervals per piece ≥ 1")
    adaptive = isinstance(grid, (int, np.integer))
    while True:
        problem = _Problem(
            curve, limits, make_grid(curve, grid, least), vlim * (1.0 - MARGIN), alim * (1.0 - MARGIN),
            float(start_speed), float(end_speed),
        )  # fmt: skip
        timing = _constrained(problem, constraints, adaptive) if constraints else problem.solve(None)
        # between two rests it takes at least two intervals: a coarse grid is refined
        if timing.status is not TimingStatus.STALLED or not adaptive or least >= 64:
            return timing
        least = 2 * least


def _constrained(problem: _Problem, constraints: Sequence[Constraint], adaptive: bool) -> Timing:
    """The timing with sampled constraints; intervals whose quartics leave out too much of a limit are divided."""
    for last in range(REFINEMENTS, -1, -1):
        found = sample(problem.path, problem.grid, constraints)
        timing, shares = _with_margins(problem, found, None)
        if timing.success and found.power.any():
            timing, shares = _within_power(problem, found, timing)
        parts = np.where(shares > WIDEST_MARGIN, np.ceil(np.minimum(5.0 * shares / WIDEST_MARGIN, 1e4) ** 0.2), 1.0)
        possible = timing.success or timing.status is TimingStatus.COARSE
        if not possible and problem.grid.size <= SMALL_GRID:
            parts = np.maximum(parts, 2.0)  # what a coarse grid cannot do, a finer one may
        if not adaptive or last == 0 or parts.max() == 1.0:
            break
        grid = problem.grid
        inner = [np.linspace(a, b, int(k) + 1)[:-1] for a, b, k in zip(grid[:-1], grid[1:], parts)]
        problem = replace(problem, grid=np.concatenate([*inner, grid[-1:]]))
    return timing


@dataclass(frozen=True, eq=False)
class _Problem:
    path: PolynomialPath
    limits: Limits
    grid: Array
    vlim: Array
    alim: Array
    start_speed: float
    end_speed: float

    def solve(self, sampled: Sampled | None) -> Timing:
        count = self.grid.size - 1
        x, alpha, beta = np.zeros((3, count + 1))
        values, bounds = (NO_SAMPLES, NO_BOUNDS) if sampled is None else sampled.in_blocks()
        coefficients = self.path.at_least_cubic
        degree = coefficients.shape[1] - 1
        rows = 3 * rows_of.row_count(degree, self.path.n, 0 if sampled is None else len(sampled.names)) + 2
        scratch = np.empty((-(-count // WIDE), rows * WIDE))
        status, stage = kernels.solve_into(
            self.path.breaks, coefficients, self.grid, self.vlim, self.alim, values, bounds,
            binomials(2 * degree), self.start_speed**2, self.end_speed**2, scratch,
            np.empty(count + 1, dtype=np.bool_), alpha, beta, x,
        )  # fmt: skip
        if status == kernels.OK:
            return profile_timing(self.path, self.limits, self.grid, x)
        t, timing = np.zeros(count + 1), np.zeros((count, 3))
        return self._failure(status, stage, alpha, beta, np.sqrt(x), t, timing, sampled)

    def _failure(
        self, status: int, stage: int, alpha: Array, beta: Array, speed: Array, t: Array, timing: Array,
        sampled: Sampled | None,
    ) -> Timing:  # fmt: skip
        if status == kernels.TORN:
            where = float(self.grid[stage])
            gap = float(np.abs(self.path.jumps(0)[int(np.searchsorted(self.path.breaks, where)) - 1]).max())
            raise InputError(f"the path jumps by {gap:.6g} at s = {where:.6g}; its pieces must meet")
        kind = {
            kernels.START: TimingStatus.START_SPEED,
            kernels.END: TimingStatus.END_SPEED,
            kernels.STALLED: TimingStatus.STALLED,
        }.get(status, TimingStatus.INFEASIBLE)
        if status == kernels.START:
            reason = (
                f"start_speed is {self.start_speed:.6g}; expected at least {np.sqrt(max(alpha[0], 0.0)):.6g} and at "
                f"most {np.sqrt(max(beta[0], 0.0)):.6g}"
            )
        elif status == kernels.STALLED:
            reason = "the speed is zero at both ends of a grid interval; give a finer grid there"
        else:
            reason = conflict(self.path, self.grid, stage, self.vlim, self.alim, sampled, float(beta[stage + 1]))
            if status == kernels.END:
                reason = f"end_speed is {self.end_speed:.6g}, against {reason}"
        return Timing(
            kind, self.path, self.limits, self.grid, speed, t, timing, float(self.grid[stage]), reason
        )  # fmt: skip


def _with_margins(problem: _Problem, found: Sampled, tangent: Array | None) -> tuple[Timing, Array]:
    """Solve, bound what the sampled functions do between their samples at the speeds found, and tighten by that.

    Returns the timing, and the share of a limit that every interval holds back ``(N,)``.
    """
    margins = np.zeros(found.bounds.shape[:2])
    exact = found.tightened(0.0, tangent)
    for _ in range(MARGIN_ROUNDS):
        timing = problem.solve(found.tightened(margins, tangent))
        if not timing.success:
            if not margins.any():
                return timing, exact.shares(margins, timing.speed**2, problem.grid)
            break
        short = exact.remainder(timing.speed**2, problem.grid) - margins
        if (short <= 0.0).all():
            shares = exact.shares(margins, timing.speed**2, problem.grid)
            return replace(timing, margin=float(shares.max()), sampled=exact), shares
        margins += 1.25 * np.maximum(short, 0.0)
    size = np.abs(exact.bounds).min(axis=2)
    share = np.divide(margins, size, out=np.zeros_like(margins), where=np.isfinite(size) & (size > 0.0))
    i, e = (int(k) for k in np.unravel_index(share.argmax(), share.shape))
    held = "more than its whole limit" if share[i, e] >= 1.0 else f"{100.0 * share[i, e]:.3g} % of its limit"
    reason = f"{found.names[e]} varies too fast between the samples of this grid: {held} would have to be held back"
    shares = exact.shares(margins, timing.speed**2, problem.grid)
    return replace(timing, status=TimingStatus.COARSE, s=float(problem.grid[i]), reason=reason), shares


def _within_power(problem: _Problem, found: Sampled, timing: Timing) -> tuple[Timing, Array]:
    """Timings within the power limits, with their tangents at the speeds of the one before: each is feasible for the
    next, so that the duration falls."""
    # the power that gravity alone takes bounds the speed to begin with
    still = np.abs(found.samples[:, :, found.power, 2]).max(axis=1)
    with np.errstate(divide="ignore"):
        rest = (0.7 * found.bounds[:, found.power, 1] / still).min(axis=1)
    tangent = np.minimum(_middle(timing), rest**2)
    best: tuple[Timing, Array] | None = None
    for _ in range(POWER_ROUNDS):
        made = _with_margins(problem, found, tangent)
        if not made[0].success:
            if best is not None:
                return best
            tangent = 0.25 * tangent
            continue
        if best is not None and made[0].t[-1] > (1.0 - POWER_GAIN) * best[0].t[-1]:
            return min(best, made, key=lambda m: float(m[0].t[-1]))
        best = made
        tangent = np.maximum(_middle(made[0]), 1e-12 * tangent)
    return made if best is None else best


def _middle(timing: Timing) -> Array:
    """Path speed squared in the middle of every interval ``(N,)``."""
    x = timing.speed**2
    return np.asarray(0.5 * (x[1:] + x[:-1]))


def conflict(
    path: PolynomialPath, grid: Array, stage: int, vlim: Array, alim: Array, sampled: Sampled | None, y_high: float
) -> str:
    """Which rows of interval *stage* exclude every speed, in words."""
    values, bounds = (NO_SAMPLES, NO_BOUNDS) if sampled is None else sampled.of_interval(stage).in_blocks()
    coefficients = path.at_least_cubic
    degree = coefficients.shape[1] - 1
    rows = int(rows_of.row_count(degree, path.n, 0 if sampled is None else len(sampled.names)))
    table = np.empty((1, (3 * rows + 2) * WIDE))
    rows_of.rows_along(
        path.breaks, coefficients, grid[stage : stage + 2], vlim, alim, values, bounds,
        binomials(2 * degree), table,
    )  # fmt: skip
    _, low, high = table[0].reshape(-1, WIDE)[: 3 * rows, 0].reshape(rows, 3).T
    if sampled is not None:
        still = sampled.samples[stage, :, :, 2]
        low, high = sampled.bounds[stage, : still.shape[1]].T
        excess = np.maximum(still - high, low - still).max(axis=0)
        e = int(excess.argmax())
        if excess[e] > 0.0:
            value = still[np.abs(still[:, e]).argmax(), e]
            return f"{sampled.names[e]} is {value:.6g} even at rest; the limit is {sampled.bounds[stage, e].tolist()}"
    names = [f"acceleration of coordinate {j}" for j in range(path.n) for _ in range(degree)]
    names += ["velocity"] * (2 * degree - 1)
    names += [name for name in (sampled.names if sampled is not None else ()) for _ in range(ROWS)]
    top, bottom = int(high.argmin()), int(low.argmax())
    upper = names[top] if high[top] < y_high else "the speed that can still be braked further on"
    return f"{names[bottom]} and {upper} contradict each other at every speed"


def make_grid(path: PolynomialPath, grid: int | ArrayLike, least: int = 1) -> Array:
    """The grid with every break of the path in it."""
    breaks = path.breaks
    if isinstance(grid, (int, np.integer)):
        if grid < 1:
            raise InputError(f"grid is {grid}; expected a number of intervals ≥ 1, or the grid points")
        parts = np.empty(breaks.size - 1, dtype=np.int64)
        out = np.empty(kernels.grid_parts(breaks, int(grid), least, parts) + 1)
        kernels.subdivide(breaks, parts, out)
        return out
    points = as_array(grid, "grid")
    start, end = path.interval
    if points.ndim != 1 or points.size < 2 or np.diff(points).min() <= 0.0 or points[0] != start or points[-1] != end:
        raise InputError(f"grid must increase strictly from {start:.9g} to {end:.9g}, the interval of the path")
    merged = np.union1d(points, breaks)
    # grid points that nearly coincide with a break give way to it
    is_break = np.isin(merged, breaks)
    near = np.zeros(merged.size, dtype=np.bool_)
    tight = np.diff(merged) < 1e-12 * (end - start)
    near[:-1] |= tight & ~is_break[:-1]
    near[1:] |= tight & ~is_break[1:]
    return np.ascontiguousarray(merged[~near])


def _outside(path: PolynomialPath, limits: Limits) -> Timing | None:
    """The answer for a path that leaves the limits of position; None for one that keeps them."""
    pairs = limits.pairs("position", path.n)
    found = path.extrema(0)
    slack = 1e-9 * (1.0 + found.magnitude)
    over = np.stack([pairs[:, 0] - found.lower, found.upper - pairs[:, 1]]) - slack
    if not (over > 0.0).any():
        return None
    side, j = (int(k) for k in np.unravel_index(over.argmax(), over.shape))
    s, value = ((found.at_lower, found.lower), (found.at_upper, found.upper))[side]
    reason = f"position of coordinate {j} is {value[j]:.6g}; the limit is {pairs[j].tolist()}"
    return Timing(
        TimingStatus.INFEASIBLE, path, limits, path.breaks, np.zeros(path.breaks.size), np.zeros(path.breaks.size),
        np.zeros((path.breaks.size - 1, 3)), float(s[j]), reason,
    )  # fmt: skip


def _refuse_unbounded(path: PolynomialPath, alim: Array) -> None:
    bounded = np.isfinite(alim).all(axis=1) | (np.abs(path.coefficients[:, 1:]).max(axis=(0, 1)) == 0.0)
    if not bounded.all():
        j = int(np.argmin(bounded))
        raise InputError(
            f"limits.acceleration[{j}] is {alim[j].tolist()}; a time-optimal motion needs a finite acceleration limit "
            "for every moving coordinate: pass Limits(velocity=…, acceleration=…)"
        )


@cache
def binomials(size: int) -> Array:
    """Pascal's triangle ``(size + 1, size + 1)``."""
    table = np.zeros((size + 1, size + 1))
    table[:, 0] = 1.0
    for i in range(1, size + 1):
        table[i, 1:] = table[i - 1, 1:] + table[i - 1, :-1]
    return table


NO_SAMPLES = np.empty((1, 0))
NO_BOUNDS = np.empty((1, 0))
