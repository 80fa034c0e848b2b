"""Robots made up for tests: random chains with every kind of joint, and a small two-armed tree."""

from __future__ import annotations

import numpy as np

from apprehend.kinematics import Robot
from apprehend.robots.description import Description, Joint, JointLimits, JointType, Link, Mimic

TYPES = {"R": JointType.REVOLUTE, "C": JointType.CONTINUOUS, "P": JointType.PRISMATIC, "F": JointType.FIXED}


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q if np.linalg.det(Q) > 0 else -Q


def random_pose(rng: np.random.Generator, length: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = random_rotation(rng)
    T[:3, 3] = rng.normal(size=3) * length
    return T


def chain(
    kinds: str, seed: int = 0, length: float = 0.3, mimic: dict[int, tuple[int, float, float]] | None = None
) -> Robot:
    """A serial robot with a joint for every letter (R, C, P, F) at random placements; its last link is ``tip``."""
    rng = np.random.default_rng(seed)
    links = ["base", *(f"link{i}" for i in range(len(kinds))), "tip"]
    joints = []
    for i, kind in enumerate(kinds):
        lower = rng.uniform(-3.0, -1.0)
        limits = {
            "R": JointLimits(lower, rng.uniform(1.0, 3.0)),
            "P": JointLimits(-0.2, 0.4),
            "C": JointLimits(),
            "F": JointLimits(),
        }[kind]
        axis = rng.normal(size=3)
        follow = None
        if mimic and i in mimic:
            driver, multiplier, offset = mimic[i]
            follow = Mimic(f"j{driver}", multiplier, offset)
        joints.append(
            Joint(
                f"j{i}",
                TYPES[kind],
                links[i],
                links[i + 1],
                random_pose(rng, length / 1.7),
                axis / np.linalg.norm(axis),
                limits,
                follow,
            )
        )
    joints.append(Joint("to_tip", JointType.FIXED, links[-2], "tip", random_pose(rng, length / 3)))
    return Robot(Description("made", "base", {name: Link(name) for name in links}, tuple(joints)))


def two_arms(seed: int = 0) -> Robot:
    """A turning torso with two arms of six joints, ``left_tip`` and ``right_tip``."""
    rng = np.random.default_rng(seed)
    joints = [Joint("torso", JointType.REVOLUTE, "base", "torso", np.eye(4), limits=JointLimits(-1.0, 1.0))]
    names = ["base", "torso"]
    for side, y in (("left", 0.3), ("right", -0.3)):
        parent = "torso"
        for i in range(6):
            T = random_pose(rng, 0.15)
            if i == 0:
                T[:3, 3] = (0.0, y, 0.4)
            link = f"{side}_tip" if i == 5 else f"{side}_{i}"
            joints.append(Joint(f"{side}_j{i}", JointType.REVOLUTE, parent, link, T, limits=JointLimits(-2.8, 2.8)))
            names.append(link)
            parent = link
    return Robot(Description("two arms", "base", {name: Link(name) for name in names}, tuple(joints)))


def configurations(robot: Robot, count: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    lower, upper = robot.limits.lower, robot.limits.upper
    return rng.uniform(
        np.where(np.isfinite(lower), lower, -np.pi), np.where(np.isfinite(upper), upper, np.pi), (count, robot.n)
    )


def from_axes(
    H: np.ndarray, P: np.ndarray, R0: np.ndarray | None = None, kinds: str | None = None, limit: float = np.pi
) -> Robot:
    """The robot p = P0 + R1 (P1 + R2 (P2 + …)) with axes ``H (m, 3)``, offsets ``P (m + 1, 3)``, turning by ±limit."""
    m = len(H)
    kinds = kinds or "R" * m
    links = ["base", *(f"link{i}" for i in range(m)), "tip"]
    joints = []
    for i in range(m):
        T = np.eye(4)
        T[:3, 3] = P[i]
        limits = JointLimits(-limit, limit)
        joints.append(Joint(f"j{i}", TYPES[kinds[i]], links[i], links[i + 1], T, np.asarray(H[i], float), limits))
    T = np.eye(4)
    T[:3, 3] = P[m]
    T[:3, :3] = np.eye(3) if R0 is None else R0
    joints.append(Joint("to_tip", JointType.FIXED, links[m], "tip", T))
    return Robot(Description("axes", "base", {name: Link(name) for name in links}, tuple(joints)))


def from_dh(links: list[dict[str, float]]) -> Robot:
    """A robot from rows of standard Denavit–Hartenberg parameters: A = Rz(θ + offset) Tz(d) Tx(a) Rx(α)."""
    names = ["base", *(f"link{i}" for i in range(len(links)))]
    joints = []
    T = np.eye(4)
    for i, row in enumerate(links):
        c, s = np.cos(row["offset"]), np.sin(row["offset"])
        joints.append(
            Joint(
                f"j{i}",
                JointType.REVOLUTE,
                names[i],
                names[i + 1],
                T @ np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]),
                limits=JointLimits(-np.pi, np.pi),
            )
        )
        c, s = np.cos(row["alpha"]), np.sin(row["alpha"])
        T = np.array([[1, 0, 0, row["a"]], [0, c, -s, 0], [0, s, c, row["d"]], [0, 0, 0, 1.0]])
    joints.append(Joint("to_tip", JointType.FIXED, names[-1], "tip", T))
    names.append("tip")
    return Robot(Description("dh", "base", {name: Link(name) for name in names}, tuple(joints)))
