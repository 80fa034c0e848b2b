"""Trees that grow on a constraint: every new configuration is moved onto it (CBiRRT2, Berenson et al. 2011)."""

from __future__ import annotations

import time

import numpy as np

from ..arrays import Array
from ..collision import CollisionModel
from .constraints import Constraints

STRIDE = 0.2
"""Largest step before it is moved onto the constraint, in rad (and m)."""

LEAD = 1.0 / 16.0
"""Share of the slack that the ends of a path need: they are given, and may lie near the bound."""

DIRECT = 0.75
"""A step on the constraint must bring the tree nearer to where it goes, by 1 − this share of the stride."""


class Tree:
    """Configurations with parents; the first are roots."""

    def __init__(self, roots: Array) -> None:
        self.nodes = np.array(roots)
        self.parent = [-1] * len(roots)
        self.count = len(roots)
        self.lead: dict[int, Array] = {}

    def nearest(self, q: Array) -> int:
        """The nearest node."""
        return int(((self.nodes[: self.count] - q) ** 2).sum(axis=1).argmin())

    def add(self, q: Array, parent: int) -> int:
        """One more node."""
        if self.count == len(self.nodes):
            self.nodes = np.concatenate([self.nodes, np.empty_like(self.nodes), np.empty((64, len(q)))])
        self.nodes[self.count] = q
        self.parent.append(parent)
        self.count += 1
        return self.count - 1

    def way(self, node: int) -> tuple[Array, int]:
        """From *node* to its root, and the number of the root."""
        rows = [node]
        while self.parent[rows[-1]] >= 0:
            rows.append(self.parent[rows[-1]])
        return self.nodes[rows], rows[-1]


class ConstrainedSearch:
    """Two trees between the start and the goals, all of whose motions keep the constraints and are free."""

    def __init__(self, model: CollisionModel, keep: Constraints, start: Array, goals: Array, low: Array, high: Array):
        self.model, self.keep, self.low, self.high = model, keep, low, high
        self.trees = Tree(start[None]), Tree(goals)
        self.samples = 0
        self._enter(self.trees[0], start[None])
        self._enter(self.trees[1], goals)

    @property
    def nodes(self) -> tuple[int, int]:
        """Sizes of the trees."""
        return self.trees[0].count, self.trees[1].count

    def passes(self, qa: Array, qb: Array, share: float = 1.0) -> bool:
        """Whether a straight motion keeps the constraints and is free."""
        held = self.keep.hold(qa[None], qb[None], share)[0]
        return bool(held and self.model.edges_free(qa, qb))

    def _enter(self, tree: Tree, roots: Array) -> None:
        """From roots that lie near a bound, first a motion away from it."""
        inner, good = self.keep.project(roots, self.low, self.high)
        for k, (root, q) in enumerate(zip(roots, inner, strict=True)):
            if good[k] and np.abs(q - root).max() > 0.0 and self.passes(root, q, LEAD):
                tree.add(q, k)

    def reach(self, tree: Tree, row: int, goal: Array) -> tuple[int, bool]:
        """Grow *tree* from a node towards *goal*, step by step on the constraint; the last node, whether it arrived."""
        while True:
            q = tree.nodes[row]
            way = goal - q
            far = float(np.linalg.norm(way))
            if far <= STRIDE:
                if far == 0.0:
                    return row, True
                if self.passes(q, goal) or (far < STRIDE and self.passes(q, goal, LEAD)):
                    return tree.add(goal, row), True
                return row, False
            step, good = self.keep.project((q + (STRIDE / far) * way)[None], self.low, self.high)
            moved = step[0]
            nearer = float(np.linalg.norm(goal - moved)) <= far - (1.0 - DIRECT) * STRIDE
            if not good[0] or not nearer or np.linalg.norm(moved - q) > 2.0 * STRIDE or not self.passes(q, moved):
                return row, False
            row = tree.add(moved, row)

    def solve(self, rng: np.random.Generator, until: float, max_nodes: int) -> tuple[Array, int] | None:
        """A path and the number of its goal, or None when the time is over or the trees are full."""
        first = True
        while time.perf_counter() < until and max(self.nodes) < max_nodes:
            one = 0 if self.nodes[0] <= self.nodes[1] else 1
            mine, theirs = self.trees[one], self.trees[1 - one]
            if first:  # straight towards the other tree
                row, target, first = 0, theirs.nodes[theirs.nearest(mine.nodes[0])], False
            else:
                self.samples += 1
                target = rng.uniform(self.low, self.high)
                row = mine.nearest(target)
            row, _ = self.reach(mine, row, target)
            met, reached = self.reach(theirs, theirs.nearest(mine.nodes[row]), mine.nodes[row].copy())
            if reached:
                halves = [mine.way(row), theirs.way(met)]
                if one == 1:
                    halves.reverse()
                (a, _), (b, root) = halves
                return np.concatenate([a[::-1], b[1:]]), root
        return None

    def shorten(self, path: Array, rng: np.random.Generator, tries: int, until: float) -> Array:
        """Random ways through, grown on the constraint, where they are shorter than what they replace."""
        for _ in range(tries):
            if len(path) < 3 or time.perf_counter() > until:
                break
            i, k = sorted(rng.integers(0, len(path), 2).tolist())
            if k - i < 2:
                continue
            tree = Tree(path[i][None])
            row, reached = self.reach(tree, 0, path[k])
            if not reached:
                continue
            way = tree.way(row)[0][::-1]
            if _length(way) < _length(path[i : k + 1]) - 1e-6:
                path = np.concatenate([path[:i], way, path[k + 1 :]])
        return self.thin(path)

    def thin(self, path: Array) -> Array:
        """Fewer vertices: those that a straight motion on the constraint can pass by go."""
        kept, i = [0], 0
        while i < len(path) - 1:
            k = min(len(path) - 1, i + 8)
            while k > i + 1 and not self.passes(path[i], path[k]):
                k -= 1
            kept.append(k)
            i = k
        return path[kept]


def _length(path: Array) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
