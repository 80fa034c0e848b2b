"""Homogeneous transforms and twists: exp, log, adjoints (G 1.1, 1.3, 1.6). Twists are ``(v, ω)``, linear part first.

Arrays in, arrays out; leading dimensions are batches. `Pose`, `Twist` and `Wrench` wrap these functions as values.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_pose, as_shaped
from ..kernels import se3 as kernels
from ._batch import apply
from .so3 import as_rotation, hat


def exp(twist: ArrayLike) -> Array:
    """``e^ξ̂ (..., 4, 4)`` of *twist* ``(..., 6)`` (G eq. 1.5)."""
    return apply(kernels.exp_many, as_shaped(twist, "twist", 6), (6,), (4, 4))


def log(pose: ArrayLike) -> Array:
    """Twist ``(..., 6)`` with rotation part of length ≤ π and ``exp(log(T)) = T`` (G Satz 1.10)."""
    return apply(kernels.log_many, as_pose(pose, "pose"), (4, 4), (6,))


def transform(rotation: ArrayLike | None = None, translation: ArrayLike | None = None) -> Array:
    """Homogeneous transform ``(..., 4, 4)`` from its parts; an absent part is the identity."""
    R = np.eye(3) if rotation is None else as_rotation(rotation, "rotation")
    p = np.zeros(3) if translation is None else as_shaped(translation, "translation", 3)
    shape = np.broadcast_shapes(R.shape[:-2], p.shape[:-1])
    T = np.zeros((*shape, 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = p
    T[..., 3, 3] = 1.0
    return T


def inverse(pose: ArrayLike) -> Array:
    """``T⁻¹ = (Rᵀ, −Rᵀ p)``."""
    T = as_pose(pose, "pose")
    out = T.copy()
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, :3] = Rt
    out[..., :3, 3] = -(Rt @ T[..., :3, 3:])[..., 0]
    return out


def points(pose: ArrayLike, coordinates: ArrayLike) -> Array:
    """``R q + p``: coordinates ``(..., 3)`` of points, in the frame that T_ab leads to (G eq. 1.1)."""
    T, q = as_pose(pose, "pose"), as_shaped(coordinates, "coordinates", 3)
    return np.asarray(np.einsum("...ij,...j->...i", T[..., :3, :3], q) + T[..., :3, 3])


def directions(pose: ArrayLike, coordinates: ArrayLike) -> Array:
    """``R d``: directions ``(..., 3)`` are turned, not moved."""
    T, d = as_pose(pose, "pose"), as_shaped(coordinates, "coordinates", 3)
    return np.asarray(np.einsum("...ij,...j->...i", T[..., :3, :3], d))


def adjoint(pose: ArrayLike) -> Array:
    """``Ad_T = [[R, p̂ R], [0, R]] (..., 6, 6)``: twists from b to a for T_ab (G Def. 1.17)."""
    T = as_pose(pose, "pose")
    R = T[..., :3, :3]
    out = np.zeros((*T.shape[:-2], 6, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = R
    out[..., :3, 3:] = hat(T[..., :3, 3]) @ R
    return out


def coadjoint(pose: ArrayLike) -> Array:
    """``Ad_{T⁻¹}ᵀ = [[R, 0], [p̂ R, R]] (..., 6, 6)``: wrenches from b to a for T_ab.

    G eq. 1.24 writes Ad_Tᵀ for it; the matrix written out there is this one.
    """
    T = as_pose(pose, "pose")
    R = T[..., :3, :3]
    out = np.zeros((*T.shape[:-2], 6, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = R
    out[..., 3:, :3] = hat(T[..., :3, 3]) @ R
    return out


def bracket(twist: ArrayLike) -> Array:
    """``ad_ξ = [[ω̂, v̂], [0, ω̂]] (..., 6, 6)``: the Lie bracket ξ × of twists."""
    xi = as_shaped(twist, "twist", 6)
    out = np.zeros((*xi.shape[:-1], 6, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = hat(xi[..., 3:])
    out[..., :3, 3:] = hat(xi[..., :3])
    return out


def hat_matrix(twist: ArrayLike) -> Array:
    """``ξ̂ = [[ω̂, v], [0, 0]] (..., 4, 4)`` (G Def. 1.8)."""
    xi = as_shaped(twist, "twist", 6)
    out = np.zeros((*xi.shape[:-1], 4, 4))
    out[..., :3, :3] = hat(xi[..., 3:])
    out[..., :3, 3] = xi[..., :3]
    return out


def left_jacobian(twist: ArrayLike) -> Array:
    """``J (..., 6, 6)`` with ``(d exp(ξ) exp(ξ)⁻¹)^∨ = J dξ``, i.e. Σ ad_ξᵏ / (k + 1)!."""
    return apply(kernels.left_jacobians, as_shaped(twist, "twist", 6), (6,), (6, 6))


def interpolate(first: ArrayLike, second: ArrayLike, t: ArrayLike) -> Array:
    """``T1 exp(t log(T1⁻¹ T2))``: one screw motion from *first* (t = 0) to *second* (t = 1)."""
    A, B = as_pose(first, "first"), as_pose(second, "second")
    step = log(inverse(A) @ B)
    from ..arrays import as_array

    return np.asarray(A @ exp(as_array(t, "t")[..., None] * step))
