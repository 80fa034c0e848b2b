"""What the steps ask of any hand: its joints when open and when closed on a grasp, its tcp, and opening it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..grasp import Candidate, HandCandidate
from ..sim import Gripper

if TYPE_CHECKING:
    from .context import Context


def opened(context: Context, candidate: Candidate) -> Array:
    """Joints of the hand (n,) with which it approaches."""
    if isinstance(candidate, HandCandidate):
        return candidate.pregrasp
    return np.asarray(context.hand.jaw.q_at(candidate.opening))


def closed(context: Context, candidate: Candidate) -> Array:
    """Joints of the hand (n,) when it touches."""
    if isinstance(candidate, HandCandidate):
        return candidate.q
    return np.asarray(context.hand.jaw.q_at(candidate.width))


def tcp(context: Context, candidate: Candidate) -> Array:
    """T_hand_tcp (4, 4) of the open hand: between the pads, z along the approach."""
    if isinstance(candidate, HandCandidate):
        return np.asarray(np.linalg.inv(candidate.pose) @ candidate.tcp)
    return np.asarray(context.hand.jaw.tcp_at(candidate.opening))


def spread(context: Context, candidate: Candidate, time_limit: float) -> float:
    """Open the hand for *candidate*; what is left to go, in m between the pads or rad of the worst joint."""
    world, gripper = context.world, context.gripper
    if isinstance(gripper, Gripper):
        gripper.move(world, candidate.opening)
    else:
        gripper.move(world, opened(context, candidate))
    world.run(time_limit, context.arm, gripper, until=lambda _: gripper.state.name == "ARRIVED")
    if isinstance(gripper, Gripper):
        return abs(gripper.width(world) - candidate.opening)
    return float(np.abs(gripper.positions(world) - opened(context, candidate)).max())
