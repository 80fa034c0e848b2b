"""Files and pictures of motions."""

from __future__ import annotations

import json

import numpy as np
import pytest

from apprehend import trajectory as tj
from apprehend.errors import InputError

LIMITS = tj.Limits(velocity=1.0, acceleration=2.0, position=[[-5.0, 5.0]] * 3)
MOTION = tj.time_optimal(tj.Spline(np.random.default_rng(0).normal(size=(4, 3))), LIMITS).motion


def test_json_is_exact(tmp_path) -> None:
    tj.to_json(MOTION, tmp_path / "m.json", names=["a", "b", "c"])
    motion, names = tj.read_json(tmp_path / "m.json")
    assert names == ("a", "b", "c")
    np.testing.assert_array_equal(motion.breaks, MOTION.breaks)
    np.testing.assert_array_equal(motion.coefficients, MOTION.coefficients)
    assert [p.name for p in tmp_path.iterdir()] == ["m.json"]


def test_csv(tmp_path) -> None:
    tj.to_csv(MOTION, tmp_path / "m.csv", dt=0.05)
    text = (tmp_path / "m.csv").read_text().splitlines()
    assert text[0].startswith("t,q1,q2,q3,q1_velocity")
    table = np.array([[float(x) for x in line.split(",")] for line in text[1:]])
    np.testing.assert_array_equal(table[:, 1:4], MOTION(table[:, 0]))
    np.testing.assert_array_equal(table[:, 7:], MOTION(table[:, 0], 2))


def test_ros_layout() -> None:
    message = tj.joint_trajectory(MOTION, dt=0.1, names=["a", "b", "c"])
    assert message["joint_names"] == ["a", "b", "c"]
    times = [p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in message["points"]]
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(MOTION.duration, abs=1e-8)
    assert all(0 <= p["time_from_start"]["nanosec"] < 10**9 for p in message["points"])
    assert (np.diff(times) > 0).all()
    np.testing.assert_allclose(message["points"][3]["velocities"], MOTION(times[3], 1), atol=1e-6)
    json.dumps(message)


def test_plots() -> None:
    pytest.importorskip("matplotlib")
    figure = tj.plot(MOTION, LIMITS, names=["a", "b", "c"])
    assert len(figure.axes) == 4
    dashed = [line for line in figure.axes[1].lines if line.get_linestyle() == "--"]
    assert sorted({line.get_ydata()[0] for line in dashed}) == [-1.0, 1.0]
    share = tj.plot(MOTION, LIMITS, relative=True).axes[2]
    assert max(np.abs(line.get_ydata()).max() for line in share.lines) <= 1.0 + 1e-9


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda p: tj.to_json(MOTION, p / "no" / "m.json"), "does not exist"),
        (lambda p: tj.to_json(MOTION, p / "m.json", names=["a", "a", "b"]), r"names has 3 entries \(2 different\)"),
        (lambda p: tj.read_json(p / "none.json"), "cannot be read as a trajectory"),
        (lambda p: tj.plot(MOTION, names=["a"]), "names has 1 entries"),
    ],
)
def test_bad_input(call, message: str, tmp_path) -> None:
    with pytest.raises(InputError, match=message):
        call(tmp_path)


def test_foreign_json(tmp_path) -> None:
    (tmp_path / "x.json").write_text('{"format": "other"}')
    with pytest.raises(InputError, match="is not a trajectory of this package"):
        tj.read_json(tmp_path / "x.json")
