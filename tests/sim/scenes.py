"""Scenes that the tests of the simulation share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pytest

from apprehend.arrays import Array
from apprehend.bodies import Body
from apprehend.collision import Scene
from apprehend.collision.scene import Box, Placed, RobotSource
from apprehend.errors import ApprehendError
from apprehend.kinematics import Hand, Robot
from apprehend.robots.description import Description, Inertial, Joint, JointLimits, JointType, Link
from apprehend.sim import Gripper, GripResult, JointController, Load, Physics, World, grip


def translation(x: float, y: float, z: float) -> Array:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def table(top: float = 0.0) -> Box:
    return Box("table", np.array([2.0, 2.0, 0.1]), translation(0.0, 0.0, top - 0.05))


def description(name: str, links: list[Link], joints: list[Joint]) -> Description:
    return Description(name, links[0].name, {link.name: link for link in links}, tuple(joints))


def pendulum(effort: float = 50.0, mass: float = 2.0, length: float = 0.5, damping: float = 0.0) -> Robot:
    """One link that turns about y, its mass on the x axis at *length*."""
    inertial = Inertial(mass, np.array([length, 0.0, 0.0]), np.eye(3) * 1e-3)
    joint = Joint(
        "swing", JointType.REVOLUTE, "base", "arm", np.eye(4), np.array([0.0, 1.0, 0.0]),
        JointLimits(-3.0, 3.0, 10.0, 50.0, effort), damping=damping,
    )  # fmt: skip
    return Robot(description("pendulum", [Link("base"), Link("arm", inertial)], [joint]))


def scene(
    robot: Robot, *, boxes: tuple[Box, ...] = (), hand_root: str | None = None, **bodies: tuple[Body, Array]
) -> Scene:
    placed = {name: Placed(body, pose) for name, (body, pose) in bodies.items()}
    return Scene(robot, RobotSource(robot.name), placed, boxes, hand_root=hand_root)


@dataclass(frozen=True, eq=False)
class Rig:
    """An arm at home with its hand wide open."""

    robot: Robot
    hand: Hand
    hand_root: str | None
    q: Array

    def tcp(self, width: float) -> Array:
        """Pose of the tcp when the pads are *width* apart."""
        return self.robot.fk(self.q, self.hand.root) @ self.hand.jaw.tcp_at(width)


@lru_cache
def rig(name: str) -> Rig:
    try:
        robot, root = RobotSource(name, "robotiq_2f_85" if name == "ur5e" else None).build()
    except ApprehendError as error:
        pytest.skip(f"robot {name} is not installed: {error}")
    hand = Hand.within(robot, root)
    q = robot.home.copy()
    q[hand.indices_in(robot)] = hand.jaw.q_at(hand.jaw.max_width)
    return Rig(robot, hand, root, q)


@dataclass(frozen=True, eq=False)
class Held:
    """A world in which a gripper has closed on the body "object", before gravity acts."""

    world: World
    arm: JointController
    gripper: Gripper
    rig: Rig
    result: GripResult

    def in_hand(self) -> Array:
        """Pose of the object in the hand's frame."""
        return np.linalg.solve(self.world.frame(self.rig.hand.root), self.world.body_pose("object"))

    def turn_gravity_on(self, seconds: float = 0.2) -> None:
        steps = round(seconds / self.world.timestep)
        for k in range(steps):
            self.world.model.opt.gravity[2] = -9.81 * (k + 1) / steps
            self.world.step(self.arm, self.gripper)


def hold(name: str, body: Body, force: float, *, offset: Array | None = None, physics: Physics | None = None) -> Held:
    """Close *name*'s hand with *force* around *body*, which is at the tcp of its width, moved by *offset* (4, 4)."""
    at = rig(name)
    shift = np.eye(4) if offset is None else offset
    width = float(np.ptp(body.vertices @ shift[0, :3]))
    pose = at.tcp(width) @ shift
    world = World(scene(at.robot, hand_root=at.hand_root, object=(body, pose)), physics=physics)
    world.model.opt.gravity[2] = 0.0
    world.set_q(at.q)
    mine = set(at.hand.indices_in(at.robot).tolist())
    arm = JointController(world, [i for i in range(at.robot.n) if i not in mine])
    gripper = Gripper(world, at.hand)
    result = grip(world, gripper, force, arm)
    held = Held(world, arm, gripper, at, result)
    arm.load = Load(at.hand.root, body.mass, held.in_hand()[:3, :3] @ body.com + held.in_hand()[:3, 3])
    return held


def slip(before: Array, after: Array) -> tuple[float, float]:
    """Distance in m and angle in rad between two poses."""
    relative = np.linalg.solve(before, after)
    cosine = 0.5 * (np.trace(relative[:3, :3]) - 1.0)
    return float(np.linalg.norm(relative[:3, 3])), float(np.arccos(np.clip(cosine, -1.0, 1.0)))
