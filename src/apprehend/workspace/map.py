"""`ReachabilityMap`: which poses a chain reaches, and how well it moves there, in a six-dimensional grid (K)."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self
from zipfile import BadZipFile

import numpy as np
from numpy.typing import ArrayLike

from .. import parallel
from ..arrays import Array, IntArray, as_pose
from ..errors import InputError
from ..files import replace_file
from ..kernels import reach_map as kernels
from ..kernels.reach_map import PoseGrid
from ..kinematics import Robot
from .accuracy import Accuracy, accuracy
from .placements import BasePlacements, base_placements, flattened
from .sampler import LEVELS, ByteArray, Counts, Sampler, Valid, coverage_of
from .settings import Settings

CHUNK = 1 << 19
"""Samples that are worked on at once."""

MOST_SAMPLES = 200_000_000
CHECKPOINT = 20.0
"""Seconds of sampling after which a map that has a file is saved."""

GRAIN = 4096

Progress = Callable[[float, int], None]


@dataclass(frozen=True, eq=False)
class ReachabilityMap:
    """Reachability and manipulability of one frame of a robot over its workspace, in cells of poses (K).

    A cell is a voxel of *resolution* m times a set of orientations about *angle* rad wide (`kernels.reach_map`). It
    holds how many sampled configurations led into it (0: not reachable as far as was sampled), and the best measure
    of manipulability among them, rounded to 1/255 of *scale*. Queries take O(1). Poses are T_world_frame, for the
    robot as it was placed.

    After N. Vahrenkamp, T. Asfour, R. Dillmann, Efficient inverse kinematics computation based on reachability
    analysis, IJHR 9(4), 2012; samples are random in place of K's regular grid of joint angles, which would need
    (360° / 5°)⁷ of them.
    """

    settings: Settings
    grid: PoseGrid
    base: Array  # (4, 4) T_world_root of the robot
    hits: ByteArray  # (cells,)
    best: ByteArray  # (cells,)
    scale: float  # the value of level 255
    counts: Counts
    robot: Robot | None = None

    # making --------------------------------------------------------------------------------------------------------

    @classmethod
    def build(
        cls,
        robot: Robot,
        frame: str,
        *,
        resolution: float = 0.05,
        angle: float = np.pi / 4.0,
        measure: str = "yoshikawa",
        part: str = "both",
        length: float = 1.0,
        coverage: float = 0.95,
        samples: int | None = None,
        valid: Valid | None = None,
        rng: np.random.Generator | None = None,
        file: str | Path | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """Sample the configurations of *robot* within its limits until *coverage* is reached, or *samples* are drawn.

        *resolution* (m) and *angle* (rad; infinite: positions only) are the size of a cell. *measure* is
        ``"yoshikawa"`` √det(J Jᵀ), or K's ``"mu1"``, ``"mu2"``, ``"mu3"``, of the *part* ``"both"``, ``"linear"`` or
        ``"angular"`` of the mixed Jacobian, ω's rows times *length* (m), as in `kinematics.manipulability`.
        *valid* ``(N, n) -> (N,)`` leaves configurations out (``CollisionModel(robot).free``: self-collisions). *rng*
        gives the seed of the samples: one draw; without it they are always the same.

        With a *file* the map is saved there as it grows, and an interrupted build of the same map goes on from it.
        *progress* is called with the coverage and the number of samples.

        Raises `InputError` for a grid of more than 2³⁰ cells, an unlimited prismatic joint, or a frame nothing moves.
        """
        if not 0.0 < coverage < 1.0:
            raise InputError(f"coverage is {coverage}; expected more than 0 and less than 1")
        if samples is not None and samples < 1:
            raise InputError(f"samples is {samples}; expected 1 or more")
        seed = 0 if rng is None else int(rng.integers(1 << 62))
        settings = Settings.of(robot, frame, resolution, angle, measure, part, length, seed)
        sampler = Sampler(robot, settings, valid)
        if file is not None and Path(file).exists():
            found = cls.load(file, robot)
            if found.settings != settings:
                raise InputError(f"{file} holds another map: {found.settings}; give another file, or remove it")
            sampler.resume(found.grid, found.hits, found.best, found.scale, found.counts)
        most, saved = samples or MOST_SAMPLES, time.monotonic()
        while sampler.counts.samples < most and (samples is not None or sampler.coverage < coverage):
            sampler.add(min(CHUNK, most - sampler.counts.samples))
            if progress is not None:
                progress(sampler.coverage, sampler.counts.samples)
            if file is not None and time.monotonic() - saved > CHECKPOINT:
                cls._of(sampler).save(file)
                saved = time.monotonic()
        out = cls._of(sampler)
        if file is not None:
            out.save(file)
        return out

    @classmethod
    def _of(cls, sampler: Sampler) -> Self:
        s = sampler
        return cls(s.settings, s.grid, s.robot.base, s.hits, s.best, s.scale, s.counts, s.robot)

    # what it knows --------------------------------------------------------------------------------------------------

    @cached_property
    def coverage(self) -> float:
        """Estimated probability that the cell of one more random configuration is marked already (`coverage_of`)."""
        return coverage_of(self.hits, self.counts)

    @property
    def resolution(self) -> float:
        """Edge of a voxel in m."""
        return self.settings.resolution

    @cached_property
    def capability(self) -> Array:
        """Share of the orientation cells that are reachable in each voxel, (nx, ny, nz)."""
        reached: Array = (self.hits.reshape(-1, self.settings.turns) > 0).mean(axis=1)
        return reached.reshape(self.grid.nx, self.grid.ny, self.grid.nz)

    @cached_property
    def best_manipulability(self) -> Array:
        """Best manipulability over the orientations of each voxel, (nx, ny, nz); 0 where nothing is reached."""
        levels = self.best.reshape(-1, self.settings.turns).max(axis=1)
        return np.asarray(levels.reshape(self.capability.shape) * self.level)

    @property
    def level(self) -> float:
        """One step of the stored manipulability."""
        return self.scale / LEVELS

    @property
    def volume(self) -> float:
        """Volume in m³ of the voxels with a reachable pose: an upper estimate, for voxels of the rim count whole."""
        return float(np.count_nonzero(self.capability)) * self.resolution**3

    @property
    def centers(self) -> tuple[Array, Array, Array]:
        """Coordinates in m, in the frame of the robot's root, of the centres of the voxels along x, y and z."""
        x, y, z = (
            self.grid.origin[i] + self.resolution * (np.arange(n) + 0.5)
            for i, n in enumerate((self.grid.nx, self.grid.ny, self.grid.nz))
        )
        return x, y, z

    def cells(self, T: ArrayLike) -> IntArray:
        """Numbers of the cells of the poses ``T (..., 4, 4)``, T_world_frame; −1 outside the grid."""
        poses = np.ascontiguousarray(T, dtype=np.float64)
        if poses.shape[-2:] != (4, 4):
            as_pose(poses, "T")
        rows = poses.reshape(-1, 16)
        out = np.empty(len(rows), dtype=np.int64)
        good = []
        parallel.over_ranges(
            lambda a, b: good.append(kernels.pose_cells(self.grid, self._base, rows, a, b, out)), len(rows), GRAIN
        )
        if not all(good):
            as_pose(T, "T")  # says what is wrong with it
        return out.reshape(poses.shape[:-2])

    @cached_property
    def _base(self) -> Array:
        row: Array = flattened(self.base[None])[0]
        return row

    def reachable(self, T: ArrayLike) -> Any:
        """Whether the cells of the poses ``T (..., 4, 4)`` were reached, ``(...)``; a plain bool for one pose."""
        cell = self.cells(T)
        out = (cell >= 0) & (self.hits[cell] > 0)
        return bool(out) if out.ndim == 0 else out

    def manipulability(self, T: ArrayLike) -> Any:
        """Best manipulability known in the cells of the poses ``T (..., 4, 4)``, ``(...)``; 0 where not reachable.

        Rounded to scale/255; a float for one pose.
        """
        cell = self.cells(T)
        out = np.where(cell >= 0, self.best[cell], 0) * self.level
        return float(out) if out.ndim == 0 else out

    def base_placements(
        self,
        T: ArrayLike,
        *,
        n: int = 10,
        height: float = 0.0,
        region: ArrayLike | None = None,
        bases: ArrayLike | None = None,
    ) -> BasePlacements:
        """Poses of the robot's root link from which all targets ``T (..., 4, 4)`` are reachable, the best *n*.

        The score of a base is the manipulability at its worst target. Looked at are upright base poses with their
        origin at *height* m, a voxel apart in *region* ``(2, 2)`` (lower and upper corner in x, y; default: all
        that could reach) and 10° apart in yaw; or the given *bases* ``(B, 4, 4)``. Where the robot stands now does not
        matter. A map that knows its robot gives only bases that inverse kinematics confirms, with joint vectors.
        """
        return base_placements(self, T, n, height, region, bases)

    def accuracy(self, n: int = 10_000, *, rng: np.random.Generator) -> Accuracy:
        """How far the map agrees with inverse kinematics, on *n* random poses in its box."""
        return accuracy(self, n, rng)

    def draw(self, plane: str = "xz", at: float | None = None, of: str = "reachability", *, axes: Any = None) -> Any:
        """Picture of a cut through the map: see `workspace.pictures.draw`."""
        from .pictures import draw

        return draw(self, plane, at, of, axes=axes)

    # files ----------------------------------------------------------------------------------------------------------

    def save(self, path: str | Path) -> None:
        """Write the map: a NumPy archive (whatever its name ends in) that holds the reachable voxels only."""
        used = np.flatnonzero(self.capability.ravel())
        turns = self.settings.turns
        head = {"format": 1, "settings": self.settings.data(), "scale": self.scale,
                "counts": asdict(self.counts)}  # fmt: skip
        with replace_file(path) as work, work.open("wb") as file:
            np.savez(
                file, head=np.array(json.dumps(head)), base=self.base, origin=self.grid.origin,
                shape=np.array(self.capability.shape), used=used,
                hits=self.hits.reshape(-1, turns)[used], best=self.best.reshape(-1, turns)[used],
            )  # fmt: skip

    @classmethod
    def load(cls, path: str | Path, robot: Robot | None = None) -> Self:
        """Read a map. With its *robot* it can be checked against inverse kinematics, and grow.

        Raises `InputError` where the file is not a map, or is one of another chain than *robot*'s.
        """
        try:
            with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as archive:
                data = {name: archive[name] for name in archive.files}
            head = json.loads(str(data["head"]))
            settings = Settings(**head["settings"])
            counts = Counts(**head["counts"])
            nx, ny, nz = (int(v) for v in data["shape"])
            layers = np.zeros((2, nx * ny * nz, settings.turns), np.uint8)
            layers[0, data["used"]], layers[1, data["used"]] = data["hits"], data["best"]
        except FileNotFoundError:
            raise
        except (OSError, ValueError, KeyError, TypeError, IndexError, BadZipFile) as error:
            raise InputError(f"{path} is not a reachability map, or is damaged: {error}") from error
        base = data["base"]
        if robot is not None:
            if settings.of_robot(robot).chain != settings.chain:
                raise InputError(
                    f"{path} is a map of {settings.robot!r} to {settings.frame!r}; the chain of {robot.name!r} differs"
                )
            base = robot.base
        grid = PoseGrid(data["origin"], 1.0 / settings.resolution, nx, ny, nz, settings.cuts)
        hits, best = (np.ascontiguousarray(layer.ravel()) for layer in layers)
        return cls(settings, grid, base, hits, best, float(head["scale"]), counts, robot)
