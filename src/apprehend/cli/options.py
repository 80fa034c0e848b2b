"""Options that several commands share, and the robot that they name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ..kinematics import Robot

RobotName = Annotated[str, typer.Argument(help="catalogue name or description file")]
Joints = Annotated[str | None, typer.Option("--q", help="joint values, comma-separated", show_default="home")]
Degrees = Annotated[bool, typer.Option("--deg", help="angles in degrees, in and out")]
CutLoops = Annotated[bool, typer.Option("--cut-loops", help="read closed chains with their loops cut")]
Json = Annotated[bool, typer.Option("--json", help="print JSON")]


def load(robot: str, cut_loops: bool) -> Robot:
    """A robot of the catalogue or a file, with its loops cut if that was asked for."""
    from ..errors import DescriptionError
    from ..kinematics import Robot

    try:
        return Robot.load(robot, loops="cut" if cut_loops else "refuse")
    except DescriptionError as error:
        raise DescriptionError(str(error).replace("loops='cut'", "--cut-loops")) from error
