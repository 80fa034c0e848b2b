"""Poses, Jacobians and dynamics equal those of Pinocchio on the robots that wheels ship, and MuJoCo's on MJCF."""

from __future__ import annotations

import importlib.metadata
import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apprehend.arrays import Array
from apprehend.errors import ApprehendError
from apprehend.kinematics import Robot
from apprehend.robots import JointType


def urdf_files() -> list[Path]:
    """The URDF files of the wheels example-robot-data and airo-models."""
    found: list[Path] = []
    try:
        files = importlib.metadata.files("example-robot-data") or []
        found += [Path(str(f.locate())) for f in files if f.suffix == ".urdf"]
    except importlib.metadata.PackageNotFoundError:
        pass
    spec = importlib.util.find_spec("airo_models")
    if spec and spec.origin:
        found += sorted((Path(spec.origin).parent / "arms").glob("*/*.urdf"))
    return sorted(path.resolve() for path in found)


class Peer:
    """Pinocchio's model of a file, and how our coordinates become its own."""

    def __init__(self, pin: Any, path: Path, robot: Robot) -> None:
        self.pin, self.model = pin, pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.robot = robot
        moving = [j for j in robot.description.joints if j.type is not JointType.FIXED]
        self.joints = [self.model.joints[self.model.getJointId(j.name)] for j in moving]
        self.gain = np.zeros((self.model.nv, robot.n))
        self.offset = np.zeros(self.model.nv)
        for ours, theirs in zip(moving, self.joints, strict=True):
            driver = ours.mimic.joint if ours.mimic else ours.name
            self.gain[theirs.idx_v, robot.index(driver)] = ours.mimic.multiplier if ours.mimic else 1.0
            self.offset[theirs.idx_v] = ours.mimic.offset if ours.mimic else 0.0

    def q(self, q: Array) -> Array:
        values = self.gain @ q + self.offset
        full = self.pin.neutral(self.model)
        for joint in self.joints:
            v = values[joint.idx_v]
            if joint.nq == 1:
                full[joint.idx_q] = v
            else:
                full[joint.idx_q : joint.idx_q + 2] = np.cos(v), np.sin(v)
        return np.asarray(full)


def differences(peer: Peer, q: Array, qd: Array, qdd: Array) -> dict[str, float]:
    """Largest differences at one configuration; those of the dynamics relative to the size of the numbers."""
    pin, model, data, robot, G = peer.pin, peer.model, peer.data, peer.robot, peer.gain
    pq = peer.q(q)
    pin.computeJointJacobians(model, data, pq)
    pin.framesForwardKinematics(model, data, pq)
    worst = {"fk": 0.0, "jacobian": 0.0}
    poses = robot.fk(q[None])[0]
    for i, frame in enumerate(robot.frame_names):
        number = model.getFrameId(frame, pin.BODY)
        worst["fk"] = max(worst["fk"], float(np.abs(poses[i] - data.oMf[number].homogeneous).max()))
        if i % 4 == 0 and model.frames[number].parentJoint:
            for ours, theirs in (("mixed", pin.LOCAL_WORLD_ALIGNED), ("spatial", pin.WORLD), ("body", pin.LOCAL)):
                J = pin.getFrameJacobian(model, data, number, theirs) @ G
                ours_J = robot.jacobian(q, frame, ours)
                worst["jacobian"] = max(worst["jacobian"], float(np.abs(ours_J - J).max(initial=0.0)))

    def compare(name: str, ours: Array, theirs: Array) -> None:
        size = max(1.0, float(np.abs(theirs).max(initial=0.0)))
        worst[name] = float(np.abs(ours - theirs).max(initial=0.0)) / size

    v, a = G @ qd, G @ qdd
    compare("inverse dynamics", robot.inverse_dynamics(q, qd, qdd), G.T @ pin.rnea(model, data, pq, v, a))
    compare("gravity", robot.gravity(q), G.T @ pin.computeGeneralizedGravity(model, data, pq))
    upper = np.triu(pin.crba(model, data, pq))
    compare("mass matrix", robot.mass_matrix(q), G.T @ (upper + np.triu(upper, 1).T) @ G)
    return worst


def test_robots_that_wheels_ship_equal_pinocchio() -> None:
    pin = pytest.importorskip("pinocchio")
    files = urdf_files()
    if len(files) < 30:
        pytest.skip("the wheel example-robot-data is not installed")
    equal, different = [], {}
    rng = np.random.default_rng(0)
    for path in files:
        try:
            robot = Robot.load(path)
            peer = Peer(pin, path, robot)
        except (ApprehendError, ValueError, RuntimeError):  # refused by one of the two: not comparable
            continue
        if any("inertia" in repair.problem or "mass" in repair.problem for repair in robot.description.repairs):
            continue  # the peer computes with the impossible inertia
        q, qd, qdd = rng.uniform(-2, 2, (3, robot.n))
        worst = differences(peer, q, qd, qdd)
        limits = {"fk": 1e-12, "jacobian": 1e-12}
        if all(error <= limits.get(name, 1e-10) for name, error in worst.items()):
            equal.append(path.name)
        else:
            different[path.name] = worst
    assert not different
    assert len(equal) >= 30
