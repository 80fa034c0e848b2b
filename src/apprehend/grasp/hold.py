"""The normal force with which two soft fingers must press to hold a body against a family of wrenches."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..kernels import cone
from .program import solve


def pressing_force(directions: Array, frictions: Array, torsions: Array, wrenches: Array, length: float) -> Array:
    """The least bound t on both normal forces that balances every wrench: ``(N, K)``, inf where nothing does.

    ``directions (N, 2, 6, 4)``: wrench columns (about the centre of mass) of each contact's f₁, f₂, f₃, τ;
    ``frictions, torsions (N, 2)``; ``wrenches (K, 6)`` that act on the body from outside; *length* scales torques.
    Solves ``min t`` over ``G f = −w``, ``f_i`` in the elliptic cone, ``f₃ ≤ t``.
    """
    n, k = len(directions), len(wrenches)
    scale = np.array([1.0, 1.0, 1.0, 1.0 / length, 1.0 / length, 1.0 / length])
    A = np.zeros((n, 8, 11))
    for i in range(2):
        G = directions[:, i] * scale[:, None]
        mu, gamma = frictions[:, i, None], torsions[:, i, None]
        A[:, :6, 4 * i] = G[:, :, 2]
        A[:, :6, 4 * i + 1] = G[:, :, 0] * mu
        A[:, :6, 4 * i + 2] = G[:, :, 1] * mu
        A[:, :6, 4 * i + 3] = G[:, :, 3] * gamma
        A[:, 6 + i, 4 * i], A[:, 6 + i, 8 + i], A[:, 6 + i, 10] = 1.0, 1.0, -1.0
    size = float(np.linalg.norm(wrenches * scale, axis=1).max())
    b = np.zeros((k, 8))
    b[:, :6] = -wrenches * scale / size
    c = np.zeros((1, 11))
    c[0, 10] = 1.0
    answer = solve(np.repeat(A, k, axis=0), np.tile(b, (n, 1)), c, (4, 4, 1, 1, 1))
    value = np.where(answer.status == cone.OPTIMAL, answer.primal * size, np.inf)
    return value.reshape(n, k)
