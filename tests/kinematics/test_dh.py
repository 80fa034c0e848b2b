"""DH tables of random chains give back the chain; known arms give their printed tables."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from apprehend.errors import InputError
from apprehend.kinematics import Robot, dh_table, dh_transform, inverse_dh_transform
from apprehend.robots.description import Description, Joint, JointType, Link, Mimic
from apprehend.spatial import so3

from .trees import random_pose, random_tree


def chain_of(axes: list[tuple[str, list[float], list[float]]], tool: list[float]) -> Robot:
    """A robot at rest with joints at absolute points (type, point, axis) and a tool frame with axes of the world."""
    joints, last, at = [], "root", np.zeros(3)
    for i, (kind, point, axis) in enumerate([*axes, ("fixed", tool, [0, 0, 1])]):
        T = np.eye(4)
        T[:3, 3] = np.array(point) - at
        at = np.array(point, dtype=float)
        name = "tool" if kind == "fixed" else f"l{i}"
        joints.append(Joint(f"j{i + 1}", JointType(kind), last, name, T, np.array(axis, dtype=float)))
        last = name
    links = {name: Link(name) for name in ("root", *(j.child for j in joints))}
    return Robot(Description("arm", "root", links, tuple(joints)))


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_transforms_and_their_inverses(convention: str) -> None:
    rng = np.random.default_rng(0)
    theta, d, a, alpha = rng.normal(size=(4, 30))
    A = dh_transform(theta, d, a, alpha, convention)
    for i in range(30):
        Z, X = np.eye(4), np.eye(4)
        Z[:3, :3], Z[2, 3] = so3.basic("z", theta[i]), d[i]
        X[:3, :3], X[0, 3] = so3.basic("x", alpha[i]), a[i]
        np.testing.assert_allclose(A[i], Z @ X if convention == "standard" else X @ Z, atol=1e-15)
    back = inverse_dh_transform(theta, d, a, alpha, convention) @ A
    np.testing.assert_allclose(back, np.broadcast_to(np.eye(4), A.shape), atol=1e-14)
    with pytest.raises(InputError, match="convention is 'craig'; expected one of 'standard', 'modified'"):
        dh_transform(0, 0, 0, 0, "craig")


@pytest.mark.parametrize("seed", range(12))
def test_tables_of_random_chains_give_the_same_poses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = Robot(random_tree(seed, 9, serial=True), base=random_pose(rng))
    frame = robot.frame_names[-1]
    table = dh_table(robot, frame)
    q = rng.uniform(-2, 2, (20, robot.n))
    np.testing.assert_allclose(table.fk(q), robot.fk(q, frame), atol=1e-11)
    np.testing.assert_allclose(table.modified().fk(q), robot.fk(q, frame), atol=1e-11)
    assert table.modified().modified().convention == "modified"
    # the tool is a turn about and a shift along z
    np.testing.assert_allclose(table.tool[:3, 2], [0, 0, 1], atol=1e-13)
    np.testing.assert_allclose(table.tool[:2, 3], [0, 0], atol=1e-12)


def test_special_positions_of_axes() -> None:
    """Parallel, antiparallel, coincident, intersecting, and prismatic in a row."""
    z, x, down = [0, 0, 1], [1, 0, 0], [0, 0, -1]
    arms = [
        [("revolute", [0, 0, 0], z), ("revolute", [1, 0, 0.3], z), ("revolute", [1, 2, 0], down)],
        [("revolute", [0, 0, 0], z), ("revolute", [0, 0, 1], z), ("revolute", [0, 0, 2], down)],
        [("revolute", [0, 0, 0], z), ("revolute", [0, 0, 1], x), ("revolute", [3, 0, 1], z)],
        [("prismatic", [0, 1, 0], x), ("prismatic", [0, 0, 2], z), ("revolute", [0, 5, 0], [0, 1, 0])],
        [("prismatic", [0, 1, 0], x), ("revolute", [0, 0, 2], x)],
        [("revolute", [4, 1, 0], down)],
    ]
    rng = np.random.default_rng(0)
    for axes in arms:
        robot = chain_of(axes, [0.1, 0.2, 0.3])
        table = dh_table(robot, "tool")
        q = rng.uniform(-2, 2, (10, robot.n))
        np.testing.assert_allclose(table.fk(q), robot.fk(q, "tool"), atol=1e-14)


def test_planar_arm_has_its_textbook_table() -> None:
    robot = chain_of([("revolute", [0, 0, 0], [0, 0, 1]), ("revolute", [0.4, 0, 0], [0, 0, 1])], [0.7, 0, 0])
    table = dh_table(robot, "tool")
    assert [r.a for r in table.rows] == pytest.approx([0.4, 0.3])
    for row in table.rows:
        assert (row.theta, row.d, row.alpha) == pytest.approx((0, 0, 0))
    np.testing.assert_allclose(table.base, np.eye(4))
    np.testing.assert_allclose(table.tool, np.eye(4), atol=1e-15)
    assert "j2" in str(table)
    assert "standard DH" in str(table)


def test_a_frame_that_nothing_moves_has_no_table() -> None:
    robot = Robot(random_tree(0))
    with pytest.raises(InputError, match=r"no joint of robot 'random0' moves frame 'root'"):
        dh_table(robot, "root")


def test_mimicking_joints_keep_their_gain() -> None:
    description = random_tree(7, 9, serial=True)
    joints = list(description.joints)
    movers = [i for i, j in enumerate(joints) if j.type is not JointType.FIXED and j.mimic is None]
    joints[movers[-1]] = dataclasses.replace(joints[movers[-1]], mimic=Mimic(joints[movers[0]].name, -0.5, 0.2))
    joints = [
        dataclasses.replace(j, mimic=None) if j.mimic and j.mimic.joint == joints[movers[-1]].name else j
        for j in joints
    ]
    robot = Robot(dataclasses.replace(description, joints=tuple(joints)))
    q = np.random.default_rng(0).normal(size=(5, robot.n))
    frame = robot.frame_names[-1]
    np.testing.assert_allclose(dh_table(robot, frame).fk(q), robot.fk(q, frame), atol=1e-11)
