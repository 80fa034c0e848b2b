"""Dynamics of a tree, batched: what `Robot`'s methods of the same names compute, on arrays that are already checked.

Rows are configurations: ``q, qd, qdd, tau (N, n)``. Rows that are not finite are answered by the number that
`first_bad` decodes; kernels fill the rest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Array
from ..conventions import GRAVITY
from ..kernels import dynamics as kernels
from ..kernels import mass as inertia_kernels
from ..kernels.tree import TreeModel, centers_of_mass
from ..parallel import over_ranges

GRAIN = 1024
"""Smallest share of a batch that is worth a thread."""

DOWN = np.array([0.0, 0.0, -GRAVITY])
"""Acceleration of free fall in the world."""

NONE = np.empty((0, 0))
"""Stands for rates or accelerations that are zero."""


def each_range(work: Callable[[int, int], int], count: int, grain: int = GRAIN) -> int:
    """Run *work* on ranges that cover ``range(count)``; the smallest answer that is not −1, or −1."""
    bad: list[int] = []

    def run(start: int, stop: int) -> None:
        answer = work(start, stop)
        if answer >= 0:
            bad.append(answer)

    over_ranges(run, count, grain)
    return min(bad, default=-1)


def inverse_dynamics(model: TreeModel, q: Array, qd: Array, qdd: Array, out: Array, gravity: Array = DOWN) -> int:
    """Torques by the recursive Newton–Euler algorithm; 4 row + input (1 q, 2 q̇, 3 q̈) of the first not finite, or −1."""
    return each_range(lambda a, b: int(kernels.inverse_dynamics(model, q, qd, qdd, gravity, a, b, out)), q.shape[0])


def mass_matrix(model: TreeModel, q: Array, out: Array) -> int:
    """Mass matrices by the composite rigid body algorithm; the first row that is not finite, or −1."""
    return each_range(lambda a, b: int(inertia_kernels.mass_matrix(model, q, a, b, out)), q.shape[0])


def center_of_mass(model: TreeModel, q: Array, out: Array) -> int:
    """Centres of mass; the first row that is not finite, or −1."""
    return each_range(lambda a, b: int(centers_of_mass(model, q, a, b, out)), q.shape[0])


def forward_dynamics(model: TreeModel, q: Array, qd: Array, tau: Array, out: Array) -> tuple[int, int, int]:
    """Accelerations; as `inverse_dynamics` (3: τ), and row and coordinate of the first singular mass matrix."""
    singular: list[tuple[int, int]] = []

    def run(a: int, b: int) -> int:
        bad, row, coordinate = inertia_kernels.forward_dynamics(model, q, qd, tau, DOWN, a, b, out)
        if row >= 0:
            singular.append((int(row), int(coordinate)))
        return int(bad)

    bad = each_range(run, q.shape[0])
    return (bad, *min(singular, default=(-1, -1)))
