"""Options that several commands share, and the robot that they name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from ..bodies import Body
    from ..kinematics import Robot

RobotName = Annotated[str, typer.Argument(help="catalogue name or description file")]
Joints = Annotated[str | None, typer.Option("--q", help="joint values, comma-separated", show_default="home")]
Degrees = Annotated[bool, typer.Option("--deg", help="angles in degrees, in and out")]
CutLoops = Annotated[bool, typer.Option("--cut-loops", help="read closed chains with their loops cut")]
Units = Annotated[str | None, typer.Option(help="of a mesh file: m, cm, mm, in", show_default="m, checked")]
Port = Annotated[int, typer.Option(help="port of the page")]
Browser = Annotated[bool, typer.Option(help="open the page in the default browser")]
Json = Annotated[bool, typer.Option("--json", help="print JSON")]


def load_body(path: str | Path, **options: Any) -> Body:
    """`Body.load`, whose advice on units is given in words of the command line."""
    import re

    from ..bodies import Body
    from ..errors import MeshError

    try:
        return Body.load(path, **options)
    except MeshError as error:
        raise MeshError(re.sub(r"units='(\w+)'", r"--units \1", str(error))) from error


PICTURES = (".png", ".svg", ".pdf")


def check_file(option: str, path: Path | None, *endings: str) -> None:
    """Refuse the name of a file that cannot be written, before anything is computed."""
    from ..errors import InputError

    if path is not None and not path.name.lower().endswith(endings):
        raise InputError(f"{option} is {path}; expected a name that ends in {' or '.join(endings)}")
    if path is not None and not path.absolute().parent.is_dir():
        raise InputError(f"{option} is {path}, but there is no folder {path.absolute().parent}")


def is_scene(path: Path) -> bool:
    """Whether a file describes a scene; what ends in .toml may also be the table of a robot. Missing ones do."""
    return path.suffix == ".toml" and (not path.exists() or "[robot]" in path.read_text(encoding="utf-8"))


def load(robot: str, cut_loops: bool) -> Robot:
    """A robot of the catalogue or a file, with its loops cut if that was asked for."""
    from ..errors import DescriptionError
    from ..kinematics import Robot

    try:
        return Robot.load(robot, loops="cut" if cut_loops else "refuse")
    except DescriptionError as error:
        raise DescriptionError(str(error).replace("loops='cut'", "--cut-loops")) from error
