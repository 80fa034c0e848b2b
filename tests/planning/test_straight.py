"""Straight lines of a tool: on the line, on one branch, and stopped with a reason."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.collision import Box, CollisionModel, RobotSource, Scene
from apprehend.collision.rotations import matrix_quaternion
from apprehend.errors import InputError
from apprehend.planning import PlanStatus, straight
from apprehend.planning.straight import DEVIATION, Line
from tests.collision.makers import gantry, planar, pose, rotation


def model_of(robot, *boxes: Box) -> CollisionModel:
    return CollisionModel(robot, Scene(robot, RobotSource("in code"), boxes=boxes))


def dense(path: np.ndarray, count: int = 20) -> np.ndarray:
    s = np.linspace(0.0, 1.0, count)[None, :, None]
    return (path[:-1, None] + s * np.diff(path, axis=0)[:, None]).reshape(-1, path.shape[1])


def test_the_tool_stays_on_the_line_and_turns_evenly() -> None:
    robot, _ = RobotSource("ur5e").build()
    q = robot.home
    start = robot.fk(q, "tool0")
    goal = start @ pose(0.05, -0.1, -0.1, rotation_about(np.array([1.0, 2.0, -1.0]), 0.4))
    result = straight(robot, None, q, "tool0", goal).require_success()
    assert result.progress == 1.0
    np.testing.assert_allclose(robot.fk(result.path[-1], "tool0"), goal, atol=2e-7)
    poses = robot.fk(dense(result.path), "tool0")
    line = Line(start, goal)
    direction = (goal[:3, 3] - start[:3, 3]) / line.distance
    for T in poses:
        along = (T[:3, 3] - start[:3, 3]) @ direction
        aside = np.linalg.norm(T[:3, 3] - start[:3, 3] - along * direction)
        assert aside < DEVIATION
        on_line = line.at(float(np.clip(along / line.distance, 0.0, 1.0)))
        turn = 2.0 * np.arccos(np.clip(matrix_quaternion(on_line[:3, :3].T @ T[:3, :3])[0], -1.0, 1.0))
        assert turn < 0.01
    assert np.abs(np.diff(result.path, axis=0)).max() < 0.35


def rotation_about(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def test_collision_names_what_is_hit_and_where() -> None:
    robot = gantry()
    model = model_of(robot, Box("wall", np.array([0.1, 1.0, 1.0]), pose(0.55)))
    result = straight(robot, model, np.zeros(3), "ball", pose(0.8))
    assert result.status is PlanStatus.COLLISION
    assert "ball" in result.explain()
    assert "wall" in result.explain()
    assert result.progress == pytest.approx(0.4 / 0.8, abs=0.02)
    assert model.path_free(result.path)
    assert straight(robot, model, np.zeros(3), "ball", pose(0.8), touching=[("ball", "wall")]).success
    inside = straight(robot, model, [0.55, 0.0, 0.0], "ball", pose(0.8))
    assert inside.status is PlanStatus.START_IN_COLLISION


def test_a_line_beyond_the_limits_ends_with_the_joint() -> None:
    robot = gantry()
    result = straight(robot, None, np.zeros(3), "ball", pose(4.0))
    assert result.status is PlanStatus.UNREACHABLE
    assert "slide_x is at its limit" in result.explain()
    assert result.progress == pytest.approx(0.5, abs=0.01)
    np.testing.assert_allclose(result.path[-1], [2.0, 0.0, 0.0], atol=0.02)
    turned = straight(robot, None, np.zeros(3), "ball", pose(0.1, R=rotation(np.random.default_rng(0))))
    assert turned.status is PlanStatus.UNREACHABLE
    out = straight(robot, None, [3.0, 0.0, 0.0], "ball", pose(1.0))
    assert out.status is PlanStatus.START_OUT_OF_LIMITS


def test_redundant_arms_stay_within_their_limits() -> None:
    robot = planar(5)
    q = np.array([0.4, 0.8, -0.5, 0.6, -0.9])
    start = robot.fk(q, "tip")
    goal = start.copy()
    goal[:2, 3] -= 0.4 * start[:2, 3]
    result = straight(robot, None, q, "tip", goal).require_success()
    assert robot.limits.contains(result.path).all()
    np.testing.assert_allclose(robot.fk(result.path[-1], "tip"), goal, atol=2e-7)


def test_joints_that_may_not_move_stay() -> None:
    robot = planar(5)
    q = np.array([0.4, 0.8, -0.5, 0.6, -0.9])
    goal = robot.fk(q + 0.02 * np.array([1.0, -1.0, 1.0, 0.0, 0.0]), "tip")
    result = straight(robot, None, q, "tip", goal, joints=range(3)).require_success()
    assert (result.path[:, 3:] == q[3:]).all()


def test_a_half_turn_and_a_line_of_no_length() -> None:
    robot, _ = RobotSource("ur5e").build()
    T = robot.fk(robot.home, "tool0")
    nothing = straight(robot, None, robot.home, "tool0", T).require_success()
    np.testing.assert_allclose(nothing.path[-1], robot.home, atol=1e-9)
    turn = T @ pose(R=np.diag([-1.0, -1.0, 1.0]))
    result = straight(robot, None, robot.home, "tool0", turn).require_success()
    assert abs(abs(result.path[-1, 5] - robot.home[5]) - np.pi) < 1e-6


def test_bad_arguments_are_named() -> None:
    robot = gantry()
    with pytest.raises(InputError, match="start has shape"):
        straight(robot, None, np.zeros((1, 3)), "ball", np.eye(4))
    with pytest.raises(InputError, match="step is 0"):
        straight(robot, None, np.zeros(3), "ball", np.eye(4), step=0.0)
    with pytest.raises(InputError, match="goal has shape"):
        straight(robot, None, np.zeros(3), "ball", np.zeros((2, 4, 4)) + np.eye(4))
