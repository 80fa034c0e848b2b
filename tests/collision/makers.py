"""Small robots and scenes made in code, so that the tests need no files."""

from __future__ import annotations

import numpy as np

from apprehend.kinematics import Robot
from apprehend.robots import Description, Joint, JointLimits, JointType, Link, Shape, ShapeKind


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0, R: np.ndarray | None = None) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    if R is not None:
        T[:3, :3] = R
    return T


def rotation(rng: np.random.Generator) -> np.ndarray:
    q = rng.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def planar(links: int = 3, length: float = 0.4, thickness: float = 0.06) -> Robot:
    """A planar arm in the xy-plane whose links are boxes from joint to joint."""
    shape = Shape(ShapeKind.BOX, (length - thickness, thickness, thickness), pose(0.5 * length))
    names = ["base", *(f"link{i}" for i in range(1, links + 1)), "tip"]
    built = {name: Link(name, collisions=(shape,) if name.startswith("link") else ()) for name in names}
    limits = JointLimits(-3.0, 3.0, 2.0)
    joints = [
        Joint(f"joint{i}", JointType.REVOLUTE, names[i - 1], names[i], pose(0.0 if i == 1 else length), limits=limits)
        for i in range(1, links + 1)
    ]
    joints.append(Joint("tip_joint", JointType.FIXED, names[-2], "tip", pose(length)))
    return Robot(Description("planar", "base", built, tuple(joints)))


def gantry() -> Robot:
    """A sphere of radius 0.1 that three sliding joints move: its distances are known in closed form."""
    names = ["base", "x", "y", "ball"]
    axes = np.eye(3)
    links = {name: Link(name) for name in names[:3]}
    links["ball"] = Link("ball", collisions=(Shape(ShapeKind.SPHERE, (0.1,), np.eye(4)),))
    joints = tuple(
        Joint(
            f"slide_{'xyz'[i]}", JointType.PRISMATIC, names[i], names[i + 1], np.eye(4), axes[i], JointLimits(-2.0, 2.0)
        )
        for i in range(3)
    )
    return Robot(Description("gantry", "base", links, joints))
