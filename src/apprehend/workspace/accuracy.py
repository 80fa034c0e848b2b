"""How well a reachability map agrees with inverse kinematics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .. import ik
from ..arrays import Array
from ..errors import InputError
from ..spatial import Rotation

if TYPE_CHECKING:
    from .map import ReachabilityMap


@dataclass(frozen=True)
class Accuracy:
    """Counts over random poses, uniform in the map's box and in all orientations: what the map says, and what is so.

    True is what inverse kinematics solves. A cell is marked as a whole where only a part of it is reachable, which
    makes false positives at the rim; false negatives are cells that no sample found.
    """

    true_positive: int
    false_positive: int
    false_negative: int
    true_negative: int

    @property
    def precision(self) -> float:
        """Share of the poses said to be reachable that are."""
        said = self.true_positive + self.false_positive
        return self.true_positive / said if said else 1.0

    @property
    def recall(self) -> float:
        """Share of the reachable poses that are said to be."""
        real = self.true_positive + self.false_negative
        return self.true_positive / real if real else 1.0

    @property
    def agreement(self) -> float:
        """Share of all poses on which both agree."""
        total = self.true_positive + self.false_positive + self.false_negative + self.true_negative
        return (self.true_positive + self.true_negative) / total

    def __str__(self) -> str:
        return f"precision {self.precision:.1%}, recall {self.recall:.1%}, agreement {self.agreement:.1%}"


def accuracy(reach: ReachabilityMap, n: int, rng: np.random.Generator) -> Accuracy:
    """See `ReachabilityMap.accuracy`."""
    if reach.robot is None:
        raise InputError("the map was loaded without its robot; give it: ReachabilityMap.load(path, robot)")
    if n < 1:
        raise InputError(f"n is {n}; expected 1 or more")
    T = random_poses(reach, n, rng)
    free = np.full(3, np.inf) if reach.settings.turns == 1 else np.full(3, 1e-6)
    tolerance = np.concatenate([np.full(3, 1e-6), free])
    real = np.asarray(
        ik.solve(reach.robot, T, reach.settings.frame, tolerance=tolerance, diagnose=False, rng=rng).success
    )
    said = reach.reachable(T)
    return Accuracy(*(int(np.sum(x)) for x in (said & real, said & ~real, ~said & real, ~said & ~real)))


def random_poses(reach: ReachabilityMap, n: int, rng: np.random.Generator) -> Array:
    """Poses ``(n, 4, 4)`` T_world_frame, uniform in the box of the grid and over the rotations."""
    grid = reach.grid
    T = np.zeros((n, 4, 4))
    T[:, :3, :3] = Rotation.random(rng, n).matrix
    T[:, :3, 3] = grid.origin + reach.resolution * rng.uniform(0.0, [grid.nx, grid.ny, grid.nz], (n, 3))
    T[:, 3, 3] = 1.0
    return np.asarray(reach.base @ T)
