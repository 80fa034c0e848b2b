"""Closed chains: the constraints of loops that were cut, their Jacobians, and postures that close them.

A description read with ``loops="cut"`` lists what was cut as `Loop`. Each becomes a `LoopConstraint` c(q) = 0 in the
coordinates of the tree. With the relative pose T = T_first⁻¹ T_second = (R, p) of the two frames that must meet, c is
p for a point, log(T) for a pose, (p, the part of R a across a) for a hinge about a, and (the part of p across a,
log R) for a slider along a. Body twists of T give the Jacobian.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, as_shaped
from ..errors import InputError
from ..result import Result, Status
from ..robots.description import Loop
from ..spatial import se3, so3

if TYPE_CHECKING:
    from .robot import Robot

SINGULAR = 1e-10
"""Singular values of the constraints' Jacobian below this share of the largest count as zero."""


class LoopConstraint:
    """One cut loop of a robot; `residual` is zero where it is closed."""

    def __init__(self, robot: Robot, loop: Loop) -> None:
        self.robot, self.loop, self.name = robot, loop, loop.name
        self._first, self._second = se3.inverse(loop.T_first), se3.inverse(loop.T_second)

    @property
    def size(self) -> int:
        """Number of equations: 3 for a point, 6 for a pose, 5 for a hinge or a slider."""
        return {"point": 3, "pose": 6}.get(self.loop.free, 5)

    @cached_property
    def _across(self) -> Array:
        """Two unit vectors ``(2, 3)`` that are orthogonal to the axis and to each other."""
        _, _, Vt = np.linalg.svd(np.asarray(self.loop.axis)[None])
        return np.asarray(Vt[1:])

    def relative(self, q: ArrayLike) -> Array:
        """T = T_first⁻¹ T_second ``(..., 4, 4)``."""
        A = self.robot.fk(q, self.loop.first) @ self.loop.T_first
        B = self.robot.fk(q, self.loop.second) @ self.loop.T_second
        return np.asarray(se3.inverse(A) @ B)

    def residual(self, q: ArrayLike) -> Array:
        """c(q) ``(..., size)``: m, and rad (or the sine of the angle between the axes, for a hinge)."""
        T = self.relative(q)
        p, R = T[..., :3, 3], T[..., :3, :3]
        free = self.loop.free
        if free == "point":
            return p.copy()
        if free == "pose":
            return se3.log(T)
        if free == "prismatic":
            return np.concatenate([p @ self._across.T, so3.log(R)], axis=-1)
        return np.concatenate([p, R @ self.loop.axis @ self._across.T], axis=-1)

    def jacobian(self, q: ArrayLike) -> Array:
        """∂c/∂q ``(..., size, n)``."""
        T = self.relative(q)
        R = T[..., :3, :3]
        first = se3.adjoint(self._first) @ self.robot.jacobian(q, self.loop.first, "body")
        second = se3.adjoint(self._second) @ self.robot.jacobian(q, self.loop.second, "body")
        V = second - se3.adjoint(se3.inverse(T)) @ first  # body twist of T for each q̇
        free = self.loop.free
        if free == "pose":
            return np.asarray(np.linalg.solve(se3.left_jacobian(-se3.log(T)), V))
        linear = R @ V[..., :3, :]
        if free == "point":
            return np.asarray(linear)
        if free == "prismatic":
            turning = np.linalg.solve(so3.left_jacobian(-so3.log(R)), V[..., 3:, :])
            return np.concatenate([self._across @ linear, turning], axis=-2)
        turning = -self._across @ R @ so3.hat(self.loop.axis) @ V[..., 3:, :]
        return np.concatenate([linear, turning], axis=-2)

    def value(self, q: ArrayLike) -> Array:
        """Value ``(...)`` of the joint that was cut, a hinge (rad) or a slider (m), where the loop is closed."""
        axis = self.loop.axis
        if self.loop.free == "prismatic":
            return np.asarray(self.relative(q)[..., :3, 3] @ axis)
        if self.loop.free in ("revolute", "continuous"):
            return np.asarray(so3.log(self.relative(q)[..., :3, :3]) @ axis)
        raise InputError(f"loop {self.name!r} was cut at a {self.loop.free}, which has no joint value")

    def __repr__(self) -> str:
        return f"<LoopConstraint {self.name!r}: {self.loop.first} – {self.loop.second}, {self.size} equations>"


class LoopStatus(Status):
    """Outcomes of `close_loops`."""

    SUCCESS = "every loop is closed"
    OPEN = "the loops cannot be closed from here: the steps came to rest at a posture where they are nearest to closing"
    LIMIT = "the loops close, but beyond the limits of a joint"


@dataclass(frozen=True, eq=False)
class LoopResult(Result):
    """Answer of `close_loops`; arrays have the batch shape in front, *status* is the worst of the batch."""

    q: Array  # (..., n)
    residual: Array  # (...), largest entry of all constraints
    closed: BoolArray  # (...)
    within: BoolArray  # (...), whether all joints are within their limits
    status: LoopStatus
    reason: str

    def explain(self) -> str:
        """The status, with the loop or the joint at fault."""
        return self.reason


def loop_residual(robot: Robot, q: ArrayLike) -> Array:
    """All constraints of the robot's loops, stacked ``(..., Σ size)``."""
    return np.concatenate([loop.residual(q) for loop in _loops(robot)], axis=-1)


def loop_jacobian(robot: Robot, q: ArrayLike) -> Array:
    """Their Jacobian ``(..., Σ size, n)``: velocities that keep the loops closed have J q̇ = 0."""
    return np.concatenate([loop.jacobian(q) for loop in _loops(robot)], axis=-2)


def loop_motions(robot: Robot, q: ArrayLike) -> Array:
    """Orthonormal joint velocities ``(n, k)`` that keep the loops closed at ``q (n,)``; k is the mobility there."""
    vector = as_shaped(q, "q", robot.n)
    if vector.ndim != 1:
        raise InputError(f"q has shape {vector.shape}; motions belong to one configuration ({robot.n},)")
    _, s, Vt = np.linalg.svd(loop_jacobian(robot, vector))
    rank = int((s > SINGULAR * s[:1]).sum())
    return np.asarray(Vt[rank:].T)


def close_loops(
    robot: Robot, q: ArrayLike, hold: Iterable[str] = (), *, tolerance: float = 1e-12, max_steps: int = 100
) -> LoopResult:
    """The posture near ``q (..., n)`` at which every loop is closed, the joints *hold* staying where they are.

    Newton's steps of least norm, shortened while they do not help; *tolerance* bounds the largest entry of the
    residual. Joint limits are not enforced: what lies beyond them is told.
    """
    start = as_shaped(q, "q", robot.n)
    held = [robot.index(name) for name in hold]
    moving = np.setdiff1d(np.arange(robot.n), held)
    rows = np.array([_newton(robot, row, moving, tolerance, max_steps) for row in start.reshape(-1, robot.n)])
    rows = rows.reshape(-1, robot.n)
    parts = [np.abs(loop.residual(rows)).max(axis=-1) for loop in _loops(robot)]
    residual = np.max(parts, axis=0)
    aligned = np.all([_aligned(loop, rows) for loop in _loops(robot)], axis=0)
    closed = np.asarray((residual <= tolerance) & aligned)
    low, high = robot.limits.lower, robot.limits.upper
    within = np.asarray(((rows >= low - 1e-9) & (rows <= high + 1e-9)).all(axis=1))
    status, reason = LoopStatus.SUCCESS, str(LoopStatus.SUCCESS.value)
    if not closed.all():
        i = int(np.argmin(closed))
        worst = int(np.argmax([part[i] for part in parts]))
        status = LoopStatus.OPEN
        reason = f"{status.value} (loop {_loops(robot)[worst].name!r} is open by {residual[i]:.3g})"
    elif not within.all():
        i = int(np.argmin(within))
        j = int(np.argmax(np.maximum(low - rows[i], rows[i] - high)))
        status = LoopStatus.LIMIT
        reason = (
            f"{status.value} (joint {robot.joint_names[j]!r}: {rows[i, j]:.4g} not in [{low[j]:.4g}, {high[j]:.4g}])"
        )
    shape = start.shape[:-1]
    return LoopResult(
        rows.reshape(start.shape),
        residual.reshape(shape),
        np.reshape(closed, shape),
        np.reshape(within, shape),
        status,
        reason,
    )


def _newton(robot: Robot, start: Array, moving: Array, tolerance: float, max_steps: int) -> Array:
    q = start.copy()
    c = loop_residual(robot, q)
    for _ in range(max_steps):
        if np.abs(c).max() <= 0.01 * tolerance:
            break
        step = np.zeros(robot.n)
        step[moving] = -np.linalg.lstsq(loop_jacobian(robot, q)[:, moving], c, rcond=SINGULAR)[0]
        longest = float(np.abs(step).max(initial=0.0))
        share = min(1.0, 1.0 / longest) if longest > 0.0 else 0.0
        while share > 1e-6:
            tried = loop_residual(robot, q + share * step)
            if np.linalg.norm(tried) < np.linalg.norm(c):
                break
            share *= 0.5
        else:
            break
        q, c = q + share * step, tried
    return q


def _aligned(loop: LoopConstraint, q: Array) -> BoolArray:
    """Whether the axes of a hinge point the same way, where its residual would also vanish the other way round."""
    if loop.loop.free not in ("revolute", "continuous"):
        return np.ones(len(q), dtype=bool)
    R = loop.relative(q)[..., :3, :3]
    return np.asarray((R @ loop.loop.axis) @ loop.loop.axis > 0.0)


def _loops(robot: Robot) -> tuple[LoopConstraint, ...]:
    if not robot.loops:
        raise InputError(f"robot {robot.name!r} has no loops; read a description that closes chains with loops='cut'")
    return robot.loops
