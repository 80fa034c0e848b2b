"""Hands with several fingers: postures, closing on nothing, closing on a ball, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.errors import InputError
from apprehend.kinematics import Hand
from apprehend.robots.description import Joint, JointLimits, JointType
from apprehend.sim import CloseStatus, Fingers, FingerState, World, close_fingers
from apprehend.sim.model import LOSSES, losses

from .scenes import pendulum, scene, translation


def hand() -> Hand:
    pytest.importorskip("cmeel", reason="the extra [robots] is not installed")
    return Hand.load("allegro_right")


def test_moves_to_a_posture_and_finds_nothing() -> None:
    allegro = hand()
    world = World(scene(allegro.robot))
    fingers = Fingers(world, allegro)
    q = allegro.robot.home + 0.2
    fingers.move(world, q, speed=1.0)
    start = world.time
    assert world.run(2.0, fingers, until=lambda _: fingers.state is FingerState.ARRIVED)
    assert world.time - start == pytest.approx(0.2, abs=0.1)
    world.run(0.2, fingers)
    assert np.abs(fingers.positions(world) - q).max() < 0.02
    empty = close_fingers(world, fingers, [q + 0.2, q + 0.3], [0.2, 0.2])
    assert empty.status is CloseStatus.EMPTY
    assert "felt nothing" in empty.explain()


def test_torques_press_on_what_is_in_the_way() -> None:
    allegro = hand()
    tip = allegro.robot.fk(allegro.robot.home, "link_3.0_tip")[:3, 3]
    ball = Body.sphere(0.02, mass=5000.0, name="object")  # so heavy that it stays for the time of the test
    still = scene(allegro.robot, object=(ball, translation(*(tip + [0.034, 0.0, 0.0]))))
    world = World(replace(still, gravity=0.0))
    fingers = Fingers(world, allegro)
    bent = allegro.robot.home.copy()
    bent[1] += 0.8
    felt = close_fingers(world, fingers, [bent], [1.0])
    assert felt.status is CloseStatus.ONE_SIDED
    fingers.rest(world)
    torques = np.zeros(allegro.n)
    torques[1] = 0.3
    fingers.press(torques)
    assert world.run(1.0, fingers, until=lambda _: fingers.state is FingerState.HOLDING)
    world.run(0.5, fingers)
    work = []
    for _ in range(200):  # the torque meets the force of the contact; what is hard chatters, so on average
        world.run(world.timestep, fingers)
        J = allegro.robot.jacobian(fingers.positions(world), "link_3.0_tip")
        origin = world.frame("link_3.0_tip")[:3, 3]
        slopes = [J[:3, 1] + np.cross(J[3:, 1], touch.position - origin) for touch in world.contacts("object")]
        work.append(sum(world.contact_force("object")[:3] @ slope for slope in slopes))
    assert np.mean(work) == pytest.approx(0.3, abs=0.12)  # the joint's dry friction is 0.07 N m


def test_what_is_refused() -> None:
    allegro = hand()
    world = World(scene(allegro.robot))
    fingers = Fingers(world, allegro)
    with pytest.raises(InputError, match="speed is 0"):
        fingers.move(world, allegro.robot.home, speed=0.0)
    with pytest.raises(InputError, match="path has 1 points, durations 2"):
        fingers.close(world, [allegro.robot.home], [1.0, 1.0])
    with pytest.raises(InputError, match="is not a joint of robot 'pendulum'"):
        Fingers(World(scene(pendulum())), allegro)


def test_a_drive_overcomes_its_own_friction() -> None:
    def joint(friction: float, damping: float, effort: float = 0.7) -> Joint:
        limits = JointLimits(-1.0, 1.0, 7.0, 50.0, effort)
        return Joint(
            "j", JointType.REVOLUTE, "a", "b", np.eye(4), np.array([0.0, 0.0, 1.0]), limits,
            friction=friction, damping=damping,
        )  # fmt: skip

    assert losses(joint(0.1, 0.05)) == (0.1, 0.05, None)
    friction, damping, sentence = losses(joint(10.0, 3.0))
    assert friction == pytest.approx(LOSSES * 0.7)
    assert damping * 7.0 == pytest.approx(LOSSES * 0.7)
    assert sentence is not None
    assert "an effort of 0.7 could not move it against its dry friction of 10 and damping of 3" in sentence
    assert losses(joint(10.0, 3.0, effort=np.inf))[2] is None
