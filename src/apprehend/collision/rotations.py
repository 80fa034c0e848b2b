"""Rotations as a scene file writes them: roll, pitch, yaw and unit quaternions."""

from __future__ import annotations

import numpy as np

from ..arrays import Array


def rpy_matrix(rpy: Array) -> Array:
    """Rotation Rz(yaw) Ry(pitch) Rx(roll): roll, pitch, yaw about fixed axes, as in URDF."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def quaternion_matrix(q: Array) -> Array:
    """Rotation matrix of the unit quaternion (w, x, y, z)."""
    w, v = q[0], q[1:]
    cross: Array = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    R: Array = np.eye(3) + 2.0 * (w * cross + cross @ cross)
    return R


def matrix_quaternion(R: Array) -> Array:
    """Unit quaternion (w, x, y, z) of a rotation matrix: the eigenvector of Bar-Itzhack's symmetric matrix."""
    K = np.array(
        [
            [np.trace(R), R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
            [0.0, R[0, 0] - R[1, 1] - R[2, 2], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
            [0.0, 0.0, R[1, 1] - R[0, 0] - R[2, 2], R[1, 2] + R[2, 1]],
            [0.0, 0.0, 0.0, R[2, 2] - R[0, 0] - R[1, 1]],
        ]
    )
    q: Array = np.linalg.eigh(K, UPLO="U")[1][:, -1]
    q = np.array(q if q[0] >= 0.0 else -q)
    return q
