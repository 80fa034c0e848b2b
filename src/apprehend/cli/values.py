"""How numbers are typed on the command line: vectors with commas, degrees only where asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..conventions import DEGREE
from ..errors import InputError

if TYPE_CHECKING:
    from ..kinematics import Robot


def vector(text: str, name: str, n: int) -> Array:
    """``"0.1, 2, -3"`` as an array of *n* numbers."""
    try:
        values = np.array([float(part) for part in text.replace(",", " ").split()])
    except ValueError as error:
        raise InputError(f"{name} is {text!r}; expected {n} numbers with commas between them") from error
    if values.size != n:
        raise InputError(f"{name} has {values.size} numbers; expected {n}")
    if not np.isfinite(values).all():
        raise InputError(f"{name} is {text!r}; expected {n} finite numbers")
    return values


def joints(text: str | None, robot: Robot, deg: bool, option: str = "--q") -> Array:
    """Joint values in the order of ``robot.joint_names``; home where nothing is given. *deg*: angles in degrees."""
    if text is None:
        return robot.home.copy()
    q = vector(text, f"{option} (joints {', '.join(robot.joint_names)})", robot.n)
    if deg:
        turning = np.array([j.type.value != "prismatic" for j in robot.description.free_joints])
        q = np.where(turning, q * DEGREE, q)
    return q


def pose(xyz: str, rpy: str | None, deg: bool) -> Array:
    """A pose (4, 4) from a position in m and fixed-axis roll, pitch, yaw."""
    from ..spatial import Rotation

    T = np.eye(4)
    T[:3, 3] = vector(xyz, "--xyz", 3)
    if rpy is not None:
        T[:3, :3] = Rotation.from_rpy(vector(rpy, "--rpy", 3) * (DEGREE if deg else 1.0)).matrix
    return T
