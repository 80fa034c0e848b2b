"""Scenes, and collision of robots with themselves and with what stands around them."""

from .allowed import AllowedPairs, find_allowed_pairs
from .model import Closest, CollisionModel, PairDistances, Sweep, Touch
from .obstacles import Cloud, Grid, HalfSpace, Union
from .pairs import Separation, signed_distance
from .scene import Box, Obstacle, Placed, RobotSource, Scene
from .shapes import Convex

__all__ = [
    "AllowedPairs",
    "Box",
    "Closest",
    "Cloud",
    "CollisionModel",
    "Convex",
    "Grid",
    "HalfSpace",
    "Obstacle",
    "PairDistances",
    "Placed",
    "RobotSource",
    "Scene",
    "Separation",
    "Sweep",
    "Touch",
    "Union",
    "find_allowed_pairs",
    "signed_distance",
]
