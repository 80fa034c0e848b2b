"""The catalogue: every entry loads, says what it changed, and says how to install what is missing."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from apprehend.errors import DescriptionError, MissingDependencyError, UnknownNameError
from apprehend.kinematics import Robot
from apprehend.robots import catalogue, load_description, read_srdf
from tests.robots.build import write

INSTALLED = [e.name for e in catalogue.entries().values() if e.installed]


def test_the_core_needs_no_extra() -> None:
    assert {"ur5e", "ur3e", "robotiq_2f_85"} <= set(INSTALLED)
    assert all(not catalogue.entry(n).extra for n in ("ur5e", "ur3e", "robotiq_2f_85"))


@pytest.mark.parametrize("name", INSTALLED)
def test_every_entry_loads(name: str) -> None:
    entry = catalogue.entry(name)
    description = load_description(name)
    assert description.name == name
    assert entry.licence
    assert entry.summary
    assert entry.kind in catalogue.KINDS
    robot = Robot(description)
    assert robot.limits.contains(robot.home)
    assert np.isfinite(robot.fk(robot.home)).all()
    seen = {description.root}
    for joint in description.joints:  # root to leaf
        assert joint.parent in seen
        seen.add(joint.child)
    assert seen == set(description.links)


@pytest.mark.parametrize("name", INSTALLED)
def test_every_mesh_exists(name: str) -> None:
    for link in load_description(name).links.values():
        for shape in (*link.visuals, *link.collisions):
            assert shape.mesh is None or shape.mesh.is_file()


def test_thirty_robots_come_with_the_wheels() -> None:
    if not catalogue.entry("panda").installed:
        pytest.skip("the extra [robots] is not installed")
    assert len({catalogue.entry(n).path for n in INSTALLED}) >= 30


def test_panda_has_its_documented_limits_and_says_so() -> None:
    if "panda" not in INSTALLED:
        pytest.skip("the extra [robots] is not installed")
    robot = Robot.load("panda")
    assert robot.limits.acceleration[:7].tolist() == [15, 7.5, 10, 12.5, 15, 20, 20]
    assert any("Franka Control Interface" in str(r) for r in robot.description.repairs)
    assert robot.description.tool == "panda_hand_tcp"
    assert frozenset(("panda_link5", "panda_link7")) in robot.description.allowed_collisions  # from the SRDF beside it


def test_robotiq_effort_is_no_placeholder() -> None:
    robot = Robot.load("robotiq_2f_85")
    assert robot.limits.effort[0] < 100
    assert any("effort 26.85 instead of 1000" in str(r) for r in robot.description.repairs)


def test_names_by_kind() -> None:
    assert "robotiq_2f_85" in catalogue.names("hand")
    assert "ur5e" not in catalogue.names("hand")
    with pytest.raises(UnknownNameError, match=r"no kind named 'hands' in the catalogue\. Did you mean 'hand'"):
        catalogue.names("hands")


def test_unknown_names_get_a_suggestion() -> None:
    with pytest.raises(UnknownNameError, match=r"no robot named 'pandda' in the catalogue.*Did you mean 'panda'"):
        load_description("pandda")
    with pytest.raises(DescriptionError, match=r"/none/x\.urdf does not exist"):
        load_description("/none/x.urdf")


def test_files_of_other_types(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match=r"files of type '\.sdf' are not read; expected one of \.urdf"):
        load_description(write(tmp_path, "<sdf/>", "x.sdf"))
    with pytest.raises(DescriptionError, match=r"is a xacro file; expand it first: xacro x\.urdf\.xacro > x\.urdf$"):
        load_description(write(tmp_path, "", "x.urdf.xacro"))
    with pytest.raises(DescriptionError, match="is a folder; expected a file of type"):
        load_description(tmp_path)
    with pytest.raises(DescriptionError, match=r"none\.sdf does not exist"):
        load_description(tmp_path / "none.sdf")


def test_a_missing_wheel_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = dataclasses.replace(catalogue.entry("panda"), wheel="no-such-wheel")
    assert not entry.installed
    with pytest.raises(
        MissingDependencyError, match=r"'no-such-wheel', which is not installed .* pip install 'apprehe"
    ):
        entry.file()


def test_faults_of_an_entry_are_named() -> None:
    description, entry = load_description("ur5e"), catalogue.entry("ur5e")
    row = {"joints": "none_.*", "velocity": 1.0, "source": "nowhere"}
    for bad, said in (
        ({"limits": (row,)}, "no joint matches 'none_"),
        ({"home": {"elbow": 0.0}}, r"home names unknown joints \['elbow'\]"),
        ({"tool": "hand"}, "the tool frame 'hand' does not exist"),
    ):
        with pytest.raises(DescriptionError, match=said):
            catalogue.applied(dataclasses.replace(entry, **bad), description)


def test_srdf(tmp_path: Path) -> None:
    text = """<robot name="r"><group_state name="home" group="g"><joint name="a" value="0.5"/>
<joint name="root" value="0 0 0"/></group_state><disable_collisions link1="x" link2="y" reason="Never"/></robot>"""
    semantics = read_srdf(write(tmp_path, text, "r.srdf"))
    assert semantics.postures == {"home": {"a": 0.5}}
    assert semantics.allowed == {frozenset(("x", "y"))}
    with pytest.raises(DescriptionError, match=r"r\.srdf:1: expected <robot>"):
        read_srdf(write(tmp_path, "<sdf/>", "r.srdf"))
    with pytest.raises(DescriptionError, match=r"r\.srdf:1: disable_collisions: .* lacks the attribute 'link2'"):
        read_srdf(write(tmp_path, '<robot><disable_collisions link1="x"/></robot>', "r.srdf"))
