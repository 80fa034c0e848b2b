"""Arrays for the kernels, joined from those of the robot alone and those of everything else."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..kernels.collide import CollideModel
from ..kernels.sphere import SphereModel
from ..kernels.tree import TreeModel
from . import standing
from .geometry import arrays_of, join
from .nodes import Node, Pair, ancestors

FINEST = 0.045
"""A link is not split into spheres smaller than this share of the robot's reach."""


class Blocks(NamedTuple):
    """Pairs of nodes, in the order in which they are tested, and the pairs of their shapes."""

    rows: IntArray  # see `CollideModel.blocks`
    pairs: IntArray


class Alone:
    """A robot's links, and which of them may touch: what all its models share, whatever else there is."""

    def __init__(self, tree: TreeModel, nodes: tuple[Node, ...], allowed: Collection[Pair]) -> None:
        self.tree, self.nodes, self.allowed = tree, nodes, frozenset(allowed)
        m = len(tree.kind)
        self.links = np.stack([tree.parent, tree.kind, tree.coordinate], axis=1)
        self.joints = np.concatenate([tree.place, tree.gain], axis=1)
        self.above = np.zeros((m + 1, m), np.int64)  # whether a joint carries another; the last row is the world's
        for joint in range(m):
            self.above[joint, ancestors(tree, joint)] = 1
        travels = [float(node.travel.max(initial=0.0)) for node in nodes if node.travel is not None]
        self.small = FINEST * max(travels, default=1.0)
        self.part = join([node.part for node in nodes])
        self.rows = self.node_rows(nodes)

    def allowing(self, allowed: Collection[Pair]) -> Alone:
        """The same links, of which others may touch."""
        other = object.__new__(type(self))
        other.__dict__.update({k: v for k, v in self.__dict__.items() if k != "blocks"}, allowed=frozenset(allowed))
        return other

    def node_rows(self, nodes: Sequence[Node]) -> Array:
        """Rows of ``CollideModel.nodes``."""
        m = len(self.tree.kind)
        rows = np.zeros((len(nodes), 5 + m))
        rows[:, 4] = [node.carrier for node in nodes]
        if nodes:
            rows[:, :4] = np.concatenate([node.ball for node in nodes]).reshape(-1, 4)
        for k, node in enumerate(nodes):
            if node.travel is not None:
                rows[k, 5:] = node.travel
        return rows

    @cached_property
    def blocks(self) -> Blocks:
        """The links that may not touch."""
        return self.new_blocks(self.nodes, 0, self.allowed, 0)

    def new_blocks(self, nodes: Sequence[Node], first: int, allowed: Collection[Pair], pairs: int) -> Blocks:
        """Blocks of each node from *first* on with those before it, but the *allowed*; *pairs* of shapes come before.

        What moves comes first in a block: its sphere is tested against the oriented box of the other.
        """
        number = {node.name: k for k, node in enumerate(nodes)}
        carriers = np.array([node.carrier for node in nodes])
        meet = carriers[first:, None] != carriers
        meet &= np.arange(len(nodes)) < np.arange(first, len(nodes))[:, None]
        for names in allowed:
            if len(names) == 2:
                i, j = sorted(number.get(name, -1) for name in names)
                if i >= 0 and j >= first:
                    meet[j - first, i] = False
        later, earlier = np.nonzero(meet)
        later += first
        moves = carriers[later] >= 0
        a, b = np.where(moves, later, earlier), np.where(moves, earlier, later)
        counts = np.array([len(node.shapes) for node in nodes])
        start = np.cumsum(counts) - counts
        size = counts[a] * counts[b]
        end = np.cumsum(size)
        rows = np.empty((len(a), 4 + self.above.shape[1]), np.int64)
        rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3] = a, b, end - size + pairs, end + pairs
        rows[:, 4:] = self.above[carriers[a]] & self.above[carriers[b]]
        within, wide = spread(size), counts[b].repeat(size)
        shapes = [start[a].repeat(size) + within // wide, start[b].repeat(size) + within % wide]
        return Blocks(rows, np.stack(shapes, axis=1))

    def with_others(self, others: Sequence[Node], allowed: Collection[Pair]) -> CollideModel:
        """The robot with *others* around it; *allowed* are pairs that may touch, of which one at least is no link."""
        rows, pairs = self.blocks
        part, table = self.part, self.rows
        if others:
            more = self.new_blocks([*self.nodes, *others], len(self.nodes), allowed, len(pairs))
            rows, pairs = np.concatenate([rows, more.rows]), np.concatenate([pairs, more.pairs])
            part = join([part, *(node.part for node in others)])
            table = np.concatenate([table, self.node_rows(others)])
        return CollideModel(self.links, self.joints, arrays_of(part), table, rows, pairs)

    def on_lanes(self, exact: CollideModel, others: Sequence[Node], clearance: float) -> SphereModel:
        """The sphere model that goes with the exact one; of each of its blocks the first node moves.

        Standing shapes that a link cannot come as near as *clearance* to are left out.

        It decides where links are spheres and what stands around boxes, cylinders, spheres, capsules and half-spaces.
        """
        nodes, m = [*self.nodes, *others], len(self.tree.kind)
        carriers = exact.nodes[:, 4].astype(np.int64)
        moving, based = np.flatnonzero(carriers >= 0), np.flatnonzero(carriers < 0)
        number = np.zeros(len(nodes), np.int64)  # of a node among those that move, or among those that stand
        number[moving], number[based] = np.arange(len(moving)), np.arange(len(based))
        spheres = [nodes[k].covered(self.tree, self.small) for k in moving]
        fixed = [nodes[k].standing for k in based]
        whole = standing.join(fixed)
        ends = np.cumsum([0, *(len(s.balls) for s in spheres)])
        shapes_end = np.cumsum([len(node.shapes) for node in nodes])
        table = exact.nodes[moving]
        table[:, :4] = np.array([s.around for s in spheres]).reshape(-1, 4)
        a, b, first = exact.blocks[:, :3].T
        still = carriers[b] < 0
        both = exact.blocks[~still]
        selves = np.concatenate([number[both[:, :2]], both[:, 4:]], axis=1)
        near = np.zeros((len(moving), len(whole.rows)), np.bool_)
        if near.size:
            reach = np.array([s.radius for s in spheres]) + clearance
            near = standing.gaps(whole.boxes, np.array([s.centre for s in spheres])) <= reach[:, None]
        meets = meetings(near, number[a[still]], number[b[still]], first[still], fixed, whole.numbers)
        round_only = np.array([s.exactly for s in spheres], np.bool_)
        exactly = [round_only[meets[:, 0]] & whole.exactly[meets[:, 1]], round_only[selves[:, :2]].all(axis=1)]
        return SphereModel(
            links=self.links,
            joints=self.joints,
            spheres=np.concatenate([*(s.balls for s in spheres), np.zeros((0, 4))]),
            nodes=table.reshape(-1, 5 + m),
            parts=np.stack([carriers[moving], ends[:-1], ends[1:]], axis=1),
            selves=selves,
            fixed=whole.rows,
            meets=meets,
            owns=np.stack([shapes_end[moving] - [len(nodes[k].shapes) for k in moving], shapes_end[moving]], axis=1),
            ranges=np.ascontiguousarray(both[:, 2:4]),
            exactly=np.concatenate(exactly).astype(np.int64),
            decides=np.array([round_only.all() and whole.exactly.all()], np.int64),
            shapes=whole.counts,
            cells=whole.cells,
        )


def meetings(
    near: BoolArray, a: IntArray, b: IntArray, first: IntArray, fixed: Sequence[standing.Standing], shapes: IntArray
) -> IntArray:
    """Rows of ``SphereModel.meets`` for moving nodes *a* and standing nodes *b* whose exact pairs begin at *first*.

    ``near (K, O)`` says which rows of what stands a moving node can come near to.
    """
    count = np.array([len(s.rows) for s in fixed], np.int64)
    stride = np.array([s.shapes for s in fixed], np.int64)
    sizes = count[b]
    row = (np.cumsum(count) - count)[b].repeat(sizes) + spread(sizes)
    node = a.repeat(sizes)
    out: IntArray = np.stack([node, row, first.repeat(sizes) + shapes[row], stride[b].repeat(sizes)], axis=1)
    return np.asarray(out[near[node, row]])


def spread(sizes: IntArray) -> IntArray:
    """0 … size − 1 for each of *sizes*, one after the other."""
    ends = np.cumsum(sizes)
    return np.arange(ends[-1] if len(ends) else 0) - np.repeat(ends - sizes, sizes)
