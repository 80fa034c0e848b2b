"""Targets through the kernels of the queue: what is asked for, and the call."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from ..kernels.ik_queue import solve_queue, solve_wide
from ..kernels.ik_seeds import nearest_starts
from ..parallel import over_ranges
from .chain import GROUPS, PreparedChain

WIDE = 16
"""Batches smaller than this give all lanes to one target after the other."""
GRAIN = 128
"""Smallest share of a batch that is worth a thread."""


def seed_of(rng: np.random.Generator | None) -> int:
    """The number from which random starts are made: one draw, or 0 without a generator."""
    if rng is None:
        return 0
    if not isinstance(rng, np.random.Generator):
        raise InputError(f"rng is {rng!r}; expected a generator such as np.random.default_rng(0)")
    return int(rng.integers(1 << 62))


def whole(value: int, name: str) -> int:
    """*value* if it is a whole number from 1 on."""
    if not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{name} is {value}; expected a whole number, 1 or more")
    return int(value)


@dataclass(frozen=True, eq=False)
class Request:
    """What is asked of every target, in the kernels' units."""

    box: Array  # (6,) tolerances
    partial: bool  # whether they differ from axis to axis
    free_axis: int  # the one rotation axis that is free, or −1
    wanted: int  # solutions
    distinct: float
    starts: int
    seed: int

    def slack(self, reach: float) -> tuple[float, float]:
        """How far in m and rad the frame may be from a target that counts as reached."""
        return float(np.linalg.norm(self.box[:3])) * reach, float(np.linalg.norm(self.box[3:]))

    def with_(self, **changes: Any) -> Request:
        """The same with some changes."""
        return replace(self, **changes)


def run(
    chain: PreparedChain, targets: Array, guesses: Array | None, request: Request
) -> tuple[Array, IntArray, IntArray]:
    """Solutions ``(N, wanted, k)`` in kernel units, how many, and starts used, for target rows ``(N, 12)``."""
    count, k = targets.shape[0], chain.free.size
    out = np.zeros((count, request.wanted, k))
    found = np.zeros(count, dtype=np.int64)
    starts = np.zeros(count, dtype=np.int64)
    table, weighted, half = chain.table
    order = np.zeros((count, GROUPS), dtype=np.int64)
    targets = np.ascontiguousarray(targets)
    given = np.zeros((0, k)) if guesses is None else np.ascontiguousarray(guesses)
    driver = solve_wide if count < WIDE else solve_queue

    def work(first: int, last: int) -> None:
        nearest_starts(weighted, half, targets, first, last, order)
        driver(
            chain.program, targets, first, last, given, table, order, request.seed, request.starts, request.box,
            request.partial, request.free_axis, request.distinct, out, found, starts,
        )  # fmt: skip

    over_ranges(work, count, GRAIN)
    return out, found, starts
