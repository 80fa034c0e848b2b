"""Inverses of a Jacobian, as the script has them (G 1.8): by rank case, and by its treatment of singular values.

These are the textbook forms, batched, for study and for own controllers; `step` solves the same problems with strict
limits and priorities.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_shaped, choice
from ..errors import InputError

METHODS = ("rank", "damped", "clipped", "smooth")


def inverse_singular_values(sigma: ArrayLike, method: str = "rank", parameter: float = 0.1) -> Array:
    """What ``1/σ`` becomes for the singular values ``sigma (..., k)`` of one matrix each (G fig. 6, eq. 1.17, 1.18).

    - ``"rank"``: 1/σ, and 0 where σ ≤ 1e-12 σ_max: the pseudo-inverse;
    - ``"damped"``: σ/(σ² + λ²) with λ = *parameter*. The script writes JJᵗ + λ1 beside it: right is λ² on the
      diagonal;
    - ``"clipped"``: 1/σ, and 0 where σ < λ σ_max: it jumps there;
    - ``"smooth"``: 1/σ above s = λ σ_max, below it (σ/s²)(3 − 2σ/s), which meets it with the same slope and falls
      to 0 at σ = 0.
    """
    choice(method, "method", METHODS)
    s = as_array(sigma, "sigma")
    if (s < 0.0).any():
        raise InputError(f"sigma has the negative entry {s.min():.6g}; singular values are not negative")
    if method != "rank" and not parameter > 0.0:
        raise InputError(f"parameter is {parameter}; expected a positive number")
    largest = s.max(axis=-1, keepdims=True, initial=0.0)
    if method == "damped":
        damped: Array = s / (s * s + parameter * parameter)
        return damped
    edge = (1e-12 if method == "rank" else parameter) * largest
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=(s > edge) if method == "rank" else (s >= edge) & (s > 0.0))
    if method == "smooth":
        edge = np.broadcast_to(edge, s.shape)
        low = (s < edge) & (edge > 0.0)
        inverse[low] = s[low] / edge[low] ** 2 * (3.0 - 2.0 * s[low] / edge[low])
    return inverse


def inverse_jacobian(
    J: ArrayLike,
    method: str = "rank",
    parameter: float = 0.1,
    *,
    task_weight: ArrayLike | None = None,
    joint_weight: ArrayLike | None = None,
) -> Array:
    """J# ``(..., n, m)`` of ``J (..., m, n)`` by its singular value decomposition, V f(σ) Uᵀ (G eq. 1.12 – 1.18).

    *method* and *parameter*: see `inverse_singular_values`. With weights ``task_weight (m,)`` and
    ``joint_weight (n,)`` (the diagonals M_x and M_q of G 1.8.3): M_q (M_x J M_q)# M_x; a joint weight towards 0 holds
    that joint, a task weight of 0 gives up that row.
    """
    A = as_array(J, "J")
    if A.ndim < 2:
        raise InputError(f"J has shape {A.shape}; expected (..., m, n)")
    m, n = A.shape[-2:]
    x = np.ones(m) if task_weight is None else as_shaped(task_weight, "task_weight", m)
    w = np.ones(n) if joint_weight is None else as_shaped(joint_weight, "joint_weight", n)
    if (x < 0.0).any() or (w < 0.0).any():
        raise InputError("task_weight and joint_weight must not be negative")
    U, s, Vt = np.linalg.svd(x[:, None] * A * w, full_matrices=False)
    f = inverse_singular_values(s, method, parameter)
    core = np.swapaxes(Vt, -1, -2) * f[..., None, :] @ np.swapaxes(U, -1, -2)
    out: Array = w[:, None] * core * x
    return out


def null_space_projector(J: ArrayLike) -> Array:
    """N = 1 − J# J = V_N V_Nᵀ ``(..., n, n)`` of ``J (..., m, n)`` (G eq. 1.23)."""
    A = as_array(J, "J")
    out: Array = np.eye(A.shape[-1]) - inverse_jacobian(A) @ A
    return out


def transpose_step(J: ArrayLike, dx: ArrayLike) -> Array:
    """Δθ = α Jᵀ Δx ``(..., n)`` with the step that leaves the least error, α = ⟨JJᵀΔx, Δx⟩/‖JJᵀΔx‖² (G 1.8.4).

    Zero where Jᵀ Δx is zero: the error is then across everything the joints can do.
    """
    A = as_array(J, "J")
    e = as_shaped(dx, "dx", A.shape[-2])
    g = np.einsum("...mn,...m->...n", A, e)
    h = np.einsum("...mn,...n->...m", A, g)
    square = (h * h).sum(axis=-1)
    alpha = np.divide((h * e).sum(axis=-1), square, out=np.zeros_like(square), where=square > 1e-300)
    out: Array = alpha[..., None] * g
    return out
