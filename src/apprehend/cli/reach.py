"""``apprehend reach``: build a reachability map, look at it, ask it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .console import console, print_json
from .options import PICTURES, check_file


def command(
    robot: Annotated[str, typer.Argument(help="catalogue name or description file")],
    frame: Annotated[str, typer.Argument(help="frame to be brought to poses")],
    out: Annotated[Path | None, typer.Option(help="the map's file; an interrupted build goes on from it")] = None,
    picture: Annotated[Path | None, typer.Option(help="draw a cut through the base's axis (.png, .svg, .pdf)")] = None,
    xyz: Annotated[str | None, typer.Option(help="a pose to ask for: position in m, x,y,z")] = None,
    rpy: Annotated[str | None, typer.Option(help="its fixed-axis roll,pitch,yaw", show_default="0,0,0")] = None,
    resolution: Annotated[float, typer.Option(help="edge of a voxel in m")] = 0.05,
    angle: Annotated[float, typer.Option(help="width of an orientation cell in degrees; 360: positions only")] = 45.0,
    measure: Annotated[str, typer.Option(help="yoshikawa, mu1, mu2 or mu3")] = "yoshikawa",
    coverage: Annotated[float, typer.Option(help="sample until a new sample falls into a known cell so often")] = 0.95,
    seed: Annotated[int, typer.Option(min=0, help="of the samples, and of the check")] = 0,
    deg: Annotated[bool, typer.Option("--deg", help="rpy in degrees")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> int:
    """Exit code 0: done, and the pose asked for is reachable; 1: it is not; 2: wrong input."""
    import numpy as np

    from ..conventions import DEGREE
    from ..errors import InputError
    from ..kinematics import Robot
    from ..workspace import ReachabilityMap
    from .values import pose

    check_file("--picture", picture, *PICTURES)
    if rpy is not None and xyz is None:
        raise InputError("--rpy turns the pose of --xyz; give --xyz, or drop --rpy")
    model = Robot.load(robot)
    target = None if xyz is None else pose(xyz, rpy, deg)
    with console.status("compiling") as status:
        reach = ReachabilityMap.build(
            model, frame, resolution=resolution, angle=np.inf if angle >= 360.0 else angle * DEGREE, measure=measure,
            coverage=coverage, rng=np.random.default_rng(seed), file=out,
            progress=lambda c, n: status.update(f"{n / 1e6:.1f} million samples, coverage {c:.1%} of {coverage:.0%}"),
        )  # fmt: skip
        status.update("checking against inverse kinematics")
        checked = reach.accuracy(10_000, rng=np.random.default_rng(seed))
    if picture is not None:
        reach.draw("xz", at=float(model.base[1, 3])).figure.savefig(picture)
    facts = {
        "samples": reach.counts.samples, "coverage": reach.coverage, "cells": int(np.count_nonzero(reach.hits)),
        "volume": reach.volume, "precision": checked.precision, "recall": checked.recall,
        "agreement": checked.agreement,
    }  # fmt: skip
    if target is not None:
        facts |= {"reachable": reach.reachable(target), "manipulability": reach.manipulability(target)}
    if as_json:
        print_json(facts)
    else:
        console.print(f"{facts['cells']} cells reached, within {reach.volume:.3g} m³; coverage {reach.coverage:.1%}")
        console.print(f"against inverse kinematics on 10,000 random poses: {checked}")
        if target is not None:
            console.print(
                f"the pose is reachable, manipulability up to {facts['manipulability']:.3g} ({measure})"
                if facts["reachable"]
                else "the pose is not reachable"
            )
    return 1 if target is not None and not facts["reachable"] else 0
