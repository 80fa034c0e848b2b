"""Cone programs over contact forces: from arrays of problems to lanes and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, IntArray
from ..kernels import cone
from ..parallel import over_ranges
from .contact import Contact, ContactModel

TOLERANCE = 1e-8
"""Relative residuals and duality gap at which a cone program counts as solved."""
ACCEPTABLE = 1e-6
"""What still counts as solved where rounding stops the method earlier."""
MOST_STEPS = 50


@dataclass(frozen=True, eq=False)
class Solutions:
    """Answers of N problems: ``x (N, n)``, ``y (N, rows)``, ``z (N, n)``, ``status (N,)`` (codes of `kernels.cone`),
    ``primal, dual (N,)`` values, ``residual (N,)``, ``steps (N,)``."""

    x: Array
    y: Array
    z: Array
    status: IntArray
    primal: Array
    dual: Array
    residual: Array
    steps: Array


def _lanes(problems: Array, blocks: int) -> Array:
    """``(N, …)`` to ``(blocks, …, LANES)``; padding repeats problem 0."""
    missing = blocks * cone.LANES - len(problems)
    if missing:
        problems = np.concatenate([problems, np.broadcast_to(problems[:1], (missing, *problems.shape[1:]))])
    shaped = problems.reshape(blocks, cone.LANES, *problems.shape[1:])
    return np.ascontiguousarray(np.moveaxis(shaped, 1, -1))


def _problems(lanes: Array, count: int) -> Array:
    back = np.moveaxis(lanes, -1, 1)
    return np.ascontiguousarray(back.reshape(-1, *back.shape[2:])[:count])


def solve(A: Array, b: Array, c: Array, cones: tuple[int, ...], Q: Array | None = None) -> Solutions:
    """Minimise ``½ xᵀ diag(Q) x + cᵀ x`` over ``A x = b``, x in the product of *cones* (1: half-line, k: second order).

    ``A (N, rows, n)``, ``b (N, rows)``, ``c, Q (N, n)``; axes of length 1 broadcast over the N problems.
    """
    count = max(len(A), len(b), len(c))
    rows, n = A.shape[1:]
    A = np.broadcast_to(A, (count, rows, n))
    b, c = np.broadcast_to(b, (count, rows)), np.broadcast_to(c, (count, n))
    quadratic = np.zeros(len(cones), np.bool_)
    if Q is None:
        Q = np.zeros((1, n))
    sizes = np.array(cones, np.int64)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
    offsets = np.concatenate([[0], np.cumsum(sizes**2)]).astype(np.int64)
    blocks = -(-count // cone.LANES)
    A_l, b_l, c_l = _lanes(A, blocks), _lanes(b, blocks), _lanes(c, blocks)
    Q_l = _lanes(np.broadcast_to(Q, (count, n)), blocks)
    x, y, z = np.empty_like(c_l), np.empty_like(b_l), np.empty_like(c_l)
    status, measures = np.empty((blocks, cone.LANES), np.int64), np.zeros((blocks, 5, cone.LANES))

    def work(i: int, j: int) -> None:
        cone.solve(
            A_l[i:j], b_l[i:j], c_l[i:j], Q_l[i:j], sizes, starts, offsets, quadratic, TOLERANCE, MOST_STEPS,
            x[i:j], y[i:j], z[i:j], status[i:j], measures[i:j],
        )  # fmt: skip

    over_ranges(work, blocks, 4)
    m = _problems(measures, count)
    code = status.reshape(-1)[:count]
    gap = np.abs(m[:, 0] - m[:, 1]) / np.maximum(1.0, np.abs(m[:, 0]))
    residual = np.maximum(np.maximum(m[:, 2], m[:, 3]), np.where(np.isfinite(gap), gap, 0.0))
    code = np.where((code == cone.INACCURATE) & (residual <= ACCEPTABLE), cone.OPTIMAL, code)
    return Solutions(
        _problems(x, count), _problems(y, count), _problems(z, count), code, m[:, 0], m[:, 1], residual, m[:, 4]
    )


@dataclass(frozen=True, eq=False)
class ContactCone:
    """A contact's friction cone as a product of standard cones: ``f = map @ x``, x in *cones*, ``link @ x = 0``."""

    cones: tuple[int, ...]
    map: Array  # (m_i, k)
    link: Array  # (rows, k)


def contact_cone(contact: Contact) -> ContactCone:
    """The standard form of a contact: coordinates in which its cone is a half-line, a second-order cone, or both."""
    mu, gamma = contact.friction, contact.torsion
    none = np.empty((0, 0))
    if contact.size == 1:
        return ContactCone((1,), np.eye(1), none.reshape(0, 1))
    if contact.dimension == 2:  # |f_t| ≤ µ f_n
        return ContactCone((2,), np.array([[0.0, mu], [1.0, 0.0]]), none.reshape(0, 2))
    if contact.size == 3 or gamma == 0.0 or contact.model is ContactModel.SOFT:
        k = 4 if contact.size == 4 and gamma > 0.0 else 3
        D = np.zeros((contact.size, k))
        D[2, 0], D[0, 1], D[1, 2] = 1.0, mu, mu
        if k == 4:
            D[3, 3] = gamma
        return ContactCone((k,), D, none.reshape(0, k))
    D = np.zeros((4, 5))  # x = (f₃, f₁/µ, f₂/µ) and (γ f₃ + τ)/γ, (γ f₃ − τ)/γ
    D[2, 0], D[0, 1], D[1, 2] = 1.0, mu, mu
    D[3, 3], D[3, 4] = 0.5 * gamma, -0.5 * gamma
    return ContactCone((3, 1, 1), D, np.array([[2.0, 0.0, 0.0, -1.0, -1.0]]))
