"""A pinhole camera, and the depth images that it makes.

Camera frames are optical: z forward along the axis, x to the right of the image, y down. Pixel (u, v) counts columns
and rows; its centre is at (u + ½, v + ½). Depth is the z coordinate, not the length of the ray; 0 means no return.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, as_array, as_pose, as_vector
from ..errors import InputError


@dataclass(frozen=True)
class Camera:
    """Focal lengths and principal point in pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise InputError(f"the image is {self.width} × {self.height} pixels; expected at least 1 × 1")
        for name in ("fx", "fy"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise InputError(f"{name} is {getattr(self, name)} pixels; a focal length is positive")
        if not np.isfinite([self.cx, self.cy]).all():
            raise InputError(f"the principal point is ({self.cx}, {self.cy}); expected finite pixels")

    @staticmethod
    def from_fov(width: int = 640, height: int = 480, fov: float = math.radians(60.0)) -> Camera:
        """Square pixels and a centred axis, with the horizontal field of view *fov* in rad."""
        if not 0.0 < fov < math.pi:
            raise InputError(f"fov is {fov} rad; expected more than 0 and less than π")
        f = 0.5 * width / math.tan(0.5 * fov)
        return Camera(width, height, f, f, 0.5 * width, 0.5 * height)

    @cached_property
    def rays(self) -> Array:
        """Directions (H, W, 3) of the pixels in the camera frame, scaled so that z = 1."""
        u = (np.arange(self.width) + 0.5 - self.cx) / self.fx
        v = (np.arange(self.height) + 0.5 - self.cy) / self.fy
        out = np.ones((self.height, self.width, 3))
        out[..., 0], out[..., 1] = u, v[:, None]
        return out

    def project(self, points: ArrayLike) -> Array:
        """Image coordinates (..., 2) of points (..., 3) in the camera frame; the points must lie in front of it."""
        p = as_array(points, "points")
        if p.size and not (p[..., 2] > 0.0).all():
            raise InputError(f"a point has z = {p[..., 2].min():.4g} m; only points in front of the camera project")
        u = self.fx * p[..., 0] / p[..., 2] + self.cx
        v = self.fy * p[..., 1] / p[..., 2] + self.cy
        return np.stack([u, v], axis=-1)


@dataclass(frozen=True, eq=False)
class DepthImage:
    """Depth (H, W) in m seen by *camera* at *pose* (T_world_camera); 0 where there is no return.

    *known* marks pixels that show something whose place is known anyway, such as the robot itself.
    """

    depth: Array
    camera: Camera
    pose: Array
    known: BoolArray | None = None

    def __post_init__(self) -> None:
        depth = as_array(self.depth, "depth")
        shape = (self.camera.height, self.camera.width)
        if depth.shape != shape:
            raise InputError(f"depth has shape {depth.shape}; the camera makes images of {shape}")
        if (depth < 0.0).any():
            raise InputError(f"depth holds {depth.min():.4g} m; it is positive, or 0 where there is no return")
        pose = as_pose(self.pose, "pose")
        if pose.shape != (4, 4):
            raise InputError(f"pose has shape {pose.shape}; expected (4, 4)")
        if self.known is not None and np.shape(self.known) != shape:
            raise InputError(f"known has shape {np.shape(self.known)}; expected {shape}")
        object.__setattr__(self, "depth", depth)
        object.__setattr__(self, "pose", pose)

    @property
    def valid(self) -> BoolArray:
        """Pixels (H, W) with a return from something unknown."""
        seen: BoolArray = self.depth > 0.0
        return seen if self.known is None else seen & ~np.asarray(self.known, dtype=bool)

    def points(self) -> Array:
        """Points (H, W, 3) in the world; meaningless where there is no return (see `valid`)."""
        local = self.camera.rays * self.depth[..., None]
        return np.asarray(local @ self.pose[:3, :3].T + self.pose[:3, 3])

    def with_noise(self, rng: np.random.Generator, noise: Noise | None = None) -> DepthImage:
        """The image as a real sensor might give it."""
        return (noise or Noise()).apply(self, rng)


@dataclass(frozen=True)
class Noise:
    """Noise of a structured-light depth sensor.

    Axial noise has the standard deviation ``floor + growth (z − 0.4 m)²`` (Nguyen, Izadi and Lovell, 3DIMPVT 2012, with
    floor 1.2 mm and growth 1.9 mm/m²; the default floor is that of present sensors at arm's length). Edges jitter by
    *lateral* pixels. Surfaces seen under less than *grazing* (rad) and a share *dropout* of all pixels give no return.
    """

    floor: float = 0.0007
    growth: float = 0.0019
    lateral: float = 0.5
    grazing: float = math.radians(8.0)
    dropout: float = 0.002

    def apply(self, image: DepthImage, rng: np.random.Generator) -> DepthImage:
        """A noisy copy of *image*; the same generator state gives the same noise."""
        h, w = image.depth.shape
        jitter = np.rint(rng.normal(0.0, max(self.lateral, 1e-12), (2, h, w))).astype(np.int64)
        rows = np.clip(np.arange(h)[:, None] + jitter[0], 0, h - 1)
        columns = np.clip(np.arange(w) + jitter[1], 0, w - 1)
        depth = image.depth[rows, columns]
        # a pixel keeps its own depth within a surface; only edges move
        same = np.abs(depth - image.depth) < 0.02 * np.maximum(image.depth, 1e-9)
        depth = np.where(same, image.depth, depth)
        sigma: Array = self.floor + self.growth * np.maximum(depth - 0.4, 0.0) ** 2
        lost = (depth == 0.0) | _grazing(image, self.grazing) | (rng.random((h, w)) < self.dropout)
        noisy = np.maximum(depth + sigma * rng.normal(size=(h, w)), 0.0)
        return replace(image, depth=np.where(lost, 0.0, noisy))


def _grazing(image: DepthImage, angle: float) -> BoolArray:
    """Pixels whose surface, from neighbouring pixels, is seen under less than *angle*."""
    p = image.camera.rays * image.depth[..., None]
    along = np.gradient(p, axis=1), np.gradient(p, axis=0)
    normal = np.cross(*along)
    length: Array = np.linalg.norm(normal, axis=-1) * np.linalg.norm(p, axis=-1)
    sine = np.abs((normal * p).sum(axis=-1)) / np.maximum(length, 1e-300)
    return np.asarray((image.depth > 0.0) & (length > 0.0) & (sine < math.sin(angle)))


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> Array:
    """T_world_camera (4, 4) of a camera at *eye* whose axis goes through *target*, the image upright along *up*."""
    a, b, u = (as_vector(value, name, 3) for value, name in ((eye, "eye"), (target, "target"), (up, "up")))
    z = b - a
    if not np.linalg.norm(z) > 0.0:
        raise InputError("eye and target are the same point; a camera needs a direction")
    z = z / np.linalg.norm(z)
    x = np.cross(z, u)
    if float(np.linalg.norm(x)) <= 1e-9 * float(np.linalg.norm(u)):
        x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])  # looking along up: any roll will do
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = x, np.cross(z, x), z, a
    return T
