"""Computed torque: follows a motion, carries a load, keeps to the limits and says when it could not."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.errors import InputError
from apprehend.sim import JointController, World

from .scenes import hold, pendulum, rig, scene


def swing(amplitude: float = 0.8, omega: float = 3.0):  # type: ignore[no-untyped-def]
    def motion(t: float, order: int) -> np.ndarray:
        return np.array([amplitude * omega**order * np.sin(omega * t + order * np.pi / 2)])

    return motion


def test_follows_a_motion_to_the_integration_error() -> None:
    world = World(scene(pendulum()))
    world.set_q(swing()(0.0, 0), swing()(0.0, 1))
    controller = JointController(world, motion=swing(), duration=2.0)
    world.run(2.0, controller)
    assert controller.finished(world)
    assert controller.worst_error.max() < 2e-3
    assert not controller.saturation.any
    world.run(0.5, controller)  # holds the end
    assert world.q == pytest.approx(swing()(2.0, 0), abs=1e-4)


def test_damping_of_a_joint_is_compensated() -> None:
    world = World(scene(pendulum(damping=5.0)))
    world.set_q(swing()(0.0, 0), swing()(0.0, 1))
    controller = JointController(world, motion=swing(), duration=2.0)
    world.run(2.0, controller)
    assert controller.worst_error.max() < 2e-3


def test_an_arm_follows_all_its_joints() -> None:
    robot = rig("ur5e").robot
    world = World(scene(robot))
    world.set_q(robot.home)
    step = np.where(np.arange(robot.n) < 6, 0.4, 0.3)

    def motion(t: float, order: int) -> np.ndarray:
        s = t / 1.5
        value = (10 * s**3 - 15 * s**4 + 6 * s**5, 30 * s**2 - 60 * s**3 + 30 * s**4, 60 * s - 180 * s**2 + 120 * s**3)[
            order
        ]
        return (robot.home if order == 0 else 0.0) + step * value / 1.5**order

    controller = JointController(world)
    controller.follow(world, motion, 1.5)
    world.run(1.5, controller)
    assert controller.worst_error.max() < 2e-3
    assert world.q == pytest.approx(robot.home + step, abs=1e-3)
    assert controller.saturation.total_steps == 750


def test_a_known_load_is_carried_without_error() -> None:
    held = hold("ur5e", Body.box([0.05, 0.04, 0.03], mass=1.0), 30.0)
    held.turn_gravity_on()
    held.world.run(0.3, held.arm, held.gripper)
    assert np.abs(held.arm.error(held.world)).max() < 1e-6
    held.arm.load = None
    held.world.run(0.3, held.arm, held.gripper)
    assert np.abs(held.arm.error(held.world)).max() > 1e-4


def test_saturation_is_counted_not_hidden() -> None:
    world = World(scene(pendulum(effort=5.0)))  # needs 9.81 N m to hold itself
    controller = JointController(world)
    world.run(0.2, controller)
    found = controller.saturation
    assert found.any
    assert found.steps[0] == 100
    assert found.worst[0] > 9.81 / 5.0 * 0.99
    assert np.abs(world.tau).max() <= 5.0
    assert world.q[0] > 0.05  # it sank


def test_bad_arguments() -> None:
    world = World(scene(pendulum()))
    with pytest.raises(InputError, match="coordinates are"):
        JointController(world, [3])
    with pytest.raises(InputError, match=r"bandwidth is 1000000\.0 rad/s; expected more than 0 and at most 250"):
        JointController(world, bandwidth=1e6)
    controller = JointController(world)
    with pytest.raises(InputError, match="the motion has duration None"):
        controller.follow(world, swing())
    with pytest.raises(InputError, match=r"motion\(0, 0\) has shape \(2,\); expected \(1,\)"):
        controller.follow(world, lambda t, order: np.zeros(2), 1.0)
