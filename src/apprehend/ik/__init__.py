"""Inverse kinematics: solved, or why not (G 1.8)."""

from .result import IKResult, IKStatus
from .solve import solve

__all__ = ["IKResult", "IKStatus", "solve"]
