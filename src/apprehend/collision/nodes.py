"""The things that a collision model knows: links, attached bodies, obstacles; and which of them may touch."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from ..kernels.tree import TreeModel
from ..kinematics import Robot
from ..robots.description import Description, JointType
from .geometry import Geometry, Part, part_of
from .shapes import Convex, link_shapes
from .spheres import Covered, covered
from .standing import Standing, standing

UNBOUNDED_TRAVEL = 100.0
"""Travel in m that is assumed for a sliding joint without limits when the motion of what it carries is bounded."""

Pair = frozenset[str]


@dataclass(frozen=True, eq=False)
class Node:
    """Something rigid with a name: its shapes, in the frame of the joint that carries it (−1: the world)."""

    name: str
    carrier: int
    shapes: tuple[Geometry, ...]
    attached_to: str | None = None  # frame that an attached body moves with
    pose: Array | None = None  # of an attached body in that frame
    travel: Array | None = None  # of what moves: see `reach`

    @cached_property
    def ball(self) -> Array:
        """A sphere (centre, radius) that holds the node, in its carrier: around the box around the shapes' spheres."""
        if len(self.shapes) == 1:
            centre, radius = self.shapes[0].ball
            return np.array([*centre, radius * (1.0 + 1e-12)]) if radius < np.inf else np.array([0.0, 0.0, 0.0, np.inf])
        centres = np.array([shape.ball[0] for shape in self.shapes])
        radii = np.array([shape.ball[1] for shape in self.shapes])
        if np.isinf(radii).any():
            return np.array([0.0, 0.0, 0.0, np.inf])
        centre = 0.5 * ((centres - radii[:, None]).min(axis=0) + (centres + radii[:, None]).max(axis=0))
        radius = float((np.linalg.norm(centres - centre, axis=1) + radii).max())
        return np.array([*centre, radius * (1.0 + 1e-12)])

    @cached_property
    def part(self) -> Part:
        """Rows of the shapes for the kernels."""
        return part_of(self.shapes, self.carrier)

    @cached_property
    def standing(self) -> Standing:
        """Rows of the shapes for the sphere kernels, where the node stands still."""
        return standing(self.shapes)

    def covered(self, tree: TreeModel, small: float) -> Covered:
        """Spheres around the shapes of a node that moves; *tree* and *small* are those of its robot."""
        if "spheres" not in self.__dict__:
            self.__dict__["spheres"] = covered(tree, self.carrier, self.shapes, small)
        found: Covered = self.__dict__["spheres"]
        return found


def pair(a: str, b: str) -> Pair:
    """The unordered pair of two names."""
    return frozenset((a, b))


def link_nodes(robot: Robot, geometry: Mapping[str, Sequence[Convex]] | None = None) -> tuple[Node, ...]:
    """The links that have collision geometry: their description's, or what *geometry* gives instead."""
    tree, nodes = robot.model, []
    for name in geometry or ():
        robot.frame_index(name)
    for f, name in enumerate(robot.frame_names):
        shapes = link_shapes(robot.description.links[name]) if geometry is None else tuple(geometry.get(name, ()))
        if shapes:
            place = matrix(tree.frame_place[f])
            nodes.append(moving(robot, Node(name, int(tree.frame_joint[f]), tuple(s.at(place) for s in shapes))))
    if not nodes:
        raise InputError(f"robot {robot.name!r} has no collision geometry: nothing could be checked")
    return tuple(nodes)


def moving(robot: Robot, node: Node) -> Node:
    """The node with the bounds on its travel."""
    return replace(node, travel=reach(robot.model, robot, node)) if node.carrier >= 0 else node


def matrix(flat: Array) -> Array:
    """A pose of 12 numbers (rotation row-major, translation) as (4, 4)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = flat[:9].reshape(3, 3), flat[9:]
    return T


def ancestors(tree: TreeModel, joint: int) -> list[int]:
    """The joint and those that carry it, innermost first."""
    chain = []
    while joint >= 0:
        chain.append(joint)
        joint = int(tree.parent[joint])
    return chain


def between(tree: TreeModel, a: int, b: int) -> list[int]:
    """The joints whose motion moves carrier *a* against carrier *b*."""
    up_a, up_b = ancestors(tree, a), ancestors(tree, b)
    return [j for j in up_a if j not in up_b] + [j for j in up_b if j not in up_a]


def neighbours(description: Description, shaped: set[str]) -> tuple[set[Pair], set[Pair]]:
    """Pairs of links that a joint connects, and pairs that one may connect.

    These stand for links without geometry: everything that is rigid with such a link, of which the joint touches only
    what is near to it.
    """
    group = {description.root: description.root}  # link → the link that its rigid group hangs on
    members: dict[str, list[str]] = {description.root: [description.root]}
    for joint in description.joints:
        group[joint.child] = group[joint.parent] if joint.type is JointType.FIXED else joint.child
        members.setdefault(group[joint.child], []).append(joint.child)
    direct, indirect = set[Pair](), set[Pair]()
    for joint in description.joints:
        if joint.type is JointType.FIXED:
            continue
        ends = (joint.parent, joint.child)
        sides = [[link] if link in shaped else members[group[link]] for link in ends]
        found = {pair(a, b) for a in sides[0] for b in sides[1] if a in shaped and b in shaped}
        (direct if shaped.issuperset(ends) else indirect).update(found)
    return direct, indirect - direct


def linkages(tree: TreeModel, nodes: Sequence[Node]) -> set[Pair]:
    """Pairs that move against each other by two or more joints coupled to one coordinate.

    Such a mechanism (the fingers of a gripper, a four-bar linkage) is fixed by its maker; no plan can change it.
    """
    pairs = set()
    for i, a in enumerate(nodes):
        for b in nodes[:i]:
            joints = between(tree, a.carrier, b.carrier)
            if len(joints) >= 2 and len({int(tree.coordinate[j]) for j in joints}) == 1:
                pairs.add(pair(a.name, b.name))
    return pairs


def reach(tree: TreeModel, robot: Robot, node: Node) -> Array:
    """How far any point of the node moves at most per rad or m of each joint's value, over all configurations (m,).

    A revolute joint moves a point by its distance from the axis, which the lengths of the links in between bound.
    """
    out = np.zeros(len(tree.kind))
    radius, across = 0.0, 0.0  # of the ball about the joint's origin that holds the node, and about its axis
    for shape in node.shapes:
        (x, y, z), r = shape.ball
        radius = max(radius, math.sqrt(x * x + y * y + z * z) + r)
        across = max(across, math.hypot(x, y) + r)
    for joint in ancestors(tree, node.carrier):
        if tree.kind[joint] == 0:
            out[joint] = across
        else:
            out[joint] = 1.0
            radius += float(slide_bounds(robot, np.array([joint]))[0])
        x, y, z = tree.place[joint, 9:].tolist()
        across = math.hypot(x, y) + radius
        radius += math.sqrt(x * x + y * y + z * z)
    return out


def slide_bounds(robot: Robot, joints: IntArray) -> Array:
    """How far sliding joints are from their zero at most, within their limits; `UNBOUNDED_TRAVEL` without limits."""
    tree, limits = robot.model, robot.limits
    c, gain = tree.coordinate[joints], tree.gain[joints]
    ends = np.abs(np.stack([limits.lower[c], limits.upper[c]]) * gain[:, 0] + gain[:, 1])
    return np.where(np.isfinite(ends).all(axis=0), ends.max(axis=0, initial=0.0), UNBOUNDED_TRAVEL)
