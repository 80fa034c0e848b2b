"""What planning needs to know of a hand with several fingers: shapes of its links, pads, and what moves what."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..errors import DescriptionError
from ..kernels import touch
from ..kernels.gjk import BOX
from ..kinematics import Hand, Robot
from ..parallel import over_ranges
from ..robots import attach
from ..robots.description import Description, Joint, JointLimits, JointType, Link
from .surface import Surface

if TYPE_CHECKING:
    from ..collision import CollisionModel, Convex

POSTURES = 20000
"""Random postures that are judged as pre-grasps."""
CAGES = 300
"""How many of them are kept."""
APART = 0.01
"""Fingers that close on one place aim this far from it, each from its own side, in m."""
LEAST_SHARE = 0.08
"""Every pad presses at least with that share of all forces when pads are asked how well they oppose each other."""
SPAN = 2.0
"""A floating palm may turn this much beyond a half turn, and move this many reaches of the hand, either way."""


@dataclass(frozen=True, eq=False)
class Cages:
    """Pre-grasp postures ``q (P, n)`` whose pads all face one place, the *focus* ``(P, 3)`` in the hand frame.

    *targets* ``(P, k, 3)``: where the pads go when they close, each a little to its own side of the focus (or of the
    line through it that long things lie along); *approach* ``(P, 3)``: from the palm to the focus.
    """

    q: Array
    focus: Array
    targets: Array
    approach: Array


class Fingers:
    """A hand whose links are convex shapes, with one pad on the last link of every finger.

    The pad is where the shape of the last link reaches farthest along the mean of two directions: that in which
    closing moves it, and that of the finger.
    """

    def __init__(self, hand: Hand) -> None:
        from ..collision.shapes import shape_convexes

        self.hand, self.robot = hand, hand.robot
        if len(hand.fingers) < 2:
            raise DescriptionError(f"hand {hand.name!r} has {len(hand.fingers)} finger; planning needs two or more")
        description = self.robot.description
        visual = not any(link.collisions for link in description.links.values())
        shapes: list[Convex] = []
        owners: list[int] = []
        for i, name in enumerate(self.robot.frame_names):
            link = description.links[name]
            found = [c for shape in (link.visuals if visual else link.collisions) for c in shape_convexes(shape)]
            shapes += found
            owners += [i] * len(found)
        if not shapes:
            raise DescriptionError(f"hand {hand.name!r} has no geometry, so its contacts cannot be planned")
        self.shapes = tuple(shapes)
        self.owner: IntArray = np.array(owners)
        """Frame of each shape."""
        self.tips = tuple(f.tip for f in hand.fingers)
        self._arrays = _packed(self.shapes)
        self._offsets = np.stack([s.pose for s in self.shapes])
        self.halves = np.array([s.half for s in self.shapes])
        """Half the edges ``(S, 3)`` of a box around each shape in its own axes."""

    @cached_property
    def moves(self) -> BoolArray:
        """``(S, n)``: whether a coordinate moves a shape."""
        chains = [set(self.robot.chain(name)) for name in self.robot.frame_names]
        return np.array([[j in chains[o] for j in range(self.robot.n)] for o in self.owner])

    @cached_property
    def coordinates(self) -> tuple[IntArray, ...]:
        """For each finger its coordinates that move no other finger: those that close it."""
        chains = [set(self.robot.chain(tip)) for tip in self.tips]
        own = []
        for i, chain in enumerate(chains):
            others = set().union(*(c for j, c in enumerate(chains) if j != i))
            own.append(np.array(sorted(chain - others) or sorted(chain), dtype=np.int64))
        return tuple(own)

    @cached_property
    def reach(self) -> float:
        """Bound of the distance of any point of the hand from any joint axis that moves it, in m."""
        joints = self.robot.description.joints
        length = {self.robot.description.root: 0.0}
        for joint in joints:
            slide = 0.0
            if joint.type is JointType.PRISMATIC and joint.limits is not None:
                slide = max(abs(joint.limits.lower), abs(joint.limits.upper))
            length[joint.child] = length[joint.parent] + float(np.linalg.norm(joint.pose[:3, 3])) + slide
        names = self.robot.frame_names
        return max(
            length[names[o]] + float(np.linalg.norm(s.ball[0])) + s.ball[1]
            for o, s in zip(self.owner, self.shapes, strict=True)
        )

    def shape_poses(self, q: Array, T_body_hand: Array) -> Array:
        """T_body_shape ``(N, S, 4, 4)``."""
        out: Array = T_body_hand[:, None] @ self.robot.fk(q)[:, self.owner] @ self._offsets
        return out

    def distances(
        self, surface: Surface, q: Array, T_body_hand: Array, within: float, wanted: BoolArray | None = None
    ) -> tuple[Array, Array]:
        """Distance ``(N, S)`` of every shape from the surface, at most *within*, and the nearest points
        ``(N, S, 2, 3)`` on shape and surface, in the frame of the body."""
        poses = np.ascontiguousarray(self.shape_poses(q, T_body_hand))
        count = len(poses)
        look = np.ones(poses.shape[:2], np.bool_) if wanted is None else np.ascontiguousarray(wanted)
        distance, near = np.empty(poses.shape[:2]), np.zeros((*poses.shape[:2], 2, 3))

        def work(a: int, b: int) -> None:
            touch.distances(surface.tree, *self._arrays, poses[a:b], look[a:b], float(within), distance[a:b], near[a:b])

        over_ranges(work, count, 8)
        return distance, near

    @cached_property
    def own(self) -> CollisionModel:
        """The hand against itself."""
        from ..collision import CollisionModel

        return CollisionModel(self.robot)

    @cached_property
    def pads(self) -> tuple[Array, Array]:
        """Points and outward normals of the pads ``(k, 3)`` in the frames of the tips."""
        robot = self.robot
        middle = 0.5 * (robot.limits.lower + robot.limits.upper)
        straight = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
        q = 0.5 * (straight + middle)
        tips = np.stack(
            [robot.fk(q, f.tip)[:3, :3] @ f.tip_point + robot.fk(q, f.tip)[:3, 3] for f in self.hand.fingers]
        )
        points, normals = np.empty((len(self.tips), 3)), np.empty((len(self.tips), 3))
        for i, finger in enumerate(self.hand.fingers):
            T = robot.fk(q, finger.tip)
            J = robot.jacobian(q, finger.tip)
            own = self.coordinates[i]
            arm = tips[i] - T[:3, 3]
            slopes = J[:3, own] + np.cross(J[3:, own], arm, axisa=0).T
            others = tips[np.arange(len(tips)) != i].mean(axis=0) - tips[i]
            closing = slopes @ (slopes.T @ others)  # towards the other fingers, as the joints can
            along = T[:3, :3] @ finger.tip_point
            closing -= (closing @ along) / max(float(along @ along), 1e-12) * along
            direction = _unit(T[:3, :3].T @ (_unit(closing) + 0.5 * _unit(along)))
            shapes = [s for o, s in zip(self.owner, self.shapes, strict=True) if robot.frame_names[o] == finger.tip]
            points[i] = max(
                (_support(s, direction) for s in shapes), key=lambda p: float(p @ direction), default=T[3, :3]
            )
            normals[i] = direction
        return points, normals

    def pad_places(self, q: Array) -> tuple[Array, Array]:
        """Where the pads are and which way they face, ``(N, k, 3)`` each, in the hand frame."""
        points, normals = self.pads
        T = np.stack([self.robot.fk(q, tip) for tip in self.tips], axis=-3)
        return (
            np.einsum("nkij,kj->nki", T[..., :3, :3], points) + T[..., :3, 3],
            np.einsum("nkij,kj->nki", T[..., :3, :3], normals),
        )

    @cached_property
    def cages(self) -> Cages:
        """Random postures whose pads face one place from around it: where an object can be held.

        The focus is the point nearest to the rays that leave the pads. Half of the postures are for round things, half
        for long ones: a posture is better the nearer the rays pass the focus, or any line through it, and the better
        the pads can oppose each other; it must not collide with itself, nor have the focus behind a pad.
        """
        robot = self.robot
        rng = np.random.default_rng(0xCA6E)
        q = rng.uniform(robot.limits.lower, robot.limits.upper, (POSTURES, robot.n))
        points, normals = self.pad_places(q)
        A = np.eye(3) - normals[..., :, None] * normals[..., None, :]
        focus = np.linalg.solve(A.sum(axis=1) + 1e-3 * np.eye(3), np.einsum("nkij,nkj->ni", A, points)[..., None])[
            ..., 0
        ]
        to = focus[:, None] - points
        depth = np.einsum("nki,nki->nk", to, normals)
        aside = np.einsum("nkij,nkj->nki", A, to)
        line = np.linalg.eigh(np.einsum("nki,nkj->nij", aside, aside))[1][..., -1]  # what most misses lie along
        across = aside - np.einsum("nki,ni->nk", aside, line)[..., None] * line[:, None]
        unopposed = 10.0 * (depth.min(axis=1) < 0.05 * self.reach) + _unopposed(normals)
        shift = np.einsum("nki,ni->nk", -to, line)[..., None] * line[:, None]
        kept: list[int] = []
        ends: list[Array] = []
        for miss in (aside, across):
            score = unopposed + 10.0 * np.linalg.norm(miss, axis=-1).mean(axis=1) / self.reach
            first = np.argsort(score, kind="stable")[: 3 * CAGES]
            first = first[~np.isin(first, kept)]
            first = first[self.own.free(q[first])][: CAGES // 2]
            place = focus[first, None] + (shift[first] if miss is across else 0.0)
            ends.append(place + APART * _unit(points[first] - place))
            kept += first.tolist()
        order = np.array(kept, dtype=np.int64)
        if not len(order):
            raise DescriptionError(
                f"hand {self.hand.name!r} collides with itself in all postures that were tried; is its geometry right?"
            )
        palm = robot.fk(q[order], self.hand.palm)
        own = [s for o, s in zip(self.owner, self.shapes, strict=True) if robot.frame_names[o] == self.hand.palm]
        middle = np.mean([s.ball[0] for s in own], axis=0) if own else np.zeros(3)
        towards = focus[order] - (palm[:, :3, :3] @ middle + palm[:, :3, 3])
        return Cages(q[order], focus[order], np.concatenate(ends), _unit(towards))

    @cached_property
    def floating(self) -> Robot:
        """The hand on a palm that moves freely: x, y, z and three turns come first; its pads are frames ``pad_0`` …,
        with z out of the finger."""
        description = self.robot.description
        span = SPAN * self.reach
        links, joints, parent = {"ground": Link("ground")}, [], "ground"
        for i, name in enumerate(("x", "y", "z", "turn_z", "turn_y", "turn_x")):
            slide = i < 3
            bound = span if slide else np.pi + SPAN
            axis = np.eye(3)[i if slide else 5 - i]
            kind = JointType.PRISMATIC if slide else JointType.REVOLUTE
            limits = JointLimits(-bound, bound, 1.0, 1.0, 1.0)
            links[f"float_{name}"] = Link(f"float_{name}")
            joints.append(Joint(f"float_{name}", kind, parent, f"float_{name}", np.eye(4), axis, limits))
            parent = f"float_{name}"
        ground = Description("floating", "ground", links, tuple(joints))
        whole = attach(ground, description, parent)
        pads = {f"pad_{i}": Link(f"pad_{i}") for i in range(len(self.tips))}
        welds = []
        for i, (tip, point, normal) in enumerate(zip(self.tips, *self.pads, strict=True)):
            T = np.eye(4)
            x = _unit(np.cross(np.eye(3)[int(np.argmin(np.abs(normal)))], normal))
            T[:3, :3], T[:3, 3] = np.stack([x, np.cross(normal, x), normal], axis=1), point
            welds.append(Joint(f"weld_{i}", JointType.FIXED, tip, f"pad_{i}", T))
        return Robot(replace(whole, links={**whole.links, **pads}, joints=(*whole.joints, *welds)))


_known: WeakKeyDictionary[Hand, Fingers] = WeakKeyDictionary()


def fingers_of(hand: Hand) -> Fingers:
    """The `Fingers` of a hand, made once."""
    if hand not in _known:
        _known[hand] = Fingers(hand)
    return _known[hand]


def _unit(v: Array) -> Array:
    out: Array = v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)
    return out


def _unopposed(normals: Array) -> Array:
    """How far from zero ``(N,)`` the best mixture of unit vectors ``(N, k, 3)`` stays in which each has a share."""
    k = normals.shape[1]
    share = np.full(normals.shape[:2], 1.0 / k)
    free = 1.0 - k * LEAST_SHARE
    for step in range(12):
        total = np.einsum("nk,nki->ni", share, normals)
        corner = np.eye(k)[np.argmin(np.einsum("nki,ni->nk", normals, total), axis=1)]
        share += 2.0 / (step + 3.0) * (LEAST_SHARE + free * corner - share)
    out: Array = np.linalg.norm(np.einsum("nk,nki->ni", share, normals), axis=-1)
    return out


def _support(shape: Convex, direction: Array) -> Array:
    """The point of a shape that is farthest along *direction*, in the frame of its carrier."""
    d = shape.pose[:3, :3].T @ direction
    if len(shape.points):
        local = shape.points[int(np.argmax(shape.points @ d))]
    elif shape.kind == BOX:
        local = np.copysign(shape.size, d)
    else:
        across = d[:2] / max(float(np.linalg.norm(d[:2])), 1e-12)
        local = np.append(shape.size[0] * across, np.copysign(shape.size[1], d[2]))
    out: Array = shape.pose[:3, :3] @ (local + shape.radius * d) + shape.pose[:3, 3]
    return out


def _packed(shapes: tuple[Convex, ...]) -> tuple[IntArray, Array, Array, IntArray]:
    """The shapes and a triangle behind them in the layout of `kernels.gjk`, each in its own frame."""
    count = len(shapes)
    ints, floats = np.zeros((count + 1, 4), np.int64), np.zeros((count + 1, 23))
    points, ends, around = [], [0], list[int]()
    start = 0
    for i, shape in enumerate(shapes):
        ints[i, :3] = shape.kind, start, len(shape.points)
        floats[i, :3], floats[i, 3], floats[i, 20:] = shape.size, shape.radius, shape.half
        points.append(shape.points)
        last, near = shape.graph
        ends += (len(around) + last).tolist()
        around += near.tolist()
        start += len(shape.points)
    ints[count, 1:3] = start, 3
    triangle = [[1, 2], [0, 2], [0, 1]]
    for row in triangle:
        around += row
        ends.append(len(around))
    graph = np.concatenate([np.array(ends) + len(ends), np.array(around)]).astype(np.int64)
    return ints, floats, np.concatenate([*points, np.zeros((3, 3))]), graph
