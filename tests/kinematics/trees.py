"""Random robots as descriptions, and a plain reference for their kinematics, written the obvious way."""

from __future__ import annotations

import numpy as np

from apprehend.arrays import Array
from apprehend.robots.description import Description, Inertial, Joint, JointLimits, JointType, Link, Mimic


def random_rotation(rng: np.random.Generator) -> Array:
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(R))
    if np.linalg.det(Q) < 0:
        Q[:, 0] *= -1
    return np.asarray(Q)


def random_pose(rng: np.random.Generator, scale: float = 0.5) -> Array:
    T = np.eye(4)
    T[:3, :3] = random_rotation(rng)
    T[:3, 3] = rng.uniform(-scale, scale, 3)
    return T


def random_inertial(rng: np.random.Generator) -> Inertial:
    moments = rng.uniform(0.01, 0.1, 3)
    R = random_rotation(rng)
    # the inertia of a cloud of points with second moments `moments` obeys the triangle inequalities
    second = R @ np.diag(moments) @ R.T
    return Inertial(float(rng.uniform(0.1, 3.0)), rng.uniform(-0.1, 0.1, 3), np.trace(second) * np.eye(3) - second)


def random_tree(seed: int, joints: int = 12, *, serial: bool = False, armature: bool = False) -> Description:
    """A tree with every joint type, and mimicking joints, in random places."""
    rng = np.random.default_rng(seed)
    links = {"root": Link("root", random_inertial(rng))}
    made: list[Joint] = []
    for i in range(joints):
        names = list(links)
        parent = names[-1] if serial else names[int(rng.integers(len(names)))]
        child = f"link{i}"
        kind = JointType(rng.choice(["revolute", "revolute", "continuous", "prismatic", "fixed"]))
        axis = rng.normal(size=3)
        if rng.random() < 0.4:
            axis = np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
        free = [j.name for j in made if j.type is not JointType.FIXED and j.mimic is None]
        mimic = None
        if free and kind is not JointType.FIXED and rng.random() < 0.2:
            mimic = Mimic(str(rng.choice(free)), float(rng.uniform(-2, 2)), float(rng.uniform(-1, 1)))
        bounded = JointLimits(*np.sort(rng.uniform(-2.5, 2.5, 2)), 2.0, 5.0, 30.0)
        limits = JointLimits() if kind is JointType.CONTINUOUS else bounded
        rotor = float(rng.uniform(0, 0.1)) if armature else 0.0
        links[child] = Link(child, random_inertial(rng) if rng.random() < 0.8 else None)
        pose = random_pose(rng)
        made.append(
            Joint(f"joint{i}", kind, parent, child, pose, axis / np.linalg.norm(axis), limits, mimic, armature=rotor)
        )
    return Description(f"random{seed}", "root", links, tuple(made))


def rotation_about(axis: Array, angle: float) -> Array:
    """Rodrigues."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)


def joint_value(description: Description, joint: Joint, q: Array) -> float:
    names = [j.name for j in description.free_joints]
    if joint.mimic is not None:
        return float(joint.mimic.multiplier * q[names.index(joint.mimic.joint)] + joint.mimic.offset)
    return float(q[names.index(joint.name)])


def naive_fk(description: Description, q: Array, base: Array | None = None) -> dict[str, Array]:
    """Poses of all links, joint by joint."""
    poses = {description.root: np.eye(4) if base is None else base}
    for joint in description.joints:
        motion = np.eye(4)
        if joint.type is JointType.PRISMATIC:
            motion[:3, 3] = joint.axis * joint_value(description, joint, q)
        elif joint.type is not JointType.FIXED:
            motion[:3, :3] = rotation_about(joint.axis, joint_value(description, joint, q))
        poses[joint.child] = poses[joint.parent] @ joint.pose @ motion
    return poses


def naive_mixed_jacobian(description: Description, q: Array, frame: str, base: Array | None = None) -> Array:
    """Mixed Jacobian by central differences of `naive_fk`."""
    h = 1e-6
    n = len(description.free_joints)
    J = np.zeros((6, n))
    R = naive_fk(description, q, base)[frame][:3, :3]
    for i in range(n):
        d = np.eye(n)[i] * h
        plus, minus = (naive_fk(description, q + s * d, base)[frame] for s in (1, -1))
        J[:3, i] = (plus[:3, 3] - minus[:3, 3]) / (2 * h)
        W = (plus[:3, :3] - minus[:3, :3]) / (2 * h) @ R.T
        J[3:, i] = [W[2, 1], W[0, 2], W[1, 0]]
    return J
