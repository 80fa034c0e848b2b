"""Opening, closing until felt, holding with a set force."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.collision.scene import Box
from apprehend.errors import InputError
from apprehend.kinematics import Hand
from apprehend.sim import Gripper, GripStatus, JawState, JointController, World, grip
from apprehend.sim.gripper import START, finger_links

from .scenes import hold, rig, scene, translation

ARMS = ["ur5e", "panda"]


@pytest.mark.parametrize("name", ARMS)
def test_moves_to_a_width_at_a_speed(name: str) -> None:
    at = rig(name)
    world = World(scene(at.robot, hand_root=at.hand_root))
    world.set_q(at.q)
    gripper, arm = Gripper(world, at.hand), JointController(world, range(at.robot.n - at.hand.n))
    assert gripper.width(world) == pytest.approx(at.hand.jaw.max_width, abs=1e-4)
    gripper.move(world, 0.02, speed=0.1)
    start = world.time
    assert world.run(2.0, arm, gripper, until=lambda _: gripper.state is JawState.ARRIVED)
    assert world.time - start == pytest.approx((at.hand.jaw.max_width - 0.02) / 0.1 + 0.5 * 0.1 / START, abs=0.1)
    world.run(0.3, arm, gripper)
    assert gripper.width(world) == pytest.approx(0.02, abs=1e-4)
    apart = at.hand.jaw.width_of(world.q[at.hand.indices_in(at.robot)])
    assert apart == pytest.approx(0.02, abs=1e-4)


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("force", [2.0, 20.0, 60.0])
def test_pads_press_with_the_commanded_force(name: str, force: float) -> None:
    held = hold(name, Body.box([0.04, 0.03, 0.025], mass=0.2), force)
    assert held.result.require_success().status is GripStatus.SUCCESS
    held.world.run(0.3, held.arm, held.gripper)
    assert held.gripper.pad_forces(held.world) == pytest.approx((force, force), rel=0.02)
    assert held.result.width == pytest.approx(0.04, abs=1.5e-3)
    wrench = held.world.contact_force("object")
    assert np.abs(wrench).max() < 0.02 * force
    held.gripper.press(0.5 * force)
    held.world.run(0.5, held.arm, held.gripper)
    assert held.gripper.state is JawState.HOLDING
    assert held.gripper.pad_forces(held.world) == pytest.approx((0.5 * force, 0.5 * force), rel=0.02)


@pytest.mark.parametrize("name", ARMS)
def test_an_object_off_centre_is_pushed_between_the_pads(name: str) -> None:
    held = hold(name, Body.box([0.03, 0.03, 0.025], mass=0.05), 5.0, offset=translation(0.012, 0.0, 0.0))
    assert held.result.success
    held.world.run(0.2, held.arm, held.gripper)
    tcp = held.world.frame(held.rig.hand.root) @ held.rig.hand.jaw.tcp_at(held.gripper.width(held.world))
    assert abs(np.linalg.solve(tcp, held.world.body_pose("object"))[0, 3]) < 1e-3


@pytest.mark.parametrize("name", ARMS)
def test_closing_on_nothing_is_reported(name: str) -> None:
    at = rig(name)
    world = World(scene(at.robot, hand_root=at.hand_root))
    world.set_q(at.q)
    result = grip(world, Gripper(world, at.hand), 10.0, JointController(world, range(at.robot.n - at.hand.n)))
    assert result.status is GripStatus.EMPTY
    assert "without anything between them. Width " in result.explain()
    assert result.width < 2e-3


def test_closing_on_something_fixed_is_reported_as_blocked() -> None:
    at = rig("ur5e")
    pose = at.tcp(0.03)
    post = Box("post", np.array([0.03, 0.03, 0.03]), pose)
    world = World(scene(at.robot, boxes=(post,), hand_root=at.hand_root))
    world.set_q(at.q)
    result = grip(world, Gripper(world, at.hand), 10.0, JointController(world, range(at.robot.n - at.hand.n)))
    assert result.status is GripStatus.BLOCKED
    assert result.width == pytest.approx(0.03, abs=3e-3)


def test_time_out_is_reported() -> None:
    at = rig("ur5e")
    world = World(scene(at.robot, hand_root=at.hand_root))
    world.set_q(at.q)
    arm = JointController(world, range(at.robot.n - at.hand.n))
    assert grip(world, Gripper(world, at.hand), 10.0, arm, time_limit=0.1).status is GripStatus.TIMEOUT


def test_fingers_are_all_that_moves_with_a_pad() -> None:
    at = rig("ur5e")
    one, two = (finger_links(at.robot.description, at.hand.root, pad) for pad in at.hand.jaw.pad_links)
    assert not set(one) & set(two)
    assert at.hand.jaw.pad_links[0] in one
    assert len(one) == len(two) == 4
    with pytest.raises(InputError, match="is not part of the hand"):
        finger_links(at.robot.description, at.hand.root, at.robot.frame_names[0])


def test_bad_commands() -> None:
    at = rig("ur5e")
    world = World(scene(at.robot, hand_root=at.hand_root))
    gripper = Gripper(world, at.hand)
    with pytest.raises(InputError, match=r"width is 0\.2 m; these jaws reach"):
        gripper.move(world, 0.2)
    with pytest.raises(InputError, match=r"force is 1000000.0 N; the pads of this hand press with up to"):
        gripper.close(world, 1e6)
    with pytest.raises(InputError, match="speed is 0"):
        gripper.close(world, 1.0, speed=0.0)
    with pytest.raises(InputError, match="the gripper holds nothing"):
        gripper.press(1.0)
    with pytest.raises(InputError, match="is not a joint of robot"):
        Gripper(world, Hand.load("robotiq_2f_85"))


@pytest.mark.parametrize("name", ARMS)
def test_letting_go_leaves_the_object_where_it_is(name: str) -> None:
    """A ball on a stand under the open hand: gripped, held, let go of, it stays."""
    ball = Body.sphere(0.03, mass=0.06)
    at = rig(name)
    tcp = at.tcp(0.06)
    stand = Box("stand", np.array([0.2, 0.2, 0.02]), translation(tcp[0, 3], tcp[1, 3], float(tcp[2, 3]) - 0.04))
    world = World(scene(at.robot, boxes=(stand,), hand_root=at.hand_root, object=(ball, translation(*tcp[:3, 3]))))
    world.set_q(at.q)
    arm, gripper = JointController(world, range(at.robot.n - at.hand.n)), Gripper(world, at.hand)
    world.settle(arm, gripper)
    grip(world, gripper, 8.0, arm).require_success()
    world.run(0.2, arm, gripper)
    before = world.body_pose("object")
    gripper.move(world, at.hand.jaw.max_width)
    world.run(2.0, arm, gripper)
    assert gripper.state is JawState.ARRIVED
    assert world.contact_force("object", at.robot.frame_names) == pytest.approx(np.zeros(6))
    assert np.linalg.norm((world.body_pose("object") - before)[:3, 3]) < 0.004
