"""``apprehend robots``: the catalogue, or one robot: its tree, limits, and DH table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import console, print_json
from .options import CutLoops, Json, load

if TYPE_CHECKING:
    from ..kinematics import DHTable, Robot


def command(
    robot: Annotated[str | None, typer.Argument(help="catalogue name or file", show_default="the catalogue")] = None,
    kind: Annotated[str | None, typer.Option(help="of the catalogue, only this kind: arm, hand, …")] = None,
    frame: Annotated[str | None, typer.Option(help="also print the DH table of the chain to this frame")] = None,
    modified: Annotated[bool, typer.Option("--modified", help="DH table in Craig's convention")] = False,
    deg: Annotated[bool, typer.Option("--deg", help="angles in degrees")] = False,
    cut_loops: CutLoops = False,
    as_json: Json = False,
) -> None:
    """List the catalogue, or show one robot."""
    if robot is None:
        catalogue(kind, as_json)
    else:
        describe(load(robot, cut_loops), frame, modified, deg, as_json)


def catalogue(kind: str | None, as_json: bool) -> None:
    """Names, kinds and what they need."""
    from rich.table import Table

    from ..robots import catalogue as entries

    rows = [entries.entry(name) for name in entries.names(kind)]
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


def describe(robot: Robot, frame: str | None, modified: bool, deg: bool, as_json: bool) -> None:
    """The tree of one robot, what was repaired, and a DH table if asked for."""
    from ..conventions import DEGREE
    from ..kinematics import dh_table
    from ..robots import outline

    table = None if frame is None else dh_table(robot, frame)
    if table is not None and modified:
        table = table.modified()
    if as_json:
        print_json(everything(robot, table))
        return
    console.print(outline(robot.description, degrees=deg), markup=False, soft_wrap=True)
    if table is not None:
        turn = 1.0 / DEGREE if deg else 1.0
        console.print(
            f"\nDH table to {frame} ({table.convention}; θ and α in {'degrees' if deg else 'rad'}, d and a in m)"
        )
        for i, row in enumerate(table.rows, 1):
            angles = f"θ {row.theta * turn + 0.0:9.4f}  α {row.alpha * turn + 0.0:9.4f}"
            console.print(f"{i:3}  {row.type:9}  {angles}  d {row.d + 0.0:8.4f}  a {row.a + 0.0:8.4f}  {row.joint}")


def everything(robot: Robot, table: DHTable | None) -> dict[str, Any]:
    """One robot for programs: SI units and radians; null where there is no limit."""
    description = robot.description
    data: dict[str, Any] = {
        "name": robot.name,
        "root": description.root,
        "coordinates": list(robot.joint_names),
        "frames": list(robot.frame_names),
        "home": robot.home.tolist(),
        "joints": [
            {
                "name": joint.name, "type": joint.type.value, "parent": joint.parent, "child": joint.child,
                "pose": joint.pose.tolist(), "axis": joint.axis.tolist(),
                **{key: finite(value) for key, value in vars(joint.limits).items()},
                "mimic": vars(joint.mimic) if joint.mimic else None,
            }
            for joint in description.joints
        ],
        "masses": {name: link.inertial.mass for name, link in description.links.items() if link.inertial},
        "tendons": [linear(t.name, t.arms, t.lower, t.upper) for t in description.tendons],
        "actuators": [linear(a.name, a.arms, a.lower, a.upper) for a in description.actuators],
        "loops": [{"name": p.name, "first": p.first, "second": p.second, "free": p.free} for p in description.loops],
        "repairs": [str(r) for r in description.repairs],
    }  # fmt: skip
    if table is not None:
        data["dh"] = {
            "frame": table.frame, "convention": table.convention, "base": table.base.tolist(),
            "rows": [vars(row) for row in table.rows], "tool": table.tool.tolist(),
        }  # fmt: skip
    return data


def linear(name: str, arms: Any, lower: float, upper: float) -> dict[str, Any]:
    """A tendon or a motor: its arms on the joints and its range."""
    return {"name": name, "arms": dict(arms), "lower": finite(lower), "upper": finite(upper)}


def finite(value: float) -> float | None:
    """A number for JSON: an infinite one becomes null."""
    return value if abs(value) < float("inf") else None
