"""apprehend: from a robot description and an object to a grasp that holds, and the motion that gets there.

Names load on first use, so that importing the package is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_PUBLIC: dict[str, str] = {
    # name: module that defines it
    "Body": "apprehend.bodies",
    "Contact": "apprehend.grasp",
    "Grasp": "apprehend.grasp",
    "Hand": "apprehend.kinematics",
    "Pose": "apprehend.spatial",
    "ReachabilityMap": "apprehend.workspace",
    "Robot": "apprehend.kinematics",
    "Rotation": "apprehend.spatial",
    "Scene": "apprehend.collision",
    "Screw": "apprehend.spatial",
    "Twist": "apprehend.spatial",
    "Wrench": "apprehend.spatial",
    "pick_and_place": "apprehend.process",
}
_ROOMS = (
    "bodies", "collision", "conventions", "errors", "grasp", "ik", "kinematics", "parallel", "perception", "planning",
    "process", "robots", "sim", "spatial", "trajectory", "viewer", "workspace",
)  # fmt: skip

__all__ = sorted((*_PUBLIC, *_ROOMS))


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        value = getattr(importlib.import_module(_PUBLIC[name]), name)
    elif name in _ROOMS:
        value = importlib.import_module(f"apprehend.{name}")
    else:
        raise AttributeError(f"module 'apprehend' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


if TYPE_CHECKING:
    from . import (
        bodies,
        collision,
        conventions,
        errors,
        grasp,
        ik,
        kinematics,
        parallel,
        perception,
        planning,
        process,
        robots,
        sim,
        spatial,
        trajectory,
        viewer,
        workspace,
    )
    from .bodies import Body
    from .collision import Scene
    from .grasp import Contact, Grasp
    from .kinematics import Hand, Robot
    from .process import pick_and_place
    from .spatial import Pose, Rotation, Screw, Twist, Wrench
    from .workspace import ReachabilityMap
