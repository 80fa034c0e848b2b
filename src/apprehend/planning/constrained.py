"""Trees that grow on a constraint, and ways on it that are shorter: what the kernels of `constrain_plan` work on."""

from __future__ import annotations

import time

import numpy as np

from ..arrays import Array, IntArray
from ..collision import CollisionModel
from ..kernels import collide_plan, constrain_plan
from .keeping import Constraints
from .trees import Trees

STRIDE, LEAST = 0.5, 0.03
"""Longest and shortest step before it is moved onto the constraint, in rad (and m)."""

WIDEST, NARROWEST = 0.5, 0.25
"""Bounds of a node's domain (see `kernels.constrain_plan.grow`) relative to the diagonal of the joint space."""

PORTION = 16
"""Random configurations between looks at the clock."""

NOTHING = np.empty((0, 2))


class ConstrainedSearch(Trees):
    """Two trees between the start and the goals, all of whose motions keep the constraints and are free."""

    def __init__(
        self, model: CollisionModel, keep: Constraints, start: Array, goals: Array, low: Array, high: Array, most: int
    ):
        super().__init__(start, goals, max(most, 2 * len(goals) + 2))
        self.low, self.high = low, high
        across = float(np.linalg.norm(high - low))
        scale = np.array([STRIDE, LEAST, model.clearance, model.resolution, WIDEST * across, NARROWEST * across])
        self.task = constrain_plan.Task(model.compiled, model.lanes, keep.compiled, low, high, scale)
        self.tally = np.zeros(3, np.int64)
        for k, roots in enumerate((start[None], goals)):
            self._enter(model, keep, k, roots)

    def _enter(self, model: CollisionModel, keep: Constraints, k: int, roots: Array) -> None:
        """From roots that lie near a bound, first a motion away from it."""
        inner, good = keep.project(roots, self.low, self.high)
        moved = np.flatnonzero(good & (inner != roots).any(axis=1))
        moved = moved[keep.hold(roots[moved], inner[moved])]
        for row in moved[model.edges_free(roots[moved], inner[moved])] if len(moved) else ():
            self.nodes[k, self.count[k]] = inner[row]
            self.parent[k, self.count[k]] = row
            self.count[k] += 1

    def solve(self, rng: np.random.Generator, until: float) -> tuple[Array, int] | None:
        """A path and the number of its goal, or None when the time is over or the trees are full."""
        near = int(((self.nodes[1, : self.count[1]] - self.nodes[0, 0]) ** 2).sum(axis=1).argmin())
        samples = self.nodes[1, near][None].copy()  # the first way is that towards the nearest goal
        ends = np.zeros(2, np.int64)
        while True:
            status, used = self._run(self.count, samples, self.nodes[0], NOTHING, ends)
            self.samples += used
            if status == collide_plan.CONNECTED:
                return self._joined((int(ends[0]), int(ends[1])))
            full = status == collide_plan.FULL
            if full and self.nodes.shape[1] < self.most:
                self._make_room()
            elif full or time.perf_counter() - self.compiling > until:
                return None
            samples = rng.uniform(self.low, self.high, (PORTION, len(self.low)))

    def shorten(self, path: Array, rng: np.random.Generator, tries: int) -> Array:
        """Random ways on the constraint, where they are shorter than what they replace."""
        room = np.empty((4 * len(path) + 64, path.shape[1]))
        room[: len(path)] = path
        count = np.array([len(path), 0], np.int64)
        none = np.empty((0, path.shape[1]))
        _, left = self._run(count, none, room, rng.uniform(size=(tries, 2)), np.zeros(2, np.int64))
        return room[:left].copy()

    def _run(self, count: IntArray, samples: Array, path: Array, pairs: Array, ends: IntArray) -> tuple[int, int]:
        began, known = time.perf_counter(), len(constrain_plan.search.overloads)
        status, number = constrain_plan.search(
            self.task, self.nodes, self.parent, self.domain, count, samples, path, pairs, ends, self.tally
        )
        if len(constrain_plan.search.overloads) > known:
            self.compiling += time.perf_counter() - began
        return int(status), int(number)

    @property
    def full(self) -> bool:
        """Whether there is no room for more nodes."""
        return bool(self.count.max() >= self.most)

    def told(self) -> str:
        """What became of the steps."""
        share = 100.0 * self.tally / max(int(self.tally.sum()), 1)
        return (
            f"of {self.tally.sum()} steps {share[constrain_plan.LEFT]:.0f} % left the constraints and "
            f"{share[constrain_plan.BLOCKED]:.0f} % hit something"
        )
