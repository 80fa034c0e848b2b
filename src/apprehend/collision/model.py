"""`CollisionModel`: a robot against itself and its surroundings, exactly on convex pieces, batched."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_pose, as_shaped
from ..errors import InputError, unknown_name
from ..kernels import collide, collide_edges, sphere
from ..kernels.collide import CollideModel
from ..kernels.sphere import SphereModel
from ..kinematics import Robot
from ..parallel import over_ranges
from .lanes_model import sphere_model
from .nodes import (
    Node,
    Pair,
    can_meet,
    compile_model,
    link_nodes,
    linkages,
    matrix,
    neighbours,
    pair,
)
from .shapes import Convex, hulls

if TYPE_CHECKING:
    from ..bodies import Body
    from .scene import Scene

SAMPLES = 500
"""Random configurations in which a pair of links is tried; a pair that always touches is allowed to."""

ALWAYS = 0.95
"""Share of the samples from which on a pair counts as always touching."""

RESOLUTION = 1e-3
"""Default of `CollisionModel.resolution`, in m."""

LANE_GRAIN = 512
"""The same, for spheres on lanes."""

WHOLE_TURNS = 1e4
"""Joint values above this, in rad, are left to the exact check: lanes reduce angles to 1e5 only."""

NONE = np.zeros(0, np.int64)
NO_BLOCKS = np.zeros(0)

GRAIN = 16
"""Smallest share of a batch that is worth a thread."""


@dataclass(frozen=True)
class Touch:
    """Two named things that are nearer than the clearance."""

    a: str
    b: str
    distance: float
    """Signed distance in m; negative: how deep they overlap."""

    def __str__(self) -> str:
        if self.distance < 0.0:
            return f"{self.a} is {-1e3 * self.distance:.1f} mm deep in {self.b}"
        return f"{self.a} is {1e3 * self.distance:.1f} mm from {self.b}"


@dataclass(frozen=True, eq=False)
class Closest:
    """The smallest distance in each configuration, and where."""

    distance: Array
    """``(...)`` signed distance in m; negative: penetration depth."""
    points: Array
    """``(..., 2, 3)`` the nearest (or deepest) points on the two shapes, in the world."""
    normal: Array
    """``(..., 3)`` unit vector along which the first moves away from the second."""
    names: tuple[tuple[str, str], ...]
    """The two names for each configuration of the flattened batch."""


class CollisionModel:
    """Which configurations and motions of a robot are free of collision.

    *clearance* (m) is how near two things may come; by default the scene's. *resolution* (m) bounds what a checked
    motion can miss: between the configurations that are checked nothing comes nearer than clearance − resolution.
    *allowed* are pairs of names that may touch, beyond those that are found: links that a joint connects, links that
    the description allows, couplings of one coordinate, and links that touch in nearly all random configurations.
    *geometry* maps links to shapes in the link's frame that stand for all collision geometry of the description: a
    hand-made model of spheres, for instance.

    Joint vectors are ``(..., n)`` of the whole robot. A model is a value: `attach`, `allow`, … make new ones.
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
        self.reasons: Mapping[Pair, str] = self._found_pairs(links)
        """Why each allowed pair may touch."""
        self._compiled: CollideModel | None = None
        self._lanes: SphereModel | None = None
        self.reasons = {**self.reasons, **self._checked_pairs(allowed)}

    # --- what may touch ------------------------------------------------------------------------------------------
    def _found_pairs(self, links: Sequence[Node]) -> dict[Pair, str]:
        description = self.robot.description
        reasons = dict.fromkeys(description.allowed_collisions, "allowed by the description")
        reasons |= dict.fromkeys(linkages(self.robot.model, links), "parts of one coupled mechanism")
        reasons |= dict.fromkeys(neighbours(description, {node.name for node in links}), "connected by a joint")
        blocks = [
            (i, j)
            for i, a in enumerate(links)
            for j, b in enumerate(links[:i])
            if can_meet(self.robot.model, a, b) and pair(a.name, b.name) not in reasons
        ]
        if not blocks:
            return reasons
        model = compile_model(self.robot, links, blocks)
        rng = np.random.default_rng(0)
        lower, upper = np.maximum(self.robot.limits.lower, -np.pi), np.minimum(self.robot.limits.upper, np.pi)
        q = rng.uniform(lower, upper, (SAMPLES, self.robot.n))
        hits = np.zeros(len(blocks), np.int64)
        collide.check(model, q, self.clearance, 0, SAMPLES, NONE, hits)
        for (i, j), count in zip(blocks, hits, strict=True):
            if count >= ALWAYS * SAMPLES:
                reasons[pair(links[i].name, links[j].name)] = "touch in nearly every configuration"
        return reasons

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

    def _with(self, nodes: tuple[Node, ...], reasons: Mapping[Pair, str]) -> CollisionModel:
        other = object.__new__(CollisionModel)
        other.robot, other.clearance, other.resolution = self.robot, self.clearance, self.resolution
        other.nodes, other.reasons, other._compiled, other._lanes = nodes, dict(reasons), None, None
        return other

    def allow(self, pairs: Iterable[tuple[str, str]]) -> CollisionModel:
        """The model in which these pairs of names may touch, too."""
        return self._with(self.nodes, {**self.reasons, **self._checked_pairs(pairs)})

    def forbid(self, pairs: Iterable[tuple[str, str]]) -> CollisionModel:
        """The model in which these pairs of names are checked again."""
        checked = self._checked_pairs(pairs)
        return self._with(self.nodes, {p: reason for p, reason in self.reasons.items() if p not in checked})

    def with_clearance(self, clearance: float, resolution: float | None = None) -> CollisionModel:
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
        body: Body | Sequence[Convex],
        frame: str,
        pose: ArrayLike,
        *,
        name: str | None = None,
        touching: Iterable[str] | None = None,
    ) -> CollisionModel:
        """The model in which *body* moves with link *frame* at *pose* (T_frame_body); an obstacle of its name goes.

        *touching* names what may touch it: by default the links beyond *frame* and those that are rigid with it (a
        hand and its fingers).
        """
        shapes, name = _shapes_of(body, name)
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

    def detach(self, name: str, pose: ArrayLike | None = None) -> CollisionModel:
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

    def add(self, name: str, body: Body | Sequence[Convex], pose: ArrayLike) -> CollisionModel:
        """The model with one more obstacle, or with another one of that name, at *pose* (T_world_body)."""
        if name in self.robot.frame_names:
            raise InputError(f"{name!r} is a link of the robot; an obstacle needs another name")
        T = as_pose(pose, "pose")
        node = Node(name, -1, tuple(shape.at(T) for shape in _shapes_of(body, name)[0]))
        return self._with((*(n for n in self.nodes if n.name != name), node), self.reasons)

    def remove(self, name: str) -> CollisionModel:
        """The model without the obstacle or attached body *name*."""
        if self._node(name).name in self.robot.frame_names:
            raise InputError(f"{name!r} is a link of the robot; only obstacles and attached bodies can be removed")
        reasons = {p: reason for p, reason in self.reasons.items() if name not in p}
        return self._with(tuple(n for n in self.nodes if n.name != name), reasons)

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

    # --- questions -----------------------------------------------------------------------------------------------
    def _rows(self, q: ArrayLike, name: str = "q") -> tuple[Array, tuple[int, ...]]:
        q = as_shaped(q, name, self.robot.n)
        return np.array(q.reshape(-1, self.robot.n)), q.shape[:-1]

    def hits(self, q: ArrayLike) -> IntArray:
        """For every ``q (..., n)`` the number of a colliding pair of shapes, −1 where it is free."""
        rows, shape = self._rows(q)
        out = np.full(len(rows), -1, np.int64)
        model, margin = self.compiled, self.clearance
        if len(rows):
            over_ranges(lambda a, b: collide.check(model, rows, margin, a, b, out, NONE), len(rows), GRAIN)
        return out.reshape(shape)

    def free(self, q: ArrayLike) -> BoolArray:
        """Whether each ``q (..., n)`` keeps everything farther apart than the clearance."""
        rows, shape = self._rows(q)
        blocked = np.zeros(len(rows), np.int64)
        lanes, margin = self.lanes, self.clearance
        if len(rows):
            if np.abs(rows).max(initial=0.0) > WHOLE_TURNS:
                return np.asarray(self.hits(q) < 0)
            over_ranges(lambda a, b: sphere.check_lanes(lanes, rows, margin, a, b, blocked), len(rows), LANE_GRAIN)
        if not lanes.decides[0]:
            open_rows = np.flatnonzero(blocked)
            if len(open_rows):
                blocked[open_rows] = self.hits(rows[open_rows]) >= 0
        return np.asarray(blocked.reshape(shape) == 0)

    def edges_free(self, qa: ArrayLike, qb: ArrayLike, step: float | None = None) -> BoolArray:
        """Whether each straight motion ``qa → qb (..., n)`` is free, between the ends, too.

        Checked configurations are chosen so that no point moves farther from the nearest one than the distance that
        was found there, or than *step* in m (default: the model's resolution) where that is more. Nothing can be
        tunnelled: what goes unseen is nearer than the clearance by less than *step*.
        """
        step = self._step(step)
        a, b = np.broadcast_arrays(as_shaped(qa, "qa", self.robot.n), as_shaped(qb, "qb", self.robot.n))
        rows_a, shape = self._rows(a, "qa")
        rows_b, _ = self._rows(b, "qb")
        blocked = np.zeros(len(rows_a), np.int64)
        lanes, exact, margin = self.lanes, self.compiled, self.clearance

        def work(start: int, stop: int) -> None:
            collide_edges.edges(exact, lanes, rows_a, rows_b, NONE, margin, step, start, stop, blocked)

        if len(rows_a):
            over_ranges(work, len(rows_a), 1)
        return np.asarray(blocked.reshape(shape) == 0)

    def _step(self, step: float | None) -> float:
        step = self.resolution if step is None else step
        if not (math.isfinite(step) and step > 0.0):
            raise InputError(f"step is {step}; expected a positive length in m")
        return float(step)

    def edge_hits(self, qa: ArrayLike, qb: ArrayLike, step: float | None = None) -> tuple[IntArray, Array]:
        """As `edges_free`: the number of the pair of shapes that is hit (−1: free), and where (0 … 1)."""
        step = self._step(step)
        a, b = np.broadcast_arrays(as_shaped(qa, "qa", self.robot.n), as_shaped(qb, "qb", self.robot.n))
        rows_a, shape = self._rows(a, "qa")
        rows_b, _ = self._rows(b, "qb")
        out, where = np.full(len(rows_a), -1, np.int64), np.zeros(len(rows_a))
        model, margin = self.compiled, self.clearance

        def work(start: int, stop: int) -> None:
            collide_edges.edge_hits(model, rows_a, rows_b, margin, step, start, stop, out, where)

        if len(rows_a):
            over_ranges(work, len(rows_a), 1)
        return out.reshape(shape), where.reshape(shape)

    def path_free(self, path: ArrayLike) -> bool:
        """Whether the whole polyline ``(M, n)`` is free."""
        points = as_shaped(path, "path", self.robot.n)
        if points.ndim != 2:
            raise InputError(f"path has shape {points.shape}; expected (M, {self.robot.n})")
        if len(points) == 1:
            return bool(self.free(points).all())
        return bool(self.edges_free(points[:-1], points[1:]).all())

    def distance(self, q: ArrayLike) -> Array:
        """Smallest signed distance in m over all pairs that may not touch, for each ``q (..., n)``."""
        return self.closest(q).distance

    def closest(self, q: ArrayLike) -> Closest:
        """Smallest signed distance for each ``q (..., n)``, with its points, normal and names."""
        rows, shape = self._rows(q)
        distance, number, out = self._nearest(rows)
        names = tuple(self.names_of(int(p)) for p in number)
        points = out[:, :6].reshape(*shape, 2, 3)
        return Closest(distance.reshape(shape), points, out[:, 6:].reshape(*shape, 3), names)

    def distance_gradient(self, q: ArrayLike) -> tuple[Array, Array]:
        """Smallest signed distance ``(...)`` for each ``q (..., n)`` and its derivative ``(..., n)`` by q.

        ∂d/∂q = nᵀ (J_a(p_a) − J_b(p_b)): witness points fixed to their links, n the normal between them. Where two
        pairs are equally near, or a face is parallel to another, it is one of the possible slopes.
        """
        rows, shape = self._rows(q)
        distance, number, out = self._nearest(rows)
        slope, model = np.zeros_like(rows), self.compiled
        if len(rows):
            over_ranges(lambda a, b: collide.gradients(model, rows, number, out, a, b, slope), len(rows), GRAIN)
        return distance.reshape(shape), slope.reshape(*shape, self.robot.n)

    def _nearest(self, rows: Array) -> tuple[Array, IntArray, Array]:
        model = self.compiled
        distance, number, out = np.full(len(rows), np.inf), np.full(len(rows), -1, np.int64), np.zeros((len(rows), 9))
        if len(model.pairs) == 0:
            raise InputError("there is no pair of things that could collide, so there is no distance")
        if len(rows):
            over_ranges(
                lambda a, b: collide.distances(model, rows, math.inf, a, b, distance, number, out, NO_BLOCKS),
                len(rows),
                GRAIN,
            )
        return distance, number, out

    def why(self, q: ArrayLike) -> tuple[Touch, ...]:
        """What is nearer than the clearance in one configuration ``q (n,)``, the worst first."""
        q = as_shaped(q, "q", self.robot.n)
        if q.ndim != 1:
            raise InputError(f"q has shape {q.shape}; expected one configuration ({self.robot.n},)")
        model = self.compiled
        gap, row = np.zeros(len(model.blocks)), np.array(q)[None]
        least, number, points = np.zeros(1), np.zeros(1, np.int64), np.zeros((1, 9))
        if len(gap):
            collide.distances(model, row, self.clearance + 1e-9, 0, 1, least, number, points, gap)
        touching = [
            Touch(self.nodes[a].name, self.nodes[b].name, float(d))
            for (a, b), d in zip(model.blocks[:, :2], gap, strict=True)
            if d <= self.clearance
        ]
        return tuple(sorted(touching, key=lambda touch: touch.distance))

    def names_of(self, number: int) -> tuple[str, str]:
        """The two names of a pair of shapes that `hits` answered."""
        model = self.compiled
        for a, b, begin, end in model.blocks[:, :4]:
            if begin <= number < end:
                return self.nodes[a].name, self.nodes[b].name
        raise InputError(f"there is no pair {number}")

    @cached_property
    def unmodelled(self) -> tuple[str, ...]:
        """Links without collision geometry."""
        names = set(self.names)
        return tuple(link for link in self.robot.frame_names if link not in names)

    def __repr__(self) -> str:
        moving = sum(node.carrier >= 0 for node in self.nodes)
        return f"<CollisionModel of {self.robot.name!r}: {moving} moving, {len(self.nodes) - moving} standing things>"


def _shapes_of(body: Body | Sequence[Convex], name: str | None) -> tuple[tuple[Convex, ...], str]:
    if isinstance(body, Sequence):
        if not body or name is None:
            raise InputError("shapes need a name, and at least one of them")
        return tuple(body), name
    return hulls(body.convex_pieces), name or body.name


def obstacle_nodes(scene: Scene | None) -> tuple[Node, ...]:
    """Boxes and bodies of a scene as fixed nodes."""
    if scene is None:
        return ()
    boxes = tuple(Node(box.name, -1, (Convex.box(box.size).at(box.pose),)) for box in scene.boxes)
    bodies = tuple(
        Node(name, -1, tuple(shape.at(placed.pose) for shape in hulls(placed.body.convex_pieces)))
        for name, placed in scene.bodies.items()
    )
    return boxes + bodies
