"""``apprehend view``: replay an episode, or look at a body or a robot and its models: a page or a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import console
from .options import Browser, Port, Units, is_scene, load_body

if TYPE_CHECKING:
    from ..bodies import Body
    from ..kinematics import Robot

PLANAR = ("section", "silhouette")
FLAT = (".svg", ".pdf")


def command(
    what: Annotated[
        str,
        typer.Argument(help="episode.json (or its directory), a mesh, a household body, a robot, or a scene (.toml)"),
    ],
    port: Port = 8080,
    browser: Browser = True,
    model: Annotated[
        str | None,
        typer.Option(
            "--as",
            help="a model of the body or of the robot's links: blocks, boxes, spheres, capsules, convex, wireframe, "
            "simplified, surface; of a body also voxels, field, section, silhouette",
        ),
    ] = None,
    count: Annotated[int | None, typer.Option(min=1, help="most shapes (or faces) of the model")] = None,
    resolution: Annotated[float | None, typer.Option(help="side of voxels, spacing of a field, in m")] = None,
    units: Units = None,
    view: Annotated[str | None, typer.Option(help="draw in the plane, as seen from: front, side, top")] = None,
    picture: Annotated[
        Path | None, typer.Option(help="write a picture instead of opening a page: .png, or .svg, .pdf in the plane")
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option(help="write the model: .npz, a mesh, .svg of a figure; of a robot .urdf or .xml (MJCF)"),
    ] = None,
) -> None:
    """Serve a page until interrupted, or write a picture or the model."""
    from .. import viewer
    from ..bodies import FORMATS, HOUSEHOLD, Body
    from ..errors import InputError
    from ..kinematics import Robot

    path = Path(what)
    page: dict[str, Any] = {"port": port, "open_browser": browser, "announce": console.print}
    if path.is_dir() or path.suffix == ".json":
        viewer.show(path, **page)
    elif path.suffix.lower() in FORMATS:
        _body(load_body(path, units=units), model, count, resolution, view, picture, save, page)
    elif what in HOUSEHOLD:
        if units is not None:
            raise InputError(f"--units goes with a mesh file; the household body {what!r} is in m")
        _body(Body.household(what), model, count, resolution, view, picture, save, page)
    elif is_scene(path):
        _scene(path, model, picture, page)
    else:
        _robot(Robot.load(what), model, count, view, picture, save, page)


def _scene(path: Path, model: str | None, picture: Path | None, page: dict[str, Any]) -> None:
    from .. import viewer
    from ..collision import Scene
    from ..errors import InputError

    if model is not None:
        raise InputError("--as shows models of one body or robot, not of a scene; name the body or the robot")
    scene = Scene.load(path)
    if picture is not None:
        _write(picture, viewer.render(scene))
        console.print(f"wrote {picture}")
    else:
        viewer.show_robot(scene, **page)


def _body(
    body: Body, name: str | None, count: int | None, resolution: float | None, view: str | None,
    picture: Path | None, save: Path | None, page: dict[str, Any],
) -> None:  # fmt: skip
    from .. import viewer
    from ..bodies.picture import VIEWS, save_picture
    from ..errors import InputError, unknown_name

    if view is not None and view not in VIEWS:
        unknown_name("view", view, VIEWS)
    shown: Any = body
    if name in PLANAR:
        direction = VIEWS[view or "front"]
        shown = body.section(normal=direction) if name == "section" else body.silhouette(direction)
        console.print(f"{name} of {body.name}: {1e4 * shown.area:.2f} cm², outline {1e3 * shown.length:.1f} mm")
    elif name is not None:
        shown = body.model(name, count, resolution)
        size = f"{len(shown)} " if hasattr(shown, "__len__") else ""
        console.print(f"{size}{name} of {body.name}: {body.deviation(shown)}", soft_wrap=True)
    if save is not None:
        if name is None:
            raise InputError("--save writes a model; say which with --as")
        console.print(f"wrote {shown.save(save)}")
    if picture is not None:
        if view is not None or name in PLANAR or picture.suffix.lower() in FLAT:
            others = () if name is None or name in PLANAR else (shown,)
            save_picture(picture, shown if name in PLANAR else body, *others, view=view or "front")
        else:
            _write(picture, viewer.render(body, model=None if shown is body else shown))
        console.print(f"wrote {picture}")
    elif save is None:
        if name in PLANAR:
            raise InputError(f"a {name} is drawn in the plane; give --picture or --save")
        viewer.show_body(body, model=None if name == "surface" else name, **page)


def _robot(
    robot: Robot, name: str | None, count: int | None, view: str | None,
    picture: Path | None, save: Path | None, page: dict[str, Any],
) -> None:  # fmt: skip
    from .. import viewer
    from ..errors import InputError
    from ..kinematics import link_models

    if view is not None:
        raise InputError("--view draws bodies in the plane; a robot is drawn in space, without --view")
    models = None if name is None else link_models(robot, name, count)
    if models is not None:
        console.print(models.report(), highlight=False, soft_wrap=True)
    if save is not None:
        if models is None:
            raise InputError("--save writes the robot with models as its collision geometry; say which with --as")
        console.print(f"wrote {models.save(save)}")
    if picture is not None:
        _write(picture, viewer.render(robot, model=models))
        console.print(f"wrote {picture}")
    elif save is None:
        viewer.show_robot(robot, models=models, **page)


def _write(path: Path, image: Any) -> None:
    from ..errors import InputError
    from ..files import replace_file
    from ..viewer import png

    if path.suffix.lower() != ".png":
        raise InputError(f"{path.name} is not a picture's name; expected .png (.svg and .pdf show bodies in the plane)")
    with replace_file(path) as work:
        work.write_bytes(png(image))
