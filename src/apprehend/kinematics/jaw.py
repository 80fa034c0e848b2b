"""`ParallelJaw`: two pads that close on each other, and what a grasp needs to know of them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from .robot import Robot


@dataclass(frozen=True, eq=False)
class ParallelJaw:
    """Two pads that close on each other.

    The tcp lies midway between the pad centres: z points away from the palm, x along the closing direction from pad 1
    to pad 0, y = z × x. Poses are T_hand_tcp, with the hand's root link as "hand".
    """

    robot: Robot
    max_width: float
    min_width: float
    pad_links: tuple[str, str]
    pad_points: Array  # (2, 3), centre of each pad in its link's frame
    pad_size: tuple[float, float]
    finger_depth: float
    tip_length: float
    """How far the fingers reach beyond the tcp along z, in m, at full width."""
    max_force: float
    _path: Array = field(repr=False)  # (SAMPLES, n), joint values from closed to open
    _widths: Array = field(repr=False)  # (SAMPLES,), ascending
    _axes: Array = field(repr=False)  # (2, 3): x and z when closed, in the hand frame

    def q_at(self, width: ArrayLike) -> Array:
        """Joint values ``(..., n)`` that put the pads *width* ``(...)`` apart; `InputError` outside the stroke."""
        w = as_array(width, "width")
        bad = (w < self.min_width - 1e-9) | (w > self.max_width + 1e-9)
        if bad.any():
            raise InputError(
                f"width is {np.atleast_1d(w)[np.atleast_1d(bad)][0]:.6g} m; hand {self.robot.name!r} opens from "
                f"{self.min_width:.4g} to {self.max_width:.4g} m"
            )
        s = np.interp(w, self._widths, np.arange(len(self._widths), dtype=np.float64))
        for _ in range(4):  # refine on the true width: the table is within micrometres already
            h = 1e-3
            slope = (self._width(s + h) - self._width(s - h)) / (2 * h)
            step = np.divide(self._width(s) - w, slope, out=np.zeros_like(s), where=np.abs(slope) > 1e-9)
            s = np.clip(s - np.clip(step, -1.0, 1.0), 0.0, len(self._widths) - 1.0)
        return self._q(s)

    def tcp_at(self, width: ArrayLike) -> Array:
        """T_hand_tcp ``(..., 4, 4)`` when the pads are *width* ``(...)`` apart."""
        q = self.q_at(width)
        p0, p1 = self.pads(q)
        apart = p0 - p1
        length = np.linalg.norm(apart, axis=-1, keepdims=True)
        x = np.where(length > 1e-3, apart / np.maximum(length, 1e-12), self._axes[0])
        z = self._axes[1] - x * (x @ self._axes[1])[..., None]
        z /= np.linalg.norm(z, axis=-1, keepdims=True)
        T = np.zeros((*q.shape[:-1], 4, 4))
        T[..., :3, 0], T[..., :3, 1], T[..., :3, 2] = x, np.cross(z, x), z
        T[..., :3, 3] = 0.5 * (p0 + p1)
        T[..., 3, 3] = 1.0
        return T

    def width_of(self, q: ArrayLike) -> Array:
        """Distance between the pads ``(...)`` at hand joints ``q (..., n)``."""
        p0, p1 = self.pads(q)
        distance: Array = np.linalg.norm(p0 - p1, axis=-1)
        return distance

    def pads(self, q: ArrayLike) -> tuple[Array, Array]:
        """The centres of pad 0 and pad 1 in the hand frame ``(..., 3)`` at hand joints ``q (..., n)``."""
        poses = [self.robot.fk(q, link) for link in self.pad_links]
        p0, p1 = [T[..., :3, :3] @ p + T[..., :3, 3] for T, p in zip(poses, self.pad_points, strict=True)]
        return p0, p1

    def _q(self, s: Array) -> Array:
        index = np.clip(np.floor(s).astype(int), 0, len(self._path) - 2)
        part = (s - index)[..., None]
        q: Array = self._path[index] * (1.0 - part) + self._path[index + 1] * part
        return q

    def _width(self, s: Array) -> Array:
        return self.width_of(self._q(s))
