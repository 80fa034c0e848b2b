"""Time-optimal timing of many paths in one call: intervals on lanes, paths over the threads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray
from ..errors import InputError, UnsuccessfulError
from ..kernels import timing as kernels
from ..parallel import over_ranges
from ..result import Result
from .limits import Limits
from .path import Path, PolynomialPath, as_polynomial
from .timing import (
    MARGIN,
    NO_BOUNDS,
    NO_SAMPLES,
    Timing,
    TimingStatus,
    binomials,
    make_grid,
    profile_timing,
    time_optimal,
)


@dataclass(frozen=True, eq=False)
class Timings(Result):
    """Answer of `time_optimal_many`: one `Timing` per path, by index; ``durations (P,)`` are infinite for failures."""

    durations: Array
    _timings: tuple[Timing | tuple[PolynomialPath, Limits, Array, Array], ...]

    def __len__(self) -> int:
        return len(self._timings)

    def __getitem__(self, i: int) -> Timing:
        found = self._timings[i]
        return found if isinstance(found, Timing) else profile_timing(*found)

    @property
    def success(self) -> BoolArray:  # type: ignore[override]
        """``(P,)`` booleans."""
        return np.isfinite(self.durations)

    @property
    def status(self) -> tuple[TimingStatus, ...]:  # type: ignore[override]
        """One status per path."""
        return tuple(t.status if isinstance(t, Timing) else TimingStatus.SUCCESS for t in self._timings)

    def explain(self) -> str:
        """How many succeeded, and the reason of the first that did not."""
        good = self.success
        text = f"{int(good.sum())} of {good.size} paths timed"
        return text if good.all() else f"{text}; path {int(np.argmin(good))}: {self[int(np.argmin(good))].explain()}"

    def require_success(self) -> Timings:
        """Return ``self`` if every path is timed, or raise `UnsuccessfulError`."""
        if not self.success.all():
            raise UnsuccessfulError(self.explain())
        return self


def time_optimal_many(
    paths: Sequence[Path], limits: Limits | Any, *, grid: int | ArrayLike = 200, **options: Any
) -> Timings:
    """`time_optimal` of every one of *paths*, which share the number of coordinates and the *limits*.

    The answers are those of single calls with the same *options*. Without further constraints all paths are solved in
    one call, spread over the threads, and each `Timing` is made when it is asked for; paths with constraints, and those
    that fail, are solved one by one.
    """
    curves = [as_polynomial(p) for p in paths]
    if not curves:
        raise InputError("paths is empty; time_optimal_many needs at least one path")
    n = curves[0].n
    for i, curve in enumerate(curves):
        if curve.n != n:
            raise InputError(f"path {i} has {curve.n} coordinates and path 0 has {n}; they must agree")
    limits = Limits.read(limits)
    found: list[Timing | tuple[PolynomialPath, Limits, Array, Array] | None] = [None] * len(curves)
    durations = np.empty(len(curves))
    simple = isinstance(grid, (int, np.integer)) and not (set(options) - {"least", "start_speed", "end_speed"})
    alim = limits.pairs("acceleration", n)
    if simple and np.isfinite(alim).all():
        vlim = limits.pairs("velocity", n) * (1.0 - MARGIN)
        grids = [make_grid(c, grid, int(options.get("least", 1))) for c in curves]
        groups: dict[tuple[int, int], list[int]] = {}
        for i, (curve, s) in enumerate(zip(curves, grids)):
            groups.setdefault((curve.degree, s.size), []).append(i)
        for members in groups.values():
            points = np.array([grids[i] for i in members])
            profiles, times = _together([curves[i] for i in members], points, vlim, alim * (1.0 - MARGIN), options)
            for k, i in enumerate(members):
                if times[k] < np.inf:
                    found[i], durations[i] = (curves[i], limits, points[k], profiles[k]), times[k]
    answers: list[Timing | tuple[PolynomialPath, Limits, Array, Array]] = []
    for i, (curve, answer) in enumerate(zip(curves, found)):
        if answer is None:
            answer = time_optimal(curve, limits, grid=grid, **options)
            durations[i] = answer.t[-1] if answer.success else np.inf
        answers.append(answer)
    return Timings(durations, tuple(answers))


def _together(
    curves: list[PolynomialPath], grids: Array, vlim: Array, alim: Array, options: dict[str, Any]
) -> tuple[Array, Array]:
    """Profiles ``(P, N + 1)`` and durations of curves of one degree on grids of one size, over the threads."""
    breaks = np.concatenate([c.breaks for c in curves])
    coefficients = np.concatenate([c.coefficients for c in curves])
    first = np.concatenate([[0], np.cumsum([c.breaks.size - 1 for c in curves])])
    x, durations = np.zeros(grids.shape), np.empty(len(curves))
    table = binomials(2 * curves[0].degree)
    x_start, x_end = (float(options.get(name, 0.0)) ** 2 for name in ("start_speed", "end_speed"))

    def work(start: int, stop: int) -> None:
        kernels.solve_many(
            breaks, coefficients, first, grids, vlim, alim, NO_SAMPLES, NO_BOUNDS, table, x_start, x_end, start, stop,
            x, durations,
        )  # fmt: skip

    over_ranges(work, len(curves), grain=8)
    return x, durations
