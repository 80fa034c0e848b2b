"""Actuation: motors and tendons on one side, joints on the other, and the limits of both (G 3).

A `Transmission` is linear: with the matrix A, motor forces f act on the joints as ``τ = A f``, and the motors (or the
tendons' lengths) move as ``x = x₀ + Aᵀ q``, so that the power is the same on both sides: ``τ · q̇ = f · ẋ``. A positive
force lengthens: a tendon, which can only pull, has f ≤ 0. Torques belong to the coordinates of the robot; what acts on
a mimicking joint counts, times its multiplier, for the joint that drives it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, as_shaped, as_vector
from ..errors import InputError
from ..result import Result, Status
from ..robots.description import JointType

if TYPE_CHECKING:
    from .robot import Robot

ROUNDING = 1e-9
"""Torques and forces that agree to this share of their size agree."""


class ActuationStatus(Status):
    """Outcomes of `Transmission.forces`, from best to worst."""

    SUCCESS = "the motors give these torques within all limits"
    JOINT_LIMIT = "the motors could give these torques, but a joint may not carry its own"
    FORCE_LIMIT = "these torques are beyond the forces of the motors: the nearest ones that they can give are told"
    UNDRIVEN = "no motor drives some part of these torques: the nearest ones that they can give are told"


@dataclass(frozen=True, eq=False)
class Actuation(Result):
    """Answer of `Transmission.forces`; arrays have the batch shape in front, *status* is the worst of the batch."""

    forces: Array  # (..., k) of the motors
    torques: Array  # (..., n) that these forces give
    residual: Array  # (...), largest difference from the torques asked for
    feasible: BoolArray  # (...), whether all limits hold
    status: ActuationStatus
    reason: str

    def explain(self) -> str:
        """The status, and the motor or joint at fault."""
        return self.reason


@dataclass(frozen=True, eq=False)
class Transmission:
    """Motors (or tendons) on the coordinates of a robot: ``τ = matrix f``, ``x = offset + matrixᵀ q``."""

    names: tuple[str, ...]  # of the k motors
    joint_names: tuple[str, ...]  # of the n coordinates
    matrix: Array  # (n, k), in m, or ratios
    offset: Array  # (k,)
    lower: Array  # (k,) least force of each motor
    upper: Array  # (k,)
    shortest: Array  # (k,) least x of each motor
    longest: Array  # (k,)
    effort: Array  # (n,) largest torque either way that each joint may carry

    @classmethod
    def motors(cls, robot: Robot) -> Self:
        """The motors of the description; one for each coordinate, with its effort limits, if it names none."""
        motors = robot.description.actuators
        n = robot.n
        if not motors:
            free, effort = np.full(n, np.inf), robot.limits.effort
            return cls(
                robot.joint_names, robot.joint_names, np.eye(n), np.zeros(n), -effort, effort, -free, free, effort
            )
        matrix, offset = _arms(robot, [motor.arms for motor in motors])
        lower, upper = np.array([(motor.lower, motor.upper) for motor in motors]).T
        free = np.full(len(motors), np.inf)
        names = tuple(motor.name for motor in motors)
        return cls(names, robot.joint_names, matrix, offset, lower, upper, -free, free, robot.limits.effort)

    @classmethod
    def tendons(cls, robot: Robot, tension: ArrayLike = np.inf) -> Self:
        """The tendons of the description; *tension* (one number, or one for each) is the most they may be pulled with.

        `InputError` if the description has none.
        """
        tendons = robot.description.tendons
        if not tendons:
            raise InputError(f"the description of robot {robot.name!r} has no tendons")
        most = as_vector(tension, "tension", len(tendons))
        if (most < 0.0).any():
            raise InputError(f"tension is {float(most.min()):g} N; expected zero or more")
        matrix, offset = _arms(robot, [tendon.arms for tendon in tendons])
        offset += np.array([tendon.offset for tendon in tendons])
        shortest, longest = np.array([(tendon.lower, tendon.upper) for tendon in tendons]).T
        names = tuple(tendon.name for tendon in tendons)
        zero = np.zeros(len(tendons))
        effort = robot.limits.effort
        return cls(names, robot.joint_names, matrix, offset, -most, zero, shortest, longest, effort)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.joint_names)

    @property
    def k(self) -> int:
        """Number of motors."""
        return len(self.names)

    def lengths(self, q: ArrayLike) -> Array:
        """Lengths of the tendons, or positions of the motors, ``x = x₀ + Aᵀ q (..., k)``."""
        return np.asarray(as_shaped(q, "q", self.n) @ self.matrix + self.offset)

    def rates(self, qd: ArrayLike) -> Array:
        """Their rates ``ẋ = Aᵀ q̇ (..., k)``."""
        return np.asarray(as_shaped(qd, "qd", self.n) @ self.matrix)

    def within(self, q: ArrayLike, tolerance: float = ROUNDING) -> BoolArray:
        """Whether every length at ``q (..., n)`` is between its shortest and its longest."""
        x = self.lengths(q)
        return np.asarray(((x >= self.shortest - tolerance) & (x <= self.longest + tolerance)).all(axis=-1))

    def torques(self, forces: ArrayLike) -> Array:
        """``τ = A f (..., n)``."""
        return np.asarray(as_shaped(forces, "forces", self.k) @ self.matrix.T)

    def torque_range(self) -> Array:
        """Least and largest torque ``(n, 2)`` of each joint on its own, within the limits of motors and joint.

        The right *torque_limits* of a grasp. Motors that act on several joints cannot give all of these at once:
        whether they give torques together is what `forces` and `reach` answer.
        """
        ends = np.zeros((2, self.n, self.k))
        used = self.matrix != 0.0
        for end, force in zip(ends, (self.lower, self.upper), strict=True):
            np.multiply(self.matrix, force, out=end, where=used)
        low, high = ends.min(axis=0).sum(axis=1), ends.max(axis=0).sum(axis=1)
        return np.stack([np.maximum(low, -self.effort), np.minimum(high, self.effort)], axis=-1)

    def forces(self, torques: ArrayLike) -> Actuation:
        """The smallest forces (in the sense of Σ f²) that give joint *torques* ``(..., n)`` within the limits.

        Where none do, the nearest torques (least squares) that the motors can give are answered, and the reason.
        """
        tau = as_shaped(torques, "torques", self.n)
        rows = tau.reshape(-1, self.n)
        U, s, Vt = np.linalg.svd(self.matrix)
        rank = int((s > 1e-12 * s[:1]).sum()) if s.size else 0
        inverse = Vt[:rank].T @ (U[:, :rank] / s[:rank]).T
        f = rows @ inverse.T
        size = np.maximum(1.0, np.abs(rows).max(axis=1, initial=0.0))
        undriven = np.abs(rows - rows @ U[:, :rank] @ U[:, :rank].T).max(axis=1, initial=0.0) > ROUNDING * size
        missed = undriven.copy()
        for i in np.flatnonzero(~self._allowed(f).all(axis=1) | undriven):
            inside = None if undriven[i] else _least(f[i], Vt[rank:].T, self.lower, self.upper)
            missed[i] = inside is None
            f[i] = self._nearest(rows[i]) if inside is None else inside
        given = f @ self.matrix.T
        over = (np.abs(rows) > self.effort * (1.0 + ROUNDING)).any(axis=1)
        status, reason = ActuationStatus.SUCCESS, str(ActuationStatus.SUCCESS.value)
        for bad, kind in (
            (over, ActuationStatus.JOINT_LIMIT),
            (missed & ~undriven, ActuationStatus.FORCE_LIMIT),
            (undriven, ActuationStatus.UNDRIVEN),
        ):
            if bad.any():
                first = int(np.argmax(bad))
                status, reason = kind, f"{kind.value} ({self._at_fault(kind, rows[first], given[first])})"
        shape = tau.shape[:-1]
        return Actuation(
            forces=f.reshape(*shape, self.k),
            torques=given.reshape(tau.shape),
            residual=np.abs(given - rows).max(axis=1, initial=0.0).reshape(shape),
            feasible=~(over | missed).reshape(shape),
            status=status,
            reason=reason,
        )

    def reach(self, direction: ArrayLike) -> Array:
        """The largest s for which the torques ``s · direction (..., n)`` are within all limits; ``(...)``, maybe inf.

        With ``direction = Jᵀ F`` this is how strongly a frame can press with the wrench F. 0 where not even the
        smallest torque that way can be given.
        """
        d = as_shaped(direction, "direction", self.n)
        rows = d.reshape(-1, self.n)
        if not np.abs(rows).max(axis=1, initial=0.0).all():
            raise InputError("direction is zero: it is no direction")
        return np.array([self._reach(row) for row in rows]).reshape(d.shape[:-1])

    def _reach(self, d: Array) -> float:
        from scipy.optimize import linprog

        d = d / (size := float(np.abs(d).max()))
        most = float(np.min(np.where(d == 0.0, np.inf, self.effort) / np.where(d == 0.0, 1.0, np.abs(d))))
        objective = np.zeros(self.k + 1)
        objective[-1] = -1.0
        rows = np.column_stack([self.matrix, -d])
        scale = np.abs(rows).max(axis=1, keepdims=True)
        rows = rows[scale[:, 0] > 0.0] / scale[scale[:, 0] > 0.0]
        bounds = [*zip(self.lower, self.upper, strict=True), (0.0, most)]
        found = linprog(objective, A_eq=rows, b_eq=np.zeros(len(rows)), bounds=bounds, method="highs")
        if found.status == 3:  # unbounded
            return np.inf
        return float(found.x[-1]) / size if found.status == 0 else 0.0

    def _allowed(self, f: Array) -> BoolArray:
        slack = ROUNDING * np.maximum(1.0, np.abs(f).max(axis=-1, keepdims=True, initial=0.0))
        return np.asarray((f >= self.lower - slack) & (f <= self.upper + slack))

    def _nearest(self, torques: Array) -> Array:
        """Forces within the limits whose torques come nearest."""
        from scipy.optimize import lsq_linear

        f = np.clip(np.zeros(self.k), self.lower, self.upper)
        free = self.upper > self.lower
        if free.any():
            rest = torques - self.matrix[:, ~free] @ f[~free]
            bounds = (self.lower[free], self.upper[free])
            f[free] = lsq_linear(self.matrix[:, free], rest, bounds=bounds, method="bvls", tol=1e-14).x
        return f

    def _at_fault(self, kind: ActuationStatus, asked: Array, given: Array) -> str:
        """The joint that is farthest from what was asked of it, in numbers."""
        if kind is ActuationStatus.JOINT_LIMIT:
            j = int(np.argmax(np.abs(asked) - self.effort))
            return f"joint {self.joint_names[j]!r}: {asked[j]:.4g} asked, {self.effort[j]:.4g} allowed"
        j = int(np.argmax(np.abs(given - asked)))
        motors = [name for name, arm in zip(self.names, self.matrix[j], strict=True) if arm]
        shown = ", ".join(motors[:4]) + (", …" if len(motors) > 4 else "")
        driven = f"driven by {shown}" if motors else "driven by no motor"
        return f"joint {self.joint_names[j]!r}: {asked[j]:.4g} asked, {given[j]:.4g} given, {driven}"

    def __str__(self) -> str:
        width = max([5, *map(len, self.names)])
        lines = [f"{'motor':<{width}}  force               arms"]
        for name, low, high, arms in zip(self.names, self.lower, self.upper, self.matrix.T, strict=True):
            said = " ".join(f"{a:+.6g}·{j}" for a, j in zip(arms, self.joint_names, strict=True) if a)
            lines.append(f"{name:<{width}}  {f'[{low + 0.0:.4g}, {high:.4g}]':<18}  {said}")
        return "\n".join(lines)


def _arms(robot: Robot, rows: Sequence[Mapping[str, float]]) -> tuple[Array, Array]:
    """Matrix ``(n, k)`` of arms on the coordinates, and the offsets ``(k,)`` that mimicking joints bring."""
    matrix, offset = np.zeros((robot.n, len(rows))), np.zeros(len(rows))
    joints = {joint.name: joint for joint in robot.description.joints}
    for k, arms in enumerate(rows):
        for name, arm in arms.items():
            mimic = joints[name].mimic
            if joints[name].type is JointType.FIXED:
                continue
            if mimic is None:
                matrix[robot.index(name), k] += arm
            else:
                matrix[robot.index(mimic.joint), k] += arm * mimic.multiplier
                offset[k] += arm * mimic.offset
    return matrix, offset


def _least(f: Array, N: Array, lower: Array, upper: Array) -> Array | None:
    """The smallest ``f + N z`` between *lower* and *upper*, or None: least distance programming by Lawson and Hanson.

    *f* is orthogonal to the orthonormal columns of *N*, so that ‖f + N z‖² = ‖f‖² + ‖z‖².
    """
    from scipy.optimize import nnls

    if not N.shape[1]:
        return None
    bounded = np.isfinite(lower), np.isfinite(upper)
    G = np.vstack([N[bounded[0]], -N[bounded[1]]])
    h = np.concatenate([(lower - f)[bounded[0]], (f - upper)[bounded[1]]])
    size = max(float(np.abs(h).max()), 1e-300)
    E = np.vstack([G.T, h / size])
    target = np.zeros(len(E))
    target[-1] = 1.0
    u, _ = nnls(E, target)
    r = E @ u - target
    if abs(r[-1]) < 1e-10:
        return None
    return np.asarray(np.clip(f + N @ (-r[:-1] / r[-1] * size), lower, upper))
