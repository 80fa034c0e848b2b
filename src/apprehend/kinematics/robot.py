"""`Robot`: what computes with a description. Joint vectors in, poses, Jacobians and torques out, batched."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_pose, as_shaped, choice, is_complex
from ..errors import InputError, expect, unknown_name
from ..kernels import chain as chain_kernels
from ..kernels import single as single_kernels
from ..kernels import tree as tree_kernels
from ..kernels.chain import ChainModel
from ..kernels.coriolis import coriolis_matrix
from ..kernels.tree import TreeModel
from ..robots.description import Description, JointType
from . import differential, dynamics, memory
from .loops import LoopConstraint
from .model import chain_model, frame_names, tree_model
from .transmission import Transmission

GRAIN = 2048
"""Smallest share of a batch that is worth a thread."""

_NO_JACOBIAN = np.empty((0, 0))
_NO_POSES = np.empty((0, 16))


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of the n coordinates: rad or m, per s, per s², N m or N; infinite where the description gives none.

    They are those of the driving joint: what a mimicking joint states for itself does not tighten them.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    effort: Array

    def contains(self, q: ArrayLike, margin: float = 0.0) -> Any:
        """Whether ``q (..., n)`` stays *margin* inside the position limits; a boolean for each leading index."""
        q = as_shaped(q, "q", self.lower.size)
        return ((q >= self.lower + margin) & (q <= self.upper - margin)).all(axis=-1)

    def clip(self, q: ArrayLike) -> Array:
        """The nearest joint vector within the position limits."""
        clipped: Array = np.clip(as_shaped(q, "q", self.lower.size), self.lower, self.upper)
        return clipped


class Robot:
    """A kinematic tree with n free coordinates: arms, hands, several arms with hands.

    Joint vectors are ``(..., n)`` in the order of `joint_names` (free joints in tree order: neither fixed nor
    mimicking). Poses are T_world_frame ``(..., 4, 4)``; the world is the root link unless the robot was `placed`.
    Gravity is 9.81 m/s² along −z of the world. A robot is a value: nothing changes it.
    """

    description: Description
    name: str
    n: int
    joint_names: tuple[str, ...]
    frame_names: tuple[str, ...]
    base: Array
    model: TreeModel

    def __init__(self, description: Description, *, base: ArrayLike | None = None) -> None:
        self.description = description
        self.name = description.name
        self.base = np.eye(4) if base is None else as_pose(base, "base").copy()
        self.base.flags.writeable = False
        if self.base.shape != (4, 4):
            raise InputError(f"base has shape {self.base.shape}; expected (4, 4)")
        self.model = tree_model(description, self.base)
        free = description.free_joints
        self.n = len(free)
        self.joint_names = tuple(joint.name for joint in free)
        self.frame_names = frame_names(description)
        self._chains: dict[str, ChainModel] = {}

    @classmethod
    def load(cls, source: str | Path, **options: Any) -> Self:
        """Read a robot: a name of the catalogue, or a file (.urdf, .xml for MJCF, .toml for DH tables and twists).

        *options* go to `apprehend.robots.load_description`.
        """
        from .. import robots

        return cls(robots.load_description(source, **options))

    def placed(self, T_world_base: ArrayLike) -> Robot:
        """The same robot with its root link at *T_world_base* ``(4, 4)``; everything is then in world coordinates."""
        return Robot(self.description, base=T_world_base)

    def attach(self, other: Robot | Description, at: str, pose: ArrayLike | None = None, prefix: str = "") -> Robot:
        """A robot with *other*'s root link fixed to link *at* of this one, at *pose* (T_at_root, identity if absent).

        *prefix* is put before the names of *other*'s links and joints.
        """
        from .. import robots

        tool: Any = other.description if isinstance(other, Robot) else other
        if not isinstance(tool, robots.Description):
            expect(tool, "Robot", "other")
        offset = None if pose is None else as_pose(pose, "pose")
        joined = robots.attach(self.description, tool, at, pose=offset, prefix=prefix)
        return Robot(joined, base=self.base)

    # names ------------------------------------------------------------------------------------------------------

    def index(self, joint: str) -> int:
        """Position of the free joint *joint* in joint vectors."""
        if joint not in self.joint_names:
            unknown_name("free joint", joint, self.joint_names, f"robot {self.name!r}")
        return self.joint_names.index(joint)

    def frame_index(self, frame: str) -> int:
        """Position of the link *frame* in `frame_names`."""
        if frame not in self._frame_numbers:
            unknown_name("frame", frame, self.frame_names, f"robot {self.name!r}")
        return self._frame_numbers[frame]

    @cached_property
    def _frame_numbers(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.frame_names)}

    def chain(self, frame: str) -> tuple[int, ...]:
        """Positions of the coordinates that move *frame*, ascending."""
        return tuple(int(i) for i in self.chain_model(frame).free)

    def chain_model(self, frame: str) -> ChainModel:
        """Arrays of the chain from the root to *frame*, for kernels (layout: `apprehend.kernels.chain`)."""
        found = self._chains.get(frame)
        if found is None:
            found = self._chains[frame] = chain_model(self.model, self.frame_index(frame))
        return found

    @cached_property
    def limits(self) -> Limits:
        """Limits of the coordinates; read-only, as all of a robot: `Limits` of a trajectory, or a description with
        other `JointLimits`, say what else should hold."""
        read_only = {name: array.view() for name, array in vars(self.limits_model).items()}
        for array in read_only.values():
            array.flags.writeable = False
        return Limits(**read_only)

    @cached_property
    def limits_model(self) -> Limits:
        """The limits as kernels read them, in writable memory: not to be written to."""
        of = [joint.limits for joint in self.description.free_joints]
        continuous = np.array([j.type is JointType.CONTINUOUS for j in self.description.free_joints], dtype=bool)
        return Limits(
            lower=np.where(continuous, -np.inf, [limit.lower for limit in of]),
            upper=np.where(continuous, np.inf, [limit.upper for limit in of]),
            velocity=np.array([limit.velocity for limit in of], dtype=np.float64),
            acceleration=np.array([limit.acceleration for limit in of], dtype=np.float64),
            effort=np.array([limit.effort for limit in of], dtype=np.float64),
        )

    @property
    def home(self) -> Array:
        """A resting joint vector ``(n,)``: the description's value for a joint where it gives one; else the middle
        of its limits where both are finite; else zero, or the limit nearest to zero. A new array each time.
        """
        return self._home.copy()

    @cached_property
    def _home(self) -> Array:
        values = [self.description.rest(joint) for joint in self.description.free_joints]
        return np.array(values, dtype=np.float64)

    @cached_property
    def transmission(self) -> Transmission:
        """The motors on the coordinates, with the limits of both sides (see `Transmission`)."""
        return Transmission.motors(self)

    @cached_property
    def loops(self) -> tuple[LoopConstraint, ...]:
        """The constraints of closed chains that were cut (``Robot.load(..., loops="cut")``); see `close_loops`."""
        return tuple(LoopConstraint(self, loop) for loop in self.description.loops)

    # poses and Jacobians ----------------------------------------------------------------------------------------

    def fk(self, q: ArrayLike, frame: str | None = None) -> Array:
        """Poses T_world_frame of ``q (..., n)`` (G 1.5, K): ``(..., 4, 4)``.

        The product of the relative transforms along the chain. Without *frame*: all frames ``(..., F, 4, 4)`` in the
        order of `frame_names`.
        """
        q = self._read(q)
        if q.ndim == 1:
            if frame is None:
                out = np.empty((len(self.frame_names), 4, 4))
                if tree_kernels.frames_single(self.model, q, out):
                    self._refuse(q)
                return out
            out = np.empty((4, 4))
            if single_kernels.chain_single(self._chains.get(frame) or self.chain_model(frame), q, 0, out, _NO_JACOBIAN):
                self._refuse(q)
            return out
        count = math.prod(q.shape[:-1])
        rows = q.reshape(count, self.n)
        if frame is None:
            out = memory.empty(count, 16 * len(self.frame_names))
            tree = self.model
            self._batch(lambda a, b: tree_kernels.tree_poses(tree, rows, a, b, out), q, count)
            return out.reshape(*q.shape[:-1], len(self.frame_names), 4, 4)
        out = memory.empty(count, 16)
        chain = self.chain_model(frame)
        self._batch(lambda a, b: chain_kernels.chain_poses(chain, rows, a, b, out), q, count)
        return out.reshape(*q.shape[:-1], 4, 4)

    def jacobian(self, q: ArrayLike, frame: str, reference: str = "mixed") -> Array:
        """Jacobian ``(..., 6, n)`` of *frame* (G 1.7): twist (v, ω) = J q̇.

        *reference*: ``"spatial"``: v of the point at the world's origin, axes of the world; ``"body"``: origin and
        axes of the frame; ``"mixed"``: origin of the frame, axes of the world (the scripts' classical Jacobian).
        Columns of joints that mimic add to their driver's, times the multiplier.
        """
        return self._jacobian(q, frame, reference, poses=False)[0]

    def fk_jacobian(self, q: ArrayLike, frame: str, reference: str = "mixed") -> tuple[Array, Array]:
        """`fk` and `jacobian` of *frame* in one go: ``(..., 4, 4)`` and ``(..., 6, n)``."""
        J, T = self._jacobian(q, frame, reference, poses=True)
        return T, J

    def jacobian_derivative(
        self, q: ArrayLike, qd: ArrayLike, frame: str, reference: str = "mixed"
    ) -> tuple[Array, Array]:
        """Jacobian and its time derivative along q̇, both ``(..., 6, n)``."""
        return differential.jacobian_derivative(self, q, qd, frame, reference)

    def _jacobian(self, q: ArrayLike, frame: str, reference: str, *, poses: bool) -> tuple[Array, Array]:
        try:
            kind = differential.REFERENCES.index(reference)
        except ValueError:
            choice(reference, "reference", differential.REFERENCES)
            raise
        q = self._read(q)
        chain = self._chains.get(frame) or self.chain_model(frame)
        if q.ndim == 1:
            T = np.empty((4, 4))
            J = np.empty((6, self.n))
            if single_kernels.chain_single(chain, q, kind, T, J):
                self._refuse(q)
            return J, T
        count = math.prod(q.shape[:-1])
        rows = q.reshape(count, self.n)
        T = memory.empty(count, 16) if poses else _NO_POSES
        J = memory.empty(count, 6 * self.n)
        self._batch(lambda a, b: chain_kernels.chain_jacobians(chain, rows, a, b, kind, J, T), q, count)
        return J.reshape(*q.shape[:-1], 6, self.n), T.reshape(*q.shape[:-1], 4, 4) if poses else T

    # dynamics ---------------------------------------------------------------------------------------------------

    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike | None = None, qdd: ArrayLike | None = None) -> Array:
        """Joint torques (forces of prismatic joints) τ = M(q) q̈ + C(q, q̇) q̇ + g(q), ``(..., n)``.

        q, q̇, q̈ broadcast; absent ones are zero. Recursive Newton–Euler; rotor inertias (``armature``) are included,
        joint friction and damping are not.
        """
        shape, rows = self.read_rows(q=q, qd=qd, qdd=qdd)
        out = memory.empty(math.prod(shape), self.n)
        bad = dynamics.inverse_dynamics(self.model, rows[0], rows[1], rows[2], out)
        if bad >= 0:
            self._refuse_one(bad % 4 - 1, q=q, qd=qd, qdd=qdd)
        return out.reshape(*shape, self.n)

    def gravity(self, q: ArrayLike) -> Array:
        """Torques g(q) that hold the robot still against gravity, ``(..., n)``."""
        return self.inverse_dynamics(q)

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Joint-space inertia M(q), ``(..., n, n)``, symmetric (composite rigid bodies)."""
        q = self._read(q)
        count = math.prod(q.shape[:-1])
        out = memory.empty(count, self.n * self.n)
        if dynamics.mass_matrix(self.model, q.reshape(count, self.n), out) >= 0:
            self._refuse(q)
        return out.reshape(*q.shape[:-1], self.n, self.n)

    def forward_dynamics(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike) -> Array:
        """Accelerations q̈ = M(q)⁻¹ (τ − C(q, q̇) q̇ − g(q)), ``(..., n)``.

        Raises `InputError` if the mass matrix is singular: a joint that moves no inertia.
        """
        shape, rows = self.read_rows(q=q, qd=qd, tau=tau)
        out = memory.empty(math.prod(shape), self.n)
        bad, row, coordinate = dynamics.forward_dynamics(self.model, rows[0], rows[1], rows[2], out)
        if bad >= 0:
            self._refuse_one(bad % 4 - 1, q=q, qd=qd, tau=tau)
        if row >= 0:
            raise InputError(
                f"robot {self.name!r}: the mass matrix is singular at joint {self.joint_names[coordinate]!r}: the "
                "links that it moves have no inertia of their own; give them one, or the joint an armature"
            )
        return out.reshape(*shape, self.n)

    def coriolis(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """The matrix C(q, q̇) ``(..., n, n)`` of Coriolis and centrifugal torques C q̇, with Ṁ − 2 C antisymmetric."""
        shape, (rows, rates) = self.read_rows(q=q, qd=qd)
        out = np.empty((math.prod(shape), self.n, self.n))
        if coriolis_matrix(self.model, rows, rates, out) >= 0:
            self._refuse_one(0, q=q)
            self._refuse_one(0, qd=qd)
        return out.reshape(*shape, self.n, self.n)

    def com(self, q: ArrayLike) -> Array:
        """Centre of mass of the whole robot in the world, ``(..., 3)``; its mass is `mass`."""
        differential.check_mass(self)
        q = self._read(q)
        count = math.prod(q.shape[:-1])
        out = np.empty((count, 3))
        if dynamics.center_of_mass(self.model, q.reshape(count, self.n), out) >= 0:
            self._refuse(q)
        return out.reshape(*q.shape[:-1], 3)

    @cached_property
    def mass(self) -> float:
        """Mass of all links in kg."""
        return float(self.model.inertia[:, 0].sum())

    # plumbing ---------------------------------------------------------------------------------------------------

    def _read(self, value: ArrayLike, name: str = "q") -> Array:
        """*value* as writable contiguous float64 ``(..., n)``, so that kernels meet one type; not checked for NaN."""
        try:
            array = np.asarray(value, dtype=np.float64, order="C")
        except (TypeError, ValueError, np.exceptions.ComplexWarning):
            return as_shaped(value, name, self.n)
        if array is not value and is_complex(value):
            as_shaped(value, name, self.n)
        if not array.ndim or array.shape[-1] != self.n:
            joints = ", ".join(self.joint_names[:8]) + (", …" if self.n > 8 else "")
            raise InputError(f"{name} has shape {array.shape}; expected (..., {self.n}) for the joints {joints}")
        return array if array.flags.writeable else array.copy()

    def read_rows(self, **values: ArrayLike | None) -> tuple[tuple[int, ...], list[Array]]:
        """Broadcast joint vectors against each other: their batch shape, and each as rows ``(N, n)``; absent: none."""
        given = {name: self._read(value, name) for name, value in values.items() if value is not None}
        shapes = {name: array.shape[:-1] for name, array in given.items()}
        try:
            shape = np.broadcast_shapes(*shapes.values())
        except ValueError:
            told = ", ".join(f"{name} {array.shape}" for name, array in given.items())
            raise InputError(f"the shapes of {told} do not broadcast") from None
        rows = []
        for name in values:
            if name in given:
                array = given[name]
                if array.shape[:-1] != shape:
                    array = np.broadcast_to(array, (*shape, self.n)).copy()
                rows.append(array.reshape(math.prod(shape), self.n))
            else:
                rows.append(dynamics.NONE)
        return shape, rows

    def _refuse_one(self, which: int, **values: ArrayLike | None) -> None:
        """Raise `InputError` for the input that a kernel found not finite."""
        name, value = list(values.items())[which]
        as_shaped(value if value is not None else 0.0, name, self.n)

    def _refuse(self, q: Array, name: str = "q") -> None:
        as_shaped(q, name, self.n)

    def _batch(self, work: Callable[[int, int], int], q: Array, count: int, name: str = "q") -> None:
        """Run *work* over the rows of a batch; it returns the first row that is not finite, or −1."""
        if dynamics.each_range(work, count, GRAIN) >= 0:
            self._refuse(q, name)

    def __repr__(self) -> str:
        return f"<Robot {self.name!r}: {self.n} coordinates, {len(self.frame_names)} frames>"
