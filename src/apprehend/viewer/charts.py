"""Which charts an episode gets: loads as a share of their limits, force, the object's way, and every joint."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Array
from ..robots.description import JointType
from .plots import Chart, Line
from .record import Record
from .stage import Stage

SHADES = 8


def load_charts(record: Record, data: Mapping[str, Any]) -> list[Chart]:
    """Charts over the whole episode, with the steps as bands: speeds, torques, force, and where the object is."""
    charts = (
        _share(record, record.qd, "velocity", "Joint speed"),
        _share(record, record.tau, "effort", "Joint torque"),
        _force(record),
        _height(record, data),
    )
    return [chart for chart in charts if chart is not None]


def joint_charts(record: Record, stage: Stage) -> list[Chart]:
    """One chart for each joint: its position, and its limits where they are near."""
    return [_joint(record, stage, i) for i in range(len(record.joints))]


def _shade(record: Record, joint: int) -> int:
    """Joints of the arm get the colours in order; those of the hand, and any beyond, are drawn quietly."""
    rank = record.arm.index(joint) if joint in record.arm else SHADES
    return rank if rank < SHADES else -1


def _share(record: Record, values: Array, limit: str, title: str) -> Chart | None:
    """Every joint as a percentage of its own limit."""
    bound = record.limits[limit]
    limited = [i for i in range(len(record.joints)) if np.isfinite(bound[i]) and bound[i] > 0.0]
    if not limited:
        return None
    order = [*[i for i in limited if _shade(record, i) < 0], *[i for i in limited if _shade(record, i) >= 0]]
    lines = [Line(record.joints[i], 100.0 * values[:, i] / bound[i], _shade(record, i)) for i in order]
    peaks = [float(np.abs(line.values).max()) for line in lines]
    worst = int(np.argmax(peaks))
    reach = max(peaks[worst], 20.0)
    note = f"peak {peaks[worst]:.0f} % at {lines[worst].label}"
    high = 105.0 if reach > 60.0 else 1.1 * reach
    return Chart(
        f"{title}, share of the limit", "%", record.time, lines, limits=((100.0, "limit"), (-100.0, "")),
        bands=record.bands, low=-max(high, reach * 1.02), high=max(high, reach * 1.02), note=note,
    )  # fmt: skip


def _force(record: Record) -> Chart:
    peak = float(record.force.max())
    return Chart(
        "Net force of the hand on the object", "N", record.time, [Line("force", record.force)],
        bands=record.bands, low=0.0, high=max(1.1 * peak, 1.0), note=f"peak {peak:.1f} N", digits=2,
    )  # fmt: skip


def _height(record: Record, data: Mapping[str, Any]) -> Chart | None:
    goal = data["scene"].get("goal") or {}
    poses = record.bodies.get(goal.get("body", ""))
    if poses is None:
        return None
    end = np.asarray(goal["pose"])[:3, 3]
    away = 1e3 * np.linalg.norm(poses[:, :3, 3] - end, axis=1)
    lift = 1e3 * (poses[:, 2, 3] - poses[0, 2, 3])
    lines = [Line("height above its start", lift, 0), Line("distance to the goal", away, 1)]
    return Chart(
        f"Where {goal['body']} is", "mm", record.time, lines, bands=record.bands,
        note=f"raised {lift.max():.0f} mm, ends {away[-1]:.2f} mm from the goal",
    )  # fmt: skip


def _joint(record: Record, stage: Stage, joint: int) -> Chart:
    """One joint's position in degrees or millimetres, with its limits where they are near."""
    name = record.joints[joint]
    factor, unit = 180.0 / np.pi, "°"
    if stage.robot is not None and stage.robot.description.joint(name).type is JointType.PRISMATIC:
        factor, unit = 1e3, "mm"
    values = factor * record.q[:, joint]
    lower, upper = factor * record.limits["lower"][joint], factor * record.limits["upper"][joint]
    low, high = float(values.min()), float(values.max())
    span = max(high - low, 1e-3 * abs(high) + 1e-9, 10.0 if unit == "°" else 2.0)
    low, high = 0.5 * (low + high) - 0.6 * span, 0.5 * (low + high) + 0.6 * span
    # a limit that is close comes into view
    if np.isfinite(lower) and lower > low - 0.6 * span:
        low = min(low, lower - 0.08 * span)
    if np.isfinite(upper) and upper < high + 0.6 * span:
        high = max(high, upper + 0.08 * span)
    room = min(float(values.min()) - lower, upper - float(values.max()))
    if not np.isfinite(room):
        note = "no limits"
    elif room < 0.0:
        note = f"passes a limit by {-room:.2g} {unit}"
    else:
        note = f"{room:.3g} {unit} from the nearest limit"
    return Chart(
        name, unit, record.time, [Line(name, values, max(_shade(record, joint), 0))],
        limits=[(v, label) for v, label in ((lower, "lower limit"), (upper, "upper limit")) if np.isfinite(v)],
        low=low, high=high, note=note.replace(" °", "°"), digits=2,
    )  # fmt: skip
