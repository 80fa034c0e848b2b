"""The viewer: pictures without a graphics card, the report of an episode, and a live page in the browser."""

from .picture import Camera, Image, Item, jpeg, png, render
from .report import write_report
from .stage import Stage

__all__ = ["Camera", "Image", "Item", "Stage", "jpeg", "png", "render", "write_report"]
