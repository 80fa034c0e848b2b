"""The standard scene: a robot at the edge of a table, one body on it, and a place for that body."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_pose
from ..errors import InputError, expect
from ..kinematics import Robot
from ..robots import load_description
from .scene import AUTO, DEFAULT_HAND, Box, Placed, RobotSource, Scene, end_link, has_hand

if TYPE_CHECKING:
    from ..bodies import Body

UPRIGHT = 0.1
"""Largest angle in rad between a body's z and the vertical at which it counts as upright as it was modelled."""

REACH_SAMPLES = 2000
FLOOR = -0.75  # m; the table's top and the robot's base are at z = 0


def tabletop(
    robot: str = "ur5e",
    hand: str | None = AUTO,
    *,
    body: Body | str | None = None,
    pose: ArrayLike | None = None,
    goal: ArrayLike | None = None,
    upright: bool = False,
) -> Scene:
    """The scene of the main job: *robot* on a pedestal at the edge of a table whose top is z = 0.

    The body (a `Body` or the name of a household object; "mug" by default) stands at *pose* (4, 4), by default at
    half of the arm's reach to the right, at rest as `resting` chooses; *goal* (4, 4) is by default the same posture
    to the left. *hand* is a name or path, None for a robot that needs none, or "auto": none where the arm's
    description has a hand of its own, else the default gripper.
    """
    from ..bodies import Body

    if hand == AUTO:
        hand = None if has_hand(load_description(robot)) else DEFAULT_HAND
    source = RobotSource(robot, hand)
    arm, hand_root = source.build()
    reach = horizontal_reach(arm)
    near, depth, width = 0.22 * reach, 1.0 * reach, 1.4 * reach
    boxes = (
        Box("table", np.array([depth, width, 0.04]), translation(near + 0.5 * depth, 0.0, -0.02)),
        Box("pedestal", np.array([0.24, 0.24, -FLOOR]), translation(0.0, 0.0, 0.5 * FLOOR), (0.35, 0.36, 0.38, 1.0)),
        Box("floor", np.array([4.0, 4.0, 0.02]), translation(0.0, 0.0, FLOOR - 0.01), (0.8, 0.8, 0.8, 1.0)),
    )
    origin: dict[str, object] | None = None
    if body is None or isinstance(body, str):
        origin = {"household": body or "mug"}
        body = Body.household(body or "mug")
    place = (0.5 * reach, -0.2 * reach)
    start = resting(body, *place) if pose is None else as_pose(pose, "pose")
    if goal is None:
        target = start.copy()
        target[1, 3] = -start[1, 3] if abs(start[1, 3]) > 0.1 * reach else start[1, 3] + 0.3 * reach
    else:
        target = as_pose(goal, "goal")
    return Scene(
        robot=arm,
        robot_source=source,
        bodies={body.name: Placed(body, start, True, origin)},
        boxes=boxes,
        goals={body.name: target},
        pick=body.name,
        upright=upright,
        hand_root=hand_root,
    )


def horizontal_reach(robot: Robot) -> float:
    """Largest distance in the xy-plane that the end of the arm reached from the base in random postures, in m."""
    rng = np.random.default_rng(0)
    lower = np.maximum(robot.limits.lower, -np.pi)
    upper = np.minimum(robot.limits.upper, np.pi)
    tips = robot.fk(rng.uniform(lower, upper, (REACH_SAMPLES, robot.n)), end_link(robot.description))[:, :3, 3]
    return float(np.linalg.norm(tips[:, :2] - robot.base[:2, 3], axis=1).max())


def resting(body: Body, x: float, y: float, z: float = 0.0, *, yaw: float = 0.0, choose: int | None = None) -> Array:
    """The pose (4, 4) of *body* that rests on the plane of height *z*, its centre of mass above (x, y).

    *choose* counts the stable poses from the most probable one; None takes the pose in which the body's z points up
    where that is stable, else the most probable one. With *yaw* = 0 (rad, about the vertical) the rest is the
    smallest rotation that brings it about.
    """
    expect(body, "Body", "body")
    poses = body.stable_poses()
    if choose is None:
        ups = [pose.up[2] for pose in poses]
        choose = int(np.argmax(ups)) if max(ups) > np.cos(UPRIGHT) else 0
    if not 0 <= choose < len(poses):
        raise InputError(f"body {body.name!r} has {len(poses)} stable poses, counted from 0; there is no pose {choose}")
    T = translation(0.0, 0.0, z)
    c, s = np.cos(yaw), np.sin(yaw)
    T[:3, :3] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ raising(poses[choose].up)
    T[:3, 3] += [x, y, 0.0] - T[:3, :3] @ body.com
    T[2, 3] = z - (body.vertices @ T[2, :3]).min()
    return T


def raising(up: Array) -> Array:
    """The smallest rotation (3, 3) that turns the unit vector *up* into z."""
    x, y, z = up
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    f = 1.0 / (1.0 + z)
    return np.array([[1.0 - x * x * f, -x * y * f, -x], [-x * y * f, 1.0 - y * y * f, -y], [x, y, z]])


def translation(x: float, y: float, z: float) -> Array:
    """The pose (4, 4) that is turned like the world, at (x, y, z)."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T
