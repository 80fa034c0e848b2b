"""`Arrangement`: what can collide — links, attached bodies, obstacles — and which of it may touch."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_pose
from ..errors import InputError, unknown_name
from ..kernels.collide import CollideModel
from ..kernels.sphere import SphereModel
from ..kinematics import Robot
from .allowed import SAMPLES, by_sampling, srdf_pairs
from .geometry import Geometry
from .lanes_model import sphere_model
from .nodes import Node, Pair, can_meet, compile_model, link_nodes, matrix, pair, slide_bounds
from .obstacles import as_geometry
from .shapes import Convex

if TYPE_CHECKING:
    from pathlib import Path

    from ..bodies import Body
    from ..robots import Semantics
    from .scene import Scene

RESOLUTION = 2e-5
"""Default of `CollisionModel.resolution`, in m."""

NONE = np.zeros(0, np.int64)


class Arrangement:
    """A robot and its surroundings as convex shapes that are rigid with joints, and the pairs that may touch.

    The part of `CollisionModel` that asks nothing yet: things come and go, pairs are allowed and forbidden, and the
    arrays for the kernels are made when they are first needed. An arrangement is a value: each change makes a new one.
    """

    def __init__(
        self,
        robot: Robot,
        scene: Scene | None = None,
        *,
        clearance: float | None = None,
        resolution: float = RESOLUTION,
        allowed: Iterable[tuple[str, str]] = (),
        geometry: Mapping[str, Sequence[Convex]] | None = None,
    ) -> None:
        if clearance is None:
            clearance = scene.clearance if scene is not None else 0.0
        if not (math.isfinite(clearance) and clearance >= 0.0):
            raise InputError(f"clearance is {clearance}; expected 0 or more, in m")
        if not (math.isfinite(resolution) and resolution > 0.0):
            raise InputError(f"resolution is {resolution}; expected a positive length in m")
        self.robot = robot
        self.clearance = float(clearance)
        self.resolution = float(resolution)
        links = link_nodes(robot, geometry)
        self.nodes: tuple[Node, ...] = links + obstacle_nodes(scene)
        twice = sorted({n.name for n in links} & {n.name for n in self.nodes[len(links) :]})
        if twice:
            raise InputError(f"{twice[0]!r} names both a link of the robot and an obstacle; rename the obstacle")
        found, _ = by_sampling(robot, links, self.clearance, SAMPLES, np.random.default_rng(0))
        self.reasons: Mapping[Pair, str] = found
        """Why each allowed pair may touch."""
        self._compiled: CollideModel | None = None
        self._lanes: SphereModel | None = None
        self.reasons = {**self.reasons, **self._checked_pairs(allowed)}
        for a, b in scene.allowed if scene is not None else ():
            self.reasons = {**self.reasons, pair(a, b): "allowed by the scene"}

    # --- what may touch ------------------------------------------------------------------------------------------
    def _checked_pairs(self, pairs: Iterable[tuple[str, str]]) -> dict[Pair, str]:
        names = [node.name for node in self.nodes]
        checked = {}
        for a, b in pairs:
            for name in (a, b):
                if name not in names:
                    unknown_name("link or body with collision geometry", name, names, "the collision model")
            checked[pair(a, b)] = "allowed by the caller"
        return checked

    @property
    def allowed(self) -> frozenset[Pair]:
        """Pairs of names that may touch."""
        return frozenset(self.reasons)

    def _with(self, nodes: tuple[Node, ...], reasons: Mapping[Pair, str]) -> Self:
        other = object.__new__(type(self))
        other.robot, other.clearance, other.resolution = self.robot, self.clearance, self.resolution
        other.nodes, other.reasons, other._compiled, other._lanes = nodes, dict(reasons), None, None
        return other

    def allow(self, pairs: Iterable[tuple[str, str]]) -> Self:
        """The model in which these pairs of names may touch, too."""
        return self._with(self.nodes, {**self.reasons, **self._checked_pairs(pairs)})

    def allow_srdf(self, source: str | Path | Semantics) -> Self:
        """The model in which the pairs of an SRDF may touch, too: a file's path, its text, or read already.

        Raises `DescriptionError` for links that the robot does not have.
        """
        return self._with(self.nodes, {**self.reasons, **srdf_pairs(source, self.robot)})

    def forbid(self, pairs: Iterable[tuple[str, str]]) -> Self:
        """The model in which these pairs of names are checked again."""
        checked = self._checked_pairs(pairs)
        return self._with(self.nodes, {p: reason for p, reason in self.reasons.items() if p not in checked})

    def with_clearance(self, clearance: float, resolution: float | None = None) -> Self:
        """The model with another clearance (and resolution)."""
        if not (math.isfinite(clearance) and clearance >= 0.0):
            raise InputError(f"clearance is {clearance}; expected 0 or more, in m")
        other = self._with(self.nodes, self.reasons)
        other.clearance, other._compiled = float(clearance), self._compiled
        other.resolution = self.resolution if resolution is None else float(resolution)
        return other

    # --- what is there -------------------------------------------------------------------------------------------
    @property
    def names(self) -> tuple[str, ...]:
        """Everything that has collision geometry: links, attached bodies, obstacles."""
        return tuple(node.name for node in self.nodes)

    def _node(self, name: str) -> Node:
        for node in self.nodes:
            if node.name == name:
                return node
        unknown_name("link or body with collision geometry", name, self.names, "the collision model")

    def attach(
        self,
        body: Body | Geometry | Sequence[Geometry],
        frame: str,
        pose: ArrayLike,
        *,
        name: str | None = None,
        touching: Iterable[str] | None = None,
    ) -> Self:
        """The model in which *body* moves with link *frame* at *pose* (T_frame_body); an obstacle of its name goes.

        *touching* names what may touch it: by default the links beyond *frame* and those that are rigid with it (a
        hand and its fingers).
        """
        shapes, name = _shapes_of(body, name)
        for shape in shapes:
            if not isinstance(shape, Convex):
                raise InputError(
                    f"{name!r} has a {type(shape).__name__}; only bodies and convex shapes can be attached"
                )
        f = self.robot.frame_index(frame)
        tree = self.robot.model
        carrier = int(tree.frame_joint[f])
        T = as_pose(pose, "pose")
        place = matrix(tree.frame_place[f]) @ T
        node = Node(name, carrier, tuple(shape.at(place) for shape in shapes), frame, T)
        if touching is None:
            touching = [n.name for n in self.nodes if n.attached_to is None and self._beyond(n.carrier, carrier)]
        others = tuple(n for n in self.nodes if n.name != name)
        reasons = {p: reason for p, reason in self.reasons.items() if name not in p}
        model = self._with((*others, node), reasons)
        checked = model._checked_pairs((name, link) for link in touching)
        return model._with(model.nodes, {**reasons, **dict.fromkeys(checked, "holds the body")})

    def _beyond(self, carrier: int, base: int) -> bool:
        tree = self.robot.model
        while carrier >= 0 and carrier != base:
            carrier = int(tree.parent[carrier])
        return carrier == base and base >= 0

    def detach(self, name: str, pose: ArrayLike | None = None) -> Self:
        """The model without the attached body *name*; with *pose* (T_world_body) it stands there as an obstacle."""
        node = self._node(name)
        if node.attached_to is None or node.pose is None:
            raise InputError(f"{name!r} is not attached to the robot")
        others = tuple(n for n in self.nodes if n.name != name)
        reasons = {p: reason for p, reason in self.reasons.items() if name not in p}
        if pose is not None:
            f = self.robot.frame_index(node.attached_to)
            back = np.linalg.inv(matrix(self.robot.model.frame_place[f]) @ node.pose)
            T = as_pose(pose, "pose") @ back
            others = (*others, Node(name, -1, tuple(shape.at(T) for shape in node.shapes)))
        return self._with(others, reasons)

    def add(self, name: str, body: Body | Geometry | Sequence[Geometry], pose: ArrayLike | None = None) -> Self:
        """The model with one more obstacle, or with another one of that name, at *pose* (T_world_body).

        An obstacle is a body (its convex pieces), a distance field of one, or geometry of any kind: `Convex`,
        `HalfSpace`, `Cloud`, `Union`, `Grid`, or several of them.
        """
        if name in self.robot.frame_names:
            raise InputError(f"{name!r} is a link of the robot; an obstacle needs another name")
        T = np.eye(4) if pose is None else as_pose(pose, "pose")
        node = Node(name, -1, tuple(shape.at(T) for shape in _shapes_of(body, name)[0]))
        return self._with((*(n for n in self.nodes if n.name != name), node), self.reasons)

    def remove(self, name: str) -> Self:
        """The model without the obstacle or attached body *name*."""
        if self._node(name).name in self.robot.frame_names:
            raise InputError(f"{name!r} is a link of the robot; only obstacles and attached bodies can be removed")
        reasons = {p: reason for p, reason in self.reasons.items() if name not in p}
        return self._with(tuple(n for n in self.nodes if n.name != name), reasons)

    @cached_property
    def unmodelled(self) -> tuple[str, ...]:
        """Links without collision geometry."""
        names = set(self.names)
        return tuple(link for link in self.robot.frame_names if link not in names)

    @cached_property
    def travel(self) -> tuple[IntArray, Array, Array]:
        """Of the sliding joints: their coordinates, multipliers and offsets ``(k, 2)``, and the most they may slide.

        The bounds on motions hold up to there.
        """
        tree = self.robot.model
        slides = np.flatnonzero(tree.kind != 0)
        coordinate, gain = tree.coordinate[slides], tree.gain[slides]
        return coordinate, gain, slide_bounds(self.robot, slides)

    @property
    def compiled(self) -> CollideModel:
        """Arrays for the kernels (layout: `apprehend.kernels.collide`)."""
        if self._compiled is None:
            tree = self.robot.model
            blocks = [
                (i, j)
                for i, a in enumerate(self.nodes)
                for j, b in enumerate(self.nodes[:i])
                if can_meet(tree, a, b) and pair(a.name, b.name) not in self.reasons
            ]
            # the moving one first: its sphere is tested against the oriented box of the other
            blocks = [(i, j) if self.nodes[i].carrier >= 0 else (j, i) for i, j in blocks]
            self._compiled = compile_model(self.robot, self.nodes, blocks)
        return self._compiled

    @property
    def lanes(self) -> SphereModel:
        """Arrays for the sphere kernels (layout: `apprehend.kernels.sphere`)."""
        if self._lanes is None:
            self._lanes = sphere_model(self.compiled, self.nodes, self.clearance)
        return self._lanes


def _shapes_of(body: Body | Geometry | Sequence[Geometry], name: str | None) -> tuple[tuple[Geometry, ...], str]:
    name = name or getattr(body, "name", None)
    if not name:
        raise InputError("shapes need a name, and at least one of them")
    return as_geometry(body, name), name


def obstacle_nodes(scene: Scene | None) -> tuple[Node, ...]:
    """Boxes, bodies and obstacles of a scene as fixed nodes."""
    if scene is None:
        return ()
    boxes = tuple(Node(box.name, -1, (Convex.box(box.size).at(box.pose),)) for box in scene.boxes)
    bodies = tuple(
        Node(name, -1, tuple(shape.at(placed.pose) for shape in as_geometry(placed.body, name)))
        for name, placed in scene.bodies.items()
    )
    return boxes + bodies + tuple(Node(name, -1, other.shapes) for name, other in scene.obstacles.items())
