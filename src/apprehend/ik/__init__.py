"""Inverse kinematics: solved, or why not (G 1.8)."""

from .branches import BranchResult, BranchStatus, branches, redundancy_intervals, redundant_joint
from .curves import plot_inverses
from .inverse import inverse_jacobian, inverse_singular_values, null_space_projector, transpose_step
from .result import IKResult, IKStatus
from .several import solve_frames
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
    "inverse_jacobian",
    "inverse_singular_values",
    "null_space_projector",
    "plot_inverses",
    "redundancy_intervals",
    "redundant_joint",
    "solve",
    "solve_frames",
    "step",
    "track",
    "transpose_step",
]
