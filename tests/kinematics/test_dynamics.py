"""Dynamics against what defines them: kinetic and potential energy, differences of the mass matrix, and themselves."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from apprehend import parallel
from apprehend.arrays import Array
from apprehend.conventions import GRAVITY
from apprehend.errors import InputError
from apprehend.kinematics import Robot
from apprehend.robots.description import Description, Joint, JointType, Link

from .trees import naive_fk, naive_mixed_jacobian, random_pose, random_tree

SEEDS = range(6)


def robot_of(seed: int) -> tuple[Description, Robot, Array]:
    base = random_pose(np.random.default_rng(seed), 3.0)
    description = random_tree(seed, 10, armature=True)
    return description, Robot(description, base=base), base


def naive_mass_matrix(description: Description, robot: Robot, q: Array, base: Array) -> Array:
    """Σ over the links of Jᵀ diag(m, I) J with the Jacobian of the centre of mass, plus the rotors."""
    M = np.zeros((robot.n, robot.n))
    poses = naive_fk(description, q, base)
    for name, link in description.links.items():
        if link.inertial is None:
            continue
        J = naive_mixed_jacobian(description, q, name, base)
        R = poses[name][:3, :3]
        Jv = J[:3] - np.cross(R @ link.inertial.com, J[3:].T).T
        M += link.inertial.mass * Jv.T @ Jv + J[3:].T @ R @ link.inertial.inertia @ R.T @ J[3:]
    for joint in description.joints:
        if joint.type is not JointType.FIXED:
            driver = joint.mimic.joint if joint.mimic else joint.name
            gain = joint.mimic.multiplier if joint.mimic else 1.0
            M[robot.index(driver), robot.index(driver)] += joint.armature * gain**2
    return M


def naive_com(description: Description, q: Array, base: Array) -> Array:
    poses = naive_fk(description, q, base)
    heavy = [(link.inertial, poses[name]) for name, link in description.links.items() if link.inertial]
    total = sum(i.mass for i, _ in heavy)
    return np.asarray(sum(i.mass * (T[:3, :3] @ i.com + T[:3, 3]) for i, T in heavy) / total)


@pytest.mark.parametrize("seed", SEEDS)
def test_mass_matrix_is_the_kinetic_energy(seed: int) -> None:
    description, robot, base = robot_of(seed)
    q = np.random.default_rng(seed).uniform(-2, 2, (18, robot.n))
    M = robot.mass_matrix(q)
    np.testing.assert_array_equal(M, np.swapaxes(M, 1, 2))
    for i in (0, 17):
        np.testing.assert_allclose(M[i], naive_mass_matrix(description, robot, q[i], base), atol=1e-7)
        np.testing.assert_allclose(robot.mass_matrix(q[i]), M[i], atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_centre_of_mass_and_gravity_is_the_slope_of_its_height(seed: int) -> None:
    description, robot, base = robot_of(seed)
    q = np.random.default_rng(seed).uniform(-2, 2, (3, robot.n))
    com, g = robot.com(q), robot.gravity(q)
    h = 1e-6
    for i in range(3):
        np.testing.assert_allclose(com[i], naive_com(description, q[i], base), atol=1e-13)
        slope = [(robot.com(q[i] + h * e)[2] - robot.com(q[i] - h * e)[2]) / (2 * h) for e in np.eye(robot.n)]
        np.testing.assert_allclose(g[i], robot.mass * GRAVITY * np.array(slope), atol=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_inverse_dynamics_are_lagranges_equations(seed: int) -> None:
    _, robot, _ = robot_of(seed)
    rng = np.random.default_rng(seed)
    n = robot.n
    q, qd, qdd = rng.uniform(-2, 2, (3, n))
    h = 1e-5
    dM = np.array([(robot.mass_matrix(q + h * e) - robot.mass_matrix(q - h * e)) / (2 * h) for e in np.eye(n)])
    coriolis = np.einsum("kij,k,j->i", dM, qd, qd) - 0.5 * np.einsum("ijk,j,k->i", dM, qd, qd)
    expected = robot.mass_matrix(q) @ qdd + coriolis + robot.gravity(q)
    np.testing.assert_allclose(robot.inverse_dynamics(q, qd, qdd), expected, atol=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_forward_dynamics_invert_inverse_dynamics(seed: int) -> None:
    _, robot, _ = robot_of(seed)
    q, qd, qdd = np.random.default_rng(seed).uniform(-2, 2, (3, 21, robot.n))
    tau = robot.inverse_dynamics(q, qd, qdd)
    np.testing.assert_allclose(robot.forward_dynamics(q, qd, tau), qdd, atol=1e-8)


def test_inputs_broadcast_and_may_be_absent() -> None:
    _, robot, _ = robot_of(1)
    rng = np.random.default_rng(0)
    q, qd, qdd = rng.normal(size=(4, 1, robot.n)), rng.normal(size=(5, robot.n)), rng.normal(size=robot.n)
    tau = robot.inverse_dynamics(q, qd, qdd)
    assert tau.shape == (4, 5, robot.n)
    np.testing.assert_allclose(tau[2, 3], robot.inverse_dynamics(q[2, 0], qd[3], qdd), atol=1e-12)
    np.testing.assert_array_equal(robot.inverse_dynamics(q, qdd=qdd), robot.inverse_dynamics(q, 0 * q, qdd))
    np.testing.assert_array_equal(robot.gravity(q), robot.inverse_dynamics(q, 0 * q, 0 * q))
    with pytest.raises(InputError, match=r"the shapes of q \(4, 1, \d\), qd \(3, 2, \d\) do not broadcast"):
        robot.inverse_dynamics(q, np.zeros((3, 2, robot.n)))


def test_bad_numbers_are_named_with_their_argument() -> None:
    _, robot, _ = robot_of(1)
    z, bad = np.zeros((40, robot.n)), np.zeros((40, robot.n))
    bad[33, 2] = np.nan
    with pytest.raises(InputError, match=r"qd\[33, 2\] is nan"):
        robot.inverse_dynamics(z, bad, z)
    with pytest.raises(InputError, match=r"qdd\[33, 2\] is nan"):
        robot.inverse_dynamics(z, z, bad)
    with pytest.raises(InputError, match=r"tau\[33, 2\] is nan"):
        robot.forward_dynamics(z, z, bad)
    for call in (robot.mass_matrix, robot.com, robot.gravity):
        with pytest.raises(InputError, match=r"q\[33, 2\] is nan"):
            call(bad)
    with pytest.raises(InputError, match=r"qd has shape \(3,\)"):
        robot.inverse_dynamics(z, np.zeros(3))


def test_a_joint_that_moves_nothing_is_named() -> None:
    joint = Joint("lazy", JointType.REVOLUTE, "root", "tip", np.eye(4))
    description = Description("empty", "root", {"root": Link("root"), "tip": Link("tip")}, (joint,))
    robot = Robot(description)
    with pytest.raises(InputError, match="mass matrix is singular at joint 'lazy'"):
        robot.forward_dynamics([0.0], [0.0], [1.0])
    with pytest.raises(InputError, match="robot 'empty' has no mass"):
        robot.com([0.0])
    armed = Robot(dataclasses.replace(description, joints=(dataclasses.replace(joint, armature=0.5),)))
    np.testing.assert_allclose(armed.forward_dynamics([0.0], [0.0], [1.0]), [2.0])


def test_threads_do_not_change_a_bit() -> None:
    _, robot, _ = robot_of(2)
    q, qd, qdd = np.random.default_rng(0).normal(size=(3, 5000, robot.n))
    before = parallel.threads()
    answers = []
    try:
        for threads in (1, 3):
            parallel.set_threads(threads)
            answers.append((robot.inverse_dynamics(q, qd, qdd), robot.mass_matrix(q), robot.fk(q)))
    finally:
        parallel.set_threads(before)
    for one, many in zip(*answers):
        np.testing.assert_array_equal(one, many)
