"""Robots and hands that compute: forward kinematics, Jacobians, dynamics, manipulability."""

from .dh import DHRow, DHTable, dh_table, dh_transform, inverse_dh_transform
from .differential import (
    StaticsResult,
    StaticsStatus,
    acceleration,
    com_jacobian,
    com_jacobian_derivative,
    frame_wrench,
    joint_torques,
    rpy_jacobian,
    rpy_jacobian_derivative,
    velocity,
)
from .exponentials import ProductOfExponentials, leaf_to_root_jacobian
from .hand import Finger, Hand
from .jaw import ParallelJaw
from .link_models import LinkModels, link_models
from .loops import (
    LoopConstraint,
    LoopResult,
    LoopStatus,
    close_loops,
    loop_jacobian,
    loop_motions,
    loop_residual,
)
from .manipulability import Manipulability, manipulability
from .pictures import draw
from .polytopes import Polytope, force_polytope, velocity_polytope
from .robot import Limits, Robot
from .transmission import Actuation, ActuationStatus, Transmission

__all__ = [
    "Actuation",
    "ActuationStatus",
    "DHRow",
    "DHTable",
    "Finger",
    "Hand",
    "Limits",
    "LinkModels",
    "LoopConstraint",
    "LoopResult",
    "LoopStatus",
    "Manipulability",
    "ParallelJaw",
    "Polytope",
    "ProductOfExponentials",
    "Robot",
    "StaticsResult",
    "StaticsStatus",
    "Transmission",
    "acceleration",
    "close_loops",
    "com_jacobian",
    "com_jacobian_derivative",
    "dh_table",
    "dh_transform",
    "draw",
    "force_polytope",
    "frame_wrench",
    "inverse_dh_transform",
    "joint_torques",
    "leaf_to_root_jacobian",
    "link_models",
    "loop_jacobian",
    "loop_motions",
    "loop_residual",
    "manipulability",
    "rpy_jacobian",
    "rpy_jacobian_derivative",
    "velocity",
    "velocity_polytope",
]
