"""Attaching and cutting descriptions."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.errors import InputError, UnknownNameError
from apprehend.robots import Description, JointType, attach, load_description, parse_urdf, renamed, subtree, without
from tests.robots.build import joint, link, robot


def arm() -> Description:
    return parse_urdf(robot(*(link(n) for n in "abc"), joint("ab", "a", "b"), joint("bc", "b", "c"), name="arm"))


def gripper() -> Description:
    return parse_urdf(
        robot(
            *(link(n) for n in ("p", "f", "g")),
            joint("pf", "p", "f"),
            joint("pg", "p", "g", inner='<limit lower="-1" upper="1"/><mimic joint="pf" multiplier="-1"/>'),
            name="gripper",
        )
    )


def test_attach_welds_the_root_at_a_pose() -> None:
    T = np.eye(4)
    T[:3, 3] = 1, 2, 3
    d = attach(arm(), gripper(), "c", T, prefix="left/")
    assert d.name == "arm+gripper"
    assert [j.name for j in d.free_joints] == ["ab", "bc", "left/pf"]
    weld = d.parent_joint["left/p"]
    assert (weld.type, weld.parent) == (JointType.FIXED, "c")
    assert np.array_equal(weld.pose, T)
    mimic = d.joint("left/pg").mimic
    assert mimic is not None
    assert (mimic.joint, mimic.multiplier) == ("left/pf", -1.0)


def test_attach_keeps_what_may_touch_and_repairs() -> None:
    hand = load_description("robotiq_2f_85")
    d = attach(load_description("ur5e"), hand, "tool0", prefix="h_")
    assert frozenset(("h_left_inner_knuckle", "h_left_inner_finger")) in d.allowed_collisions
    assert set(hand.repairs) <= set(d.repairs)
    assert d.home["h_finger_joint"] == 0.0


def test_what_has_fingers_is_the_hand() -> None:
    assert attach(arm(), gripper(), "c", prefix="x_").hand == "x_p"
    assert attach(arm(), arm(), "c", prefix="x_").hand == ""
    both = attach(arm(), attach(arm(), gripper(), "c"), "a", prefix="y_")
    assert both.hand == "y_p"
    assert without(both, "y_p").hand == ""


def test_two_of_the_same_need_prefixes() -> None:
    both = attach(arm(), gripper(), "c")
    with pytest.raises(InputError, match=r"both have the links 'f', 'g', 'p'; attach with prefix='gripper_'"):
        attach(both, gripper(), "b")
    assert len(attach(both, gripper(), "b", prefix="two_").links) == 9
    with pytest.raises(UnknownNameError, match="no link named 'd' in robot 'arm'"):
        attach(arm(), gripper(), "d")
    with pytest.raises(InputError, match=r"pose has shape \(2, 4, 4\); expected \(4, 4\)"):
        attach(arm(), gripper(), "c", np.stack([np.eye(4)] * 2))


def test_subtree_and_its_complement() -> None:
    d = attach(arm(), gripper(), "c")
    hand, rest = subtree(d, "p"), without(d, "p")
    assert hand.root == "p"
    assert [j.name for j in hand.joints] == ["pf", "pg"]
    assert set(rest.links) == {"a", "b", "c"}
    assert [j.name for j in rest.joints] == ["ab", "bc"]
    with pytest.raises(UnknownNameError, match="no link named 'x' in robot 'arm\\+gripper'"):
        subtree(d, "x")
    with pytest.raises(UnknownNameError, match="no link named 'x'"):
        without(d, "x")
    with pytest.raises(InputError, match="'a' is the root of 'arm': nothing would be left"):
        without(arm(), "a")


def test_a_follower_cut_from_its_leader_stands_still_at_its_home() -> None:
    text = robot(
        *(link(n) for n in "abc"),
        joint("lead", "a", "b"),
        joint(
            "turn", "a", "c", inner='<axis xyz="0 0 1"/><limit lower="-3" upper="3"/><mimic joint="lead" offset="0.5"/>'
        ),
    )
    rest = without(parse_urdf(text), "b")
    left = rest.joint("turn")
    assert (left.type, left.mimic) == (JointType.FIXED, None)
    assert left.pose[1, 0] == pytest.approx(np.sin(0.5))
    slides = text.replace('"turn" type="revolute"', '"turn" type="prismatic"')
    assert np.allclose(without(parse_urdf(slides), "b").joint("turn").pose[:3, 3], [0, 0, 0.5])


def test_renaming_is_complete() -> None:
    d = renamed(gripper(), "x_")
    assert d.root == "x_p"
    assert all(n.startswith("x_") and link_.name == n for n, link_ in d.links.items())
    assert all(j.name.startswith("x_") and j.parent in d.links and j.child in d.links for j in d.joints)
    assert renamed(d, "") is d
