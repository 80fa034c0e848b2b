"""The cone program of a grasp, an objective and limits (G 2.7)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array, BoolArray, IntArray, as_vector
from ..errors import InputError
from ..kernels import cone as kernel
from ..kernels.cone_batch import orthonormal
from .limits import Limits, joint_torques, torque_bounds
from .program import in_threes, layout, run

if TYPE_CHECKING:
    from .grasp import Grasp


RANK = 1e-11
"""Singular values of the balance rows below this share of the largest count as zero."""
WEAK = 1e-6
"""Grasps in a batch, of whose balance rows less than this is independent, are solved one by one."""
TOO_LARGE = "{} is too large to compute with; expected forces in N and moments in N m"
TYPICAL = 1e-3
"""Forces are counted in units of the wrench, but at least of this share of the smallest limit."""


@dataclass(frozen=True, eq=False)
class Parts:
    """What the cone programs of N grasps of one kind are made of: contacts of the same models in the same order.

    ``wrenches (N, p, n)`` of cone coordinates, scaled; ``maps (N, m, n)`` from them to forces; the rest they share:
    the interior element ``e (n,)``, ``links (L, n)``, the *cones*, and the rows of normal forces.
    """

    wrenches: Array
    maps: Array
    e: Array
    links: Array
    cones: tuple[int, ...]
    normals: IntArray
    friction: Array  # (N, k)
    torsion: Array  # (N, k)
    scale: Array  # (N, p)
    grasp: Grasp  # one of them

    @classmethod
    def of(cls, grasp: Grasp) -> Parts:
        """The parts of one grasp."""
        from .closure import _stacked, normal_index

        maps, e, links = _stacked(grasp)
        normals = np.array([s.start + normal_index(c) for c, s in zip(grasp.contacts, grasp.slices, strict=True)])
        friction, torsion = (np.array([[getattr(c, name) for c in grasp.contacts]]) for name in ("friction", "torsion"))
        wrenches = (grasp.matrix * grasp.scale[:, None] @ maps)[None]
        cones = tuple(size for cc in grasp.cones for size in cc.cones)
        return cls(wrenches, maps[None], e, links, cones, normals, friction, torsion, grasp.scale[None], grasp)

    def __len__(self) -> int:
        return len(self.wrenches)


class _Builder:
    """Columns (cones) and rows (equations) put together piece by piece, for N programs at once."""

    def __init__(self, parts: Parts) -> None:
        self.cones = list(parts.cones)
        self.n = sum(parts.cones)
        self.count = len(parts)
        self.rows: list[Array] = []
        self.right: list[Array] = []
        self.kinds: list[int] = []
        self.sizes: list[Array] = []  # what rows were divided by
        self.names: dict[int, str] = {}  # row of a limit → name

    def cone(self, size: int) -> int:
        """A new cone; the column where it starts."""
        padded = layout((size,))[1][0]
        self.cones.append(padded)
        self.n += padded
        return self.n - padded

    def equation(
        self,
        row: Array,
        right: Array | float = 0.0,
        kind: int = kernel.COUPLING,
        others: dict[int, float] | None = None,
    ) -> None:
        """A new equation: *row* ``(N, …)`` over the first columns, *others* by column."""
        full = np.zeros((self.count, self.n))
        full[:, : row.shape[-1]] = row
        for column, value in (others or {}).items():
            full[:, column] = value
        self.rows.append(full)
        self.right.append(np.broadcast_to(np.asarray(right, np.float64), self.count))
        self.kinds.append(kind)
        self.sizes.append(np.ones(self.count))

    def limit(self, row: Array, right: Array | float, name: str) -> None:
        """``row x + s = right`` with a slack s ≥ 0, the row of unit length."""
        length = np.linalg.norm(row, axis=-1)
        length = np.where(length > 0.0, length, 1.0)
        slack = self.cone(1)
        self.names[len(self.rows)] = name
        self.equation(row / length[:, None], right / length, slack, {slack: 1.0})
        self.sizes[-1] = length

    def arrays(self) -> tuple[Array, Array]:
        """``A (N, rows, n)`` and ``b (N, rows)``."""
        A = np.zeros((self.count, len(self.rows), self.n))
        for i, row in enumerate(self.rows):
            A[:, i, : row.shape[1]] = row
        return A, np.array(self.right).T.reshape(self.count, len(self.rows))


@dataclass(frozen=True, eq=False)
class Program:
    """The cone programs of N grasps, an objective and limits; only their right-hand side depends on the wrench.

    ``A x = b0 − B w``, forces ``f = maps x``, value = *factor* × that of the program. *columns*, *right*, *kinds* and
    *floor* are what `kernels.cone.solve` takes: the first rows, the balance of wrenches, are turned into orthonormal
    ones by *onto*, so that neither units nor a weak direction of the grasp spoil the numbers. What of them is *missed*
    cannot be balanced by any contact forces.
    """

    A: Array
    b0: Array
    B: Array
    cones: IntArray
    maps: Array
    factor: Array
    power: int
    columns: Array
    right: Array
    kinds: IntArray
    floor: float
    onto: Array  # (N, rank, first rows)
    missed: Array  # (first rows, first rows − rank); one grasp only
    unit: float  # the first factor
    weak: BoolArray  # (N,): to be solved one by one
    names: dict[int, str]
    sizes: Array  # (rows, N)
    torque: tuple[Array, Array] | None  # J_H, offset

    @property
    def n(self) -> int:
        """Number of columns."""
        return int(self.columns.shape[1])

    @cached_property
    def cuts(self) -> tuple[slice, slice, slice]:
        """Where an answer holds x, y and z."""
        n, rows = self.n, self.right.shape[1]
        return slice(0, n), slice(n, n + rows), slice(n + rows, 2 * n + rows)

    def direction(self, y: Array, p: int) -> Array:
        """The part ``(…, p)`` of dual solutions ``y (…, rows)`` that belongs to the wrench."""
        rank = self.onto.shape[1]
        onto = self.onto[0] if len(self.onto) == 1 else self.onto
        d: Array = (y[..., None, :rank] @ onto)[..., 0, :p]
        return d


def build(parts: Parts, objective: str, limits: Limits, weights: Array | None = None) -> Program:
    """The cone programs for an objective and limits."""
    builder = _Builder(parts)
    maps, wrenches = parts.maps, parts.wrenches
    links = np.broadcast_to(parts.links, (len(parts), *parts.links.shape))
    unit, margin = np.ones(len(parts)), -1
    if objective == "max_margin":  # f = maps (x + t e'), with the smallest eigenvalue of P as t
        margin = builder.cone(1)
        shift = _eigen_units(parts)
        unit = shift.max(axis=1)  # t is counted in the finest of these, so that its column is of order one
        shift = (shift / unit[:, None])[..., None]
        maps, links, wrenches = (np.concatenate([v, v @ shift], axis=2) for v in (maps, links, wrenches))
    for rows in (wrenches, links):
        for i in range(rows.shape[1]):
            builder.equation(rows[:, i], kind=kernel.BALANCE)
    first = len(builder.rows)
    torque = joint_torques(parts.grasp, limits)
    _limits(builder, parts, maps, limits, torque)
    c, Q, factor = _objective(builder, parts, maps, objective, torque, weights)
    if objective == "max_margin":
        c, factor = np.zeros(builder.n), -1.0 / unit
        c[margin] = -1.0
    A, b0 = builder.arrays()
    columns, onto, missed, weak = _columns(A, first)
    rows_in, p = A.shape[1] - first + onto.shape[1], parts.wrenches.shape[1]
    columns[:, : len(c), -2] = c
    columns[:, : Q.shape[1], -1] = Q
    right = np.zeros((len(parts), in_threes(rows_in), 1 + p))
    right[:, onto.shape[1] : rows_in, 0] = b0[:, first:]
    right[:, : onto.shape[1], 1:] = -onto[:, :, :p] * parts.scale[:, None]
    kinds = np.full(in_threes(rows_in), kernel.COUPLING)
    kinds[: onto.shape[1]] = kernel.BALANCE
    kinds[onto.shape[1] : rows_in] = builder.kinds[first:]
    full_maps = np.zeros((len(maps), maps.shape[1], builder.n))
    full_maps[:, :, : maps.shape[2]] = maps
    B = np.zeros((A.shape[1], p))
    B[:p] = np.diag(parts.scale[0])
    return Program(
        A, b0, B, np.array(builder.cones), full_maps, factor, 2 if Q.any() else 1, columns, right, kinds,
        _floor(b0[:, first:], kinds[onto.shape[1] : rows_in], objective), onto, missed, float(factor[0]), weak,
        builder.names, np.array(builder.sizes), torque,
    )  # fmt: skip


def _floor(right: Array, kinds: IntArray, objective: str) -> float:
    """The least unit of force, from the constant sides of the rows behind the balance."""
    limits = np.abs(right[:, kinds >= 0])
    least = float(limits[limits > 0.0].min(initial=np.inf))
    if not np.isfinite(least):
        return TYPICAL * float(np.abs(right).max(initial=0.0))
    return least if objective == "max_margin" else TYPICAL * least


def _limits(builder: _Builder, parts: Parts, maps: Array, limits: Limits, torque: tuple[Array, Array] | None) -> None:
    """The rows of the limits on normal forces, their sum and joint torques."""
    if limits.normal is not None:
        most = as_vector(limits.normal, "limits.normal", len(parts.normals))
        for i in np.flatnonzero(np.isfinite(most)):
            builder.limit(maps[:, parts.normals[i]], float(most[i]), f"normal force of contact {i}")
    if limits.total is not None and np.isfinite(limits.total):
        builder.limit(maps[:, parts.normals].sum(axis=1), float(limits.total), "sum of normal forces")
    if torque is None:
        return
    J, offset = torque
    lower, upper = torque_bounds(limits, J.shape[1])
    for j in range(J.shape[1]):
        row = J[:, j] @ maps
        if np.isfinite(upper[j]):
            builder.limit(row, float(upper[j] - offset[j]), f"upper torque of joint {j}")
        if np.isfinite(lower[j]):
            builder.limit(-row, float(offset[j] - lower[j]), f"lower torque of joint {j}")


def _objective(
    builder: _Builder, parts: Parts, maps: Array, objective: str, torque: tuple[Array, Array] | None,
    weights: Array | None,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Cost ``c (n,)``, ``Q (N, n)`` and the *factor* of the value ``(N,)``, with the columns and rows they need."""
    none, ones = np.zeros((len(parts), 0)), np.ones(len(parts))
    normals = maps[:, parts.normals]
    if objective == "min_normal":
        w = np.ones(len(parts.normals)) if weights is None else weights
        largest = max(float(np.abs(w).max()), 1e-300)
        return (w / largest) @ normals[0], none, ones * largest
    if objective == "min_norm":
        return np.zeros(0), 2.0 * (maps**2).sum(axis=1), ones
    if objective in ("min_largest", "min_largest_norm", "min_torque"):
        if objective == "min_torque" and torque is None:
            raise InputError('objective "min_torque" needs limits.hand_jacobian')
        t = builder.cone(1 if torque is None or objective != "min_torque" else 1 + torque[0].shape[1])
        if objective == "min_largest":
            for i in range(normals.shape[1]):
                rest = builder.cone(1)
                builder.equation(normals[:, i], others={rest: 1.0, t: -1.0})
        elif objective == "min_largest_norm":
            for s in parts.grasp.slices:
                count = min(s.stop - s.start, parts.grasp.dimension)  # the moment of a soft finger is not a force
                u = builder.cone(1 + count)
                builder.equation(none, others={u: 1.0, t: -1.0})
                for j in range(count):
                    builder.equation(maps[:, s.start + j], others={u + 1 + j: -1.0})
        elif torque is not None:
            J, offset = torque
            length = max(float(np.linalg.norm(J)), 1e-300)
            ones = ones * length
            for j in range(J.shape[1]):
                builder.equation((J[:, j] / length) @ maps, -float(offset[j]) / length, others={t + 1 + j: -1.0})
        c = np.zeros(builder.n)
        c[t] = 1.0
        return c, none, ones
    return np.zeros(0), none, ones  # "feasible", and "max_margin", which has its own column


def _columns(A: Array, first: int) -> tuple[Array, Array, Array, BoolArray]:
    """The columns for the kernel, with room for c and Q: the *first* rows of ``A (N, rows, n)`` made orthonormal by
    *onto*, the others behind them. Then what the first rows miss, and which grasps are too weak for a batch."""
    count, rows, n = A.shape
    weak = np.zeros(count, np.bool_)
    if count == 1:
        U, s, _ = np.linalg.svd(A[0, :first], full_matrices=True)
        rank = int((s > RANK * max(float(s[0]), 1e-300)).sum())
        onto, missed = np.ascontiguousarray((U[:, :rank] / s[:rank]).T)[None], U[:, rank:].copy()
        columns = np.zeros((1, n, in_threes(rows - first + rank) + 2))
        columns[0, :, :rank] = (onto[0] @ A[0, :first]).T
    else:
        rank, onto, missed = first, np.empty((count, first, first)), np.zeros((first, 0))
        columns = np.zeros((count, n, in_threes(rows) + 2))
        orthonormal(np.ascontiguousarray(A[:, :first]), WEAK, onto, columns, weak)
    columns[:, :, rank : rank + rows - first] = A[:, first:].transpose(0, 2, 1)
    return columns, onto, missed, weak


def _eigen_units(parts: Parts) -> Array:
    """By cone coordinate: the shift of x₀ that lowers the smallest eigenvalue of P by one ``(N, n)``."""
    units = np.zeros((len(parts), len(parts.e)))
    column = 0
    for i, (contact, cc) in enumerate(zip(parts.grasp.contacts, parts.grasp.cones, strict=True)):
        for j, size in enumerate(cc.cones):
            if contact.size == 1 or size == 5:
                units[:, column] = 1.0
            else:
                units[:, column] = 1.0 / np.maximum(parts.friction[:, i] if j == 0 else parts.torsion[:, i], 1e-12)
            column += size
    return units


def answers(
    program: Program, wrenches: Array, *, start: Array | None = None, share: float = 0.0, chain: bool = False
) -> Array:
    """Answers ``(N, …)`` of the program of one grasp, or of N programs, for ``wrenches (N, p)``."""
    out = run(
        program.columns, program.right, wrenches, program.cones, program.kinds, program.floor, len(wrenches),
        start=start, share=share, chain=chain,
    )  # fmt: skip
    invalid = (out[:, -kernel.EXTRAS] == kernel.INVALID) & ~program.weak  # those are solved one by one
    if invalid.any():
        raise InputError(TOO_LARGE.format(f"wrench {int(invalid.argmax())} of {len(wrenches)}"))
    if program.missed.shape[1]:
        refuse(program, wrenches, out)
    return out


def refuse(program: Program, wrenches: Array, out: Array) -> None:
    """Mark the wrenches that no forces balance, whatever the cones: the part that the balance rows miss proves it."""
    first = len(program.missed)
    # einsum, not @: BLAS's threads go on spinning after a product and would hold the core that the solver's need
    b = program.b0[0, :first] - np.einsum("nj,ij->ni", wrenches, program.B[:first])
    outside = np.einsum("ni,ij->nj", b, program.missed)
    bad = (outside * outside).sum(axis=1) > 1e-18 * (b * b).sum(axis=1)
    m = 2 * program.n + program.right.shape[1]
    out[bad, m : m + 3] = kernel.INFEASIBLE, np.inf, np.inf


def missed_direction(program: Program, wrench: Array) -> Array | None:
    """The certificate ``(p,)`` where a wrench is one that the balance rows miss."""
    first, p = len(program.missed), len(wrench)
    b = program.b0[0, :first] - program.B[:first] @ wrench
    outside = b @ program.missed
    square = float(outside @ outside)
    if not square > 1e-18 * float(b @ b):
        return None
    d: Array = (program.missed @ outside)[:p] / square
    return d
