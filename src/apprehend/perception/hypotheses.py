"""Where a resting body might stand: its resting poses, turned about the vertical, slid under the points."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..spatial import so3
from .evaluate import Window, predicted
from .mesh import ModelSurface
from .segment import Plane

YAWS = 20
POINTS = 120
PROBABILITY = 0.995  # of the resting poses that are considered
MOST = 24  # resting poses


def upright_frame(plane: Plane) -> Array:
    """Axes (3, 3) as columns, the third along the plane's normal."""
    n = np.array(plane.normal)
    x = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(n, x), n])


def resting_hypotheses(surface: ModelSurface, points: Array, eyes: list[Array], plane: Plane) -> Array:
    """Poses (H, 4, 4) of the body resting on *plane*, its visible side over the middle of *points*."""
    frame = upright_frame(plane)
    middle = points.mean(axis=0)
    sight = np.mean([(eye - middle) / np.linalg.norm(eye - middle) for eye in eyes], axis=0)
    poses, covered = [], 0.0
    for rest in surface.body.stable_poses()[:MOST]:
        for yaw in np.arange(YAWS) * (2.0 * np.pi / YAWS):
            pose = np.eye(4)
            pose[:3, :3] = so3.exp(np.array(plane.normal) * yaw) @ frame @ rest.pose[:3, :3]
            facing = np.maximum((surface.outward @ pose[:3, :3].T) @ sight, 0.0)
            seen = (facing @ surface.points) / max(float(facing.sum()), 1e-12)
            shift = middle - pose[:3, :3] @ seen
            height = float((surface.hull @ pose[:3, :3].T @ frame[:, 2]).min())
            shift += frame[:, 2] * (plane.offset - height - float(shift @ frame[:, 2]))
            pose[:3, 3] = shift
            poses.append(pose)
        covered += rest.probability
        if covered >= PROBABILITY:
            break
    return np.array(poses)


def centred(surface: ModelSurface, poses: Array, around: list[Window], plane: Plane) -> Array:
    """The poses (H, 4, 4), each shifted along the plane so that the middle of what is seen is where it should be."""
    seen = np.concatenate([w.origin + w.rays[w.on_object] * w.depth[w.on_object, None] for w in around]).mean(axis=0)
    frame = upright_frame(plane)
    out = poses.copy()
    for pose in out:
        hits = []
        for window in around:
            depth = predicted(surface, pose, window)
            hit = np.isfinite(depth)
            hits.append(window.origin + window.rays[hit] * depth[hit, None])
        found = np.concatenate(hits)
        if len(found):
            shift = seen - found.mean(axis=0)
            pose[:3, 3] += frame[:, :2] @ (frame[:, :2].T @ shift)
    return out


def slide(
    surface: ModelSurface, poses: Array, points: Array, toward: Array, plane: Plane, steps: int, bound: float
) -> tuple[Array, Array]:
    """Slide and turn each pose (H, 4, 4) on the plane towards *points*: the poses, and their cost (H,).

    Gauss–Newton in the three freedoms that leave a resting body resting; the cost is the mean of the squared distances
    of the points from the surface in units of *bound*, at most one each.
    """
    poses = poses.copy()
    frame = upright_frame(plane)
    count, n = len(poses), len(points)
    cost = np.ones(count)
    for step in range(steps + 1):
        R, t = poses[:, :3, :3], poses[:, :3, 3]
        local = np.einsum("hnj,hjk->hnk", points - t[:, None], R)
        facing = np.einsum("nj,hjk->hnk", toward, R)
        found, distance = surface.nearest_facing(local.reshape(-1, 3), facing.reshape(-1, 3))
        distance = np.minimum(distance.reshape(count, n), 1e3)  # finite where no side faces the camera
        cost = np.minimum((distance / bound) ** 2, 1.0).mean(axis=1)
        if step == steps:
            break
        away = np.einsum("hij,hnj->hni", R, local - found.reshape(count, n, 3))
        normal = away / np.maximum(distance, 1e-12)[..., None]
        centre = np.einsum("hij,j->hi", R, surface.body.com) + t
        arm = points - away - centre[:, None]
        J = np.stack(
            [normal @ frame[:, 0], normal @ frame[:, 1], np.cross(arm, normal) @ frame[:, 2]], axis=-1
        )  # fmt: skip
        weight = 1.0 / (1.0 + (distance / (2.0 * bound)) ** 2) ** 2
        H = np.einsum("hni,hn,hnj->hij", J, weight, J) + np.diag([1e-3 * n, 1e-3 * n, 1e-6 * n])
        g = np.einsum("hni,hn,hn->hi", J, weight, distance)
        move = np.linalg.solve(H, g[..., None])[..., 0]
        turn = so3.exp(move[:, 2:] * frame[:, 2])
        poses[:, :3, :3] = turn @ R
        offset = np.einsum("hij,hj->hi", turn, t - centre)
        poses[:, :3, 3] = centre + offset + move[:, :2] @ frame[:, :2].T
    return poses, cost


def distinct(poses: Array, order: np.ndarray, radius: float, most: int) -> list[int]:
    """Indices of at most *most* poses in *order* that differ by more than a tenth of the body's *radius*."""
    kept: list[int] = []
    for i in order:
        for j in kept:
            turn = np.linalg.norm(poses[i][:3, :3] - poses[j][:3, :3])
            apart = np.linalg.norm(poses[i][:3, 3] - poses[j][:3, 3])
            if apart + 0.7 * radius * turn < 0.1 * radius:
                break
        else:
            kept.append(int(i))
        if len(kept) == most:
            break
    return kept
