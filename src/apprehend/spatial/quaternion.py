"""Quaternions ``(w, x, y, z)``: product, conjugate, power, conversion, slerp (G 1.2.4).

Arrays in, arrays out; leading dimensions broadcast. ``q`` and ``−q`` are the same rotation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_shaped, choice
from ..errors import InputError
from ..kernels import so3 as kernels
from ._batch import apply, unit
from .so3 import as_rotation

SLERP_FORMS = ("first", "second", "left second", "left first")
"""The four forms of G 1.2.4: Q1 (Q1⁻¹ Q2)ᵗ, Q2 (Q2⁻¹ Q1)¹⁻ᵗ, (Q1 Q2⁻¹)¹⁻ᵗ Q2, (Q2 Q1⁻¹)ᵗ Q1."""


def from_matrix(matrix: ArrayLike) -> Array:
    """Unit quaternion ``(..., 4)`` with w ≥ 0 of the rotation *matrix* ``(..., 3, 3)``."""
    return apply(kernels.quaternions, as_rotation(matrix), (3, 3), (4,))


def to_matrix(quaternion: ArrayLike) -> Array:
    """Rotation ``(..., 3, 3)`` of *quaternion* ``(..., 4)``, which is normalised; zero is refused."""
    return apply(kernels.matrices, unit(as_shaped(quaternion, "quaternion", 4), "quaternion"), (4,), (3, 3))


def multiply(first: ArrayLike, second: ArrayLike) -> Array:
    """Product ``Q P = (q0 p0 − q·p, q0 p + p0 q + q × p)``: the rotation P, then Q."""
    q, p = np.broadcast_arrays(as_shaped(first, "first", 4), as_shaped(second, "second", 4))
    a, b, c, d = (q[..., i] for i in range(4))
    w, x, y, z = (p[..., i] for i in range(4))
    return np.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        axis=-1,
    )


def conjugate(quaternion: ArrayLike) -> Array:
    """``Q* = (q0, −q)``."""
    return np.asarray(as_shaped(quaternion, "quaternion", 4) * np.array([1.0, -1.0, -1.0, -1.0]))


def inverse(quaternion: ArrayLike) -> Array:
    """``Q⁻¹ = Q* / |Q|²``; zero is refused."""
    q = as_shaped(quaternion, "quaternion", 4)
    size = np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(conjugate(unit(q, "quaternion")) / size)


def rotate(quaternion: ArrayLike, vector: ArrayLike) -> Array:
    """The vector part of ``Q (0, p) Q*`` for a unit quaternion: *vector* ``(..., 3)`` rotated."""
    q = unit(as_shaped(quaternion, "quaternion", 4), "quaternion")
    p = as_shaped(vector, "vector", 3)
    u = q[..., 1:]
    t = 2.0 * np.cross(u, p)
    return np.asarray(p + q[..., :1] * t + np.cross(u, t))


def power(quaternion: ArrayLike, exponent: ArrayLike) -> Array:
    """``Qᵗ = (cos(t θ/2), ω sin(t θ/2))`` of a unit quaternion, with θ/2 in [0, π]: the sign of Q matters.

    Q = −1 has no axis of its own; x is taken.
    """
    q = unit(as_shaped(quaternion, "quaternion", 4), "quaternion")
    t = as_array(exponent, "exponent")
    s = np.linalg.norm(q[..., 1:], axis=-1)
    half = np.arctan2(s, q[..., 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        axis = np.where(s[..., None] > 0.0, q[..., 1:] / s[..., None], [1.0, 0.0, 0.0])
    angle = t * half
    return np.concatenate([np.cos(angle)[..., None], np.sin(angle)[..., None] * axis], axis=-1)


def slerp(first: ArrayLike, second: ArrayLike, t: ArrayLike, form: str = "first") -> Array:
    """Interpolation on the short way from *first* (t = 0) to *second* (t = 1), ``(..., 4)``.

    *form* names one of the four equal formulas of G 1.2.4 (see `SLERP_FORMS`). *second* is negated where the two lie
    on opposite hemispheres; at exactly half a turn apart both ways are equally short and *second* is taken as it is.
    """
    choice(form, "form", SLERP_FORMS)
    a, b = np.broadcast_arrays(
        unit(as_shaped(first, "first", 4), "first"), unit(as_shaped(second, "second", 4), "second")
    )
    b = np.where((a * b).sum(axis=-1, keepdims=True) < 0.0, -b, b)
    t = as_array(t, "t")
    if form == "first":
        return multiply(a, power(multiply(conjugate(a), b), t))
    if form == "second":
        return multiply(b, power(multiply(conjugate(b), a), 1.0 - t))
    if form == "left second":
        return multiply(power(multiply(a, conjugate(b)), 1.0 - t), b)
    return multiply(power(multiply(b, conjugate(a)), t), a)


def slerp_vectors(first: ArrayLike, second: ArrayLike, t: ArrayLike) -> Array:
    """Great-circle interpolation of unit vectors ``(..., n)`` (G 1.2.4, last formula).

    ``(sin((1 − t) Ω) p0 + sin(t Ω) p1) / sin Ω`` with Ω between p0 and p1, taken from the half angle so that close
    vectors keep their digits. Opposite vectors have no single great circle and are refused.
    """
    a, b = np.broadcast_arrays(unit(first, "first"), unit(second, "second"))
    t = as_array(t, "t")[..., None]
    angle = 2.0 * np.arctan2(np.linalg.norm(b - a, axis=-1), np.linalg.norm(b + a, axis=-1))[..., None]
    if (np.pi - angle < 1e-9).any():
        raise InputError("first and second are opposite vectors: every great circle through them is as short")
    small = angle < 1e-8
    safe = np.where(small, 1.0, angle)
    mixed = (np.sin((1.0 - t) * safe) * a + np.sin(t * safe) * b) / np.sin(safe)
    straight = (1.0 - t) * a + t * b
    return np.asarray(np.where(small, straight, mixed))
