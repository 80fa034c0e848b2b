"""Descriptions of robots and hands: readers, the catalogue, and what can be made of descriptions.

What computes with a description is `apprehend.kinematics.Robot`.
"""

from __future__ import annotations

from . import catalogue
from .combine import attach, renamed, subtree, without
from .description import (
    Actuator,
    Description,
    Inertial,
    Joint,
    JointLimits,
    JointType,
    Link,
    Loop,
    Mimic,
    Repair,
    Shape,
    ShapeKind,
    Tendon,
)
from .load import load_description
from .meshes import link_surface, load_shape_mesh, read_mesh, shape_surface
from .mjcf import read_mjcf
from .srdf import Semantics, read_srdf
from .urdf import parse_urdf, read_urdf

__all__ = [
    "Actuator",
    "Description",
    "Inertial",
    "Joint",
    "JointLimits",
    "JointType",
    "Link",
    "Loop",
    "Mimic",
    "Repair",
    "Semantics",
    "Shape",
    "ShapeKind",
    "Tendon",
    "attach",
    "catalogue",
    "link_surface",
    "load_description",
    "load_shape_mesh",
    "parse_urdf",
    "read_mesh",
    "read_mjcf",
    "read_srdf",
    "read_urdf",
    "renamed",
    "shape_surface",
    "subtree",
    "without",
]
