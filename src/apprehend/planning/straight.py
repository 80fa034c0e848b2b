"""Straight lines of a tool, followed in joint space on one branch of the inverse kinematics."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_pose, as_shaped
from ..collision import CollisionModel, Convex
from ..collision.nodes import Node, ancestors, matrix, reach
from ..collision.rotations import matrix_quaternion, quaternion_matrix
from ..errors import InputError
from ..kinematics import Robot
from .plan import LIMIT_SLACK, moving_joints, violated
from .result import PlanResult, PlanStatus

STEP = 0.005
"""Largest distance between waypoints in m, and, times `TURN_PER_METRE`, their largest rotation in rad."""

TURN_PER_METRE = 8.0

TOLERANCE = 1e-7
"""Residual in m and rad at which a waypoint counts as reached."""

NEWTON_STEPS = 30

LEAP = 0.35
"""Largest change of one joint between waypoints, in rad: more is a change of branch."""

DEVIATION = 5e-4
"""Largest distance in m of the tool from the line between two waypoints, proven; more halves the step."""


def straight(
    robot: Robot,
    model: CollisionModel | None,
    start: ArrayLike,
    frame: str,
    goal: ArrayLike,
    *,
    joints: Iterable[int] | None = None,
    step: float = STEP,
    touching: Iterable[tuple[str, str]] = (),
) -> PlanResult:
    """Joint path along which *frame* moves straight from where it is at *start* ``(n,)`` to *goal* ``(4, 4)``.

    Position and rotation are interpolated evenly (the rotation about one fixed axis); every waypoint is solved by
    damped Newton steps from the last one within the joint limits, so that the arm stays on its branch. Between
    waypoints the tool deviates from the line by at most `DEVIATION` (proven: `Bend`). *model* None: no check of
    collision; *touching* are pairs of names that may touch on the way. When it fails, the path up to there is in the
    answer, ``progress`` says how far that is, and ``detail`` why it ends.
    """
    began = time.perf_counter()
    q = as_shaped(start, "start", robot.n)
    if q.ndim != 1:
        raise InputError(f"start has shape {q.shape}; expected ({robot.n},)")
    if not (math.isfinite(step) and step > 0.0):
        raise InputError(f"step is {step}; expected a positive length in m")
    target = as_pose(goal, "goal")
    if target.shape != (4, 4):
        raise InputError(f"goal has shape {target.shape}; expected one (4, 4) pose")
    chain = np.zeros(robot.n, bool)
    chain[list(robot.chain(frame))] = True
    free = np.flatnonzero(chain & moving_joints(robot, joints))
    lower, upper = robot.limits_model.lower, robot.limits_model.upper

    def answer(status: PlanStatus, path: list[Array], s: float, detail: str = "", **facts: object) -> PlanResult:
        seconds = time.perf_counter() - began
        return PlanResult(status, np.array(path), 0, detail, progress=s, seconds=seconds, **facts)  # type: ignore[arg-type]

    outside = violated(robot, q[free], lower[free], upper[free]) if len(free) else ""
    if outside:
        return answer(PlanStatus.START_OUT_OF_LIMITS, [q.copy()], 0.0, f"{outside}.")
    if model is not None and touching:
        model = model.allow(touching)
    if model is not None and (touches := model.why(q)):
        return answer(PlanStatus.START_IN_COLLISION, [q.copy()], 0.0, f"{touches[0]}.", touches=touches)
    line = Line(robot.fk(q, frame), target)
    path, places = [q.copy()], [0.0]
    ds = 1.0 / max(1, math.ceil(max(line.distance, line.angle / TURN_PER_METRE) / step))
    largest, smallest, bend = ds, ds / 64.0, Bend(robot, frame)
    s = 0.0
    while s < 1.0:
        ahead = min(1.0, s + ds)
        if 1.0 - ahead < 1e-9:
            ahead = 1.0
        q_next, residual = track(robot, path[-1], frame, line.at(ahead), free)
        leap = float(np.abs(q_next - path[-1]).max())
        reached = residual <= TOLERANCE
        good = reached and leap <= LEAP and bend(path[-1], q_next) <= DEVIATION - 2.0 * TOLERANCE
        if not good:
            if ds > smallest:
                ds *= 0.5
                continue
            where = f"at {100 * s:.0f} % of the line"
            if not reached:
                stuck = _at_limit(robot, q_next, free)
                why = f"{stuck} is at its limit" if stuck else f"{1e3 * residual:.2g} mm or mrad remain"
                return answer(PlanStatus.UNREACHABLE, path, s, f"{where}, {why}.")
            j = int(np.argmax(np.abs(q_next - path[-1])))
            return answer(
                PlanStatus.BRANCH_CHANGE,
                path,
                s,
                f"{where}, {robot.joint_names[j]} would have to leap by {leap:.2g} rad.",
            )
        path.append(q_next)
        places.append(ahead)
        s, ds = ahead, min(2.0 * ds, largest)
    if model is None:
        return answer(PlanStatus.SUCCESS, path, 1.0)
    rows = np.array(path)
    hits, where_hit = model.edge_hits(rows[:-1], rows[1:])
    if (hits >= 0).any():
        first = int(np.argmax(hits >= 0))
        q_hit = rows[first] + where_hit[first] * (rows[first + 1] - rows[first])
        touches = model.why(q_hit)
        what = str(touches[0]) if touches else " and ".join(model.names_of(int(hits[first])))
        detail = f"At {100 * places[first]:.0f} % of the line: {what}."
        return answer(PlanStatus.COLLISION, path[: first + 1], places[first], detail, touches=touches)
    return answer(PlanStatus.SUCCESS, path, 1.0)


class Line:
    """Poses evenly between two: the position on a straight line, the rotation about one axis."""

    def __init__(self, start: Array, goal: Array):
        self.start, self.goal = start, goal
        self.distance = float(np.linalg.norm(goal[:3, 3] - start[:3, 3]))
        q = matrix_quaternion(start[:3, :3].T @ goal[:3, :3])  # w >= 0: the short way
        sine = float(np.linalg.norm(q[1:]))
        self.angle = 2.0 * math.atan2(sine, float(q[0]))
        self.axis = q[1:] / sine if sine > 0.0 else np.array([0.0, 0.0, 1.0])

    def at(self, s: float) -> Array:
        """The pose (4, 4) at *s* in 0 … 1."""
        if s >= 1.0:
            return self.goal
        T = np.eye(4)
        half = 0.5 * s * self.angle
        T[:3, :3] = self.start[:3, :3] @ quaternion_matrix(np.array([math.cos(half), *(math.sin(half) * self.axis)]))
        T[:3, 3] = self.start[:3, 3] + s * (self.goal[:3, 3] - self.start[:3, 3])
        return T


def track(robot: Robot, q: Array, frame: str, target: Array, free: IntArray) -> tuple[Array, float]:
    """Damped Newton steps of the coordinates *free* from *q* to the pose *target*; the answer and its residual.

    A joint that a step would push beyond its limit is held there, and the step is solved again without it.
    """
    q = q.copy()
    lower, upper = robot.limits.lower[free], robot.limits.upper[free]
    best, residual = q.copy(), math.inf
    for _ in range(NEWTON_STEPS):
        T, J = robot.fk_jacobian(q, frame)
        error = pose_error(T, target)
        norm = float(np.abs(error).max())
        if norm < residual:
            best, residual = q.copy(), norm
        if norm <= 0.1 * TOLERANCE:
            break
        active = np.ones(len(free), bool)
        move = np.zeros(len(free))
        for _ in range(len(free)):
            A = J[:, free[active]]
            damping = 1e-3 * float(error @ error) + 1e-12
            move[active] = A.T @ np.linalg.solve(A @ A.T + damping * np.eye(6), error)
            beyond = active & ((q[free] + move < lower - 1e-12) | (q[free] + move > upper + 1e-12))
            if not beyond.any():
                break
            bounded = np.clip(q[free] + move, lower, upper) - q[free]
            J_held = J[:, free[beyond]]
            error = error - J_held @ bounded[beyond]
            move[beyond] = bounded[beyond]
            active &= ~beyond
            if not active.any():
                break
        q[free] = np.clip(q[free] + move, lower, upper)
    return best, residual


def pose_error(T: Array, target: Array) -> Array:
    """Translation and rotation vector (6,) in world axes that bring *T* to *target*."""
    q = matrix_quaternion(target[:3, :3] @ T[:3, :3].T)
    sine = float(np.linalg.norm(q[1:]))
    turn = 2.0 * math.atan2(sine, float(q[0])) / sine if sine > 1e-12 else 2.0
    return np.concatenate([target[:3, 3] - T[:3, 3], turn * q[1:]])


class Bend:
    """How far a frame's origin can leave the chord while the joints move straight from one configuration to another.

    ``|p − chord| ≤ max |p''| / 8`` and ``|p''| ≤ Σᵢⱼ |q̇ᵢ q̇ⱼ| l``, l the farthest that the origin can be from the axis
    of the outer of the two joints (1 for one that slides).
    """

    def __init__(self, robot: Robot, frame: str):
        tree, f = robot.model, robot.frame_index(frame)
        carrier = int(tree.frame_joint[f])
        origin = Node("origin", carrier, (Convex.sphere(1e-9).at(matrix(tree.frame_place[f])),))
        chain = np.array(ancestors(tree, carrier)[::-1], np.int64)
        self.coordinate, self.gain = tree.coordinate[chain], np.abs(tree.gain[chain, 0])
        self.lever, self.turning = reach(tree, robot, origin)[chain], tree.kind[chain] == 0

    def __call__(self, a: Array, b: Array) -> float:
        """The bound in m."""
        v = self.gain * np.abs(b - a)[self.coordinate]
        turned = np.where(self.turning, v, 0.0)
        return float((v * self.lever) @ (2.0 * np.cumsum(turned) - turned)) / 8.0


def _at_limit(robot: Robot, q: Array, free: IntArray) -> str:
    for j in free:
        if q[j] <= robot.limits.lower[j] + LIMIT_SLACK or q[j] >= robot.limits.upper[j] - LIMIT_SLACK:
            return robot.joint_names[int(j)]
    return ""
