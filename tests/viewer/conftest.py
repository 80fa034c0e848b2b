"""A small episode, written by hand: an arm that swings over a table while a cube is carried."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apprehend import Body
from apprehend.process.episode import FORMAT, plain
from apprehend.robots import load_description


def make_episode(*, success: bool = True, recorded: bool = True) -> dict[str, Any]:
    from apprehend.kinematics import Robot

    robot = Robot(load_description("ur5e"))
    time = np.linspace(0.0, 3.0, 181)
    q = robot.home + 0.3 * np.sin(time)[:, None] * np.ones(robot.n)
    step = np.searchsorted([0.5, 1.0, 2.0], time)
    rows = np.tile([0.5, 0.1, 0.0, 1.0, 0.0, 0.0, 0.0], (len(time), 1))
    rows[:, 2] = np.clip(time - 1.0, 0.0, 0.1)
    rows[:, 1] += np.clip(time - 1.5, 0.0, 1.0) * 0.2
    pose = np.eye(4)
    pose[:2, 3] = [0.5, 0.1]
    goal = pose.copy()
    goal[1, 3] = 0.3
    table = np.eye(4)
    table[:3, 3] = [0.5, 0.0, -0.02]
    limits = robot.limits
    steps = [
        {
            "name": name, "title": title, "status": "success" if success or name != "lift" else "failed",
            "message": message, "duration": 0.5, "simulated": 1.0, "inputs": {"width": 0.05},
            "outputs": {"contacts": [[0.025, 0.0, 0.025], [-0.025, 0.0, 0.025]], "normals": [[-1, 0, 0], [1, 0, 0]]},
            "margins": {"tracking_error": 1e-4, "slip": 2e-5},
        }
        for name, title, message in (
            ("plan", "Plan the grasp", "found <3> grasps & more"),
            ("close", "Close until contact", "10 N"),
            ("lift", "Lift", "raised 100 mm"),
            ("place", "Set down", "done"),
        )
    ]  # fmt: skip
    recording: dict[str, Any] = {
        "joint_names": robot.joint_names, "arm": list(range(6)), "t": time, "q": q, "qd": np.gradient(q, time, axis=0),
        "tau": 0.1 * q, "bodies": {"cube": rows}, "contact_force": np.where(step > 0, 1.0, 0.0), "step_index": step,
        "limits": {n: getattr(limits, n) for n in ("lower", "upper", "velocity", "acceleration", "effort")},
    }  # fmt: skip
    nothing = float("nan")
    data = {
        "format": FORMAT,
        "title": "arm picks <cube>",
        "inputs": {"robot": "ur5e", "mass": 0.1, "friction": 0.5, "seed": 0},
        "verdict": {
            "success": success, "status": "success" if success else "failed_step", "reason": "because & so",
            "position_error": 1e-3 if success else nothing, "angle_error": 1e-2 if success else nothing,
            "slip": 1e-4 if success else nothing,
        },
        "steps": steps,
        "scene": {
            "robot": {"arm": "ur5e", "hand": None, "at": None, "base": np.eye(4)},
            "bodies": [{"name": "cube", "mesh": "meshes/cube.obj", "pose": pose}],
            "boxes": [{"name": "table", "size": [0.8, 1.0, 0.04], "pose": table, "rgba": [0.6, 0.5, 0.4, 1.0]}],
            "goal": {"body": "cube", "pose": goal},
        },
        "recording": recording if recorded else {},
    }  # fmt: skip
    result: dict[str, Any] = plain(data)
    return result


@pytest.fixture(scope="session")
def episode(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return on_disk(make_episode(), tmp_path_factory.mktemp("episode"))


def on_disk(data: dict[str, Any], folder: Path) -> dict[str, Any]:
    import json

    Body.household("cube").save(folder / "meshes" / "cube.obj")
    (folder / "episode.json").write_text(json.dumps(data))
    return {**data, "path": str(folder / "episode.json")}
