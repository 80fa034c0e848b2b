"""``apprehend trajectory`` as a person meets it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from apprehend import trajectory as tj
from apprehend.errors import InputError


def run(*args: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    program = "from apprehend.cli import main; main()"
    command = [sys.executable, "-c", program, "trajectory", *args]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=280)


def test_a_file_of_waypoints_becomes_a_motion(tmp_path: Path) -> None:
    (tmp_path / "way.csv").write_text("a,b\n0,0\n1,0.5\n0.5,2\n")
    result = run("way.csv", "--velocity", "1", "--acceleration", "2", "--out", "m.json", "--json", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    facts = json.loads(result.stdout)
    assert facts["success"]
    assert facts["violation"] <= 1e-9
    motion, names = tj.read_json(tmp_path / "m.json")
    assert motion.duration == pytest.approx(facts["duration"])
    assert names == ("q1", "q2")
    np.testing.assert_allclose(motion.end, [0.5, 2.0], atol=1e-9)


def test_mistakes_are_one_paragraph(tmp_path: Path) -> None:
    (tmp_path / "way.csv").write_text("0,0\n1,zwei\n")
    result = run("way.csv", "--acceleration", "2", cwd=tmp_path)
    assert result.returncode == 2
    assert "way.csv:2" in result.stderr
    assert "Traceback" not in result.stderr


def test_waypoint_files(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("[[0, 1], [2, 3]]")
    np.testing.assert_array_equal(tj.read_waypoints(tmp_path / "a.json"), [[0.0, 1.0], [2.0, 3.0]])
    for text, message in (
        ("0,0\n1\n", "1 values; the rows before have 2"),
        ("0,0\n", "at least two points"),
        ("x,y\nz,w\n1,2\n", r":2: could not convert"),
    ):
        (tmp_path / "b.csv").write_text(text)
        with pytest.raises(InputError, match=message):
            tj.read_waypoints(tmp_path / "b.csv")
    with pytest.raises(InputError, match="cannot be read"):
        tj.read_waypoints(tmp_path / "none.csv")
    (tmp_path / "c.json").write_text("{")
    with pytest.raises(InputError, match="not JSON"):
        tj.read_waypoints(tmp_path / "c.json")
    motion = tj.cubic([0.0], [1.0], 1.0)
    tj.to_ros(motion, tmp_path / "m.ros.json", dt=0.25)
    assert len(json.loads((tmp_path / "m.ros.json").read_text())["points"]) == 5


def test_limits_of_the_robot_are_kept(tmp_path: Path) -> None:
    """Its torques and its positions too; what is missing is asked for by the name of its option."""
    ap = pytest.importorskip("apprehend")
    try:
        ap.Robot.load("ur5")
    except ap.errors.MissingDependencyError as error:
        pytest.skip(str(error))
    (tmp_path / "way.csv").write_text("0,-1.2,1,0,0.5,0\n0.5,-1,1.4,0.3,0.5,1\n0.3,-0.8,0.7,0.2,0.1,-0.5\n")
    options = ("way.csv", "--robot", "ur5", "--acceleration", "5", "--grid", "80")
    result = run(*options, "--torque", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "torques proven too: largest excess over any limit 0" in result.stdout
    (tmp_path / "way.csv").write_text("0,0,0,0,0,0\n3,0,0,0,0,9\n")
    result = run(*options, cwd=tmp_path)
    assert result.returncode == 1
    assert "position of coordinate 5 is 9" in result.stdout.replace("\n", "")
    result = run(*options, "--straight", cwd=tmp_path)
    assert result.returncode == 1
    assert "a limit is exceeded: position of wrist_3_joint" in result.stdout.replace("\n", " ")
    result = run("way.csv", "--velocity", "1", cwd=tmp_path)
    assert result.returncode == 2
    assert "give --acceleration" in result.stderr.replace("\n", " ")
