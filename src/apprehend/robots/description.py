"""What a robot description file says, as values: links, joints, shapes, inertias. No computation here.

Every reader (URDF, MJCF, DH table, twists) produces a `Description`; `kinematics.Robot` computes with it, the
simulator and the viewer build from it. Descriptions are values: attaching or cutting makes a new one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

import numpy as np

from ..arrays import Array

INFINITE = float("inf")


class JointType(Enum):
    """The joint types of the tree. A planar or floating joint is read as a chain of these, and reported."""

    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"
    FIXED = "fixed"


class ShapeKind(Enum):
    """Kinds of geometry; `Shape.size` holds their dimensions in metres."""

    BOX = "box"  # full extents x, y, z
    SPHERE = "sphere"  # radius
    CYLINDER = "cylinder"  # radius, length along z
    CAPSULE = "capsule"  # radius, length of the cylindrical part along z
    MESH = "mesh"  # scale x, y, z; the file in `Shape.mesh`


@dataclass(frozen=True, eq=False)
class Shape:
    """One piece of geometry, placed in the frame of its link."""

    kind: ShapeKind
    size: tuple[float, ...]
    pose: Array  # (4, 4), T_link_shape
    mesh: Path | None = None
    rgba: tuple[float, float, float, float] | None = None
    name: str = ""


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass in kg, centre of mass in the link frame, and inertia about that centre in axes of the link, in kg m²."""

    mass: float
    com: Array  # (3,)
    inertia: Array  # (3, 3)


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid body; its name is also the name of its frame."""

    name: str
    inertial: Inertial | None = None
    visuals: tuple[Shape, ...] = ()
    collisions: tuple[Shape, ...] = ()


@dataclass(frozen=True)
class JointLimits:
    """Limits of one joint in rad or m, per second, per second², and N m or N; infinite where none is given."""

    lower: float = -INFINITE
    upper: float = INFINITE
    velocity: float = INFINITE
    acceleration: float = INFINITE
    effort: float = INFINITE


@dataclass(frozen=True)
class Mimic:
    """``q = multiplier * q[joint] + offset`` (a chain of mimics is resolved by the reader)."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Joint:
    """Connects *parent* to *child*; *pose* is T_parent_joint at q = 0, *axis* a unit vector in the joint frame."""

    name: str
    type: JointType
    parent: str
    child: str
    pose: Array  # (4, 4)
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))  # (3,)
    limits: JointLimits = JointLimits()
    mimic: Mimic | None = None
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0


@dataclass(frozen=True)
class Tendon:
    """A length that is linear in the joints: ``offset + Σ arms[joint] * q[joint]``, kept between *lower* and *upper*.

    The *arms* are in m per rad (or per m) and may name mimicking joints. A coupling of joints is a tendon, too.
    """

    name: str
    arms: Mapping[str, float]
    lower: float = -INFINITE
    upper: float = INFINITE
    offset: float = 0.0


@dataclass(frozen=True)
class Actuator:
    """A motor whose force or torque f, between *lower* and *upper*, acts on joints: ``τ[joint] = arms[joint] * f``.

    A gear ratio or a lever arm is one arm; a motor that pulls a tendon has the tendon's arms.
    """

    name: str
    arms: Mapping[str, float]
    lower: float = -INFINITE
    upper: float = INFINITE


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed chain that was cut: *first* and *second* are links whose frames T_first, T_second must meet again.

    *free* says what they may do to each other: ``"point"`` (positions coincide, orientations are free), ``"pose"``
    (nothing), or ``"revolute"``, ``"continuous"``, ``"prismatic"`` along *axis* of the first frame.
    """

    name: str
    first: str
    second: str
    T_first: Array  # (4, 4), in the frame of the link *first*
    T_second: Array  # (4, 4), in the frame of the link *second*
    free: str = "pose"
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class Repair:
    """Something in the file that had to be corrected to be usable: what, where, and what was done."""

    where: str
    problem: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.where}: {self.problem}; {self.remedy}"


@dataclass(frozen=True, eq=False)
class Description:
    """A kinematic tree. *joints* are ordered root to leaf: a joint's parent link is the root or an earlier child."""

    name: str
    root: str
    links: Mapping[str, Link]
    joints: tuple[Joint, ...]
    home: Mapping[str, float] = field(default_factory=dict)  # joint name → resting value; others: see `rest`
    allowed_collisions: frozenset[frozenset[str]] = frozenset()  # pairs of links that may touch
    repairs: tuple[Repair, ...] = ()
    source: Path | None = None
    tendons: tuple[Tendon, ...] = ()
    actuators: tuple[Actuator, ...] = ()
    loops: tuple[Loop, ...] = ()  # closed chains that were cut on request; nothing here closes them
    hand: str = ""  # link at which the hand begins; "" if there is none, or it is not known
    tool: str = ""  # frame that carries a tool, or at which grasps and targets are meant; "" if not known

    def joint(self, name: str) -> Joint:
        """The joint of that name."""
        from ..errors import unknown_name

        for joint in self.joints:
            if joint.name == name:
                return joint
        unknown_name("joint", name, (j.name for j in self.joints), f"robot {self.name!r}")

    def rest(self, joint: Joint) -> float:
        """The joint's value in the home posture: as given, 0 if it turns without limits, else the middle of its range.

        With a limit on one side only, what is nearest to 0.
        """
        if joint.name in self.home:
            return float(self.home[joint.name])
        lower, upper = joint.limits.lower, joint.limits.upper
        if joint.type is JointType.CONTINUOUS:
            return 0.0
        if np.isfinite(lower) and np.isfinite(upper):
            return 0.5 * (lower + upper)
        return min(max(0.0, lower), upper)

    @property
    def parent_joint(self) -> Mapping[str, Joint]:
        """For every link but the root, the joint that carries it."""
        return {joint.child: joint for joint in self.joints}

    @property
    def free_joints(self) -> tuple[Joint, ...]:
        """The joints that have a coordinate of their own: neither fixed nor mimicking, in tree order."""
        return tuple(j for j in self.joints if j.type is not JointType.FIXED and j.mimic is None)
