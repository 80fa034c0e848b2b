"""The room that a jaw needs: convex pieces of its links at several openings, also swept along the approach."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from ..arrays import Array, IntArray
from ..errors import DescriptionError
from ..kernels import grasp as kernels
from ..kernels.rays import Tree
from ..kinematics import Hand
from ..parallel import over_ranges
from ..robots.meshes import shape_surface

LEVELS = 9
"""Openings at which the swept pieces are prepared."""
FACES = 36
"""Planes kept for a convex piece; a finer one is enclosed by its largest facets, so that the piece only grows."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A convex piece of one link: corners ``(V, 3)`` and planes ``n·x ≤ d`` ``(P, 4)`` in the link frame."""

    link: str
    corners: Array
    planes: Array
    pad: bool


@dataclass(frozen=True, eq=False)
class Postures:
    """Convex pieces of a hand in several postures, in the hand frame, laid out for `kernels.grasp.hand_hits`."""

    planes: Array  # (L, P, 4)
    plane_start: IntArray
    corners: Array  # (L, V, 3)
    corner_start: IntArray
    links: tuple[str, ...]  # of each piece

    def obstacles(
        self, tree: Tree, poses: Array, level: IntArray, table: Array, margins: Array, room: float
    ) -> IntArray:
        """What each pose ``(N, 4, 4)`` T_body_hand in posture ``level (N,)`` hits: see `kernels.grasp.hand_hits`."""
        out = np.empty(len(poses), np.int64)
        poses = np.ascontiguousarray(poses)

        def work(a: int, b: int) -> None:
            kernels.hand_hits(
                tree, poses[a:b], level[a:b], self.planes, self.plane_start, self.corners, self.corner_start,
                margins, table, room, out[a:b],
            )  # fmt: skip

        over_ranges(work, len(poses), 64)
        return out


_pieces: WeakKeyDictionary[Hand, tuple[Piece, ...]] = WeakKeyDictionary()
_swept: WeakKeyDictionary[Hand, dict[float, tuple[Array, Postures]]] = WeakKeyDictionary()


def pieces_of(hand: Hand) -> tuple[Piece, ...]:
    """The convex pieces of all links: the hull of each collision shape, or of each visual where no shape collides."""
    if hand not in _pieces:
        links = hand.robot.description.links
        visual = not any(link.collisions for link in links.values())
        pads = set(hand.jaw.pad_links)
        found = []
        for name, link in links.items():
            for shape in link.visuals if visual else link.collisions:
                corners, planes = enclosed(shape_surface(shape)[0])
                found.append(Piece(name, corners, planes, name in pads))
        if not found:
            raise DescriptionError(f"hand {hand.name!r} has no geometry, so its room cannot be checked")
        _pieces[hand] = tuple(found)
    return _pieces[hand]


def enclosed(points: Array, faces: int = FACES) -> tuple[Array, Array]:
    """Corners ``(V, 3)`` of the hull of *points*, and at most ``faces + 6`` planes ``n·x ≤ d`` that enclose it."""
    from scipy.spatial import ConvexHull, QhullError

    spread = points.max(axis=0) - points.min(axis=0)
    try:
        if spread.min() <= 1e-9:
            raise QhullError
        hull = ConvexHull(points)
    except QhullError:  # a flat piece: give it a thickness of a tenth of a millimetre
        points = np.concatenate([points - 5e-5, points + 5e-5])
        hull = ConvexHull(points, qhull_options="QJ")
    corners = points[hull.vertices]
    tri = points[hull.simplices]
    area = 0.5 * np.linalg.norm(np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0]), axis=1)
    normals = hull.equations[:, :3]
    rounded, index = np.unique(np.round(normals, 6), axis=0, return_inverse=True)
    weight = np.bincount(index.ravel(), area)
    order = np.argsort(-weight, kind="stable")
    chosen = [np.eye(3), -np.eye(3)]
    if len(order) <= faces:
        chosen.append(rounded)
    else:
        kept = np.empty((0, 3))
        for spacing in (0.3, 0.15, 0.0):
            for i in order:
                if len(kept) < faces and (not len(kept) or (kept @ rounded[i]).max() < np.cos(spacing) + 1e-9):
                    kept = np.concatenate([kept, rounded[i : i + 1]])
        chosen.append(kept)
    directions = np.concatenate(chosen)
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return corners, np.column_stack([directions, (directions @ corners.T).max(axis=1)])


def at(hand: Hand, widths: Array) -> Postures:
    """The pieces with the pads ``widths (L,)`` apart."""
    pieces = pieces_of(hand)
    q = hand.jaw.q_at(widths)
    planes, corners = [], []
    for piece in pieces:
        T = hand.robot.fk(q, piece.link)
        R, p = T[:, :3, :3], T[:, :3, 3]
        n = np.einsum("lij,pj->lpi", R, piece.planes[:, :3])
        planes.append(np.concatenate([n, (piece.planes[:, 3] + np.einsum("lpi,li->lp", n, p))[..., None]], axis=2))
        corners.append(np.einsum("lij,vj->lvi", R, piece.corners) + p[:, None])
    return _laid_out(planes, corners, tuple(p.link for p in pieces))


def swept(hand: Hand, distance: float) -> tuple[Array, Postures]:
    """Openings ``(L,)``, ascending, and the pieces there, swept back by *distance* against the approach direction."""
    cache = _swept.setdefault(hand, {})
    if distance not in cache:
        jaw, pieces = hand.jaw, pieces_of(hand)
        widths = np.linspace(jaw.min_width, jaw.max_width, LEVELS)
        z = jaw.tcp_at(widths)[:, :3, 2]
        q = jaw.q_at(widths)
        planes, corners = [], []
        for piece in pieces:
            T = hand.robot.fk(q, piece.link)
            per_level = []
            for R, p, back in zip(T[:, :3, :3], T[:, :3, 3], z, strict=True):
                placed = piece.corners @ R.T + p
                per_level.append(enclosed(np.concatenate([placed, placed - distance * back])))
            most_c, most_p = (max(len(x[k]) for x in per_level) for k in range(2))
            corners.append(np.stack([_filled(c, most_c) for c, _ in per_level]))
            planes.append(np.stack([_filled(p, most_p) for _, p in per_level]))
        cache[distance] = (widths, _laid_out(planes, corners, tuple(p.link for p in pieces)))
    return cache[distance]


def _filled(rows: Array, count: int) -> Array:
    """*rows* with the first one repeated up to *count*."""
    return np.concatenate([rows, np.repeat(rows[:1], count - len(rows), axis=0)])


def _laid_out(planes: list[Array], corners: list[Array], links: tuple[str, ...]) -> Postures:
    return Postures(
        np.ascontiguousarray(np.concatenate(planes, axis=1)),
        np.cumsum([0, *(p.shape[1] for p in planes)]).astype(np.int64),
        np.ascontiguousarray(np.concatenate(corners, axis=1)),
        np.cumsum([0, *(c.shape[1] for c in corners)]).astype(np.int64),
        links,
    )
