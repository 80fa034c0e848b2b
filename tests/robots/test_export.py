"""Descriptions written and read back are the same; what a format cannot say is told."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from apprehend.errors import InputError
from apprehend.kinematics import Robot, dh_table
from apprehend.robots import (
    Actuator,
    Description,
    Inertial,
    Joint,
    JointLimits,
    JointType,
    Link,
    Loop,
    Mimic,
    Shape,
    ShapeKind,
    Tendon,
    catalogue,
    load_description,
    load_shape_mesh,
    outline,
    read_dh,
    save_dh,
    save_mjcf,
    save_urdf,
)
from apprehend.robots.poses import from_rpy, to_rpy

RNG = np.random.default_rng(5)
NAMES = [e.name for e in catalogue.entries().values() if e.installed]


def same(a: Description, b: Description, *, limits: tuple[str, ...]) -> None:
    """Every frame, mass, limit, coupling, posture and allowed pair of *a* is in *b*."""
    ra, rb = Robot(a), Robot(b)
    assert set(ra.joint_names) == set(rb.joint_names)
    order = [ra.joint_names.index(n) for n in rb.joint_names]
    q = RNG.uniform(-1, 1, (3, ra.n))
    for frame in ra.frame_names:
        assert np.abs(ra.fk(q, frame) - rb.fk(q[:, order], frame)).max() < 1e-12
    for kind in limits:
        assert np.allclose(getattr(ra.limits, kind)[order], getattr(rb.limits, kind), rtol=1e-12, atol=1e-11)
    for name, link in a.links.items():
        if link.inertial is not None and link.inertial.mass:
            other = b.links[name].inertial
            assert other is not None
            assert other.mass == link.inertial.mass
            assert np.abs(other.com - link.inertial.com).max() < 1e-14
            assert np.abs(other.inertia - link.inertial.inertia).max() < 1e-12
    for joint in a.joints:
        other_joint = b.joint(joint.name) if joint.type is not JointType.FIXED else joint
        assert other_joint.type is joint.type
        assert (other_joint.mimic is None) == (joint.mimic is None)
        assert (other_joint.damping, other_joint.friction) == (joint.damping, joint.friction)
    np.testing.assert_allclose(ra.home[order], rb.home, atol=1e-12)
    assert a.allowed_collisions == b.allowed_collisions


@pytest.mark.parametrize("name", [n for n in NAMES if n != "puma560"])  # puma560 keeps impossible inertias
def test_urdf_round_trip(tmp_path: Path, name: str) -> None:
    a = load_description(name)
    save_urdf(a, tmp_path / "r.urdf", meshes="omit")
    b = load_description(tmp_path / "r.urdf")
    same(a, b, limits=("lower", "upper", "velocity", "acceleration", "effort"))
    assert (b.name, b.root) == (a.name, a.root)
    assert {x.name for x in b.actuators} == {x.name for x in a.actuators if len(x.arms) == 1}


@pytest.mark.parametrize("name", [n for n in NAMES if n != "puma560"])
def test_mjcf_round_trip(tmp_path: Path, name: str) -> None:
    a = load_description(name)
    save_mjcf(a, tmp_path / "r.xml", meshes="omit")
    b = load_description(tmp_path / "r.xml")
    same(a, b, limits=("lower", "upper", "effort"))
    pulled = {f"{x.name}_tendon" for x in a.actuators if len(x.arms) > 1}  # MJCF drives several joints by a tendon
    kept = [(t.name, dict(t.arms)) for t in b.tendons if t.name not in pulled]
    assert kept == [(t.name, dict(t.arms)) for t in a.tendons]
    assert {x.name: dict(x.arms) for x in b.actuators} == {x.name: dict(x.arms) for x in a.actuators}


def everything() -> Description:
    """A description that uses every field."""

    def box(x: float) -> tuple[Shape, ...]:
        return (Shape(ShapeKind.BOX, (x, 0.2, 0.3), from_rpy((0, 0, x), (0.1, 0.2, 0.3)), None, (1, 0, 0, 0.5), "s"),)

    inertial = Inertial(1.5, np.array([0.1, 0.2, 0.3]), np.array([[2.0, 0.1, 0.2], [0.1, 3.0, 0.3], [0.2, 0.3, 4.0]]))
    links = {n: Link(n, inertial, box(0.1), box(0.2)) for n in "abcde"}
    z, tilted = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.0, 0.8])
    joints = (
        Joint("r", JointType.REVOLUTE, "a", "b", from_rpy((1, 2, 3), (0.4, np.pi / 2, 0.0)), tilted,
              JointLimits(-1.0, 2.0, 3.0, 4.0, 5.0), None, 0.1, 0.2),
        Joint("c", JointType.CONTINUOUS, "b", "c", from_rpy((0, 0, 1), (3.0, -1.2, 2.5)), z),
        Joint("half", JointType.PRISMATIC, "c", "d", np.eye(4), z, JointLimits(lower=-0.5)),
        Joint("m", JointType.REVOLUTE, "a", "e", np.eye(4), z, JointLimits(-9, 9), Mimic("r", -2.0, 0.25)),
    )  # fmt: skip
    return Description(
        "all", "a", links, joints, {"r": 0.5, "c": -1.0, "half": 0.1}, frozenset((frozenset("bd"),)),
        tendons=(Tendon("t", {"r": 0.01, "c": -0.02}, -0.1, 0.3),),
        actuators=(Actuator("one", {"r": 3.0}, -1.0, 2.0), Actuator("two", {"r": 0.01, "c": -0.02}, 0.0, 9.0),
                   Actuator("three", {"r": 1.0, "c": 1.0})),
        loops=(Loop("pin", "d", "e", from_rpy((0.1, 0, 0), (0, 0, 0)), np.eye(4), "point"),),
    )  # fmt: skip


def test_every_field_survives_urdf_or_is_told(tmp_path: Path) -> None:
    a = everything()
    lost = save_urdf(a, tmp_path / "r.urdf")
    b = load_description(tmp_path / "r.urdf")
    same(a, b, limits=("lower", "upper", "velocity", "acceleration", "effort"))
    assert not b.repairs
    for name in "abcde":
        for x, y in zip((*a.links[name].visuals, *a.links[name].collisions),
                        (*b.links[name].visuals, *b.links[name].collisions), strict=True):  # fmt: skip
            assert (x.kind, x.size, x.rgba, x.name) == (y.kind, y.size, y.rgba, y.name)
            assert np.allclose(x.pose, y.pose, atol=1e-15)
    assert [x.name for x in b.actuators] == ["one"]
    said = "\n".join(lost)
    for part in ("tendon 't': URDF has no tendons", "loop 'pin': URDF has no closed chains",
                 "actuator 'two': URDF has no motors that drive several joints",
                 "actuator 'one': URDF has no force limits of motors"):  # fmt: skip
        assert part in said


def test_every_field_survives_mjcf_or_is_told(tmp_path: Path) -> None:
    a = everything()
    lost = save_mjcf(a, tmp_path / "r.xml")
    b = load_description(tmp_path / "r.xml", loops="cut")
    same(a, b, limits=("lower", "upper", "effort"))
    assert {x.name: (dict(x.arms), x.lower, x.upper) for x in b.actuators} == {
        x.name: (dict(x.arms), x.lower, x.upper) for x in a.actuators
    }
    assert dataclasses.astuple(b.tendons[0]) == dataclasses.astuple(a.tendons[0])
    assert (b.loops[0].name, b.loops[0].free) == ("pin", "point")
    assert "joint 'r': MJCF has no velocity limits" in lost


def test_what_moves_without_mass_gets_a_little_and_is_told(tmp_path: Path) -> None:
    lost = save_mjcf(load_description("planar_2r"), tmp_path / "r.xml")
    assert "moves and has no mass or inertia of its own: MuJoCo needs some; wrote 1e-09 kg" in lost[0]
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "r.xml")).nv == 2


def test_impossible_inertia_is_made_possible_and_told(tmp_path: Path) -> None:
    lost = save_mjcf(load_description("puma560"), tmp_path / "r.xml")
    assert any("link 'link3': impossible inertia" in x and "wrote the nearest" in x for x in lost)


@pytest.mark.parametrize("save", [save_urdf, save_mjcf])
def test_meshes_are_copied_so_that_the_folder_stands_alone(tmp_path: Path, save: object) -> None:
    import shutil

    a = load_description("robotiq_2f_85")
    suffix = ".urdf" if save is save_urdf else ".xml"
    (save_urdf if save is save_urdf else save_mjcf)(a, tmp_path / "one" / f"r{suffix}")
    shutil.move(tmp_path / "one", tmp_path / "two")
    b = load_description(tmp_path / "two" / f"r{suffix}")
    for name, link in a.links.items():
        for x, y in zip(link.collisions, b.links[name].collisions, strict=True):
            if x.kind is ShapeKind.MESH:
                va, vb = (load_shape_mesh(s)[0] @ s.pose[:3, :3].T + s.pose[:3, 3] for s in (x, y))
                assert np.allclose(va.min(axis=0), vb.min(axis=0), atol=1e-9)
                assert np.allclose(va.max(axis=0), vb.max(axis=0), atol=1e-9)


def test_meshes_that_mujoco_does_not_read_are_converted(tmp_path: Path) -> None:
    import trimesh

    box = trimesh.creation.box(extents=(1, 2, 3))
    for name in ("x.dae", "x.ply"):
        box.export(tmp_path / name)
    (tmp_path / "a.stl").write_text(trimesh.exchange.stl.export_stl_ascii(box))
    shapes = tuple(Shape(ShapeKind.MESH, (1.0, 1.0, 1.0), np.eye(4), tmp_path / n) for n in ("x.dae", "x.ply", "a.stl"))
    d = Description("d", "l", {"l": Link("l", None, (), shapes)}, ())
    save_mjcf(d, tmp_path / "out" / "d.xml")
    assert sorted(p.name for p in (tmp_path / "out" / "meshes").iterdir()) == ["a.obj", "x.obj", "x_2.obj"]
    b = load_description(tmp_path / "out" / "d.xml")
    assert len(b.links["l"].collisions) == 3
    refer = tmp_path / "out" / "refer.urdf"
    save_urdf(d, refer, meshes="refer")
    assert load_description(refer, packages=tmp_path).links["l"].collisions[0].mesh == tmp_path / "x.dae"


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize("name", ["puma560", "ur5e", "stanford", "armar1"])
def test_dh_round_trip(tmp_path: Path, name: str, convention: str) -> None:
    robot = Robot.load(name)
    derived = dh_table(robot, robot.description.tool)
    table = (derived if convention == "standard" else derived.modified()).chain(robot)
    save_dh(table, tmp_path / "t.toml")
    again = read_dh(tmp_path / "t.toml")
    for field in ("theta", "d", "a", "alpha", "base", "tool"):
        assert np.array_equal(getattr(again, field), getattr(table, field))
    for field in ("convention", "names", "types", "limits", "flip", "name", "home"):
        assert getattr(again, field) == getattr(table, field)


@pytest.mark.parametrize("pitch", [0.0, 1.0, np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, -np.pi / 2 + 1e-6])
def test_angles_of_a_rotation(pitch: float) -> None:
    for roll, yaw in RNG.uniform(-3, 3, (10, 2)):
        T = from_rpy((0, 0, 0), (roll, pitch, yaw))
        assert np.abs(from_rpy((0, 0, 0), to_rpy(T[:3, :3])) - T).max() < 1e-15


def test_names_must_fit_the_format(tmp_path: Path) -> None:
    d = load_description("armar1")
    with pytest.raises(InputError, match=r"path is '.*x\.txt'; expected a name that ends in \.urdf"):
        save_urdf(d, tmp_path / "x.txt")
    with pytest.raises(InputError, match="meshes is 'move'; expected one of 'copy', 'refer', 'omit'"):
        save_mjcf(d, tmp_path / "x.xml", meshes="move")


def test_the_outline_shows_the_tree() -> None:
    text = outline(everything())
    lines = text.splitlines()
    assert lines[0] == "all: 3 coordinates, 5 links"
    assert lines[1] == "a (1.5 kg)"
    assert lines[2] == "├─ b (1.5 kg)  ← r: revolute, [-1, 2] rad, 3 rad/s, 4 rad/s², 5 N m"
    assert lines[3] == "│  └─ c (1.5 kg)  ← c: continuous"
    assert lines[4] == "│     └─ d (1.5 kg)  ← half: prismatic, [-0.5, inf] m"
    assert lines[5] == "└─ e (1.5 kg)  ← m: revolute, [-9, 9] rad, = -2·r +0.25"
    assert "tendon t: +0.01·r -0.02·c  [-0.1, 0.3]" in text
    assert "loop pin: d – e, free: point" in text
    assert "[-57.3, 114.6] °, 171.9 °/s" in outline(everything(), degrees=True)


def test_the_outline_shows_repairs_and_hides_what_does_not_move() -> None:
    ur5e = load_description("ur5e")
    assert "repaired: ur5e.urdf:" in outline(ur5e)
    assert "base_link_inertia" in outline(ur5e, fixed=False)
    assert "tool0" not in outline(ur5e, fixed=False)
