"""Perception: depth cameras, and where a known body stands that they see."""

from .camera import Camera, DepthImage, Noise, look_at

__all__ = ["Camera", "DepthImage", "Noise", "look_at"]
