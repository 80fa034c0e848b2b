"""``apprehend ik``: joint values for a pose, or the reason why there are none."""

from __future__ import annotations

from typing import Annotated

import typer

from .console import console, print_json


def command(
    robot: Annotated[str, typer.Argument(help="catalogue name or description file")],
    frame: Annotated[str, typer.Argument(help="frame to bring to the pose")],
    xyz: Annotated[str, typer.Option(help="position in m: x,y,z")],
    rpy: Annotated[str | None, typer.Option(help="fixed-axis roll,pitch,yaw", show_default="0,0,0")] = None,
    n: Annotated[int, typer.Option(min=1, help="most solutions to list")] = 8,
    seed: Annotated[int, typer.Option(min=0, help="of the random starts")] = 0,
    deg: Annotated[bool, typer.Option("--deg", help="angles in degrees, in and out")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> int:
    """List distinct solutions within the limits. Exit code 0: found; 1: none, and why; 2: wrong input."""
    import numpy as np
    from rich.table import Table

    from ..conventions import DEGREE
    from ..ik import solve
    from ..kinematics import Robot
    from .values import pose

    model = Robot.load(robot)
    T = pose(xyz, rpy, deg)
    answer = solve(model, T, frame, n_solutions=max(n, 2), rng=np.random.default_rng(seed))
    found = answer.solutions()[:n] if answer.success else np.zeros((0, model.n))
    if as_json:
        print_json({"status": str(answer.status), "reason": answer.reason(), "joints": list(model.joint_names),
                    "q": found.tolist(), "residual": answer.residual.tolist()})  # fmt: skip
        return 0 if answer.success else 1
    console.print(answer.reason(), markup=False)
    if answer.success:
        table = Table(box=None, padding=(0, 2, 0, 0))
        for name in model.joint_names:
            table.add_column(name, header_style="dim", justify="right")
        for q in found:
            table.add_row(*(f"{v:.4f}" for v in q / (DEGREE if deg else 1.0)))
        console.print(table)
    return 0 if answer.success else 1
