"""``apprehend trajectory``: waypoints from a file, a motion within proven limits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import console, print_json
from .options import PICTURES, check_file

if TYPE_CHECKING:
    from ..arrays import Array
    from ..kinematics import Robot
    from ..trajectory import Limits, Trajectory


def command(
    waypoints: Annotated[
        Path, typer.Argument(help="joint values, one waypoint per row: .csv, or .json (list of lists)")
    ],
    robot: Annotated[str, typer.Option(help="robot whose limits hold: a catalogue name or a file")] = "",
    velocity: Annotated[
        float | None, typer.Option(help="velocity limit of every joint, instead of the robot's")
    ] = None,
    acceleration: Annotated[float | None, typer.Option(help="acceleration limit of every joint")] = None,
    jerk: Annotated[float | None, typer.Option(help="jerk limit of every joint: makes the motion jerk-limited")] = None,
    straight: Annotated[bool, typer.Option(help="straight segments instead of a spline through the waypoints")] = False,
    deviation: Annotated[float, typer.Option(help="how far straight segments may be left to round corners")] = 0.0,
    grid: Annotated[int, typer.Option(help="grid intervals of the time-optimal motion")] = 200,
    torque: Annotated[bool, typer.Option(help="keep the robot's torque limits too (full dynamics)")] = False,
    out: Annotated[Path | None, typer.Option(help="write the motion: .json (exact), .csv, or .ros.json")] = None,
    dt: Annotated[float, typer.Option(help="seconds between samples of .csv and .ros.json")] = 0.01,
    picture: Annotated[
        Path | None, typer.Option(help="draw position to jerk with the limits (.png, .svg, .pdf)")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> int:
    """Time a path. Exit code 0: a motion with proven limits; 1: there is none, and why; 2: wrong input."""
    from .. import trajectory as tj
    from ..errors import InputError, UnsuccessfulError
    from ..kinematics import Robot

    check_file("--out", out, ".json", ".ros.json", ".csv")
    check_file("--picture", picture, *PICTURES)
    if deviation != 0.0 and not straight:
        raise InputError("--deviation rounds the corners of straight segments; give --straight, or drop it")
    points = tj.read_waypoints(waypoints)
    arm = Robot.load(robot) if robot else None
    names = arm.joint_names if arm is not None else None
    if arm is not None and points.shape[1] != arm.n:
        raise InputError(f"{waypoints} has {points.shape[1]} columns; robot {arm.name!r} has {arm.n} joints: {names}")
    limits = _limits(arm, velocity, acceleration, jerk)
    if torque and arm is None:
        raise InputError("--torque needs --robot: the torques follow from its dynamics")
    try:
        motion, violation = _motion(points, limits, straight, deviation, grid, arm if torque else None)
    except UnsuccessfulError as error:
        if as_json:
            print_json({"success": False, "why": str(error)})
        else:
            console.print(f"no motion: {error}")
        return 1
    report = motion.check(limits)
    violation = max(violation, report.violation)
    if out is not None:
        _write(motion, out, dt, names)
    if picture is not None:
        tj.plot(motion, limits, names=names, relative=True).savefig(picture)
    facts: dict[str, Any] = {
        "success": report.success, "duration": motion.duration, "pieces": int(motion.breaks.size - 1),
        "length": tj.arc_length(motion, tolerance=1e-9), "limit": report.limit, "coordinate": report.coordinate,
        "time": report.time, "value": report.value, "bound": report.bound, "violation": violation,
    }  # fmt: skip
    if as_json:
        print_json(facts)
    else:
        joint = names[report.coordinate] if names is not None else f"q{report.coordinate + 1}"
        console.print(f"{points.shape[0]} waypoints, {points.shape[1]} joints: {motion.duration:.4f} s")
        verdict = "limits proven at all times; tightest" if report.success else "a limit is exceeded"
        console.print(f"{verdict}: {report.limit} of {joint}, {report.value:.4g} of {report.bound:.4g} "
                      f"at t = {report.time:.4f} s")  # fmt: skip
        if torque:
            console.print(f"torques proven too: largest excess over any limit {violation:.1g}")
        if out is not None:
            console.print(f"written: {out}")
    return 0 if report.success else 1


def _limits(arm: Robot | None, velocity: float | None, acceleration: float | None, jerk: float | None) -> Limits:
    """What was asked for, and otherwise what the robot can do."""
    import numpy as np

    from ..errors import InputError
    from ..trajectory import Limits

    own = arm.limits if arm is not None else None
    if acceleration is None and (own is None or not np.isfinite(own.acceleration).all()):
        raise InputError(
            f"{f'robot {arm.name!r}' if arm is not None else 'a motion without --robot'} has no acceleration limits of "
            "its own; give --acceleration (rad/s² or m/s² of every joint)"
        )
    return Limits(
        velocity=velocity if velocity is not None else own.velocity if own is not None else None,
        acceleration=acceleration if acceleration is not None else own.acceleration if own is not None else None,
        jerk=jerk,
        position=np.stack([own.lower, own.upper], axis=1) if own is not None else None,
    )


def _motion(
    points: Array, limits: Limits, straight: bool, deviation: float, grid: int, arm: Robot | None
) -> tuple[Trajectory, float]:
    """The fastest motion within the limits (and those of the torques of *arm*), and by how much it exceeds any."""
    from .. import trajectory as tj
    from ..errors import InputError

    if straight and deviation == 0.0:
        if arm is not None or limits.jerk is not None:
            raise InputError("straight segments with stops take no --torque or --jerk; give a --deviation > 0")
        return tj.follow(points, limits), 0.0
    path = tj.rounded(points, deviation) if straight else tj.Spline(points)
    if limits.jerk is not None:
        if arm is not None:
            raise InputError("--jerk and --torque together are not supported; choose one")
        return tj.jerk_limited(path, limits, least=8), 0.0
    constraints = [tj.TorqueLimits(arm)] if arm is not None else []
    timing = tj.time_optimal(path, limits, constraints=constraints, grid=grid, least=8).require_success()
    return timing.motion, timing.violation


def _write(motion: Any, out: Path, dt: float, names: Any) -> None:
    from .. import trajectory as tj
    from ..errors import InputError

    if out.name.endswith(".ros.json"):
        tj.to_ros(motion, out, dt=dt, names=names)
    elif out.suffix == ".json":
        tj.to_json(motion, out, names=names)
    elif out.suffix == ".csv":
        tj.to_csv(motion, out, dt=dt, names=names)
    else:
        raise InputError(f"--out is {out}; expected a name that ends in .json, .ros.json or .csv")
