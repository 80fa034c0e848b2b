"""How well a pose explains depth images: fit where the object is seen, and free space where it is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from .camera import DepthImage
from .mesh import ModelSurface
from .segment import Group, Plane

CAP = 9.0  # cost of a pixel that the pose does not explain: three standard deviations, squared


@dataclass(frozen=True)
class Fit:
    """Agreement of a pose with the images.

    *cost* is the mean over all pixels that show the object or that the pose says should, of the squared deviation in
    standard deviations, at most `CAP`. *fitness* is the share of these pixels that the pose explains; *residual* the
    root mean square of their deviations in m.
    """

    cost: float
    fitness: float
    residual: float
    pixels: int


@dataclass(frozen=True, eq=False)
class Window:
    """The pixels of one view around the object, as rays: what the sensor said, and whether it was the object."""

    origin: Array  # (3,) camera in the world
    rays: Array  # (P, 3) in the world, scaled so that depth is the ray's parameter
    depth: Array  # (P,)
    sigma: Array  # (P,)
    on_object: BoolArray  # (P,)

    def thinned(self, count: int, rng: np.random.Generator) -> Window:
        """At most *count* of the pixels."""
        if len(self.depth) <= count:
            return self
        pick: IntArray = np.sort(rng.choice(len(self.depth), count, replace=False))
        return Window(self.origin, self.rays[pick], self.depth[pick], self.sigma[pick], self.on_object[pick])


def windows(views: Sequence[DepthImage], group: Group, margin: float, floor: float, growth: float) -> list[Window]:
    """The neighbourhood of *group* in every view, *margin* m wide; the noise is ``floor + growth (z − 0.4 m)²``."""
    out = []
    for view, mask in zip(views, group.masks, strict=True):
        local = (group.points - view.pose[:3, 3]) @ view.pose[:3, :3]
        local = local[local[:, 2] > 1e-3]
        if not len(local):
            continue
        image = view.camera.project(local)
        pad = margin * np.array([view.camera.fx, view.camera.fy]) / local[:, 2].min()
        low = np.maximum(np.floor(image.min(axis=0) - pad), 0).astype(int)
        high = np.minimum(np.ceil(image.max(axis=0) + pad), [view.camera.width, view.camera.height]).astype(int)
        if (high <= low).any():
            continue
        rows, columns = slice(low[1], high[1]), slice(low[0], high[0])
        valid = view.valid[rows, columns]
        depth = view.depth[rows, columns][valid]
        rays = view.camera.rays[rows, columns][valid] @ view.pose[:3, :3].T
        sigma = floor + growth * np.maximum(depth - 0.4, 0.0) ** 2
        out.append(Window(view.pose[:3, 3].copy(), rays, depth, sigma, mask[rows, columns][valid]))
    return out


def predicted(surface: ModelSurface, pose: Array, window: Window) -> Array:
    """Depth (P,) that the window's pixels would have on the body at *pose*; inf beside it."""
    R = pose[:3, :3]
    return surface.first_hits(R.T @ (window.origin - pose[:3, 3]), window.rays @ R)


def violations(window: Window, depth: Array, plane: Plane, clearance: float) -> BoolArray:
    """Pixels that look through the body at its predicted *depth*: it would stand where the sensor saw free space.

    The zone just above the plane does not count, since points there were taken for the plane's.
    """
    through = ~window.on_object & np.isfinite(depth) & (depth < window.depth - 3.0 * window.sigma)
    hit = window.origin + window.rays[through] * depth[through, None]
    through[through] = plane.height(hit) > 1.5 * clearance
    return through


def fit(surface: ModelSurface, pose: Array, around: Sequence[Window], plane: Plane, clearance: float) -> Fit:
    """Agreement of *pose* with all windows."""
    total = residual = 0.0
    pixels = explained = 0
    for window in around:
        depth = predicted(surface, pose, window)
        through = violations(window, depth, plane, clearance)
        seen = window.on_object
        with np.errstate(invalid="ignore"):
            deviation = np.where(np.isfinite(depth[seen]), depth[seen] - window.depth[seen], np.inf)
        tolerance = np.hypot(window.sigma[seen], 0.001)
        cost = np.minimum((deviation / tolerance) ** 2, CAP)
        good = cost < CAP
        total += float(cost.sum()) + CAP * int(through.sum())
        residual += float((deviation[good] ** 2).sum())
        explained += int(good.sum())
        pixels += int(seen.sum()) + int(through.sum())
    if not pixels:
        return Fit(CAP, 0.0, 0.0, 0)
    return Fit(total / pixels, explained / pixels, float(np.sqrt(residual / max(explained, 1))), pixels)
