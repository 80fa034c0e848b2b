"""The contact forces farthest from the walls of their cones: the analytic centre (G 2.7)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_shaped, as_vector
from ..kernels import cone
from ..kernels import cone_barrier as kernel
from ..parallel import over_ranges
from .contact import Contact, ContactModel
from .force_program import Program, answers
from .limits import Limits

if TYPE_CHECKING:
    from .forces import ContactForces, ForceBatch
    from .grasp import Grasp

LIMIT_WEIGHTS = (1e-2, 1e-4, 1e-6, 1e-8)
"""Weights of the logarithms that keep limits, one Newton run each."""
STRICT = 1e-12
"""Relative depth inside the cones below which there is no point strictly inside."""


def analytic_centre(
    grasp: Grasp, wrench: ArrayLike, limits: Limits, weights: ArrayLike | None, program: Program
) -> ContactForces | ForceBatch:
    """Minimise ``Σ w f_n − log det P(f)`` over ``G f = −wrench`` within the limits, by Newton's method on 𝒩(G).

    *program*: the largest margin, whose answer starts the method and decides whether a strictly feasible point exists.
    P is the LMI of `Contact.lmi`. The barrier is self-concordant: at a Newton decrement λ < 0.68 the value is within
    λ² of the optimum, which is the bound that is returned. UNBOUNDED without positive weights and limits.
    """
    from .forces import _CODES, batch, single

    p = grasp.wrench_size
    w = as_shaped(wrench, "wrench", p)
    flat = w.reshape(-1, p)
    out = answers(program, flat)
    forces, found = _inside(grasp, program, flat, out)
    cost = np.zeros(grasp.matrix.shape[1])
    cost[_normals(grasp)] = 1.0 if weights is None else as_vector(weights, "weights", len(grasp))
    rows, right = _limit_rows(program)
    measures = np.zeros((len(flat), 3))
    stages = np.array(LIMIT_WEIGHTS if len(rows) else (0.0,))
    chosen = np.flatnonzero(found)
    at, numbers = np.ascontiguousarray(forces[chosen]), np.zeros((len(chosen), 3))

    if len(chosen):
        factors = _factors(grasp)
        over_ranges(
            lambda i, j: kernel.centre(grasp.null_space, cost, *factors, rows, right, stages, at[i:j], numbers[i:j]),
            len(chosen), 4,
        )  # fmt: skip
    forces[chosen], measures[chosen] = at, numbers
    e = -cone.EXTRAS
    status, decrement = out[:, e], measures[:, 1]
    status[~found] = cone.INFEASIBLE
    status[found] = np.where(
        decrement < 0.0, cone.UNBOUNDED, np.where(decrement < 1e-4, cone.OPTIMAL, cone.INACCURATE)
    )[found]
    value = np.where(status == cone.INFEASIBLE, np.inf, np.where(status == cone.UNBOUNDED, -np.inf, measures[:, 0]))
    residual = np.abs(forces @ grasp.matrix.T + flat).max(axis=1) / (1.0 + np.abs(flat).max(axis=1))
    allowance = decrement**2 + LIMIT_WEIGHTS[-1] * len(rows)
    forces[status != cone.OPTIMAL] = 0.0
    done = (forces, value, value - allowance, residual, measures[:, 2])
    if w.ndim == 1:
        value_, bound, residual_, steps = (float(v[0]) for v in done[1:])
        return single(grasp, program, w, out[0], _CODES[int(status[0])], forces[0], value_, bound, residual_, steps)
    return batch(program, flat, out, w.shape[:-1], done)


def _inside(grasp: Grasp, program: Program, wrenches: Array, out: Array) -> tuple[Array, BoolArray]:
    """Balancing forces ``(N, m)`` strictly inside cones and limits, and for which wrenches there are any."""
    G, code, size = grasp.matrix, out[:, -cone.EXTRAS], out[:, -1]
    forces = out[:, program.cuts[0]] @ program.maps[0].T * size[:, None]
    back = np.linalg.pinv(G)
    rays = code == cone.UNBOUNDED  # inner forces with a margin: as many of them as it takes
    inner = forces[rays] - forces[rays] @ G.T @ back.T
    plain = -wrenches[rays] @ back.T
    depth, lack = _depth(grasp, inner), -_depth(grasp, plain) + np.abs(plain).max(axis=1, initial=0.0)
    lack = np.maximum(lack, 1.0 * (lack == 0.0))
    with np.errstate(divide="ignore"):
        forces[rays] = plain + (lack / np.where(depth > 0.0, depth, np.inf))[:, None] * inner
    forces -= (forces @ G.T + wrenches) @ back.T
    rows, right = _limit_rows(program)
    room = (right - forces @ rows.T).min(axis=1, initial=np.inf)
    largest = np.abs(forces).max(axis=1)
    found = (code == cone.OPTIMAL) | rays
    return forces, found & (_depth(grasp, forces) > STRICT * largest) & (room > 0.0)


def _normals(grasp: Grasp) -> IntArray:
    from .closure import normal_index

    return np.array([s.start + normal_index(c) for c, s in zip(grasp.contacts, grasp.slices, strict=True)])


def _depth(grasp: Grasp, forces: Array) -> Array:
    """The least slack of the contacts ``(N,)``."""
    each = [contact.slack(forces[:, s]) for contact, s in zip(grasp.contacts, grasp.slices, strict=True)]
    depth: Array = np.min(np.broadcast_arrays(*each), axis=0)
    return depth


def _limit_rows(program: Program) -> tuple[Array, Array]:
    """``rows f ≤ right`` of all finite limits: those of the program, put back from cone coordinates to forces."""
    which = list(program.names)
    maps = program.maps[0]
    back = np.linalg.pinv(maps)
    used = np.abs(maps).sum(axis=0) > 0.0
    A = np.where(used, program.A[0, which], 0.0)
    return np.ascontiguousarray(A @ back), program.b0[0, which].copy()


def _factors(grasp: Grasp) -> tuple[IntArray, Array, Array]:
    """det P as powers of linear and diagonal quadratic forms: for `kernels.cone_barrier.centre`."""
    places, powers, forms = [], [], []
    for contact, s in zip(grasp.contacts, grasp.slices, strict=True):
        normal = 0 if contact.size == 1 else 1 if contact.dimension == 2 else 2
        for form, quadratic, power in _log_factors(contact):
            places.append((s.start, len(form), int(quadratic), normal))
            powers.append(power)
            forms.append(form + (0.0,) * (4 - len(form)))
    return np.array(places), np.array(powers), np.array(forms)


def _log_factors(contact: Contact) -> list[tuple[tuple[float, ...], bool, float]]:
    """Coefficients, whether they belong to squares, and the power, of each factor of det P."""
    mu, gamma = contact.friction, contact.torsion
    if contact.size == 1:
        return [((1.0,), False, 1.0)]
    if contact.dimension == 2:
        return [((1.0, mu), False, 1.0), ((-1.0, mu), False, 1.0)]
    if contact.size == 3:
        return [((-1.0, -1.0, mu * mu), True, 1.0)]
    if contact.model is ContactModel.SOFT_BOX:
        box = [((0.0, 0.0, gamma, sign), False, 1.0) for sign in (1.0, -1.0)]
        return [((-1.0, -1.0, mu * mu, 0.0), True, 1.0), *box]
    return [((-1.0 / mu**2, -1.0 / mu**2, 1.0, -1.0 / gamma**2), True, 1.0), ((0.0, 0.0, 1.0, 0.0), False, 2.0)]
