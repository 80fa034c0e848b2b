"""``apprehend robots``, ``fk`` and ``jacobian``: what they print, their JSON, and mistakes."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apprehend.cli import main
from apprehend.kinematics import Robot, dh_table, manipulability


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """Runs a command in this process; gives the exit code, standard output and standard error."""

    def call(*args: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["apprehend", *args])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        return int(ended.value.code or 0), out, err

    return call


def data(result: tuple[int, str, str]) -> Any:
    code, out, err = result
    assert (code, err) == (0, "")
    return json.loads(out)


def test_the_catalogue_by_kind(run: Any) -> None:
    rows = data(run("robots", "--kind", "hand", "--json"))
    assert {"robotiq_2f_85", "shadow_right"} <= {row["name"] for row in rows}
    assert {row["kind"] for row in rows} == {"hand"}
    code, _, err = run("robots", "--kind", "hands")
    assert code == 2
    assert "no kind named 'hands' in the catalogue. Did you mean 'hand'" in " ".join(err.split())


def test_everything_about_a_robot(run: Any) -> None:
    robot = Robot.load("puma560")
    told = data(run("robots", "puma560", "--frame", "link6", "--modified", "--json"))
    assert told["coordinates"] == list(robot.joint_names)
    assert told["root"] == robot.frame_names[0]
    assert [j["parent"] for j in told["joints"]] == [j.parent for j in robot.description.joints]
    assert told["joints"][0]["lower"] == pytest.approx(np.radians(-160.0))
    assert told["joints"][0]["velocity"] is None
    assert told["masses"]["link2"] == 17.4
    table = dh_table(robot, "link6").modified()
    assert told["dh"]["convention"] == "modified"
    assert [row["alpha"] for row in told["dh"]["rows"]] == [row.alpha for row in table.rows]
    assert np.allclose(told["dh"]["tool"], table.tool)


def test_degrees_only_where_asked(run: Any) -> None:
    _, radians, _ = run("robots", "scara", "--frame", "tool")
    _, degrees, _ = run("robots", "scara", "--frame", "tool", "--deg")
    assert "[-2.5, 2.5] rad" in radians
    assert "[-143.2, 143.2] °" in degrees
    assert "[-0.2, 0] m" in degrees
    assert "θ and α in rad" in radians
    assert "θ and α in degrees" in degrees
    q = data(run("fk", "scara", "tool", "--q", "0.5,0.25,0,-0.1", "--json"))["tool"]
    turned = f"{np.degrees(0.5)!r},{np.degrees(0.25)!r},0,-0.1".replace("np.float64(", "").replace(")", "")
    assert np.allclose(data(run("fk", "scara", "tool", "--q", turned, "--deg", "--json"))["tool"], q, atol=1e-15)


def test_no_minus_before_a_zero(run: Any) -> None:
    _, out, _ = run("fk", "scara")
    assert "-0.00000" not in out
    assert "0.65000" in out


def test_the_jacobian_and_its_measures(run: Any, tmp_path: Path) -> None:
    robot, q = Robot.load("planar_3r"), [0.4, 0.0, 0.0]
    told = data(run("jacobian", "planar_3r", "link3", "--q", "0.4,0,0", "--part", "xy", "--json"))
    m = manipulability(robot, q, "link3", "xy")
    assert np.allclose(told["jacobian"], robot.jacobian(q, "link3"))
    assert told["rank"] == 1
    assert told["mu3"] == pytest.approx(float(m.mu3), abs=1e-15)
    assert np.allclose(np.abs(told["lost"][0]), [np.cos(0.4), np.sin(0.4)])
    _, out, _ = run("jacobian", "planar_3r", "link3")
    assert "both: rank 2 of 6" in out
    assert "lost direction" in out
    pytest.importorskip("matplotlib")
    picture = tmp_path / "ellipsoids.svg"
    run("jacobian", "planar_3r", "link3", "--q", "0.4,0.5,0.3", "--part", "xy", "--picture", str(picture))
    assert "<svg" in picture.read_text()


LOOP = """<robot name="ring"><link name="a"/><link name="b"/><link name="c"/>
<joint name="ab" type="continuous"><parent link="a"/><child link="b"/></joint>
<joint name="ac" type="continuous"><parent link="a"/><child link="c"/></joint>
<joint name="bc" type="continuous"><parent link="b"/><child link="c"/></joint></robot>"""


def test_closed_chains_are_refused_or_cut(run: Any, tmp_path: Path) -> None:
    path = tmp_path / "ring.urdf"
    path.write_text(LOOP)
    code, _, err = run("robots", str(path))
    assert code == 2
    assert "Pass --cut-loops to read the tree without the second joint" in " ".join(err.split())
    told = data(run("robots", str(path), "--cut-loops", "--json"))
    assert told["loops"] == [{"name": "bc", "first": "b", "second": "c", "free": "continuous"}]
    assert set(data(run("fk", str(path), "--cut-loops", "--json"))) == {"a", "b", "c"}


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (("jacobian", "scara", "tol"), "no frame named 'tol' in robot 'scara'. Did you mean 'tool'?"),
        (("jacobian", "scara", "tool", "--reference", "word"), "reference is 'word'; expected one of 'spatial'"),
        (("jacobian", "scara", "tool", "--part", "zz"), "part is 'zz'; expected one of 'linear', 'angular', 'both'"),
        (("fk", "scara", "--q", "1,2,x,4"), "expected 4 numbers with commas between them"),
        (("fk", "scara", "--q", "1,2,nan,4"), "is '1,2,nan,4'; expected 4 finite numbers"),
        (("robots", "scara", "--frame", "base"), "no joint of robot 'scara' moves frame 'base'"),
    ],
)
def test_mistakes_are_named(run: Any, args: tuple[str, ...], said: str) -> None:
    code, out, err = run(*args)
    assert (code, out) == (2, "")
    assert said in " ".join(err.split())
