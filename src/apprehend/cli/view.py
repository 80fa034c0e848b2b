"""``apprehend view``: replay an episode, or look at one body or robot, in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .console import console


def command(
    what: Annotated[str, typer.Argument(help="episode.json (or its directory), a mesh, a household body, or a robot")],
    port: Annotated[int, typer.Option(help="port of the page")] = 8080,
    browser: Annotated[bool, typer.Option(help="open the page in the default browser")] = True,
) -> None:
    """Serve a page until interrupted."""
    from .. import viewer
    from ..bodies import HOUSEHOLD, Body
    from ..kinematics import Robot

    path = Path(what)
    page: dict[str, Any] = {"port": port, "open_browser": browser, "announce": console.print}
    if path.is_dir() or path.suffix == ".json":
        viewer.show(path, **page)
    elif path.suffix.lower() in (".obj", ".stl", ".ply", ".glb"):
        viewer.show_body(Body.load(path), **page)
    elif what in HOUSEHOLD:
        viewer.show_body(Body.household(what), **page)
    else:
        viewer.show_robot(Robot.load(what), **page)
