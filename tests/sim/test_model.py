"""The engine's model equals the robot: kinematics, inertia, couplings; what cannot be taken as it stands is said."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.errors import DescriptionError, InputError
from apprehend.kinematics import Robot
from apprehend.robots.description import Inertial, Joint, JointLimits, JointType, Link, Shape, ShapeKind
from apprehend.sim import JointController, Physics, World, build
from apprehend.sim.model import physical
from tests.kinematics.trees import random_inertial, random_pose, random_tree

from .scenes import description, pendulum, rig, scene, table, translation


def postures(robot: Robot, count: int, seed: int = 0) -> np.ndarray:
    limits = robot.limits
    lower, upper = np.maximum(limits.lower, -3.0), np.minimum(limits.upper, 3.0)
    return np.random.default_rng(seed).uniform(lower, upper, (count, robot.n))


@pytest.mark.parametrize("seed", range(6))
def test_random_trees_have_the_kinematics_of_robot(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = Robot(random_tree(seed), base=random_pose(rng))
    world = World(scene(robot))
    for q in postures(robot, 5, seed):
        world.set_q(q)
        expected = robot.fk(q)
        found = np.array([world.frame(name) for name in robot.frame_names])
        assert np.abs(found - expected).max() < 1e-9
        assert np.array_equal(world.q, q)


@pytest.mark.parametrize("name", ["ur5e", "panda"])
def test_arms_with_hands_have_the_kinematics_of_robot(name: str) -> None:
    robot = rig(name).robot
    world = World(scene(robot))
    for q in postures(robot, 10):
        world.set_q(q)
        found = np.array([world.frame(link) for link in robot.frame_names])
        assert np.abs(found - robot.fk(q)).max() < 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_random_trees_have_the_dynamics_of_robot(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tree = random_tree(seed, armature=True)
    filled = {name: link if link.inertial else Link(name, random_inertial(rng)) for name, link in tree.links.items()}
    robot = Robot(dataclasses.replace(tree, links=filled))
    world = World(scene(robot))
    plant, model, data = world.plant, world.model, world.data
    assert not plant.assumptions
    for q in postures(robot, 3, seed):
        qd, qdd = rng.normal(size=(2, robot.n))
        world.set_q(q, qd)
        product, acceleration = np.zeros(model.nv), np.zeros(model.nv)
        acceleration[plant.joint_v] = plant.expand @ qdd
        mujoco.mj_mulM(model, data, product, acceleration)
        tau = plant.expand.T @ (product + data.qfrc_bias)[plant.joint_v]
        assert tau == pytest.approx(robot.inverse_dynamics(q, qd, qdd), rel=1e-6, abs=1e-6)


def test_mimicking_joints_follow_under_load() -> None:
    """Torque on the driver moves both fingers; the coupling gives by less than a milliradian."""
    at = rig("ur5e")
    world = World(scene(at.robot))
    driver = at.robot.index(at.hand.robot.joint_names[0])
    motion = np.array([at.robot.home, at.robot.home])
    motion[1, driver] += 0.6
    controller = JointController(world)
    controller.follow(
        world,
        lambda t, order: [motion[0] + (motion[1] - motion[0]) * t, motion[1] - motion[0], 0 * motion[0]][order],
        1.0,
    )
    world.run(1.2, controller)
    assert world.q[driver] == pytest.approx(motion[1, driver], abs=1e-3)
    joints = world.plant.expand @ world.q + world.plant.offset
    assert np.abs(world.data.qpos[world.plant.joint_q] - joints).max() < 1e-3


def test_mass_properties_are_those_of_the_body() -> None:
    body = Body.box([0.1, 0.06, 0.04], mass=0.7)
    offset = translation(0.03, 0.0, 0.0)
    world = World(scene(pendulum(), thing=(body, offset)))
    index = world.plant.bodies["thing"]
    assert world.model.body_mass[index] == pytest.approx(0.7)
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, world.model.body_iquat[index])
    R = axes.reshape(3, 3)
    assert R @ np.diag(world.model.body_inertia[index]) @ R.T == pytest.approx(body.inertia, abs=1e-9)
    assert world.model.body_ipos[index] == pytest.approx(body.com)
    assert np.array_equal(world.body_pose("thing"), offset)


def test_friction_in_a_contact_is_that_of_the_body() -> None:
    body = Body.box([0.1, 0.1, 0.1], mass=0.5, friction=0.37)
    world = World(scene(pendulum(), boxes=(table(),), thing=(body, translation(0.5, 0.5, 0.05))))
    world.settle()
    frictions = world.data.contact.friction
    assert len(frictions)
    assert frictions[:, 0] == pytest.approx(0.37)
    assert frictions[:, 2] == pytest.approx(body.torsional_friction)


def test_neighbours_and_allowed_pairs_do_not_touch_but_others_do() -> None:
    ball = Shape(ShapeKind.SPHERE, (0.06,), np.eye(4))
    inertial = Inertial(0.2, np.zeros(3), np.eye(3) * 1e-3)
    links = [Link(f"l{i}", inertial, (), (ball,)) for i in range(4)]
    joints = [
        Joint(f"j{i}", JointType.REVOLUTE, f"l{i}", f"l{i + 1}", translation(0.1, 0.0, 0.0), limits=JointLimits(-3, 3))
        for i in range(3)
    ]
    made = description("beads", links, joints)
    folded = [0.0, 2.6, 0.0]  # bead 3 comes back onto bead 0 and 1
    world = World(scene(Robot(made)))
    assert frozenset(("l0", "l1")) in world.plant.allowed
    assert frozenset(("l1", "l3")) not in world.plant.allowed
    world.set_q(folded)
    touching = {
        frozenset((world.plant.owners[a], world.plant.owners[b]))
        for a, b in world.model.geom_bodyid[world.data.contact.geom]
    }
    assert frozenset(("l1", "l3")) in touching
    assert all(pair not in world.plant.allowed for pair in touching)
    allowed = dataclasses.replace(made, allowed_collisions=frozenset({frozenset(("l1", "l3"))}))
    assert frozenset(("l1", "l3")) in build(scene(Robot(allowed))).allowed


def test_impossible_inertia_is_corrected_and_said() -> None:
    bad = np.diag([1.0, 0.1, 0.1])
    fixed, sentence = physical(bad)
    moments = np.linalg.eigvalsh(fixed)
    assert moments[2] <= moments[0] + moments[1] + 1e-12
    assert sentence is not None
    assert "no body has the principal moments" in sentence
    same, silent = physical(np.diag([1.0, 1.0, 1.5]))
    assert silent is None
    assert np.array_equal(same, np.diag([1.0, 1.0, 1.5]))
    robot = pendulum()
    links = {**robot.description.links, "arm": Link("arm", Inertial(1.0, np.zeros(3), bad))}
    plant = build(scene(Robot(dataclasses.replace(robot.description, links=links))))
    assert any("link arm" in s for s in plant.assumptions)


def test_moving_link_without_mass_is_given_one_and_said() -> None:
    robot = pendulum()
    links = {**robot.description.links, "arm": Link("arm")}
    plant = build(scene(Robot(dataclasses.replace(robot.description, links=links))))
    assert any("arm moves and has no mass; 1 g is assumed" in s for s in plant.assumptions)


def test_nothing_to_simulate_is_an_error() -> None:
    still = Robot(description("post", [Link("base")], []))
    with pytest.raises(InputError, match="neither a movable joint nor a movable body"):
        build(scene(still))


def test_the_engines_refusal_names_the_robot() -> None:
    robot = pendulum()
    joint = dataclasses.replace(robot.description.joints[0], limits=JointLimits(1.0, -1.0))
    with pytest.raises(DescriptionError, match="refuses the model of 'pendulum'"):
        build(scene(Robot(dataclasses.replace(robot.description, joints=(joint,)))))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"timestep": 0.1}, "timestep is 0.1 s"),
        ({"softness": 1.0}, "softness is 1.0 steps"),
        ({"impedance": (0.9, 1.0)}, "expected 0 < at zero penetration"),
        ({"impratio": 0.0}, "impratio is 0.0; expected a positive"),
        ({"rolling": -1.0}, "rolling is -1.0; expected 0 or more"),
        ({"iterations": -1}, "iterations is -1; expected 0 or more"),
    ],
)
def test_settings_out_of_range(change: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message.replace("(", r"\(")):
        Physics(**change)  # type: ignore[arg-type]
