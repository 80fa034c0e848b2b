"""The viewer: pictures without a graphics card, the report of an episode, and live pages in the browser."""

from .contacts import show_contacts
from .draw import render
from .live import Page
from .pages import show_body, show_grasp, show_robot
from .paths import render_path, show_path
from .picture import Camera, Image, Item, jpeg, png
from .postures import render_postures
from .replay import show
from .report import write_report
from .stage import Stage

__all__ = [
    "Camera",
    "Image",
    "Item",
    "Page",
    "Stage",
    "jpeg",
    "png",
    "render",
    "render_path",
    "render_postures",
    "show",
    "show_body",
    "show_contacts",
    "show_grasp",
    "show_path",
    "show_robot",
    "write_report",
]
