"""Planned paths are free, start and end where they should, and failures say why."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.collision import Box, CollisionModel, RobotSource, Scene
from apprehend.errors import InputError, UnsuccessfulError
from apprehend.planning import PlanStatus, plan, shortcut
from tests.collision.makers import gantry, planar, pose


def model_of(robot, *boxes: Box, **options) -> CollisionModel:
    return CollisionModel(robot, Scene(robot, RobotSource("in code"), boxes=boxes), **options)


def wall_with_hole() -> CollisionModel:
    """A ball of radius 0.1 and a wall at x = 0 with a hole of 0.3 by 0.3 at y = 1."""
    thick = 0.05
    return model_of(
        gantry(),
        Box("below", np.array([thick, 2.85, 6.0]), pose(0.0, -0.575)),
        Box("above", np.array([thick, 1.85, 6.0]), pose(0.0, 2.075)),
        Box("left", np.array([thick, 0.3, 2.85]), pose(0.0, 1.0, -1.575)),
        Box("right", np.array([thick, 0.3, 2.85]), pose(0.0, 1.0, 1.575)),
    )


def test_a_hole_is_found_and_the_path_is_free_everywhere() -> None:
    model = wall_with_hole()
    start, goal = np.array([-1.0, -1.0, 0.5]), np.array([1.0, -1.0, -0.5])
    assert not model.edges_free(start, goal)
    result = plan(model, start, goal, rng=np.random.default_rng(0), time_limit=60.0).require_success()
    np.testing.assert_array_equal(result.path[0], start)
    np.testing.assert_array_equal(result.path[-1], goal)
    s = np.linspace(0.0, 1.0, 2001)[:, None, None]
    dense = (result.path[:-1] + s * np.diff(result.path, axis=0)).reshape(-1, 3)
    assert (model.distance(dense) > -model.resolution).all()
    # the crossing is inside the hole, and the way is not much longer than the best one
    crossing = dense[np.argmin(np.abs(dense[:, 0]))]
    assert abs(crossing[1] - 1.0) < 0.15
    assert abs(crossing[2]) < 0.15
    best = 2.0 * np.linalg.norm([1.0, 2.0 - 0.05, 0.45])
    assert result.length < 1.25 * best


def test_the_same_generator_gives_the_same_path() -> None:
    model = wall_with_hole()
    ends = np.array([[-1.0, -1.0, 0.5], [1.0, -1.0, -0.5]])
    first, second = (plan(model, *ends, rng=np.random.default_rng(7), time_limit=60.0).path for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_the_nearest_reachable_goal_is_taken() -> None:
    model = wall_with_hole()
    start = np.array([-1.0, 0.0, 0.0])
    goals = np.array([[0.0, 0.0, 0.0], [-1.0, 1.5, 0.0], [-0.5, 0.2, 0.0]])  # the first is in the wall
    result = plan(model, start, goals, rng=np.random.default_rng(0))
    assert result.status is PlanStatus.SUCCESS
    assert result.goal == 2
    np.testing.assert_array_equal(result.path, [start, goals[2]])
    at_goal = plan(model, start, start, rng=np.random.default_rng(0))
    assert at_goal.success
    assert len(at_goal.path) == 1
    assert at_goal.length == 0.0


def test_only_the_given_joints_move() -> None:
    robot = planar(4)
    model = model_of(robot, Box("post", np.array([0.1, 0.1, 0.4]), pose(0.9, 0.5)))
    start, goal = np.array([0.0, 0.1, 0.2, 0.3]), np.array([1.2, 0.3, -0.4, 9.0])
    result = plan(model, start, goal, rng=np.random.default_rng(1), joints=range(3), time_limit=60.0).require_success()
    assert (result.path[:, 3] == 0.3).all()
    np.testing.assert_array_equal(result.path[-1, :3], goal[:3])
    assert model.path_free(result.path)


def test_joints_without_limits_take_the_short_way() -> None:
    from dataclasses import replace

    from apprehend.kinematics import Robot
    from apprehend.robots import JointLimits, JointType

    description = planar(2).description
    joints = tuple(
        replace(j, type=JointType.CONTINUOUS, limits=JointLimits()) if j.type is JointType.REVOLUTE else j
        for j in description.joints
    )
    robot = Robot(replace(description, joints=joints))
    result = plan(model_of(robot), np.array([3.0, 0.0]), np.array([-3.0, 0.1]), rng=np.random.default_rng(0))
    assert result.success
    assert result.length < 0.4
    assert result.path[-1, 0] == pytest.approx(2.0 * np.pi - 3.0)


def test_failures_say_why() -> None:
    model = wall_with_hole()
    rng = np.random.default_rng(0)
    free, blocked = np.array([-1.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0])
    start = plan(model, blocked, free, rng=rng)
    assert start.status is PlanStatus.START_IN_COLLISION
    assert "ball is 125.0 mm deep in below" in start.explain()
    assert start.touches[0].b == "below"
    goals = plan(model, free, [blocked, [0.0, 2.0, 0.0]], rng=rng)
    assert goals.status is PlanStatus.GOALS_IN_COLLISION
    assert "goal 0: ball is 125.0 mm deep in below; goal 1: ball is" in goals.explain()
    beyond = plan(model, [-3.0, 0.0, 0.0], free, rng=rng)
    assert beyond.status is PlanStatus.START_OUT_OF_LIMITS
    assert "slide_x is -3, limits -2 to 2" in beyond.explain()
    far = plan(model, free, [[0.0, 5.0, 0.0]], rng=rng)
    assert far.status is PlanStatus.GOALS_OUT_OF_LIMITS
    assert "slide_y is 5" in far.explain()
    assert plan(model, free, np.zeros((0, 3)), rng=rng).status is PlanStatus.NO_GOAL
    with pytest.raises(UnsuccessfulError, match="Every goal is in collision"):
        goals.require_success()


def test_an_impossible_problem_ends_in_time() -> None:
    closed = model_of(gantry(), Box("wall", np.array([0.05, 6.0, 6.0]), pose()))
    ends = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    late = plan(closed, *ends, rng=np.random.default_rng(0), time_limit=0.05)
    assert late.status is PlanStatus.TIME_SPENT
    assert "the tree from the start has" in late.explain()
    assert late.samples > 0
    full = plan(closed, *ends, rng=np.random.default_rng(0), time_limit=60.0, max_nodes=50)
    assert full.status is PlanStatus.NODES_SPENT


def test_shortcuts_keep_the_ends_and_never_lengthen() -> None:
    model = wall_with_hole()
    rng = np.random.default_rng(3)
    start = np.array([-1.0, 1.0, 0.0])
    path = np.array([start, [-1.5, 1.5, 1.0], [-0.5, 1.0, 0.5], [-0.5, 1.0, 0.0], [0.5, 1.0, 0.0], [1.0, 0.0, 0.0]])
    assert model.path_free(path)
    short = shortcut(model, path, rng=rng)
    np.testing.assert_array_equal(short[[0, -1]], path[[0, -1]])
    lengths = [np.linalg.norm(np.diff(p, axis=0), axis=1).sum() for p in (short, path)]
    assert lengths[0] < 0.7 * lengths[1]
    assert model.path_free(short)


def test_bad_arguments_are_named() -> None:
    model = model_of(gantry())
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match=r"start has shape \(2,\)"):
        plan(model, np.zeros(2), np.zeros(3), rng=rng)
    with pytest.raises(InputError, match="start has shape"):
        plan(model, np.zeros((2, 3)), np.zeros(3), rng=rng)
    with pytest.raises(InputError, match="goals have shape"):
        plan(model, np.zeros(3), np.zeros((2, 2, 3)), rng=rng)
    with pytest.raises(InputError, match="time_limit is 0"):
        plan(model, np.zeros(3), np.zeros(3), rng=rng, time_limit=0.0)
    with pytest.raises(InputError, match="joints contains 3"):
        plan(model, np.zeros(3), np.zeros(3), rng=rng, joints=[3])
    with pytest.raises(InputError, match="joints is empty"):
        plan(model, np.zeros(3), np.zeros(3), rng=rng, joints=[])
    with pytest.raises(InputError, match="path has shape"):
        shortcut(model, np.zeros(3), rng=rng)
