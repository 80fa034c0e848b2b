"""Why a target was not reached, and the joint vector that comes nearest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..kernels.ik_nearest import nearest_poses
from ..kernels.ik_seeds import nearest_starts
from ..parallel import over_ranges
from .chain import GROUPS, PreparedChain
from .queue import Request, run
from .result import IKStatus

NEAREST_STARTS = 96
NEAREST_STEPS = 400
NEARLY = 100.0
NEAR = 1e-3
"""A nearest pose within `NEARLY` tolerances, and within `NEAR`, is called singular: it is missed by a hair, in a
direction in which the chain cannot move there."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """For each failed target: the status, the nearest kernel coordinates ``(F, k)``, what they cost, and whether the
    status is certified."""

    codes: IntArray
    x: Array
    cost: Array
    certified: BoolArray


def diagnose(
    chain: PreparedChain,
    poses: Array,
    targets: Array,
    guesses: Array | None,
    request: Request,
    nearest_known: tuple[Array, Array] | None = None,
) -> Diagnosis:
    """Reasons for the targets ``(F, 12)`` (poses ``(F, 4, 4)``) that no start reached.

    *nearest_known*: kernel coordinates and costs of the nearest poses, where tolerances differ from axis to axis.
    """
    count = targets.shape[0]
    codes = np.full(count, IKStatus.NOT_FOUND.code, dtype=np.int64)
    box = request.box
    certified = np.zeros(count, dtype=bool)
    if np.isfinite(box[:3]).all():
        certified = chain.bound.beyond(poses, *request.slack(chain.reach))
    codes[certified] = IKStatus.OUT_OF_REACH.code
    x, cost = nearest(chain, targets, guesses, request.seed) if nearest_known is None else nearest_known
    open_ = np.flatnonzero(~certified)
    if open_.size:
        wide = chain.without_limits()
        starts = min(request.starts, 60)
        free = request.with_(starts=starts, wanted=1)
        found = run(wide, targets[open_], None if guesses is None else guesses[open_], free)[1] > 0
        codes[open_[found]] = IKStatus.LIMITS.code
        rest = open_[~found]
        near = min(NEARLY * float(box[np.isfinite(box)].min()), NEAR)
        crawling = cost[rest] <= 0.5 * near**2
        codes[rest] = np.where(crawling, IKStatus.SINGULAR.code, IKStatus.OUT_OF_REACH.code)
    return Diagnosis(codes, x, cost, certified)


def nearest(chain: PreparedChain, targets: Array, guesses: Array | None, seed: int) -> tuple[Array, Array]:
    """Kernel coordinates ``(N, k)`` within the limits whose poses are nearest to the targets ``(N, 12)``; the costs."""
    count, k = targets.shape[0], chain.free.size
    table, weighted, half = chain.table
    order = np.zeros((count, GROUPS), dtype=np.int64)
    given = np.zeros((0, k)) if guesses is None else np.ascontiguousarray(guesses)
    x = np.zeros((count, k))
    cost = np.full(count, np.inf)

    def work(first: int, last: int) -> None:
        nearest_starts(weighted, half, targets, first, last, order)
        nearest_poses(
            chain.program, targets, first, last, given, table, order, seed, NEAREST_STARTS, NEAREST_STEPS, x, cost
        )

    over_ranges(work, count, 16)
    return x, cost
