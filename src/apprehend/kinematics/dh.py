"""Denavit–Hartenberg parameters of any chain, by K's nine steps, and the DH transforms.

K calls its convention a "modified variant of Waldron and Paul"; it is the standard (distal) one:
``A = R_z(θ) T_z(d) T_x(a) R_x(α)``. Craig's, ``A = R_x(α) T_x(a) R_z(θ) T_z(d)``, is called modified here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped
from ..errors import InputError
from ..kernels.chain import REVOLUTE
from ..robots.description import JointLimits
from ..robots.dh import DHChain, dh_transform, inverse_dh_transform
from ..spatial import se3
from .exponentials import ProductOfExponentials

__all__ = ["DHRow", "DHTable", "dh_table", "dh_transform", "inverse_dh_transform"]

if TYPE_CHECKING:
    from .robot import Robot

PARALLEL = 1e-9
"""Axes whose directions differ by less (sine of the angle) count as parallel."""


@dataclass(frozen=True)
class DHRow:
    """Parameters of one joint at joint value 0; the value adds to θ (revolute) or d (prismatic)."""

    joint: str
    type: str  # "revolute" or "prismatic"
    theta: float
    d: float
    a: float
    alpha: float


@dataclass(frozen=True, eq=False)
class DHTable:
    """``T(q) = base · A₁ … Aₘ · tool`` of one chain."""

    robot: str
    frame: str
    convention: str
    base: Array  # (4, 4), frame 0 in the world
    rows: tuple[DHRow, ...]
    tool: Array  # (4, 4), the chain's frame in frame m
    coordinate: tuple[int, ...]  # of each row in the robot's joint vector
    gain: Array  # (m, 2), multiplier and offset from coordinate to joint value
    n: int

    def frames(self, q: ArrayLike) -> Array:
        """Poses of the DH frames 0 … m, ``(..., m + 1, 4, 4)``, in the world."""
        q = as_shaped(q, "q", self.n)
        T = np.broadcast_to(self.base, (*q.shape[:-1], 4, 4))
        out = [T]
        for row, c, (gain, offset) in zip(self.rows, self.coordinate, self.gain, strict=True):
            value = gain * q[..., c] + offset
            turn, shift = (value, 0.0) if row.type == "revolute" else (0.0, value)
            T = T @ dh_transform(row.theta + turn, row.d + shift, row.a, row.alpha, self.convention)
            out.append(T)
        return np.stack(out, axis=-3)

    def fk(self, q: ArrayLike) -> Array:
        """Pose of the chain's frame ``(..., 4, 4)`` for ``q (..., n)``."""
        return np.asarray(self.frames(q)[..., -1, :, :] @ self.tool)

    def modified(self) -> DHTable:
        """The same chain in Craig's convention: ``T_x(a) R_x(α)`` of a row moves to the next, the last to the tool."""
        if self.convention == "modified":
            return self
        a, alpha = [0.0, *(r.a for r in self.rows)], [0.0, *(r.alpha for r in self.rows)]
        rows = tuple(replace(r, a=a[i], alpha=alpha[i]) for i, r in enumerate(self.rows))
        tool = dh_transform(0.0, 0.0, a[-1], alpha[-1]) @ self.tool
        return replace(self, convention="modified", rows=rows, tool=tool)

    def chain(self, robot: Robot) -> DHChain:
        """The table as a chain of its own, with the limits of *robot*, whose chain it is: for files (`save_dh`).

        A mimicking joint becomes a joint without limits.
        """
        joints = [robot.description.joint(row.joint) for row in self.rows]
        theta, d, a, alpha = np.array([[row.theta, row.d, row.a, row.alpha] for row in self.rows]).T
        return DHChain(
            self.convention,
            tuple(row.joint for row in self.rows),
            tuple(joint.type for joint in joints),
            theta,
            d,
            a,
            alpha,
            base=self.base,
            tool=self.tool,
            limits=tuple(JointLimits() if joint.mimic else joint.limits for joint in joints),
            name=self.robot,
            home={n: v for n, v in robot.description.home.items() if n in {row.joint for row in self.rows}},
        )

    def __str__(self) -> str:
        width = max([5, *(len(r.joint) for r in self.rows)])
        lines = [f"{self.robot}, {self.frame}: {self.convention} DH parameters (rad, m)"]
        lines.append(f"{'joint':<{width}}  type         θ           d           a           α")
        for r in self.rows:
            numbers = "  ".join(f"{v + 0.0:10.6g}" for v in (r.theta, r.d, r.a, r.alpha))
            lines.append(f"{r.joint:<{width}}  {r.type:<9}  {numbers}")
        return "\n".join(lines)


def dh_table(robot: Robot, frame: str) -> DHTable:
    """Standard DH parameters of the chain to *frame* by K's nine steps.

    1, 2: the chain at rest, its joints in order. 3: the axes z_{i−1}; that of a prismatic joint has only a direction
    and is laid through the next axis. 4–6: the common normals x_i (z_{i−1} × z_i; for parallel axes the normal
    through the last origin), their length a and the twist α. 7: d, 8: θ, at rest. 9: the transforms, in the
    `DHTable`. The z axis of the chain's frame takes the part of the axis after the last joint, so ``tool`` is a turn
    about and a shift along it. `InputError` if no joint moves the frame.
    """
    poe = ProductOfExponentials.of(robot, frame)
    model = robot.chain_model(frame)
    m = len(model.kind)
    if not m:
        raise InputError(f"no joint of robot {robot.name!r} moves frame {frame!r}: it has no DH parameters")
    z, p = _axes(poe, [int(k) == REVOLUTE for k in model.kind])
    x, origin = _first_frame(robot.base, z[0], p[0])
    frames = [_frame(x, z[0], origin)]
    rows: list[DHRow] = []
    names = _joint_names(robot, frame)
    for i in range(m):
        next_x, next_origin = _normal(z[i], p[i], z[i + 1], p[i + 1], x, origin)
        rows.append(
            DHRow(
                names[i],
                "revolute" if model.kind[i] == REVOLUTE else "prismatic",
                theta=_angle(x, next_x, z[i]),
                d=float((next_origin - origin) @ z[i]),
                a=float((next_origin - origin) @ next_x),
                alpha=_angle(z[i], z[i + 1], next_x),
            )
        )
        x, origin = next_x, next_origin
        frames.append(_frame(x, z[i + 1], origin))
    tool = se3.inverse(frames[-1]) @ poe.home
    table = (poe.coordinate, poe.gain, robot.n)
    return DHTable(robot.name, frame, "standard", frames[0], tuple(rows), tool, *table)


def _axes(poe: ProductOfExponentials, revolute: list[bool]) -> tuple[list[Array], list[Array]]:
    """Directions and points of the joints' axes and, last, of the chain's z axis."""
    z = [xi[3:] if r else xi[:3] for xi, r in zip(poe.twists, revolute, strict=True)]
    z.append(poe.home[:3, 2])
    p: list[Array] = [np.zeros(3)] * len(z)
    p[-1] = poe.home[:3, 3]
    for i in reversed(range(len(revolute))):
        p[i] = np.cross(z[i], poe.twists[i, :3]) if revolute[i] else p[i + 1]
    return z, p


def _first_frame(base: Array, z: Array, p: Array) -> tuple[Array, Array]:
    """x and origin of frame 0: the common normal with the base's z axis, or the base's own x where that is free."""
    x, origin = _normal(base[:3, 2], base[:3, 3], z, p, base[:3, 0], base[:3, 3])
    if math.hypot(*np.cross(base[:3, 2], z)) < PARALLEL:
        side = base[:3, 0] - (base[:3, 0] @ z) * z
        x = side / np.linalg.norm(side)
    return x, origin


def _normal(z0: Array, p0: Array, z1: Array, p1: Array, x0: Array, o0: Array) -> tuple[Array, Array]:
    """Direction of the common normal from axis 0 to axis 1, and its foot on axis 1."""
    cross = np.cross(z0, z1)
    sine = math.hypot(*cross)
    if sine >= PARALLEL:
        x = cross / sine
        # foot on axis 1: the point where the offset to axis 0 has no part along z0 × x
        side = np.cross(z0, x)
        return x, p1 - ((p1 - p0) @ side) / (z1 @ side) * z1
    foot = p1 + ((o0 - p1) @ z1) * z1
    offset = foot - o0
    offset = offset - (offset @ z0) * z0
    length = math.hypot(*offset)
    size = max(1e-3, math.hypot(*p0), math.hypot(*p1))
    if length <= 1e-12 * size:
        return x0 - (x0 @ z1) * z1, foot
    return offset / length, foot


def _frame(x: Array, z: Array, origin: Array) -> Array:
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = x, np.cross(z, x), z, origin
    return T


def _angle(first: Array, second: Array, axis: Array) -> float:
    """Angle from *first* to *second* about *axis*, in (−π, π]."""
    angle = math.atan2(float(np.cross(first, second) @ axis), float(first @ second))
    return math.pi if angle == -math.pi else angle


def _joint_names(robot: Robot, frame: str) -> list[str]:
    """Names of the moving joints from the root to *frame*."""
    carrier = robot.description.parent_joint
    names: list[str] = []
    while frame in carrier:
        joint = carrier[frame]
        if joint.type.value != "fixed":
            names.append(joint.name)
        frame = joint.parent
    return names[::-1]
