"""Further limits of a timing: torque, power, and Cartesian speed and acceleration.

A constraint turns a path into rows ``lo ≤ A(s) u + B(s) x + C(s) ≤ hi`` in the path acceleration ``u = s̈`` and the
path speed squared ``x = ṡ²``. `time_optimal` asks for them at five places of every grid interval and takes A, B, C as
the quartics through them. How far these are off is proven for the constraints of this module: the fifth derivatives
are bounded over every interval (`kernels.jets`).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_vector
from ..conventions import GRAVITY
from ..errors import InputError
from ..kernels import jets

if TYPE_CHECKING:
    from ..kinematics import Robot
    from .path import Path, PolynomialPath

DIRECTIONS = 32
"""Sides of the polygon inside the disc of allowed Cartesian accelerations (0.5 % below the disc at worst)."""
QUARTIC_ERROR = 0.0035464
"""Largest ``|σ (σ − ¼) (σ − ½) (σ − ¾) (σ − 1)|`` on [0, 1]: times the fifth Taylor coefficient, the error of the
quartic through five even samples."""


@dataclass(frozen=True, eq=False)
class Rows:
    """``lower ≤ A u + B x + C ≤ upper`` at five places of N intervals for E rows.

    A, B, C ``(N, 5, E)``; bounds and names ``(E,)``. ``error (N, E, 3)`` are proven bounds of what A, B and C differ,
    anywhere in an interval, from the quartics through their five values; without them the errors are estimated.
    ``across (N, E, 2)`` is for rows that are parts of a vector of limited length: bounds of what A u and B x may have
    at right angles to all of them.
    """

    A: Array
    B: Array
    C: Array
    lower: Array
    upper: Array
    names: tuple[str, ...]
    error: Array | None = None
    across: Array | None = None


class Constraint(Protocol):
    """A limit that `time_optimal` can keep beyond those of velocity and acceleration."""

    def rows(self, path: PolynomialPath, s: Array) -> Rows:
        """Rows at the places ``s (N, 5)`` of a path: evenly spaced over N intervals, ends included."""


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
        _same_coordinates(self, path)
        A, B, C = dynamics_along(self.robot, path, s)
        names = tuple(f"torque of {name!r}" for name in self.robot.joint_names)
        return Rows(A, B, C, -self.effort, self.effort, names, _torque_error(self.robot, path, s, power=False))


def _same_coordinates(limit: TorqueLimits | PowerLimits | CartesianSpeed | CartesianAcceleration, path: Path) -> None:
    if path.n != limit.robot.n:
        raise InputError(
            f"the path has {path.n} coordinates; {type(limit).__name__} is for robot {limit.robot.name!r} with "
            f"{limit.robot.n}: {', '.join(limit.robot.joint_names)}"
        )


def dynamics_along(robot: Robot, path: PolynomialPath, s: Array) -> tuple[Array, Array, Array]:
    """``A, B, C (..., n)`` of ``τ = A s̈ + B ṡ² + C`` at ``s (...)``: three inverse dynamics per place."""
    q, dq, ddq = path(s), path(s, 1), path(s, 2)
    zero = np.zeros_like(q)
    first, second, gravity = robot.inverse_dynamics(
        np.stack([q, q, q]), np.stack([zero, dq, zero]), np.stack([dq, ddq, zero])
    )
    return first - gravity, second - gravity, gravity


def _torque_error(robot: Robot, path: PolynomialPath, s: Array, *, power: bool) -> Array:
    """Proven errors ``(N, n, 3)`` of the quartics through five samples of the dynamics (or of its power)."""
    grid = _grid(s)
    found = np.empty((s.shape[0], robot.n, 3, jets.ORDERS))
    jets.torque_jets(robot.model, GRAVITY, path.breaks, path.coefficients, grid, power, found)
    h = np.diff(grid)[:, None, None] ** (np.array([1.0, 2.0, 0.0]) + power)
    return np.asarray(QUARTIC_ERROR * found[..., 5] / h)


def _grid(s: Array) -> Array:
    """The grid whose intervals the places ``s (N, 5)`` divide."""
    return np.append(s[:, 0], s[-1, 4])


class PowerLimits:
    """Mechanical power of every joint ``|τ_j q̇_j|`` within *power* ``(n,)`` or a scalar, in watts.

    The limit ``τ_j q'_j ≤ P/√x`` is not convex, but each tangent of the right side in x is a limit that suffices;
    `time_optimal` keeps it by a sequence of timings, with the tangents at the speeds of the one before.
    """

    def __init__(self, robot: Robot, power: ArrayLike) -> None:
        self.robot = robot
        self.power = as_vector(power, "power", robot.n)
        if self.power.min() <= 0.0:
            j = int(self.power.argmin())
            raise InputError(f"power of {robot.joint_names[j]!r} is {self.power[j]:.6g}; expected a positive power")

    def rows(self, path: PolynomialPath, s: Array) -> Rows:
        """``τ_j q'_j``, the power per path speed, and its negative."""
        _same_coordinates(self, path)
        dq = path(s, 1)
        A, B, C = (np.concatenate([v * dq, -v * dq], axis=-1) for v in dynamics_along(self.robot, path, s))
        names = tuple(f"power of {name!r}" for name in self.robot.joint_names) * 2
        error = np.tile(_torque_error(self.robot, path, s, power=True), (1, 2, 1))
        limit = np.tile(self.power, 2)
        return Rows(A, B, C, np.full(limit.size, -np.inf), limit, names, error)


class CartesianSpeed:
    """Speed of *frame*: ``|v| ≤ linear`` (m/s) and ``|ω| ≤ angular`` (rad/s); ``None`` leaves one out."""

    def __init__(self, robot: Robot, frame: str, linear: float | None = None, angular: float | None = None) -> None:
        self.robot, self.frame = robot, frame
        self.limits = _positive(linear=linear, angular=angular)
        robot.frame_index(frame)

    def rows(self, path: PolynomialPath, s: Array) -> Rows:
        """``|v'|² x ≤ v²``, scaled to 1."""
        _same_coordinates(self, path)
        twist = np.einsum("...ij,...j->...i", self.robot.jacobian(path(s), self.frame), path(s, 1))
        B = np.stack([(twist[..., part] ** 2).sum(axis=-1) / v**2 for part, v, _ in self.limits], axis=-1)
        names = tuple(f"{name} speed of {self.frame!r}" for _, _, name in self.limits)
        found, h = _frame_jets(self.robot, self.frame, path, s)
        error = np.zeros((s.shape[0], len(names), 3))
        for e, (part, v, _) in enumerate(self.limits):
            jet = found[:, _JET[part.start]]
            fifth = 2.0 * (jet[:, 0] * jet[:, 5] + jet[:, 1] * jet[:, 4] + jet[:, 2] * jet[:, 3])
            error[:, e, 1] = QUARTIC_ERROR * fifth / (h * v) ** 2
        zero = np.zeros_like(B)
        return Rows(zero, B, zero, np.full(len(names), -np.inf), np.ones(len(names)), names, error)


class CartesianAcceleration:
    """Acceleration of *frame*: ``|v̇| ≤ linear`` (m/s²) and ``|ω̇| ≤ angular`` (rad/s²); ``None`` leaves one out.

    On every interval the disc of allowed accelerations in the plane of p' and p'' at its middle is replaced by a
    regular polygon inside it; what leaves that plane within the interval takes its share of the length.
    """

    def __init__(self, robot: Robot, frame: str, linear: float | None = None, angular: float | None = None) -> None:
        self.robot, self.frame = robot, frame
        self.limits = _positive(linear=linear, angular=angular)
        robot.frame_index(frame)

    def rows(self, path: PolynomialPath, s: Array) -> Rows:
        """Half-planes ``d·(p' u + p'' x) ≤ a cos(π/m)`` inside the disc."""
        from ..kinematics import acceleration

        _same_coordinates(self, path)
        q, dq, ddq = path(s), path(s, 1), path(s, 2)
        twists = np.einsum("...ij,...j->...i", self.robot.jacobian(q, self.frame), dq)
        bends = acceleration(self.robot, q, dq, ddq, self.frame)
        angles = 2.0 * np.pi * np.arange(DIRECTIONS // 2) / DIRECTIONS
        wheel = np.stack([np.cos(angles), np.sin(angles)])
        found, h = _frame_jets(self.robot, self.frame, path, s)
        A, B, errors, beside, bounds, names = [], [], [], [], [], []
        for part, limit, name in self.limits:
            axes = _plane(twists[:, 2, part], bends[:, 2, part])
            first, second = (np.einsum("nki,nai->nka", v[..., part], axes) for v in (twists, bends))
            A.append(first[..., :2] @ wheel)
            B.append(second[..., :2] @ wheel)
            jet = _JET[part.start]
            error = QUARTIC_ERROR * np.stack([found[:, jet, 5] / h, found[:, jet + 2, 5] / h**2], axis=-1)
            # what is across the plane: the Bernstein coefficients of its quartics, and their own errors
            across = np.stack([np.abs(BERNSTEIN @ v[..., 2:]).max(axis=(1, 2)) for v in (first, second)], axis=-1)
            whole = np.concatenate([error, np.zeros((h.size, 1))], axis=-1)
            errors.append(np.repeat(whole[:, None], angles.size, axis=1))
            beside.append(np.repeat((across + error)[:, None], angles.size, axis=1))
            bounds.append(np.full(angles.size, limit * np.cos(np.pi / DIRECTIONS)))
            names += [f"{name} acceleration of {self.frame!r}"] * angles.size
        a, b, limit_rows = np.concatenate(A, axis=-1), np.concatenate(B, axis=-1), np.concatenate(bounds)
        error, across = np.concatenate(errors, axis=1), np.concatenate(beside, axis=1)
        return Rows(a, b, np.zeros_like(a), -limit_rows, limit_rows, tuple(names), error, across)


BERNSTEIN = np.linalg.inv([[comb(4, k) * x**k * (1.0 - x) ** (4 - k) for k in range(5)] for x in np.arange(5) / 4.0])
"""Bernstein coefficients of the quartic through five even samples."""

_JET = {0: 1, 3: 0}
"""Place in `jets.frame_jets` of the velocity that begins at this row of a twist; its acceleration is two further."""


def _frame_jets(robot: Robot, frame: str, path: PolynomialPath, s: Array) -> tuple[Array, Array]:
    """Jets ``(N, 4, 6)`` of the frame's motion, and the lengths ``(N,)`` of the intervals."""
    grid = _grid(s)
    found = np.empty((s.shape[0], 4, jets.ORDERS))
    jets.frame_jets(robot.chain_model(frame), path.breaks, path.coefficients, grid, found)
    return found, np.diff(grid)


def _plane(first: Array, second: Array) -> Array:
    """Orthonormal axes ``(N, 3, 3)`` as rows: along *first* ``(N, 3)``, then towards *second*, then across."""
    axes = np.stack([first, second, np.zeros_like(first)], axis=1)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    size = np.linalg.norm(axes, axis=-1)
    flat = size[:, 2] <= 1e-9 * size[:, 0] * size[:, 1]  # parallel, or one is zero: any plane through the longer one
    longer = np.where((size[:, 0] >= size[:, 1])[:, None], axes[:, 0], axes[:, 1])
    longer = np.where((np.abs(longer).max(axis=-1) > 0.0)[:, None], longer, [1.0, 0.0, 0.0])
    other = np.eye(3)[np.abs(longer).argmin(axis=-1)]
    axes[:, 0] = np.where(flat[:, None], longer, axes[:, 0])
    axes[:, 2] = np.where(flat[:, None], np.cross(longer, other), axes[:, 2])
    axes[:, 1] = np.cross(axes[:, 2], axes[:, 0])
    return np.asarray(axes / np.linalg.norm(axes, axis=-1, keepdims=True))


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
