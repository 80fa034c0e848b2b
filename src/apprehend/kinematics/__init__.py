"""Robots and hands that compute: forward kinematics, Jacobians, dynamics, manipulability."""

from .differential import (
    StaticsResult,
    StaticsStatus,
    acceleration,
    frame_wrench,
    joint_torques,
    rpy_jacobian,
    velocity,
)
from .exponentials import ProductOfExponentials, leaf_to_root_jacobian
from .hand import Finger, Hand
from .jaw import ParallelJaw
from .robot import Limits, Robot

__all__ = [
    "Finger",
    "Hand",
    "Limits",
    "ParallelJaw",
    "ProductOfExponentials",
    "Robot",
    "StaticsResult",
    "StaticsStatus",
    "acceleration",
    "frame_wrench",
    "joint_torques",
    "leaf_to_root_jacobian",
    "rpy_jacobian",
    "velocity",
]
