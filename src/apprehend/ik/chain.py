"""From a robot's chain to the form that the IK kernels read, and the table of configurations to start from."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_shaped, spread
from ..errors import InputError
from ..kernels.chain import PRISMATIC, ChainModel
from ..kernels.ik_chain import IKChain
from ..kernels.ik_seeds import chain_features, chain_targets
from ..kinematics import Robot
from .reach import ReachBound, reach_bound

TABLE = 512
"""Configurations in the table of starts."""
GROUPS = 8
"""Starts taken from the table, one from each group of `TABLE` / `GROUPS` entries."""
ROTATION_WEIGHT = 0.3
"""Weight of an entry of the rotation matrix against the position over the chain's reach."""
WHOLE_TURN = 2.0 * math.pi - 1e-9


@dataclass(frozen=True, eq=False)
class PreparedChain:
    """One chain of a robot, ready for the kernels."""

    program: IKChain
    free: IntArray  # (k,) the robot's coordinates that move the frame
    before: Array  # (4, 4) T_world_chain: what precedes the first joint
    reach: float  # metres; no point of the frame is farther from `before`'s origin
    unit: Array  # (k,) size of the kernels' unit of each coordinate: 1 rad, or the reach in metres
    lower: Array  # (k,) limits as the robot has them
    upper: Array
    bound: ReachBound
    turns: Any  # (k,) bool: coordinates that may make a whole turn, and are solved without limits

    def targets(self, T: Array) -> Array:
        """Poses ``(N, 4, 4)`` in the world as the rows ``(N, 12)`` that the kernels read."""
        out = np.empty((T.shape[0], 12))
        rows = np.ascontiguousarray(T).reshape(-1, 16)
        chain_targets(rows, self.before, self.program.tool, self.reach, 0, rows.shape[0], out)
        return out

    def to_kernel(self, q: Array) -> Array:
        """The chain's coordinates of joint vectors ``(N, n)`` in the kernels' units ``(N, k)``."""
        return np.ascontiguousarray(q[:, self.free] / self.unit)

    def from_kernel(self, x: Array, near: Array) -> Array:
        """Kernel coordinates ``(..., k)`` in rad and m; whole turns are chosen nearest to *near*, within the limits."""
        q: Array = x * self.unit
        if self.turns.any():
            t = self.turns
            lower, upper = self.lower[t], self.upper[t]
            turn = 2.0 * math.pi
            value = q[..., t] - turn * np.round((q[..., t] - near[..., t]) / turn)
            value = np.where(value > upper, value - turn * np.ceil((value - upper) / turn), value)
            value = np.where(value < lower, value + turn * np.ceil((lower - value) / turn), value)
            q[..., t] = np.clip(value, lower, upper)
        return q

    def without_limits(self) -> PreparedChain:
        """The same chain with all limits taken away (starts are still drawn from within them)."""
        return self._wide

    @cached_property
    def _wide(self) -> PreparedChain:
        k = self.free.size
        return replace(self, program=self.program._replace(lower=np.full(k, -np.inf), upper=np.full(k, np.inf)))

    @cached_property
    def middle(self) -> Array:
        """The middle of the limits ``(k,)``, or the finite limit nearest to zero, or zero."""
        finite = np.isfinite(self.lower) & np.isfinite(self.upper)
        with np.errstate(invalid="ignore"):
            return np.where(finite, 0.5 * (self.lower + self.upper), np.clip(0.0, self.lower, self.upper))

    @cached_property
    def table(self) -> tuple[Array, Array, Array]:
        """Configurations ``(TABLE, k)`` spread evenly over the limits, their weighted features, half their squares."""
        p = self.program
        k = self.free.size
        # additive recurrence with the generalised golden ratio (Roberts 2018): even in every dimension, no state
        ratio = 2.0
        for _ in range(60):
            ratio = (1.0 + ratio) ** (1.0 / (k + 1))
        alpha = ratio ** -np.arange(1.0, k + 1.0)
        spread = (0.5 + np.arange(1.0, TABLE + 1.0)[:, None] * alpha) % 1.0
        q = np.ascontiguousarray(p.low + (p.high - p.low) * spread)
        features = np.empty((TABLE, 12))
        chain_features(p, q, features)
        weight = np.concatenate([np.full(9, ROTATION_WEIGHT**2), np.ones(3)])
        return q, np.ascontiguousarray(features * weight), 0.5 * (features**2 * weight).sum(axis=1)


_prepared: WeakKeyDictionary[Robot, dict[str, PreparedChain]] = WeakKeyDictionary()


def prepare(robot: Robot, frame: str) -> PreparedChain:
    """The chain of *robot* from its root to *frame*, built once."""
    chains = _prepared.setdefault(robot, {})
    if frame not in chains:
        model = robot.chain_model(frame)
        if model.free.size == 0:
            raise InputError(
                f"frame {frame!r} of robot {robot.name!r} is fixed to its root: no joint moves it, so it has no "
                "inverse kinematics; choose a frame behind a joint"
            )
        chains[frame] = _build(model, robot.limits.lower[model.free], robot.limits.upper[model.free])
    return chains[frame]


def zxz(R: Array) -> tuple[float, float, float, float]:
    """Angles and numbers (a, cos α, sin α, b) with R = Rz(a) Rx(α) Rz(b), sin α ≥ 0."""
    s = math.hypot(R[0, 2], R[1, 2])
    if s < 1e-13:
        c = 1.0 if R[2, 2] > 0.0 else -1.0
        return 0.0, c, 0.0, math.atan2(R[1, 0] * c, R[0, 0])
    return math.atan2(R[0, 2], -R[1, 2]), float(R[2, 2]), s, math.atan2(R[2, 0], R[2, 1])


def _build(model: ChainModel, lower: Array, upper: Array) -> PreparedChain:
    m, k = model.kind.size, model.free.size
    R = model.place[:, :9].reshape(m + 1, 3, 3)
    p = model.place[:, 9:]
    first = np.zeros(m + 1)
    twist = np.zeros((m, 4))
    gain = model.gain.copy()
    shift = np.zeros((m + 1, 3))
    fixed_turn = np.zeros(m)
    for i in range(m):
        first[i], twist[i, 0], twist[i, 1], fixed_turn[i] = zxz(R[i])
        c, s = math.cos(first[i]), math.sin(first[i])
        shift[i] = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ p[i]
    shift[m] = p[m]
    turn = fixed_turn + first[1:]
    c, s = math.cos(first[0]), math.sin(first[0])
    before = np.eye(4)
    before[:3, :3] = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
    before[:3, 3] = p[0]
    shift[0] = 0.0
    prismatic = model.kind == PRISMATIC
    sliding = np.zeros(k, dtype=bool)
    sliding[model.column[prismatic]] = True
    turns = ~sliding & (upper - lower >= WHOLE_TURN)
    # a coordinate that also drives mimics with other than whole multipliers does not repeat after a turn
    for j in range(m):
        if model.gain[j, 0] != round(model.gain[j, 0]) or prismatic[j]:
            turns[model.column[j]] &= False
    low, high = _box(lower, upper, sliding, turns, float(np.linalg.norm(shift, axis=1).sum()))
    slide = np.abs(gain[:, 0]) * np.maximum(np.abs(low), np.abs(high))[model.column] + np.abs(gain[:, 1])
    reach = float(np.linalg.norm(shift, axis=1).sum() + slide[prismatic].sum())
    reach = reach if reach > 0.0 else 1.0
    unit = np.where(sliding, reach, 1.0)
    twist[:, 2], twist[:, 3] = np.cos(turn), np.sin(turn)
    gain[prismatic, 0] *= unit[model.column[prismatic]] / reach
    gain[prismatic, 1] /= reach
    gain[~prismatic, 0] *= unit[model.column[~prismatic]]
    gain[~prismatic, 1] += turn[~prismatic]
    program = IKChain(
        kind=model.kind,
        column=model.column,
        gain=gain,
        twist=twist,
        shift=shift / reach,
        tool=R[m].copy(),
        lower=np.where(turns, -np.inf, lower / unit),
        upper=np.where(turns, np.inf, upper / unit),
        low=low / unit,
        high=high / unit,
    )
    return PreparedChain(
        program, model.free, before, reach, unit, lower, upper, reach_bound(model, lower, upper), turns
    )


def _box(lower: Array, upper: Array, sliding: Any, turns: Any, length: float) -> tuple[Array, Array]:
    """Finite bounds to draw starts from: the limits, one turn, or the chain's length where there is no limit."""
    span = np.where(sliding, max(length, 1.0), math.pi)
    low = np.where(
        turns, -math.pi, np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper, 0.0) - span)
    )
    high = np.where(turns, math.pi, np.where(np.isfinite(upper), upper, low + 2.0 * span))
    return low, high


def read_targets(robot: Robot, T: Array, q0: ArrayLike | None) -> tuple[Array, Array, tuple[int, ...]]:
    """Poses ``(N, 4, 4)``, joint vectors ``(N, n)`` to fill up with, and the batch shape."""
    shape = T.shape[:-2]
    start = robot.home
    if q0 is not None:
        start = as_shaped(q0, "q0", robot.n)
        try:
            shape = np.broadcast_shapes(shape, start.shape[:-1])
        except ValueError as error:
            raise InputError(f"q0 has batch shape {start.shape[:-1]} and T {shape}; they do not broadcast") from error
    count = math.prod(shape)
    T, start = spread(T, (*shape, 4, 4)), spread(start, (*shape, robot.n))
    return T.reshape(count, 4, 4), start.reshape(count, robot.n), shape
