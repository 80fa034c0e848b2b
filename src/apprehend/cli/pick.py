"""``apprehend pick``: the main job, from an object or a scene to a verdict of the physics."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import console, print_json
from .options import Units, load_body

if TYPE_CHECKING:
    from ..collision import Scene
    from ..process import Episode

MESHES = (".obj", ".stl", ".ply", ".glb", ".off")


def command(
    target: Annotated[
        str | None,
        typer.Argument(
            help="scene (.toml), mesh (.obj, .stl, .ply, .glb, .off) or household object", show_default="mug"
        ),
    ] = None,
    robot: Annotated[str | None, typer.Option(help="catalogue name or description file", show_default="ur5e")] = None,
    hand: Annotated[
        str | None,
        typer.Option(help="hand to mount; 'none' for an arm without one", show_default="the arm's own, or a 2F-85"),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="of all random choices; the same seed gives the same episode")] = 0,
    shuffle: Annotated[
        bool, typer.Option("--shuffle", help="draw a random resting pose and goal from the seed")
    ] = False,
    mass: Annotated[float | None, typer.Option(help="of the object, in kg")] = None,
    friction: Annotated[float | None, typer.Option(help="Coulomb coefficient of the object")] = None,
    units: Units = None,
    out: Annotated[Path | None, typer.Option(help="directory for episode.json and report.html")] = None,
    view: Annotated[bool, typer.Option("--view", help="replay the episode in the browser afterwards")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print the verdict and the steps as JSON")] = False,
) -> int:
    """Exit code 0: the object stands at its goal; 1: it does not (the verdict says why); 2: the input is wrong."""
    from ..errors import InputError
    from ..process import pick_and_place
    from .progress import Checklist, silence
    from .warm import warm_up

    if out is not None and out.is_file():
        raise InputError(f"--out is {out}, which is a file; give a directory")
    start = time.perf_counter()
    with silence() if as_json else Checklist(console) as observer:
        observer.started("scene", "Build the scene")
        scene = build_scene(target, robot, hand, mass=mass, friction=friction, units=units)
        if shuffle:
            from ..process import shuffled

            scene = shuffled(scene, seed)
        warm_up(observer)
        episode = pick_and_place(scene, seed=seed, observer=observer)
    wall = time.perf_counter() - start
    saved = save(episode, out) if out is not None else None
    if as_json:
        data = episode.as_dict()
        print_json({"verdict": data["verdict"], "steps": data["steps"], "wall_time": round(wall, 3), "saved": saved})
    else:
        summarise(episode, wall, saved)
    if view:
        from .. import viewer

        viewer.show(episode, announce=console.print)
    return 0 if episode.success else 1


def build_scene(target: str | None, robot: str | None, hand: str | None, **body_options: Any) -> Scene:
    """The scene that the arguments describe."""
    from ..bodies import HOUSEHOLD, Body
    from ..collision import Scene
    from ..errors import InputError, unknown_name

    given = {k: v for k, v in body_options.items() if v is not None}
    if target is not None and target.endswith(".toml"):
        extra = [f"--{k}" for k, v in {"robot": robot, "hand": hand, **given}.items() if v is not None]
        if extra:
            raise InputError(f"{target} describes the whole scene; drop {', '.join(extra)}, or change the file")
        return Scene.load(target)
    name = target or "mug"
    if name.lower().endswith(MESHES):
        body = load_body(name, **given)
    elif name in HOUSEHOLD:
        if given:
            raise InputError(
                f"--{next(iter(given))} goes with a mesh file; the household object {name!r} brings its own"
            )
        body = Body.household(name)
    elif Path(name).suffix:
        raise InputError(f"{name}: expected a scene (.toml) or a mesh ({', '.join(MESHES)})")
    else:
        unknown_name("household object", name, HOUSEHOLD)
    mounted: dict[str, Any] = {} if hand is None else {"hand": None if hand == "none" else hand}
    return Scene.tabletop(robot or "ur5e", body=body, **mounted)


def save(episode: Episode, out: Path) -> dict[str, str]:
    """Write the episode and its report; return where they are."""
    from .. import viewer

    path = episode.save(out)
    report = viewer.write_report(path, out / "report.html")
    return {"episode": str(path), "report": str(report)}


def summarise(episode: Episode, wall: float, saved: dict[str, str] | None) -> None:
    """The verdict with its numbers."""
    from rich.table import Table

    verdict = episode.verdict
    colour = "green" if episode.success else "red"
    console.print(f"\n[bold {colour}]{'placed' if episode.success else 'failed'}[/]  {verdict.reason}")
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for label, value, unit, digits in (
        ("position error", verdict.position_error * 1e3, "mm", 2),
        ("angle error", verdict.angle_error * 57.29578, "°", 2),
        ("slip in the hand", verdict.slip * 1e3, "mm", 3),
    ):
        if value == value:
            table.add_row(f"[dim]{label}[/]", f"{value:.{digits}f} {unit}")
    simulated = sum(s.simulated for s in episode.steps)
    table.add_row("[dim]time[/]", f"{wall:.1f} s for {simulated:.1f} s of motion")
    for kind, notes in (("repaired", episode.inputs["repairs"]), ("assumed", episode.inputs["assumptions"])):
        for note in notes:
            table.add_row(f"[dim]{kind}[/]", note)
    for label, path in (saved or {}).items():
        table.add_row(f"[dim]{label}[/]", path)
    console.print(table)
