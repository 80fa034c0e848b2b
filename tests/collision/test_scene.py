"""Scenes as values and as files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.collision import Box, Placed, RobotSource, Scene
from apprehend.collision.rotations import matrix_quaternion, quaternion_matrix, rpy_matrix
from apprehend.collision.scene import end_link, has_hand
from apprehend.errors import ApprehendError, DescriptionError, InputError, UnknownNameError
from tests.collision.makers import gantry, planar, pose, rotation

GOOD = """
clearance = 0.004

[robot]
arm = "ur5e"
hand = "robotiq_2f_85"
base = {xyz = [0.1, 0, 0.2], rpy_deg = [0, 0, 90]}

[[box]]
name = "table"
size = [1.0, 1.4, 0.04]
pose = {xyz = [0.6, 0, -0.02]}

[[body]]
name = "brick"
box = [0.05, 0.06, 0.1]
mass = 0.3
friction = 0.7
rest = {on = "table", xy = [0.5, -0.2], yaw_deg = 30}

[[body]]
household = "mug"
pose = {xyz = [0.4, 0.3, 0.0], wxyz = [1, 0, 0, 0]}

[task]
pick = "brick"
place = {xyz = [0.5, 0.2, 0.05], rpy = [0, 0, 0.5]}
upright = true
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return path


def test_a_file_says_what_stands_where(tmp_path: Path) -> None:
    scene = Scene.load(written(tmp_path, GOOD))
    assert scene.robot.n == 7
    np.testing.assert_allclose(scene.robot.base[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    assert scene.hand_root in scene.robot.frame_names
    brick = scene.bodies["brick"]
    assert (brick.body.mass, brick.body.friction) == (0.3, 0.7)
    lowest = (brick.body.vertices @ brick.pose[:3, :3].T + brick.pose[:3, 3])[:, 2].min()
    assert lowest == pytest.approx(0.0, abs=1e-12)  # on the table, whose top is at 0
    assert scene.pick == "brick"
    assert scene.upright
    assert scene.clearance == 0.004
    np.testing.assert_allclose(scene.goals["brick"][:2, :2], [[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])


def test_saving_and_loading_keeps_everything(tmp_path: Path) -> None:
    scene = Scene.load(written(tmp_path, GOOD))
    rng = np.random.default_rng(0)
    mesh = Body.box([0.04, 0.05, 0.06], mass=0.2, name="made")
    scene = scene.with_body("made", mesh, pose(*rng.normal(size=3), rotation(rng)), movable=False)
    again = Scene.load(scene.save(tmp_path / "out" / "again.toml"))
    assert list(again.bodies) == list(scene.bodies)
    for name, placed in scene.bodies.items():
        other = again.bodies[name]
        np.testing.assert_allclose(other.pose, placed.pose, atol=1e-14)
        assert other.movable == placed.movable
        assert other.body.mass == pytest.approx(placed.body.mass, rel=1e-15)
        assert other.body.friction == placed.body.friction
        np.testing.assert_allclose(other.body.extents, placed.body.extents, atol=1e-8)
    for box, other_box in zip(scene.boxes, again.boxes, strict=True):
        np.testing.assert_array_equal(box.size, other_box.size)
        np.testing.assert_allclose(box.pose, other_box.pose, atol=1e-15)
        assert (box.name, box.rgba, box.friction) == (other_box.name, other_box.rgba, other_box.friction)
    np.testing.assert_allclose(again.goals["brick"], scene.goals["brick"], atol=1e-15)
    np.testing.assert_allclose(again.robot.base, scene.robot.base, atol=1e-15)
    assert (again.pick, again.upright, again.clearance, again.gravity) == ("brick", True, 0.004, scene.gravity)
    assert again.robot.frame_names == scene.robot.frame_names
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"again.toml", "again_made.obj"}  # nothing half-written


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "clearance = 0.004",
            "clearence = 0.004",
            r"scene\.toml has an unknown key 'clearence'. Did you mean 'clearance'",
        ),
        ("clearance = 0.004", "clearance = -1", r"scene\.toml: clearance is -1; expected a finite number, 0 or more"),
        ('arm = "ur5e"', "", r"scene\.toml, \[robot\] has no 'arm'"),
        ('arm = "ur5e"', 'arm = "ur5ee"', r"(?s)\[robot\].*ur5ee.*Did you mean"),
        ("[robot]", "[robo]", r"unknown key 'robo'. Did you mean 'robot'"),
        ('hand = "robotiq_2f_85"', 'at = "tool0"', "names no hand"),
        (
            'hand = "robotiq_2f_85"',
            'hand = "robotiq_2f_85"\nat = "tool1"',
            "no link named 'tool1'.*Did you mean 'tool0'",
        ),
        ("rpy_deg = [0, 0, 90]", "rpy_deg = [0, 0]", r"base: rpy_deg is \[0, 0\]; expected a list of 3 finite numbers"),
        ("rpy_deg = [0, 0, 90]", "rpy_deg = [0, 0, nan]", "expected a list of 3 finite numbers"),
        ("rpy_deg = [0, 0, 90]", "rpy_deg = [0, 0, 9], wxyz = [1, 0, 0, 0]", "both rpy_deg and wxyz"),
        ("wxyz = [1, 0, 0, 0]", "wxyz = [1, 1, 0, 0]", r"number 2, pose: wxyz has length 1.414"),
        ("size = [1.0, 1.4, 0.04]", "size = [1.0, -1.4, 0.04]", r"\[\[box\]\] number 1.*every extent must be positive"),
        ("mass = 0.3", "mass = 0", r"\[\[body\]\] number 1.*mass"),
        ("mass = 0.3", 'mass = "heavy"', r"mass is 'heavy'; expected a finite number"),
        ("mass = 0.3", "mass = 0.3\ndensity = 100", "both mass and density"),
        ("mass = 0.3", 'mass = 0.3\nunits = "mm"', "units belong to a mesh"),
        ("box = [0.05, 0.06, 0.1]", 'mesh = "none.obj"', r"number 1.*none\.obj"),
        ("box = [0.05, 0.06, 0.1]", "", "needs one of mesh, household, box, cylinder, sphere; it has none"),
        ("box = [0.05, 0.06, 0.1]", "box = [0.05, 0.06, 0.1]\nsphere = 0.1", "it has box and sphere"),
        ('household = "mug"', 'household = "mugg"', r"number 2.*Did you mean 'mug'"),
        ('on = "table"', 'on = "tabel"', "no box named 'tabel'.*Did you mean 'table'"),
        ("yaw_deg = 30}", "yaw_deg = 30, choose = 77}", "there is no pose 77"),
        ("yaw_deg = 30}", "yaw_deg = 30, choose = 1.5}", "choose is 1.5; expected a whole number"),
        ("yaw_deg = 30}", "yaw_deg = 30}\npose = {xyz = [0, 0, 0]}", "either a pose or a rest"),
        ('pick = "brick"', 'pick = "brik"', "pick names 'brik', which is no body of this scene. Did you mean 'brick'"),
        ('pick = "brick"', "", r"\[task\] has no 'pick'"),
        ("upright = true", 'upright = "yes"', "upright is 'yes'; expected true or false"),
        ("[[box]]", "[box]", r"write \[\[box\]\] with two brackets"),
        ('household = "mug"', 'household = "mug"\nname = "table"', r"scene\.toml: 'table' names two things"),
        ('name = "brick"', 'name = "mug"', "2 bodies named 'mug'"),
        ("[robot]", "[robot", "is not TOML"),
        ("[task]", "[[task]]", r"write \[task\] with one bracket"),
        ("rpy = [0, 0, 0.5]", "rpy = [0, 0, 90]", r"place: rpy is .* radians, .*degrees are given as rpy_deg"),
        ("xyz = [0.5, 0.2, 0.05]", "xyz = [500, 200, 50]", "place: xyz is .* in metres, .*is it in millimetres"),
        ("size = [1.0, 1.4, 0.04]", "size = [1000, 1400, 40]", "size is .* in metres; are they in millimetres"),
        ("size = [1.0, 1.4, 0.04]", "size = [1, 1, 1]\nrgba = [255, 0, 0, 1]", "rgba is .* each from 0 to 1"),
        ("xy = [0.5, -0.2]", "xy = [5, -0.2]", "xy is .*a place on 'table', which spans 0.1 to 1.1 m in x"),
        ('on = "table"', 'on = "floor"', "A body rests on a box; there are: table"),
        ("clearance = 0.004", 'clearance = 0.004\nsrdf = "no.srdf"', r"scene\.toml, srdf: .*no\.srdf does not exist"),
        ("mass = 0.3", "com = [0, 0, 1]", "number 1.*com is .*outside the convex hull"),
        ("mass = 0.3", "inertia = [1, 1, 3, 0, 0, 0]", "number 1.*inertia has principal moments"),
        ("mass = 0.3", "inertia = [1, 1, 3]", "inertia is .*expected a list of 6"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in GOOD
    with pytest.raises(ApprehendError, match=words):
        Scene.load(written(tmp_path, GOOD.replace(old, new, 1)))


def test_missing_huge_and_binary_files(tmp_path: Path) -> None:
    written(tmp_path, GOOD)
    with pytest.raises(DescriptionError, match=r"no scene file .*scena.toml. Did you mean 'scene.toml'"):
        Scene.load(tmp_path / "scena.toml")
    huge = tmp_path / "huge.toml"
    huge.write_bytes(b"#" * 2_000_000)
    with pytest.raises(DescriptionError, match="at most 1000000"):
        Scene.load(huge)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DescriptionError, match="cannot be read"):
        Scene.load(binary)
    with pytest.raises(DescriptionError, match="cannot be read"):
        Scene.load(tmp_path)


def test_changes_make_new_scenes() -> None:
    robot = gantry()
    box = Box("shelf", np.array([1.0, 1.0, 0.1]), pose(0.0, 0.0, 0.5))
    scene = Scene(robot, RobotSource("in code"), boxes=(box,))
    ball = Body.sphere(0.05, name="ball2")
    more = scene.with_body("ball2", ball, pose(0.1)).with_task("ball2", pose(0.2), upright=True)
    assert not scene.bodies
    assert more.moved("ball2", pose(0.3)).bodies["ball2"].pose[0, 3] == 0.3
    assert more.bodies["ball2"].pose[0, 3] == 0.1
    less = more.without("ball2")
    assert (less.pick, dict(less.goals), dict(less.bodies)) == (None, {}, {})
    assert not more.without("shelf").boxes
    assert box.top == pytest.approx(0.55)
    with pytest.raises(TypeError):
        more.bodies["ball2"] = Placed(ball, pose())  # type: ignore[index]
    with pytest.raises(UnknownNameError, match=r"no body named 'ball'.*Did you mean 'ball2'"):
        more.moved("ball", pose())
    with pytest.raises(UnknownNameError, match="no box named"):
        more.box("nothing")
    with pytest.raises(UnknownNameError, match="no body named 'cup'"):
        Scene(robot, RobotSource("in code"), goals={"cup": pose()})
    with pytest.raises(InputError, match="'shelf' names two things"):
        scene.with_box(box)
    with pytest.raises(InputError, match="clearance of a scene is nan"):
        Scene(robot, RobotSource("in code"), clearance=float("nan"))
    with pytest.raises(InputError, match="is a reflection"):
        more.moved("ball2", np.diag([1.0, 1.0, -1.0, 1.0]))


@pytest.mark.parametrize("robot", ["ur5e", "ur3e", "panda"])
def test_the_standard_scene_fits_the_robot(robot: str) -> None:
    from apprehend.collision import CollisionModel

    try:
        scene = Scene.tabletop(robot)
    except ApprehendError as error:
        pytest.skip(str(error))
    assert CollisionModel(scene.robot, scene).free(scene.robot.home)
    (name,) = scene.bodies
    body, start, goal = scene.bodies[name].body, scene.bodies[name].pose, scene.goals[name]
    table = scene.box("table")
    for T in (start, goal):
        corners = body.vertices @ T[:3, :3].T + T[:3, 3]
        assert corners[:, 2].min() == pytest.approx(table.top, abs=1e-12)
        local = (corners - table.pose[:3, 3]) @ table.pose[:3, :3]
        assert (np.abs(local[:, :2]) < 0.5 * table.size[:2]).all()
    assert np.linalg.norm(start[:2, 3] - goal[:2, 3]) > 0.1


def test_tabletop_takes_bodies_and_poses() -> None:
    body = Body.cylinder(0.03, 0.12, mass=0.2, name="can1")
    scene = Scene.tabletop("ur5e", body=body, goal=pose(0.4, 0.1, 0.06), upright=True)
    assert scene.bodies["can1"].pose[2, 2] == pytest.approx(1.0)  # upright, as modelled
    assert scene.goals["can1"][0, 3] == 0.4
    assert scene.upright
    assert scene.robot_source.hand == "robotiq_2f_85"
    assert Scene.tabletop("ur5e", None, body=body, pose=pose(0.5)).robot_source.hand is None


def test_the_end_of_an_arm_and_its_hand_are_found() -> None:
    description = planar(3).description
    assert end_link(description) == "tip"
    assert not has_hand(description)


def test_rotations_round_trip() -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        R = rotation(rng)
        np.testing.assert_allclose(quaternion_matrix(matrix_quaternion(R)), R, atol=1e-14)
    for half_turn in (np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, -1.0]), np.diag([-1.0, -1.0, 1.0])):
        np.testing.assert_allclose(quaternion_matrix(matrix_quaternion(half_turn)), half_turn, atol=1e-14)
    np.testing.assert_allclose(rpy_matrix(np.array([0.0, 0.0, np.pi / 2])) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(
        rpy_matrix(np.array([0.3, 0.0, 0.5])) @ [1, 0, 0], [np.cos(0.5), np.sin(0.5), 0], atol=1e-15
    )
