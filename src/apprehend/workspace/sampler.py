"""Filling the cells of a reachability map with random configurations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import parallel
from ..arrays import Array, BoolArray, IntArray
from ..errors import InputError
from ..kernels import reach_map as kernels
from ..kernels.reach_map import PoseGrid
from ..kinematics import Robot
from .settings import MEASURES, ROWS, Settings, ranges

PILOT = 1 << 16
"""Samples from which the box of the grid and the scale of the measure are taken."""

LEVELS = 255
GRAIN = 4096

ByteArray = NDArray[np.uint8]
Valid = Callable[[Array], BoolArray]


@dataclass
class Counts:
    """Configurations that were sampled, those of them left out as not valid, and those that fell outside the grid."""

    samples: int = 0
    invalid: int = 0
    outside: int = 0


def coverage_of(hits: ByteArray, counts: Counts) -> float:
    """Good's and Turing's estimate 1 − n₁/N of the probability that one more sample falls into a marked cell.

    n₁ are the cells that were hit once (and the samples outside the grid), N the valid samples.
    """
    valid = counts.samples - counts.invalid
    return 1.0 - (int(np.count_nonzero(hits == 1)) + counts.outside) / valid if valid else 0.0


class Sampler:
    """Samples the chain of a robot into the cells of a grid; the same settings give the same samples in order."""

    def __init__(self, robot: Robot, settings: Settings, valid: Valid | None) -> None:
        self.robot, self.settings, self._valid = robot, settings, valid
        alone = robot.placed(np.eye(4))
        self._chain, self._home = alone.chain_model(settings.frame), alone.home
        self._range = ranges(robot, self._chain)
        self.grid = PoseGrid(np.zeros(3), 1.0, 0, 0, 0, 0)
        q, _, values, good = self._sampled(0, PILOT)
        if not good.any():
            raise InputError(f"valid refuses each of {PILOT} random configurations of {robot.name!r}")
        self.grid = settings.grid(alone.fk(q, settings.frame)[:, :3, 3])
        self.scale = 1.25 * float(values.max()) or 1.0
        cells = self.grid.nx * self.grid.ny * self.grid.nz * settings.turns
        self.hits, self.best = np.zeros(cells, np.uint8), np.zeros(cells, np.uint8)
        self.counts = Counts()

    def resume(self, grid: PoseGrid, hits: ByteArray, best: ByteArray, scale: float, counts: Counts) -> None:
        """Go on from where a map of the same settings stopped; its arrays are copied."""
        self.grid, self.hits, self.best, self.scale = grid, hits.copy(), best.copy(), scale
        self.counts = Counts(counts.samples, counts.invalid, counts.outside)

    @property
    def coverage(self) -> float:
        """See `coverage_of`."""
        return coverage_of(self.hits, self.counts)

    def add(self, count: int) -> None:
        """Enter *count* more samples."""
        _, cells, values, good = self._sampled(self.counts.samples, count)
        self.counts.outside += int(((cells < 0) & good).sum())
        self.counts.invalid += int((~good).sum())
        self.counts.samples += count
        cells[~good] = -1

        def keep(low: int, high: int) -> None:
            kernels.keep_best(cells, values, LEVELS / self.scale, low, high, self.hits, self.best)

        parallel.over_ranges(keep, self.hits.size, 1 << 20)

    def _sampled(self, first: int, count: int) -> tuple[Array, IntArray, Array, BoolArray]:
        """Configurations from number *first* on, the cells they lead to, their manipulability, and which are valid."""
        row, rows = ROWS[self.settings.part]
        measure = MEASURES[self.settings.measure]
        length = self.settings.length if self.settings.part == "both" else 1.0  # alone, the unit of ω is rad/s
        q, values = np.empty((count, self.robot.n)), np.empty(count)
        cells = np.empty(count, dtype=np.int64)

        def work(a: int, b: int) -> None:
            kernels.random_rows(self.settings.seed, first, a, b, self._home, self._chain.free, *self._range, q)
            kernels.sample_cells(self._chain, q, a, b, self.grid, row, rows, length, measure, cells, values)

        parallel.over_ranges(work, count, GRAIN)
        good = np.ones(count, dtype=bool) if self._valid is None else np.asarray(self._valid(q))
        if good.shape != (count,) or good.dtype != np.bool_:
            raise InputError(
                f"valid returned {good.dtype} of shape {good.shape} for {count} configurations; "
                f"expected booleans ({count},)"
            )
        return q, cells, values, good
