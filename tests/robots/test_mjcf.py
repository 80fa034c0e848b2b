"""The MJCF reader equals MuJoCo's compiled model: poses, masses, tendons, motors; what it cannot say is reported."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from apprehend.errors import DescriptionError, MeshError
from apprehend.kinematics import Robot
from apprehend.robots import Description, JointType, ShapeKind, load_description, load_shape_mesh, read_mjcf
from tests.robots.build import write

HAND = """<mujoco model="hand"><compiler angle="degree"/><default><joint damping="0.1"/><default class="finger">
<geom type="capsule" size="0.01" rgba="1 0 0 1"/><joint axis="0 1 0" range="-20 90" limited="true" armature="0.01"/>
</default></default><worldbody><geom type="plane" size="1 1 1"/>
<body name="palm" pos="0.1 0.2 0.3" euler="10 20 30"><geom type="box" size="0.05 0.04 0.01"/>
<body name="f1" pos="0 0 0.02"><joint name="a1" class="finger"/><geom class="finger" fromto="0 0 0 0 0 0.04"/>
<body name="f2" pos="0 0 0.04" quat="1 0 0.2 0"><joint name="a2" class="finger" pos="0.003 0 -0.01" ref="15"/>
<joint name="a3" class="finger" axis="1 0 1" pos="0 0.01 0"/><geom class="finger" fromto="0 0 0 0 0 0.03"/>
<body name="f3" pos="0 0 0.03"><joint name="s" type="slide" axis="0 0 2" range="-0.01 0.02" limited="true" ref="0.005"/>
<geom type="ellipsoid" size="0.01 0.02 0.01"/></body></body></body></body></worldbody>
<tendon><fixed name="t" limited="true" range="-0.1 0.2"><joint joint="a1" coef="0.01"/><joint joint="a2" coef="-0.02"/>
</fixed></tendon>
<equality><joint joint1="a3" joint2="a1" polycoef="0.1 0.5 0 0 0"/></equality>
<actuator><motor name="m" joint="a1" gear="3" ctrllimited="true" ctrlrange="-2 1"/>
<motor name="pull" tendon="t" forcelimited="true" forcerange="-5 50"/></actuator>
<contact><exclude body1="palm" body2="f2"/></contact>
<keyframe><key name="home" qpos="0.1 0.2 0.15 0.01"/></keyframe></mujoco>"""


def expand(description: Description, model: Any, q: dict[str, float]) -> Any:
    """MuJoCo's qpos of free joint values: mimics computed, hinges and slides by name."""
    full = dict(q)
    for joint in description.joints:
        if joint.mimic:
            full[joint.name] = joint.mimic.multiplier * full[joint.mimic.joint] + joint.mimic.offset
    qpos = model.qpos0.copy()
    for k in range(model.njnt):
        if model.jnt(k).name in full:
            qpos[model.jnt_qposadr[k]] = full[model.jnt(k).name]
    return qpos


def compare(description: Description, model: Any, count: int = 10) -> None:
    """Poses of every body, masses, and moments of tendons and motors agree with MuJoCo at random postures."""
    robot, data, rng = Robot(description), mujoco.MjData(model), np.random.default_rng(1)
    for _ in range(count):
        q = rng.uniform(-1.5, 1.5, robot.n)
        data.qpos[:] = expand(description, model, dict(zip(robot.joint_names, q, strict=True)))
        mujoco.mj_forward(model, data)
        T = robot.fk(q)
        for i in range(model.nbody):
            P = T[robot.frame_index(model.body(i).name)]
            assert np.abs(P[:3, 3] - data.xpos[i]).max() < 1e-12
            assert np.abs(P[:3, :3].ravel() - data.xmat[i]).max() < 1e-12
    couples(description, model, robot, rng)
    for i in range(1, model.nbody):
        inertial = description.links[model.body(i).name].inertial
        assert (inertial.mass if inertial else 0.0) == model.body_mass[i]
        if inertial:
            moments = np.linalg.eigvalsh(inertial.inertia)
            assert np.abs(moments - np.sort(model.body_inertia[i])).max() < 1e-12
    for name, arms in [(t.name, t.arms) for t in description.tendons]:
        row = np.zeros(model.nv)
        t = model.tendon(name)
        for w in range(model.tendon_adr[t.id], model.tendon_adr[t.id] + model.tendon_num[t.id]):
            row[model.jnt_dofadr[model.wrap_objid[w]]] += model.wrap_prm[w]
        ours = np.zeros(model.nv)
        for joint, arm in arms.items():
            ours[model.joint(joint).dofadr[0]] = arm
        assert np.array_equal(ours, row)
        length = sum(arm * data.qpos[model.joint(j).qposadr[0]] for j, arm in arms.items())
        assert data.tendon(name).length[0] == pytest.approx(length, abs=1e-12)


def couples(description: Description, model: Any, robot: Robot, rng: Any) -> None:
    """Inverse dynamics and mass matrix agree with MuJoCo's, of which mimicking joints are eliminated."""
    data = mujoco.MjData(model)
    E, e = np.zeros((model.nv, robot.n)), np.zeros(model.nv)
    for joint in description.joints:
        if joint.type is not JointType.FIXED:
            row = model.joint(joint.name).dofadr[0]
            leader, slope = (joint.mimic.joint, joint.mimic.multiplier) if joint.mimic else (joint.name, 1.0)
            E[row, robot.index(leader)] = slope
            e[row] = joint.mimic.offset if joint.mimic else 0.0
    q, v, a = rng.uniform(-1, 1, (3, robot.n))
    data.qpos[:], data.qvel[:], data.qacc[:] = E @ q + e, E @ v, E @ a
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    scale = max(1.0, float(np.abs(M).max()))
    assert np.abs(robot.mass_matrix(q) - E.T @ M @ E).max() < 1e-12 * scale
    tau = E.T @ (M @ (E @ a) + data.qfrc_bias)
    assert np.abs(robot.inverse_dynamics(q, v, a) - tau).max() < 1e-11 * max(1.0, np.abs(tau).max())


def test_a_hand_equals_the_compiled_model(tmp_path: Path) -> None:
    path = write(tmp_path, HAND, "hand.xml")
    d, model = load_description(path), mujoco.MjModel.from_xml_path(str(path))
    compare(d, model)
    assert d.name == "hand"
    assert d.root == "world"
    assert [j.name for j in d.free_joints] == ["a1", "a2", "s"]
    a1 = d.joint("a1")
    assert (a1.limits.lower, a1.limits.upper) == pytest.approx(np.radians([-20, 90]))
    assert (a1.damping, a1.armature, a1.limits.effort) == (0.1, 0.01, 6.0)
    mimic = d.joint("a3").mimic
    assert mimic is not None
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("a1", 0.5, 0.1)
    assert d.home == {"a1": 0.1, "a2": 0.2, "s": 0.01}
    assert d.allowed_collisions == {frozenset(("palm", "f2"))}


def test_motors_and_tendons(tmp_path: Path) -> None:
    d = read_mjcf(write(tmp_path, HAND, "hand.xml"))
    tendon = d.tendons[0]
    assert (tendon.name, dict(tendon.arms), tendon.lower, tendon.upper) == ("t", {"a1": 0.01, "a2": -0.02}, -0.1, 0.2)
    motor, pull = d.actuators
    assert (motor.name, dict(motor.arms), motor.lower, motor.upper) == ("m", {"a1": 3.0}, -2.0, 1.0)
    assert (dict(pull.arms), pull.lower, pull.upper) == ({"a1": 0.01, "a2": -0.02}, -5.0, 50.0)


def test_shapes(tmp_path: Path) -> None:
    d = read_mjcf(write(tmp_path, HAND, "hand.xml"))
    palm, finger = d.links["palm"].collisions[0], d.links["f1"].collisions[0]
    assert (palm.kind, palm.size) == (ShapeKind.BOX, pytest.approx((0.1, 0.08, 0.02)))
    assert (finger.kind, finger.size) == (ShapeKind.CAPSULE, pytest.approx((0.01, 0.04)))
    assert finger.rgba == (1, 0, 0, 1)
    said = "\n".join(map(str, d.repairs))
    assert "of body 'f3': is an ellipsoid; took a polyhedron around it, at most" in said
    assert "of body 'world': is a plane" in said


def test_meshes_keep_the_axes_of_their_file(tmp_path: Path) -> None:
    import trimesh

    wedge = trimesh.convex.convex_hull([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.1], [0.2, 0.2, 0.1]])
    wedge.export(tmp_path / "w.stl")
    text = """<mujoco><asset><mesh file="w.stl" scale="2 1 1"/></asset><worldbody><body name="b" pos="1 0 0">
<geom type="mesh" mesh="w" pos="0 0 0.5" euler="0 0 90"/></body></worldbody></mujoco>"""
    d = read_mjcf(write(tmp_path, text, "m.xml"))
    shape = d.links["b"].collisions[0]
    vertices, _ = load_shape_mesh(shape)
    placed = vertices @ shape.pose[:3, :3].T + shape.pose[:3, 3]
    expected = np.stack([-wedge.vertices[:, 1], 2 * wedge.vertices[:, 0], wedge.vertices[:, 2] + 0.5], axis=1)
    assert np.allclose(placed.min(axis=0), expected.min(axis=0), atol=1e-6)
    assert np.allclose(placed.max(axis=0), expected.max(axis=0), atol=1e-6)


def test_free_and_ball_joints_become_chains(tmp_path: Path) -> None:
    text = """<mujoco><worldbody><body name="b" pos="0 0 1"><freejoint name="f"/><geom size="1"/>
<body name="c"><joint name="ball" type="ball" pos="0.1 0 0"/><geom size="1"/></body></body></worldbody></mujoco>"""
    d = read_mjcf(write(tmp_path, text, "m.xml"))
    assert len(d.free_joints) == 9
    said = "\n".join(map(str, d.repairs))
    assert "joint 'f': is a free joint; read as single joints f_x, f_y, f_z, f_yaw, f_pitch, f_roll" in said
    assert "joint 'ball': is a ball joint; read as single joints ball_yaw, ball_pitch, ball_roll" in said
    q = np.zeros(9)
    q[6] = np.pi / 2  # the ball turns about its anchor at x = 0.1
    assert np.allclose(Robot(d).fk(q, "c")[:3, 3], [0.1, -0.1, 1.0])


def test_constant_and_curved_equalities(tmp_path: Path) -> None:
    text = """<mujoco><worldbody><body name="b"><joint name="i"/><geom size="1"/><body name="c" pos="0 0 1">
<joint name="j" axis="1 0 0"/><geom size="1"/></body></body></worldbody>
<equality><joint joint1="i" polycoef="0.3 0 0 0 0"/>
<joint joint1="j" joint2="i" polycoef="0 0 1 0 0"/></equality></mujoco>"""
    d = read_mjcf(write(tmp_path, text, "m.xml"))
    assert d.joint("i").type is JointType.FIXED
    assert d.joint("i").pose[1, 0] == pytest.approx(np.sin(0.3))
    assert [j.name for j in d.free_joints] == ["j"]
    assert "couples joints by a polynomial of degree 2 or more; left them free" in str(d.repairs[-1])


LOOP = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="i"/><geom size="0.1"/></body>
<body name="b" pos="1 0 1"><joint name="j"/><geom size="0.1"/></body></worldbody>
<equality>{}</equality></mujoco>"""


@pytest.mark.parametrize(
    ("tie", "free"),
    [
        ('<connect name="pin" body1="a" body2="b" anchor="0.4 0.1 0"/>', "point"),
        ('<weld name="pin" body1="a" body2="b"/>', "pose"),
        ('<weld name="pin" body1="a" body2="b" anchor="0.1 0.2 0.3"/>', "pose"),
    ],
)
def test_closed_chains_are_refused_or_cut(tmp_path: Path, tie: str, free: str) -> None:
    path = write(tmp_path, LOOP.format(tie), "m.xml")
    with pytest.raises(
        DescriptionError, match="equality 'pin' closes a chain: it ties body 'a' to 'b'; pass loops='cut'"
    ):
        read_mjcf(path)
    d = load_description(path, loops="cut")
    (loop,) = d.loops
    assert (loop.name, loop.free) == ("pin", free)
    robot = Robot(d)
    first, second = (robot.fk([0, 0], n) @ T for n, T in ((loop.first, loop.T_first), (loop.second, loop.T_second)))
    assert np.allclose(first[:3, 3], second[:3, 3], atol=1e-12)  # the chain is closed where MuJoCo starts
    if free == "pose":
        assert np.allclose(first, second, atol=1e-12)


def test_nested_includes_and_defaults(tmp_path: Path) -> None:
    write(tmp_path, '<mujoco><include file="inner.xml"/></mujoco>', "outer.xml")
    write(tmp_path, '<mujoco><default><geom size="0.2"/></default></mujoco>', "inner.xml")
    text = """<mujoco><include file="outer.xml"/><worldbody><body name="b"><joint name="j"/><geom/></body></worldbody>
</mujoco>"""
    d = read_mjcf(write(tmp_path, text, "main.xml"))
    assert d.links["b"].collisions[0].size == (0.2,)


@pytest.mark.parametrize("name", ["hand/reach", "adroit_hand/adroit_hammer", "fetch/slide"])
def test_models_of_a_wheel_equal_the_compiled_model(name: str) -> None:
    import importlib.util

    found = importlib.util.find_spec("gymnasium_robotics")
    if found is None or found.origin is None:
        pytest.skip("gymnasium-robotics is not installed")
    path = Path(found.origin).parent / f"envs/assets/{name}.xml"
    d = read_mjcf(path, loops="cut")
    model = mujoco.MjModel.from_xml_path(str(path))
    joints = {j.name for j in d.joints}
    if all(model.jnt_type[k] >= 2 for k in range(model.njnt)):
        compare(d, model, count=5)
    assert {model.jnt(k).name for k in range(model.njnt) if model.jnt_type[k] >= 2} <= joints
    if name == "hand/reach":
        assert (len(d.free_joints), len(d.tendons), len(d.actuators)) == (24, 44, 20)


# ---- what is refused

BODY = '<worldbody><body name="b"><geom size="1"/></body></worldbody>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<mujoco><worldbody>", r"m\.xml:1: malformed XML"),
        ("<sdf/>", r"m\.xml:1: expected <mujoco> as the outermost element of an MJCF, found <sdf>"),
        ('<!DOCTYPE m [<!ENTITY a "b">]><mujoco/>', "declares a DOCTYPE or entities"),
        ("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>", r"m\.xml: .*mass"),
        ("<mujoco><worldbody><geom typ='box'/></worldbody></mujoco>", r"m\.xml: .*typ"),
        ("<mujoco><include file='none.xml'/></mujoco>", r"m\.xml:1: includes 'none\.xml', which does not exist"),
        ("<mujoco><include file='m.xml'/></mujoco>", "includes 'm.xml', which includes this file again"),
        ("<mujoco><include file='../../../etc/passwd'/></mujoco>", "outside the allowed folders"),
        ("<mujoco><include file='/etc/passwd'/></mujoco>", "outside the allowed folders"),
        (f"<mujoco><asset><mesh file='/etc/x.stl'/></asset>{BODY}</mujoco>", "outside the allowed folders"),
        (
            f"<mujoco><compiler meshdir='{'../' * 9}etc'/><asset><texture file='passwd'/></asset>{BODY}</mujoco>",
            "outside the allowed folders",
        ),
    ],
)
def test_mistakes_are_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(DescriptionError, match=said) as caught:
        load_description(write(tmp_path, text, "m.xml"))
    assert "\n" not in str(caught.value)


def test_a_missing_mesh(tmp_path: Path) -> None:
    text = """<mujoco><asset><mesh name="m" file="none.stl"/></asset><worldbody><body name="b"><geom size="1"/>
<geom type="mesh" mesh="m"/></body></worldbody></mujoco>"""
    path = write(tmp_path, text, "m.xml")
    with pytest.raises(MeshError, match=r"mesh 'none\.stl' does not exist \(looked for .*none\.stl\); meshes='ignore'"):
        read_mjcf(path)
    d = read_mjcf(path, meshes="ignore")
    assert len(d.links["b"].collisions) == 1
    assert "mesh 'none.stl' was not found; left its shapes out, as asked" in str(d.repairs[0])


def test_an_xml_file_may_hold_urdf(tmp_path: Path) -> None:
    assert load_description(write(tmp_path, '<robot name="r"><link name="a"/></robot>', "r.xml")).root == "a"


def test_menagerie(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco_menagerie")
    from apprehend.errors import UnknownNameError

    with pytest.raises(UnknownNameError, match=r"no robot named 'franka_emika_pand' in MuJoCo Menagerie.*Did you mean"):
        load_description("menagerie:franka_emika_pand")
    with pytest.raises(UnknownNameError, match="no model named 'x' in franka_emika_panda of MuJoCo Menagerie"):
        load_description("menagerie:franka_emika_panda/x")
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path))
    (tmp_path / "franka_emika_panda").mkdir()
    write(tmp_path / "franka_emika_panda", HAND, "panda.xml")
    assert load_description("menagerie:franka_emika_panda/panda").name == "franka_emika_panda/panda"
    monkeypatch.delenv("MENAGERIE_ROOT")
    monkeypatch.setenv("MENAGERIE_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("MENAGERIE_BASE_URL", "http://127.0.0.1:9")
    monkeypatch.setattr("time.sleep", lambda _: None)  # between its attempts
    with pytest.raises(DescriptionError, match=r"could not be downloaded .* go online once, or set MENAGERIE_ROOT"):
        load_description("menagerie:franka_emika_panda")


def test_menagerie_without_its_loader(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "mujoco_menagerie", None)
    with pytest.raises(ImportError, match=r"pip install 'apprehend\[menagerie\]'"):
        load_description("menagerie:franka_emika_panda")
