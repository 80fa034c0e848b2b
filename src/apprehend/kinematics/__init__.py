"""Robots and hands that compute: forward kinematics, Jacobians, dynamics, manipulability."""

from .dh import DHRow, DHTable, dh_table, dh_transform, inverse_dh_transform
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
from .link_models import LinkModels, link_models
from .manipulability import Manipulability, manipulability
from .pictures import draw
from .polytopes import Polytope, force_polytope, velocity_polytope
from .robot import Limits, Robot

__all__ = [
    "DHRow",
    "DHTable",
    "Finger",
    "Hand",
    "Limits",
    "LinkModels",
    "Manipulability",
    "ParallelJaw",
    "Polytope",
    "ProductOfExponentials",
    "Robot",
    "StaticsResult",
    "StaticsStatus",
    "acceleration",
    "dh_table",
    "dh_transform",
    "draw",
    "force_polytope",
    "frame_wrench",
    "inverse_dh_transform",
    "joint_torques",
    "leaf_to_root_jacobian",
    "link_models",
    "manipulability",
    "rpy_jacobian",
    "velocity",
    "velocity_polytope",
]
