"""Hands: where they begin, their fingers, and jaws found from geometry alone."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from apprehend.errors import DescriptionError, InputError, MissingDependencyError, UnknownNameError
from apprehend.kinematics import Hand, ParallelJaw, Robot
from apprehend.robots import Actuator, parse_urdf
from tests.kinematics.hands import box, hinged, sliding


def load(name: str) -> Hand:
    try:
        return Hand.load(name)
    except MissingDependencyError as error:
        pytest.skip(str(error))


def lawful(jaw: ParallelJaw) -> None:
    """What holds for every jaw."""
    widths = np.linspace(jaw.min_width, jaw.max_width, 23)
    q = jaw.q_at(widths)
    assert q.shape == (23, jaw.robot.n)
    assert jaw.robot.limits.contains(q, -1e-9).all()
    assert np.abs(jaw.width_of(q) - widths).max() < 1e-9
    T = jaw.tcp_at(widths)
    R = T[:, :3, :3]
    assert np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max() < 1e-12
    assert np.allclose(np.linalg.det(R), 1)
    p0, p1 = jaw.pads(q)
    assert np.allclose(0.5 * (p0 + p1), T[:, :3, 3], atol=1e-12)
    wide = widths > 2e-3
    assert np.abs(np.cross(p0 - p1, R[:, :, 0])[wide]).max() < 1e-9  # x runs from pad 1 to pad 0
    assert (np.einsum("ij,ij->i", p0 - p1, R[:, :, 0])[wide] > 0).all()
    assert np.allclose(jaw.q_at(float(widths[5])), q[5], rtol=0, atol=1e-12)
    assert jaw.finger_depth > 0
    assert jaw.tip_length > 0
    assert min(jaw.pad_size) > 0


def test_a_slider_is_measured_as_it_was_made() -> None:
    jaw = sliding().jaw
    lawful(jaw)
    assert jaw.max_width == pytest.approx(0.06, abs=1e-5)
    assert jaw.min_width == pytest.approx(0.0, abs=1e-5)
    assert set(jaw.pad_links) == {"a", "b"}
    assert jaw.pad_size == pytest.approx((0.02, 0.02), abs=1e-3)
    assert jaw.finger_depth == pytest.approx(0.06, abs=1e-3)
    assert jaw.tip_length == pytest.approx(0.01, abs=1e-3)
    assert jaw.max_force == pytest.approx(15.0, rel=1e-6)  # one motor of 30 N drives both: F · 2 dq = 30 dq
    T = jaw.tcp_at(0.03)
    assert np.allclose(T[:3, 3], [0, 0, 0.09], atol=1e-3)
    assert np.allclose(T[:3, 2], [0, 0, 1], atol=1e-9)
    assert np.allclose(np.abs(T[:3, 0]), [0, 1, 0], atol=1e-9)


def test_what_has_no_collision_geometry_is_as_large_as_it_looks() -> None:
    hand = sliding()
    description = hand.robot.description
    links = dict(description.links)
    for name in ("a", "palm"):
        links[name] = dataclasses.replace(links[name], visuals=links[name].collisions, collisions=())
    seen = Hand(Robot(dataclasses.replace(description, links=links))).jaw
    assert np.array_equal(seen.tcp_at(0.02), hand.jaw.tcp_at(0.02))
    assert (seen.max_width, seen.finger_depth) == (hand.jaw.max_width, hand.jaw.finger_depth)


def test_two_motors_hold_with_the_weaker() -> None:
    jaw = sliding(mimic=False).jaw
    lawful(jaw)
    assert jaw.max_width == pytest.approx(0.06, abs=1e-5)
    assert jaw.max_force == pytest.approx(30.0, rel=1e-6)
    assert np.allclose(jaw.q_at(0.06), [0.03, -0.03], atol=1e-6)


def test_a_motor_on_a_tendon_bounds_the_force() -> None:
    hand = sliding(effort=0.0)  # zero means not given
    assert hand.jaw.max_force == math.inf
    pull = Actuator("pull", {"left": 0.5, "right": -0.5}, -100.0, 40.0)  # right = −left: together 1 N for each newton
    driven = Hand(Robot(dataclasses.replace(hand.robot.description, actuators=(pull,))))
    assert driven.jaw.max_force == pytest.approx(50.0, rel=1e-6)


@pytest.mark.parametrize("turn", ["0.3 0 0", "0 0.9 0", "0.2 -0.4 1.0", "3.14159 0 0"])
def test_the_jaw_turns_with_the_palm(turn: str) -> None:
    straight, turned = sliding().jaw, sliding(turn=turn).jaw
    lawful(turned)
    mount = turned.robot.fk(turned.robot.home, "palm")
    assert np.allclose(turned.tcp_at(0.02)[:3, 2], mount[:3, 2], atol=1e-6)
    assert np.allclose(turned.tcp_at(0.02)[:3, 3], (mount @ straight.tcp_at(0.02))[:3, 3], atol=1.5e-3)
    assert turned.max_width == pytest.approx(straight.max_width, abs=1e-5)


def test_a_hinged_jaw() -> None:
    jaw = hinged().jaw
    lawful(jaw)
    assert jaw.pad_links == ("jaw", "fixed_jaw")
    assert jaw.min_width == pytest.approx(0.0, abs=1e-4)
    angle = float(jaw.q_at(jaw.max_width)[0])
    assert angle == pytest.approx(math.radians(60), abs=math.radians(1))  # pads face each other up to there
    assert jaw.max_width == pytest.approx(2 * 0.09 * math.sin(0.5 * angle), rel=0.05)
    assert jaw.max_force == pytest.approx(2 / 0.09, rel=0.1)
    assert jaw.tcp_at(jaw.min_width)[2, 2] == pytest.approx(1.0, abs=1e-6)


def test_robotiq_2f_85() -> None:
    hand = Hand.load("robotiq_2f_85")
    jaw = hand.jaw
    lawful(jaw)
    assert set(jaw.pad_links) == {"left_inner_finger_pad", "right_inner_finger_pad"}
    assert jaw.max_width == pytest.approx(0.085, abs=2e-3)
    assert jaw.min_width < 3e-3
    assert jaw.pad_size == pytest.approx((0.022, 0.0375), abs=5e-4)
    assert jaw.max_force == pytest.approx(235, rel=0.01)
    rise = jaw.tcp_at(jaw.min_width)[2, 3] - jaw.tcp_at(jaw.max_width)[2, 3]
    assert 0.010 < rise < 0.018  # the pads travel on an arc
    assert np.allclose(jaw.tcp_at(0.04)[:3, 2], [0, 0, 1], atol=1e-6)
    assert [f.tip for f in hand.fingers] == list(jaw.pad_links)


def test_panda_hand() -> None:
    hand = load("panda_hand")
    jaw = hand.jaw
    lawful(jaw)
    assert jaw.max_width == pytest.approx(0.08, abs=1e-4)
    assert jaw.max_force == pytest.approx(70, rel=1e-3)
    tcp = hand.robot.fk(hand.robot.home, "panda_hand_tcp")
    assert np.allclose(jaw.tcp_at(0.04)[:3, 3], tcp[:3, 3], atol=1e-3)
    assert np.allclose(jaw.tcp_at(0.04)[:3, 2], [0, 0, 1], atol=1e-9)


def test_a_hand_within_an_arm_is_the_hand_alone() -> None:
    alone = load("panda_hand")
    arm = Robot.load("panda")
    hand = Hand.within(arm)
    assert hand.root == "panda_hand"
    assert hand.indices_in(arm).tolist() == [7]
    assert np.allclose(hand.jaw.tcp_at(0.03), alone.jaw.tcp_at(0.03), atol=1e-9)


def test_a_hand_attached_to_an_arm() -> None:
    arm = Robot.load("ur5e").attach(Robot.load("robotiq_2f_85"), "tool0", prefix="hand_")
    hand = Hand.within(arm)
    assert hand.root == "hand_base_link"
    assert hand.indices_in(arm).tolist() == [6]
    named = Hand.within(arm, "hand_base_link_inertia")
    alone = Hand.load("robotiq_2f_85")
    assert np.allclose(hand.jaw.tcp_at(0.05), alone.jaw.tcp_at(0.05), atol=1e-9)
    q = np.concatenate([arm.home[:6], hand.jaw.q_at(0.05)])
    through = [arm.fk(q, h.root) @ h.jaw.tcp_at(0.05) for h in (hand, named)]
    assert np.allclose(through[0][:3, 3], through[1][:3, 3], atol=1e-3)


@pytest.mark.parametrize(
    ("name", "root", "pads"),
    [
        ("pr2_gripper", "r_gripper_palm_link", {"r_gripper_l_finger_tip_link", "r_gripper_r_finger_tip_link"}),
        ("z1", None, {"gripperMover", "gripperStator"}),
        ("so101", None, {"moving_jaw_so101_v1_link", "gripper_link"}),
        ("baxter", "left_gripper_base_link", {"l_gripper_l_finger_tip", "l_gripper_r_finger_tip"}),
        (
            "tiago_pro",
            "gripper_left_base_link",
            {"gripper_left_fingertip_right_link", "gripper_left_fingertip_left_link"},
        ),
    ],
)
def test_other_jaws_are_found(name: str, root: str | None, pads: set[str]) -> None:
    hand = Hand.within(load(name).robot, root)
    lawful(hand.jaw)
    assert set(hand.jaw.pad_links) == pads
    assert 0.05 < hand.jaw.max_width < 0.12


def test_fingers_that_meet_at_their_bases_grip_with_the_larger_faces_beyond() -> None:
    foot = box("0.02 0.03 0.02", "0 {side}0.015 0.04") + box("0.02 0.01 0.08", "0 {side}0.015 0.08")
    text = f"""<robot name="r"><link name="palm">{box("0.1 0.1 0.02", "0 0 0")}</link>
<link name="a">{foot.format(side="")}</link><link name="b">{foot.format(side="-")}</link>
<joint name="i" type="prismatic"><parent link="palm"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="0" upper="0.02"/></joint><joint name="j" type="prismatic"><parent link="palm"/><child link="b"/>
<axis xyz="0 -1 0"/><limit lower="0" upper="0.02"/><mimic joint="i"/></joint></robot>"""
    jaw = Hand(Robot(parse_urdf(text))).jaw
    lawful(jaw)
    assert (jaw.min_width, jaw.max_width) == pytest.approx((0.02, 0.06), abs=1e-5)
    assert jaw.pad_size == pytest.approx((0.02, 0.07), abs=1e-3)


def test_so101_tcp_is_at_its_own_frame() -> None:
    hand = Hand.within(load("so101").robot)
    frame = hand.robot.fk(hand.robot.home, "gripper_frame_link")[:3, 3]
    assert np.abs(hand.jaw.tcp_at(hand.jaw.min_width)[:3, 3] - frame).max() < 3e-3


def test_fingers_of_a_multi_finger_hand() -> None:
    hand = load("allegro_right")
    assert hand.palm == "palm_link"
    assert not hand.is_jaw
    assert [f.tip for f in hand.fingers] == ["link_3.0_tip", "link_7.0_tip", "link_11.0_tip", "link_15.0_tip"]
    assert [f.joints for f in hand.fingers] == [(0, 1, 2, 3), (4, 5, 6, 7), (8, 9, 10, 11), (12, 13, 14, 15)]
    index = hand.fingers[0]
    assert index.tip_point[2] == pytest.approx(0.012, abs=1e-3)  # a sphere of 12 mm
    with pytest.raises(DescriptionError, match="has 16 coordinates; a parallel jaw closes with one, or one for each"):
        _ = hand.jaw


# ---- what is refused


def test_widths_outside_the_stroke() -> None:
    jaw = sliding().jaw
    with pytest.raises(InputError, match=r"width is 0\.07 m; hand 'slider' opens from .* to 0\.06 m"):
        jaw.q_at([0.01, 0.07])
    with pytest.raises(InputError, match=r"width is -0\.01 m"):
        jaw.tcp_at(-0.01)
    with pytest.raises(InputError, match="width is nan; every entry must be finite"):
        jaw.q_at(math.nan)


def test_a_robot_without_joints_is_no_hand() -> None:
    with pytest.raises(DescriptionError, match="has no joint that moves: it is not a hand"):
        Hand(Robot(parse_urdf('<robot name="r"><link name="a"/></robot>')))


def test_a_hand_without_fingers_says_so() -> None:
    with pytest.raises(DescriptionError, match="its fingers have no geometry"):
        _ = Hand.load("schunk_egk40").jaw


def test_parts_that_do_not_close() -> None:
    text = f"""<robot name="lid"><link name="a">{box("0.1 0.1 0.01", "0 0 0")}</link>
<link name="b">{box("0.1 0.1 0.01", "0 0 0.05")}</link>
<joint name="slide" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.02"/></joint></robot>"""
    with pytest.raises(DescriptionError, match="no two parts close on each other when slide moves through the limits"):
        _ = Hand(Robot(parse_urdf(text))).jaw


def test_a_jaw_needs_limits() -> None:
    text = f"""<robot name="r"><link name="a">{box("1 1 1", "0 0 0")}</link>
<link name="b">{box("1 1 1", "0 0 0")}</link>
<joint name="turn" type="continuous"><parent link="a"/><child link="b"/></joint></robot>"""
    with pytest.raises(DescriptionError, match="a jaw needs finite limits on turn"):
        _ = Hand(Robot(parse_urdf(text))).jaw


def test_where_a_hand_begins_must_be_clear() -> None:
    with pytest.raises(DescriptionError, match="is one serial chain: no hand was found at its end; pass root_link="):
        Hand.within(Robot.load("ur5e"))
    with pytest.raises(UnknownNameError, match=r"no link named 'tool1' in robot 'ur5e'\. Did you mean 'tool0'"):
        Hand.within(Robot.load("ur5e"), "tool1")
    with pytest.raises(DescriptionError, match=r"divides at 'palm' already \(into 'a', 'b'\), before any arm"):
        Hand.within(sliding().robot)
