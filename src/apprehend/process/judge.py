"""The verdict of the physics: where the object stands in the end, and how it got there."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..conventions import DEGREE
from .context import Context
from .episode import EpisodeStatus, Verdict

POSITION_TOLERANCE = 0.015
"""Largest distance in m of the object's centre of mass from its goal."""

ANGLE_TOLERANCE = 10.0 * DEGREE
"""Largest rotation of the object from its goal pose, in rad."""

SETTLE_TIME = 2.0


def judge(context: Context) -> Verdict:
    """Let the world come to rest, and compare the object's pose with its goal."""
    context.world.settle(context.arm, context.gripper, time_limit=SETTLE_TIME)
    pose = context.world.body_pose(context.name)
    position = float(np.linalg.norm(apply(pose, context.body.com) - apply(context.goal, context.body.com)))
    turn = angle(context.goal[:3, :3].T @ pose[:3, :3])
    tilt = float(np.arccos(np.clip(pose[2, :3] @ context.goal[2, :3], -1.0, 1.0)))
    errors = f"{position * 1e3:.1f} mm and {turn / DEGREE:.1f}° from its goal"
    if context.dropped:
        status, reason = EpisodeStatus.DROPPED, f"{context.name} left the hand on the way; it lies {errors}."
    elif position > POSITION_TOLERANCE or turn > ANGLE_TOLERANCE:
        toppled = context.scene.upright and tilt > ANGLE_TOLERANCE
        status = EpisodeStatus.TOPPLED if toppled else EpisodeStatus.MISPLACED
        allowed = f"{POSITION_TOLERANCE * 1e3:.0f} mm and {ANGLE_TOLERANCE / DEGREE:.0f}°"
        reason = f"{context.name} {'toppled' if toppled else 'stands'} {errors}; allowed are {allowed}."
    else:
        status, reason = (
            EpisodeStatus.SUCCESS,
            f"{context.name} stands {errors}, and slipped {context.slip * 1e3:.2f} mm in the hand.",
        )
    return Verdict(status, reason, position, turn, tilt, context.slip)


def apply(T: Array, point: Array) -> Array:
    """``T`` (4, 4) applied to a point (3,)."""
    return np.asarray(T[:3, :3] @ point + T[:3, 3])


def angle(R: Array) -> float:
    """Rotation angle of *R* in rad, accurate at 0 and at π."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return float(np.arctan2(np.linalg.norm(axis), np.trace(R) - 1.0))
