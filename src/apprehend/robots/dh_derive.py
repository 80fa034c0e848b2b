"""The DH table of any chain, by the steps that script K gives for a sketch on paper.

1, 2: the joints of the chain are numbered. 3: their axes z_{i−1} are drawn, at q = 0. 4: a_i is the distance of two
neighbouring axes. 5: x_i lies along their common normal, x_i ∥ z_{i−1} × z_i. 6: α_i turns z_{i−1} into z_i about x_i.
7: d_i is the way along z_{i−1} from x_{i−1} to x_i. 8: θ_i turns x_{i−1} into x_i about z_{i−1}. 9: the matrices are
chained, between a constant base and tool, since four numbers cannot say where an arbitrary root and tip are.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Array, choice
from ..errors import InputError, unknown_name
from .description import Description, Joint, JointLimits, JointType
from .dh import CONVENTIONS, DHTable
from .poses import shift, turn

PARALLEL = 1e-9
"""Two axes are parallel if the sine of the angle between them is below this."""
COINCIDENT = 1e-10
"""Two axes meet if they pass each other by less than this, in m."""


def dh_table(description: Description, tip: str | None = None, convention: str = "standard") -> DHTable:
    """The DH table of the chain from the root to link *tip* (default: the tool frame, or the only leaf).

    Rows are the moving joints of the chain in order, mimicking ones included (their row takes the mimicked value).
    ``table.fk(q)`` equals the chain's forward kinematics at every q. Parallel axes leave d free: it is chosen 0. Axes
    that are almost parallel (by a sloppy angle in a file) meet far away, and make d large: the convention's own limit.
    """
    choice(convention, "convention", CONVENTIONS)
    chain = _chain(description, tip)
    T = np.eye(4)
    axes: list[tuple[Array, Array]] = []  # a point on the axis and its direction, at q = 0
    moving: list[Joint] = []
    for joint in chain:
        T = T @ joint.pose
        if joint.type is not JointType.FIXED:
            moving.append(joint)
            axes.append((T[:3, 3].copy(), T[:3, :3] @ joint.axis))
    if not moving:
        raise InputError(f"no joint moves between the root of {description.name!r} and its tip: there is no DH table")
    frame = base = _first_frame(*axes[0])
    rows = []
    for point, direction in [*axes[1:], (T[:3, 3], T[:3, 2])]:  # the last line is the z axis of the tip
        frame, row = _next_frame(frame, point, direction)
        rows.append(row)
    theta, d, a, alpha = (np.array(column) for column in zip(*rows, strict=True))
    tool = _inverse(frame) @ T
    if convention == "modified":  # the same numbers, shifted by one row
        tool = shift((a[-1], 0.0, 0.0)) @ turn(np.array([1.0, 0.0, 0.0]), float(alpha[-1])) @ tool
        a, alpha = np.concatenate([[0.0], a[:-1]]), np.concatenate([[0.0], alpha[:-1]])
    limits = tuple(j.limits if j.mimic is None else JointLimits() for j in moving)
    names, types = tuple(j.name for j in moving), tuple(j.type for j in moving)
    return DHTable(
        convention, names, types, theta, d, a, alpha, _tidy(base), _tidy(tool), limits=limits, name=description.name
    )


def _chain(description: Description, tip: str | None) -> list[Joint]:
    if tip is None:
        leaves = description.links.keys() - {j.parent for j in description.joints}
        if description.tool:
            tip = description.tool
        elif len(leaves) == 1:
            tip = next(iter(leaves))
        else:
            raise InputError(
                f"{description.name!r} has {len(leaves)} chains; pass tip= one of {', '.join(sorted(leaves)[:12])}"
            )
    if tip not in description.links:
        unknown_name("link", tip, description.links, f"robot {description.name!r}")
    carried = description.parent_joint
    chain: list[Joint] = []
    while tip != description.root:
        chain.insert(0, carried[tip])
        tip = carried[tip].parent
    return chain


def _first_frame(point: Array, z: Array) -> Array:
    """Frame 0: z along the first axis, origin at its point nearest to the root, x as near to the root's x as can be."""
    origin = point - z * float(z @ point)
    x = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
    x = x - z * float(x @ z)
    return _frame(origin, x / np.linalg.norm(x), z)


def _next_frame(frame: Array, point: Array, z_next: Array) -> tuple[Array, tuple[float, float, float, float]]:
    """Frame i on the line through *point* along *z_next*, and (θ, d, a, α) that lead there from frame i − 1."""
    origin, x, z = frame[:3, 3], frame[:3, 0], frame[:3, 2]
    normal = np.cross(z, z_next)
    sine = float(np.linalg.norm(normal))
    if sine < PARALLEL:
        d = 0.0
        across = point - origin
        across = across - z * float(z @ across)
        a = float(np.linalg.norm(across))
        x_next = x if a < COINCIDENT else across / a
        a = 0.0 if a < COINCIDENT else a
    else:
        x_next = normal / sine
        gap = point - origin
        a = float(x_next @ gap)
        # the foot of the common normal on the axis z: solve d z + a x_next + s z_next = gap for d
        d = float(np.cross(gap, z_next) @ x_next) / sine
        a = 0.0 if abs(a) < COINCIDENT else a
    theta = math.atan2(float(z @ np.cross(x, x_next)), float(x @ x_next))
    alpha = math.atan2(float(x_next @ np.cross(z, z_next)), float(z @ z_next))
    following = (
        frame @ turn(np.array([0.0, 0.0, 1.0]), theta) @ shift((a, 0.0, d)) @ turn(np.array([1.0, 0.0, 0.0]), alpha)
    )
    return following, (_round(theta), _round(d), a, _round(alpha))


def _frame(origin: Array, x: Array, z: Array) -> Array:
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = x, np.cross(z, x), z, origin
    return T


def _inverse(T: Array) -> Array:
    inverse = np.eye(4)
    inverse[:3, :3] = T[:3, :3].T
    inverse[:3, 3] = -T[:3, :3].T @ T[:3, 3]
    return inverse


def _round(value: float) -> float:
    """Exactly zero for what is zero but for rounding."""
    return 0.0 if abs(value) < 1e-13 else value


def _tidy(T: Array) -> Array:
    clean: Array = np.where(np.abs(T) < 1e-13, 0.0, T)
    return np.where(np.abs(clean - 1.0) < 1e-13, 1.0, clean)
