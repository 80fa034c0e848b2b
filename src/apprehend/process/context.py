"""The state of one run of the process: what the steps read and write."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..collision import CollisionModel, Scene
from ..errors import InputError
from ..kinematics import Hand, Robot
from ..sim import Fingers, Gripper, JointController, World
from .step import Observer

if TYPE_CHECKING:
    from ..bodies import Body
    from ..grasp import GraspPlan
    from .choose import Choice

RECORDING_RATE = 60.0


@dataclass
class Context:
    """One run: the scene as described, the world as simulated, and what the steps found out so far.

    *pose* is the located pose T_world_body and *covariance* (6, 6) that of the translation of its centre of mass and
    of its rotation vector, in world axes, None where the pose is exact; *plan* the ranked grasps, for the supporting
    *planes* (k, 4); *choice* the grasp being carried out with its arm postures; *tried* the grasps that failed;
    *held* the pose of the body in the hand, T_hand_body, once lifted.
    """

    scene: Scene
    world: World
    rng: np.random.Generator
    observer: Observer
    hand: Hand
    arm: JointController
    gripper: Gripper | Fingers
    pose: Array | None = None
    covariance: Array | None = None
    plan: GraspPlan | None = None
    choice: Choice | None = None
    held: Array | None = None
    planes: Array = field(default_factory=lambda: np.zeros((0, 4)))
    tried: set[int] = field(default_factory=set)
    slip: float = 0.0
    dropped: bool = False

    @classmethod
    def begin(cls, scene: Scene, rng: np.random.Generator, observer: Observer | None = None) -> Context:
        """A world with the scene in it, the robot at home, and its controllers."""
        if scene.pick is None or scene.pick not in scene.goals:
            raise InputError("the scene has no task; give it one with scene.with_task(body, place) or a [task] table")
        if not scene.bodies[scene.pick].movable:
            raise InputError(
                f"the task is to pick {scene.pick!r}, which the scene says cannot be moved (movable = false)"
            )
        world = World(scene, rng=rng)
        world.record(RECORDING_RATE)
        hand = scene.hand
        arm = JointController(world, scene.robot.chain(hand.root))
        return cls(
            scene,
            world,
            rng,
            observer or Observer(),
            hand,
            arm,
            Gripper(world, hand) if hand.is_jaw else Fingers(world, hand),
        )

    @property
    def name(self) -> str:
        """The name of the body that the task is about."""
        assert self.scene.pick is not None
        return self.scene.pick

    @property
    def body(self) -> Body:
        """The body that the task is about."""
        return self.scene.bodies[self.name].body

    @property
    def goal(self) -> Array:
        """Where the body should go, T_world_body."""
        return self.scene.goals[self.name]

    @property
    def q(self) -> Array:
        """The present joint vector; what a joint stands beyond its limit by, a hair in the simulation, is cut off."""
        return self.robot.limits.clip(self.world.q)

    @property
    def robot(self) -> Robot:
        """The robot of the scene."""
        return self.scene.robot

    @cached_property
    def fingers(self) -> list[int]:
        """Positions of the hand's coordinates in the robot's joint vectors."""
        return [int(i) for i in self.hand.indices_in(self.robot)]

    @cached_property
    def joints(self) -> list[int]:
        """Positions of the arm's coordinates, those that move the hand."""
        return list(self.robot.chain(self.hand.root))

    @property
    def chosen(self) -> Choice:
        """The grasp being carried out; the steps that need it come after the one that sets it."""
        assert self.choice is not None
        return self.choice

    def with_fingers(self, q: Array, joints: Array) -> Array:
        """*q* ``(..., n)`` with the hand at *joints*."""
        out = np.array(q, copy=True)
        out[..., self.fingers] = joints
        return out

    @cached_property
    def collisions(self) -> CollisionModel:
        """Collision checks of the robot with its surroundings, the body included where it was described to be."""
        return CollisionModel(self.robot, self.scene)

    def tell(self, text: str) -> None:
        """Pass a word on progress to the observer."""
        self.observer.progress(text)
