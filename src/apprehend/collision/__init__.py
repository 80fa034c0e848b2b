"""Scenes, and collision of robots with themselves and with what stands around them."""

from .scene import Box, Placed, RobotSource, Scene

__all__ = ["Box", "Placed", "RobotSource", "Scene"]
