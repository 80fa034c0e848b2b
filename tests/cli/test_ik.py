"""``apprehend ik``: the table of branches, the joint that a pose leaves open, the picture, and the curves."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from apprehend import Robot
from apprehend.cli.app import app


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["ik", *words], standalone_mode=False, catch_exceptions=False)
    code = done.return_value if isinstance(done.return_value, int) else done.exit_code
    return code, done.stdout


POSE = ("--xyz", "0.4,0.2,0.3", "--rpy", "3.0,0,0.3")


def test_every_branch_of_a_six_joint_arm() -> None:
    code, text = run("ur5e", "tool0", *POSE, "--json")
    data = json.loads(text)
    assert code == 0
    assert data["closed_form"] == "three parallel axes"
    robot = Robot.load("ur5e")
    T = robot.fk(np.array(data["q"]), "tool0")
    assert len(T) == 8
    assert np.abs(T - T[0]).max() < 1e-9
    assert np.allclose(T[0, :3, 3], [0.4, 0.2, 0.3])
    code, text = run("ur5e", "tool0", *POSE, "--deg")
    assert "shoulder_pan_joint" in text


def test_the_open_joint_of_a_seven_joint_arm() -> None:
    code, text = run("panda", "panda_hand", *POSE, "--json")
    data = json.loads(text)
    assert code == 0
    assert data["redundant_joint"] == "panda_joint7"
    low, high = data["feasible"][0]
    q = np.array(data["q"])
    assert np.allclose(q[:, 6], 0.5 * (low + high))
    assert Robot.load("panda").limits.contains(q).all()
    code, text = run("panda", "panda_hand", *POSE, "--redundancy", "1.0", "--all", "--json")
    every = json.loads(text)
    assert len(every["q"]) == 8
    assert any(float(row["limits"].split()[1]) < 0.0 for row in every["rows"])


def test_pictures_are_written(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from PIL import Image

    arms, curves = tmp_path / "arms.png", tmp_path / "curves.png"
    code, _ = run("ur5e", "tool0", *POSE, "--n", "2", "--picture", str(arms), "--curves", str(curves))
    assert code == 0
    picture = np.asarray(Image.open(arms))
    assert picture.shape == (380, 840, 3)
    assert np.abs(picture[:, :420].astype(int) - picture[:, 420:]).max() > 100  # two postures
    assert np.asarray(Image.open(curves)).std() > 10.0


def test_out_of_reach_shows_the_nearest() -> None:
    code, text = run("panda", "panda_hand", "--xyz", "2,0,0", "--json")
    data = json.loads(text)
    assert code == 1
    assert data["q"] == []
    assert data["status"] == "out_of_reach"
    assert Robot.load("panda").limits.contains(np.array(data["nearest"]))
    code, text = run("panda", "panda_hand", "--xyz", "2,0,0")
    assert "nearest joint vector within the limits" in text
