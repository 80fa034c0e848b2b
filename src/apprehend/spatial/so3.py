"""Rotation matrices and rotation vectors: exp, log, the hat operator, basic rotations (G 1.2).

Arrays in, arrays out; leading dimensions are batches. `Rotation` wraps these functions as a value.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_shaped, check_rotation
from ..kernels import so3 as kernels
from ._batch import apply, unit


def hat(vector: ArrayLike) -> Array:
    """The matrix ``v̂ (..., 3, 3)`` with ``v̂ b = v × b`` (G 1.2.5), of ``vector (..., 3)``."""
    v = as_shaped(vector, "vector", 3)
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def vee(matrix: ArrayLike) -> Array:
    """Inverse of `hat`: the vector ``(..., 3)`` of the antisymmetric part of ``matrix (..., 3, 3)``."""
    m = as_shaped(matrix, "matrix", 3, 3)
    return 0.5 * np.stack(
        [m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], axis=-1
    )


def exp(vector: ArrayLike) -> Array:
    """Rotation ``R = e^ŵ (..., 3, 3)`` about ``vector (..., 3)`` by its length in rad (Rodrigues, G 1.2.5)."""
    return apply(kernels.exp_many, as_shaped(vector, "vector", 3), (3,), (3, 3))


def log(matrix: ArrayLike) -> Array:
    """Rotation vector ``(..., 3)`` of length ≤ π with ``exp(log(R)) = R``, for ``matrix (..., 3, 3)``.

    Read through the quaternion's largest component, so the digits hold at 0, near π and at π, where the first
    component of the axis that is not zero is taken positive. (G 1.4 divides by sin θ, which fails there.)
    """
    return apply(kernels.log_many, as_rotation(matrix), (3, 3), (3,))


def as_rotation(matrix: ArrayLike, name: str = "matrix") -> Array:
    """*matrix* as ``(..., 3, 3)``, or `InputError` if it is no rotation."""
    R = as_shaped(matrix, name, 3, 3)
    check_rotation(R, name)
    return R


def basic(axis: str, angle: ArrayLike) -> Array:
    """Rotation by *angle* ``(...)`` about the coordinate axis ``"x"``, ``"y"`` or ``"z"`` (G 1.2.1)."""
    from ..arrays import choice

    k = "xyz".index(choice(axis, "axis", ("x", "y", "z")))
    theta = as_array(angle, "angle")
    i, j = (k + 1) % 3, (k + 2) % 3
    out = np.zeros((*theta.shape, 3, 3))
    out[..., k, k] = 1.0
    out[..., i, i] = out[..., j, j] = np.cos(theta)
    out[..., j, i] = np.sin(theta)
    out[..., i, j] = -out[..., j, i]
    return out


def axis_angle(axis: ArrayLike, angle: ArrayLike) -> Array:
    """Rotation ``(..., 3, 3)`` by *angle* about *axis* ``(..., 3)``, which need not be a unit vector but not zero."""
    theta = as_array(angle, "angle")
    direction = unit(as_shaped(axis, "axis", 3), "axis")
    shape = np.broadcast_shapes(direction.shape[:-1], theta.shape)
    theta = np.broadcast_to(theta, shape)
    w = np.broadcast_to(direction, (*shape, 3))
    # c 1 + s ŵ + (1 − c) w wᵀ, with 1 − c as 2 sin²(θ/2)
    eta = 2.0 * np.sin(0.5 * theta) ** 2
    s = np.sin(theta)
    R = eta[..., None, None] * w[..., :, None] * w[..., None, :] + s[..., None, None] * hat(w)
    R[..., range(3), range(3)] += np.cos(theta)[..., None]
    return R


def axis_of_angles(phi: ArrayLike, psi: ArrayLike) -> Array:
    """The unit vector ``(cos φ cos ψ, sin φ cos ψ, −sin ψ)`` of G eq. 1.2: ``R_z(φ) R_y(ψ)`` turns x into it."""
    f, p = np.broadcast_arrays(as_array(phi, "phi"), as_array(psi, "psi"))
    return np.stack([np.cos(f) * np.cos(p), np.sin(f) * np.cos(p), -np.sin(p)], axis=-1)


def angles_of_axis(axis: ArrayLike) -> tuple[Array, Array]:
    """φ and ψ in G eq. 1.2 for *axis* ``(..., 3)``; φ is 0 where the axis is ±z."""
    w = unit(as_shaped(axis, "axis", 3), "axis")
    flat = np.hypot(w[..., 0], w[..., 1])
    return np.where(flat == 0.0, 0.0, np.arctan2(w[..., 1], w[..., 0])), np.arctan2(-w[..., 2], flat)


def angle_between(first: ArrayLike, second: ArrayLike) -> Array:
    """Angle in [0, π] of the rotation from *first* to *second* ``(..., 3, 3)``, exact for small angles too."""
    A, B = as_rotation(first, "first"), as_rotation(second, "second")
    return np.asarray(np.linalg.norm(log(np.swapaxes(A, -1, -2) @ B), axis=-1))


def left_jacobian(vector: ArrayLike) -> Array:
    """``V(w) (..., 3, 3)`` with ``d exp(w) exp(w)⁻¹ = (V dw)^``; also the V of exp on SE(3)."""
    return apply(kernels.left_jacobians, as_shaped(vector, "vector", 3), (3,), (3, 3), False)


def inverse_left_jacobian(vector: ArrayLike) -> Array:
    """``V(w)⁻¹ (..., 3, 3)`` for rotation vectors shorter than 2 π."""
    w = as_shaped(vector, "vector", 3)
    longest = float(np.linalg.norm(w, axis=-1).max(initial=0.0))
    if longest >= 2.0 * np.pi:
        from ..errors import InputError

        raise InputError(f"vector has length {longest:.6g}; the left Jacobian is invertible below 2 π only")
    return apply(kernels.left_jacobians, w, (3,), (3, 3), True)


def mean(matrices: ArrayLike, weights: ArrayLike | None = None) -> Array:
    """The rotation ``(3, 3)`` nearest to *matrices* ``(N, 3, 3)``: least weighted sum of squared matrix differences."""
    from ..errors import InputError

    R = as_rotation(matrices, "matrices").reshape(-1, 3, 3)
    w = np.ones(len(R)) if weights is None else as_shaped(weights, "weights", len(R))
    if not len(R) or (w < 0.0).any() or not w.sum() > 0.0:
        raise InputError(f"the mean of {len(R)} rotations needs weights that are not negative and not all zero")
    return nearest(np.einsum("n,nij->ij", w / w.sum(), R))


def nearest(matrix: ArrayLike) -> Array:
    """The rotation nearest to *matrix* ``(..., 3, 3)`` in the sense of least squares (by its singular vectors)."""
    from ..errors import InputError

    M = as_shaped(matrix, "matrix", 3, 3)
    U, s, Vt = np.linalg.svd(M)
    sign = np.sign(np.linalg.det(U @ Vt))
    gap = s[..., 1] + sign * s[..., 2]
    if (gap <= 1e-12 * s[..., 0]).any():
        raise InputError("matrix has no nearest rotation: several are equally near")
    U[..., :, 2] *= sign[..., None]
    return np.asarray(U @ Vt)
