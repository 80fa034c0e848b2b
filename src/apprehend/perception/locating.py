"""Locating a known body that depth cameras see (G 4, the first step of the grasp process).

Points above the table are grouped; the body is put on the table in every resting pose and direction, slid under the
points, and the poses that agree best with what the cameras saw (and with the space that they saw to be free) are
refined in all six freedoms. The answer says how well it fits, how sure it is in every direction, and whether another
pose would explain the images as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_pose, as_shaped
from ..bodies import Body
from ..errors import InputError, expect
from ..result import Result, Status
from .camera import DepthImage, Noise
from .evaluate import Fit, Window, fit, windows
from .hypotheses import POINTS, centred, distinct, resting_hypotheses, slide
from .mesh import ModelSurface
from .refine import Refiner
from .segment import Group, Plane, groups_above

FEWEST_POINTS = 25
GROUPS = 4  # groups of points that are tried
GOOD_FITNESS = 0.8
SAME = 0.003  # m; poses whose surfaces differ by less are one
TIED = 0.1  # a pose ties with the best if its cost is higher by less than this share (and `TIED_FLOOR`)
TIED_FLOOR = 0.05


class LocateStatus(Status):
    """How locating ended."""

    SUCCESS = "The body was found."
    AMBIGUOUS = "The body was found, but another pose that differs visibly explains the images as well."
    POOR_FIT = "No pose of the body explains the images well: it may be another object, or mostly hidden."
    NOT_SEEN = "The cameras see nothing on the table that could be the body."


@dataclass(frozen=True, eq=False)
class LocateResult(Result):
    """A pose and how far it can be trusted.

    *pose* is T_world_body (the identity if nothing was seen). *covariance* (6, 6) is of (translation, rotation) about
    the centre of mass in world axes; a freedom that the images leave open, such as the turn of a can about its axis,
    shows as a large variance. *residual* is the root mean square deviation in m of the pixels that the pose explains,
    and *fitness* the share of the pixels that it explains. *alternatives* are other poses that fit as well; those
    that put the surface in the same place (a symmetry of the body) are not among them.
    """

    status: LocateStatus
    pose: Array
    covariance: Array
    residual: float
    fitness: float
    pixels: int
    alternatives: tuple[Array, ...] = field(default=())

    def explain(self) -> str:
        """The outcome with its numbers."""
        if self.status is LocateStatus.NOT_SEEN:
            return str(self.status.value)
        return (
            f"{self.status.value} It explains {self.fitness:.0%} of {self.pixels} pixels, "
            f"to {self.residual * 1e3:.1f} mm."
        )


@dataclass(frozen=True, eq=False)
class _Candidate:
    pose: Array
    information: Array
    fit: Fit


def locate(
    views: DepthImage | Sequence[DepthImage],
    body: Body,
    *,
    plane: Plane | None = None,
    rng: np.random.Generator,
    region: ArrayLike | None = None,
    guess: ArrayLike | None = None,
    resting: bool = True,
    noise: Noise | None = None,
) -> LocateResult:
    """Find *body* in depth images of one moment.

    *plane* is the table (default: z = 0); *region* (2, 3), its lower and upper corner in the world, limits where to
    look; *guess* (4, 4), an approximate T_world_body, is refined instead of searched for, as with a hand camera
    near the object; *resting* says that the body stands or lies on the plane; *noise* is that of the sensor.

    Raises `InputError` for no view, a region that is not a box, or a guess that is not one pose.
    """
    expect(body, "Body", "body")
    images = [views] if isinstance(views, DepthImage) else list(views)
    if not images:
        raise InputError("locate needs at least one depth image")
    table, sensor = plane or Plane(), noise or Noise()
    corners = None if region is None else as_shaped(region, "region", 2, 3)
    if corners is not None and not (corners.shape == (2, 3) and (corners[0] < corners[1]).all()):
        raise InputError("region must hold a lower corner and an upper corner, (2, 3), lower below upper everywhere")
    start = None if guess is None else as_pose(guess, "guess")
    if start is not None and start.shape != (4, 4):
        raise InputError(f"guess has shape {start.shape}; expected one pose (4, 4)")
    surface = ModelSurface(body)
    clearance = _clearance(images, sensor)
    found: list[_Candidate] = []
    for group in groups_above(images, table, clearance, corners)[:GROUPS]:
        if len(group.points) >= FEWEST_POINTS:
            search = _Search(images, group, surface, table, clearance, sensor, rng, resting)
            found += search.near(start) if start is not None else search.everywhere()
    return _answer(surface, found)


def _clearance(images: Sequence[DepthImage], sensor: Noise) -> float:
    """Height in m above the plane below which a point is taken for the plane's: five standard deviations."""
    depths = np.concatenate([image.depth[image.valid] for image in images])
    typical = float(np.median(depths)) if depths.size else 1.0
    return max(0.002, 5.0 * (sensor.floor + sensor.growth * max(typical - 0.4, 0.0) ** 2))


class _Search:
    """The search for the body in one group of points."""

    def __init__(
        self, images: Sequence[DepthImage], group: Group, surface: ModelSurface, plane: Plane, clearance: float,
        sensor: Noise, rng: np.random.Generator, resting: bool,
    ) -> None:  # fmt: skip
        self.surface, self.plane, self.clearance, self.rng = surface, plane, clearance, rng
        self.eyes = [image.pose[:3, 3] for image in images]
        around = windows(images, group, surface.body.radius, sensor.floor, sensor.growth)
        self.coarse = [window.thinned(500, rng) for window in around]
        self.middle = [window.thinned(2500, rng) for window in around]
        self.fine = [window.thinned(12000, rng) for window in around]
        self.group = group
        sigma = float(np.median(np.concatenate([w.sigma for w in around])))
        few, many = group.sample(350, rng), group.sample(1200, rng)
        self.quick = Refiner(surface, *few, self.middle, plane, clearance, sigma=sigma, resting=resting)
        self.thorough = Refiner(surface, *many, self.fine, plane, clearance, sigma=sigma, resting=resting)

    def near(self, guess: Array) -> list[_Candidate]:
        """The refined *guess*."""
        return self._finish([self.quick.refine(guess, 15).pose])

    def everywhere(self) -> list[_Candidate]:
        """The best poses on the table."""
        surface, radius = self.surface, self.surface.body.radius
        points, toward = self.group.sample(POINTS, self.rng)
        poses = resting_hypotheses(surface, points, self.eyes, self.plane)
        poses = centred(surface, poses, self.coarse, self.plane)
        poses, cost = slide(surface, poses, points, toward, self.plane, 3, 0.25 * radius)
        half = np.argsort(cost, kind="stable")[: max(len(poses) // 2, 16)]
        poses, cost = slide(surface, poses[half], points, toward, self.plane, 4, 0.1 * radius)
        kept = distinct(poses, np.argsort(cost, kind="stable"), radius, 40)
        ranked = sorted((self._fit(poses[i], self.coarse).cost, i) for i in kept)
        refined = [self.quick.refine(poses[i], 10).pose for _, i in ranked[:8]]
        return self._finish(refined)

    def _finish(self, poses: list[Array]) -> list[_Candidate]:
        """The best few of *poses*, thoroughly refined and judged by all pixels."""
        judged = sorted(((self._fit(pose, self.middle).cost, i) for i, pose in enumerate(poses)))
        out = []
        for cost, i in judged[:3]:
            if cost > 1.5 * judged[0][0] + 0.5:
                break
            refined = self.thorough.refine(poses[i], 8, start=0.006, end=0.003)
            out.append(_Candidate(refined.pose, refined.information, self._fit(refined.pose, self.fine)))
        return out

    def _fit(self, pose: Array, around: Sequence[Window]) -> Fit:
        return fit(self.surface, pose, around, self.plane, self.clearance)


def _answer(surface: ModelSurface, found: list[_Candidate]) -> LocateResult:
    if not found:
        return LocateResult(LocateStatus.NOT_SEEN, np.eye(4), np.diag([1.0] * 6), 0.0, 0.0, 0)
    found = sorted(found, key=lambda c: c.fit.cost)
    best = found[0]
    limit = best.fit.cost * (1.0 + TIED) + TIED_FLOOR
    others = [c.pose for c in found[1:] if c.fit.cost < limit and surface_distance(surface, c.pose, best.pose) > SAME]
    status = LocateStatus.AMBIGUOUS if others else LocateStatus.SUCCESS
    if best.fit.fitness < GOOD_FITNESS:
        status = LocateStatus.POOR_FIT
    covariance: Array = np.asarray(np.linalg.inv(best.information), dtype=np.float64)
    return LocateResult(
        status, best.pose, covariance, best.fit.residual, best.fit.fitness, best.fit.pixels, tuple(others)
    )  # fmt: skip


def surface_distance(surface: ModelSurface, one: Array, other: Array) -> float:
    """Largest distance in m of the surface at pose *one* from the surface at pose *other*.

    It is zero exactly where the poses differ by a symmetry of the body.
    """
    T = np.linalg.solve(other, one)
    return float(surface.nearest(surface.points @ T[:3, :3].T + T[:3, 3])[1].max())
