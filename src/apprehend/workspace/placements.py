"""Where to put a robot's base so that it reaches given poses well: the inverse query of a reachability map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from .. import ik, parallel
from ..arrays import Array, BoolArray, IntArray, as_pose, as_shaped
from ..errors import InputError
from ..kernels.reach_map import placement_scores
from ..result import Result, Status

if TYPE_CHECKING:
    from .map import ReachabilityMap

YAWS = 36
MOST_BASES = 1 << 24
GRAIN = 1024
BLOCK = 512
"""Bases that inverse kinematics looks at together."""


class PlacementStatus(Status):
    """How the search for base placements ended."""

    SUCCESS = "There are base poses from which every target is reachable."
    NONE = "From no base pose that was looked at are all targets reachable."


@dataclass(frozen=True, eq=False)
class BasePlacements(Result):
    """Base poses by rank: ``poses (k, 4, 4)`` T_world_base; ``scores (k,)`` are the manipulability at the worst target.

    They lie apart from one another by at least two voxels, or a sixth of a turn. *tried* base poses were looked at.
    ``q (k, m, n)`` are joint vectors that reach the m targets from there; k is 0 in it where the robot is not known.
    """

    status: PlacementStatus
    poses: Array
    scores: Array
    q: Array
    tried: int

    def explain(self) -> str:
        """The outcome with its numbers."""
        return f"{self.status.value} {len(self.poses)} of {self.tried} base poses are given."


def base_placements(
    reach: ReachabilityMap,
    T: ArrayLike,
    n: int,
    height: float,
    region: ArrayLike | None,
    bases: ArrayLike | None,
) -> BasePlacements:
    """See `ReachabilityMap.base_placements`."""
    targets = as_pose(T, "T").reshape(-1, 4, 4)
    if not len(targets):
        raise InputError("T holds no pose; give at least one target")
    if n < 1:
        raise InputError(f"n is {n}; expected 1 or more")
    tried = upright(reach, targets, height, region) if bases is None else as_pose(bases, "bases").reshape(-1, 4, 4)
    levels = np.empty(len(tried), dtype=np.int64)
    rows, flat = np.ascontiguousarray(targets.reshape(-1, 16)), flattened(tried)
    parallel.over_ranges(
        lambda a, b: placement_scores(reach.grid, reach.hits, reach.best, rows, flat, a, b, levels),
        len(tried),
        GRAIN,
    )
    kept, q = _best(reach, tried, levels, targets, n)
    scores = np.asarray((levels[kept] - 1) * reach.level, dtype=np.float64)
    status = PlacementStatus.SUCCESS if len(kept) else PlacementStatus.NONE
    return BasePlacements(status, tried[kept], scores, q, len(tried))


def _best(reach: ReachabilityMap, bases: Array, levels: IntArray, targets: Array, n: int) -> tuple[IntArray, Array]:
    """The best *n* bases that lie apart, best first, and joint vectors; those that inverse kinematics confirms."""
    order = np.argsort(-levels, kind="stable")
    order = order[levels[order] > 0]
    kept: list[int] = []
    solutions = []
    for block in range(0, order.size, BLOCK):
        some = order[block : block + BLOCK]
        q, good = _solved(reach, bases[some], targets)
        for i in np.flatnonzero(good):
            if len(kept) == n:
                break
            if _lies_apart(bases[some[i]], bases[kept], 2.0 * reach.resolution):
                kept.append(int(some[i]))
                solutions.append(q[i : i + 1])
        if len(kept) == n:
            break
    found = np.concatenate(solutions) if solutions and reach.robot is not None else np.zeros((0, len(targets), 0))
    return np.array(kept, dtype=np.int64), found


def _solved(reach: ReachabilityMap, bases: Array, targets: Array) -> tuple[Array, BoolArray]:
    """Joint vectors (B, m, n) to the targets from each base, and where all are reached; all, if there is no robot."""
    if reach.robot is None:
        return np.zeros((len(bases), 0)), np.ones(len(bases), dtype=bool)
    local = reach.base @ np.linalg.inv(bases)[:, None] @ targets
    free = np.full(3, np.inf) if reach.settings.turns == 1 else np.full(3, 1e-6)
    found = ik.solve(
        reach.robot, local, reach.settings.frame, tolerance=np.concatenate([np.full(3, 1e-6), free]), max_starts=20,
        diagnose=False,
    )  # fmt: skip
    return found.q, np.all(found.success, axis=1).reshape(-1)


def upright(reach: ReachabilityMap, targets: Array, height: float, region: ArrayLike | None) -> Array:
    """Upright base poses (B, 4, 4) at *height*, a voxel apart in *region* (2, 2) and a 36th of a turn apart in yaw."""
    if not np.isfinite(height):
        raise InputError(f"height is {height}; expected metres")
    step = reach.resolution
    if region is None:
        shape = reach.resolution * np.array([reach.grid.nx, reach.grid.ny, reach.grid.nz])
        far = float(np.linalg.norm(np.maximum(np.abs(reach.grid.origin), np.abs(reach.grid.origin + shape))[:2]))
        low, high = targets[:, :2, 3].max(axis=0) - far, targets[:, :2, 3].min(axis=0) + far
    else:
        low, high = as_shaped(region, "region", 2, 2).reshape(2, 2)
        if not (low <= high).all():
            raise InputError(
                "region must hold a lower corner and an upper corner, (2, 2), lower below upper everywhere"
            )
    axes = [np.arange(a, b + 0.5 * step, step) for a, b in zip(low, high, strict=True)]
    count = len(axes[0]) * len(axes[1]) * YAWS
    if count > MOST_BASES:
        raise InputError(
            f"region holds {count} base poses a voxel apart; at most {MOST_BASES} are looked at: shrink it"
        )
    yaw = np.arange(YAWS) * (2.0 * np.pi / YAWS)
    x, y, turn = (v.ravel() for v in np.meshgrid(*axes, yaw, indexing="ij"))
    out = np.zeros((len(x), 4, 4))
    out[:, 0, 0] = out[:, 1, 1] = np.cos(turn)
    out[:, 1, 0], out[:, 0, 1] = np.sin(turn), -np.sin(turn)
    out[:, 0, 3], out[:, 1, 3], out[:, 2, 3] = x, y, height
    out[:, 2, 2] = out[:, 3, 3] = 1.0
    return out


def flattened(T: Array) -> Array:
    """Poses (B, 4, 4) as rows of rotation, row-major, and translation, (B, 12)."""
    return np.ascontiguousarray(np.concatenate([T[:, :3, :3].reshape(-1, 9), T[:, :3, 3]], axis=1))


def _lies_apart(base: Array, others: Array, distance: float) -> bool:
    """Whether *base* is *distance* or a sixth of a turn away from each of *others* (k, 4, 4)."""
    far = np.linalg.norm(others[:, :3, 3] - base[:3, 3], axis=1) >= distance
    cosine = 0.5 * (np.einsum("nij,ij->n", others[:, :3, :3], base[:3, :3]) - 1.0)
    return bool((far | (cosine <= 0.5)).all())
