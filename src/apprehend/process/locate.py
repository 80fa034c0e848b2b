"""Step *locate*: where is the object in the scene?"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Array
from ..bodies import Body
from ..perception import Camera, LocateStatus, ModelSurface, Noise, Plane, locate, look_at, surface_distance
from ..sim import look
from ..spatial import Rotation
from .context import Context
from .judge import angle
from .step import Outcome

AZIMUTHS = (-1.0, 1.0)
"""Directions in rad, from the robot over the object, in which the scene's cameras stand."""

DISTANCE, HEIGHT = 0.55, 0.65
"""Horizontal distance in m of the cameras from the object's described place, and their height above it."""

SEARCH = 0.3
"""Half the width in m of the region around the described place in which the object is looked for."""


SAME = 3e-3
"""Distance in m between the surfaces of two poses below which noisy images do not tell them apart."""

LARGE = 0.2
"""Difference of two orientations in rad from which on it is an open turn, and no error of measurement."""


@dataclass(frozen=True)
class Locate:
    """Let the scene come to rest, and find the object in noisy depth images of two fixed cameras (perception room).

    The described pose says where to look and which of several equivalent poses of a symmetric object is meant; where
    it does not fit what is seen, the whole region around it is searched without it. *calibration* are the standard
    deviations in m and rad, per axis, of the error with which the robot knows where the two cameras stand (one error
    for both, about the described place): what the look of the hand camera takes out again.
    """

    name: str = "locate"
    title: str = "Locate the object"
    camera: Camera = field(default_factory=lambda: Camera.from_fov(320, 240))
    noise: Noise = field(default_factory=Noise)
    calibration: tuple[float, float] = (0.0, 0.0)

    def run(self, context: Context) -> Outcome:
        """Settle, look, find; the simulator's true pose serves to state the error, and nothing else."""
        settled = settle(context)
        if not settled.success:
            return settled
        described = context.scene.bodies[context.name].pose
        centre = described[:3, :3] @ context.body.com + described[:3, 3]
        error = self._calibration_error(context.rng, centre)
        views = [
            replace(view, pose=error @ view.pose)
            for view in (
                look(context.world, self.camera, pose, noise=self.noise).image for pose in viewpoints(context, centre)
            )
        ]
        plane = support(context.body, described)
        region = np.array([centre - SEARCH, centre + SEARCH])
        result = locate(
            views, context.body, plane=plane, rng=context.rng, region=region, guess=described, noise=self.noise
        )
        if result.status is not LocateStatus.SUCCESS:
            context.tell("it is not where it was described; searching around")
            result = locate(views, context.body, plane=plane, rng=context.rng, region=region, noise=self.noise)
        if result.status in (LocateStatus.NOT_SEEN, LocateStatus.POOR_FIT):
            return Outcome(False, result.explain())
        context.pose = as_described(context.body, result.pose, described, result.covariance)
        context.covariance = result.covariance + np.diag(np.repeat(np.square(self.calibration), 3))
        truth = context.world.body_pose(context.name)
        off = float(np.linalg.norm((context.pose - truth) @ np.append(context.body.com, 1.0)))
        x, y, z = context.pose[:3, 3]
        return Outcome(
            True,
            f"{context.name} seen at ({x:.3f}, {y:.3f}, {z:.3f}) m, {off * 1e3:.1f} mm off the truth",
            inputs={"source": "two depth cameras", "pixels": result.pixels},
            outputs={"pose": context.pose, "residual": result.residual, "fitness": result.fitness},
            margins={"error": off, "turn": angle(truth[:3, :3].T @ context.pose[:3, :3])},
        )

    def _calibration_error(self, rng: np.random.Generator, centre: Array) -> Array:
        """A small random motion (4, 4) about *centre*."""
        out = np.eye(4)
        if any(self.calibration):
            shift, turn = rng.standard_normal((2, 3)) * np.array(self.calibration)[:, None]
            out[:3, :3] = Rotation.exp(turn).matrix
            out[:3, 3] = centre + shift - out[:3, :3] @ centre
        return out


def support(body: Body, pose: Array) -> Plane:
    """The horizontal plane under *body* at *pose* (T_world_body)."""
    return Plane(offset=float((body.vertices @ pose[2, :3] + pose[2, 3]).min()))


def as_described(body: Body, pose: Array, described: Array, covariance: Array) -> Array:
    """Of all poses that put the surface of *body* where *pose* does, one that is turned like *described*.

    A can looks the same however it is turned about its axis, so images leave that turn open; the task does not, for
    its goal is a pose. Tried are the described orientation itself, and the one that differs from it by the smallest
    rotation that agrees with *pose* on the axis about which *covariance* is largest.
    """
    surface = ModelSurface(body)
    free = np.linalg.eigh(covariance[3:, 3:])[1][:, -1]
    before = described[:3, :3] @ pose[:3, :3].T @ free
    turns = (described[:3, :3], Rotation.between(before, free).matrix @ described[:3, :3])
    centre = pose[:3, :3] @ body.com + pose[:3, 3]
    for turn in turns:
        other = np.eye(4)
        other[:3, :3], other[:3, 3] = turn, centre - turn @ body.com
        open_turn = angle(turn.T @ pose[:3, :3]) > LARGE
        if open_turn and surface_distance(surface, pose, other) < SAME:
            return other
    return pose


@dataclass(frozen=True)
class LocateByState:
    """Let the scene come to rest, and read the object's pose from the simulator: perfect perception."""

    name: str = "locate"
    title: str = "Locate the object"

    def run(self, context: Context) -> Outcome:
        """Settle, then read."""
        settled = settle(context)
        if not settled.success:
            return settled
        context.pose = context.world.body_pose(context.name)
        x, y, z = context.pose[:3, 3]
        return Outcome(
            True,
            f"{context.name} rests at ({x:.3f}, {y:.3f}, {z:.3f}) m",
            {"source": "simulator"},
            {"pose": context.pose},
        )


def settle(context: Context) -> Outcome:
    """Wait until the scene is at rest."""
    result = context.world.settle(context.arm, context.gripper)
    return Outcome(result.success, "" if result.success else f"the scene did not come to rest: {result.explain()}")


def viewpoints(context: Context, centre: Array) -> list[Array]:
    """Poses T_world_camera that look at *centre* from both sides, beyond it as seen from the robot."""
    out = centre[:2] - context.robot.base[:2, 3]
    heading = float(np.arctan2(out[1], out[0]))
    eyes = [
        centre + np.array([DISTANCE * np.cos(heading + a), DISTANCE * np.sin(heading + a), HEIGHT]) for a in AZIMUTHS
    ]
    return [look_at(eye, centre) for eye in eyes]
