"""How a hand sits on a flange where nobody says it: fingers away from the flange, palm in front of it."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..errors import ApprehendError
from ..robots.meshes import link_surface
from .hand import Hand
from .robot import Robot

INSIDE = 0.03
"""A root frame with more of the palm than that behind it, in m, lies inside the palm, not on its mounting face."""


def mounting(hand: Robot) -> Array:
    """T_flange_hand ``(4, 4)`` of the root of *hand* on a flange whose z axis points out of the arm.

    The axis of the root's frame along which the fingers reach is turned, by the smallest rotation, to the flange's z. A
    root frame is the mounting face unless `INSIDE` or more of what does not move lies behind it; then the rearmost of
    that does. The identity for a tool without fingers.
    """
    T = np.eye(4)
    try:
        fingers = Hand(hand).fingers
    except ApprehendError:
        return T
    q = np.clip(np.zeros(hand.n), hand.limits.lower, hand.limits.upper)
    tips = [hand.fk(q, f.tip) @ np.append(f.tip_point, 1.0) for f in fingers]
    reach = np.mean(tips, axis=0)[:3]
    axis = np.zeros(3)
    axis[np.argmax(np.abs(reach))] = np.sign(reach[np.argmax(np.abs(reach))])
    T[:3, :3] = _to_z(axis)
    still = [_points(hand, name) for name in hand.frame_names if not hand.chain(name)]
    heights = np.concatenate([np.zeros(1), *(points @ axis for points in still)])
    if heights.min() < -INSIDE:
        T[2, 3] = -heights.min()
    return T


def _points(hand: Robot, link: str) -> Array:
    """Vertices ``(V, 3)`` of a link that does not move, in the root's frame."""
    points, _ = link_surface(hand.description.links[link], visual=False)
    pose = hand.fk(hand.home, link)
    moved: Array = points.reshape(-1, 3) @ pose[:3, :3].T + pose[:3, 3]
    return moved


def _to_z(axis: Array) -> Array:
    """The smallest rotation (3, 3) that turns a unit vector along a coordinate axis into z."""
    if axis[2] < -0.5:
        return np.diag([1.0, -1.0, -1.0])
    v = np.cross(axis, [0.0, 0.0, 1.0])
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    out: Array = np.eye(3) + K + K @ K / (1.0 + axis[2])
    return out
