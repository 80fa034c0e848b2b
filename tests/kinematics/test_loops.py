"""Closed chains that were cut: constraints, their Jacobians, and Newton against the closed form of the four-bar."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from apprehend.errors import DescriptionError, InputError
from apprehend.kinematics import (
    LoopConstraint,
    LoopStatus,
    Robot,
    close_loops,
    loop_jacobian,
    loop_motions,
    loop_residual,
)
from apprehend.robots import Loop, parse_urdf
from tests.kinematics.trees import random_pose, random_tree

A, B, C, D = 0.2, 0.5, 0.4, 0.55
"""Lengths of crank, coupler, rocker and frame."""

FOUR_BAR = f"""<robot name="four_bar"><link name="ground"/><link name="crank"/><link name="coupler"/>
<link name="rocker"/>
<joint name="drive" type="continuous"><parent link="ground"/><child link="crank"/><axis xyz="0 0 1"/></joint>
<joint name="knee" type="continuous"><parent link="crank"/><child link="coupler"/><origin xyz="{A} 0 0"/>
<axis xyz="0 0 1"/></joint>
<joint name="out" type="revolute"><parent link="ground"/><child link="rocker"/><origin xyz="{D} 0 0"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3"/></joint>
<joint name="tip" type="revolute"><parent link="rocker"/><child link="coupler"/><origin xyz="{C} 0 0"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3"/></joint></robot>"""


def closed_form(drive: float) -> float:
    """Angle of the rocker (Freudenstein), elbow up."""
    x, y = A * np.cos(drive) - D, A * np.sin(drive)
    d = np.hypot(x, y)
    return float(np.arctan2(y, x) - np.arccos((d * d + C * C - B * B) / (2.0 * d * C)))


def four_bar() -> Robot:
    # the tip of the rocker is where the coupler ends: the coupler's frame begins at the knee
    robot = Robot(parse_urdf(FOUR_BAR, loops="cut"))
    loop = robot.description.loops[0]
    end = np.eye(4)
    end[0, 3] = B
    return Robot(replace(robot.description, loops=(replace(loop, T_second=end),)))


def test_a_four_bar_closes_as_the_closed_form_says() -> None:
    robot = four_bar()
    drive = np.linspace(-np.pi, np.pi, 25)
    guess = np.stack([drive, 0.8 - drive, np.full(25, 1.9)], axis=-1)
    answer = close_loops(robot, guess, hold=("drive",)).require_success()
    assert np.abs(loop_residual(robot, answer.q)).max() < 1e-12
    assert np.array_equal(answer.q[:, robot.index("drive")], drive)
    expected = [closed_form(x) for x in drive]
    turns = (answer.q[:, robot.index("out")] - expected) / (2.0 * np.pi)
    assert np.abs(turns - np.round(turns)).max() < 1e-12
    joint = robot.loops[0].value(answer.q)
    x = answer.q
    apart = (x[:, 0] + x[:, 1] - x[:, 2] - joint) / (2.0 * np.pi)
    assert np.abs(apart - np.round(apart)).max() < 1e-12


def test_a_closed_four_bar_moves_one_way() -> None:
    robot = four_bar()
    q = close_loops(robot, [0.7, 0.3, 1.5], hold=("drive",)).require_success().q
    motions = loop_motions(robot, q)
    assert motions.shape == (3, 1)
    h = 1e-6
    again = close_loops(robot, q + [h, 0.0, 0.0], hold=("drive",)).require_success().q
    assert np.allclose((again - q) / h, motions[:, 0] / motions[0, 0], atol=1e-4)


@pytest.mark.parametrize("free", ["point", "pose", "revolute", "prismatic"])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_jacobian_is_the_derivative_of_the_residual(free: str, seed: int) -> None:
    description = random_tree(seed, 9)
    rng = np.random.default_rng(seed)
    names = list(description.links)
    axis = rng.normal(size=3)
    loop = Loop("l", names[3], names[-1], random_pose(rng), random_pose(rng), free, axis / np.linalg.norm(axis))
    robot = Robot(replace(description, loops=(loop,)))
    constraint = robot.loops[0]
    q = rng.uniform(-1, 1, (2, robot.n))
    assert constraint.residual(q).shape == (2, constraint.size)
    J = constraint.jacobian(q)
    h = 1e-6
    for i in range(robot.n):
        step = np.eye(robot.n)[i] * h
        slope = (constraint.residual(q + step) - constraint.residual(q - step)) / (2 * h)
        assert np.abs(J[..., i] - slope).max() < 1e-7
    assert np.array_equal(loop_jacobian(robot, q), J)


@pytest.mark.parametrize("free", ["pose", "revolute", "prismatic"])
def test_the_residual_vanishes_where_the_frames_meet(free: str) -> None:
    description = random_tree(3, 6)
    robot = Robot(description)
    rng = np.random.default_rng(5)
    q = rng.uniform(-1, 1, robot.n)
    names = robot.frame_names
    first, second = robot.fk(q, names[2]), robot.fk(q, names[-1])
    meet = np.linalg.inv(second) @ first
    axis = np.array([0.0, 0.6, 0.8])
    closed = Loop("l", names[2], names[-1], np.eye(4), meet, free, axis)
    assert np.abs(LoopConstraint(robot, closed).residual(q)).max() < 1e-14
    if free != "pose":
        assert LoopConstraint(robot, closed).value(q) == pytest.approx(0.0, abs=1e-14)


def test_mujoco_agrees_on_what_a_weld_and_a_point_demand(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    text = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="j1" axis="0 1 0"/><geom size="0.1"/>
    <body name="b" pos="0.3 0 0"><joint name="j2" axis="0 1 1"/><geom size="0.1"/></body></body>
    <body name="c" pos="0.4 0.1 0.9"><joint name="j3" axis="1 0 0"/><joint name="j4" type="slide" axis="0 0 1"/>
    <geom size="0.1"/></body></worldbody>
    <equality><connect name="pin" body1="b" body2="c" anchor="0.1 0.02 0.03"/>
    <weld name="glue" body1="a" body2="c" relpose="0.4 0 0 1 0.1 0 0"/></equality></mujoco>"""
    path = tmp_path / "m.xml"
    path.write_text(text)
    with pytest.raises(DescriptionError, match="closes a chain: it ties body 'b' to 'c'; pass"):
        Robot.load(path)
    robot, model = Robot.load(path, loops="cut"), mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    assert [(loop.name, loop.size) for loop in robot.loops] == [("pin", 3), ("glue", 6)]
    q = np.array([0.3, -0.4, 0.2, 0.05])
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    # MuJoCo's rows 0–2 are the vector between the anchors, in axes of the world
    for loop, row in zip(robot.loops, (0, 3), strict=True):
        frame = robot.fk(q, loop.loop.first) @ loop.loop.T_first
        assert np.allclose(
            np.abs(frame[:3, :3] @ loop.relative(q)[:3, 3]), np.abs(data.efc_pos[row : row + 3]), atol=1e-9
        )


def test_loops_that_cannot_close_are_told() -> None:
    robot = four_bar()
    long = np.eye(4)
    long[0, 3] = 2.0
    torn = Robot(replace(robot.description, loops=(replace(robot.description.loops[0], T_second=long),)))
    answer = close_loops(torn, [0.5, 0.2, 1.5])
    assert answer.status is LoopStatus.OPEN
    assert not answer.closed
    assert "loop 'tip' is open by" in answer.explain()
    narrow = [
        replace(j, type=j.type.REVOLUTE, limits=replace(j.limits, lower=-0.1, upper=0.1))
        for j in robot.description.joints
    ]
    tight = Robot(replace(robot.description, joints=tuple(narrow)))
    beyond = close_loops(tight, [0.5, 0.2, 1.5], hold=("drive",))
    assert beyond.status is LoopStatus.LIMIT
    assert beyond.closed
    assert "not in [-0.1, 0.1]" in beyond.explain()


def test_mistakes_are_named() -> None:
    with pytest.raises(DescriptionError, match="closed chain: link 'coupler' is the child of joint 'knee'"):
        parse_urdf(FOUR_BAR)
    robot = Robot(random_tree(0, 4))
    with pytest.raises(InputError, match="has no loops; read a description that closes chains with loops='cut'"):
        close_loops(robot, np.zeros(robot.n))
    with pytest.raises(InputError, match="motions belong to one configuration"):
        loop_motions(four_bar(), np.zeros((2, 3)))
    point = replace(four_bar().description.loops[0], free="point")
    with pytest.raises(InputError, match="loop 'tip' was cut at a point, which has no joint value"):
        LoopConstraint(four_bar(), point).value(np.zeros(3))
