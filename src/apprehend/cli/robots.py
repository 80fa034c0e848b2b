"""``apprehend robots``: the catalogue, or one robot: its tree, limits, and DH table."""

from __future__ import annotations

from typing import Annotated

import typer

from .console import console, print_json


def command(
    robot: Annotated[str | None, typer.Argument(help="catalogue name or file", show_default="the catalogue")] = None,
    frame: Annotated[str | None, typer.Option(help="also print the DH table of the chain to this frame")] = None,
    deg: Annotated[bool, typer.Option("--deg", help="angles in degrees")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """List the catalogue, or show one robot."""
    if robot is None:
        catalogue(as_json)
    else:
        describe(robot, frame, deg, as_json)


def catalogue(as_json: bool) -> None:
    """Names, kinds and what they need."""
    from rich.table import Table

    from ..robots import catalogue as entries

    rows = entries.entries().values()
    if as_json:
        print_json([
            {"name": e.name, "kind": e.kind, "summary": e.summary, "licence": e.licence, "installed": e.installed}
            for e in rows
        ])  # fmt: skip
        return
    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in ("name", "kind", "what it is", "licence"):
        table.add_column(column, header_style="dim")
    for e in rows:
        missing = "" if e.installed else f" [dim](pip install 'apprehend[{e.extra or 'robots'}]')[/]"
        table.add_row(e.name, e.kind, e.summary + missing, e.licence)
    console.print(table)


def describe(name: str, frame: str | None, deg: bool, as_json: bool) -> None:
    """The tree of one robot, what was repaired, and a DH table if asked for."""
    from ..kinematics import Robot, dh_table
    from ..robots import outline

    robot = Robot.load(name)
    table = None if frame is None else dh_table(robot, frame)
    if as_json:
        limits = robot.limits
        data = {
            "name": robot.name,
            "joints": [
                {"name": j, "lower": lo, "upper": up, "velocity": v, "acceleration": a, "effort": e}
                for j, lo, up, v, a, e in zip(
                    robot.joint_names, finite(limits.lower), finite(limits.upper), finite(limits.velocity),
                    finite(limits.acceleration), finite(limits.effort), strict=True,
                )
            ],
            "frames": list(robot.frame_names),
            "home": robot.home.tolist(),
            "repairs": [str(r) for r in robot.description.repairs],
        }  # fmt: skip
        if table is not None:
            data["dh"] = [vars(row) for row in table.rows]
        print_json(data)
        return
    console.print(outline(robot.description, degrees=deg), markup=False, soft_wrap=True)
    if table is not None:
        turn = 57.29577951308232 if deg else 1.0
        console.print(
            f"\nDH table to {frame} ({table.convention}; θ and α in {'degrees' if deg else 'rad'}, d and a in m)"
        )
        for i, row in enumerate(table.rows, 1):
            angles = f"θ {row.theta * turn:9.4f}  α {row.alpha * turn:9.4f}"
            console.print(f"{i:3}  {row.type:9}  {angles}  d {row.d:8.4f}  a {row.a:8.4f}")


def finite(values: object) -> list[float | None]:
    """Numbers for JSON: infinite ones become null."""
    import numpy as np

    return [float(v) if np.isfinite(v) else None for v in np.asarray(values)]
