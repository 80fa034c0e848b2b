"""Every URDF robot of the wheels, read by us and by Pinocchio: the same poses, Jacobians, torques and masses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from apprehend.kinematics import Robot
from apprehend.robots import Description, JointType, catalogue, load_description

pin = pytest.importorskip("pinocchio")

WHOLE = [
    e.name
    for e in catalogue.entries().values()
    if e.installed and e.path.endswith(".urdf") and not e.root and not e.without and e.name != "schunk_egk40"
]  # schunk_egk40 lacks <inertia>, which Pinocchio refuses


def expansion(description: Description, robot: Robot, model: Any) -> tuple[np.ndarray, np.ndarray]:
    """E and e of v_pin = E q + e: Pinocchio orders joints by name and does not couple mimicking ones."""
    E, e = np.zeros((model.nv, robot.n)), np.zeros(model.nv)
    for joint in description.joints:
        if joint.type is JointType.FIXED:
            continue
        row = model.joints[model.getJointId(joint.name)].idx_v
        if joint.mimic is None:
            E[row, robot.index(joint.name)] = 1.0
        else:
            E[row, robot.index(joint.mimic.joint)] = joint.mimic.multiplier
            e[row] = joint.mimic.offset
    return E, e


@pytest.mark.parametrize("name", WHOLE)
def test_equals_pinocchio(name: str) -> None:
    path = catalogue.entry(name).file()
    description = load_description(path, inertias="keep")
    robot = Robot(description)
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    E, e = expansion(description, robot, model)
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-1.5, 1.5, (3, 4, robot.n))
    poses = robot.fk(q)
    torques, masses = robot.inverse_dynamics(q, v, a), robot.mass_matrix(q)
    frames = [f for f in robot.frame_names if model.existBodyName(f)]
    assert len(frames) == len(robot.frame_names)
    for k in range(len(q)):
        q_pin = pin.integrate(model, pin.neutral(model), E @ q[k] + e)
        pin.forwardKinematics(model, data, q_pin)
        pin.updateFramePlacements(model, data)
        pin.computeJointJacobians(model, data, q_pin)
        for frame in frames:
            i = model.getFrameId(frame, pin.FrameType.BODY)
            T = data.oMf[i].homogeneous
            assert np.abs(poses[k, robot.frame_index(frame)] - T).max() < 1e-12
        for frame in (*frames[:: max(1, len(frames) // 8)], frames[-1]):
            i = model.getFrameId(frame, pin.FrameType.BODY)
            J = pin.getFrameJacobian(model, data, i, pin.LOCAL_WORLD_ALIGNED) @ E
            assert np.abs(robot.jacobian(q[k], frame) - J).max() < 1e-12
        tau = E.T @ pin.rnea(model, data, q_pin, E @ v[k], E @ a[k])
        assert np.abs(torques[k] - tau).max() < 1e-10 * max(1.0, np.abs(tau).max())
        M = pin.crba(model, data, q_pin)
        M = np.triu(M) + np.triu(M, 1).T
        assert np.abs(masses[k] - E.T @ M @ E).max() < 1e-10 * max(1.0, np.abs(M).max())


def test_thirty_robots_are_compared() -> None:
    if not catalogue.entry("panda").installed:
        pytest.skip("the extra [robots] is not installed")
    assert len(WHOLE) >= 30
