"""Pictures without a graphics card: meshes with poses and colours, seen by a camera, as an RGB array or a PNG.

The machine that runs a process is often headless, so reports are drawn by our own rasteriser (`kernels.raster`):
smooth normals, one sun with soft shadows, ambient light that corners and contacts keep out, four samples per pixel.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import parallel
from ..arrays import Array, IntArray, as_pose, as_shaped
from ..errors import InputError
from ..kernels import raster

Image = NDArray[np.uint8]
"""``(height, width, 3)`` sRGB."""

SAMPLES = 2
"""Supersampling along each axis."""
SHADOW_PIXELS = 1400
"""Side of the shadow map."""
CREASE = math.radians(35.0)
"""Faces that meet at a smaller angle are shaded as one smooth surface."""
SUN_AZIMUTH, SUN_ELEVATION = math.radians(-75.0), math.radians(52.0)
"""Where the sun stands, seen from the camera's side of the scene."""
BACKGROUND = ((0.93, 0.945, 0.96), (0.80, 0.83, 0.87))
"""sRGB at the top and at the bottom of the picture."""


@dataclass(frozen=True, eq=False)
class Item:
    """A mesh to be drawn: ``vertices (V, 3)``, ``faces (F, 3)``, its pose in the world and its colour (sRGB, alpha)."""

    vertices: Array
    faces: IntArray
    pose: Array = field(default_factory=lambda: np.eye(4))
    rgba: tuple[float, float, float, float] = (0.7, 0.7, 0.72, 1.0)
    gloss: float = 0.35
    shadow: bool = True
    normals: Array | None = None
    """Corner normals ``(F, 3, 3)`` from `smooth_normals`, where they are known already."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Where the picture is taken from: *eye* and *target* in m, and the vertical field of view in rad."""

    eye: Array
    target: Array
    field_of_view: float = math.radians(32.0)

    @classmethod
    def around(
        cls,
        points: ArrayLike,
        *,
        azimuth: float = math.radians(-50.0),
        elevation: float = math.radians(24.0),
        aspect: float = 1.5,
        field_of_view: float = math.radians(32.0),
        margin: float = 1.06,
    ) -> Camera:
        """The nearest camera that sees all *points* ``(n, 3)``, from *azimuth* about z and *elevation* above.

        With k the tangent of half the opening angle, a point at (x, z) across and along the line of sight is seen
        from distance D and offset c if |x − c| ≤ k (D + z), which the extremes of x − k z and x + k z decide.
        """
        points = as_shaped(points, "points", 3).reshape(-1, 3)
        away = np.array(
            [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
        )
        right, down, forward = _axes(-away)
        z, distance, centre = points @ forward, 1e-3 - float((points @ forward).min()), np.zeros(3)
        for axis, k in ((right, math.tan(field_of_view / 2.0) * aspect), (down, math.tan(field_of_view / 2.0))):
            x, k = points @ axis, k / margin
            high, low = float((x - k * z).max()), float((x + k * z).min())
            distance = max(distance, (high - low) / (2.0 * k))
            centre += 0.5 * (high + low) * axis
        middle = centre + 0.5 * float(z.min() + z.max()) * forward
        return cls(centre - distance * forward, middle, field_of_view)


def _axes(forward: Array) -> tuple[Array, Array, Array]:
    """Right, down and forward unit vectors of a camera that holds its head up."""
    forward = forward / np.linalg.norm(forward)
    side = np.array([0.0, 1.0, 0.0]) if abs(forward[2]) > 0.999 else np.array([0.0, 0.0, 1.0])
    right = np.cross(forward, side)
    right /= np.linalg.norm(right)
    return right, np.cross(forward, right), forward


def render(
    items: Sequence[Item],
    camera: Camera | None = None,
    *,
    size: tuple[int, int] = (960, 640),
    floor: bool = True,
    focus: tuple[Array, Array] | None = None,
    background: tuple[tuple[float, float, float], tuple[float, float, float]] = BACKGROUND,
) -> Image:
    """The picture ``(height, width, 3)`` of *items*, *size* = (width, height) in pixels.

    *focus* is the box (low, high) that matters: shadows are finest there, and without a *camera* one is placed that
    sees it; by default everything. *floor* lays a ground under the lowest point.
    Items with an alpha below one are drawn over the rest, where they are in front; those of one alpha hide each other.
    """
    width, height = size
    if not (16 <= width <= 8192 and 16 <= height <= 8192):
        raise InputError(f"size is {size}; expected (width, height) between 16 and 8192 pixels")
    if not items:
        raise InputError("there is nothing to draw: items is empty")
    everything = bounds(items)
    low, high = everything if focus is None else focus
    ground = [_ground(*everything)] if floor else []
    if camera is None:
        camera = Camera.around(corners_of(low, high), aspect=width / height)
    solid = [item for item in items if item.rgba[3] >= 1.0]
    light = _Light.of(ground + solid, camera, (low, high))
    base, depth = _layer(ground + solid, camera, size, light)
    rows = np.linspace(0.0, 1.0, height * SAMPLES)[:, None, None]
    backdrop = _linear(np.array(background[0])) * (1.0 - rows) + _linear(np.array(background[1])) * rows
    backdrop = np.broadcast_to(backdrop, base.shape)
    image = np.where(np.isinf(depth)[..., None], backdrop, base)
    if floor:
        image = _into_the_distance(image, depth, backdrop, camera, *everything)
    for alpha in sorted({item.rgba[3] for item in items if item.rgba[3] < 1.0}, reverse=True):
        group = [item for item in items if item.rgba[3] == alpha]
        over, over_depth = _layer(group, camera, size, light, shut_in=False)
        front = over_depth < depth
        image[front] = (1.0 - alpha) * image[front] + alpha * over[front]
    small = np.empty((height, width, 3))
    parallel.over_ranges(lambda a, b: raster.average(image, SAMPLES, a, b, small), height, 16)
    return np.asarray(np.clip(_encoded(small) * 255.0 + 0.5, 0.0, 255.0), dtype=np.uint8)


def bounds(items: Sequence[Item]) -> tuple[Array, Array]:
    """Lower and upper corner of the box around *items*."""
    points = [_placed(item) for item in items]
    return np.min([p.min(axis=0) for p in points], axis=0), np.max([p.max(axis=0) for p in points], axis=0)


def corners_of(low: Array, high: Array) -> Array:
    """The eight corners of a box."""
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def png(image: Image) -> bytes:
    """*image* as a PNG file."""
    from PIL import Image as Pillow

    buffer = io.BytesIO()
    Pillow.fromarray(image).save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


def jpeg(image: Image, quality: int = 88) -> bytes:
    """*image* as a JPEG file."""
    from PIL import Image as Pillow

    buffer = io.BytesIO()
    Pillow.fromarray(image).save(buffer, format="JPEG", quality=quality, optimize=True, subsampling=0)
    return buffer.getvalue()


def _placed(item: Item) -> Array:
    pose = as_pose(item.pose, "pose of an item")
    return np.asarray(item.vertices @ pose[:3, :3].T + pose[:3, 3])


def _ground(low: Array, high: Array) -> Item:
    middle, reach = 0.5 * (low + high), 12.0 * float(np.linalg.norm(high - low))
    square = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]) * reach
    square += [middle[0], middle[1], low[2] - 1e-4]
    return Item(square, np.array([[0, 1, 2], [0, 2, 3]]), rgba=(0.90, 0.91, 0.925, 1.0), gloss=0.0, shadow=False)


def _into_the_distance(image: Array, depth: Array, backdrop: Array, camera: Camera, low: Array, high: Array) -> Array:
    """Let the ground fade into the backdrop beyond what is to be seen."""
    near = float(np.linalg.norm(camera.eye - 0.5 * (low + high))) + 0.5 * float(np.linalg.norm(high - low))
    share = np.clip((np.where(np.isinf(depth), 1e9, depth) - near) / (1.5 * near), 0.0, 1.0)[..., None]
    share = share * share * (3.0 - 2.0 * share)
    return np.asarray(image * (1.0 - share) + backdrop * share)


def _linear(srgb: Array) -> Array:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _encoded(linear: Array) -> Array:
    x = np.clip(linear, 0.0, None)
    x = np.where(x < 0.8, x, 0.8 + 0.2 * np.tanh((x - 0.8) / 0.2))  # bright spots roll off instead of clipping
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055)


@dataclass(frozen=True, eq=False)
class _Light:
    """The sun and what it reaches: rows ``(3, 4)`` from the world to pixel and depth of the shadow map."""

    sun: Array
    rows: Array
    depth: Array
    texel: float  # size of a pixel of the map in m
    radius: float  # of the surroundings that keep ambient light out, in m

    @classmethod
    def of(cls, items: Sequence[Item], camera: Camera, box: tuple[Array, Array]) -> _Light:
        """The shadows of *items*, finest in *box*; the sun is high on the camera's left."""
        away = camera.eye - camera.target
        azimuth = math.atan2(away[1], away[0]) + SUN_AZIMUTH
        flat = math.cos(SUN_ELEVATION)
        sun = np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(SUN_ELEVATION)])
        right, down, forward = _axes(-sun)
        middle, size = 0.5 * (box[0] + box[1]), float(np.linalg.norm(box[1] - box[0])) + 1e-6
        scale = SHADOW_PIXELS / (1.02 * size)
        rows = np.zeros((3, 4))
        rows[0, :3], rows[0, 3] = scale * right, 0.5 * SHADOW_PIXELS - scale * (right @ middle)
        rows[1, :3], rows[1, 3] = scale * down, 0.5 * SHADOW_PIXELS - scale * (down @ middle)
        rows[2, :3] = forward
        depth, face, bary = raster.empty_buffers(SHADOW_PIXELS, SHADOW_PIXELS)
        casting = [_placed(item)[item.faces] for item in items if item.shadow]
        if casting:
            corners = np.concatenate(casting)
            screen = np.ones(corners.shape)
            screen[..., :2] = corners @ rows[:2, :3].T + rows[:2, 3]
            z = np.ascontiguousarray(corners @ forward)
            parallel.over_ranges(lambda a, b: raster.rasterise(screen, z, a, b, depth, face, bary), SHADOW_PIXELS, 64)
        return cls(sun, rows, depth.astype(np.float32), 1.0 / scale, 0.08 * size)


def _layer(
    items: Sequence[Item], camera: Camera, size: tuple[int, int], light: _Light, *, shut_in: bool = True
) -> tuple[Array, Array]:
    """Linear colours and depths of all samples; *shut_in* says whether corners keep ambient light out."""
    width, height = size[0] * SAMPLES, size[1] * SAMPLES
    out = np.zeros((height, width, 3))
    depth, face, bary = raster.empty_buffers(height, width)
    if not items:
        return out, depth
    corners = np.concatenate([_placed(item)[item.faces] for item in items])
    normals = np.concatenate([_corner_normals(item) for item in items])
    counts = [len(item.faces) for item in items]
    colour = np.repeat(_linear(np.array([item.rgba[:3] for item in items], dtype=np.float64)), counts, axis=0)
    gloss = np.repeat(np.array([item.gloss for item in items], dtype=np.float64), counts)

    right, down, forward = _axes(camera.target - camera.eye)
    focal = 0.5 * height / math.tan(camera.field_of_view / 2.0)
    screen = (corners - camera.eye) @ np.stack([right, down, forward], axis=1)
    z = np.ascontiguousarray(screen[..., 2])
    screen[..., 0] = focal * screen[..., 0] + 0.5 * width * z
    screen[..., 1] = focal * screen[..., 1] + 0.5 * height * z
    point, normal = np.zeros((height, width, 3)), np.zeros((height, width, 3))
    eye = np.ascontiguousarray(camera.eye, dtype=np.float64)

    def draw(a: int, b: int) -> None:
        raster.rasterise(screen, z, a, b, depth, face, bary)
        raster.surface(face, bary, corners, normals, eye, a, b, point, normal)

    parallel.over_ranges(draw, height, 64)
    sky = _open_sky(depth, point, normal, focal, light.radius) if shut_in else np.ones((height, width))
    step, taps = 2.0 * light.texel, raster.spirals(16, 12, 0.5)

    def colour_in(a: int, b: int) -> None:
        raster.shade(
            face, point, normal, sky, colour, gloss, eye, light.sun, light.rows, light.depth, step, 5.0, taps, a, b, out
        )  # fmt: skip

    parallel.over_ranges(colour_in, height, 64)
    return out, depth


def _open_sky(depth: Array, point: Array, normal: Array, focal: float, radius: float) -> Array:
    """How open the sky is at every sample, computed once per pixel and spread."""
    half = slice(None, None, SAMPLES)
    small = np.ascontiguousarray(depth[half, half], dtype=np.float32)
    points = np.ascontiguousarray(point[half, half], dtype=np.float32)
    normals = np.ascontiguousarray(normal[half, half], dtype=np.float32)
    spiral = raster.spirals(9, 12, 1.0)
    seen, out = np.empty(small.shape, dtype=np.float32), np.empty(depth.shape)
    parallel.over_ranges(
        lambda a, b: raster.occlusion(small, points, normals, focal / SAMPLES, radius, spiral, a, b, seen),
        len(small),
        32,
    )
    parallel.over_ranges(lambda a, b: raster.spread(seen, small, depth, SAMPLES, radius, a, b, out), len(depth), 64)
    return out


def _corner_normals(item: Item) -> Array:
    """Unit normals ``(F, 3, 3)`` at the corners, in the world."""
    pose = np.asarray(item.pose, dtype=np.float64)
    normals = smooth_normals(item.vertices, item.faces) if item.normals is None else item.normals
    return np.asarray(normals @ pose[:3, :3].T)


def smooth_normals(vertices: Array, faces: IntArray) -> Array:
    """Normals ``(F, 3, 3)`` at the corners of the faces; edges sharper than `CREASE` stay sharp.

    Every corner averages, weighted by area, the faces at its vertex that are within the crease angle of its own.
    """
    triangles = vertices[faces]
    area = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(area, axis=1)
    unit = area / np.maximum(size, 1e-30)[:, None]
    # vertices at one place count as one, since exporters split them
    _, merged = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)
    at = merged.reshape(-1)[faces].reshape(-1)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(at, kind="stable")
    starts = np.flatnonzero(np.r_[True, at[order][1:] != at[order][:-1]])
    lengths = np.diff(np.r_[starts, len(order)])
    # all pairs (corner, face) that meet at one place
    group = np.repeat(np.arange(len(starts)), lengths)
    first = np.repeat(np.arange(len(order)), lengths[group])
    offset = np.arange(len(first)) - np.repeat(np.cumsum(np.r_[0, lengths[group][:-1]]), lengths[group])
    second = starts[group][first] + offset
    one, two = order[first], owner[order[second]]
    near = np.einsum("ij,ij->i", unit[owner[one]], unit[two]) > math.cos(CREASE)
    total = np.empty((3 * len(faces), 3))
    for k in range(3):
        total[:, k] = np.bincount(one[near], area[two[near], k], minlength=3 * len(faces))
    length = np.linalg.norm(total, axis=1)
    flat = length < 1e-30
    total[flat], length[flat] = [0.0, 0.0, 1.0], 1.0
    return np.asarray((total / length[:, None]).reshape(-1, 3, 3))
