"""Motors and tendons: equal to MuJoCo's, dual to the joints, and forces that third parties find best, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from apprehend.errors import InputError
from apprehend.kinematics import ActuationStatus, Hand, Robot, Transmission
from apprehend.robots import Actuator, JointLimits, Mimic, Tendon, catalogue, load_description
from tests.kinematics.trees import random_tree


def finger(*motors: Actuator, tendons: tuple[Tendon, ...] = (), effort: float = np.inf) -> Robot:
    """Three parallel hinges, the last of which follows the second."""
    description = random_tree(4, 3, serial=True)
    joints = [
        replace(j, type=j.type.REVOLUTE, mimic=None, limits=JointLimits(-1.0, 1.0, effort=effort))
        for j in description.joints
    ]
    joints[2] = replace(joints[2], mimic=Mimic("joint1", 0.5, 0.1))
    return Robot(replace(description, joints=tuple(joints), actuators=motors, tendons=tendons))


def test_a_tendon_driven_hand_equals_mujoco() -> None:
    mujoco = pytest.importorskip("mujoco")
    if not catalogue.entry("shadow_right").installed:
        pytest.skip("the extra [robots] is not installed")
    path = catalogue.entry("shadow_right").file()
    robot, model = Robot(load_description(path)), mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    motors, tendons = robot.transmission, Transmission.tendons(robot)
    assert motors.k == model.nu > 15
    assert tendons.k == model.ntendon
    rng = np.random.default_rng(0)
    free = [model.joint(name) for name in robot.joint_names if name in {model.jnt(i).name for i in range(model.njnt)}]
    ours = [robot.index(joint.name) for joint in free]
    q = np.zeros(robot.n)
    q[ours] = rng.uniform(-0.5, 0.5, len(ours))
    for joint, i in zip(free, ours, strict=True):
        data.qpos[joint.qposadr[0]] = q[i]
    mujoco.mj_forward(model, data)
    moment = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(
        moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind.ravel()
    )
    dofs = [joint.dofadr[0] for joint in free]
    assert np.abs(motors.matrix[ours].T - moment[:, dofs]).max() < 1e-12
    assert np.abs(motors.lengths(q) - data.actuator_length).max() < 1e-12
    assert np.abs(tendons.lengths(q) - data.ten_length).max() < 1e-12
    assert np.array_equal(
        tendons.within(q), ((data.ten_length >= tendons.shortest) & (data.ten_length <= tendons.longest)).all()
    )
    assert np.isfinite(tendons.longest).any()


def test_power_is_the_same_on_both_sides() -> None:
    robot = finger(
        Actuator("a", {"joint0": 3.0, "joint1": -0.5}), Actuator("b", {"joint1": 2.0, "joint2": 0.4}, -1.0, 2.0)
    )
    motors, rng = robot.transmission, np.random.default_rng(1)
    f, qd = rng.normal(size=(5, 2)), rng.normal(size=(5, robot.n))
    power = (motors.torques(f) * qd).sum(axis=1)
    assert np.allclose(power, (f * motors.rates(qd)).sum(axis=1), atol=1e-14)
    assert motors.matrix[robot.index("joint1"), 1] == pytest.approx(2.0 + 0.5 * 0.4)  # through the follower
    q = rng.normal(size=robot.n)
    h = 1e-6
    slope = [(motors.lengths(q + h * e) - motors.lengths(q - h * e)) / (2 * h) for e in np.eye(robot.n)]
    assert np.allclose(slope, motors.matrix, atol=1e-9)
    assert motors.lengths(np.zeros(robot.n))[1] == pytest.approx(0.4 * 0.1)
    assert "b" in str(motors)


def test_a_description_without_motors_is_driven_directly() -> None:
    robot = finger(effort=2.0)
    motors = robot.transmission
    assert motors.names == robot.joint_names
    assert np.array_equal(motors.torque_range(), [[-2.0, 2.0]] * 2)
    asked = np.array([[1.0, -1.5], [1.0, 2.5]])
    answer = motors.forces(asked)
    assert np.array_equal(answer.feasible, [True, False])
    assert np.allclose(answer.torques, [[1.0, -1.5], [1.0, 2.0]])
    assert answer.status is ActuationStatus.FORCE_LIMIT
    assert "joint 'joint1': 2.5 asked, 2 given, driven by joint1" in answer.explain()
    assert motors.forces(asked[0]).success


@pytest.mark.parametrize("seed", range(6))
def test_smallest_forces_are_those_of_a_cone_solver(seed: int) -> None:
    clarabel = pytest.importorskip("clarabel")
    from scipy import sparse

    rng = np.random.default_rng(seed)
    n, k = 3, 6
    A = rng.normal(size=(n, k))
    lower, upper = -rng.uniform(0.0, 1.0, k), rng.uniform(0.1, 1.0, k)
    lower[0], upper[1] = -np.inf, np.inf
    free = np.full(k, np.inf)
    motors = Transmission(
        tuple("abcdef"), ("x", "y", "z"), A, np.zeros(k), lower, upper, -free, free, np.full(n, np.inf)
    )
    inside = rng.uniform(np.maximum(lower, -2.0), np.minimum(upper, 2.0))
    tau = A @ inside
    answer = motors.forces(tau).require_success()
    assert np.abs(A @ answer.forces - tau).max() < 1e-9
    assert (answer.forces >= lower).all()
    assert (answer.forces <= upper).all()
    rows = np.vstack([A, np.eye(k)[np.isfinite(upper)], -np.eye(k)[np.isfinite(lower)]])
    b = np.concatenate([tau, upper[np.isfinite(upper)], -lower[np.isfinite(lower)]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.ZeroConeT(n), clarabel.NonnegativeConeT(len(b) - n)]
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix(np.eye(k)), np.zeros(k), sparse.csc_matrix(rows), b, cones, settings
    )
    assert np.abs(answer.forces - solver.solve().x).max() < 1e-6
    direction = rng.normal(size=n)
    reach = float(motors.reach(direction))
    assert motors.forces(0.999 * reach * direction).success
    beyond = motors.forces(1.01 * reach * direction)
    assert beyond.status is ActuationStatus.FORCE_LIMIT
    assert 0.0 < beyond.residual < 0.2 * reach * np.abs(direction).max()


def test_tendons_only_pull() -> None:
    pull = (
        Tendon("flexor", {"joint0": -0.01, "joint1": -0.008}, 0.0, 0.3, offset=0.1),
        Tendon("extensor", {"joint0": 0.01}),
    )
    robot = finger(tendons=(*pull, Tendon("tip", {"joint1": 0.006})), effort=5.0)
    tendons = Transmission.tendons(robot, tension=200.0)
    bend = tendons.forces([1.0, 0.8])
    assert bend.success
    assert (bend.forces <= 0.0).all()
    assert np.allclose(bend.torques, [1.0, 0.8])
    straight = tendons.forces([-1.0, -0.5]).require_success()
    assert straight.forces[1] == pytest.approx(-100.0)
    assert tendons.forces([3.0, 0.0]).status is ActuationStatus.FORCE_LIMIT  # 300 N, and an equal pull at the tip
    assert tendons.reach([1.0, 0.0]) == pytest.approx(0.01 * min(200.0, 200.0 * 0.006 / 0.008))
    assert tendons.within([0.0, 0.0])
    assert not tendons.within([15.0, 0.0])


def test_what_no_motor_drives_is_told() -> None:
    robot = finger(Actuator("a", {"joint0": 2.0}, -1.0, 1.0), effort=1.5)
    answer = robot.transmission.forces([[1.0, 0.3], [1.0, 0.0]])
    assert answer.status is ActuationStatus.UNDRIVEN
    assert np.array_equal(answer.feasible, [False, True])
    assert "joint 'joint1': 0.3 asked, 0 given, driven by no motor" in answer.explain()
    assert np.array_equal(robot.transmission.torque_range(), [[-1.5, 1.5], [0.0, 0.0]])
    limited = robot.transmission.forces([1.8, 0.0])
    assert limited.status is ActuationStatus.JOINT_LIMIT
    assert "joint 'joint0': 1.8 asked, 1.5 allowed" in limited.explain()
    assert robot.transmission.reach([1.0, 0.0]) == pytest.approx(1.5)
    assert robot.transmission.reach([0.0, 1.0]) == 0.0


def test_a_frame_presses_as_hard_as_the_weaker_side_lets_it() -> None:
    if not catalogue.entry("panda").installed:
        pytest.skip("the extra [robots] is not installed")
    robot = Robot.load("panda", meshes="ignore")
    J = robot.jacobian(robot.home, "panda_hand")
    wrench = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
    tau = J.T @ wrench
    moving = np.abs(tau) > 1e-12
    weakest = (robot.limits.effort[moving] / np.abs(tau[moving])).min()
    assert robot.transmission.reach(tau) == pytest.approx(weakest, rel=1e-9)


def test_a_hand_of_the_catalogue_has_motors() -> None:
    if not catalogue.entry("shadow_right").installed:
        pytest.skip("the extra [robots] is not installed")
    hand = Hand.load("shadow_right")
    motors = hand.robot.transmission
    assert motors.k == 20 < motors.n
    assert not motors.forces(np.ones(motors.n)).success  # coupled joints cannot be driven one by one
    given = motors.torques(0.5 * np.maximum(motors.lower, -1.0))
    again = motors.forces(given).require_success()
    assert np.allclose(again.torques, given)


def test_mistakes_are_named() -> None:
    robot = finger()
    with pytest.raises(InputError, match="has no tendons"):
        Transmission.tendons(robot)
    with pytest.raises(InputError, match="direction is zero"):
        robot.transmission.reach([0.0, 0.0])
    with pytest.raises(InputError, match=r"torques has shape \(3,\); expected \(\.\.\., 2\)"):
        robot.transmission.forces([1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="tension is -1 N; expected zero or more"):
        Transmission.tendons(finger(tendons=(Tendon("t", {"joint0": 1.0}),)), tension=-1.0)
