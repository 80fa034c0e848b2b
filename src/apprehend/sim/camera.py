"""Depth cameras in the simulated world, by rays: no graphics library, the same numbers everywhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_pose
from ..errors import InputError
from ..perception import Camera, DepthImage, Noise
from .shapes import HIDDEN_GROUP, ROBOT

if TYPE_CHECKING:
    from .world import World

FAR = 20.0  # m; nothing beyond is seen


@dataclass(frozen=True, eq=False)
class View:
    """What a simulated camera sees: depth, and which link, body or box each pixel shows."""

    image: DepthImage
    labels: IntArray  # (H, W) index into *names*, −1 where nothing is
    names: tuple[str, ...]

    def shows(self, name: str) -> BoolArray:
        """Pixels (H, W) that show the link, body or box *name*."""
        if name not in self.names:
            return np.zeros(self.labels.shape, dtype=bool)
        return np.asarray(self.labels == self.names.index(name))

    @property
    def pixels(self) -> Mapping[str, int]:
        """Number of pixels of everything that is seen."""
        found, counts = np.unique(self.labels[self.labels >= 0], return_counts=True)
        return {self.names[i]: int(c) for i, c in zip(found, counts, strict=True)}


def look(
    world: World,
    camera: Camera,
    pose: ArrayLike,
    *,
    link: str | None = None,
    noise: Noise | None = None,
) -> View:
    """The view of *camera* at *pose*: T_world_camera, or T_link_camera for a camera that *link* carries.

    Pixels of the robot are marked as known in the image: its joints say where it is. *noise* draws from the world's
    generator. Links are seen as their collision meshes, bodies as their whole meshes.
    """
    T = as_pose(pose, "pose")
    if T.shape != (4, 4):
        raise InputError(f"pose has shape {T.shape}; expected (4, 4)")
    if link is not None:
        T = world.frame(link) @ T
    rays = camera.rays @ T[:3, :3].T
    length = np.linalg.norm(rays, axis=-1)
    directions = np.ascontiguousarray(rays / length[..., None]).reshape(-1, 1)
    count = length.size
    geoms, distance = np.full(count, -1, dtype=np.int32), np.zeros(count)
    seen = np.array([group < HIDDEN_GROUP for group in range(mujoco.mjNGROUP)], dtype=np.uint8)
    mujoco.mj_multiRay(
        world.model, world.data, T[:3, 3], directions, seen, 1, -1, geoms, distance, None, count, FAR
    )  # fmt: skip
    hit = geoms >= 0
    depth = np.where(hit, distance / length.ravel(), 0.0).reshape(length.shape)
    owner = np.where(hit, world.model.geom_bodyid[np.maximum(geoms, 0)], -1).reshape(length.shape)
    known = (owner >= 0) & (world.plant.kinds[np.maximum(owner, 0)] == ROBOT)
    image = DepthImage(depth, camera, T, known)
    if noise is not None:
        image = noise.apply(image, world.rng)
    return View(image, owner.astype(np.int64), world.plant.owners)


def hand_camera(world: World, root: str, tcp: Array, *, back: float = 0.0, side: float = 0.07) -> Array:
    """T_root_camera of a camera on the hand with base link *root*, beside the palm, that looks at the tcp.

    *tcp* is T_root_tcp; the camera sits *side* m off along the tcp's y, *back* m behind the hand's root.
    """
    from ..perception import look_at

    target = tcp[:3, 3]
    eye = tcp[:3, 3] - tcp[:3, 2] * (tcp[:3, 3] @ tcp[:3, 2] + back) + tcp[:3, 1] * side
    return look_at(eye, target, tcp[:3, 1])
