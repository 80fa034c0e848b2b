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
from .dh import DHChain
from .export import save_dh, save_mjcf, save_urdf
from .load import load_description
from .meshes import link_surface, load_shape_mesh, read_mesh, shape_surface
from .mjcf import read_mjcf
from .mjcf_world import FixedThing, FreeBody, World, read_world
from .outline import outline
from .srdf import Semantics, parse_srdf, read_srdf
from .table_files import read_dh, read_table
from .urdf import parse_urdf, read_urdf

__all__ = [
    "Actuator",
    "DHChain",
    "Description",
    "Inertial",
    "FixedThing",
    "FreeBody",
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
    "World",
    "attach",
    "catalogue",
    "link_surface",
    "load_description",
    "load_shape_mesh",
    "outline",
    "parse_srdf",
    "parse_urdf",
    "read_dh",
    "read_mesh",
    "read_mjcf",
    "read_srdf",
    "read_table",
    "read_urdf",
    "read_world",
    "renamed",
    "save_dh",
    "save_mjcf",
    "save_urdf",
    "shape_surface",
    "subtree",
    "without",
]
