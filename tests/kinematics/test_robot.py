"""Poses and Jacobians of random trees equal the obvious computation; names, limits and mistakes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from apprehend.errors import DescriptionError, InputError, UnknownNameError
from apprehend.kinematics import Robot
from apprehend.robots.description import Description, Joint, JointLimits, JointType, Link, Mimic

from .trees import naive_fk, naive_mixed_jacobian, random_pose, random_tree

SEEDS = range(8)


@pytest.mark.parametrize("seed", SEEDS)
def test_every_frame_equals_the_product_of_its_joints(seed: int) -> None:
    rng = np.random.default_rng(seed)
    description = random_tree(seed)
    base = random_pose(rng)
    robot = Robot(description).placed(base)
    q = rng.uniform(-3, 3, (37, robot.n))
    poses = robot.fk(q)
    assert poses.shape == (37, len(robot.frame_names), 4, 4)
    for i in (0, 15, 16, 36):
        expected = naive_fk(description, q[i], base)
        single = robot.fk(q[i])
        for f, frame in enumerate(robot.frame_names):
            np.testing.assert_allclose(poses[i, f], expected[frame], atol=2e-14)
            np.testing.assert_allclose(single[f], expected[frame], atol=2e-14)
            np.testing.assert_allclose(robot.fk(q[i], frame), expected[frame], atol=2e-14)
            np.testing.assert_allclose(robot.fk(q, frame)[i], expected[frame], atol=2e-14)


@pytest.mark.parametrize("seed", SEEDS)
def test_mixed_jacobian_is_the_derivative_of_the_pose(seed: int) -> None:
    rng = np.random.default_rng(seed)
    description = random_tree(seed)
    base = random_pose(rng)
    robot = Robot(description, base=base)
    q = rng.uniform(-3, 3, (3, robot.n))
    for frame in robot.frame_names:
        J = robot.jacobian(q, frame)
        for i in range(3):
            np.testing.assert_allclose(J[i], naive_mixed_jacobian(description, q[i], frame, base), atol=1e-8)
            np.testing.assert_allclose(robot.jacobian(q[i], frame), J[i], atol=1e-13)


@pytest.mark.parametrize("seed", SEEDS)
def test_references_differ_by_the_pose(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = Robot(random_tree(seed), base=random_pose(rng))
    q = rng.uniform(-3, 3, (5, robot.n))
    frame = robot.frame_names[-1]
    T, mixed = robot.fk_jacobian(q, frame)
    np.testing.assert_array_equal(T, robot.fk(q, frame))
    spatial, body = robot.jacobian(q, frame, "spatial"), robot.jacobian(q, frame, "body")
    for i in range(5):
        R, p = T[i, :3, :3], T[i, :3, 3]
        np.testing.assert_allclose(body[i, :3], R.T @ mixed[i, :3], atol=1e-13)
        np.testing.assert_allclose(body[i, 3:], R.T @ mixed[i, 3:], atol=1e-13)
        np.testing.assert_allclose(spatial[i, :3], mixed[i, :3] + np.cross(p, mixed[i, 3:].T).T, atol=1e-13)
        np.testing.assert_allclose(spatial[i, 3:], mixed[i, 3:], atol=1e-13)
        for reference, J in (("spatial", spatial), ("body", body)):
            np.testing.assert_allclose(robot.jacobian(q[i], frame, reference), J[i], atol=1e-13)


def test_columns_outside_the_chain_are_zero() -> None:
    robot = Robot(random_tree(3))
    q = np.random.default_rng(0).uniform(-1, 1, (20, robot.n))
    for frame in robot.frame_names:
        others = [i for i in range(robot.n) if i not in robot.chain(frame)]
        assert not robot.jacobian(q, frame)[:, :, others].any()
        assert not robot.jacobian(q[0], frame)[:, others].any()


def test_batches_keep_their_leading_shape() -> None:
    robot = Robot(random_tree(1))
    frame = robot.frame_names[-1]
    q = np.zeros((2, 3, robot.n))
    assert robot.fk(q).shape == (2, 3, len(robot.frame_names), 4, 4)
    assert robot.fk(q, frame).shape == (2, 3, 4, 4)
    assert robot.jacobian(q, frame).shape == (2, 3, 6, robot.n)
    assert robot.fk(q[:0], frame).shape == (0, 3, 4, 4)
    assert robot.jacobian(q[:0], frame).shape == (0, 3, 6, robot.n)


def test_angles_of_many_turns_and_read_only_or_strided_input() -> None:
    robot = Robot(_one_joint(JointType.CONTINUOUS))
    for q in (1e7 + 0.5, -3e5, 1e12):
        expected = robot.fk([np.arctan2(np.sin(q), np.cos(q))], "tip")
        np.testing.assert_allclose(robot.fk([q], "tip"), expected, atol=1e-15)
        np.testing.assert_allclose(robot.fk([[q], [0.1]], "tip")[0], expected, atol=1e-15)
    many = np.linspace(-1, 1, 40).reshape(20, 2)[:, :1]
    frozen = many.copy()
    frozen.flags.writeable = False
    np.testing.assert_array_equal(robot.fk(many, "tip"), robot.fk(frozen, "tip"))


def test_a_robot_without_moving_joints() -> None:
    robot = Robot(_one_joint(JointType.FIXED))
    assert robot.n == 0
    assert robot.joint_names == ()
    assert robot.home.shape == (0,)
    assert robot.fk(np.zeros(0), "tip").shape == (4, 4)
    assert robot.fk(np.zeros((5, 0))).shape == (5, 2, 4, 4)
    assert robot.jacobian(np.zeros((5, 0)), "tip").shape == (5, 6, 0)


def test_home_and_limits() -> None:
    description = random_tree(5, 30)
    robot = Robot(description)
    for i, joint in enumerate(description.free_joints):
        assert robot.limits.lower[i] == joint.limits.lower
        assert robot.limits.effort[i] == joint.limits.effort
        middle = 0.5 * (joint.limits.lower + joint.limits.upper)
        assert robot.home[i] == (middle if np.isfinite(middle) else 0.0)
    assert robot.limits.contains(robot.home)
    assert not robot.limits.contains(robot.home + 10.0)
    assert robot.limits.contains(robot.limits.clip(robot.home + 10.0))


def test_home_of_the_description_wins_and_half_bounded_joints_rest_at_their_limit() -> None:
    given = dataclasses.replace(_one_joint(JointType.REVOLUTE), home={"j": 0.25})
    assert Robot(given).home[0] == 0.25
    half = _one_joint(JointType.PRISMATIC, JointLimits(lower=0.3))
    assert Robot(half).home[0] == 0.3


UNIT = JointLimits(-1, 1)


def _one_joint(kind: JointType, limits: JointLimits = UNIT, **changes: object) -> Description:
    joint = Joint("j", kind, "root", "tip", np.eye(4), np.array([0.0, 0.6, 0.8]), limits)
    joint = dataclasses.replace(joint, **changes)  # type: ignore[arg-type]
    return Description("one", "root", {"root": Link("root"), "tip": Link("tip")}, (joint,))


def test_wrong_width_names_the_joints() -> None:
    robot = Robot(_one_joint(JointType.REVOLUTE))
    with pytest.raises(InputError, match=r"q has shape \(2,\); expected \(\.\.\., 1\) for the joints j"):
        robot.fk([0.0, 0.0], "tip")
    with pytest.raises(InputError, match="q must be numbers"):
        robot.fk(["a"], "tip")


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_named(bad: float) -> None:
    robot = Robot(_one_joint(JointType.REVOLUTE))
    batch = np.zeros((50, 1))
    batch[37] = bad
    for call in (lambda q: robot.fk(q), lambda q: robot.fk(q, "tip"), lambda q: robot.jacobian(q, "tip")):
        with pytest.raises(InputError, match=rf"q\[0\] is {bad}"):
            call([bad])
        with pytest.raises(InputError, match=rf"q\[37, 0\] is {bad}"):
            call(batch)


def test_unknown_names_suggest() -> None:
    robot = Robot(random_tree(0))
    with pytest.raises(UnknownNameError, match="Did you mean 'link0'"):
        robot.fk(robot.home, "link_0")
    with pytest.raises(UnknownNameError, match="no free joint named 'elbow' in robot 'random0'"):
        robot.index("elbow")
    with pytest.raises(InputError, match="reference is 'world'; expected one of 'spatial', 'body', 'mixed'"):
        robot.jacobian(robot.home, "link0", reference="world")
    assert [robot.index(j) for j in robot.joint_names] == list(range(robot.n))


def test_base_must_be_one_pose() -> None:
    with pytest.raises(InputError, match=r"base has shape \(2, 4, 4\)"):
        Robot(random_tree(0), base=np.broadcast_to(np.eye(4), (2, 4, 4)))


def test_broken_trees_are_refused() -> None:
    one = _one_joint(JointType.REVOLUTE)
    with pytest.raises(DescriptionError, match=r"joint 'j': the axis .* is not a direction"):
        Robot(_one_joint(JointType.REVOLUTE, axis=np.zeros(3)))
    with pytest.raises(DescriptionError, match=r"it mimics 'k', which is not a free joint"):
        Robot(_one_joint(JointType.REVOLUTE, mimic=Mimic("k")))
    with pytest.raises(DescriptionError, match=r"link 'tipp' does not exist. Did you mean 'tip'"):
        Robot(_one_joint(JointType.REVOLUTE, child="tipp"))
    with pytest.raises(DescriptionError, match="link 'tip' is already in the tree"):
        Robot(dataclasses.replace(one, joints=one.joints * 2))
    with pytest.raises(DescriptionError, match="parent link 'tip' must be carried by an earlier joint"):
        Robot(_one_joint(JointType.REVOLUTE, parent="tip", child="root"))
    with pytest.raises(DescriptionError, match="link 'tip' hangs on no joint"):
        Robot(dataclasses.replace(one, joints=()))
