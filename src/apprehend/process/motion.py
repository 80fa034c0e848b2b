"""Arm motions of the process: from a collision-free joint path to a timed motion, and its execution in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..collision import CollisionModel
from ..trajectory import Limits, Trajectory, follow, through_samples
from .context import Context

ROUNDING = 0.04
"""Largest deviation of a rounded corner from the planned polyline, in rad (Euclidean, joint space)."""

SETTLE = 0.15
"""Seconds of standing still after a motion, in which the controller takes out what error is left."""

DEFAULT_ACCELERATION = 2.5
"""rad/s² where a description gives no acceleration limit: the slowest of the arms whose limits are published."""

ACCELERATION = 2.0
"""Largest acceleration in m/s² of an object held by a jaw; grasps are planned to withstand it in every direction."""

GENTLE = 1.0
"""The same for fingers, whose joints are weak."""

SAMPLES = 400
"""Samples of a motion at which it is checked."""

FREE, CARRYING, CAREFUL = 0.8, 0.5, 0.25
"""Shares of the velocity limits: in free space, with an object in the hand, and next to an object."""


@dataclass(frozen=True)
class Done:
    """What the execution of a motion measured."""

    duration: float
    worst_error: float  # rad, largest deviation of a joint from the motion
    final_error: float
    peak_effort: float  # largest wanted torque over its limit


def limits(context: Context, share: float) -> Limits:
    """Velocity and acceleration limits of the arm's joints, at a *share* of the velocity limits."""
    joints = context.joints
    velocity = np.minimum(context.robot.limits.velocity[joints], np.pi) * share
    acceleration = context.robot.limits.acceleration[joints]
    acceleration = np.where(np.isfinite(acceleration), acceleration, DEFAULT_ACCELERATION)
    return Limits(velocity=velocity, acceleration=acceleration * min(1.0, 1.25 * share))


def acceleration_of(context: Context) -> float:
    """Largest acceleration in m/s² of an object in the hand of *context*."""
    return ACCELERATION if context.hand.is_jaw else GENTLE


def gentle(context: Context, motion: Trajectory) -> Trajectory:
    """*motion*, slowed down where it would accelerate the held object by more than the grasp was planned for."""
    if context.held is None:
        return motion
    t = np.linspace(0.0, motion.duration, SAMPLES)
    q = np.repeat(context.world.q[None], SAMPLES, axis=0)
    q[:, context.joints] = motion(t)
    com = context.held[:3, :3] @ context.body.com + context.held[:3, 3]
    path = context.robot.fk(q, context.hand.root) @ np.append(com, 1.0)
    acceleration = np.diff(path[:, :3], n=2, axis=0) / (t[1] - t[0]) ** 2
    peak = float(np.linalg.norm(acceleration, axis=1).max())
    allowed = acceleration_of(context)
    return motion.stretched(np.sqrt(peak / allowed)) if peak > allowed else motion


def along_path(context: Context, path: Array, model: CollisionModel, share: float) -> Trajectory:
    """A motion along a planned polyline ``(m, n)``: corners rounded as far as that stays free of collision."""
    points = path[:, context.joints]
    bounds = limits(context, share)
    if len(points) > 2:
        for deviation in (ROUNDING, ROUNDING / 4):
            motion = follow(points, bounds, deviation=deviation)
            samples = np.repeat(path[:1], SAMPLES, axis=0)
            samples[:, context.joints] = motion(np.linspace(0.0, motion.duration, SAMPLES))
            if model.edges_free(samples[:-1], samples[1:]).all():
                return gentle(context, motion)
    return gentle(context, follow(points, bounds))


def along_line(context: Context, samples: Array, share: float) -> Trajectory:
    """A motion along dense joint samples ``(m, n)`` of a straight line of the hand."""
    return gentle(context, through_samples(samples[:, context.joints], limits(context, share)))


def execute(context: Context, motion: Trajectory) -> Done:
    """Play *motion* in the world with the gripper doing what it does, then let the arm come to rest."""
    world, arm = context.world, context.arm
    arm.follow(world, motion)
    watch = Watch(context)
    world.run(motion.duration + SETTLE, arm, context.gripper, until=watch)
    return Done(
        motion.duration,
        float(arm.worst_error.max()),
        float(np.abs(arm.error(world)).max()),
        float(arm.saturation.worst.max(initial=0.0)),
    )


class Watch:
    """Looks after the held object during a motion: its slip in the hand, and whether it is still there."""

    LOST = 0.05
    """Displacement of the object in the hand, in m, at which it counts as lost."""

    PERIOD = 0.01
    """Seconds between two looks."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._next = context.world.time

    def __call__(self, world: object) -> bool:
        """Update the context's slip; true (stop) when the object is lost."""
        context = self._context
        if context.held is None or context.world.time < self._next:
            return False
        self._next = context.world.time + self.PERIOD
        drift = in_hand(context) @ np.append(context.body.com, 1.0) - context.held @ np.append(context.body.com, 1.0)
        context.slip = max(context.slip, float(np.linalg.norm(drift)))
        context.dropped = context.dropped or context.slip > self.LOST
        return context.dropped


def in_hand(context: Context) -> Array:
    """The present pose of the body in the hand, T_hand_body: the simulator's, in the place of an in-hand tracker."""
    return np.asarray(np.linalg.inv(context.world.frame(context.hand.root)) @ context.world.body_pose(context.name))
