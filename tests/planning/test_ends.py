"""The first look at a start and goals says what the collision model says, asked one thing at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from apprehend.collision import CollisionModel, Convex
from apprehend.kernels import plan_ends
from apprehend.kinematics import Robot
from apprehend.robots import JointLimits, JointType
from tests.collision.makers import planar, pose
from tests.planning.test_plan import wall_with_hole

SLACK = 1e-6


def arm_that_turns() -> CollisionModel:
    """A planar arm whose first joint has no limits, beside a cone: spheres do not decide."""
    description = planar(3).description
    first, *others = description.joints
    first = replace(first, type=JointType.CONTINUOUS, limits=JointLimits())
    robot = Robot(replace(description, joints=(first, *others)))
    return CollisionModel(robot).add("cone", [Convex.cone(0.2, 0.5)], pose(0.7, 0.3))


def look(model: CollisionModel, ends: np.ndarray, moving: np.ndarray, straight: bool = True):
    state, box, rows = np.empty(len(ends), np.int64), np.empty((2, ends.shape[1])), ends.copy()
    limits = model.robot.limits
    reached = plan_ends.look(
        model.compiled, model.lanes, rows, moving, limits.lower, limits.upper, SLACK, model.clearance,
        model.resolution, straight, state, box,
    )  # fmt: skip
    return reached, rows, state, box


@pytest.mark.parametrize("make", [wall_with_hole, arm_that_turns])
def test_ends_are_judged_as_by_the_model(make) -> None:
    model, rng = make(), np.random.default_rng(0)
    lower, upper, n = model.robot.limits.lower, model.robot.limits.upper, model.robot.n
    endless = np.isinf(lower)
    seen = set()
    for trial in range(60):
        moving = np.ones(n, bool) if trial % 3 else rng.random(n) < 0.6
        ends = rng.uniform(
            np.where(endless, -9.0, 1.1 * lower), np.where(endless, 9.0, 1.1 * upper), (int(40 * rng.random()) + 2, n)
        )
        ends[0] = np.clip(ends[0], lower, upper)
        ends[1] = np.clip(ends[1], lower, upper) + 0.5 * SLACK * rng.uniform(-1.0, 1.0, n)  # within what is forgiven
        reached, rows, state, box = look(model, ends, moving)

        expected = np.where(moving, ends, ends[0])
        turned = ends[0] + np.remainder(expected - ends[0] + np.pi, 2.0 * np.pi) - np.pi
        expected[1:, endless & moving] = turned[1:, endless & moving]
        inside = np.where(moving & ~endless, np.clip(expected, lower, upper), expected)
        np.testing.assert_allclose(rows, inside, atol=1e-12)
        beyond = np.abs(expected - inside).max(axis=1) > SLACK
        free = model.free(inside)
        wanted = np.where(beyond, plan_ends.BEYOND, np.where(free, plan_ends.GOOD, plan_ends.BLOCKED))
        np.testing.assert_array_equal(state, wanted)
        seen |= set(state)

        if state[0] == plan_ends.GOOD:
            good = np.flatnonzero(state[1:] == plan_ends.GOOD)
            order = good[np.argsort(((rows[1 + good] - rows[0]) ** 2).sum(axis=1), kind="stable")]
            ways = model.edges_free(np.repeat(rows[:1], len(order), axis=0), rows[1 + order])
            assert reached == (order[np.argmax(ways)] if ways.any() else -1)
            usable = rows[state == plan_ends.GOOD]
            half = np.where(endless & moving, np.pi, 0.0)
            np.testing.assert_allclose(box[0], np.where(moving & ~endless, lower, usable.min(axis=0) - half))
            np.testing.assert_allclose(box[1], np.where(moving & ~endless, upper, usable.max(axis=0) + half))
        assert look(model, ends, moving, straight=False)[0] == -1
    assert seen == {plan_ends.GOOD, plan_ends.BEYOND, plan_ends.BLOCKED}


def test_angles_of_many_turns_are_judged_exactly() -> None:
    model = arm_that_turns()
    q = np.random.default_rng(1).uniform(-3.0, 3.0, (64, 3))
    far = q + np.array([2.0 * np.pi * 3000.0, 0.0, 0.0])  # beyond what lanes reduce
    ends = np.concatenate([far[:1], far])
    _, _, state, _ = look(model, ends, np.ones(3, bool))
    np.testing.assert_array_equal(state[1:] == plan_ends.GOOD, model.free(q))
