"""Step *refine*: fine positioning by the camera on the hand, from the standoff right before the object (G 4)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .. import planning
from ..arrays import Array
from ..perception import Camera, LocateResult, LocateStatus, Noise, locate
from ..sim import hand_camera, look
from ..spatial import Rotation
from .choose import Models, feasible
from .context import Context
from .judge import angle
from .locate import SEARCH, support
from .motion import CAREFUL, along_path, execute
from .posture import tcp
from .step import Outcome

WORTH = 3e-4
"""Correction of the object's place in m (and, times its radius, of its turn) below which the hand stays as it is."""

TRUST = 2.0
"""Standard deviations of one image are taken this many times as large: its errors are not independent."""

OPEN = 0.02
"""Standard deviation in rad from which on an image leaves a turn open, as that of a can about its axis."""

PLAUSIBLE = 25.0
"""Largest squared Mahalanobis distance of the closer look from the first one; beyond 99.97 % of χ² of 6 freedoms."""


@dataclass(frozen=True)
class Refine:
    """Look at the object with the camera on the hand, combine that with what the fixed cameras saw, and correct.

    Both looks are Gaussian about their poses: with deviations δ of the closer look from the first one (translation of
    the centre of mass, rotation vector; world axes) and covariances C₀ and C₁, the best estimate lies at
    (C₀⁻¹ + C₁⁻¹)⁻¹ C₁⁻¹ δ. What one image leaves open, such as the turn of a can, thus stays as it was.
    """

    name: str = "refine"
    title: str = "Look with the hand camera"
    camera: Camera = field(default_factory=lambda: Camera.from_fov(320, 240))
    noise: Noise = field(default_factory=Noise)

    def run(self, context: Context) -> Outcome:
        """Set ``context.pose``; where that moves the grasp, find its paths anew and move the hand to the standoff."""
        assert context.pose is not None
        if context.covariance is None:
            return Outcome(True, "the object's pose is known exactly", skipped=True)
        result = self._look(context, context.pose)
        if result.status in (LocateStatus.NOT_SEEN, LocateStatus.POOR_FIT):
            return Outcome(True, "the hand camera does not see enough of the object", skipped=True)
        pose, covariance, distance = fused(
            context.body.com, context.pose, context.covariance, result.pose, uncertainty(result.covariance)
        )
        if distance > PLAUSIBLE:
            return Outcome(True, "the closer look contradicts the first one and is left out", skipped=True)
        moved = float(np.linalg.norm((pose - context.pose) @ np.append(context.body.com, 1.0)))
        turned = angle(context.pose[:3, :3].T @ pose[:3, :3])
        truth = context.world.body_pose(context.name)
        off = [float(np.linalg.norm((T - truth) @ np.append(context.body.com, 1.0))) for T in (context.pose, pose)]
        if moved + turned * context.body.radius > WORTH and not self._correct(context, pose):
            return Outcome(True, "the corrected grasp has no free way; the first estimate is kept", skipped=True)
        context.pose, context.covariance = pose, covariance
        return Outcome(
            True,
            f"corrected by {moved * 1e3:.1f} mm and {np.degrees(turned):.1f}°, {off[1] * 1e3:.1f} mm off the truth",
            inputs={"source": "hand camera", "pixels": result.pixels},
            outputs={"pose": pose, "residual": result.residual, "fitness": result.fitness},
            margins={"error_before": off[0], "error": off[1]},
        )

    def _look(self, context: Context, guess: Array) -> LocateResult:
        mount = hand_camera(context.world, context.hand.root, tcp(context, context.chosen.candidate))
        image = look(context.world, self.camera, mount, link=context.hand.root, noise=self.noise).image
        centre = guess[:3, :3] @ context.body.com + guess[:3, 3]
        region = np.array([centre - SEARCH, centre + SEARCH])
        plane = support(context.body, context.scene.bodies[context.name].pose)
        return locate(image, context.body, plane=plane, rng=context.rng, region=region, guess=guess, noise=self.noise)

    def _correct(self, context: Context, pose: Array) -> bool:
        """Move to the standoff of the chosen grasp for the object at *pose*; false where there is no free way."""
        assert context.pose is not None
        models, robot, root, planned = Models(context, pose), context.robot, context.hand.root, context.chosen
        shifted = pose @ np.linalg.inv(context.pose) @ robot.fk(planned.approach[-1], root)
        grasp = planning.straight(robot, None, planned.approach[-1], root, shifted)
        choice = feasible(context, models, planned.index, grasp.path[-1:]) if grasp.success else ""
        if isinstance(choice, str):
            return False
        path = np.array([context.q, choice.approach[0]])
        if not models.free.edges_free(path[:1], path[1:]).all():
            return False
        context.choice = choice
        execute(context, along_path(context, path, models.free, CAREFUL))
        return True


def uncertainty(covariance: Array) -> Array:
    """What an image's *covariance* (6, 6) is taken for: `TRUST`² times it, and boundless about axes it leaves open."""
    out = TRUST**2 * covariance
    variance, axes = np.linalg.eigh(out[3:, 3:])
    for axis in axes.T[variance > OPEN**2]:
        out[3:, 3:] += np.pi**2 * np.outer(axis, axis)
    return np.asarray(out)


def fused(com: Array, pose: Array, covariance: Array, other: Array, doubt: Array) -> tuple[Array, Array, float]:
    """The best estimate of a body's pose from two independent ones, its covariance, and how well they agree.

    Poses are T_world_body, covariances (6, 6) those of the translation of the centre of mass *com* and of the rotation
    vector, in world axes. The last value is the squared Mahalanobis distance δᵀ(C₀ + C₁)⁻¹δ of the two.
    """
    before, after = pose[:3, :3] @ com + pose[:3, 3], other[:3, :3] @ com + other[:3, 3]
    turn = Rotation(other[:3, :3] @ pose[:3, :3].T).log()
    delta = np.concatenate([after - before, turn])
    gain = np.linalg.solve((covariance + doubt).T, covariance.T).T
    step = gain @ delta
    out = np.eye(4)
    out[:3, :3] = Rotation.exp(step[3:]).matrix @ pose[:3, :3]
    out[:3, 3] = before + step[:3] - out[:3, :3] @ com
    return out, (np.eye(6) - gain) @ covariance, float(delta @ np.linalg.solve(covariance + doubt, delta))
