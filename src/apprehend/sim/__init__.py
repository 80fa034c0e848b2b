"""The scene in motion, in the physics engine MuJoCo: world, contacts, controllers, cameras.

>>> world = World(scene)                                        # doctest: +SKIP
>>> arm, gripper = JointController(world, coordinates), Gripper(world, scene.hand)
>>> arm.follow(world, motion)
>>> world.run(motion.duration, arm, gripper)
>>> grip(world, gripper, 20.0, arm).require_success()
"""

from .camera import View, hand_camera, look
from .contacts import ContactTable, Touch
from .control import JointController, Load, Saturation
from .fingers import CloseResult, CloseStatus, Fingers, FingerState, close_fingers
from .grasps import Held, held, held_in, simulated
from .gripper import Gripper, GripResult, GripStatus, JawState, grip
from .model import Plant, build, specification, to_mujoco
from .physics import Physics
from .record import Recording
from .world import Controller, SettleResult, SettleStatus, World

__all__ = [
    "CloseResult", "CloseStatus", "ContactTable", "Controller", "FingerState", "Fingers", "GripResult",
    "GripStatus", "Gripper", "Held", "JawState", "JointController", "Load", "Physics", "Plant", "Recording",
    "Saturation", "SettleResult", "SettleStatus", "Touch", "View", "World", "build", "close_fingers", "grip",
    "hand_camera", "held", "held_in", "look", "simulated", "specification", "to_mujoco",
]  # fmt: skip
