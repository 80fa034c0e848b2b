"""Several frames at once: two arms that share a torso, and a hand's fingertips by position."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import ik
from apprehend.errors import InputError
from apprehend.ik import IKStatus

from .makers import configurations, two_arms

TIPS = ("left_tip", "right_tip")


def test_two_arms_on_one_torso() -> None:
    robot = two_arms(2)
    q = configurations(robot, 60)
    T = np.stack([robot.fk(q, tip) for tip in TIPS], axis=1)
    sol = ik.solve_frames(robot, T, TIPS)
    assert sol.success.mean() >= 0.9
    good = sol.success
    X = np.stack([robot.fk(sol.q[good], tip) for tip in TIPS], axis=1)
    assert np.abs(X - T[good]).max() < 2e-6
    assert robot.limits.contains(sol.q[good]).all()
    near = ik.solve_frames(robot, T, TIPS, robot.limits.clip(q + 1e-3))
    assert np.abs(near.q - q).max() < 0.1
    assert near.success.all()


def test_positions_only_and_tolerances_of_each_frame() -> None:
    robot = two_arms(3)
    T = np.stack([robot.fk(configurations(robot, 40), tip) for tip in TIPS], axis=1)
    inf = np.inf
    box = np.array([[1e-6] * 3 + [inf] * 3, [1e-6] * 6])
    sol = ik.solve_frames(robot, T, TIPS, tolerance=box)
    assert sol.success.mean() >= 0.95
    q = sol.q[sol.success]
    assert np.abs(robot.fk(q, "left_tip")[:, :3, 3] - T[sol.success, 0, :3, 3]).max() < 2e-6
    assert np.abs(robot.fk(q, "right_tip") - T[sol.success, 1]).max() < 4e-6


def test_failure_and_bad_arguments() -> None:
    robot = two_arms(2)
    T = np.stack([robot.fk(robot.home, tip) for tip in TIPS])
    assert ik.solve_frames(robot, T, TIPS).success
    far = T.copy()
    far[1, :3, 3] += 30.0
    sol = ik.solve_frames(robot, far, TIPS, max_starts=5)
    assert sol.status is IKStatus.OUT_OF_REACH
    assert "certified" in sol.reason()
    with pytest.raises(InputError, match="expected two or more different ones"):
        ik.solve_frames(robot, T[:1], ["left_tip"])
    with pytest.raises(InputError, match=r"T has shape \(4, 4\); expected \(..., 2, 4, 4\)"):
        ik.solve_frames(robot, T[0], TIPS)
    with pytest.raises(InputError, match=r"tolerance has shape \(2,\)"):
        ik.solve_frames(robot, T, TIPS, tolerance=[1.0, 1.0])
    with pytest.raises(InputError, match="must be positive"):
        ik.solve_frames(robot, T, TIPS, tolerance=-1.0)
    with pytest.raises(InputError, match="max_starts is 0"):
        ik.solve_frames(robot, T, TIPS, max_starts=0)
