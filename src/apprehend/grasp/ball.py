"""The largest ball in a wrench space, with certified bounds (see `kernels.hull`)."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..kernels import hull
from ..parallel import over_ranges

ROOMS = (2048, 16384, 131072, 524288)
"""Facets that a growing polytope may have; the next size is tried when one is full."""


class Generators(NamedTuple):
    """Cone bases ``axis + Σ s_j half_j`` in d-dimensional wrench space: ``base (k, d)``, ``spread (k, 3, d)``,
    ``flags (k,)`` of `kernels.hull_support`."""

    base: Array
    spread: Array
    flags: IntArray


class Ball(NamedTuple):
    """Bounds of the radius, the unit direction that attains the upper one, and for whole hulls volume and mean facet
    distance; *outcome* is a code of `kernels.hull`."""

    lower: float
    upper: float
    worst: Array
    outcome: int
    volume: float
    mean: float
    facets: int


@cache
def _codes() -> IntArray:
    return np.random.default_rng(0x5EED).integers(-(2**62), 2**62, size=ROOMS[-1], dtype=np.int64)


def _work(d: int, room: int, points: int) -> tuple[Array, IntArray, IntArray, Array, IntArray, IntArray]:
    return (
        np.empty((points, d)), np.empty((room, d), np.int64), np.empty((room, d), np.int64),
        np.empty((room, d + 1)), np.zeros(room, np.int64), _codes(),
    )  # fmt: skip


def largest(
    kind: int, parts: Generators, *, tolerance: float = 0.0, whole: bool = False, centre: Array | None = None
) -> Ball:
    """The largest ball about *centre* in the set of *kind* that *parts* generate; bounds within *tolerance*."""
    d = parts.base.shape[1]
    shift = np.zeros(d) if centre is None else centre
    answer, worst = np.zeros(6), np.zeros(d)
    outcome = hull.FULL
    for room in ROOMS:
        work = _work(d, room, max(room // 4, len(parts.base) + d + 2))
        outcome = hull.grow(
            kind, parts.base, parts.spread, parts.flags, shift, float(tolerance), whole, room, *work, answer, worst
        )
        if outcome != hull.FULL:
            break
    lower, upper = float(answer[0]), float(answer[1])
    if outcome in (hull.FLAT, hull.OUTSIDE) and not whole:
        lower = upper = 0.0
    return Ball(lower, upper, worst, int(outcome), float(answer[3]), float(answer[4]), int(answer[2]))


def separated(base: Array, spread: Array, flags: IntArray) -> tuple[BoolArray, Array]:
    """For N grasps of k contacts: whether a direction was found along which none can push, and the direction.

    ``base (N, k, d)``, ``spread (N, k, 3, d)``, ``flags (N, k)``; the cone bases reach at most 2e-9 of their size along
    the direction ``(N, d)`` (Farkas). Sets that do not span the space are left out.
    """
    n, d = base.shape[0], base.shape[2]
    verdict, worst = np.empty(n, np.int64), np.empty((n, d))

    def work(i: int, j: int) -> None:
        hull.separate(base[i:j], spread[i:j], flags[i:j], *_work(d, 512, 512), verdict[i:j], worst[i:j])

    over_ranges(work, n, 64)
    return verdict == hull.OUTSIDE, worst
