"""The contact forces farthest from the walls of their cones: the analytic centre (G 2.7)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from .contact import Contact, ContactModel
from .force_program import Limits, build, joint_torques, run, torque_bounds
from .forces import ContactForces, ForceStatus

if TYPE_CHECKING:
    from .grasp import Grasp

LIMIT_WEIGHTS = (1e-2, 1e-4, 1e-6, 1e-8)
"""Weights of the logarithms that keep limits, one Newton run each."""


def analytic_centre(grasp: Grasp, wrench: Array, limits: Limits, weights: Array) -> ContactForces:
    """Minimise ``Σ w f_n − log det P(f)`` over ``G f = −wrench`` within the limits, by Newton's method on 𝒩(G).

    Starts from the forces with the largest margin, which also decide whether there is a strictly feasible point. P is
    the LMI of `Contact.lmi`. The barrier is self-concordant: at a Newton decrement λ < 0.68 the value is within λ² of
    the optimum, which is the bound that is returned.
    """
    from .forces import _single

    program = build(grasp, "max_margin", limits)
    answer, size = run(program, wrench[None])
    f = program.maps @ answer.x[0] * size[0]
    p = grasp.wrench_size
    start = _single(
        grasp, program, answer, f, float(program.sign * answer.primal[0] * size[0]), 0.0, answer.y[0, :p].copy()
    )
    if start.status is ForceStatus.INFEASIBLE:
        return replace(start, forces=np.zeros_like(f), value=np.inf, bound=np.inf)
    G = grasp.matrix
    f = f - np.linalg.lstsq(G, G @ f + wrench, rcond=None)[0]
    rows, right = _limit_rows(grasp, limits)
    if _slacks(grasp, f).min() <= 1e-12 or (len(rows) and (right - rows @ f).min() <= 0.0):
        return replace(start, status=ForceStatus.INFEASIBLE, forces=np.zeros_like(f), value=np.inf, bound=np.inf)
    N = grasp.null_space
    cost = _cost(grasp, weights)
    steps, decrement = 0, np.inf
    for weight in LIMIT_WEIGHTS if len(rows) else (0.0,):
        for _ in range(60):
            value, gradient, hessian = _barrier(grasp, f, cost, rows, right, weight)
            g, H = N.T @ gradient, N.T @ hessian @ N
            step = np.linalg.solve(H, -g)
            decrement = float(np.sqrt(max(-float(g @ step), 0.0)))
            if decrement < 1e-10:
                break
            steps += 1
            direction, length = N @ step, 1.0 if decrement < 0.25 else 1.0 / (1.0 + decrement)
            while length > 1e-12:
                trial = f + length * direction
                inside = _slacks(grasp, trial).min() > 0.0 and (not len(rows) or (right - rows @ trial).min() > 0.0)
                if inside and _barrier(grasp, trial, cost, rows, right, weight)[0] <= value + 1e-12 * abs(value):
                    break
                length *= 0.5
            f = f + length * direction
            if length <= 1e-12:
                break
    value = _barrier(grasp, f, cost, rows, right, 0.0)[0]
    done = decrement < 1e-4
    allowance = decrement**2 + LIMIT_WEIGHTS[-1] * len(rows)
    residual = float(np.abs(G @ f + wrench).max() / (1.0 + np.abs(wrench).max()))
    return ContactForces(
        ForceStatus.OPTIMAL if done else ForceStatus.INACCURATE, f, value, value - allowance, residual, np.zeros(p),
        steps, grasp, (), program.torque,
    )  # fmt: skip


def _cost(grasp: Grasp, weights: Array) -> Array:
    from .closure import normal_index

    row = np.zeros(grasp.matrix.shape[1])
    for contact, s, w in zip(grasp.contacts, grasp.slices, weights, strict=True):
        row[s.start + normal_index(contact)] = w
    return row


def _slacks(grasp: Grasp, f: Array) -> Array:
    return np.array([float(c.slack(f[s])) for c, s in zip(grasp.contacts, grasp.slices, strict=True)])


def _limit_rows(grasp: Grasp, limits: Limits) -> tuple[Array, Array]:
    """``rows f ≤ right`` of all finite limits."""
    from ..arrays import as_vector
    from .closure import _normals, normal_index

    rows, right = [], []
    m = grasp.matrix.shape[1]
    if limits.normal is not None:
        most = as_vector(limits.normal, "limits.normal", len(grasp))
        for contact, s, value in zip(grasp.contacts, grasp.slices, most, strict=True):
            rows.append(np.eye(m)[s.start + normal_index(contact)])
            right.append(value)
    if limits.total is not None:
        rows.append(_normals(grasp))
        right.append(float(limits.total))
    torque = joint_torques(grasp, limits)
    if torque is not None:
        J, offset = torque
        lower, upper = torque_bounds(limits, J.shape[1])
        rows += [*J.T, *(-J.T)]
        right += [*(upper - offset), *(offset - lower)]
    A, b = np.array(rows).reshape(-1, m), np.array(right)
    finite = np.isfinite(b)
    return A[finite], b[finite]


def _barrier(
    grasp: Grasp, f: Array, cost: Array, rows: Array, right: Array, weight: float
) -> tuple[float, Array, Array]:
    """Value, gradient and Hessian of the objective, with *weight* times the logarithms of the limits."""
    m = len(f)
    value, gradient, hessian = float(cost @ f), cost.copy(), np.zeros((m, m))
    for contact, s in zip(grasp.contacts, grasp.slices, strict=True):
        for factor, power in _log_factors(contact):
            x = f[s]
            q = float(x @ factor @ x) if factor.ndim == 2 else float(factor @ x)
            d = 2.0 * factor @ x if factor.ndim == 2 else factor
            value -= power * float(np.log(q))
            gradient[s] -= power * d / q
            hessian[s, s] += power * np.outer(d, d) / q**2
            if factor.ndim == 2:
                hessian[s, s] -= power * 2.0 * factor / q
    if weight and len(rows):
        room = right - rows @ f
        value -= weight * float(np.log(room).sum())
        gradient += weight * rows.T @ (1.0 / room)
        hessian += weight * (rows.T / room**2) @ rows
    return value, gradient, hessian


def _log_factors(contact: Contact) -> list[tuple[Array, float]]:
    """det P as a product of powers of linear (vector) and quadratic (matrix) forms of the force."""
    mu, gamma = contact.friction, contact.torsion
    if contact.size == 1:
        return [(np.array([1.0]), 1.0)]
    if contact.dimension == 2:
        return [(np.array([1.0, mu]), 1.0), (np.array([-1.0, mu]), 1.0)]
    if contact.size == 3:
        return [(np.diag([-1.0, -1.0, mu * mu]), 1.0)]
    if contact.model is ContactModel.SOFT_BOX:
        return [
            (np.diag([-1.0, -1.0, mu * mu, 0.0]), 1.0),
            (np.array([0.0, 0.0, gamma, 1.0]), 1.0),
            (np.array([0.0, 0.0, gamma, -1.0]), 1.0),
        ]
    return [
        (np.diag([-1.0 / mu**2, -1.0 / mu**2, 1.0, -1.0 / gamma**2]), 1.0),
        (np.array([0.0, 0.0, 1.0, 0.0]), 2.0),
    ]
