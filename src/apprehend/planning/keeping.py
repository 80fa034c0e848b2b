"""What keeps constraints: values of configurations, proofs along motions, projections; and the arrays behind them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Array, BoolArray
from ..collision import Convex
from ..collision.nodes import Node, ancestors, matrix, reach
from ..kernels import constrain, constrain_hold
from ..kernels.constrain import ConstrainModel
from ..kinematics import Robot
from ..parallel import over_ranges
from .constraints import Inside, PathConstraint, Upright

SHARE, MOST_TURN, MOST_SHIFT = 0.15, 0.02, 0.01
"""A slack: this share of half the tolerance, or so many rad or m. Projections leave 1.5 to 2 slacks to the bounds."""

ROUNDING = 1e-9
"""Bounds are kept to so many rad or m."""

PARALLEL = 1e-12
"""Sine of the angle between axes that count as parallel."""

ATTEMPTS = 256
"""Random configurations that are tried before it is said that none keeps the constraints."""

GRAIN = 64
"""Smallest share of a batch that is worth a thread."""


class Constraints:
    """Constraints of one robot: checked, kept along motions, projected onto; joint vectors are ``(..., n)``."""

    def __init__(self, robot: Robot, items: Sequence[PathConstraint], moving: BoolArray | None = None) -> None:
        self.robot, self.items = robot, tuple(items)
        self.moving = np.ones(robot.n, bool) if moving is None else moving
        self.compiled = compile_constraints(robot, self.items, self.moving)

    def values(self, q: Array) -> Array:
        """Values ``(..., I, 3)`` of the I constraints; those that a constraint does not have are 0."""
        rows = fresh(q).reshape(-1, self.robot.n)
        out = np.zeros((len(rows), 3 * len(self.items)))
        if out.size:
            over_ranges(lambda a, b: constrain.values_many(self.compiled, rows, a, b, out), len(rows), GRAIN)
        return out.reshape(*q.shape[:-1], len(self.items), 3)

    def violation(self, q: Array) -> Array:
        """How far beyond the bounds ``(...)`` in rad or m, 0 where all hold."""
        value, floats = self.values(q), self.compiled.floats
        low, high = floats[:, constrain.LOW : constrain.HIGH], floats[:, constrain.HIGH : constrain.SLACK]
        worst: Array = np.maximum(low - value, value - high).max(axis=(-2, -1), initial=0.0)
        return worst

    def why(self, q: Array) -> str:
        """Which constraint ``q (n,)`` violates and what is known of others that keep all; empty: none."""
        value, floats = self.values(q), self.compiled.floats
        low, high = floats[:, constrain.LOW : constrain.HIGH], floats[:, constrain.HIGH : constrain.SLACK]
        beyond = np.maximum(low - value, value - high).max(axis=-1, initial=0.0)
        if not (beyond > 0.0).any():
            return ""
        first = int(np.argmax(beyond > 0.0))
        return f"{self.items[first].words(value[first])}; {self._elsewhere(q)}"

    def _elsewhere(self, q: Array) -> str:
        limits, many = self.robot.limits_model, len(self.items) > 1
        what = "all constraints" if many else "the constraint"
        near, good = self.project(q[None], limits.lower, limits.upper)
        if good[0]:
            return f"a configuration {np.linalg.norm(near[0] - q):.2g} (rad, m) away keeps {what}"
        wide = np.where(self.moving, np.pi, 0.0)
        lower = np.where(np.isfinite(limits.lower), np.where(self.moving, limits.lower, q), q - wide)
        upper = np.where(np.isfinite(limits.upper), np.where(self.moving, limits.upper, q), q + wide)
        tried = np.random.default_rng(0).uniform(lower, upper, (ATTEMPTS, len(q)))
        if self.project(tried, lower, upper)[1].any():
            return f"no configuration near it keeps {what}"
        more = ": they may exclude one another" if many else ""
        return f"none of {ATTEMPTS} random configurations could be moved onto {what}{more}"

    def hold(self, qa: Array, qb: Array) -> BoolArray:
        """Whether the constraints hold all along each straight motion ``(N, n)``: proven (`kernels.constrain_hold`)."""
        rows_a, rows_b = fresh(qa), fresh(qb)
        out = np.ones(len(rows_a), bool)
        if self.items and len(rows_a):
            over_ranges(
                lambda a, b: constrain_hold.holds_many(self.compiled, rows_a, rows_b, a, b, out), len(rows_a), GRAIN
            )
        return out

    def project(self, q: Array, lower: Array, upper: Array) -> tuple[Array, BoolArray]:
        """Configurations ``(N, n)`` near *q* that keep all bounds with 1.5 slacks to spare, and where that worked."""
        near, lower, upper = fresh(q), fresh(lower), fresh(upper)
        good = np.ones(len(near), bool)
        if len(near):
            over_ranges(
                lambda a, b: constrain.project_many(self.compiled, near, lower, upper, a, b, good), len(near), GRAIN
            )
        return near, good


def fresh(values: Array) -> Array:
    """A writable copy, row by row: kernels are compiled for no other."""
    return np.array(values, np.float64, order="C")


def compile_constraints(robot: Robot, items: Sequence[PathConstraint], moving: BoolArray) -> ConstrainModel:
    """Arrays for the kernels; of the robot's joints only those that move a constrained frame."""
    tree = robot.model
    frames = [robot.frame_index(item.frame) for item in items]
    carriers = [int(tree.frame_joint[f]) for f in frames]
    needed = sorted({joint for carrier in carriers for joint in ancestors(tree, carrier)})
    number = {joint: k for k, joint in enumerate(needed)} | {-1: -1}
    kinds, rows, levers = [], [], []
    for item, f, carrier in zip(items, frames, carriers, strict=True):
        place = matrix(tree.frame_place[f])
        low, high = item.bounds
        width = np.where(np.isfinite(low), 0.5 * (high - low), high)
        slack = np.minimum(SHARE * width, MOST_SHIFT if isinstance(item, Inside) else MOST_TURN)
        row = np.zeros(constrain.SLACK + 3)
        row[constrain.LOW : constrain.HIGH], row[constrain.HIGH : constrain.SLACK] = -np.inf, np.inf
        row[constrain.LOW : constrain.LOW + len(low)] = low - ROUNDING
        row[constrain.HIGH : constrain.HIGH + len(high)] = high + ROUNDING
        row[constrain.SLACK : constrain.SLACK + len(low)] = slack
        row[: constrain.POINT] = place[:3, :3].ravel()
        if isinstance(item, Upright):
            kinds.append(constrain.UPRIGHT)
            row[constrain.POINT : constrain.BOX] = place[:3, :3] @ np.asarray(item.axis)
            row[constrain.FROM : constrain.LOW] = np.asarray(item.up)
        elif isinstance(item, Inside):
            kinds.append(constrain.INSIDE)
            box = np.asarray(item.pose)
            row[constrain.POINT : constrain.BOX] = place[:3, :3] @ np.asarray(item.point) + place[:3, 3]
            row[constrain.BOX : constrain.FROM] = box[:3, :3].ravel()
            row[constrain.FROM : constrain.LOW] = box[:3, 3]
        else:
            kinds.append(constrain.TURNED)
            row[constrain.BOX : constrain.FROM] = np.asarray(item.rotation).ravel()
            free = np.asarray(item.tolerance) >= np.pi
            row[constrain.LOW : constrain.HIGH][free], row[constrain.HIGH : constrain.SLACK][free] = -np.inf, np.inf
        rows.append(row)
        levers.append(_levers(robot, carrier, item, row)[needed])
    parents = np.array([number[int(tree.parent[j])] for j in needed], np.int64)
    return ConstrainModel(
        links=np.stack([parents, tree.kind[needed], tree.coordinate[needed]], axis=1),
        joints=np.concatenate([tree.place[needed], tree.gain[needed]], axis=1),
        items=np.array([[kind, number[c], 3 * k] for k, (kind, c) in enumerate(zip(kinds, carriers, strict=True))])
        .reshape(-1, 3)
        .astype(np.int64),
        floats=np.array(rows).reshape(len(rows), constrain.SLACK + 3),
        levers=np.array(levers).reshape(len(rows), len(needed)),
        moving=moving.astype(np.float64),
    )


def _levers(robot: Robot, carrier: int, item: PathConstraint, row: Array) -> Array:
    """By how much the axis, point or rotation moves at most per unit of each joint's value ``(m,)``."""
    tree = robot.model
    if isinstance(item, Inside):
        point = np.eye(4)
        point[:3, 3] = row[constrain.POINT : constrain.BOX]
        return reach(tree, robot, Node("point", carrier, (Convex.sphere(1e-6).at(point),)))
    chain = [joint for joint in ancestors(tree, carrier) if tree.kind[joint] == 0]
    out = np.zeros(len(tree.kind))
    if isinstance(item, Upright):
        chain = _tilting(robot, carrier, chain, row)
    out[chain] = 1.0
    return out


def _tilting(robot: Robot, carrier: int, chain: list[int], row: Array) -> list[int]:
    """Those of the revolute joints, innermost first, that tilt an axis.

    Not the last ones, where they turn about that axis, nor the first ones, where they turn about its direction.
    """
    tree = robot.model
    axis, up = row[constrain.POINT : constrain.BOX], row[constrain.FROM : constrain.LOW]
    joint = carrier
    while joint >= 0 and (tree.kind[joint] != 0 or np.hypot(axis[0], axis[1]) < PARALLEL):
        chain = [j for j in chain if j != joint]
        axis = matrix(tree.place[joint])[:3, :3] @ axis
        joint = int(tree.parent[joint])
    for joint in reversed(ancestors(tree, carrier)):
        up = matrix(tree.place[joint])[:3, :3].T @ up
        if tree.kind[joint] == 0 and np.hypot(up[0], up[1]) > PARALLEL:
            break
        chain = [j for j in chain if j != joint]
    return chain
