"""Perception: depth cameras, and where a known body stands that they see."""

from .camera import Camera, DepthImage, Noise, look_at
from .locating import LocateResult, LocateStatus, locate, surface_distance
from .mesh import ModelSurface
from .segment import Plane

__all__ = [
    "Camera", "DepthImage", "LocateResult", "LocateStatus", "ModelSurface", "Noise", "Plane", "locate", "look_at",
    "surface_distance",
]  # fmt: skip
