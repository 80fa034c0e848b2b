"""``apprehend plan``: paths that can be used, and reasons where there are none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from apprehend.collision import Box, CollisionModel, Scene
from apprehend.planning import Constraints, Upright
from apprehend.trajectory import read_waypoints
from tests.cli.test_cli import run
from tests.collision.makers import pose


@pytest.fixture(scope="module")
def walled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scene = Scene.tabletop("ur5e", None, body="can")
    wall = Box("wall", np.array([0.6, 0.04, 0.8]), pose(0.55, 0.0, 0.4))
    return scene.with_box(wall).save(tmp_path_factory.mktemp("scene") / "walled.toml")


def test_a_path_around_a_wall_is_written_and_drawn(walled: Path, tmp_path: Path) -> None:
    out, picture = tmp_path / "path.json", tmp_path / "path.png"
    ends = ("--start", "shoulder_pan_joint=-0.8", "--goal", "shoulder_pan_joint=0.8")
    result = run("plan", str(walled), *ends, "--time-limit", "60", "--out", str(out), "--picture", str(picture))
    assert result.returncode == 0, result.stderr
    assert "A path was found" in result.stdout
    path = read_waypoints(out)
    scene = Scene.load(walled)
    np.testing.assert_allclose(path[[0, -1], 0], [-0.8, 0.8])
    assert len(path) > 2
    assert CollisionModel(scene.robot, scene).path_free(path)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_poses_are_goals_and_the_tool_stays_upright(walled: Path) -> None:
    result = run("plan", str(walled), "--start", "shoulder_pan_joint=-0.8", "--xyz", "0.45,0.35,0.3", "--xyz", "9,9,9",
                 "--frame", "tool0", "--upright", "15", "--time-limit", "60", "--json")  # fmt: skip
    assert result.returncode == 0, result.stdout + result.stderr
    data = json.loads(result.stdout)
    path, robot = np.array(data["path"]), Scene.load(walled).robot
    np.testing.assert_allclose(robot.fk(path[-1], "tool0")[:3, 3], [0.45, 0.35, 0.3], atol=1e-5)
    keep = Constraints(robot, [Upright("tool0", angle=np.radians(15.0) + 1e-9, up=robot.fk(path[0], "tool0")[:3, 2])])
    s = np.linspace(0.0, 1.0, 50)[:, None, None]
    assert keep.violation((path[:-1] + s * np.diff(path, axis=0)).reshape(-1, robot.n)).max() == 0.0


def test_no_path_is_exit_code_one_with_the_reason(walled: Path) -> None:
    far = run("plan", "ur5e", "--xyz", "2,0,0", "--json")
    assert far.returncode == 1
    assert "no joint vector reaches the target" in json.loads(far.stdout)["reason"]
    begin = ("--start", "shoulder_pan_joint=-0.8")
    blocked = run("plan", str(walled), *begin, "--goal", "shoulder_lift_joint=0.5")
    assert blocked.returncode == 1
    assert "deep in table" in blocked.stdout
    inside = run("plan", str(walled), "--goal", "shoulder_pan_joint=-0.8")
    assert inside.returncode == 1
    assert "The start is in collision. forearm_link is" in " ".join(inside.stdout.split())
    line = run(
        "plan", str(walled), "--start", "shoulder_pan_joint=-0.8", "--straight", "--xyz", "0.45,0.3,0.3", "--json"
    )
    assert line.returncode == 1
    answer = json.loads(line.stdout)
    assert answer["status"] == "collision"
    assert "wall" in answer["reason"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), "there is no goal"),
        (("--goal", "1,2"), "--goal (joints shoulder_pan_joint"),
        (("--goal", "elbow=1"), "elbow"),
        (("--goal", "elbow_joint=x"), "'elbow_joint=x'; expected joint=value"),
        (("--straight", "--goal", "home"), "--straight goes to one pose"),
        (("--goal", "home", "--frame", "tol0"), "Did you mean 'tool0'"),
        (("--goal", "home", "--out", "path.txt"), "ends in .json or .csv"),
        (("--goal", "home", "--out", "no/path.csv"), "there is no folder"),
        (("--goal", "home", "--picture", "path.jpg"), "--picture is path.jpg; expected a name that ends in .png"),
    ],
)
def test_mistakes_are_named(options: tuple[str, ...], words: str, tmp_path: Path) -> None:
    result = run("plan", "ur5e", *options, cwd=tmp_path)
    assert result.returncode == 2
    assert words in " ".join(result.stderr.split())
    assert "Traceback" not in result.stderr
