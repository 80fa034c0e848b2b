"""The URDF reader: features read, repairs reported, mistakes refused with file and line."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from apprehend.errors import DescriptionError, InputError
from apprehend.robots import Description, JointType, ShapeKind, parse_urdf, read_urdf
from tests.robots.build import inertial, joint, link, robot, two_links, write


def problems(description: Description) -> str:
    return "\n".join(map(str, description.repairs))


# ---- what is read


def test_an_axis_is_x_unless_given() -> None:
    assert np.array_equal(parse_urdf(two_links('<limit lower="0" upper="1"/>')).joints[0].axis, [1, 0, 0])


def test_origin_is_extrinsic_xyz() -> None:
    r, p, y = 0.3, -0.7, 1.1
    d = parse_urdf(two_links(f'<origin xyz="1 2 3" rpy="{r} {p} {y}"/><limit lower="0" upper="1"/>'))
    Rx = np.array([[1, 0, 0], [0, math.cos(r), -math.sin(r)], [0, math.sin(r), math.cos(r)]])
    Ry = np.array([[math.cos(p), 0, math.sin(p)], [0, 1, 0], [-math.sin(p), 0, math.cos(p)]])
    Rz = np.array([[math.cos(y), -math.sin(y), 0], [math.sin(y), math.cos(y), 0], [0, 0, 1]])
    assert np.allclose(d.joints[0].pose[:3, :3], Rz @ Ry @ Rx, atol=1e-15)
    assert np.array_equal(d.joints[0].pose[:3, 3], [1, 2, 3])


def test_limits_dynamics_and_acceleration() -> None:
    text = two_links(
        '<limit lower="-1" upper="2" velocity="3" effort="4" drake:acceleration="5"/>'
        '<dynamics damping="6" friction="7"/>'
        '<safety_controller soft_lower_limit="-0.1" soft_upper_limit="0.1" k_velocity="1"/>'
    )
    d = parse_urdf(text)
    j = d.joints[0]
    assert (j.limits.lower, j.limits.upper, j.limits.velocity, j.limits.effort) == (-1, 2, 3, 4)
    assert (j.limits.acceleration, j.damping, j.friction) == (5, 6, 7)
    assert "the prefix 'drake' is used but never declared" in problems(d)


def test_a_declared_prefix_is_no_repair() -> None:
    text = two_links('<limit lower="-1" upper="2" drake:acceleration="5"/>')
    d = parse_urdf(text.replace('name="r"', 'name="r" xmlns:drake="http://drake.mit.edu"', 1))
    assert d.joints[0].limits.acceleration == 5
    assert not d.repairs


def test_joint_order_is_root_to_leaf_depth_first() -> None:
    text = robot(
        *(link(n) for n in "edcba"),
        joint("de", "d", "e"), joint("ab", "a", "b"), joint("bc", "b", "c"), joint("ad", "a", "d"),
    )  # fmt: skip
    d = parse_urdf(text)
    assert d.root == "a"
    assert [j.name for j in d.joints] == ["ab", "bc", "ad", "de"]


def test_mimic_chains_are_multiplied_out() -> None:
    text = robot(
        *(link(n) for n in "abcd"),
        joint("one", "a", "b", inner='<limit lower="-9" upper="9"/><mimic joint="two" multiplier="2" offset="1"/>'),
        joint(
            "two", "a", "c", inner='<limit lower="-9" upper="9"/><mimic joint="three" multiplier="-3" offset="0.5"/>'
        ),
        joint("three", "a", "d"),
    )
    d = parse_urdf(text)
    mimic = d.joint("one").mimic
    assert mimic is not None
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("three", -6.0, 2.0)
    assert [j.name for j in d.free_joints] == ["three"]


def test_a_follower_narrows_its_leader_and_says_so() -> None:
    text = robot(
        *(link(n) for n in "abc"),
        joint("lead", "a", "b", inner='<limit lower="-1" upper="1"/>'),
        joint("follow", "a", "c", inner='<limit lower="-1" upper="0.5"/><mimic joint="lead" multiplier="-2"/>'),
    )
    d = parse_urdf(text)
    assert (d.joint("lead").limits.lower, d.joint("lead").limits.upper) == (-0.25, 0.5)
    assert "narrowed the leader's from [-1, 1] to [-0.25, 0.5]" in problems(d)


def test_contradicting_limits_of_a_follower_are_reported() -> None:
    text = robot(
        *(link(n) for n in "abc"),
        joint("lead", "a", "b", inner='<limit lower="0" upper="1"/>'),
        joint("follow", "a", "c", inner='<limit lower="2" upper="3"/><mimic joint="lead"/>'),
    )
    d = parse_urdf(text)
    assert (d.joint("lead").limits.lower, d.joint("lead").limits.upper) == (0, 1)
    assert "contradicts the leader's own limits" in problems(d)


def test_shapes_materials_and_poses(tmp_path: Path) -> None:
    (tmp_path / "m.stl").write_bytes(b"")
    text = robot(
        '<material name="red"><color rgba="1 0 0 1"/></material>',
        link(
            "a",
            '<visual><geometry><box size="1 2 3"/></geometry><material name="red"/></visual>'
            '<visual name="v"><origin xyz="0 0 1"/><geometry><sphere radius="0.5"/></geometry>'
            '<material name=""><color rgba="0 1 0 0.5"/></material></visual>'
            '<collision><geometry><cylinder radius="1" length="2"/></geometry></collision>'
            '<collision><geometry><capsule radius="1" length="2"/></geometry></collision>'
            '<collision><geometry><mesh filename="m.stl" scale="0.001 0.001 0.001"/></geometry></collision>',
        ),
    )
    a = read_urdf(write(tmp_path, text)).links["a"]
    assert [s.kind for s in a.visuals] == [ShapeKind.BOX, ShapeKind.SPHERE]
    assert [s.rgba for s in a.visuals] == [(1, 0, 0, 1), (0, 1, 0, 0.5)]
    assert a.visuals[1].name == "v"
    assert a.visuals[1].pose[2, 3] == 1
    assert [s.size for s in a.collisions] == [(1, 2), (1, 2), (0.001, 0.001, 0.001)]
    assert a.collisions[2].mesh == tmp_path / "m.stl"


def test_inertia_is_turned_into_the_axes_of_the_link() -> None:
    text = robot(
        link(
            "a",
            f'<inertial><origin xyz="1 2 3" rpy="0 0 {math.pi / 2}"/><mass value="2"/>'
            '<inertia ixx="1" iyy="2" izz="2.5" ixy="0" ixz="0" iyz="0"/></inertial>',
        )
    )
    inertial_ = parse_urdf(text).links["a"].inertial
    assert inertial_ is not None
    assert np.allclose(inertial_.inertia, np.diag([2, 1, 2.5]), atol=1e-15)
    assert np.array_equal(inertial_.com, [1, 2, 3])


def test_planar_and_floating_joints_become_chains_and_are_reported() -> None:
    planar = parse_urdf(two_links('<axis xyz="0 0 2"/>', "planar"))
    assert [j.name for j in planar.joints] == ["j_x", "j_y", "j_theta"]
    assert planar.joints[-1].child == "b"
    axes = np.array([j.axis for j in planar.joints])
    assert np.allclose(axes, np.eye(3), atol=1e-15)
    assert "read as a chain of single joints: j_x, j_y, j_theta" in problems(planar)
    floating = parse_urdf(two_links("", "floating"))
    assert [j.type for j in floating.joints] == [JointType.PRISMATIC] * 3 + [JointType.CONTINUOUS] * 3
    assert len(floating.free_joints) == 6


@pytest.mark.parametrize("axis", ["1 0 0", "0 1 0", "1 1 1", "-1 2 0.3", "0 0 -1"])
def test_planar_axes_are_right_handed_about_the_normal(axis: str) -> None:
    joints = parse_urdf(two_links(f'<axis xyz="{axis}"/>', "planar")).joints
    normal = np.array([float(x) for x in axis.split()])
    R = np.array([j.axis for j in joints])
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) > 0
    assert np.allclose(R[2], normal / np.linalg.norm(normal))


def test_allowed_pairs_of_drake_groups() -> None:
    group = (
        '<drake:collision_filter_group name="g"><drake:member link="a"/><drake:member link="b"/>'
        '<drake:ignored_collision_filter_group name="g"/></drake:collision_filter_group>'
    )
    d = parse_urdf(robot(link("a"), link("b"), joint("j", "a", "b"), group))
    assert d.allowed_collisions == {frozenset(("a", "b"))}


# ---- what is repaired, and reported


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (two_links(""), "joint 'j' is revolute but has no <limit>; took it as unlimited"),
        (two_links('<limit effort="1" velocity="1"/>'), "has neither lower nor upper; took both as 0"),
        (two_links('<limit lower="0" upper="1" velocity="0"/>'), "velocity limit is 0; read as not given"),
        (two_links('<limit lower="0" upper="1" effort="0"/>'), "effort limit is 0; read as not given"),
        (two_links('<axis xyz="0 0 3"/><limit lower="0" upper="1"/>'), "the axis has length 3; normalised it"),
        (two_links('<mimic joint="j"/>', "fixed"), "joint 'j' is fixed and mimics another; left the mimic out"),
        (robot(link("a", "<visual><geometry/></visual>")), "<visual> has no geometry; left it out"),
        (robot(link("a", '<visual><geometry><box size="1 0 1"/></geometry></visual>')), "a box of size 1 0 1; left it"),
        (robot(link("a", '<inertial><mass value="2"/></inertial>')), "has 2 kg but no <inertia>; took that of a solid"),
        (robot(link("a", inertial(1, 1, 1, 3))), "principal moments 1 + 1 < 3 kg m² violate A + B ≥ C; took the near"),
        (robot(link("a", inertial(1, -1, 1, 1))), "has a negative principal moment, -1 kg m²"),
        (robot(link("a", inertial(0, 1, 1, 1))), "an inertia of up to 1 kg m² with zero mass"),
        (
            robot(link("a"), link("b", inertial(0, 0, 0, 0)), joint("j", "a", "b")),
            "joint 'j' moves links without any mass; kept massless",
        ),
        (
            robot(link("a", inertial()), link("b"), joint("j", "a", "b")),
            "joint 'j' moves links without any mass; kept massless: forward dynamics is singular",
        ),
    ],
)
def test_repairs_are_reported_with_their_line(text: str, said: str) -> None:
    d = parse_urdf(text, "model.urdf")
    assert said in problems(d)
    assert all(r.where.startswith("model.urdf:") for r in d.repairs)


def test_repaired_inertia_is_possible_and_near() -> None:
    d = parse_urdf(robot(link("a", inertial(1, 1, 1, 3))))
    moments = np.diag(d.links["a"].inertial.inertia)  # type: ignore[union-attr]
    assert moments[0] + moments[1] >= moments[2] - 1e-12
    assert np.abs(moments - [1, 1, 3]).max() <= 0.5 + 1e-12
    kept = parse_urdf(robot(link("a", inertial(1, 1, 1, 3))), inertias="keep")
    assert np.array_equal(np.diag(kept.links["a"].inertial.inertia), [1, 1, 3])  # type: ignore[union-attr]
    assert not kept.repairs


def test_a_sound_file_has_no_repairs() -> None:
    assert not parse_urdf(robot(link("a", inertial()), link("b", inertial()), joint("j", "a", "b"))).repairs


# ---- what is refused

MESH = '<visual><geometry><mesh filename="{}"/></geometry></visual>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not XML"),
        ("hello", "malformed XML"),
        ("<robot name='r'><link name='a'></robot>", r"model.urdf:1: malformed XML: Opening and ending tag mismatch"),
        ("<sdf/>", r"model.urdf:1: expected <robot> as the outermost element of a URDF, found <sdf>"),
        (robot(), "there is no link"),
        (
            robot('<xacro:macro name="m"/>', attributes=' xmlns:xacro="http://www.ros.org/wiki/xacro"'),
            "expand the file",
        ),
        (robot("<link/>"), r"model.urdf:2: link: <link> lacks the attribute 'name'"),
        (robot(link("a"), link("a")), r"model.urdf:3: a second link is named 'a' \(the first: line 2\)"),
        (two_links("", "ball"), "joint 'j': type 'ball' is unknown; expected one of revolute, continuous"),
        (robot(link("a"), link("b"), joint("j", "a", "bb")), r"its child link 'bb' does not exist. Did you mean 'b'\?"),
        (robot(link("a"), link("b"), joint("j", "x", "b")), "its parent link 'x' does not exist"),
        (robot(link("a"), joint("j", "a", "a")), "connects link 'a' to itself"),
        (robot(link("a"), link("b")), r"2 links have no parent joint \('a', 'b'\)"),
        (
            robot(link("a"), link("b"), link("c"), joint("i", "a", "c"), joint("j", "b", "c"), joint("k", "a", "b")),
            r"model.urdf:6: closed chain: link 'c' is the child of joint 'i' \(from 'a'\) and of joint 'j'",
        ),
        (robot(link("a"), link("b"), joint("i", "a", "b"), joint("j", "b", "a")), "the links form a cycle: "),
        (
            robot(link("r"), link("a"), link("b"), joint("i", "a", "b"), joint("j", "b", "a")),
            "the links form a cycle: ",
        ),
        (robot(link("a"), link("b"), joint("j", "a", "b"), joint("j", "a", "b")), "a second joint is named 'j'"),
        (
            two_links('<limit lower="0" upper="1"/><mimic joint="jj"/>'),
            r"mimics 'jj', which does not exist. Did you mean",
        ),
        (two_links('<limit lower="0" upper="1"/><mimic joint="j"/>'), "mimics itself through j → j"),
        (
            robot(
                *(link(n) for n in "abc"),
                joint("i", "a", "b", "fixed", ""),
                joint("j", "a", "c", inner='<limit lower="0" upper="1"/><mimic joint="i"/>'),
            ),
            "joint 'j' mimics 'i', which is fixed",
        ),
        (two_links('<limit lower="1" upper="0"/>'), "limits reversed: lower=1 is above upper=0"),
        (two_links('<limit lower="0" upper="1" velocity="-1"/>'), "velocity limit is -1; expected a positive number"),
        (two_links('<limit lower="x" upper="1"/>'), r"joint 'j': lower='x' is not a number"),
        (two_links('<limit lower="nan" upper="1"/>'), "lower='nan'; every number must be finite"),
        (two_links('<limit lower="${pi}" upper="1"/>'), "expand the xacro first"),
        (two_links('<axis xyz="0 0 0"/><limit lower="0" upper="1"/>'), "joint 'j': the axis is zero"),
        (two_links('<axis xyz="0 0"/><limit lower="0" upper="1"/>'), "has 2 numbers; expected 3"),
        (two_links('<limit lower="0" upper="1"/><dynamics damping="-1"/>'), "damping -1, friction 0; expected zero or"),
        (robot('<link name="a"/><joint name="j" type="fixed"><parent link="a"/></joint>'), "joint 'j' lacks <child"),
        (robot(link("a", inertial(-1))), "mass is -1 kg; expected zero or more"),
        (robot(link("a", "<inertial/>")), "<inertial> lacks <mass>"),
        (robot(link("a", '<visual><geometry><torus r="1"/></geometry></visual>')), "geometry <torus> is unknown"),
        (
            robot(link("a", '<visual><geometry><sphere radius="-1"/></geometry></visual>')),
            "sphere of size -1; expected",
        ),
        (robot(link("a", MESH.format("../../etc/x.stl"))), "outside the allowed folders"),
        (robot(link("a", MESH.format("/etc/x.stl"))), "outside the allowed folders"),
        (robot(link("a", MESH.format("file:///etc/x.stl"))), "outside the allowed folders"),
        (robot(link("a", MESH.format("http://x.org/x.stl"))), "the scheme http:// is not read"),
        (robot(link("a", "<visual><geometry><mesh/></geometry></visual>")), "<mesh> lacks the attribute 'filename'"),
    ],
)
def test_mistakes_are_refused_with_file_and_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(DescriptionError, match=said) as caught:
        read_urdf(write(tmp_path, text, "model.urdf"))
    assert "model.urdf" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_impossible_inertia_can_be_refused() -> None:
    with pytest.raises(DescriptionError, match=r"<urdf>:2: link 'a': impossible inertia: principal moments 1 \+ 1 < 3"):
        parse_urdf(robot(link("a", inertial(1, 1, 1, 3))), inertias="refuse")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match=r"none\.urdf does not exist"):
        read_urdf(tmp_path / "none.urdf")
    with pytest.raises(DescriptionError, match="cannot be read"):
        read_urdf(tmp_path)


# ---- transmissions and closed chains


def transmission(joints: str, motors: str, name: str = "t") -> str:
    return f'<transmission name="{name}"><type>SimpleTransmission</type>{joints}{motors}</transmission>'


MOTOR = '<actuator name="m"><mechanicalReduction>{}</mechanicalReduction></actuator>'


def test_transmissions_are_motors() -> None:
    chain = (link("a"), link("b"), link("c"), joint("i", "a", "b"), joint("j", "b", "c", "fixed", ""))
    text = robot(
        *chain,
        transmission('<joint name="i"/>', MOTOR.format(50)),
        transmission('<joint name="i"/>', MOTOR.format(1)),
        transmission('<joint name="j"/>', MOTOR.format(1)),
        transmission('<joint name="k"/>', MOTOR.format(1)),
        transmission('<joint name="i"/><joint name="j"/>', MOTOR.format(1)),
        transmission("", ""),
    )
    d = parse_urdf(text)
    assert [(a.name, dict(a.arms)) for a in d.actuators] == [("m", {"i": 50.0}), ("m_i", {"i": 1.0})]
    said = problems(d)
    for part in (
        "a second actuator is named 'm'; called it m_i",
        "drives the joint 'j', which is fixed; left it out",
        "drives the joint 'k', which does not exist.",
        "has 2 joints and 1 actuators; left it out",
    ):
        assert part in said
    assert len(d.repairs) == 4


@pytest.mark.parametrize(
    ("ratio", "said"),
    [
        ("0", "mechanicalReduction is 0; expected the ratio"),
        ("inf", "is inf; expected the ratio"),
        ("x", "mechanicalReduction is 'x'; expected a number"),
    ],
)
def test_reductions_that_mean_nothing(ratio: str, said: str) -> None:
    text = two_links('<limit lower="0" upper="1"/>').replace(
        "</robot>", transmission('<joint name="j"/>', MOTOR.format(ratio)) + "</robot>"
    )
    with pytest.raises(DescriptionError, match=said):
        parse_urdf(text)


def geared(tag: str, name: str, role: int, ratio: float) -> str:
    role_text = f"<role>{tag}{role}</role>"
    return f'<{tag} name="{name}">{role_text}<mechanicalReduction>{ratio}</mechanicalReduction></{tag}>'


@pytest.mark.parametrize(
    ("kind", "arms"),
    [
        ("DifferentialTransmission", [{"i": 3.0 * 2.0, "j": 3.0 * -5.0}, {"i": 7.0 * 2.0, "j": 7.0 * 5.0}]),
        ("FourBarLinkageTransmission", [{"i": 3.0 * 2.0}, {"i": 7.0, "j": 7.0 * -5.0}]),
    ],
)
def test_coupled_transmissions_have_the_arms_of_their_speeds(kind: str, arms: list[dict[str, float]]) -> None:
    limit = '<limit lower="-1" upper="1"/>'
    parts = (
        geared("joint", "j", 2, -5.0) + geared("actuator", "m2", 2, 7.0)
        + geared("joint", "i", 1, 2.0) + geared("actuator", "m1", 1, 3.0)
    )  # fmt: skip
    text = f'<transmission name="t"><type>transmission_interface/{kind}</type>{parts}</transmission>'
    chain = (joint("i", "a", "b", inner=limit), joint("j", "b", "c", inner=limit))
    d = parse_urdf(robot(*(link(n) for n in "abc"), *chain, text))
    assert [(a.name, dict(a.arms)) for a in d.actuators] == [("m1", arms[0]), ("m2", arms[1])]
    torn = parse_urdf(robot(*(link(n) for n in "abc"), *chain, text.replace(geared("actuator", "m1", 1, 3.0), "")))
    assert not torn.actuators
    assert "transmission 't' has 2 joints and 1 actuators; left it out" in problems(torn)


def test_a_closed_chain_can_be_cut() -> None:
    inner = '<origin xyz="0 0 1"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/>'
    four_bar = robot(
        *(link(n) for n in "abcd"),
        joint("ab", "a", "b", inner=inner), joint("bc", "b", "c", inner=inner), joint("ad", "a", "d", inner=inner),
        joint("dc", "d", "c", inner=inner),
    )  # fmt: skip
    with pytest.raises(DescriptionError, match=r"closed chain: link 'c' is the child of joint 'bc'.* Pass loops='cut'"):
        parse_urdf(four_bar)
    d = parse_urdf(four_bar, loops="cut")
    (loop,) = d.loops
    assert (loop.name, loop.first, loop.second, loop.free) == ("dc", "d", "c", "revolute")
    assert np.array_equal(loop.axis, [0, 1, 0])
    assert loop.T_first[2, 3] == 1
    assert [j.name for j in d.joints] == ["ab", "bc", "ad"]
    assert "joint 'dc' closes a chain at 'c'; cut it, as asked" in problems(d)


@pytest.mark.parametrize("option", ["meshes", "inertias", "loops"])
def test_options_are_checked(option: str) -> None:
    with pytest.raises(InputError, match=f"{option} is 'perhaps'; expected one of '"):
        parse_urdf(robot(link("a")), **{option: "perhaps"})
