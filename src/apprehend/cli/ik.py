"""``apprehend ik``: every branch or several solutions for a pose, or the reason why there are none."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import console, print_json
from .options import check_file

if TYPE_CHECKING:
    from ..arrays import Array
    from ..ik import BranchResult
    from ..kinematics import Robot


def command(
    robot: Annotated[str, typer.Argument(help="catalogue name or description file")],
    frame: Annotated[str, typer.Argument(help="frame to bring to the pose")],
    xyz: Annotated[str, typer.Option(help="position in m: x,y,z")],
    rpy: Annotated[str | None, typer.Option(help="fixed-axis roll,pitch,yaw", show_default="0,0,0")] = None,
    near: Annotated[str | None, typer.Option(help="joint values to start from", show_default="home")] = None,
    n: Annotated[int, typer.Option(min=1, help="most solutions to list")] = 8,
    redundancy: Annotated[
        float | None, typer.Option(help="angle of the joint that a pose leaves open, on arms of seven joints")
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="list branches beyond the joint limits too")] = False,
    picture: Annotated[Path | None, typer.Option(help="PNG of the arm in every row of the table")] = None,
    curves: Annotated[
        Path | None, typer.Option(help="PNG: what the inverses make of the singular values at the first row")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the random starts")] = 0,
    deg: Annotated[bool, typer.Option("--deg", help="angles in degrees, in and out")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> int:
    """List the branches of the closed form that fits the arm, or else distinct solutions, within the limits.

    Exit code 0: found; 1: none, and why; 2: wrong input.
    """
    import numpy as np

    from .. import ik
    from ..conventions import DEGREE
    from ..kinematics import Robot
    from .values import joints, pose

    check_file("--picture", picture, ".png")
    check_file("--curves", curves, ".png")
    model = Robot.load(robot)
    T = pose(xyz, rpy, deg)
    q0 = joints(near, model, deg, "--near") if near is not None else None
    answer = ik.solve(model, T, frame, q0, n_solutions=max(n, 2), rng=np.random.default_rng(seed))
    value = None if redundancy is None else redundancy * (DEGREE if deg else 1.0)
    open_joint, intervals, known = _closed_form(model, T, frame, value, every, q0)
    if known is not None and known.success:
        found, family = known.solutions()[:n], known.family
    else:
        found, family = answer.solutions()[:n] if answer.success else np.zeros((0, model.n)), None
    shown = found if len(found) else answer.q.reshape(-1, model.n)[:1]
    rows = _facts(model, frame, shown)
    if as_json:
        print_json({"status": str(answer.status), "reason": answer.reason(), "joints": list(model.joint_names),
                    "q": found.tolist(), "residual": answer.residual.tolist(), "closed_form": family,
                    "redundant_joint": open_joint, "feasible": intervals.tolist(),
                    "nearest": None if len(found) else shown[0].tolist(),
                    "rows": [{"limits": limits, "manipulability": measure} for limits, measure in rows]})  # fmt: skip
    else:
        console.print(answer.reason(), markup=False)
        unit = DEGREE if deg else 1.0
        if open_joint is not None:
            parts = ", ".join(f"[{a / unit:.4g}, {b / unit:.4g}]" for a, b in intervals) or "none"
            console.print(f"joint {open_joint!r} is open; closed form within the limits for {parts}", markup=False)
        if family is not None:
            console.print(f"{len(found)} branches ({family})", markup=False)
        _print_table(model, frame, shown, rows, unit, bool(len(found)))
    if picture is not None:
        from ..viewer import png, render_postures

        marks = [f"{i + 1}" if len(found) else "nearest" for i in range(len(shown))]
        captions = [f"{mark}   to limit: {limits}" for mark, (limits, _) in zip(marks, rows, strict=True)]
        picture.write_bytes(png(render_postures(model, shown, captions, target=T)))
    if curves is not None:
        sigma = np.linalg.svd(model.jacobian(shown[0], frame), compute_uv=False)
        ik.plot_inverses(0.1, sigma=sigma).figure.savefig(curves, dpi=130)
    return 0 if answer.success or len(found) else 1


def _closed_form(
    model: Robot, T: Array, frame: str, value: float | None, every: bool, q0: Array | None
) -> tuple[str | None, Array, BranchResult | None]:
    """The joint that a pose leaves open, the intervals in which branches exist, and the branches, if a form fits."""
    import numpy as np

    from .. import ik
    from ..errors import InputError

    nothing = np.zeros((0, 2))
    open_joint = ik.redundant_joint(model, frame) if model.chain(frame) else None
    if open_joint is None:
        if value is not None:
            raise InputError(f"--redundancy is given, but frame {frame!r} of {model.name!r} leaves no joint open")
        try:
            return None, nothing, ik.branches(model, T, frame, limits=not every, q0=q0)
        except InputError:
            return None, nothing, None  # no closed form fits
    intervals = ik.redundancy_intervals(model, T, frame)
    if value is None and len(intervals):
        widest = intervals[int(np.argmax(intervals[:, 1] - intervals[:, 0]))]
        value = float(widest.mean())
    if value is None:
        return open_joint, intervals, None
    return open_joint, intervals, ik.branches(model, T, frame, redundancy=value, limits=not every, q0=q0)


def _facts(model: Robot, frame: str, q: Array) -> list[tuple[str, float]]:
    """For every joint vector: its nearest limit, how far off it is (rad, m; negative: beyond), the manipulability."""
    import numpy as np

    moving = list(model.chain(frame))
    lower, upper = model.limits.lower[moving], model.limits.upper[moving]
    out = []
    for row in q:
        spare = np.minimum(row[moving] - lower, upper - row[moving])
        at = int(np.argmin(spare))
        if not np.isfinite(spare[at]):
            text = "none"
        elif spare[at] < -1e-9:
            text = f"q{at + 1} {spare[at]:.2g}"
        else:
            text = f"q{at + 1} {max(spare[at], 0.0):.2g}"
        J = model.jacobian(row, frame)[:, moving]
        sigma = np.linalg.svd(J, compute_uv=False)
        out.append((text, float(np.prod(sigma))))
    return out


def _print_table(model: Robot, frame: str, q: Array, rows: list[tuple[str, float]], unit: float, found: bool) -> None:
    from rich.table import Table

    moving = list(model.chain(frame))
    sliding = [model.description.free_joints[c].type.value == "prismatic" for c in moving]
    names = ", ".join(f"q{i + 1} {model.joint_names[c]}" for i, c in enumerate(moving))
    console.print(names, style="dim", markup=False, soft_wrap=True)
    table = Table(box=None, padding=(0, 1, 0, 0))
    for i in range(len(moving)):
        table.add_column(f"q{i + 1}", header_style="dim", justify="right", no_wrap=True)
    table.add_column("√det(JJᵀ)", header_style="dim", justify="right", no_wrap=True)
    table.add_column("to limit", header_style="dim", no_wrap=True)
    table.title = None if found else "nearest joint vector within the limits"
    digits = 3 if unit == 1.0 else 1
    for row, (limits, measure) in zip(q, rows, strict=True):
        values = [
            f"{row[c]:.4f}" if slides else f"{row[c] / unit:.{digits}f}"
            for c, slides in zip(moving, sliding, strict=True)
        ]
        table.add_row(*values, f"{measure:.2g}", limits)
    console.print(table)
