"""The standard measures of grasps that need no wrench space (the review of Roa and Suárez 2015)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from ..kernels import hull
from .ball import largest

if TYPE_CHECKING:
    from .grasp import Grasp

Measured = tuple[float, Array]
"""The value, and the wrench direction that belongs to it (zero where that has no meaning)."""


def _singular(grasp: Grasp) -> tuple[Array, Array]:
    U, s, _ = np.linalg.svd(grasp.matrix * grasp.scale[:, None])
    full = np.zeros(grasp.wrench_size)
    full[: len(s)] = s[: grasp.wrench_size]
    return full, U[:, -1].copy()


def _min_singular_value(grasp: Grasp) -> Measured:
    s, weakest = _singular(grasp)
    return float(s[-1]), weakest


def _isotropy(grasp: Grasp) -> Measured:
    s, weakest = _singular(grasp)
    return (float(s[-1] / s[0]) if s[0] > 0.0 else 0.0), weakest


def _grasp_volume(grasp: Grasp) -> Measured:
    return float(np.prod(_singular(grasp)[0])), np.zeros(grasp.wrench_size)


def _points(grasp: Grasp) -> Array:
    return np.array([c.position for c in grasp.contacts])


def _centroid_distance(grasp: Grasp) -> Measured:
    return float(np.linalg.norm(_points(grasp).mean(axis=0) - grasp.reference)), np.zeros(grasp.wrench_size)


def _polygon(grasp: Grasp, kind: str) -> Array:
    """Corners ``(V, 2)`` of the hull of the contacts in their plane of best fit, in order; one line has two."""
    from scipy.spatial import ConvexHull, QhullError

    points = _points(grasp)
    if len(points) < 3:
        raise InputError(f"{kind} needs three contacts; this grasp has {len(points)}")
    centred = points - points.mean(axis=0)
    flat = centred @ np.linalg.svd(centred)[2][:2].T
    try:
        corners: Array = flat[ConvexHull(flat).vertices]
        return corners
    except QhullError:
        along = np.argsort(flat[:, 0])
        ends: Array = flat[along[[0, -1]]]
        return ends


def _polygon_area(grasp: Grasp) -> Measured:
    p = _polygon(grasp, "polygon_area")
    x, y = p.T
    area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    return area, np.zeros(grasp.wrench_size)


def _polygon_shape(grasp: Grasp) -> Measured:
    """``Σ |θ_i − θ̄| / θ_max`` over the inner angles, θ̄ = π (n − 2)/n those of a regular polygon."""
    p = _polygon(grasp, "polygon_shape")
    n = len(_points(grasp))
    mean = np.pi * (n - 2) / n
    angles = np.full(n, np.pi)  # contacts inside the hull, or on an edge, make no corner
    if len(p) > 2:
        before, after = np.roll(p, 1, axis=0) - p, np.roll(p, -1, axis=0) - p
        cosine = (before * after).sum(axis=1) / np.linalg.norm(before, axis=1) / np.linalg.norm(after, axis=1)
        angles[: len(p)] = np.arccos(np.clip(cosine, -1.0, 1.0))
    else:
        angles[:2] = 0.0
    worst = (n - 2) * (np.pi - mean) + 2.0 * mean
    return float(np.abs(angles - mean).sum() / worst), np.zeros(grasp.wrench_size)


def _normal_balance(grasp: Grasp) -> Measured:
    """``1 − ‖Σ n‖ / k``."""
    normals = np.array([c.normal for c in grasp.contacts])
    return 1.0 - float(np.linalg.norm(normals.sum(axis=0))) / len(normals), np.zeros(grasp.wrench_size)


def _position_margin(grasp: Grasp) -> Measured:
    """``ε_b · length / √(1 + µ²)``: moving a contact by δ moves the wrenches of its base by no more than
    ``‖δ‖ √(1 + µ²) / length``, and the origin stays inside while that is less than the ball ε_b of the bases."""
    ball = largest(hull.BASES, grasp.generators, tolerance=0.01)
    mu = max(c.friction if c.size > 1 else 0.0 for c in grasp.contacts)
    return max(ball.lower, 0.0) * grasp.length / float(np.sqrt(1.0 + mu * mu)), ball.worst


def min_weight(grasp: Grasp, m: int = 8) -> Measured:
    """The largest l for which the edges W of polyhedral cones balance with weights of at least l:
    ``max l`` over ``W a = 0, Σ a = 1, a ≥ l`` (Li et al. 2023); positive exactly for force closure of those cones."""
    from scipy.optimize import linprog

    W = grasp.edges(m).T
    n = W.shape[1]
    A = np.vstack([np.column_stack([W, W.sum(axis=1)]), np.append(np.ones(n), n)])  # a = l + rest, rest ≥ 0
    c = np.zeros(n + 1)
    c[-1] = -1.0
    found = linprog(
        c, A_eq=A, b_eq=np.append(np.zeros(len(W)), 1.0), bounds=[(0.0, None)] * n + [(None, None)], method="highs"
    )
    if found.status != 0:  # no weights at all balance, of whatever sign
        return -np.inf, np.zeros(grasp.wrench_size)
    return float(-found.fun), np.asarray(found.eqlin.marginals[:-1])


def orthogonality(grasp: Grasp, approach: ArrayLike) -> Measured:
    """The angle in rad, 0 … π/4, between the *approach* direction and the nearest of a principal axis of inertia of the
    body or the plane across it: 0 if the hand comes along or square to the body's axis of least inertia."""
    if grasp.body is None:
        raise InputError("orthogonality compares with the body's principal axes; give the grasp its body")
    a = as_array(approach, "approach")
    if a.shape != (3,) or not a.any():
        raise InputError(f"approach is {a.tolist()}; expected a direction (3,)")
    axis = np.linalg.eigh(grasp.body.inertia)[1][:, 0]
    angle = float(np.arccos(np.clip(abs(axis @ a) / np.linalg.norm(a), 0.0, 1.0)))
    return min(angle, 0.5 * np.pi - angle), np.zeros(grasp.wrench_size)


MORE: dict[str, Callable[..., Measured]] = {"min_weight": min_weight, "orthogonality": orthogonality}
"""Measures with options."""
PLAIN: dict[str, Callable[[Grasp], Measured]] = {
    "min_singular_value": _min_singular_value,
    "isotropy": _isotropy,
    "grasp_volume": _grasp_volume,
    "centroid_distance": _centroid_distance,
    "polygon_area": _polygon_area,
    "polygon_shape": _polygon_shape,
    "normal_balance": _normal_balance,
    "position_margin": _position_margin,
}
"""Measures without options."""
