"""Targets of one or several frames through the kernels of the tree: solutions, and nearest joint vectors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..kernels.ik_tasks import POSE, TaskList
from ..kernels.ik_tree import solve_tree
from ..kernels.ik_tree_nearest import descend_tree
from ..kinematics import Robot
from ..parallel import over_ranges
from .chain import PreparedChain

WHY_STARTS = 60
"""Starts of every search for a reason."""
CANDIDATES = 4
"""Searches for the nearest joint vector."""
POLISH = 300
"""Steps of the last descent to the nearest joint vector."""


@dataclass(frozen=True, eq=False)
class TreeProblem:
    """A batch of N targets for F frames."""

    robot: Robot
    frames: tuple[str, ...]
    chains: tuple[PreparedChain, ...]
    poses: Array  # (N, F, 4, 4)
    box: Array  # (F, 6) tolerances in m and rad
    guesses: Array  # (N, S, n) joint vectors to start from
    seed: int

    @property
    def reach(self) -> float:
        """The longest reach of the chains."""
        return max(chain.reach for chain in self.chains)

    @property
    def moving(self) -> BoolArray:
        """Which coordinates ``(n,)`` move some frame."""
        moving = np.zeros(self.robot.n, dtype=bool)
        for chain in self.chains:
            moving[chain.free] = True
        return moving

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds ``(n,), (n,)`` of random starts."""
        low, high = self.robot.limits.lower.copy(), self.robot.limits.upper.copy()
        for chain in self.chains:
            low[chain.free], high[chain.free] = chain.program.low * chain.unit, chain.program.high * chain.unit
        return low, high


@dataclass(frozen=True, eq=False)
class _Rows:
    """What the kernels read of a problem: rows of all frames, and limits."""

    tasks: TaskList
    data: Array  # (M, F, 16)
    box: Array  # (6 F,)
    scale: Array  # (6 F,)
    lower: Array  # (n,)
    upper: Array


def _rows(problem: TreeProblem, index: IntArray, limits: bool) -> _Rows:
    """The targets *index* for the kernels."""
    robot, F = problem.robot, len(problem.frames)
    tasks = TaskList(
        kind=np.full(F, POSE, dtype=np.int64),
        frame=np.array([(robot.frame_index(f), -1) for f in problem.frames], dtype=np.int64),
        row=np.arange(0, 6 * F + 1, 6, dtype=np.int64),
        point=np.zeros((F, 3)),
        axis=np.tile([0.0, 0.0, 1.0], (F, 1)),
        weight=np.ones(6 * F),
        gain=np.ones(F),
        pick=np.zeros(6 * F, dtype=np.int64),
    )
    bounded = problem.moving & limits
    return _Rows(
        tasks,
        np.ascontiguousarray(problem.poses[index].reshape(index.size, F, 16)),
        np.ascontiguousarray(problem.box.reshape(-1)),
        np.tile([problem.reach] * 3 + [1.0] * 3, F),
        np.where(bounded, robot.limits.lower, -np.inf),
        np.where(bounded, robot.limits.upper, np.inf),
    )


def run_tree(
    problem: TreeProblem, index: IntArray, starts: int, *, limits: bool = True, nearest: bool = False
) -> tuple[Array, IntArray, IntArray, Array]:
    """Solutions of the targets *index* (else their first guesses), which are found, starts used; and the nearest."""
    rows = _rows(problem, index, limits)
    low, high = problem.bounds
    guesses = np.ascontiguousarray(problem.guesses[index])
    out = guesses[:, 0].copy()
    found, used = np.zeros(index.size, dtype=np.int64), np.zeros(index.size, dtype=np.int64)
    least, best = np.full(index.size if nearest else 0, np.inf), out.copy()

    def work(first: int, last: int) -> None:
        solve_tree(
            problem.robot.model, rows.tasks, rows.data, rows.box, rows.scale, rows.lower, rows.upper, low,
            high, ~problem.moving, guesses, problem.seed, starts, first, last, out, found, used, least, best,
        )  # fmt: skip

    over_ranges(work, index.size, 32)
    return out, found, used, best


def nearest_in_tree(problem: TreeProblem, index: IntArray) -> tuple[Array, Array]:
    """Joint vectors ``(M, n)`` within the limits that come nearest to the targets *index*, and costs ``(M,)``: the
    sum of the squared errors, lengths over the reach, and 0 within the tolerances.

    The best of the starts of each of `CANDIDATES` searches is followed to its end.
    """
    rows = _rows(problem, index, True)
    best, lowest = np.empty((index.size, problem.robot.n)), np.full(index.size, np.inf)
    for number in range(CANDIDATES):
        q = run_tree(replace(problem, seed=problem.seed + number), index, WHY_STARTS, nearest=True)[3]
        cost = np.empty(index.size)

        def work(first: int, last: int, q: Array = q, cost: Array = cost) -> None:
            descend_tree(
                problem.robot.model, rows.tasks, rows.data, rows.box, rows.scale, rows.lower, rows.upper, POLISH, first,
                last, q, cost,
            )  # fmt: skip

        over_ranges(work, index.size, 16)
        better = cost < lowest
        best[better], lowest[better] = q[better], cost[better]
    return best, lowest
