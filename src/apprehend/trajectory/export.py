"""Motions as files: CSV, JSON (exact, and read back), and the layout of ROS's ``JointTrajectory``."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import InputError
from .motion import Trajectory
from .path import as_waypoints

_FORMAT = "apprehend trajectory 1"


def to_csv(motion: Trajectory, path: str | Path, *, dt: float = 0.01, names: Sequence[str] | None = None) -> Path:
    """Samples at a rate *dt*: time, then position, velocity and acceleration of every coordinate (SI, radians)."""
    names = _names(motion, names)
    samples = motion.sample(dt)
    head = ["t", *(f"{name}{kind}" for kind in ("", "_velocity", "_acceleration") for name in names)]
    table = np.column_stack([samples.t, samples.position, samples.velocity, samples.acceleration])
    lines = [",".join(head), *(",".join(repr(float(x)) for x in row) for row in table)]
    return _write(path, "\n".join(lines) + "\n")


def to_json(motion: Trajectory, path: str | Path, *, names: Sequence[str] | None = None) -> Path:
    """The polynomials themselves: breaks (s) and low-first coefficients; `read_json` gives the same motion back."""
    record = {
        "format": _FORMAT,
        "names": list(_names(motion, names)),
        "breaks": motion.breaks.tolist(),
        "coefficients": motion.coefficients.tolist(),
    }
    return _write(path, json.dumps(record) + "\n")


def read_json(path: str | Path) -> tuple[Trajectory, tuple[str, ...]]:
    """The motion and the names of its coordinates that `to_json` wrote."""
    try:
        record = json.loads(Path(path).read_text())
    except (OSError, json.JSONDecodeError) as error:
        raise InputError(f"{path} cannot be read as a trajectory: {error}") from error
    if not isinstance(record, dict) or record.get("format") != _FORMAT:
        raise InputError(f"{path} is not a trajectory of this package (its format is not {_FORMAT!r})")
    motion = Trajectory(record["breaks"], record["coefficients"])
    return motion, tuple(record["names"])


def joint_trajectory(motion: Trajectory, *, dt: float = 0.02, names: Sequence[str] | None = None) -> dict[str, Any]:
    """The motion as ROS's ``trajectory_msgs/JointTrajectory``: plain values, ready for YAML, JSON or a message.

    Times count from the start of the motion; ROS interpolates quintically between points with position, velocity and
    acceleration.
    """
    samples = motion.sample(dt)
    points = []
    for i, t in enumerate(samples.t - motion.interval[0]):
        seconds, nanoseconds = divmod(round(float(t) * 1e9), 10**9)
        points.append({
            "positions": samples.position[i].tolist(),
            "velocities": samples.velocity[i].tolist(),
            "accelerations": samples.acceleration[i].tolist(),
            "effort": [],
            "time_from_start": {"sec": seconds, "nanosec": nanoseconds},
        })  # fmt: skip
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {"header": header, "joint_names": list(_names(motion, names)), "points": points}


def to_ros(motion: Trajectory, path: str | Path, *, dt: float = 0.02, names: Sequence[str] | None = None) -> Path:
    """`joint_trajectory` as a JSON file."""
    return _write(path, json.dumps(joint_trajectory(motion, dt=dt, names=names)) + "\n")


def read_waypoints(path: str | Path) -> Array:
    """Waypoints ``(M, n)`` from a ``.csv`` file (one row each, a header is skipped) or a ``.json`` list of lists."""
    file = Path(path)
    try:
        text = file.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read: {error}") from error
    if file.suffix == ".json":
        try:
            rows = json.loads(text)
        except json.JSONDecodeError as error:
            raise InputError(f"{path}: not JSON: {error}") from error
        return as_waypoints(rows, f"the list in {file.name}")
    table = []
    for number, line in enumerate(text.splitlines(), 1):
        cells = line.replace(";", ",").split(",")
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            table.append([float(c) for c in cells])
        except ValueError as error:
            if not table and number == 1:
                continue  # a header
            raise InputError(f"{path}:{number}: {error}; expected numbers separated by commas") from error
        if len(table[-1]) != len(table[0]):
            raise InputError(f"{path}:{number}: {len(table[-1])} values; the rows before have {len(table[0])}")
    return as_waypoints(table, f"the rows of {file.name}")


def _names(motion: Trajectory, names: Sequence[str] | None) -> tuple[str, ...]:
    if names is None:
        return tuple(f"q{j + 1}" for j in range(motion.n))
    if len(names) != motion.n or len(set(names)) != motion.n:
        raise InputError(f"names has {len(names)} entries ({len(set(names))} different); expected {motion.n} names")
    return tuple(names)


def _write(path: str | Path, text: str) -> Path:
    """Write under a temporary name, then rename: whole or not at all."""
    target = Path(path)
    if not target.parent.is_dir():
        raise InputError(f"the folder {target.parent} does not exist")
    temporary = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        temporary.write_text(text)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)
    return target
