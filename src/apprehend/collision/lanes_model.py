"""Arrays for the sphere kernels, from the same nodes and pairs as the exact ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Array
from ..kernels import sphere_near
from ..kernels.collide import CollideModel
from ..kernels.gjk import BOX, CYLINDER, HALF_SPACE, HULL
from ..kernels.sphere import SphereModel
from .cells import cell_table
from .geometry import Geometry
from .nodes import Node
from .obstacles import Union
from .shapes import Convex
from .spheres import cover

FEW = 64
"""Unions of no more shapes than this are taken apart; others get a table of cells."""

FINEST = 0.045
"""A link is not split into spheres smaller than this share of the robot's reach."""


def sphere_model(exact: CollideModel, nodes: Sequence[Node], clearance: float) -> SphereModel:
    """The sphere model that goes with the exact one; of each of its blocks the first node moves.

    Standing shapes that a link cannot come as near as *clearance* to are left out.

    It decides where links are spheres and what stands around boxes, cylinders, spheres, capsules and half-spaces.
    """
    m = len(exact.links)
    moving = [k for k, node in enumerate(nodes) if node.carrier >= 0]
    based = [k for k, node in enumerate(nodes) if node.carrier < 0]
    small = FINEST * max((float(exact.nodes[k, 5:].max(initial=0.0)) for k in moving), default=1.0)
    table_of = _Fixed()
    standing = {k: [(o, g) for g, shape in enumerate(nodes[k].shapes) for o in table_of.add(shape)] for k in based}
    number = {k: i for i, k in enumerate(moving)}
    spheres: list[Array] = []
    round_only: list[bool] = []
    parts, count = [], 0
    for k in moving:
        balls = np.concatenate([cover(shape, small=small) for shape in nodes[k].shapes if isinstance(shape, Convex)])
        round_only.append(all(shape.kind == HULL and len(shape.points) == 1 for shape in nodes[k].shapes))
        spheres.append(balls)
        parts.append((nodes[k].carrier, count, count + len(balls)))
        count += len(balls)
    table = np.array([_row(exact.nodes[k], balls) for k, balls in zip(moving, spheres, strict=True)])
    selves, ranges, meets, exactly, exactly_selves = [], [], [], [], []
    for row in exact.blocks:
        a, b, first = int(row[0]), int(row[1]), int(row[2])
        if nodes[b].carrier >= 0:
            selves.append([number[a], number[b], *row[4:]])
            ranges.append(row[2:4])
            exactly_selves.append(round_only[number[a]] and round_only[number[b]])
        else:
            centre, radius = reachable(exact, int(nodes[a].carrier), table[number[a]])
            for o, g in standing[b]:
                if gap(table_of.shapes[o], centre) <= radius + clearance:
                    meets.append((number[a], o, first + g, len(nodes[b].shapes)))
                    exactly.append(round_only[number[a]] and table_of.exactly[o])
    ends = np.cumsum([0, *(len(node.shapes) for node in nodes)])
    return SphereModel(
        links=exact.links,
        joints=exact.joints,
        spheres=np.concatenate([*spheres, np.zeros((0, 4))]),
        nodes=table.reshape(len(moving), 5 + m),
        parts=np.array(parts, np.int64).reshape(-1, 3),
        selves=np.array(selves, np.int64).reshape(-1, 2 + m),
        fixed=np.array(table_of.rows, np.float64).reshape(-1, 17),
        meets=np.array(meets, np.int64).reshape(-1, 4),
        owns=np.array([(ends[k], ends[k + 1]) for k in moving], np.int64).reshape(-1, 2),
        ranges=np.array(ranges, np.int64).reshape(-1, 2),
        exactly=np.array(exactly + exactly_selves, np.int64),
        decides=np.array([all(round_only) and all(table_of.exactly)], np.int64),
        shapes=np.array(table_of.counts, np.int64).reshape(-1, 3),
        cells=np.concatenate([np.zeros(0, np.float32), *table_of.cells]),
    )


class _Fixed:
    """Collects what stands around."""

    def __init__(self) -> None:
        self.rows: list[list[float]] = []
        self.shapes: list[Geometry] = []
        self.counts: list[tuple[int, ...]] = []
        self.cells: list[Array] = []
        self.total = 0
        self.exactly: list[bool] = []

    def add(self, shape: Geometry) -> list[int]:
        """The numbers of the rows that stand for *shape*."""
        if isinstance(shape, Union) and len(shape.shapes) <= FEW:
            return [o for part in shape.shapes for o in self.add(part.at(shape.pose))]
        self.shapes.append(shape)
        counts: tuple[int, ...] = (0, 0, 0)
        if shape.kind > HALF_SPACE:
            corner, side, bounds = cell_table(shape)
            place = shape.pose[:3, 3] + shape.pose[:3, :3] @ corner
            self.rows.append([*shape.pose[:3, :3].ravel(), *place, 1.0 / side, self.total, 0.0, 0.0, sphere_near.GRID])
            self.cells.append(bounds.ravel())
            self.total += bounds.size
            self.exactly.append(False)
            counts = bounds.shape
        else:
            row, exactly = fixed_row(shape)
            self.rows.append(row)
            self.exactly.append(exactly)
        self.counts.append(counts)
        return [len(self.rows) - 1]


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


def gap(shape: Geometry, point: Array) -> float:
    """A lower bound on the distance of a point to a standing shape."""
    local = (point - shape.pose[:3, 3]) @ shape.pose[:3, :3]
    if shape.kind == HALF_SPACE:
        return float(local[2])
    return float(np.linalg.norm(np.maximum(np.abs(local) - shape.half, 0.0)))


def fixed_row(shape: Geometry) -> tuple[list[float], bool]:
    """A standing shape as a row of ``SphereModel.fixed``, and whether that is exact."""
    pose = [*shape.pose[:3, :3].ravel(), *shape.pose[:3, 3]]
    if shape.kind == BOX:
        return [*pose, *shape.size, shape.radius, 0.0], True
    if shape.kind == CYLINDER:
        return [*pose, shape.size[0], shape.size[0], shape.size[1], shape.radius, 1.0], True
    if shape.kind == HALF_SPACE:
        return [*pose, 0.0, 0.0, 0.0, 0.0, sphere_near.HALF_SPACE], True
    half = shape.half - shape.radius
    exactly = shape.kind == HULL and len(shape.points) <= 2
    if exactly:  # a point, or a segment along an axis of its box
        half = np.where(half < 1e-12, 0.0, half)
        exactly = int((half > 0.0).sum()) == len(shape.points) - 1
    return [*pose, *half, shape.radius, 0.0], exactly
