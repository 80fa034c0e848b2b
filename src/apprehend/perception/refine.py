"""Refinement of a pose by Gauss–Newton: points pull the surface, free space pushes it, the table carries it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..spatial import so3
from .evaluate import Window, predicted, violations
from .mesh import ModelSurface
from .segment import Plane

RESTING = 0.001  # m, standard deviation of the height at which a resting body stands on its plane
SPREAD = (0.05, 1.0)  # m and rad, standard deviations of the pose before anything was seen
THROUGH = 0.25  # weight of a pixel that looks through the body, against one that shows it


@dataclass(frozen=True, eq=False)
class Refined:
    """A pose and the information matrix (6, 6) of (translation, rotation) about the centre of mass, world axes."""

    pose: Array
    information: Array


class Refiner:
    """Improves poses of one body for one set of points and windows."""

    def __init__(
        self, surface: ModelSurface, points: Array, toward: Array, around: Sequence[Window], plane: Plane,
        clearance: float, *, sigma: float, resting: bool,
    ) -> None:  # fmt: skip
        from scipy.spatial import cKDTree

        self.surface, self.points, self.toward, self.around = surface, points, toward, around
        self.plane, self.clearance, self.sigma, self.resting = plane, clearance, sigma, resting
        self._tree = cKDTree(points)
        self._up = np.array(plane.normal)

    def refine(self, pose: Array, steps: int, start: float = 0.02, end: float = 0.004) -> Refined:
        """Take *steps* Gauss–Newton steps; deviations beyond a bound that shrinks from *start* to *end* (m) fade."""
        bounds = np.geomspace(start, end, steps)
        information = np.eye(6)
        for bound in bounds:
            information, gradient = self._normal_equations(pose, float(bound))
            step: Array = np.asarray(np.linalg.solve(information, gradient), dtype=np.float64)
            pose = self._moved(pose, step)
            if np.linalg.norm(step[:3]) < 2e-5 and np.linalg.norm(step[3:]) < 2e-4 and bound <= 1.5 * end:
                break
        return Refined(pose, information)

    def _moved(self, pose: Array, step: Array) -> Array:
        length = float(np.linalg.norm(step))
        if not np.isfinite(length):
            return pose
        centre = pose[:3, :3] @ self.surface.body.com + pose[:3, 3]
        R = so3.exp(step[3:])
        out = pose.copy()
        out[:3, :3] = R @ pose[:3, :3]
        out[:3, 3] = R @ (pose[:3, 3] - centre) + centre + step[:3]
        return out

    def _normal_equations(self, pose: Array, bound: float) -> tuple[Array, Array]:
        R, t = pose[:3, :3], pose[:3, 3]
        centre = R @ self.surface.body.com + t
        H = np.diag(np.repeat(1.0 / np.square(SPREAD), 3))
        g = np.zeros(6)

        local, distance = self.surface.nearest_facing((self.points - t) @ R, self.toward @ R)
        found = local @ R.T + t
        away = self.points - found
        usable = (distance > 1e-9) & np.isfinite(distance)
        normal = np.where(usable[:, None], away / np.maximum(distance, 1e-12)[:, None], 0.0)
        weight = np.where(usable, _fade(distance, bound), 0.0) / self.sigma**2
        distance = np.where(usable, distance, 0.0)
        _accumulate(H, g, found - centre, normal, distance, weight)

        for window in self.around:
            depth = predicted(self.surface, pose, window)
            through = np.flatnonzero(violations(window, depth, self.plane, self.clearance))
            if not through.size:
                continue
            hits = window.origin + window.rays[through] * depth[through, None]
            gap, nearest = self._tree.query(hits)
            across = self.points[nearest] - hits
            ray = window.rays[through] / np.linalg.norm(window.rays[through], axis=1, keepdims=True)
            across -= ray * (across * ray).sum(axis=1, keepdims=True)  # free space says nothing along the ray
            length = np.linalg.norm(across, axis=1)
            direction = across / np.maximum(length, 1e-12)[:, None]
            share = THROUGH * len(self.points) / max(int(window.on_object.sum()), 1)
            weight = share * _fade(np.asarray(gap), 3.0 * bound) / self.sigma**2
            _accumulate(H, g, hits - centre, direction, length, weight)

        corners = self.surface.hull @ R.T + t
        height = self.plane.height(corners)
        lowest = int(np.argmin(height))
        touching = height < 0.0
        if self.resting:
            touching[lowest] = True
        k = int(touching.sum())
        if k:
            weight = np.full(k, 1.0 / RESTING**2 / k)
            _accumulate(H, g, corners[touching] - centre, np.tile(self._up, (k, 1)), -height[touching], weight)
        return H, g


def _accumulate(H: Array, g: Array, arm: Array, direction: Array, distance: Array, weight: Array) -> None:
    """Add the equations ``direction · (v + ω × arm) = distance`` with their weights."""
    J = np.concatenate([direction, np.cross(arm, direction)], axis=1)
    H += (J * weight[:, None]).T @ J
    g += J.T @ (weight * distance)


def _fade(distance: Array, bound: float) -> Array:
    """Weights of Geman and McClure: one near zero, falling with the fourth power beyond *bound*."""
    return np.asarray(1.0 / (1.0 + (distance / bound) ** 2) ** 2)
