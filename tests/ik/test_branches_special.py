"""Branches where the ordinary case ends: singular poses, limits there, and arms with parallel axes in odd places."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import ik
from apprehend.errors import InputError, UnsuccessfulError
from apprehend.ik import BranchStatus
from apprehend.kernels.ik_refine import finish
from apprehend.kernels.ik_seeds import chain_targets
from apprehend.kinematics import Robot

from .makers import configurations, from_axes, from_dh
from .test_branches import Y, Z, apart

HALF = np.pi / 2
UR = (
    np.array([Z, Y, Y, Y, -Z, Y]),
    np.array([[0, 0, 0.15], [0, 0.13, 0], [0, -0.12, 0.42], [0, 0, 0.39], [0, 0.09, 0], [0, 0, 0.1], [0, 0.08, 0]]),
)
PUMA = (
    np.array([Z, Y, Y, Z, Y, Z]),
    np.array([[0, 0, 0.6], [0, 0.1, 0], [0.43, 0, 0], [0.02, 0.1, 0], [0, 0, 0.43], [0, 0, 0], [0, 0, 0.06]]),
)


@pytest.mark.parametrize("arm", [UR, PUMA], ids=["three parallel axes", "wrist"])
def test_poses_at_right_angles_are_reached_although_most_are_singular(arm: tuple[np.ndarray, np.ndarray]) -> None:
    robot = from_axes(*arm)
    q = np.stack(np.meshgrid(*[[-HALF, 0.0, HALF, np.pi]] * 6), axis=-1).reshape(-1, 6)
    T = robot.fk(q, "tip")
    sol = ik.branches(robot, T)
    assert sol.success.all()
    gap = np.abs(robot.fk(sol.q, "tip") - T[:, None]).max(axis=(-1, -2))
    assert gap[sol.valid].max() < 1e-8


def test_of_a_continuum_a_member_within_the_limits_is_returned() -> None:
    robot = from_axes(*PUMA, limit=2.6)
    q = configurations(robot, 400, 3)
    q[:, 4] = 0.0  # axes 4 and 6 are in line: only their sum counts, and alone it may leave the limits
    T = robot.fk(q, "tip")
    sol = ik.branches(robot, T)
    assert sol.success.all()
    best = sol.q[:, 0]
    first = sol.valid[:, 0]
    assert robot.limits.contains(best[first]).all()
    assert np.abs(robot.fk(best[first], "tip") - T[first]).max() < 1e-8
    q[:, 4] = 0.1
    assert ik.branches(robot, robot.fk(q, "tip")).success.all()


def test_a_pose_that_only_leaves_the_limits_says_so_at_a_singularity_too() -> None:
    robot = from_axes(*PUMA, limit=1.0)
    q = np.array([0.2, 0.3, 0.4, 1.5, 0.0, 1.5])
    sol = ik.branches(robot, robot.fk(q, "tip"))
    assert sol.status is BranchStatus.LIMITS


def dh(rows: list[tuple[float, float, float]]) -> Robot:
    return from_dh([{"offset": 0.0, "d": d, "a": a, "alpha": np.deg2rad(alpha)} for d, a, alpha in rows])


@pytest.mark.parametrize(
    "rows",
    [
        [(0.15, 0.2, 0), (0, 0.3, 0), (0.1, 0.5, 90), (0.16, 0.05, 0), (0.12, 0.07, 90), (0.1, 0.02, 0)],
        [(0.15, 0.2, 0), (0, 0.3, 90), (0.1, 0.5, 0), (0.16, 0.05, 90), (0.12, 0.07, 0), (0.1, 0.02, 0)],
        [(0.15, 0.2, 90), (0, 0.3, 0), (0.1, 0.5, 90), (0.16, 0.05, 0), (0.12, 0.07, 90), (0.1, 0.02, 0)],
        [(0.15, 0.2, 0), (0, 0.3, 90), (0.1, 0, -90), (0.16, 0, 90), (0.12, 0.1, -90), (0.1, 0.02, 0)],
    ],
    ids=["1 2 3 and 4 5 parallel", "three pairs", "2 3 and 4 5", "two pairs that meet"],
)
def test_parallel_axes_anywhere_hide_no_branch(rows: list[tuple[float, float, float]]) -> None:
    robot = dh(rows)
    q = configurations(robot, 120, 5)
    sol = ik.branches(robot, robot.fk(q, "tip"))
    assert sol.family == "six revolute joints in any position"
    assert max(apart(sol.solutions(i), q[i]).min() for i in range(len(q))) < 1e-5


def test_a_batch_without_full_success_can_be_required() -> None:
    robot = from_axes(*UR)
    near = robot.fk(np.zeros(6), "tip")
    far = near.copy()
    far[0, 3] = 9.0
    assert ik.branches(robot, np.stack([near, near])).require_success().success.all()
    with pytest.raises(UnsuccessfulError, match="1 of 2 targets have branches"):
        ik.branches(robot, np.stack([near, far])).require_success()


def test_targets_and_q0_broadcast_and_kernels_meet_one_type() -> None:
    robot = from_axes(*UR)
    T, q0 = robot.fk(np.full(6, 0.3), "tip"), np.zeros(6)
    for poses, near, shape in (
        (T, q0, ()), (T, q0[None], (1,)), (T, np.zeros((3, 6)), (3,)), (np.stack([T, T])[:, None], q0[None], (2, 1)),
    ):  # fmt: skip
        assert ik.branches(robot, poses, "tip", q0=near).codes.shape == shape
        assert ik.solve(robot, poses, "tip", near).codes.shape == shape
    assert len(finish.signatures) == len(chain_targets.signatures) == 1
    with pytest.raises(InputError, match=r"q0 has batch shape \(3,\) and T \(2,\); they do not broadcast"):
        ik.branches(robot, np.stack([T, T]), "tip", q0=np.zeros((3, 6)))
    with pytest.raises(InputError, match=r"q0 has batch shape \(3,\) and T \(2,\)"):
        ik.solve_frames(robot, np.stack([[T, T], [T, T]]), ["tip", "link2"], q0=np.zeros((3, 6)))
    with pytest.raises(InputError, match=r"velocity has shape \(3, 6\); expected \(6,\), as q"):
        ik.step(robot, q0, [ik.PoseTask("tip", T)], 0.01, velocity=np.zeros((3, 6)))
