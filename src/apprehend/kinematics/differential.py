"""Velocities, accelerations and statics of a frame: what follows from the Jacobian and its rate (G 1.7, 1.10; K)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped, choice
from ..errors import InputError
from ..kernels import single as kernels
from ..result import Result, Status
from ..spatial import euler, se3, so3
from . import dynamics

if TYPE_CHECKING:
    from .robot import Robot

REFERENCES = ("spatial", "body", "mixed")
"""Names of the three Jacobians, in the order of the kernels' numbers."""


def jacobian_derivative(
    robot: Robot, q: ArrayLike, qd: ArrayLike, frame: str, reference: str = "mixed"
) -> tuple[Array, Array]:
    """Jacobian and its time derivative along q̇, both ``(..., 6, n)``; q and q̇ ``(..., n)`` broadcast.

    Spatial: ξ̇ = V × ξ with the velocity V of what carries the joint. Body: J_b = Ad(T⁻¹) J_s, so
    J̇_b = Ad(T⁻¹) (J̇_s − ad(V) J_s). Mixed: v_m = v_s + ω × p, so v̇_m = v̇_s + ω̇ × p + ω × ṗ.
    """
    choice(reference, "reference", REFERENCES)
    shape, (rows, rates) = robot.read_rows(q=q, qd=qd)
    count = math.prod(shape)
    J, dJ = np.empty((2, count, 6, robot.n))
    T = np.empty((count, 4, 4))
    as_shaped(q, "q", robot.n)
    as_shaped(qd, "qd", robot.n)
    kernels.chain_rates(robot.chain_model(frame), rows, rates, J, dJ, T)
    if reference != "spatial":
        V = np.einsum("nij,nj->ni", J, rates)
        if reference == "body":
            X = se3.adjoint(se3.inverse(T))
            J, dJ = X @ J, X @ (dJ - se3.bracket(V) @ J)
        else:
            p = T[:, :3, 3]
            dp = V[:, :3] + np.cross(V[:, 3:], p)
            Px, dPx = so3.hat(p), so3.hat(dp)
            dJ[:, :3] -= Px @ dJ[:, 3:] + dPx @ J[:, 3:]
            J[:, :3] -= Px @ J[:, 3:]
    return J.reshape(*shape, 6, robot.n), dJ.reshape(*shape, 6, robot.n)


def com_jacobian(robot: Robot, q: ArrayLike) -> Array:
    """Jacobian ``(..., 3, n)`` of the centre of mass: ċ = J q̇.

    Its row k is what holds the robot, per kg, if it falls along −k: the torques of a uniform acceleration.
    """
    check_mass(robot)
    shape, (rows,) = robot.read_rows(q=q)
    as_shaped(q, "q", robot.n)
    out = np.empty((3, len(rows), robot.n))
    for k in range(3):
        dynamics.inverse_dynamics(robot.model, rows, dynamics.NONE, dynamics.NONE, out[k], -np.eye(3)[k])
    return np.moveaxis(out / robot.mass, 0, 1).reshape(*shape, 3, robot.n)


def com_jacobian_derivative(robot: Robot, q: ArrayLike, qd: ArrayLike) -> tuple[Array, Array]:
    """`com_jacobian` and its time derivative along q̇, both ``(..., 3, n)``: of each link's centre r in its frame's axes
    of the world, J_v − r̂ J_ω and J̇_v − r̂ J̇_ω − (ω × r)^ J_ω, weighted by mass.
    """
    check_mass(robot)
    shape = np.broadcast_shapes(np.shape(q)[:-1], np.shape(qd)[:-1])
    value, rate = np.zeros((2, *shape, 3, robot.n))
    for name, link in robot.description.links.items():
        if link.inertial is None or link.inertial.mass == 0.0 or not robot.chain(name):
            continue
        J, dJ = jacobian_derivative(robot, q, qd, name)
        r = robot.fk(q, name)[..., :3, :3] @ link.inertial.com
        turning = np.einsum("...ij,...j->...i", J[..., 3:, :], as_shaped(qd, "qd", robot.n))
        share = link.inertial.mass / robot.mass
        value += share * (J[..., :3, :] - so3.hat(r) @ J[..., 3:, :])
        bent = so3.hat(np.cross(turning, r)) @ J[..., 3:, :]
        rate += share * (dJ[..., :3, :] - so3.hat(r) @ dJ[..., 3:, :] - bent)
    return value, rate


def check_mass(robot: Robot) -> None:
    """`InputError` if no link has a mass: there is no centre then."""
    if robot.mass <= 0.0:
        raise InputError(f"robot {robot.name!r} has no mass: its description gives no link an inertia")


def velocity(robot: Robot, q: ArrayLike, qd: ArrayLike, frame: str, reference: str = "mixed") -> Array:
    """Twist ``V = J q̇ (..., 6)`` of *frame*."""
    J = robot.jacobian(q, frame, reference)
    return np.asarray(np.einsum("...ij,...j->...i", J, as_shaped(qd, "qd", robot.n)))


def acceleration(
    robot: Robot, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, frame: str, reference: str = "mixed"
) -> Array:
    """``V̇ = J q̈ + J̇ q̇ (..., 6)`` of *frame*: with ``"mixed"``, acceleration of its origin and angular acceleration."""
    J, dJ = jacobian_derivative(robot, q, qd, frame, reference)
    rate, second = as_shaped(qd, "qd", robot.n), as_shaped(qdd, "qdd", robot.n)
    return np.asarray(np.einsum("...ij,...j->...i", J, second) + np.einsum("...ij,...j->...i", dJ, rate))


def rpy_jacobian(robot: Robot, q: ArrayLike, frame: str) -> Array:
    """Analytic Jacobian ``(..., 6, n)`` of (x, y, z, roll, pitch, yaw) (K): rates of the angles instead of ω.

    Angles are those of `Rotation.rpy`, R = R_z(γ) R_y(β) R_x(α), so ω = E (α̇, β̇, γ̇) with the columns R_z R_y x,
    R_z y, z of E. E is singular at pitch ±90°, where the analytic Jacobian does not exist: `InputError`.
    """
    T, J = robot.fk_jacobian(q, frame)
    inverse, _ = _rpy_rates(_rpy(T, frame))
    out = J.copy()
    out[..., 3:, :] = inverse @ J[..., 3:, :]
    return out


def rpy_jacobian_derivative(robot: Robot, q: ArrayLike, qd: ArrayLike, frame: str) -> tuple[Array, Array]:
    """`rpy_jacobian` and its time derivative along q̇, both ``(..., 6, n)``: d(E⁻¹ J_ω)/dt by the product rule."""
    J, dJ = jacobian_derivative(robot, q, qd, frame)
    angles = _rpy(robot.fk(q, frame), frame)
    inverse, _ = _rpy_rates(angles)
    out, rate = J.copy(), dJ.copy()
    out[..., 3:, :] = inverse @ J[..., 3:, :]
    turning = np.einsum("...ij,...j->...i", out[..., 3:, :], as_shaped(qd, "qd", robot.n))
    _, change = _rpy_rates(np.broadcast_to(angles, turning.shape), turning)
    rate[..., 3:, :] = change @ J[..., 3:, :] + inverse @ dJ[..., 3:, :]
    return out, rate


def _rpy(T: Array, frame: str) -> Array:
    """Roll, pitch and yaw ``(..., 3)``; `InputError` where the analytic Jacobian does not exist."""
    angles = euler.from_matrix(T[..., :3, :3], "xyz", "extrinsic")
    if (np.abs(np.cos(angles[..., 1])) < 1e-9).any():
        raise InputError(
            f"q puts frame {frame!r} at a pitch of ±90°, where roll and yaw are not determined and the analytic "
            "Jacobian does not exist; use jacobian(), which has no such points"
        )
    return angles


def _rpy_rates(angles: Array, rates: Array | None = None) -> tuple[Array, Array]:
    """E⁻¹ ``(..., 3, 3)`` from ω to the rates of roll, pitch and yaw, and its derivative along *rates* ``(..., 3)``."""
    c, s = np.cos(angles[..., 2]), np.sin(angles[..., 2])
    secant, tangent = 1.0 / np.cos(angles[..., 1]), np.tan(angles[..., 1])
    zero, one = np.zeros_like(c), np.ones_like(c)
    value = [[c * secant, s * secant, zero], [-s, c, zero], [c * tangent, s * tangent, one]]
    pitch, yaw = (zero, zero) if rates is None else (rates[..., 1], rates[..., 2])
    bend, slope = secant * tangent * pitch, secant**2 * pitch
    change = [
        [c * bend - s * secant * yaw, s * bend + c * secant * yaw, zero],
        [-c * yaw, -s * yaw, zero],
        [c * slope - s * tangent * yaw, s * slope + c * tangent * yaw, zero],
    ]
    return _stacked(value), _stacked(change)


def _stacked(rows: list[list[Array]]) -> Array:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def joint_torques(robot: Robot, q: ArrayLike, frame: str, wrench: ArrayLike, reference: str = "mixed") -> Array:
    """``τ = Jᵀ F (..., n)`` (G 1.10): joint torques with which *frame* presses on its surroundings with *wrench*.

    *wrench* ``(..., 6)`` is (f, τ) in the frame of the Jacobian of that *reference*. Gravity is not included.
    """
    J = robot.jacobian(q, frame, reference)
    return np.asarray(np.einsum("...ij,...i->...j", J, as_shaped(wrench, "wrench", 6)))


class StaticsStatus(Status):
    """Outcomes of `frame_wrench`."""

    SUCCESS = "the wrench is determined by the torques"
    UNDETERMINED = "some wrenches reach no joint (singular or few joints): the smallest of the possible ones is given"
    UNBALANCED = "no wrench on the frame balances these torques: the robot would move; the nearest one is given"


@dataclass(frozen=True, eq=False)
class StaticsResult(Result):
    """Answer of `frame_wrench`; arrays have the batch shape in front, and *status* is the worst of the batch."""

    wrench: Array  # (..., 6)
    residual: Array  # (...), largest |Jᵀ F − τ| over the joints
    rank: Array  # (...), of the Jacobian
    status: StaticsStatus


def frame_wrench(
    robot: Robot, q: ArrayLike, frame: str, torques: ArrayLike, reference: str = "mixed", tolerance: float = 1e-9
) -> StaticsResult:
    """The wrench F with ``Jᵀ F = τ``: what a *frame* that is held fixed presses with under joint *torques* (K).

    The least-squares solution of least norm; *tolerance* is relative, for the rank and for the balance.
    """
    J = robot.jacobian(q, frame, reference)
    tau = as_shaped(torques, "torques", robot.n)
    shape = np.broadcast_shapes(J.shape[:-2], tau.shape[:-1])
    Jt = np.broadcast_to(np.swapaxes(J, -1, -2), (*shape, robot.n, 6))
    tau = np.broadcast_to(tau, (*shape, robot.n))
    U, s, Vt = np.linalg.svd(Jt, full_matrices=False)
    kept = s > tolerance * s[..., :1]
    inverse = np.where(kept, 1.0 / np.where(kept, s, 1.0), 0.0)
    F = np.einsum("...ji,...j->...i", Vt, inverse * np.einsum("...ij,...i->...j", U, tau))
    residual = np.abs(np.einsum("...ij,...j->...i", Jt, F) - tau).max(axis=-1, initial=0.0)
    rank = kept.sum(axis=-1)
    status = StaticsStatus.SUCCESS
    if (residual > tolerance * np.maximum(1.0, np.abs(tau).max(axis=-1, initial=0.0))).any():
        status = StaticsStatus.UNBALANCED
    elif (rank < 6).any():
        status = StaticsStatus.UNDETERMINED
    return StaticsResult(wrench=F, residual=residual, rank=rank, status=status)
