"""Robots and hands that compute: forward kinematics, Jacobians, dynamics, manipulability."""

from .hand import Finger, Hand
from .jaw import ParallelJaw
from .robot import Limits, Robot

__all__ = ["Finger", "Hand", "Limits", "ParallelJaw", "Robot"]
