"""``apprehend fk`` and ``apprehend jacobian``: where the frames of a robot are, and how they move."""

from __future__ import annotations

from typing import Annotated

import typer

from .console import console, print_json

RobotName = Annotated[str, typer.Argument(help="catalogue name or description file")]
Joints = Annotated[str | None, typer.Option("--q", help="joint values, comma-separated", show_default="home")]
Degrees = Annotated[bool, typer.Option("--deg", help="angles in degrees, in and out")]
Json = Annotated[bool, typer.Option("--json", help="print JSON")]


def command(
    robot: RobotName,
    frame: Annotated[str | None, typer.Argument(help="frame; without one: all")] = None,
    q: Joints = None,
    deg: Degrees = False,
    as_json: Json = False,
) -> None:
    """Print poses in the robot's base frame: position in m, fixed-axis roll, pitch, yaw."""
    from rich.table import Table

    from ..conventions import DEGREE
    from ..kinematics import Robot
    from ..spatial import Rotation
    from .values import joints

    model = Robot.load(robot)
    values = joints(q, model, deg)
    frames = model.frame_names if frame is None else (frame,)
    poses = {name: model.fk(values, name) for name in frames}
    if as_json:
        print_json({name: T.tolist() for name, T in poses.items()})
        return
    table = Table(box=None, padding=(0, 2, 0, 0))
    unit = "°" if deg else "rad"
    for column in ("frame", "x m", "y m", "z m", f"roll {unit}", f"pitch {unit}", f"yaw {unit}"):
        table.add_column(column, header_style="dim", justify="left" if column == "frame" else "right")
    for name, T in poses.items():
        rpy = Rotation(T[:3, :3]).rpy() / (DEGREE if deg else 1.0)
        table.add_row(name, *(f"{v:.5f}" for v in T[:3, 3]), *(f"{v:.5f}" for v in rpy))
    console.print(table)


def jacobian(
    robot: RobotName,
    frame: Annotated[str, typer.Argument(help="frame")],
    q: Joints = None,
    reference: Annotated[str, typer.Option(help="mixed, spatial or body")] = "mixed",
    deg: Degrees = False,
    as_json: Json = False,
) -> None:
    """Print the Jacobian (rows v, ω) with its rank, singular values and manipulability."""
    import numpy as np

    from ..kinematics import Robot
    from .values import joints

    model = Robot.load(robot)
    J = model.jacobian(joints(q, model, deg), frame, reference)
    sigma = np.linalg.svd(J, compute_uv=False)
    if as_json:
        print_json({"jacobian": J.tolist(), "singular_values": sigma.tolist(), "joints": list(model.joint_names)})
        return
    for label, row in zip(("vx", "vy", "vz", "ωx", "ωy", "ωz"), J, strict=True):
        console.print(f"{label}  " + "  ".join(f"{v:9.5f}" for v in row))
    console.print(f"\nsingular values  {'  '.join(f'{s:.4g}' for s in sigma)}")
    console.print(f"rank {np.linalg.matrix_rank(J)}, manipulability √det(JJᵀ) = {float(np.prod(sigma)):.4g}")
