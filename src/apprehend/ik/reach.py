"""How far a chain reaches: bounds that certify that a target cannot be reached by any joint vector."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, BoolArray
from ..kernels.chain import PRISMATIC, ChainModel
from .structure import pose_of


@dataclass(frozen=True, eq=False)
class ReachBound:
    """The frame's origin is never farther than *length* from *anchor*, nor *point* (fixed in the frame, on the last
    joint's axis) farther than *inner*."""

    anchor: Array  # (3,) in the world
    length: float
    point: Array  # (3,) in the frame
    inner: float

    def excess(self, T: Array) -> Array:
        """By how many metres the poses ``T (N, 4, 4)`` are certainly out of reach; negative: not certainly."""
        far = np.linalg.norm(T[:, :3, 3] - self.anchor, axis=1) - self.length
        wrist = np.linalg.norm(T[:, :3, 3] + T[:, :3, :3] @ self.point - self.anchor, axis=1) - self.inner
        worse: Array = np.maximum(far, wrist)
        return worse

    def beyond(self, T: Array, distance: float, angle: float) -> BoolArray:
        """Whether the poses are certainly out of reach even with errors of *distance* and *angle*."""
        slack = distance + 1e-9 * self.length
        far = np.linalg.norm(T[:, :3, 3] - self.anchor, axis=1) > self.length + slack
        lever = float(np.linalg.norm(self.point))
        wrist = np.linalg.norm(T[:, :3, 3] + T[:, :3, :3] @ self.point - self.anchor, axis=1)
        out: BoolArray = far | (wrist > self.inner + slack + lever * min(angle, np.pi))
        return out


def reach_bound(model: ChainModel, lower: Array, upper: Array) -> ReachBound:
    """The triangle inequality along the joints' axes, at the points on them that make it tightest.

    A revolute joint keeps the distances of the points on its axis to what precedes and to what follows; so the
    length of any polygon with one corner on each axis bounds the reach, plus the largest travel of every prismatic
    joint. Each corner slides along its axis to where the two sides that meet there are shortest together (the mirror
    principle), in turn until nothing changes; the sum is convex, so this is the minimum but for ties.
    """
    points, axes, travel = _corners(model, lower, upper)
    tip, wrist = points[-1], points[:-1]
    outer = _shortest(wrist.copy(), axes, tip)
    inner = _shortest(wrist.copy(), axes, None)
    T = _frame_at_zero(model)
    anchor = outer[0] if len(outer) > 1 else tip
    # both bounds start at the same anchor: take the outer polygon's for both
    inner[0] = anchor
    inner_length = float(np.linalg.norm(np.diff(inner, axis=0), axis=1).sum()) + travel
    outer_length = float(np.linalg.norm(np.diff(outer, axis=0), axis=1).sum()) + travel
    last_slides = bool(model.kind.size) and model.kind[-1] == PRISMATIC
    point = T[:3, :3].T @ (inner[-1] - T[:3, 3])
    if last_slides or len(inner) < 2:  # the point on the last turning axis is not fixed in the frame
        point, inner_length = np.zeros(3), outer_length
    return ReachBound(anchor, outer_length, point, inner_length)


def _frame_at_zero(model: ChainModel) -> Array:
    T = np.eye(4)
    for i in range(model.kind.size):
        T = T @ pose_of(model.place[i])
        offset = model.gain[i, 1]
        move = np.eye(4)
        if model.kind[i] == PRISMATIC:
            move[2, 3] = offset
        else:
            c, s = np.cos(offset), np.sin(offset)
            move[:2, :2] = [[c, -s], [s, c]]
        T = T @ move
    return T @ pose_of(model.place[-1])


def _corners(model: ChainModel, lower: Array, upper: Array) -> tuple[Array, Array, float]:
    """A point on each turning axis and the frame's origin, the axes, and the largest sum of prismatic travels."""
    T = np.eye(4)
    points, axes = [], []
    travel = 0.0
    for i in range(model.kind.size):
        T = T @ pose_of(model.place[i])
        gain, offset = model.gain[i]
        move = np.eye(4)
        if model.kind[i] == PRISMATIC:
            column = model.column[i]
            travel += abs(gain) * max(abs(lower[column]), abs(upper[column]))
            move[2, 3] = offset
        else:
            points.append(T[:3, 3])
            axes.append(T[:3, 2])
            c, s = np.cos(offset), np.sin(offset)
            move[:2, :2] = [[c, -s], [s, c]]
        T = T @ move
    T = T @ pose_of(model.place[-1])
    if model.kind.size and model.kind[0] == PRISMATIC:  # the anchor must not move: start at the first joint
        points.insert(0, model.place[0, 9:].copy())
        axes.insert(0, np.zeros(3))
    return np.array([*points, T[:3, 3]]), np.array(axes).reshape(-1, 3), travel


def _shortest(points: Array, axes: Array, tip: Array | None) -> Array:
    """Slide the corners along their axes so that the polygon (and on to *tip*) is shortest."""
    m = len(points)
    for _ in range(200):
        moved = 0.0
        for i in range(m):
            n = axes[i]
            before = points[i - 1] if i else None
            after = points[i + 1] if i + 1 < m else tip
            sides = [p for p in (before, after) if p is not None]
            if not sides or not n.any():
                continue
            z = [float(n @ (p - points[i])) for p in sides]
            r = [float(np.linalg.norm(p - points[i] - zi * n)) for p, zi in zip(sides, z, strict=True)]
            if len(sides) == 1:
                s = z[0]
            elif r[0] + r[1] < 1e-15:
                s = 0.5 * (z[0] + z[1])
            else:
                s = (z[0] * r[1] + z[1] * r[0]) / (r[0] + r[1])
            points[i] = points[i] + s * n
            moved = max(moved, abs(s))
        if moved < 1e-12:
            break
    return points if tip is None else np.vstack([points, tip])
