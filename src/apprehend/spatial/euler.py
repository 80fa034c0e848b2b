"""The 24 sets of Euler angles: 12 axis sequences × body-fixed or space-fixed (G 1.2.3).

The script counts 24 sets "since neighbours must differ"; sequences with different neighbours are 12, and each can be
read about the axes of the body (``"intrinsic"``) or of space (``"extrinsic"``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped, choice
from .so3 import as_rotation, basic

SEQUENCES = ("xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "xyx", "xzx", "yxy", "yzy", "zxz", "zyz")
"""The axis sequences: six with three different axes (Tait–Bryan), six that return to the first (proper Euler)."""

FRAMES = ("intrinsic", "extrinsic")

_LOCKED = 4e-16
"""Below this sine or cosine of the middle angle, the first angle is set to zero."""


def to_matrix(angles: ArrayLike, axes: str, frame: str) -> Array:
    """Rotation ``(..., 3, 3)`` of *angles* ``(..., 3)`` about *axes* (one of `SEQUENCES`).

    Intrinsic: ``R1(a1) R2(a2) R3(a3)``; extrinsic: ``R3(a3) R2(a2) R1(a1)``.
    """
    a = as_shaped(angles, "angles", 3)
    axes, frame = choice(axes, "axes", SEQUENCES), choice(frame, "frame", FRAMES)
    R = [basic(axis, a[..., i]) for i, axis in enumerate(axes)]
    return np.asarray(R[0] @ R[1] @ R[2] if frame == "intrinsic" else R[2] @ R[1] @ R[0])


def from_matrix(matrix: ArrayLike, axes: str, frame: str) -> Array:
    """Angles ``(..., 3)`` about *axes* of the rotation *matrix*; the product of their rotations gives it back.

    The middle angle lies in [−π/2, π/2] (three different axes) or [0, π] (first = third), the others in [−π, π].
    At gimbal lock only a sum or difference of the outer angles is determined: the first of the intrinsic order is
    then 0. Near it the outer angles are ill-determined, but never the product: the first angle is undone before the
    other two are read from what is left, so an error of the first is made good by the third.
    """
    R = as_rotation(matrix)
    axes, frame = choice(axes, "axes", SEQUENCES), choice(frame, "frame", FRAMES)
    if frame == "extrinsic":
        axes = axes[::-1]
    a, b, c = ("xyz".index(axis) for axis in axes)
    if a == c:
        d = 3 - a - b
        sign = _parity(a, b, d)
        y, x = R[..., b, a], -sign * R[..., d, a]
    else:
        y, x = -_parity(a, b, c) * R[..., b, c], R[..., c, c]
    first = np.where(np.hypot(x, y) < _LOCKED, 0.0, np.arctan2(y, x))
    M = basic(axes[0], -first) @ R
    k = 3 - b - c
    sign = _parity(b, c, k)
    second = np.arctan2(sign * M[..., k, c], M[..., c, c])
    third = np.arctan2(sign * M[..., b, k], M[..., b, b])
    # at its ends, rounding may put the middle angle one bit beyond
    second = np.abs(second) if a == c else np.clip(second, -np.pi / 2, np.pi / 2)
    ordered = (first, second, third) if frame == "intrinsic" else (third, second, first)
    return np.stack(ordered, axis=-1)


def _parity(i: int, j: int, k: int) -> int:
    """+1 for an even permutation of (0, 1, 2), −1 for an odd one."""
    return 1 if (j - i) % 3 == 1 and (k - j) % 3 == 1 else -1
