"""Closed forms for arms that work in parallel planes: planar arms of two or three joints, and SCARA arms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, IntArray
from ..kernels.chain import PRISMATIC, ChainModel
from ..kernels.ik_branches import MOST
from .structure import pose_of

PARALLEL = 1e-9


@dataclass(frozen=True, eq=False)
class FlatArm:
    """Parallel axes: the common direction *n*, the joints that turn (two or three), and the one that slides, if any."""

    n: Array
    turning: tuple[int, ...]
    sliding: int  # −1: none
    signs: Array  # (m,) of each joint's axis along n
    points: Array  # (m + 1, 3) at zero: a point on each axis, then the frame
    R0: Array


def flat_structure(model: ChainModel) -> FlatArm | None:
    """The arm as a flat one, if all its axes are parallel, two or three turn, and at most one slides."""
    if model.free.size != model.kind.size or not (np.abs(model.gain[:, 0]) == 1.0).all():
        return None
    T = np.eye(4)
    axes, points = [], []
    for i in range(model.kind.size):
        T = T @ pose_of(model.place[i])
        multiplier, offset = model.gain[i]
        axes.append(multiplier * T[:3, 2])
        points.append(T[:3, 3])
        move = np.eye(4)
        if model.kind[i] == PRISMATIC:
            move[2, 3] = offset
        else:
            c, s = np.cos(offset), np.sin(offset)
            move[:2, :2] = [[c, -s], [s, c]]
        T = T @ move
    T = T @ pose_of(model.place[-1])
    turning = tuple(int(i) for i in np.flatnonzero(model.kind != PRISMATIC))
    sliding = np.flatnonzero(model.kind == PRISMATIC)
    if len(turning) not in (2, 3) or sliding.size > 1:
        return None
    n = axes[turning[0]]
    signs = np.array([float(np.sign(a @ n)) for a in axes])
    if max(np.linalg.norm(np.cross(a, n)) for a in axes) > PARALLEL:
        return None
    return FlatArm(n, turning, int(sliding[0]) if sliding.size else -1, signs, np.array([*points, T[:3, 3]]), T[:3, :3])


def flat_branches(arm: FlatArm, model: ChainModel, poses: Array) -> tuple[Array, IntArray, str]:
    """Candidates ``(N, MOST, m)`` and how many (up to two). Targets off the plane or tilted are dropped later."""
    n = arm.n
    u = np.cross(n, [1.0, 0.0, 0.0] if abs(n[0]) < 0.6 else [0.0, 1.0, 0.0])
    u /= np.linalg.norm(u)
    v = np.cross(n, u)
    count = poses.shape[0]
    R = poses[:, :3, :3] @ arm.R0.T
    total = np.arctan2(R @ u @ v, R @ u @ u)
    j = arm.turning
    o = arm.points
    x = np.zeros((count, MOST, model.kind.size))

    def plane(p: Array) -> Array:
        flat: Array = (p @ u) + 1j * (p @ v)
        return flat

    last = o[-1] - o[j[-1]]
    a = plane(o[j[1]] - o[j[0]])
    if len(j) == 3:
        b = plane(o[j[2]] - o[j[1]])
        goal = plane(poses[:, :3, 3] - o[j[0]]) - np.exp(1j * total) * plane(last)
    else:
        b = plane(last)
        goal = plane(poses[:, :3, 3] - o[j[0]])
    size = abs(a) * abs(b)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = (np.abs(goal) ** 2 - abs(a) ** 2 - abs(b) ** 2) / (2.0 * size) if size > 0.0 else np.zeros(count)
    number = np.where(np.abs(cosine) <= 1.0 + 1e-9, 2, 0)
    bend = np.arccos(np.clip(cosine, -1.0, 1.0))
    for branch, sign in enumerate((1.0, -1.0)):
        second = sign * bend - np.angle(b / a) if size > 0.0 else np.zeros(count)
        first = np.angle(goal / (a + b * np.exp(1j * second))) if size > 0.0 else np.zeros(count)
        x[:, branch, j[0]] = first
        x[:, branch, j[1]] = second * arm.signs[j[1]]
        if len(j) == 3:
            x[:, branch, j[2]] = (total - first - second) * arm.signs[j[2]]
        if arm.sliding >= 0:
            x[:, branch, arm.sliding] = (poses[:, :3, 3] - o[-1]) @ n * arm.signs[arm.sliding]
    name = "SCARA" if arm.sliding >= 0 else f"planar, {len(j)} joints"
    return x, number, name
