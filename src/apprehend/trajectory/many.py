"""Time-optimal timing of many paths in one call: paths on lanes, blocks of paths over the threads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray
from ..errors import InputError
from ..kernels import timing_lanes as kernels
from ..kernels.timing_cubic import WIDE
from ..kinematics import memory
from ..parallel import over_ranges
from ..result import Result
from .constraints import Constraint
from .limits import Limits
from .path import Path, PolynomialPath, as_polynomial
from .timing import (
    MARGIN,
    NO_BOUNDS,
    NO_SAMPLES,
    Timing,
    TimingStatus,
    binomials,
    profile_timing,
    time_optimal,
)


@dataclass(frozen=True, eq=False)
class _Group:
    """Profiles of paths on grids of one size: ``grids``, ``x`` ``(P, N + 1)``, ``durations (P,)``."""

    grids: Array
    x: Array
    durations: Array


@dataclass(frozen=True, eq=False, repr=False)
class Timings(Result):
    """Answer of `time_optimal_many`: one `Timing` per path, by index; ``durations (P,)`` are infinite for failures.

    A `Timing` is made from the profiles when it is asked for.
    """

    durations: Array
    _paths: tuple[PolynomialPath, ...]
    _limits: Limits
    _profiles: tuple[_Group, ...]
    _place: IntArray
    """Group and row of every path ``(P, 2)``; a group of −1: among the single ones."""
    _single: dict[int, Timing]

    def __repr__(self) -> str:
        return f"Timings({self.explain()})"

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, i: int) -> Timing:
        i = range(len(self))[i]
        if i in self._single:
            return self._single[i]
        group, row = self._place[i]
        profiles = self._profiles[group]
        return profile_timing(self._paths[i], self._limits, profiles.grids[row], profiles.x[row])

    @property
    def success(self) -> BoolArray:  # type: ignore[override]
        """``(P,)`` booleans."""
        return np.isfinite(self.durations)

    @property
    def status(self) -> tuple[TimingStatus, ...]:  # type: ignore[override]
        """One status per path."""
        single = self._single
        return tuple(single[i].status if i in single else TimingStatus.SUCCESS for i in range(len(self)))

    def explain(self) -> str:
        """How many succeeded, and the reason of the first that did not."""
        good = self.success
        text = f"{int(good.sum())} of {good.size} paths timed"
        return text if good.all() else f"{text}; path {int(np.argmin(good))}: {self[int(np.argmin(good))].explain()}"


def time_optimal_many(
    paths: Sequence[Path],
    limits: Limits | Any,
    *,
    constraints: Sequence[Constraint] = (),
    grid: int | ArrayLike = 200,
    start_speed: float = 0.0,
    end_speed: float = 0.0,
    least: int = 1,
) -> Timings:
    """`time_optimal` of every one of *paths*, which share the number of coordinates and the *limits*.

    The answers are those of single calls with the same options. Paths of degree up to three without further
    constraints are solved side by side on lanes, several times faster than one by one; the others, and those that
    fail, one by one.
    """
    curves = tuple(as_polynomial(p) for p in paths)
    if not curves:
        raise InputError("paths is empty; time_optimal_many needs at least one path")
    n = curves[0].n
    for i, curve in enumerate(curves):
        if curve.n != n:
            raise InputError(f"path {i} has {curve.n} coordinates and path 0 has {n}; they must agree")
    limits = Limits.read(limits)
    durations, place = np.full(len(curves), np.inf), np.full((len(curves), 2), -1)
    groups: list[_Group] = []
    ends = (start_speed, end_speed)
    simple = (
        not constraints and limits.position is None and least >= 1 and all(np.isfinite(v) and v >= 0.0 for v in ends)
    )
    grid = int(grid) if isinstance(grid, np.integer) else grid
    alim = limits.pairs("acceleration", n)
    members = np.array([i for i, c in enumerate(curves) if c.degree <= 3], dtype=np.int64)
    if simple and isinstance(grid, int) and grid >= 1 and members.size and np.isfinite(alim).all():
        vlim = limits.pairs("velocity", n) * (1.0 - MARGIN)
        for chosen, group in _on_lanes([curves[i] for i in members], vlim, alim * (1.0 - MARGIN), grid, least, ends):
            place[members[chosen], 0], place[members[chosen], 1] = len(groups), np.arange(chosen.size)
            durations[members[chosen]] = group.durations
            groups.append(group)
    single = {
        int(i): time_optimal(
            curves[i], limits, constraints=constraints, grid=grid, start_speed=start_speed, end_speed=end_speed,
            least=least,
        )
        for i in np.flatnonzero(durations == np.inf)
    }  # fmt: skip
    for i, timing in single.items():
        durations[i] = timing.t[-1] if timing.success else np.inf
    return Timings(durations, curves, limits, tuple(groups), place, single)


def _on_lanes(
    curves: list[PolynomialPath], vlim: Array, alim: Array, grid: int, least: int, ends: tuple[float, float]
) -> Iterator[tuple[IntArray, _Group]]:
    """Profiles of curves of degree ≤ 3, in groups of those whose grids have one size."""
    pieces = np.array([c.breaks.size - 1 for c in curves])
    first = np.concatenate([[0], np.cumsum(pieces)])
    breaks = np.concatenate([c.breaks for c in curves])
    coefficients = np.concatenate([c.at_least_cubic for c in curves])
    parts, sizes = np.empty(first[-1], dtype=np.int64), np.empty(len(curves), dtype=np.int64)
    kernels.shares(breaks, first, grid, least, parts, sizes)
    x_start, x_end = (float(speed) ** 2 for speed in ends)
    table = binomials(6)
    for size in np.unique(sizes):
        chosen = np.flatnonzero(sizes == size)
        if chosen.size < len(curves):
            own = np.repeat(sizes == size, pieces)
            own_breaks = np.repeat(sizes == size, pieces + 1)
            own_first = np.concatenate([[0], np.cumsum(pieces[chosen])])
            data = breaks[own_breaks], coefficients[own], own_first, parts[own]
        else:
            data = breaks, coefficients, first, parts
        count = int(chosen.size)
        grids, x, durations = memory.empty(count, int(size) + 1), memory.empty(count, int(size) + 1), np.empty(count)

        def work(start: int, stop: int, data: Any = data, out: Any = (grids, x, durations)) -> None:
            kernels.solve_many(*data, vlim, alim, NO_SAMPLES, NO_BOUNDS, table, x_start, x_end, start, stop, *out)

        over_ranges(work, -(-count // WIDE))
        yield chosen, _Group(grids, x, durations)
