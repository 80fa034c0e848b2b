"""Recording of a simulation at a fixed rate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..errors import InputError

if TYPE_CHECKING:
    from .world import World


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of a simulation: k instants, n coordinates of the robot."""

    time: Array  # (k,) s
    q: Array  # (k, n)
    qd: Array  # (k, n)
    tau: Array  # (k, n)
    poses: Mapping[str, Array]  # movable body → (k, 4, 4)
    robot_force: Mapping[str, Array]  # movable body → (k, 6) wrench from the robot about the centre of mass, world axes
    other_force: Mapping[str, Array]  # the same from all else


class Recorder:
    """Takes a sample of a world whenever one is due."""

    def __init__(self, world: World, rate: float) -> None:
        if not (np.isfinite(rate) and rate > 0.0):
            raise InputError(f"rate is {rate} samples per second; expected a positive number")
        self._period = 1.0 / rate
        self._next = world.time
        self._names = list(world.plant.bodies)
        self._links = list(world.plant.links.values())
        self._rows: list[tuple[float, Array, Array, Array]] = []
        self._poses: dict[str, list[Array]] = {name: [] for name in self._names}
        self._robot: dict[str, list[Array]] = {name: [] for name in self._names}
        self._other: dict[str, list[Array]] = {name: [] for name in self._names}
        self.take(world)

    def take(self, world: World) -> None:
        """Add a sample if one is due."""
        if world.time < self._next - 0.5 * world.timestep:
            return
        self._next += self._period
        self._rows.append((world.time, world.q, world.qd, world.tau.copy()))
        for name in self._names:
            index = world.plant.bodies[name]
            about = world.data.xipos[index]
            total = world.table.wrench([index], about)
            robot = world.table.wrench([index], about, self._links)
            self._poses[name].append(world.body_pose(name))
            self._robot[name].append(robot)
            self._other[name].append(total - robot)

    def result(self) -> Recording:
        """The samples so far as arrays."""
        time, q, qd, tau = (np.array(column) for column in zip(*self._rows, strict=True))
        return Recording(
            time, q, qd, tau,
            {name: np.array(rows) for name, rows in self._poses.items()},
            {name: np.array(rows) for name, rows in self._robot.items()},
            {name: np.array(rows) for name, rows in self._other.items()},
        )  # fmt: skip
