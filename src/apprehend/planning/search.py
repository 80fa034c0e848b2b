"""Two trees between a start and goals, and shortcuts: what the kernels of `collide_plan` work on."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped
from ..collision import CollisionModel
from ..errors import InputError
from ..kernels import collide_plan
from .trees import Trees

STRIDE = 1.5
"""Largest step of a tree in joint space, in rad (and m)."""

WIDEST, LEAST = 0.5, 0.25
"""Bounds of a node's domain (see `kernels.collide_plan.grow`) relative to the diagonal of the joint space."""

SHORTCUTS = 100
"""Random shortcuts that are tried on a path."""


class Search(Trees):
    """Two growing trees."""

    def __init__(self, model: CollisionModel, start: Array, goals: Array, max_nodes: int):
        super().__init__(start, goals, max(max_nodes, len(goals) + 1))
        self.model = model
        self.chunk = 192

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

    def path(self) -> tuple[Array, int]:
        """The path through both trees once they meet, and the number of the goal that it reaches."""
        return self._joined((int(self.count[0]) - 1, int(self.count[1]) - 1))


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
