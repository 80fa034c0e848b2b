"""Cone programs over contact forces, in batches."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from ..arrays import Array, IntArray
from ..kernels import cone, cone_rows
from ..parallel import over_ranges
from .contact import Contact, ContactModel

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
    rows = A.shape[1]
    places, padded = layout(cones)
    each = max(len(A), len(c))
    columns = np.zeros((each, sum(padded), in_threes(rows) + 2))
    columns[:, places, :rows] = A.transpose(0, 2, 1)
    columns[:, places, -2] = c
    if Q is not None:
        columns[:, places, -1] = Q
    kinds = np.full(in_threes(rows), cone.COUPLING)
    right = np.zeros((1, len(kinds), 1 + rows))
    right[0, :rows, 1:] = np.eye(rows)
    out = run(columns, right, np.ascontiguousarray(b), np.array(padded), kinds, 1.0, count)
    x, y, z, last = np.split(out, np.cumsum([sum(padded), len(kinds), sum(padded)]), axis=1)
    residual = np.maximum(last[:, 3], last[:, 4])
    status = last[:, 0].astype(np.int64)
    return Solutions(x[:, places], y[:, :rows], z[:, places], status, last[:, 1], last[:, 2], residual, last[:, 5])


def run(
    columns: Array, right: Array, wrenches: Array, cones: IntArray, kinds: IntArray, floor: float, count: int,
    *, start: Array | None = None, share: float = 0.0, chain: bool = False,
) -> Array:  # fmt: skip
    """The answers ``(count, …)`` of `kernels.cone.solve`, on all threads."""
    out = np.empty((count, 2 * columns.shape[1] + right.shape[1] + cone.EXTRAS))
    begin = out[:1] if start is None else start

    def work(i: int, j: int) -> None:
        D, H, w, S = (v if len(v) == 1 else v[i:j] for v in (columns, right, wrenches, begin))
        cone.solve(D, H, w, cones, kinds, floor, S, share, chain, MOST_STEPS, out[i:j])

    over_ranges(work, count, 4 * cone_rows.WIDTH)
    return out


def in_threes(rows: int) -> int:
    """The next multiple of three: how many rows the kernel wants."""
    return -(-rows // 3) * 3


@cache
def layout(cones: tuple[int, ...]) -> tuple[IntArray, tuple[int, ...]]:
    """Where the columns of *cones* stand once all sizes are odd, and those sizes."""
    padded = tuple(k + (k + 1) % 2 for k in cones)
    starts = np.cumsum((0, *padded))
    return np.concatenate([s + np.arange(k) for s, k in zip(starts, cones)]), padded


@dataclass(frozen=True, eq=False)
class ContactCone:
    """A contact's friction cone as a product of standard cones: ``f = map @ x``, x in *cones*, ``link @ x = 0``.

    All sizes are odd (`kernels.cone_algebra`); the columns that fill up are zero.
    """

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
        return ContactCone((3,), np.array([[0.0, mu, 0.0], [1.0, 0.0, 0.0]]), none.reshape(0, 3))
    if contact.size == 3 or gamma == 0.0 or contact.model is ContactModel.SOFT:
        k = 5 if contact.size == 4 and gamma > 0.0 else 3
        D = np.zeros((contact.size, k))
        D[2, 0], D[0, 1], D[1, 2] = 1.0, mu, mu
        if k == 5:
            D[3, 3] = gamma
        return ContactCone((k,), D, none.reshape(0, k))
    D = np.zeros((4, 6))  # x = (f₃, f₁/µ, f₂/µ) and (f₃, τ/γ)
    D[2, 0], D[0, 1], D[1, 2], D[3, 4] = 1.0, mu, mu, gamma
    return ContactCone((3, 3), D, np.array([[1.0, 0.0, 0.0, -1.0, 0.0, 0.0]]))
