"""The cone program of a grasp, an objective and limits (G 2.7)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_vector
from ..errors import InputError
from ..kernels import cone as kernel
from .program import Solutions, solve

if TYPE_CHECKING:
    from .grasp import Grasp


@dataclass(frozen=True, eq=False)
class Limits:
    """What contact forces must respect besides the friction cones; None: no limit.

    *normal*: largest normal force, one number or one per contact; *total*: of their sum; *hand_jacobian* ``(m, n)``
    with *torque_lower*, *torque_upper* ``(n,)`` (or one number, or ``(−x, x)`` from *torque_upper* alone) and
    *torque_offset* ``(n,)``: ``lower ≤ J_Hᵗ f + offset ≤ upper`` (motor limits pass through a transmission by
    multiplying *hand_jacobian* with it).
    """

    normal: ArrayLike | None = None
    total: float | None = None
    hand_jacobian: ArrayLike | None = None
    torque_lower: ArrayLike | None = None
    torque_upper: ArrayLike | None = None
    torque_offset: ArrayLike | None = None


NO_LIMITS = Limits()


def with_torques(limits: Limits | None, torque_limits: ArrayLike, hand_jacobian: ArrayLike | None) -> Limits:
    """*limits* with the joint torques bounded by *torque_limits* ``(n,)`` either way or ``(n, 2)`` pairs."""
    limits = limits or NO_LIMITS
    J = limits.hand_jacobian if hand_jacobian is None else hand_jacobian
    if J is None:
        raise InputError("torque_limits need hand_jacobian= the matrix J_H (m, n) that maps contact forces to torques")
    bounds = as_array(torque_limits, "torque_limits", finite=False)
    if bounds.ndim == 2 and bounds.shape[1] == 2:
        return replace(limits, hand_jacobian=J, torque_lower=bounds[:, 0], torque_upper=bounds[:, 1])
    if bounds.ndim > 1:
        raise InputError(f"torque_limits has shape {bounds.shape}; expected (n,) or (n, 2)")
    return replace(limits, hand_jacobian=J, torque_lower=-bounds, torque_upper=bounds)


@dataclass
class Program:
    """The cone program of a grasp, an objective and limits; only its right-hand side depends on the wrench.

    ``A x = b0 − B w``, forces ``f = maps x``.
    """

    A: Array
    b0: Array
    B: Array
    c: Array
    Q: Array
    cones: tuple[int, ...]
    maps: Array
    sign: float
    homogeneous: bool
    names: dict[int, str] = field(default_factory=dict)  # column of a limit's slack → name
    torque: tuple[Array, Array] | None = None  # J_H, offset

    def __post_init__(self) -> None:
        U, s, _ = np.linalg.svd(self.A)
        rank = int((s > 1e-11 * max(float(s[0]), 1e-300)).sum())
        self.onto, self.missed = (
            U[:, :rank],
            U[:, rank:],
        )  # dependent rows make two answers possible: none, or fewer rows


class _Builder:
    """Columns (cones) and rows (equations) put together piece by piece."""

    def __init__(self) -> None:
        self.cones: list[int] = []
        self.n = 0
        self.rows: list[tuple[dict[int, float] | Array, float]] = []

    def cone(self, size: int) -> int:
        """A new cone; the column where it starts."""
        self.cones.append(size)
        self.n += size
        return self.n - size

    def equation(self, row: dict[int, float] | Array, right: float) -> None:
        """A new equation; *row* by column, or dense over the columns so far."""
        self.rows.append((row, right))

    def arrays(self) -> tuple[Array, Array]:
        """A and b."""
        A, b = np.zeros((len(self.rows), self.n)), np.zeros(len(self.rows))
        for i, (row, right) in enumerate(self.rows):
            b[i] = right
            if isinstance(row, dict):
                for j, v in row.items():
                    A[i, j] = v
            else:
                A[i, : len(row)] = row
        return A, b


def build(grasp: Grasp, objective: str, limits: Limits, weights: Array | None = None) -> Program:
    """The cone program for an objective and limits."""
    from .closure import _stacked, normal_index

    G = grasp.matrix * grasp.scale[:, None]
    p, k, m = grasp.wrench_size, len(grasp), G.shape[1]
    maps, e, links = _stacked(grasp)
    builder = _Builder()
    for cc in grasp.cones:
        for size in cc.cones:
            builder.cone(size)
    margin, unit = -1, 1.0
    if objective == "max_margin":  # f = maps (x + t e'), with the smallest eigenvalue of P as t
        margin = builder.cone(1)
        shift = e * _eigen_units(grasp)
        unit = float(shift.max())  # t is counted in the finest of these, so that its column is of order one
        shift = shift / unit
        maps = np.column_stack([maps, maps @ shift])
        links = np.column_stack([links, links @ shift])
    for row in G @ maps:
        builder.equation(row, 0.0)
    for row in links:
        builder.equation(row, 0.0)
    normal_rows = []
    for contact, s in zip(grasp.contacts, grasp.slices, strict=True):
        normal_rows.append(maps[s.start + normal_index(contact)])
    names: dict[int, str] = {}
    homogeneous = True
    if limits.normal is not None:
        most = as_vector(limits.normal, "limits.normal", k)
        for i in range(k):
            if np.isfinite(most[i]):
                _upper(builder, normal_rows[i], float(most[i]), names, f"normal force of contact {i}")
                homogeneous = False
    if limits.total is not None:
        _upper(builder, np.sum(normal_rows, axis=0), float(limits.total), names, "sum of normal forces")
        homogeneous = False
    torque = joint_torques(grasp, limits)
    if torque is not None:
        J, offset = torque
        lower, upper = torque_bounds(limits, J.shape[1])
        for j in range(J.shape[1]):
            row = J[:, j] @ maps
            if np.isfinite(upper[j]):
                _upper(builder, row, float(upper[j] - offset[j]), names, f"upper torque of joint {j}")
            if np.isfinite(lower[j]):
                _upper(builder, -row, float(offset[j] - lower[j]), names, f"lower torque of joint {j}")
            homogeneous &= not (np.isfinite(upper[j]) or np.isfinite(lower[j]))
    c, Q = {}, np.zeros(0)
    w = np.ones(k) if weights is None else weights
    if objective == "min_normal":
        c = {j: float(v) for j, v in enumerate(w @ np.array(normal_rows))}
    elif objective == "min_norm":
        Q = _squares(grasp, maps)
    elif objective == "min_largest":
        t = builder.cone(1)
        for row in normal_rows:
            rest = builder.cone(1)
            builder.equation({**_sparse(row), rest: 1.0, t: -1.0}, 0.0)
        c = {t: 1.0}
    elif objective == "min_largest_norm":
        t = builder.cone(1)
        for s in grasp.slices:
            count = min(s.stop - s.start, grasp.dimension)  # the moment of a soft finger is not a force
            u = builder.cone(1 + count)
            builder.equation({u: 1.0, t: -1.0}, 0.0)
            for j, component in enumerate(range(s.start, s.start + count)):
                builder.equation({**_sparse(maps[component]), u + 1 + j: -1.0}, 0.0)
        c = {t: 1.0}
    elif objective == "max_margin":
        c = {margin: -1.0}
    elif objective == "min_torque":
        if torque is None:
            raise InputError('objective "min_torque" needs limits.hand_jacobian')
        J, offset = torque
        u = builder.cone(1 + J.shape[1])
        for j in range(J.shape[1]):
            builder.equation({**_sparse(J[:, j] @ maps), u + 1 + j: -1.0}, -float(offset[j]))
            homogeneous &= bool(offset[j] == 0.0)
        c = {u: 1.0}
    A, b0 = builder.arrays()
    cost = np.zeros(builder.n)
    for j, v in c.items():
        cost[j] = v
    full_Q = np.zeros(builder.n)
    full_Q[: len(Q)] = Q
    full_maps = np.zeros((m, builder.n))
    full_maps[:, : maps.shape[1]] = maps
    B = np.zeros((len(A), p))
    B[:p] = np.diag(grasp.scale)
    sign = -1.0 / unit if objective == "max_margin" else 1.0
    return Program(A, b0, B, cost, full_Q, tuple(builder.cones), full_maps, sign, homogeneous, names, torque)


def _sparse(row: Array) -> dict[int, float]:
    return {int(j): float(row[j]) for j in np.nonzero(row)[0]}


def _upper(builder: _Builder, row: Array, right: float, names: dict[int, str], name: str) -> None:
    """``row x + s = right`` with a slack s ≥ 0, scaled to a unit right-hand side where that is not tiny."""
    scale = max(abs(right), 1e-9)
    s = builder.cone(1)
    names[s] = name
    builder.equation({**_sparse(row / scale), s: 1.0}, right / scale)


def _eigen_units(grasp: Grasp) -> Array:
    """By cone coordinate: the shift of x₀ that lowers the smallest eigenvalue of P by one."""
    units = []
    for contact, cc in zip(grasp.contacts, grasp.cones, strict=True):
        mu, gamma = contact.friction, contact.torsion
        for i, size in enumerate(cc.cones):
            if contact.size == 1 or (size == 4):
                unit = 1.0
            elif i == 0:
                unit = 1.0 / max(mu, 1e-12)
            else:
                unit = 1.0 / max(gamma, 1e-12)
            units += [unit] + [0.0] * (size - 1)
    return np.array(units)


def _squares(grasp: Grasp, maps: Array) -> Array:
    """Diagonal Q with ``½ xᵀ Q x = ‖f‖²`` on the cone program's feasible set."""
    Q: Array = 2.0 * (maps**2).sum(axis=0)
    column = 0
    for contact, cc in zip(grasp.contacts, grasp.cones, strict=True):
        if len(cc.cones) == 3:  # τ = γ (u − v) / 2 with u + v = 2 f₃: τ² = γ² (u² + v²) / 2 − γ² f₃²
            gamma = contact.torsion
            if gamma > 1.0:
                raise InputError(
                    f"torsion γ is {gamma} m; the minimum norm with a box-shaped soft finger is convex up to 1 m"
                )
            Q[column] -= 2.0 * gamma**2
            Q[column + 3] = Q[column + 4] = gamma**2
        column += sum(cc.cones)
    return Q


def joint_torques(grasp: Grasp, limits: Limits) -> tuple[Array, Array] | None:
    """J_H ``(m, n)`` and the offset ``(n,)`` of *limits*, checked; None without a hand Jacobian."""
    if limits.hand_jacobian is None:
        if limits.torque_lower is not None or limits.torque_upper is not None:
            raise InputError("torque limits are given without limits.hand_jacobian (m, n)")
        return None
    J = as_array(limits.hand_jacobian, "limits.hand_jacobian")
    m = grasp.matrix.shape[1]
    if J.ndim != 2 or len(J) != m:
        raise InputError(f"limits.hand_jacobian has shape {J.shape}; expected ({m}, n): one row per force component")
    n = J.shape[1]
    offset = np.zeros(n) if limits.torque_offset is None else as_vector(limits.torque_offset, "torque_offset", n)
    return J, offset


def torque_bounds(limits: Limits, n: int) -> tuple[Array, Array]:
    """Lower and upper limits of n joint torques, infinite where none is given."""
    upper = np.full(n, np.inf) if limits.torque_upper is None else as_vector(limits.torque_upper, "torque_upper", n)
    if limits.torque_lower is None:
        lower = -upper if limits.torque_upper is not None else np.full(n, -np.inf)
    else:
        lower = as_vector(limits.torque_lower, "torque_lower", n)
    bad = np.nonzero(lower > upper)[0]
    if len(bad):
        j = int(bad[0])
        raise InputError(f"torque limits of joint {j} exclude each other: lower {lower[j]:g} > upper {upper[j]:g}")
    return lower, upper


def run(program: Program, wrenches: Array) -> tuple[Solutions, Array]:
    """Solve for ``wrenches (N, p)``; homogeneous programs are scaled to unit wrenches first, by *size* ``(N,)``."""
    right = -wrenches @ program.B.T
    size = np.ones(len(wrenches))
    if program.homogeneous:
        size = np.sqrt((right * right).sum(axis=1))
        size[size == 0.0] = 1.0
        right /= size[:, None]
    b = right + program.b0
    if not program.missed.shape[1]:
        return solve(program.A[None], b, program.c[None], program.cones, program.Q[None]), size
    answer = solve(
        (program.onto.T @ program.A)[None], b @ program.onto, program.c[None], program.cones, program.Q[None]
    )
    y = answer.y @ program.onto.T
    outside = b @ program.missed
    squared = (outside * outside).sum(axis=1)
    bad = squared > 1e-18 * (1.0 + (b * b).sum(axis=1))  # nothing in the range of A balances this: y with Aᵀ y = 0
    y[bad] = outside[bad] @ program.missed.T / squared[bad, None]
    codes = np.where(bad, kernel.INFEASIBLE, answer.status)
    primal, dual = (np.where(bad, np.inf, v) for v in (answer.primal, answer.dual))
    return Solutions(answer.x, y, answer.z, codes, primal, dual, answer.residual, answer.steps), size
