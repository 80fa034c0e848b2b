"""`Hand`: fingers on a palm, alone or at the end of an arm; the jaw of hands that have one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from ..arrays import Array, IntArray
from ..errors import ApprehendError, DescriptionError, expect, unknown_name
from ..robots.branches import divide
from ..robots.combine import subtree
from ..robots.description import Description, Joint, JointType
from ..robots.meshes import link_surface
from .jaw import ParallelJaw
from .jaw_search import find_jaw
from .robot import Robot


@dataclass(frozen=True, eq=False)
class Finger:
    """A chain of links from the palm to a fingertip.

    *joints* are the positions of its coordinates in the hand's joint vector; *tip* is the last link with geometry (or
    the last link), and *tip_point* ``(3,)`` the foremost point of its surface in the tip's frame.
    """

    links: tuple[str, ...]
    joints: tuple[int, ...]
    tip: str
    tip_point: Array


class Hand:
    """A hand: its own robot, with the hand's base link as root, its fingers, and its jaw if it has one."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.root = robot.description.root
        self.name = robot.name
        if not robot.n:
            raise DescriptionError(f"{robot.name!r} has no joint that moves: it is not a hand")

    @classmethod
    def load(cls, source: str | Path, **options: Any) -> Self:
        """Read a hand: a name of the catalogue or a file; *options* as in `Robot.load`."""
        return cls(Robot.load(source, **options))

    @classmethod
    def within(cls, robot: Robot, root_link: str | None = None) -> Self:
        """The hand that is part of *robot*: all that link *root_link* carries.

        Without *root_link*: the link that the description names (the root of an attached hand, say); else the first
        link after a serial chain of moving joints at which the tree divides into two or more moving branches. Raises
        `DescriptionError` where there is no such link, or several arms.
        """
        expect(robot, "Robot", "robot")
        description = robot.description
        if root_link is None:
            root_link = description.hand or _end_of_arm(description)
        elif root_link not in description.links:
            unknown_name("link", root_link, description.links, f"robot {robot.name!r}")
        return cls(Robot(subtree(description, root_link)))

    @property
    def n(self) -> int:
        """Number of coordinates of the hand."""
        return self.robot.n

    def indices_in(self, robot: Robot) -> IntArray:
        """Positions of the hand's coordinates in the joint vector of *robot*, which contains the hand."""
        return np.array([robot.index(name) for name in self.robot.joint_names], dtype=np.int64)

    @cached_property
    def palm(self) -> str:
        """The link from which the fingers branch."""
        return divide(self.robot.description)[0]

    @cached_property
    def fingers(self) -> tuple[Finger, ...]:
        """The fingers, in the order of the description; of a jaw, the two links with the pads and what drives them."""
        description = self.robot.description
        branches = divide(description)[1]
        found = [_finger(self.robot, description, joint) for joint in branches]
        if self.is_jaw:
            tips = self.jaw.pad_links
            chosen = [f for tip in tips for f in found if tip in f.links]
            return tuple(chosen)
        return tuple(found)

    @cached_property
    def is_jaw(self) -> bool:
        """Whether the hand is a parallel jaw."""
        try:
            return self.jaw is not None
        except ApprehendError:
            return False

    @cached_property
    def jaw(self) -> ParallelJaw:
        """The parallel jaw, found from the geometry; `DescriptionError` says why there is none."""
        return find_jaw(self.robot)

    def __repr__(self) -> str:
        return f"<Hand {self.name!r}: {self.n} coordinates, palm {self.palm!r}>"


def _end_of_arm(description: Description) -> str:
    link, branches, passed = divide(description)
    if len(branches) < 2:
        raise DescriptionError(
            f"robot {description.name!r} is one serial chain: no hand was found at its end; pass root_link= the base "
            "link of the hand, or attach a hand first"
        )
    if passed < 2:
        parts = ", ".join(repr(j.child) for j in branches[:6])
        raise DescriptionError(
            f"robot {description.name!r} divides at {link!r} already (into {parts}), before any arm; "
            "pass root_link= the base link of the hand"
        )
    return link


def _finger(robot: Robot, description: Description, first: Joint) -> Finger:
    """The finger that starts with joint *first*: along the branch with most moving joints."""
    children: dict[str, list[Joint]] = {name: [] for name in description.links}
    depth: dict[str, int] = dict.fromkeys(description.links, 0)
    for joint in reversed(description.joints):
        children[joint.parent].insert(0, joint)
        depth[joint.parent] = max(depth[joint.parent], depth[joint.child] + (joint.type is not JointType.FIXED))
    links, joint = [first.child], first
    free = {name: i for i, name in enumerate(robot.joint_names)}
    used: list[int] = []
    point = np.empty(0)
    tip = first.child
    while True:
        driver = joint.mimic.joint if joint.mimic else joint.name
        if joint.type is not JointType.FIXED and free[driver] not in used:
            used.append(free[driver])
        surface = _surface(description, joint.child)
        if len(surface) or not len(point):
            tip, point = joint.child, surface
        below = children[joint.child]
        if not below:
            break
        joint = max(below, key=lambda j: depth[j.child] + (j.type is not JointType.FIXED))
        links.append(joint.child)
    return Finger(tuple(links), tuple(used), tip, _foremost(robot, tip, first.child, point))


def _surface(description: Description, link: str) -> Array:
    for visual in (False, True):
        vertices, _ = link_surface(description.links[link], visual=visual)
        if len(vertices):
            return vertices
    return np.empty((0, 3))


def _foremost(robot: Robot, tip: str, base: str, points: Array) -> Array:
    """The point of the tip's surface that lies farthest from the finger's base when the hand is straight."""
    if not len(points):
        return np.zeros(3)
    q = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
    T_tip, T_base = robot.fk(q, tip), robot.fk(q, base)
    world = points @ T_tip[:3, :3].T + T_tip[:3, 3]
    far: Array = points[int(np.argmax(np.linalg.norm(world - T_base[:3, 3], axis=1)))]
    return far.copy()
