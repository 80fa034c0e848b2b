"""Where a singularity turns a branch into a continuum, the members of it that keep the joint limits."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, IntArray
from ..kinematics import Robot

FLAT = 1e-9
"""A Jacobian whose determinant is this share of the product of its columns' lengths, or less, counts as singular."""
GRID = np.linspace(-np.pi, np.pi, 1441)
"""Steps along a self-motion that are looked at, in rad of the joint that moves most."""


def self_motions(robot: Robot, frame: str, q: Array, joints: IntArray) -> tuple[IntArray, Array]:
    """Rows of ``q (B, n)`` at which six *joints* move without the frame, and these velocities ``(S, 6)``.

    A velocity's largest entry is ±1. Rows appear once for every direction.
    """
    J = robot.jacobian(q, frame)[..., joints]
    size = np.prod(np.linalg.norm(J, axis=-2), axis=-1)
    at = np.flatnonzero(np.abs(np.linalg.det(J)) <= FLAT * size)
    _, s, vh = np.linalg.svd(J[at])
    row, direction = np.nonzero(s <= 1e-7 * s[:, :1])
    still = vh[row, direction]
    return at[row], still / np.abs(still).max(axis=-1, keepdims=True)


def within_limits(q: Array, moves: Array, lower: Array, upper: Array) -> tuple[IntArray, Array]:
    """Which of the lines ``q (S, k) + t moves (S, k)`` come between the limits, and where they stay farthest inside.

    Angles count modulo whole turns.
    """
    turn = 2.0 * np.pi
    line = q[:, None] + GRID[:, None] * moves[:, None]  # (S, G, k)
    bounded = np.isfinite(lower) & np.isfinite(upper)
    low, high = np.where(bounded, lower, -np.pi), np.where(bounded, upper, np.pi)
    middle = 0.5 * (low + high)
    line -= turn * np.round((line - middle) / turn)
    inside = np.where(bounded, np.minimum(line - low, high - line), np.inf).min(axis=-1)
    best = inside.argmax(axis=1)
    good = np.flatnonzero(inside[np.arange(len(q)), best] > 0.0)
    return good, line[good, best[good]]
