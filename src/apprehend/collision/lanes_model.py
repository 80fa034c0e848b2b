"""Arrays for the sphere kernels, from the same nodes and pairs as the exact ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Array
from ..kernels.collide import CollideModel
from ..kernels.gjk import BOX, CYLINDER, HULL
from ..kernels.sphere import SphereModel
from .nodes import Node
from .shapes import Convex
from .spheres import cover

FINEST = 0.045
"""A link is not split into spheres smaller than this share of the robot's reach."""


def sphere_model(exact: CollideModel, nodes: Sequence[Node], clearance: float) -> SphereModel:
    """The sphere model that goes with the exact one; of each of its blocks the first node moves.

    Standing shapes that a link cannot come as near as *clearance* to are left out.

    It decides where links are spheres and what stands around boxes, cylinders, spheres and capsules.
    """
    m = len(exact.links)
    decides = True
    moving = [k for k, node in enumerate(nodes) if node.carrier >= 0]
    based = [k for k, node in enumerate(nodes) if node.carrier < 0]
    small = FINEST * max((float(exact.nodes[k, 5:].max(initial=0.0)) for k in moving), default=1.0)
    fixed: list[list[float]] = []
    fixed_of: dict[int, list[int]] = {}
    for k in based:
        rows = [fixed_row(shape) for shape in nodes[k].shapes]
        fixed_of[k] = list(range(len(fixed), len(fixed) + len(rows)))
        fixed += [row for row, _ in rows]
        if not all(exactly for _, exactly in rows):
            decides = False
    number = {k: i for i, k in enumerate(moving)}
    spheres: list[Array] = []
    parts, count = [], 0
    for k in moving:
        balls = np.concatenate([cover(shape, small=small) for shape in nodes[k].shapes])
        if any(shape.kind != HULL or len(shape.points) != 1 for shape in nodes[k].shapes):
            decides = False
        spheres.append(balls)
        parts.append((nodes[k].carrier, count, count + len(balls)))
        count += len(balls)
    table = np.array([_row(exact.nodes[k], balls) for k, balls in zip(moving, spheres, strict=True)])
    selves, meets = [], []
    for row in exact.blocks:
        a, b = int(row[0]), int(row[1])
        if nodes[b].carrier >= 0:
            selves.append([number[a], number[b], *row[4:]])
        else:
            centre, radius = reachable(exact, int(nodes[a].carrier), table[number[a]])
            meets += [(number[a], o) for o in fixed_of[b] if gap(fixed[o], centre) <= radius + clearance]
    return SphereModel(
        links=exact.links,
        joints=exact.joints,
        spheres=np.concatenate([*spheres, np.zeros((0, 4))]),
        nodes=table.reshape(len(moving), 5 + m),
        parts=np.array(parts, np.int64).reshape(-1, 3),
        selves=np.array(selves, np.int64).reshape(-1, 2 + m),
        fixed=np.array(fixed, np.float64).reshape(-1, 17),
        meets=np.array(meets, np.int64).reshape(-1, 2),
        decides=np.array([decides], np.int64),
    )


def _row(node: Array, balls: Array) -> Array:
    """The node's row with a bounding sphere that holds its spheres; the bounds on its motion are those of its shapes.

    That suffices: spheres that cover the shapes in one configuration, grown by what the shapes can move, cover them.
    """
    row = node.copy()
    centre = 0.5 * ((balls[:, :3] - balls[:, 3:]).min(axis=0) + (balls[:, :3] + balls[:, 3:]).max(axis=0))
    row[:3] = centre
    row[3] = float((np.linalg.norm(balls[:, :3] - centre, axis=1) + balls[:, 3]).max()) * (1.0 + 1e-12)
    return row


def reachable(exact: CollideModel, carrier: int, row: Array) -> tuple[Array, float]:
    """A ball that a node never leaves: around the first joint that moves it, as far as the links reach."""
    radius = float(np.linalg.norm(row[:3])) + row[3]
    while exact.links[carrier, 1] == 0 and exact.links[carrier, 0] >= 0:
        radius += float(np.linalg.norm(exact.joints[carrier, 9:12]))
        carrier = int(exact.links[carrier, 0])
    return exact.joints[carrier, 9:12], radius * (1.0 + 1e-12) if exact.links[carrier, 1] == 0 else np.inf


def gap(row: list[float], point: Array) -> float:
    """Distance of a point to the box around a standing shape."""
    local = (point - np.array(row[9:12])) @ np.array(row[:9]).reshape(3, 3)
    return float(np.linalg.norm(np.maximum(np.abs(local) - row[12:15], 0.0))) - row[15]


def fixed_row(shape: Convex) -> tuple[list[float], bool]:
    """A standing shape as a row of ``SphereModel.fixed``, and whether that is exact."""
    pose = [*shape.pose[:3, :3].ravel(), *shape.pose[:3, 3]]
    if shape.kind == BOX:
        return [*pose, *shape.size, shape.radius, 0.0], True
    if shape.kind == CYLINDER:
        return [*pose, shape.size[0], shape.size[0], shape.size[1], shape.radius, 1.0], True
    half = shape.half - shape.radius
    exactly = shape.kind == HULL and len(shape.points) <= 2
    if exactly:  # a point, or a segment along an axis of its box
        half = np.where(half < 1e-12, 0.0, half)
        exactly = int((half > 0.0).sum()) == len(shape.points) - 1
    return [*pose, *half, shape.radius, 0.0], exactly
