"""Two trees between a start and goals, and shortcuts: what the kernels of `collide_plan` work on."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped
from ..collision import CollisionModel
from ..errors import InputError
from ..kernels import collide_plan

STRIDE = 1.5
"""Largest step of a tree in joint space, in rad (and m)."""

WIDEST, LEAST = 0.5, 0.25
"""Bounds of a node's domain (see `kernels.collide_plan.grow`) relative to the diagonal of the joint space."""

FIRST_ROOM = 512
"""Nodes that a tree has room for at first."""

SHORTCUTS = 100
"""Random shortcuts that are tried on a path."""


class Search:
    """Two growing trees."""

    def __init__(self, model: CollisionModel, start: Array, goals: Array, max_nodes: int):
        self.model = model
        self.most = max(max_nodes, len(goals) + 1)
        room = min(self.most, max(FIRST_ROOM, 2 * len(goals)))
        self.nodes = np.empty((2, room, len(start)))
        self.parent = np.full((2, room), -1, np.int64)
        self.domain = np.full((2, room), np.inf)
        self.count = np.array([1, len(goals)], np.int64)
        self.nodes[0, 0] = start
        self.nodes[1, : len(goals)] = goals
        self.samples = 0
        self.chunk = 192
        self.compiling = 0.0  # seconds that went into compiling the kernel, in the first run of its kind

    def grow(self, rng: np.random.Generator, low: Array, high: Array) -> int:
        """Try one more portion of random configurations."""
        samples = rng.random((self.chunk, len(low)))
        began, known = time.perf_counter(), len(collide_plan.grow.overloads)
        status, used = collide_plan.grow(
            self.model.compiled, self.model.lanes, self.nodes, self.parent, self.domain, self.count,
            samples, low, high, STRIDE, WIDEST, LEAST, self.model.clearance, self.model.resolution,
        )  # fmt: skip
        if len(collide_plan.grow.overloads) > known:
            self.compiling += time.perf_counter() - began
        self.samples += int(used)
        self.chunk = min(2 * self.chunk, 512)
        if status == collide_plan.FULL and self.nodes.shape[1] < self.most:
            self._make_room()
            return int(collide_plan.MORE)
        return int(status)

    def _make_room(self) -> None:
        old = self.nodes.shape[1]
        room = min(4 * old, self.most)
        nodes, parent = np.empty((2, room, self.nodes.shape[2])), np.full((2, room), -1, np.int64)
        domain = np.full((2, room), np.inf)
        nodes[:, :old], parent[:, :old], domain[:, :old] = self.nodes, self.parent, self.domain
        self.nodes, self.parent, self.domain = nodes, parent, domain

    def path(self) -> tuple[Array, int]:
        """The path through both trees once they meet, and the number of the goal that it reaches."""
        halves = []
        root = 0
        for k in (0, 1):
            row, rows = int(self.count[k]) - 1, []
            while row >= 0:
                rows.append(row)
                root = row
                row = int(self.parent[k, row])
            halves.append(self.nodes[k, rows])
        return np.concatenate([halves[0][::-1], halves[1][1:]]), root


def shortcut(model: CollisionModel, path: ArrayLike, *, rng: np.random.Generator, tries: int = SHORTCUTS) -> Array:
    """A shorter path ``(M', n)`` with the same ends: vertices are passed by and random shortcuts taken where free."""
    points = as_shaped(path, "path", model.robot.n)
    if points.ndim != 2 or not len(points):
        raise InputError(f"path has shape {points.shape}; expected (M, {model.robot.n})")
    if len(points) < 3:
        return points.copy()
    room = np.zeros((len(points) + 2 * tries + 2, model.robot.n))
    room[: len(points)] = points
    pairs = rng.uniform(size=(tries, 2))
    count = collide_plan.shortcut(
        model.compiled, model.lanes, room, len(points), pairs, model.clearance, model.resolution
    )
    return room[:count].copy()
