"""Cone programs over contact forces, in batches."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from ..arrays import Array, IntArray
from ..kernels import cone
from ..parallel import over_ranges
from .contact import Contact, ContactModel

TOLERANCE = 1e-9
"""Relative residuals and duality gap at which a cone program counts as solved."""
ACCEPTABLE = 1e-7
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


def solve(A: Array, b: Array, c: Array, cones: tuple[int, ...], Q: Array | None = None) -> Solutions:
    """Minimise ``½ xᵀ diag(Q) x + cᵀ x`` over ``A x = b``, x in the product of *cones* (1: half-line, k: second order).

    ``A (N, rows, n)``, ``b (N, rows)``, ``c, Q (N, n)``; axes of length 1 broadcast over the N problems.
    """
    count = max(len(A), len(b), len(c))
    n, rows = A.shape[2], A.shape[1]
    sizes, starts, offsets = _layout(cones)
    Q = np.zeros((1, n)) if Q is None else Q
    x, y, z = np.empty((count, n)), np.empty((count, rows)), np.empty((count, n))
    status, m = np.empty(count, np.int64), np.empty((count, 5))

    def work(i: int, j: int) -> None:
        each = [v if len(v) == 1 else v[i:j] for v in (A, b, c, Q)]
        cone.solve(*each, sizes, starts, offsets, TOLERANCE, MOST_STEPS, x[i:j], y[i:j], z[i:j], status[i:j], m[i:j])

    over_ranges(work, count, 8)
    if (status == cone.INACCURATE).any():
        gap = np.abs(m[:, 0] - m[:, 1]) / np.maximum(1.0, np.abs(m[:, 0]))
        fine = np.maximum(np.maximum(m[:, 2], m[:, 3]), gap) <= ACCEPTABLE
        status = np.where((status == cone.INACCURATE) & fine, cone.OPTIMAL, status)
    return Solutions(x, y, z, status, m[:, 0], m[:, 1], np.maximum(m[:, 2], m[:, 3]), m[:, 4])


@cache
def _layout(cones: tuple[int, ...]) -> tuple[IntArray, IntArray, IntArray]:
    """Sizes of the cones, where each starts in x, and where its block starts among the blocks."""
    sizes = np.array(cones, np.int64)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
    return sizes, starts, np.concatenate([[0], np.cumsum(sizes**2)]).astype(np.int64)


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
