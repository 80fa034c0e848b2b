"""Scenes, and collision of robots with themselves and with what stands around them."""

from .model import Closest, CollisionModel, Touch
from .obstacles import Cloud, Grid, HalfSpace, Union
from .pairs import Separation, signed_distance
from .scene import Box, Placed, RobotSource, Scene
from .shapes import Convex

__all__ = [
    "Box",
    "Closest",
    "Cloud",
    "CollisionModel",
    "Convex",
    "Grid",
    "HalfSpace",
    "Placed",
    "RobotSource",
    "Scene",
    "Separation",
    "Touch",
    "Union",
    "signed_distance",
]
