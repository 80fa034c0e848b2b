"""``apprehend fk`` and ``apprehend jacobian``: where the frames of a robot are, and how they move."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .console import console, print_json
from .options import PICTURES, CutLoops, Degrees, Joints, Json, RobotName, check_file, load


def command(
    robot: RobotName,
    frame: Annotated[str | None, typer.Argument(help="frame; without one: all")] = None,
    q: Joints = None,
    deg: Degrees = False,
    cut_loops: CutLoops = False,
    as_json: Json = False,
) -> None:
    """Print poses in the robot's base frame: position in m, fixed-axis roll, pitch, yaw."""
    from rich.table import Table

    from ..conventions import DEGREE
    from ..spatial import Rotation
    from .values import joints

    model = load(robot, cut_loops)
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
        table.add_row(name, *(fixed(v) for v in (*T[:3, 3], *rpy)))
    console.print(table)


def jacobian(
    robot: RobotName,
    frame: Annotated[str, typer.Argument(help="frame")],
    q: Joints = None,
    reference: Annotated[str, typer.Option(help="mixed, spatial or body")] = "mixed",
    part: Annotated[str, typer.Option(help="measured and drawn: both, linear, angular, xy, xz or yz")] = "both",
    picture: Annotated[
        Path | None, typer.Option(help="draw the ellipsoids of velocity and force of that part (.png, .svg, .pdf)")
    ] = None,
    deg: Degrees = False,
    cut_loops: CutLoops = False,
    as_json: Json = False,
) -> None:
    """Print the Jacobian (rows v, ω), its rank, lost directions, singular values and K's measures µ1, µ2, µ3."""
    from ..kinematics import draw, manipulability
    from .values import joints

    check_file("--picture", picture, *PICTURES)
    model = load(robot, cut_loops)
    values = joints(q, model, deg)
    J = model.jacobian(values, frame, reference)
    m = manipulability(model, values, frame, part)
    lost = m.lost()
    if picture is not None:
        kinds = ("velocity ellipsoid",) if m.singular else ("velocity ellipsoid", "force ellipsoid")
        draw(model, values, frame, kinds, "linear" if part == "both" else part).figure.savefig(picture)
    if as_json:
        print_json(
            {
                "joints": list(model.joint_names), "reference": reference, "jacobian": J.tolist(), "part": part,
                "singular_values": m.sigma.tolist(), "rank": int(m.rank), "lost": lost.tolist(),
                "mu1": float(m.mu1), "mu2": float(m.mu2), "mu3": float(m.mu3), "yoshikawa": float(m.yoshikawa),
            }
        )  # fmt: skip
        return
    for label, row in zip(("vx", "vy", "vz", "ωx", "ωy", "ωz"), J, strict=True):
        console.print(f"{label}  " + "  ".join(f"{fixed(v):>9}" for v in row), soft_wrap=True)
    console.print(f"\n{part}: rank {int(m.rank)} of {m.rows}; singular values {'  '.join(f'{s:.4g}' for s in m.sigma)}")
    for direction in lost:
        console.print("lost direction  " + "  ".join(f"{fixed(v):>9}" for v in direction))
    console.print(
        f"µ1 = σ_min(A) {float(m.mu1):.4g}, µ2 = σ_min(A)/σ_max(A) {float(m.mu2):.4g}, "
        f"µ3 = det A {float(m.mu3):.4g} of A = JJᵀ; √det A {float(m.yoshikawa):.4g}",
        soft_wrap=True,
    )


def fixed(value: float) -> str:
    """Five decimals, and no minus before a zero."""
    text = f"{value:.5f}"
    return text[1:] if text == "-0.00000" else text
