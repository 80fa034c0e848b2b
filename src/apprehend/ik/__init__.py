"""Inverse kinematics: solved, or why not (G 1.8)."""

from .branches import BranchResult, BranchStatus, branches, redundancy_intervals, redundant_joint
from .result import IKResult, IKStatus
from .solve import solve
from .step import Stepper, TrackResult, TrackStatus, step, track
from .tasks import (
    ComTask,
    DescentTask,
    DirectionTask,
    JointTask,
    LookAtTask,
    OrientationTask,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativeTask,
    Task,
)

__all__ = [
    "BranchResult",
    "BranchStatus",
    "ComTask",
    "DescentTask",
    "DirectionTask",
    "IKResult",
    "IKStatus",
    "JointTask",
    "LookAtTask",
    "OrientationTask",
    "PoseTask",
    "PositionTask",
    "PostureTask",
    "RelativeTask",
    "Stepper",
    "Task",
    "TrackResult",
    "TrackStatus",
    "branches",
    "redundancy_intervals",
    "redundant_joint",
    "solve",
    "step",
    "track",
]
