"""The few poses that readers need, as plain matrices: what files write as angles, quaternions and axes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..arrays import Array
from .description import Joint, JointType


def shift(position: Sequence[float] | Array) -> Array:
    """Pose ``(4, 4)`` of a displacement."""
    T = np.eye(4)
    T[:3, 3] = position
    return T


def from_rpy(xyz: Sequence[float] | Array, rpy: Sequence[float] | Array) -> Array:
    """Pose ``(4, 4)`` from a position and extrinsic xyz angles: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = [math.cos(a) for a in rpy], [math.sin(a) for a in rpy]
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
            [-sp, cp * sr, cp * cr, xyz[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def to_rpy(R: Array) -> tuple[float, float, float]:
    """Extrinsic xyz angles of a rotation ``(3, 3)``: the inverse of `from_rpy`; roll is 0 where pitch is ±π/2."""
    horizontal = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], horizontal)
    if horizontal > 1e-12:
        return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])
    return 0.0, pitch, math.atan2(-R[0, 1], R[1, 1])


def from_quaternion(position: Sequence[float] | Array, quaternion: Sequence[float] | Array) -> Array:
    """Pose ``(4, 4)`` from a position and a quaternion (w, x, y, z) of any length but zero."""
    w, x, y, z = np.asarray(quaternion) / np.linalg.norm(quaternion)
    T = shift(position)
    T[:3, :3] = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return T


def turn(axis: Array, angle: float) -> Array:
    """Pose ``(4, 4)`` of a rotation about the unit *axis* through the origin (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    T = np.eye(4)
    T[:3, :3] += math.sin(angle) * K + (2.0 * math.sin(0.5 * angle) ** 2) * (K @ K)
    return T


def motion(joint: Joint, q: float) -> Array:
    """Pose ``(4, 4)`` of what *joint* carries, in its joint frame, at coordinate *q*."""
    if joint.type is JointType.FIXED:
        return np.eye(4)
    if joint.type is JointType.PRISMATIC:
        return shift(q * joint.axis)
    return turn(joint.axis, q)
