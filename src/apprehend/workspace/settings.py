"""What a reachability map is of: the chain, the grid over poses, and the measure kept in its cells."""

from __future__ import annotations

import hashlib
import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..arrays import Array, BoolArray, choice
from ..errors import InputError, expect
from ..kernels import reach_map as kernels
from ..kernels.chain import ChainModel
from ..kernels.reach_map import PoseGrid
from ..kinematics import Robot

MEASURES = {"yoshikawa": kernels.YOSHIKAWA, "mu1": kernels.MU1, "mu2": kernels.MU2, "mu3": kernels.MU3}
"""Measures of manipulability that a map can hold: those of `kinematics.Manipulability`."""

ROWS = {"both": (0, 6), "linear": (0, 3), "angular": (3, 3)}
"""First row and number of rows of the Jacobian that each part takes."""

LARGEST = 1 << 30
"""Most cells of a map: two bytes each."""


@dataclass(frozen=True)
class Settings:
    """What two maps must have in common to be one: robot, frame, grid, measure, and the seed of the samples."""

    robot: str
    frame: str
    chain: str  # digest of the chain and its limits
    resolution: float  # m
    angle: float  # rad; infinite: orientations are not told apart
    measure: str
    part: str
    length: float  # m
    seed: int

    @classmethod
    def of(
        cls, robot: Robot, frame: str, resolution: float, angle: float, measure: str, part: str, length: float,
        seed: int,
    ) -> Settings:  # fmt: skip
        """Check the arguments of `ReachabilityMap.build`."""
        expect(robot, "Robot", "robot")
        for name, value in (("resolution", resolution), ("angle", angle), ("length", length)):
            if not value > 0.0 or (math.isinf(value) and name != "angle"):
                raise InputError(f"{name} is {value}; expected a positive number")
        choice(measure, "measure", tuple(MEASURES))
        choice(part, "part", tuple(ROWS))
        chain = robot.placed(np.eye(4)).chain_model(frame)
        if not chain.free.size:
            raise InputError(f"no joint moves {frame!r}; a map needs a frame at the end of a chain")
        return cls(
            robot.name, frame, digest(chain, *ranges(robot, chain)), resolution, angle, measure, part, length, seed
        )

    @property
    def cuts(self) -> int:
        """The k of `kernels.reach_map`; 0 where orientations are not told apart."""
        return 0 if self.angle > math.pi else math.ceil(math.pi / self.angle - 1e-9)

    @property
    def turns(self) -> int:
        """Number of orientation cells: 4 k³, or 1."""
        return 4 * self.cuts**3 if self.cuts else 1

    def grid(self, positions: Array) -> PoseGrid:
        """The cells over the box of sampled *positions* ``(N, 3)``, a tenth larger on every side."""
        low, high = positions.min(axis=0), positions.max(axis=0)
        margin = 0.1 * (high - low) + 0.5 * self.resolution
        n = [math.ceil(size / self.resolution) for size in high - low + 2.0 * margin]
        cells = math.prod(n) * self.turns
        if cells > LARGEST:
            raise InputError(
                f"a map of {n[0]} × {n[1]} × {n[2]} voxels of {self.resolution:g} m, {self.turns} orientations each, "
                f"has {cells:.3g} cells; at most {LARGEST:.3g} are allowed: choose a larger resolution or angle"
            )
        origin = 0.5 * (low + high - self.resolution * np.array(n))
        return PoseGrid(origin, 1.0 / self.resolution, n[0], n[1], n[2], self.cuts)

    def data(self) -> dict[str, Any]:
        """For a file."""
        return asdict(self)

    def of_robot(self, robot: Robot) -> Settings:
        """The same for another robot."""
        same = {name: value for name, value in self.data().items() if name not in ("robot", "chain")}
        return Settings.of(robot, **same)


def ranges(robot: Robot, chain: ChainModel) -> tuple[Array, Array]:
    """The ranges (k,), (k,) in which the chain's coordinates are sampled: a whole turn where there is no limit."""
    lower, upper = robot.limits.lower[chain.free].copy(), robot.limits.upper[chain.free].copy()
    turning = _turning(chain)
    open_ = ~(np.isfinite(lower) & np.isfinite(upper)) | (turning & (upper - lower > 2.0 * math.pi))
    if (open_ & ~turning).any():
        name = robot.joint_names[int(chain.free[np.argmax(open_ & ~turning)])]
        raise InputError(f"the prismatic joint {name!r} has no limits; a map needs a bounded range: give it limits")
    lower[open_], upper[open_] = -math.pi, math.pi
    return lower, upper


def _turning(chain: ChainModel) -> BoolArray:
    """Whether each of the chain's coordinates moves revolute joints only, (k,)."""
    out = np.ones(chain.free.size, dtype=bool)
    np.logical_and.at(out, chain.column, chain.kind == 0)
    return out


def digest(chain: ChainModel, lower: Array, upper: Array) -> str:
    """A name for the chain: equal for equal geometry and limits."""
    sums = hashlib.sha256()
    for array in (*chain, lower, upper):
        sums.update(np.ascontiguousarray(np.round(array, 12)).tobytes())
    return sums.hexdigest()[:16]
