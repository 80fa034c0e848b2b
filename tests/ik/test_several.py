"""Several frames at once: two arms that share a torso, and a hand's fingertips by position."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import ik
from apprehend.errors import InputError
from apprehend.ik import IKStatus
from apprehend.ik.chain import prepare

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


def torn(count: int) -> tuple[object, np.ndarray]:
    """Two arms whose targets ask for opposite ends of the torso's range."""
    robot = two_arms(2)
    a, b = configurations(robot, count, 1), configurations(robot, count, 2)
    a[:, 0], b[:, 0] = -0.95, 0.95
    return robot, np.stack([robot.fk(a, TIPS[0]), robot.fk(b, TIPS[1])], axis=1)


def test_reasons_of_several_frames() -> None:
    robot, T = torn(60)
    sol = ik.solve_frames(robot, T, TIPS)
    failed = ~sol.success
    assert set(sol.status[failed]) == {IKStatus.CONFLICT, IKStatus.LIMITS}
    assert (sol.at_fault == -1).all()
    i = int(np.flatnonzero(sol.status == IKStatus.CONFLICT)[0])
    assert "every frame reaches its target alone" in sol.reason(i)
    j = int(np.flatnonzero(sol.status == IKStatus.LIMITS)[0])
    assert "only outside the joint limits" in sol.reason(j)
    assert sol.limiting[failed].any()
    assert robot.limits.contains(sol.q).all()
    quick = ik.solve_frames(robot, T, TIPS, diagnose=False)
    assert (quick.status[~quick.success] == IKStatus.NOT_FOUND).all()
    T[:, 1, :3, 3] *= 0.02  # near the axis of the torso, where the right arm can hardly come
    T[0, 1, 0, 3] += 30.0
    alone = ik.solve_frames(robot, T, TIPS)
    assert 0.2 < (alone.at_fault[~alone.success] == 1).mean() < 1.0
    assert alone.certified[0]
    assert "because of 'right_tip' alone: no joint vector reaches the target (certified" in alone.reason(0)


def test_the_nearest_joint_vector_for_several_frames_is_a_minimum() -> None:
    optimize = pytest.importorskip("scipy.optimize")
    from scipy.spatial.transform import Rotation

    robot, T = torn(40)
    sol = ik.solve_frames(robot, T, TIPS)
    reach = max(prepare(robot, tip).reach for tip in TIPS)

    def cost(q: np.ndarray, target: np.ndarray) -> float:
        total = 0.0
        for tip, goal in zip(TIPS, target, strict=True):
            X = robot.fk(q, tip)
            total += float((((X[:3, 3] - goal[:3, 3]) / reach) ** 2).sum())
            total += float((Rotation.from_matrix(X[:3, :3] @ goal[:3, :3].T).as_rotvec() ** 2).sum())
        return total

    bounds = list(zip(robot.limits.lower, robot.limits.upper, strict=True))
    for i in np.flatnonzero(~sol.success)[:5]:
        ours = cost(sol.q[i], T[i])
        polished = optimize.minimize(cost, sol.q[i], (T[i],), method="L-BFGS-B", bounds=bounds).fun
        assert ours <= polished * (1.0 + 1e-4) + 1e-12


def test_more_bad_arguments() -> None:
    robot = two_arms(2)
    T = np.stack([robot.fk(robot.home, tip) for tip in TIPS])
    with pytest.raises(InputError, match="frames is 'left_tip'; expected two or more"):
        ik.solve_frames(robot, T, "left_tip")
    box = np.full((2, 6), 1e-6)
    box[1] = np.inf
    with pytest.raises(InputError, match="tolerance of frame 'right_tip' is inf in all axes"):
        ik.solve_frames(robot, T, TIPS, tolerance=box)
