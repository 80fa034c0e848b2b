"""What the search for a jaw works on: the surfaces of a hand in any posture, and the pads found on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..errors import DescriptionError
from ..robots.description import JointType
from ..robots.meshes import link_surface
from .robot import Robot


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Triangles of each link of a hand, in link frames; *moving* says which links its joints move."""

    robot: Robot
    triangles: dict[str, Array]
    moving: frozenset[str]

    def placed(self, q: Array, links: frozenset[str] | set[str], R: Array) -> Array:
        """Triangles ``(T, 3, 3)`` of *links* at joints *q*, in axes *R* ``(3, 3)`` (rows) of the hand frame."""
        parts = [np.empty((0, 3, 3))]
        for link in links:
            if link in self.triangles:
                T = self.robot.fk(q, link)
                parts.append((self.triangles[link] @ T[:3, :3].T + T[:3, 3]) @ R.T)
        return np.concatenate(parts)


@dataclass(frozen=True, eq=False)
class Patch:
    """The pads when closed, in the axes of the search: centres on both faces, extents, and the links they are on."""

    centre: Array  # (2, 3)
    low: Array  # (2,)
    high: Array  # (2,)
    links: tuple[str, str]
    points: Array  # (2, 3), the centres in the frames of their links


def surfaces_of(robot: Robot) -> Surfaces:
    """The surfaces of a hand; `DescriptionError` if nothing that moves has any."""
    description = robot.description
    moving: set[str] = set()
    for joint in description.joints:
        if joint.type is not JointType.FIXED or joint.parent in moving:
            moving.add(joint.child)
    triangles = {}
    for name, link in description.links.items():
        vertices, faces = link_surface(link)
        if not len(faces):  # a part without collision geometry is as large as it looks
            vertices, faces = link_surface(link, visual=True)
        if len(faces):
            triangles[name] = vertices[faces]
    if not triangles.keys() & moving or len(triangles) < 2:
        raise DescriptionError(f"hand {robot.name!r}: its fingers have no geometry, so that no jaw can be found")
    return Surfaces(robot, triangles, frozenset(moving))


def approach(surfaces: Surfaces, closed: Array, R: Array, patch: Patch) -> Array:
    """The direction away from the palm, perpendicular to the closing direction.

    From the middle of what does not move to the pads; turned to the nearest axis of the hand's or a pad's frame
    within 20 degrees, since the middle of a palm is rarely exactly behind the pads.
    """
    robot = surfaces.robot
    static = surfaces.placed(closed, frozenset(surfaces.triangles.keys() - surfaces.moving), np.eye(3))
    if not len(static):
        static = np.zeros((1, 3, 3))
    box = static.reshape(-1, 3)
    palm = 0.5 * (box.min(axis=0) + box.max(axis=0))
    x = R[0]
    tcp = R.T @ patch.centre.mean(axis=0)
    direction = tcp - palm
    direction = direction - x * (x @ direction)
    if np.linalg.norm(direction) < 1e-6:
        direction = R[2]
    direction /= np.linalg.norm(direction)
    frames = [np.eye(3), *(robot.fk(closed, link)[:3, :3] for link in patch.links)]
    axes = np.concatenate([f.T for f in frames])
    axes = np.concatenate([axes, -axes])
    axes = axes - np.outer(axes @ x, x)
    lengths = np.linalg.norm(axes, axis=1)
    axes = axes[lengths > 0.9] / lengths[lengths > 0.9, None]
    cosines = axes @ direction
    if len(axes) and cosines.max() > np.cos(np.radians(20)):
        direction = axes[int(np.argmax(cosines))]
    return np.asarray(direction, dtype=np.float64)
