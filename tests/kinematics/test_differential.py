"""Rates of Jacobians by differences, statics by virtual work, the script's ways, and the Coriolis matrix's symmetry."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.errors import InputError
from apprehend.kinematics import (
    ProductOfExponentials,
    Robot,
    StaticsStatus,
    acceleration,
    com_jacobian,
    com_jacobian_derivative,
    frame_wrench,
    joint_torques,
    leaf_to_root_jacobian,
    rpy_jacobian,
    rpy_jacobian_derivative,
    velocity,
)
from apprehend.spatial import euler, se3

from .trees import random_pose, random_tree

SEEDS = range(5)


def robot_of(seed: int, *, serial: bool = False) -> tuple[Robot, str, np.random.Generator]:
    rng = np.random.default_rng(seed)
    robot = Robot(random_tree(seed, 12, serial=serial, armature=True), base=random_pose(rng))
    frame = max(robot.frame_names, key=lambda name: len(robot.chain(name)))
    return robot, frame, rng


@pytest.mark.parametrize("reference", ["spatial", "body", "mixed"])
@pytest.mark.parametrize("seed", SEEDS)
def test_rate_of_the_jacobian_is_its_difference(seed: int, reference: str) -> None:
    robot, frame, rng = robot_of(seed)
    q, qd = rng.normal(size=(2, 7, robot.n))
    J, dJ = robot.jacobian_derivative(q, qd, frame, reference)
    np.testing.assert_allclose(J, robot.jacobian(q, frame, reference), atol=1e-13)
    h = 1e-6
    slope = (robot.jacobian(q + h * qd, frame, reference) - robot.jacobian(q - h * qd, frame, reference)) / (2 * h)
    np.testing.assert_allclose(dJ, slope, atol=2e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_velocity_and_acceleration_of_the_origin(seed: int) -> None:
    robot, frame, rng = robot_of(seed)
    q, qd, qdd = rng.normal(size=(3, robot.n))
    h = 1e-4
    p0, p1, p2 = (robot.fk(q + t * qd + 0.5 * t * t * qdd, frame)[:3, 3] for t in (-h, 0, h))
    np.testing.assert_allclose(velocity(robot, q, qd, frame)[:3], (p2 - p0) / (2 * h), atol=1e-6)
    np.testing.assert_allclose(acceleration(robot, q, qd, qdd, frame)[:3], (p2 - 2 * p1 + p0) / h**2, atol=1e-5)


@pytest.mark.parametrize("seed", SEEDS)
def test_rpy_jacobian_is_the_derivative_of_the_angles(seed: int) -> None:
    robot, frame, rng = robot_of(seed)
    q = rng.normal(size=robot.n)
    J = rpy_jacobian(robot, q, frame)
    h = 1e-6

    def six(x: np.ndarray) -> np.ndarray:
        T = robot.fk(x, frame)
        return np.concatenate([T[:3, 3], euler.from_matrix(T[:3, :3], "xyz", "extrinsic")])

    for i in range(robot.n):
        d = h * np.eye(robot.n)[i]
        np.testing.assert_allclose(J[:, i], (six(q + d) - six(q - d)) / (2 * h), atol=1e-6)
    assert rpy_jacobian(robot, np.tile(q, (2, 3, 1)), frame).shape == (2, 3, 6, robot.n)


@pytest.mark.parametrize("seed", SEEDS)
def test_rate_of_the_rpy_jacobian_is_its_difference(seed: int) -> None:
    robot, frame, rng = robot_of(seed)
    q, qd = rng.normal(size=(2, 4, robot.n))
    J, dJ = rpy_jacobian_derivative(robot, q, qd, frame)
    np.testing.assert_allclose(J, rpy_jacobian(robot, q, frame), atol=1e-12)
    h = 1e-6
    slope = (rpy_jacobian(robot, q + h * qd, frame) - rpy_jacobian(robot, q - h * qd, frame)) / (2 * h)
    np.testing.assert_allclose(dJ, slope, rtol=1e-6, atol=1e-6)
    one, rate = rpy_jacobian_derivative(robot, q[0], qd, frame)
    assert one.shape[-2:] == rate.shape[-2:] == (6, robot.n)


@pytest.mark.parametrize("seed", SEEDS)
def test_jacobian_of_the_centre_of_mass_and_its_rate_are_differences(seed: int) -> None:
    robot, _, rng = robot_of(seed)
    q, qd = rng.normal(size=(2, 2, 3, robot.n))
    J, dJ = com_jacobian_derivative(robot, q, qd)
    np.testing.assert_allclose(com_jacobian(robot, q), J, atol=1e-13)
    h = 1e-6
    for i in range(robot.n):
        d = h * np.eye(robot.n)[i]
        np.testing.assert_allclose(J[..., i], (robot.com(q + d) - robot.com(q - d)) / (2 * h), atol=1e-8)
    slope = (com_jacobian(robot, q + h * qd) - com_jacobian(robot, q - h * qd)) / (2 * h)
    np.testing.assert_allclose(dJ, slope, atol=1e-8)


def test_what_has_no_mass_has_no_centre() -> None:
    with pytest.raises(InputError, match="robot 'planar_2r' has no mass"):
        com_jacobian(Robot.load("planar_2r"), [0.0, 0.0])
    robot, _, _ = robot_of(0)
    with pytest.raises(InputError, match=r"q\[1\] is nan"):
        com_jacobian(robot, [0.0, np.nan, *[0.0] * (robot.n - 2)])


def test_rpy_jacobian_does_not_exist_at_the_lock() -> None:
    robot = Robot(random_tree(0, 1))
    turned = np.eye(4)
    frame = robot.frame_names[0]
    turned[:3, :3] = euler.to_matrix([0.3, np.pi / 2, 0.1], "xyz", "extrinsic")
    with pytest.raises(InputError, match="at a pitch of ±90°, where roll and yaw are not determined"):
        rpy_jacobian(robot.placed(turned), robot.home, frame)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_scripts_ways_give_the_same_numbers(seed: int) -> None:
    robot, frame, rng = robot_of(seed)
    q = rng.normal(size=(4, robot.n))
    poe = ProductOfExponentials.of(robot, frame)
    np.testing.assert_allclose(poe.fk(q), robot.fk(q, frame), atol=1e-13)
    np.testing.assert_allclose(poe.jacobian(q), robot.jacobian(q, frame, "spatial"), atol=1e-13)
    np.testing.assert_allclose(leaf_to_root_jacobian(robot, q, frame), robot.jacobian(q, frame), atol=1e-13)


def test_statics_are_dual_to_velocities_and_back() -> None:
    for seed in SEEDS:
        robot, frame, rng = robot_of(seed, serial=True)
        q, qd, F = rng.normal(size=robot.n), rng.normal(size=robot.n), rng.normal(size=6)
        for reference in ("spatial", "body", "mixed"):
            tau = joint_torques(robot, q, frame, F, reference)
            assert np.isclose(tau @ qd, F @ velocity(robot, q, qd, frame, reference))
            answer = frame_wrench(robot, q, frame, tau, reference)
            assert answer.residual < 1e-9
            again = joint_torques(robot, q, frame, answer.wrench, reference)
            np.testing.assert_allclose(again, tau, atol=1e-9)
            if answer.status is StaticsStatus.SUCCESS:
                np.testing.assert_allclose(answer.wrench, F, atol=1e-7)
        # the wrench seen from the world's origin is the coadjoint of the one seen from the body
        T = robot.fk(q, frame)
        tau = joint_torques(robot, q, frame, F, "body")
        np.testing.assert_allclose(joint_torques(robot, q, frame, se3.coadjoint(T) @ F, "spatial"), tau, atol=1e-12)


def test_torques_that_nothing_balances_are_told() -> None:
    robot, frame, rng = robot_of(2)
    tau = rng.normal(size=(3, robot.n))
    answer = frame_wrench(robot, np.zeros(robot.n), frame, tau)
    assert answer.wrench.shape == (3, 6)
    assert answer.status is StaticsStatus.UNBALANCED
    assert not answer.success
    assert "the robot would move" in answer.explain()
    few = Robot(random_tree(0, 1))
    assert frame_wrench(few, few.home, few.frame_names[-1], np.zeros(few.n)).status is StaticsStatus.UNDETERMINED


@pytest.mark.parametrize("seed", SEEDS)
def test_coriolis_matrix(seed: int) -> None:
    """C q̇ are the velocity torques, and Ṁ − 2 C is antisymmetric."""
    robot, _, rng = robot_of(seed)
    q, qd = rng.normal(size=(2, 5, robot.n))
    C = robot.coriolis(q, qd)
    torques = robot.inverse_dynamics(q, qd) - robot.gravity(q)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", C, qd), torques, atol=1e-10)
    h = 1e-6
    dM = (robot.mass_matrix(q + h * qd) - robot.mass_matrix(q - h * qd)) / (2 * h)
    S = dM - 2 * C
    np.testing.assert_allclose(S, -np.swapaxes(S, 1, 2), atol=1e-6)
    bad = qd.copy()
    bad[3, 1] = np.inf
    with pytest.raises(InputError, match=r"qd\[3, 1\] is inf"):
        robot.coriolis(q, bad)
    with pytest.raises(InputError, match=r"qd\[3, 1\] is inf"):
        robot.jacobian_derivative(q, bad, robot.frame_names[-1])
