"""Robots and hands that compute: forward kinematics, Jacobians, dynamics, manipulability."""

from .robot import Limits, Robot

__all__ = ["Limits", "Robot"]
