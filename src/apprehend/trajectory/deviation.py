"""Cartesian lines, arcs and screws by few joint points, inside a certified tube (T, Bounded_Deviation).

T halves segments until the midpoint is near enough; its test at the midpoint alone proves nothing about the rest of
the segment, and halving gives up to twice the points that are needed. Here each segment is as long as its certified
tube allows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped
from ..errors import InputError, expect
from ..ik import solve
from ..kernels import path_line as kernels
from ..kinematics import Robot
from ..result import Result, Status
from .follow import rounded
from .limits import Limits
from .motion import Trajectory
from .path import PolynomialPath, polyline
from .poses import Arc, Helix, Line, ScrewLine
from .timing import Timing, time_optimal

TOLERANCE = 1e-9
"""Residual in m and rad at which a joint point lies on the line."""
NODES = 48
LEAP = 0.5
"""Largest change of a joint between neighbouring nodes in rad or m; more is a change of branch."""
MAX_POINTS = 4000


class LineStatus(Status):
    """Whether the tool can follow the line: the three Cartesian problems of T are named before anything moves."""

    SUCCESS = "The tool stays inside the tube around the line, which is certified over the whole motion."
    UNREACHABLE = "A point of the line is out of reach within the joint limits."
    SINGULAR = "The line passes so near a singular configuration that the tool speed asked for is not possible there."
    BRANCH_CHANGE = "Start and goal belong to different solutions of the inverse kinematics."


_CODES = {kernels.LOST: "lost", kernels.LEAP: "leap", kernels.THIN: "thin"}


@dataclass(frozen=True, eq=False)
class LineResult(Result):
    """Answer of `straight_line`, `arc`, `screw_line`: joint points and what is proven about the motion between them.

    ``points (M, n)`` lie on the line at ``fractions (M,)`` of it; between them all joints move in proportion.
    ``tube (M − 1, 2)`` bounds the distance (m) and angle (rad) from the line on every segment. On failure ``s`` is the
    fraction where it ends, ``reason`` says why and what to do, and ``alternative`` is a start configuration that
    completes the line, where one was found. ``tool_speed (M,)`` is the largest speed of the tool along the line (m/s,
    or rad/s for a pure rotation) that the joint velocity limits allow at each point.
    """

    status: LineStatus
    robot: Robot
    frame: str
    line: Helix
    points: Array
    fractions: Array
    tube: Array
    tool_speed: Array
    s: float = 1.0
    reason: str = ""
    alternative: Array | None = None

    def explain(self) -> str:
        """The outcome; for a failure, where, why, and what to do."""
        if self.success:
            return (
                f"{self.status.value} {self.points.shape[0]} points; at most {1e3 * self.deviation:.4g} mm and "
                f"{1e3 * self.rotation:.4g} mrad off."
            )
        return f"{self.status.value} At {100.0 * self.s:.1f} % of the line: {self.reason}"

    @property
    def deviation(self) -> float:
        """Proven largest distance of the tool from the line, in m."""
        return float(self.tube[:, 0].max(initial=0.0))

    @property
    def rotation(self) -> float:
        """Proven largest angle between the tool and the orientation it should have there, in rad."""
        return float(self.tube[:, 1].max(initial=0.0))

    @cached_property
    def path(self) -> PolynomialPath:
        """The polyline through the joint points."""
        self.require_success()
        return polyline(self.points)

    def timed(self, limits: Limits | Any | None = None, *, rounding: float = 1e-4, **options: Any) -> Timing:
        """A timed motion that rounds the corners at the joint points so little that the tool stays near the tube.

        *rounding* (m) is what the rounding may add to the deviation of the tool; `time_optimal` takes the *options*.
        """
        self.require_success()
        lever = np.linalg.norm(_levers(self.robot, self.frame))
        path = rounded(self.points, rounding / max(float(lever), 1e-6))
        options.setdefault("least", 4)
        return time_optimal(path, self.robot.limits if limits is None else limits, **options)

    @property
    def motion(self) -> Trajectory:
        """The motion of `timed` within the robot's own limits."""
        return self.timed().require_success().motion


def straight_line(
    robot: Robot, T0: ArrayLike, T1: ArrayLike, *, frame: str | None = None, **options: Any
) -> LineResult:
    """Fewest joint points such that *frame* stays near the straight line from *T0* to *T1*; see `along`."""
    expect(robot, "Robot", "robot")
    return along(robot, Line(T0, T1), frame=frame, **options)


def screw_line(robot: Robot, T0: ArrayLike, T1: ArrayLike, *, frame: str | None = None, **options: Any) -> LineResult:
    """As `straight_line`, along the screw motion from *T0* to *T1*."""
    return along(robot, ScrewLine(T0, T1), frame=frame, **options)


def arc(
    robot: Robot, T0: ArrayLike, via: ArrayLike, T1: ArrayLike, *, frame: str | None = None, **options: Any
) -> LineResult:
    """As `straight_line`, along the circular arc from *T0* through *via* ``(3,)`` to *T1*."""
    return along(robot, Arc(T0, via, T1), frame=frame, **options)


def along(
    robot: Robot,
    line: Helix,
    *,
    frame: str | None = None,
    deviation: float = 1e-3,
    rotation: float = 1e-2,
    q0: ArrayLike | None = None,
    qf: ArrayLike | None = None,
    speed: float | None = None,
) -> LineResult:
    """Fewest joint points such that the tool stays within *deviation* (m) and *rotation* (rad) of *line*.

    The line is followed from *q0* ``(n,)`` (default: the solutions of the inverse kinematics at its start are tried in
    turn) on one branch, redundant arms with the least joint motion. Every segment between joint points is as long as
    its certified tube allows, over its whole length, for position and orientation; ``rotation=inf`` leaves the
    orientation free (arms with few joints). *frame*: by default the last one
    that the arm itself moves (`tool_frame`).

    Found before moving, with place and remedy: a point out of reach; with *speed* (of the tool along the line) a place
    near a singularity where the joints are too slow for it; and, with *qf* or where another solution goes on, start
    and goal on different branches.
    """
    frame = tool_frame(robot) if frame is None else frame
    robot.frame_index(frame)
    for name, value in (("deviation", deviation), ("rotation", rotation)):
        if not value > 0.0 or (name == "deviation" and np.isinf(value)):
            raise InputError(f"{name} is {value}; expected a positive bound")
    if deviation <= 10 * TOLERANCE or rotation <= 10 * TOLERANCE:
        raise InputError(
            f"deviation and rotation must exceed {10 * TOLERANCE:g}, the accuracy of the points themselves"
        )
    if speed is not None and not (np.isfinite(speed) and speed > 0.0):
        raise InputError(f"speed is {speed}; expected a positive speed of the tool, or None")
    follower = _Follower(robot, frame, line, deviation, rotation)
    if q0 is not None:
        start = as_shaped(q0, "q0", robot.n)
        return follower.checked(start, qf, speed)
    found = solve(robot, line.start, frame, n_solutions=8, tolerance=follower.ik_tolerance)
    if not found.success:
        return follower.failed(LineStatus.UNREACHABLE, 0.0, found.reason() + "; start the line within reach")
    failures = []
    for start in found.solutions():
        answer = follower.checked(start, qf, speed, alternatives=False)
        if answer.success:
            return answer
        failures.append(answer)
    return max(failures, key=lambda f: f.s)


class _Follower:
    """One line for one robot: tracks it from given starts."""

    def __init__(self, robot: Robot, frame: str, line: Helix, deviation: float, rotation: float) -> None:
        self.robot, self.frame, self.line = robot, frame, line
        self.model = robot.chain_model(frame)
        self.lower, self.upper = robot.limits_model.lower, robot.limits_model.upper
        # what numerical tolerance the points themselves have is taken off the tube
        self.bounds = deviation - 2.0 * TOLERANCE, rotation - 2.0 * TOLERANCE
        self.rows = 6 if np.isfinite(rotation) else 3
        self.ik_tolerance: ArrayLike = 1e-6 if self.rows == 6 else [1e-6] * 3 + [np.inf] * 3
        self.helix = line.packed
        self.nodes = np.linspace(0.0, 1.0, NODES + 1)

    def checked(self, q0: Array, qf: ArrayLike | None, speed: float | None, *, alternatives: bool = True) -> LineResult:
        n = self.robot.n
        q, dq = np.empty((NODES + 1, n)), np.empty((NODES + 1, n))
        status, reached, s = kernels.track(
            self.model, self.helix, self.rows, self.nodes, q0, self.lower, self.upper, TOLERANCE, LEAP, q, dq
        )
        if status != kernels.OK:
            return self._why(status, q0, q, int(reached), float(s), alternatives)
        s_out, q_out, bounds = np.empty(MAX_POINTS), np.empty((MAX_POINTS, n)), np.empty((MAX_POINTS, 2))
        status, count = kernels.fewest(
            self.model, self.helix, self.rows, _lever_table(self.robot, self.frame), self.nodes, q, dq,
            self.lower, self.upper, TOLERANCE, *self.bounds, s_out, q_out, bounds,
        )  # fmt: skip
        if status != kernels.OK:
            return self.failed(
                LineStatus.SINGULAR, float(s_out[count - 1]),
                "the joints turn so fast here that no segment fits the tube; the arm is at a singular configuration: "
                "move the line, or start from another solution",
            )  # fmt: skip
        answer = LineResult(
            LineStatus.SUCCESS, self.robot, self.frame, self.line, q_out[:count].copy(), s_out[:count].copy(),
            bounds[: count - 1] + 2.0 * TOLERANCE, self._speeds(s_out[:count], q, dq),
        )  # fmt: skip
        answer = self._at_goal(answer, qf) if qf is not None else answer
        return self._at_speed(answer, q, dq, speed) if speed is not None and answer.success else answer

    def _speeds(self, s: Array, q: Array, dq: Array) -> Array:
        """Largest tool speed that the joint velocity limits allow at the fractions *s*."""
        size = self.line.length if self.line.length > 1e-9 else self.line.theta
        with np.errstate(divide="ignore"):
            at_nodes = (self.robot.limits.velocity / np.maximum(np.abs(dq), 1e-300)).min(axis=1) * size
        return np.asarray(np.interp(s, self.nodes, at_nodes))

    def _at_speed(self, answer: LineResult, q: Array, dq: Array, speed: float) -> LineResult:
        allowed = self._speeds(self.nodes, q, dq)
        k = int(allowed.argmin())
        if allowed[k] >= speed:
            return answer
        j = int((np.abs(dq[k]) / self.robot.limits.velocity).argmax())
        reason = (
            f"{self.robot.joint_names[j]!r} would have to turn at {np.abs(dq[k, j]) * speed / self._size():.4g} 1/s "
            f"(limit {self.robot.limits.velocity[j]:.4g}) for a tool speed of {speed:.4g}; slow down to "
            f"{allowed[k]:.4g} there, or choose another start configuration or line"
        )
        return self.failed(LineStatus.SINGULAR, float(self.nodes[k]), reason, answer)

    def _size(self) -> float:
        return self.line.length if self.line.length > 1e-9 else self.line.theta

    def _at_goal(self, answer: LineResult, qf: ArrayLike) -> LineResult:
        goal = as_shaped(qf, "qf", self.robot.n)
        chain = list(self.robot.chain(self.frame))
        gap = np.abs(answer.points[-1] - goal)[chain]
        if gap.max() <= 1e-3:
            return answer
        j = chain[int(gap.argmax())]
        reason = (
            f"the line ends with {self.robot.joint_names[j]!r} at {answer.points[-1][j]:.4g}, but the goal has "
            f"{goal[j]:.4g}: it belongs to another solution; accept the end that is reached (points[-1]), start from "
            "another solution, or change the branch by a joint motion before or after the line"
        )
        return self.failed(LineStatus.BRANCH_CHANGE, 1.0, reason, answer)

    def _why(self, status: int, q0: Array, q: Array, reached: int, s: float, alternatives: bool) -> LineResult:
        """Name the problem at the fraction *s* where tracking from *q0* ended."""
        if reached == 0:
            T = self.robot.fk(q0, self.frame)
            far = float(np.linalg.norm(T[:3, 3] - self.line.start[:3, 3]))
            raise InputError(
                f"q0 puts {self.frame!r} {far:.4g} m from the start of the line and no step leads onto it; leave q0 "
                "out, or give one that reaches T0"
            )
        ahead = min(s + 1.0 / NODES, 1.0)
        there = solve(self.robot, self.line(ahead), self.frame, n_solutions=8, tolerance=self.ik_tolerance)
        if not there.success:
            return self.failed(
                LineStatus.UNREACHABLE, ahead,
                f"{there.reason()}; shorten the line to the part before, move it nearer, or use another base",
            )  # fmt: skip
        stuck = self._at_limit(q[reached])
        cause = f"{stuck} is at its limit" if stuck else "the branch that was followed ends (singular configuration)"
        alternative = self._other_start(q0) if alternatives else None
        remedy = (
            "; the start configuration in `alternative` completes the line"
            if alternative is not None
            else "; the pose itself can be reached on another branch: part the line here and change the branch by a "
            "joint motion"
        )
        return self.failed(LineStatus.BRANCH_CHANGE, s, cause + remedy, alternative=alternative)

    def _other_start(self, q0: Array) -> Array | None:
        """A solution at the start of the line, other than *q0*, from which it can be completed."""
        found = solve(self.robot, self.line.start, self.frame, n_solutions=12, tolerance=self.ik_tolerance)
        n = self.robot.n
        q, dq = np.empty((NODES + 1, n)), np.empty((NODES + 1, n))
        for start in found.solutions() if found.success else ():
            status, _, _ = kernels.track(
                self.model, self.helix, self.rows, self.nodes, start, self.lower, self.upper, TOLERANCE, LEAP, q, dq
            )
            if status == kernels.OK:
                return np.array(start)
        return None

    def _at_limit(self, q: Array) -> str:
        for j in self.robot.chain(self.frame):
            if q[j] <= self.lower[j] + 1e-9 or q[j] >= self.upper[j] - 1e-9:
                return repr(self.robot.joint_names[j])
        return ""

    def failed(
        self, status: LineStatus, s: float, reason: str, partial: LineResult | None = None,
        alternative: Array | None = None,
    ) -> LineResult:  # fmt: skip
        n = self.robot.n
        points, fractions, tube, speeds = (
            (np.empty((0, n)), np.empty(0), np.empty((0, 2)), np.empty(0))
            if partial is None
            else (partial.points, partial.fractions, partial.tube, partial.tool_speed)
        )
        return LineResult(
            status, self.robot, self.frame, self.line, points, fractions, tube, speeds, s, reason, alternative
        )  # fmt: skip


def tool_frame(robot: Robot) -> str:
    """The last frame that the arm itself moves: before the first link at which moving branches part."""
    children: dict[str, list[str]] = {}
    moving = {name: len(robot.chain(name)) for name in robot.frame_names}
    for joint in robot.description.joints:
        children.setdefault(joint.parent, []).append(joint.child)
    size: dict[str, int] = {}

    def joints_below(link: str) -> int:
        if link not in size:
            size[link] = max([moving[link]] + [joints_below(c) for c in children.get(link, [])])
        return size[link]

    link = robot.frame_names[0]
    while True:
        onward = [c for c in children.get(link, []) if joints_below(c) > moving[link]]
        if len(onward) == 1:
            link = onward[0]
        elif onward or not children.get(link):
            return link
        else:  # fixed frames only: the last one
            link = children[link][-1]


def _levers(robot: Robot, frame: str) -> Array:
    """Bound of the distance between the axis of every joint of the chain and the tool, over all configurations."""
    model = robot.chain_model(frame)
    steps = np.linalg.norm(model.place[1:, 9:], axis=1)
    slide = np.zeros(model.kind.size)
    for i in np.flatnonzero(model.kind == 1):
        reach = np.abs([robot.limits.lower[model.coordinate[i]], robot.limits.upper[model.coordinate[i]]]).max()
        slide[i] = abs(model.gain[i, 0]) * reach + abs(model.gain[i, 1])
    total = steps + slide
    return np.ascontiguousarray(np.cumsum(total[::-1])[::-1])


def _lever_table(robot: Robot, frame: str) -> Array:
    levers = _levers(robot, frame)
    if not np.isfinite(levers).all():
        raise InputError(f"a prismatic joint of {robot.name!r} has no limits; the tube needs finite ones")
    return levers
