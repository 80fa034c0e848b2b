"""Further limits of a timing: torque, power, and Cartesian speed and acceleration.

A constraint turns a path into rows ``lo ≤ A(s) u + B(s) x + C(s) ≤ hi`` in the path acceleration ``u = s̈`` and the
path speed squared ``x = ṡ²``. `time_optimal` samples them on its grid and accounts for what happens in between.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_vector
from ..errors import InputError

if TYPE_CHECKING:
    from ..kinematics import Robot
    from .path import PolynomialPath

DIRECTIONS = 48
"""Sides of the polygon inside the disc of allowed Cartesian accelerations (0.2 % below the disc at worst)."""


@dataclass(frozen=True, eq=False)
class Rows:
    """``lower ≤ A u + B x + C ≤ upper`` at M samples for E rows: A, B, C ``(M, E)``; bounds and names ``(E,)``."""

    A: Array
    B: Array
    C: Array
    lower: Array
    upper: Array
    names: tuple[str, ...]


class Constraint(Protocol):
    """A limit that `time_optimal` can keep beyond those of velocity and acceleration."""

    def rows(self, path: PolynomialPath, s: Array) -> Rows:
        """Rows at the places ``s (M,)`` of a path."""


class TorqueLimits:
    """Joint torques (forces) within ±*effort* by the full dynamics: ``τ = M(q) q̈ + C(q, q̇) q̇ + g(q)`` (T, G 1.9).

    Along a path ``τ = A u + B x + C`` with ``A = M q'``, ``B = M q'' + C(q, q') q'``, ``C = g``. *effort* is ``(n,)``
    or a scalar, by default the robot's own; *margin* is the share of it that is left unused.
    """

    def __init__(self, robot: Robot, effort: ArrayLike | None = None, *, margin: float = 0.0) -> None:
        self.robot = robot
        if not 0.0 <= margin < 1.0:
            raise InputError(f"margin is {margin}; expected a share of the torque from 0 to below 1")
        effort = as_vector(robot.limits.effort if effort is None else effort, "effort", robot.n)
        if effort.min() <= 0.0:
            j = int(effort.argmin())
            raise InputError(f"effort of {robot.joint_names[j]!r} is {effort[j]:.6g}; expected a positive torque")
        if not np.isfinite(effort).any():
            raise InputError("effort is infinite for every joint; give the torques that the drives can produce")
        self.effort = effort * (1.0 - margin)

    def rows(self, path: PolynomialPath, s: Array) -> Rows:
        """The dynamics along the path."""
        A, B, C = dynamics_along(self.robot, path, s)
        names = tuple(f"torque of {name!r}" for name in self.robot.joint_names)
        return Rows(A, B, C, -self.effort, self.effort, names)


def dynamics_along(robot: Robot, path: PolynomialPath, s: Array) -> tuple[Array, Array, Array]:
    """``A, B, C (M, n)`` of ``τ = A s̈ + B ṡ² + C``: three inverse dynamics per sample."""
    q, dq, ddq = path(s), path(s, 1), path(s, 2)
    zero = np.zeros_like(q)
    tau = robot.inverse_dynamics(
        np.concatenate([q, q, q]), np.concatenate([zero, dq, zero]), np.concatenate([dq, ddq, zero])
    )
    first, second, gravity = np.split(tau, 3)
    return first - gravity, second - gravity, gravity


class PowerLimits:
    """Mechanical power of every joint ``|τ_j q̇_j|`` within *power* ``(n,)`` or a scalar, in watts.

    The limit is not convex in the speed; `time_optimal` keeps it by a sequence of timings, each within the limit, in
    which the speed of the one before bounds the speed of the next.
    """

    def __init__(self, robot: Robot, power: ArrayLike) -> None:
        self.robot = robot
        self.power = as_vector(power, "power", robot.n)
        if self.power.min() <= 0.0:
            j = int(self.power.argmin())
            raise InputError(f"power of {robot.joint_names[j]!r} is {self.power[j]:.6g}; expected a positive power")

    def rows(self, path: PolynomialPath, s: Array) -> Rows:
        """``τ_j q'_j``: the power per path speed."""
        A, B, C = dynamics_along(self.robot, path, s)
        dq = path(s, 1)
        names = tuple(f"power of {name!r}" for name in self.robot.joint_names)
        return Rows(A * dq, B * dq, C * dq, -self.power, self.power, names)


class CartesianSpeed:
    """Speed of *frame*: ``|v| ≤ linear`` (m/s) and ``|ω| ≤ angular`` (rad/s); ``None`` leaves one out."""

    def __init__(self, robot: Robot, frame: str, linear: float | None = None, angular: float | None = None) -> None:
        self.robot, self.frame = robot, frame
        self.limits = _positive(linear=linear, angular=angular)
        robot.frame_index(frame)

    def rows(self, path: PolynomialPath, s: Array) -> Rows:
        """``|v'|² x ≤ v²``, scaled to 1."""
        twist = np.einsum("mij,mj->mi", self.robot.jacobian(path(s), self.frame), path(s, 1))
        B = np.stack([(twist[:, part] ** 2).sum(axis=1) / v**2 for part, v, _ in self.limits], axis=1)
        names = tuple(f"{name} speed of {self.frame!r}" for _, _, name in self.limits)
        return Rows(np.zeros_like(B), B, np.zeros_like(B), np.full(len(names), -np.inf), np.ones(len(names)), names)


class CartesianAcceleration:
    """Acceleration of *frame*: ``|v̇| ≤ linear`` (m/s²) and ``|ω̇| ≤ angular`` (rad/s²); ``None`` leaves one out.

    The disc of allowed ``p' u + p'' x`` is replaced by a regular polygon inside it in the plane of p' and p''.
    """

    def __init__(self, robot: Robot, frame: str, linear: float | None = None, angular: float | None = None) -> None:
        self.robot, self.frame = robot, frame
        self.limits = _positive(linear=linear, angular=angular)
        robot.frame_index(frame)

    def rows(self, path: PolynomialPath, s: Array) -> Rows:
        """Half-planes ``d·(p' u + p'' x) ≤ a cos(π/m)`` around the disc's inside."""
        q, dq, ddq = path(s), path(s, 1), path(s, 2)
        jacobian = self.robot.jacobian(q, self.frame)
        first = np.einsum("mij,mj->mi", jacobian, dq)
        second = np.einsum("mij,mj->mi", jacobian, ddq) + _bend(self.robot, self.frame, q, dq)
        angles = 2.0 * np.pi * np.arange(DIRECTIONS // 2) / DIRECTIONS
        A, B, bounds, names = [], [], [], []
        for part, limit, name in self.limits:
            # coordinates in the plane: along p', and the part of p'' across it
            size = np.linalg.norm(first[:, part], axis=1)
            along = np.divide(
                (first[:, part] * second[:, part]).sum(axis=1), size, out=np.zeros_like(size), where=size > 0
            )
            across = np.sqrt(np.maximum((second[:, part] ** 2).sum(axis=1) - along**2, 0.0))
            A.append(size[:, None] * np.cos(angles))
            B.append(along[:, None] * np.cos(angles) + across[:, None] * np.sin(angles))
            bounds.append(np.full(angles.size, limit * np.cos(np.pi / DIRECTIONS)))
            names += [f"{name} acceleration of {self.frame!r}"] * angles.size
        a, b, limit_rows = np.concatenate(A, axis=1), np.concatenate(B, axis=1), np.concatenate(bounds)
        return Rows(a, b, np.zeros_like(a), -limit_rows, limit_rows, tuple(names))


def _bend(robot: Robot, frame: str, q: Array, dq: Array) -> Array:
    """``(dJ/ds) q'`` with the Jacobian moved along q' (fourth-order differences; error about 1e-11)."""
    step = 1e-3 / np.maximum(np.abs(dq).max(axis=1, keepdims=True), 1e-12)
    total = np.zeros((q.shape[0], 6))
    for shift, weight in ((1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)):
        moved = robot.jacobian(q + shift * step * dq, frame)
        total += weight * np.einsum("mij,mj->mi", moved, dq)
    result: Array = total / (12.0 * step)
    return result


def _positive(**limits: float | None) -> list[tuple[slice, float, str]]:
    found = []
    for name, part in (("linear", slice(0, 3)), ("angular", slice(3, 6))):
        value = limits[name]
        if value is None:
            continue
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name} is {value}; expected a positive limit, or None for no limit")
        found.append((part, float(value), name))
    if not found:
        raise InputError("give a linear limit, an angular limit, or both")
    return found
