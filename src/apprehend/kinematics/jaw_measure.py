"""The measures of a jaw whose pads are known: widths through the stroke, force, and room behind the pads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Array
from .gap import Grid, extent_along_lines
from .jaw import ParallelJaw
from .jaw_parts import Patch, Surfaces, approach
from .robot import Robot

SAMPLES = 129
"""Samples of the stroke."""
MAX_OPENING = np.radians(60.0)
"""Pads that turn count as facing each other up to this angle between them."""


def measure(surfaces: Surfaces, opened: Array, closed: Array, R: Array, patch: Patch) -> ParallelJaw | None:
    """Follow the pads through the stroke and measure width, force, depth."""
    robot = surfaces.robot
    path = closed + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (opened - closed)
    poses = [robot.fk(path, link) for link in patch.links]
    p0, p1 = [T[:, :3, :3] @ p + T[:, :3, 3] for T, p in zip(poses, patch.points, strict=True)]
    widths = np.linalg.norm(p0 - p1, axis=1)
    facing = np.einsum("kij,kij->k", *(T[:, :3, :3] @ T[0, :3, :3].T for T in poses))  # trace of the relative rotation
    good = (np.diff(widths) > 0) & (np.arccos(np.clip(0.5 * (facing[1:] - 1.0), -1.0, 1.0)) <= MAX_OPENING)
    stop = len(widths) if good.all() else int(np.argmin(good)) + 1
    if stop < 3:
        return None
    end = path[stop - 1]
    path = closed + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (end - closed)
    z = approach(surfaces, closed, R, patch)
    jaw = ParallelJaw(
        robot,
        max_width=float(widths[stop - 1]),
        min_width=float(widths[0]),
        pad_links=patch.links,
        pad_points=patch.points,
        pad_size=(0.0, 0.0),
        finger_depth=0.0,
        tip_length=0.0,
        max_force=0.0,
        _path=path,
        _widths=np.empty(0),
        _axes=np.stack([R[0], z]),
    )
    y = np.cross(z, R[0])
    size = [float(np.abs(R[1:] @ axis) @ (patch.high - patch.low)) for axis in (y, z)]
    slopes = np.abs(np.stack([_width_slope(jaw, q) for q in path]))
    forces = np.divide(_efforts(robot), slopes, out=np.full_like(slopes, np.inf), where=slopes > 1e-9)
    jaw = replace(jaw, pad_size=(size[0], size[1]), max_force=float(forces.min()), _widths=jaw.width_of(path))
    depth, tip = _depth(surfaces, jaw)
    return replace(jaw, finger_depth=depth, tip_length=tip)


def _efforts(robot: Robot) -> Array:
    """What each coordinate can exert ``(n,)``: its joint's limit, or less where its motors give less."""
    given = robot.limits.effort
    if not robot.description.actuators:
        return given
    motors = robot.transmission
    driven = (motors.matrix != 0.0).any(axis=1)
    return np.where(driven, np.abs(motors.torque_range()).max(axis=1), given)


def _width_slope(jaw: ParallelJaw, q: Array) -> Array:
    """∂width/∂q ``(n,)`` by central differences."""
    h = 1e-6 * np.maximum(np.abs(jaw._path[-1] - jaw._path[0]), 1e-3)
    plus, minus = q + np.diag(h), q - np.diag(h)
    p0, p1 = jaw.pads(np.concatenate([plus, minus]))
    axis = jaw._axes[0]
    apart = (p0 - p1) @ axis
    n = len(q)
    slope: Array = (apart[:n] - apart[n:]) / (2 * h)
    return slope


def _depth(surfaces: Surfaces, jaw: ParallelJaw) -> tuple[float, float]:
    """Free depth from the tcp back to the palm, and the reach of the fingers beyond it, at full width."""
    q = jaw._path[-1]
    T = jaw.tcp_at(jaw.max_width)
    R = np.stack([T[:3, 2], T[:3, 0], T[:3, 1]])  # lines run along z
    origin = R @ T[:3, 3]
    everything = surfaces.placed(q, frozenset(surfaces.triangles), R) - origin
    half = np.array([max(0.35 * jaw.max_width, 1e-3), max(0.5 * jaw.pad_size[0], 1e-3)])
    behind = everything[(everything[:, :, 0].min(axis=1) < 0.0)]
    grid = Grid.over(-half, half, 1e-3)
    _, top = extent_along_lines(behind, grid)
    top = top[np.isfinite(top)]
    fingers = surfaces.placed(q, set(jaw.pad_links), R) - origin
    tip = float(fingers[:, :, 0].max())
    low = -float(everything[:, :, 0].min())
    return (max(0.0, -float(top.max())) if len(top) else low), tip
