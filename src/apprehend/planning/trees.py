"""Two trees of configurations, one from the start and one from the goals: what the kernels of planners fill."""

from __future__ import annotations

import numpy as np

from ..arrays import Array

FIRST_ROOM = 512
"""Nodes that a tree has room for at first."""


class Trees:
    """Trees with room for at most *most* nodes each; the roots are the start, and the goals in their order."""

    def __init__(self, start: Array, goals: Array, most: int):
        self.most = most
        room = min(most, max(FIRST_ROOM, 4 * len(goals)))
        self.nodes = np.empty((2, room, len(start)))
        self.parent = np.full((2, room), -1, np.int64)
        self.domain = np.full((2, room), np.inf)
        self.count = np.array([1, len(goals)], np.int64)
        self.nodes[0, 0] = start
        self.nodes[1, : len(goals)] = goals
        self.samples = 0
        self.compiling = 0.0  # seconds that went into compiling kernels, in the first run of their kind

    def _make_room(self) -> None:
        old = self.nodes.shape[1]
        room = min(4 * old, self.most)
        nodes, parent = np.empty((2, room, self.nodes.shape[2])), np.full((2, room), -1, np.int64)
        domain = np.full((2, room), np.inf)
        nodes[:, :old], parent[:, :old], domain[:, :old] = self.nodes, self.parent, self.domain
        self.nodes, self.parent, self.domain = nodes, parent, domain

    def _joined(self, ends: tuple[int, int]) -> tuple[Array, int]:
        """The path through both trees by their nodes *ends*, which are one configuration, and the goal it reaches."""
        halves = []
        row = -1
        for k in (0, 1):
            row = ends[k]
            rows = [row]
            while self.parent[k, row] >= 0:
                row = int(self.parent[k, row])
                rows.append(row)
            halves.append(self.nodes[k, rows])
        return np.concatenate([halves[0][::-1], halves[1][1:]]), row
