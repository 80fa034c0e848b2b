"""`Arrangement`: what can collide — links, attached bodies, obstacles — and which of it may touch."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Self
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_pose
from ..errors import InputError, expect, unknown_name
from ..kernels.collide import CollideModel
from ..kernels.sphere import SphereModel
from ..kinematics import Robot
from .allowed import SAMPLES, by_sampling, srdf_pairs
from .compiled import Alone
from .geometry import Geometry
from .nodes import Node, Pair, link_nodes, matrix, moving, pair, slide_bounds
from .obstacles import as_geometry
from .shapes import Convex

if TYPE_CHECKING:
    from pathlib import Path

    from ..bodies import Body
    from ..robots import Semantics
    from .scene import Scene

RESOLUTION = 2e-5
"""Default of `CollisionModel.resolution`, in m."""


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
        expect(robot, "Robot", "robot")
        if scene is not None:
            expect(scene, "Scene", "scene")
        if clearance is None:
            clearance = scene.clearance if scene is not None else 0.0
        if not (math.isfinite(clearance) and clearance >= 0.0):
            raise InputError(f"clearance is {clearance}; expected 0 or more, in m")
        if not (math.isfinite(resolution) and resolution > 0.0):
            raise InputError(f"resolution is {resolution}; expected a positive length in m")
        self.robot = robot
        self.clearance = float(clearance)
        self.resolution = float(resolution)
        alone, found = robot_alone(robot, geometry, self.clearance)
        self.nodes: tuple[Node, ...] = alone.nodes + obstacle_nodes(scene)
        names = {n.name for n in alone.nodes}
        twice = sorted(names & {n.name for n in self.nodes[len(names) :]})
        if twice:
            raise InputError(f"{twice[0]!r} names both a link of the robot and an obstacle; rename the obstacle")
        self._alone, self._links, self._others = alone, found, dict[Pair, str]()
        self._compiled: CollideModel | None = None
        self._lanes: SphereModel | None = None
        by_scene = scene.allowed if scene is not None else ()
        self._allow(self._checked_pairs(allowed) | {pair(a, b): "allowed by the scene" for a, b in by_scene})

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

    @cached_property
    def reasons(self) -> Mapping[Pair, str]:
        """Why each allowed pair may touch."""
        return {**self._links, **self._others}

    def _allow(self, pairs: Mapping[Pair, str]) -> None:
        """Take *pairs* into a model that is being made."""
        links = {node.name for node in self._alone.nodes}
        own = {p: reason for p, reason in pairs.items() if p <= links}
        self._others = {**self._others, **{p: reason for p, reason in pairs.items() if p not in own}}
        if own:
            self._links = {**self._links, **own}
            self._alone = self._alone.allowing(self._links.keys())

    def _with(self, nodes: tuple[Node, ...] | None = None, without: str | None = None) -> Self:
        """A model with these *nodes* instead, *without* what was allowed to touch the thing of that name."""
        other = object.__new__(type(self))
        other.robot, other.clearance, other.resolution = self.robot, self.clearance, self.resolution
        other.nodes = self.nodes if nodes is None else nodes
        other._alone, other._links, other._others = self._alone, self._links, self._others
        if without is not None:
            other._others = {p: reason for p, reason in self._others.items() if without not in p}
        other._compiled = other._lanes = None
        return other

    def allow(self, pairs: Iterable[tuple[str, str]]) -> Self:
        """The model in which these pairs of names may touch, too."""
        other = self._with()
        other._allow(self._checked_pairs(pairs))
        return other

    def allow_srdf(self, source: str | Path | Semantics) -> Self:
        """The model in which the pairs of an SRDF may touch, too: a file's path, its text, or read already.

        Raises `DescriptionError` for links that the robot does not have.
        """
        other = self._with()
        other._allow(srdf_pairs(source, self.robot))
        return other

    def forbid(self, pairs: Iterable[tuple[str, str]]) -> Self:
        """The model in which these pairs of names are checked again."""
        checked = self._checked_pairs(pairs)
        other = self._with()
        other._others = {p: reason for p, reason in self._others.items() if p not in checked}
        if not checked.keys().isdisjoint(self._links):
            other._links = {p: reason for p, reason in self._links.items() if p not in checked}
            other._alone = self._alone.allowing(other._links.keys())
        return other

    def with_clearance(self, clearance: float, resolution: float | None = None) -> Self:
        """The model with another clearance (and resolution)."""
        if not (math.isfinite(clearance) and clearance >= 0.0):
            raise InputError(f"clearance is {clearance}; expected 0 or more, in m")
        other = self._with()
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
        if name in self.robot.frame_names:
            raise InputError(f"{name!r} is a link of the robot; an attached body needs another name")
        f = self.robot.frame_index(frame)
        tree = self.robot.model
        carrier = int(tree.frame_joint[f])
        T = as_pose(pose, "pose")
        place = matrix(tree.frame_place[f]) @ T
        node = moving(self.robot, Node(name, carrier, tuple(shape.at(place) for shape in shapes), frame, T))
        if touching is None:
            touching = [n.name for n in self.nodes if n.attached_to is None and self._beyond(n.carrier, carrier)]
        model = self._with((*(n for n in self.nodes if n.name != name), node), name)
        model._allow(dict.fromkeys(model._checked_pairs((name, link) for link in touching), "holds the body"))
        return model

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
        if pose is not None:
            f = self.robot.frame_index(node.attached_to)
            back = np.linalg.inv(matrix(self.robot.model.frame_place[f]) @ node.pose)
            T = as_pose(pose, "pose") @ back
            others = (*others, Node(name, -1, tuple(shape.at(T) for shape in node.shapes)))
        return self._with(others, name)

    def add(self, name: str, body: Body | Geometry | Sequence[Geometry], pose: ArrayLike | None = None) -> Self:
        """The model with one more obstacle, or with another one of that name, at *pose* (T_world_body).

        What an obstacle may touch, another one of its name may touch; what an attached body may touch is forgotten.

        An obstacle is a body (its convex pieces), a distance field of one, or geometry of any kind: `Convex`,
        `HalfSpace`, `Cloud`, `Union`, `Grid`, or several of them.
        """
        if name in self.robot.frame_names:
            raise InputError(f"{name!r} is a link of the robot; an obstacle needs another name")
        T = np.eye(4) if pose is None else as_pose(pose, "pose")
        node = Node(name, -1, tuple(shape.at(T) for shape in _shapes_of(body, name)[0]))
        attached = any(n.name == name and n.attached_to is not None for n in self.nodes)
        return self._with((*(n for n in self.nodes if n.name != name), node), name if attached else None)

    def remove(self, name: str) -> Self:
        """The model without the obstacle or attached body *name*."""
        if self._node(name).name in self.robot.frame_names:
            raise InputError(f"{name!r} is a link of the robot; only obstacles and attached bodies can be removed")
        return self._with(tuple(n for n in self.nodes if n.name != name), name)

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
    def _around(self) -> tuple[Node, ...]:
        """What is no link of the robot."""
        return self.nodes[len(self._alone.nodes) :]

    @property
    def compiled(self) -> CollideModel:
        """Arrays for the kernels (layout: `apprehend.kernels.collide`)."""
        if self._compiled is None:
            self._compiled = self._alone.with_others(self._around, self._others)
        return self._compiled

    @property
    def lanes(self) -> SphereModel:
        """Arrays for the sphere kernels (layout: `apprehend.kernels.sphere`)."""
        if self._lanes is None:
            self._lanes = self._alone.on_lanes(self.compiled, self._around, self.clearance)
        return self._lanes


def robot_alone(
    robot: Robot, geometry: Mapping[str, Sequence[Convex]] | None, clearance: float
) -> tuple[Alone, dict[Pair, str]]:
    """The robot's links and which of them may touch, with the reasons; found once for a robot and its own geometry."""
    if geometry is not None:
        return _robot_alone(robot, link_nodes(robot, geometry), clearance)
    known = KNOWN.setdefault(robot, {})
    if clearance not in known:
        links = next(iter(known.values()))[0].nodes if known else link_nodes(robot)
        while len(known) >= MOST_CLEARANCES:
            del known[next(iter(known))]
        known[clearance] = _robot_alone(robot, links, clearance)
    return known[clearance]


def _robot_alone(robot: Robot, links: tuple[Node, ...], clearance: float) -> tuple[Alone, dict[Pair, str]]:
    found, _ = by_sampling(robot, links, clearance, SAMPLES, np.random.default_rng(0))
    return Alone(robot.model, links, found.keys()), found


KNOWN: WeakKeyDictionary[Robot, dict[float, tuple[Alone, dict[Pair, str]]]] = WeakKeyDictionary()
"""For the robots that are in use: what `robot_alone` found at some clearances. (A robot is a value.)"""

MOST_CLEARANCES = 4


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
