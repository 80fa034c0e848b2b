"""`CollisionModel`: a robot against itself and its surroundings, exactly on convex pieces, batched.

Questions about configurations and motions; what there is to collide is an `Arrangement`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_shaped
from ..errors import InputError
from ..kernels import collide, collide_edges, collide_sweep, sphere
from ..parallel import over_ranges
from .arrangement import Arrangement

GRAIN = 16
"""Smallest share of a batch that is worth a thread."""

LANE_GRAIN = 512
"""The same, for spheres on lanes."""


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


@dataclass(frozen=True, eq=False)
class PairDistances:
    """The smallest distance of each pair of things that may not touch, in each configuration."""

    names: tuple[tuple[str, str], ...]
    """The B pairs."""
    distance: Array
    """``(..., B)`` signed distance in m; a lower bound for pairs that are farther apart than was asked for."""
    gradient: Array
    """``(..., B, n)`` its derivative by q; zero for those pairs."""
    points: Array
    """``(..., B, 2, 3)`` the nearest (or deepest) points; zero for those pairs."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """How much of each motion is proven free, and what ends it."""

    free: BoolArray
    """``(...)`` whether the whole motion is: nothing comes nearer than the clearance, at any instant."""
    until: Array
    """``(...)`` 0 … 1: up to there it is; then something is nearer than clearance + tolerance."""
    names: tuple[tuple[str, str] | None, ...]
    """What that is, for each motion of the flattened batch; None where it is free."""


class CollisionModel(Arrangement):
    """Which configurations and motions of a robot are free of collision.

    *clearance* (m) is how near two things may come; by default the scene's. *resolution* (m) bounds what a checked
    motion can miss: between the configurations that are checked nothing comes nearer than clearance − resolution.
    *allowed* are pairs of names that may touch, beyond those that are found: links that a joint connects, links that
    the description allows, couplings of one coordinate, and links that touch in nearly all random configurations.
    *geometry* maps links to shapes in the link's frame that stand for all collision geometry of the description: a
    hand-made model of spheres, for instance.

    Joint vectors are ``(..., n)`` of the whole robot. A model is a value: `attach`, `allow`, … make new ones.
    """

    def _rows(self, q: ArrayLike, name: str = "q") -> tuple[Array, tuple[int, ...]]:
        q = as_shaped(q, name, self.robot.n)
        return np.array(q.reshape(-1, self.robot.n)), q.shape[:-1]

    def hits(self, q: ArrayLike) -> IntArray:
        """For every ``q (..., n)`` the number of a colliding pair of shapes, −1 where it is free."""
        rows, shape = self._rows(q)
        out = np.full(len(rows), -1, np.int64)
        model, margin = self.compiled, self.clearance
        if len(rows):
            over_ranges(lambda a, b: collide.check(model, rows, margin, a, b, out), len(rows), GRAIN)
        return out.reshape(shape)

    def free(self, q: ArrayLike) -> BoolArray:
        """Whether each ``q (..., n)`` keeps everything farther apart than the clearance."""
        rows, shape = self._rows(q)
        blocked = np.zeros(len(rows), np.int64)
        lanes, margin = self.lanes, self.clearance
        if len(rows):
            if np.abs(rows).max(initial=0.0) > sphere.WHOLE_TURNS:
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
        rows_a, rows_b, shape = self._motions(qa, qb)
        blocked = np.zeros(len(rows_a), np.int64)
        lanes, exact, margin = self.lanes, self.compiled, self.clearance
        every = _neighbours(len(rows_a))

        def work(start: int, stop: int) -> None:
            collide_edges.edges(exact, lanes, rows_a, rows_b, margin, step, every, start, stop, blocked)

        if len(rows_a):
            over_ranges(work, len(rows_a), step=every)
        return np.asarray(blocked.reshape(shape) == 0)

    def _motions(self, qa: ArrayLike, qb: ArrayLike) -> tuple[Array, Array, tuple[int, ...]]:
        a, b = np.broadcast_arrays(as_shaped(qa, "qa", self.robot.n), as_shaped(qb, "qb", self.robot.n))
        rows_a, shape = self._rows(a, "qa")
        rows_b, _ = self._rows(b, "qb")
        coordinate, gain, most = self.travel
        for name, rows in (("qa", rows_a), ("qb", rows_b)):
            slides = np.abs(rows[:, coordinate] * gain[:, 0] + gain[:, 1])
            if (slides > most * (1.0 + 1e-9) + 1e-9).any():
                i, j = np.argwhere(slides > most * (1.0 + 1e-9) + 1e-9)[0]
                joint = self.robot.joint_names[coordinate[j]]
                raise InputError(
                    f"{name} slides joint {joint!r} to {slides[i, j]:.4g} m from its zero; motions are bounded up "
                    f"to its limits only, {most[j]:.4g} m"
                )
        return rows_a, rows_b, shape

    def _step(self, step: float | None) -> float:
        step = self.resolution if step is None else step
        if not (math.isfinite(step) and step > 0.0):
            raise InputError(f"step is {step}; expected a positive length in m")
        return float(step)

    def edge_hits(self, qa: ArrayLike, qb: ArrayLike, step: float | None = None) -> tuple[IntArray, Array]:
        """As `edges_free`: the number of the pair of shapes that is hit (−1: free), and where (0 … 1)."""
        step = self._step(step)
        rows_a, rows_b, shape = self._motions(qa, qb)
        out, where = np.full(len(rows_a), -1, np.int64), np.zeros(len(rows_a))
        model, margin = self.compiled, self.clearance

        def work(start: int, stop: int) -> None:
            collide_edges.edge_hits(model, rows_a, rows_b, margin, step, start, stop, out, where)

        if len(rows_a):
            over_ranges(work, len(rows_a), 1)
        return out.reshape(shape), where.reshape(shape)

    def sweep(self, qa: ArrayLike, qb: ArrayLike, tolerance: float = 1e-4) -> Sweep:
        """How far each straight motion ``qa → qb (..., n)`` is proven free: a continuous check without resolution.

        Conservative advancement (Mirtich 1996): from a configuration in which a pair is d apart, the motion is free for
        at least (d − clearance) / v, where v bounds how fast the pair can approach: Σᵢ |q̇ᵢ| (rᵢ(a) + rᵢ(b)) over the
        joints between them, with rᵢ the farthest that a link's points can be from the axis of joint i in any
        configuration (1 for a sliding joint). It ends where d − clearance < *tolerance* (m), or at the end of the
        motion. So "free" is proven but for rounding, and "not free" means nearer than clearance + *tolerance*.
        """
        if not (math.isfinite(tolerance) and tolerance > 0.0):
            raise InputError(f"tolerance is {tolerance}; expected a positive length in m")
        rows_a, rows_b, shape = self._motions(qa, qb)
        until, number = np.zeros(len(rows_a)), np.full(len(rows_a), -1, np.int64)
        model, margin = self.compiled, self.clearance

        def work(start: int, stop: int) -> None:
            collide_sweep.sweep(model, rows_a, rows_b, margin, tolerance, start, stop, until, number)

        if len(rows_a):
            over_ranges(work, len(rows_a), 1)
        names = tuple(None if p < 0 else self.names_of(int(p)) for p in number)
        return Sweep((number < 0).reshape(shape), until.reshape(shape), names)

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
        model, every = self.compiled, _neighbours(len(rows))
        distance, number, out = np.full(len(rows), np.inf), np.full(len(rows), -1, np.int64), np.zeros((len(rows), 9))
        if len(model.pairs) == 0:
            raise InputError("there is no pair of things that could collide, so there is no distance")
        if len(rows):
            over_ranges(
                lambda a, b: collide.distances(model, rows, every, a, b, distance, number, out),
                len(rows),
                GRAIN,
                every,
            )
        return distance, number, out

    def why(self, q: ArrayLike) -> tuple[Touch, ...]:
        """What is nearer than the clearance in one configuration ``q (n,)``, the worst first."""
        q = as_shaped(q, "q", self.robot.n)
        if q.ndim != 1:
            raise InputError(f"q has shape {q.shape}; expected one configuration ({self.robot.n},)")
        gap = self._block_distances(np.array(q)[None], self.clearance + 1e-9)[0][0]
        touching = [
            Touch(self.nodes[a].name, self.nodes[b].name, float(d))
            for (a, b), d in zip(self.compiled.blocks[:, :2], gap, strict=True)
            if d <= self.clearance
        ]
        return tuple(sorted(touching, key=lambda touch: touch.distance))

    def distances(self, q: ArrayLike, within: float = math.inf) -> PairDistances:
        """Smallest signed distance of every pair of things for each ``q (..., n)``, with its derivative by q.

        What is farther apart than *within* (m) is only bounded from below. For optimisers that keep all pairs apart.
        """
        if math.isnan(within):
            raise InputError("within is NaN; expected a distance in m")
        rows, shape = self._rows(q)
        distance, number, out = self._block_distances(rows, within)
        model, pairs, n = self.compiled, number.shape[1], self.robot.n
        repeated, slope = np.repeat(rows, pairs, axis=0), np.zeros((len(rows) * pairs, n))
        flat, points = number.reshape(-1), out.reshape(-1, 9)
        out[number < 0] = 0.0
        if len(repeated):
            over_ranges(
                lambda a, b: collide.gradients(model, repeated, flat, points, a, b, slope), len(repeated), GRAIN
            )
        names = tuple((self.nodes[a].name, self.nodes[b].name) for a, b in model.blocks[:, :2])
        return PairDistances(
            names,
            distance.reshape(*shape, pairs),
            slope.reshape(*shape, pairs, n),
            points[:, :6].reshape(*shape, pairs, 2, 3),
        )

    def _block_distances(self, rows: Array, within: float) -> tuple[Array, IntArray, Array]:
        model, every = self.compiled, _neighbours(len(rows))
        size = (len(rows), len(model.blocks))
        distance, number, out = np.zeros(size), np.full(size, -1, np.int64), np.zeros((*size, 9))
        if distance.size:
            over_ranges(
                lambda a, b: collide.block_distances(model, rows, within, every, a, b, distance, number, out),
                len(rows),
                GRAIN,
                every,
            )
        return distance, number, out

    def names_of(self, number: int) -> tuple[str, str]:
        """The two names of a pair of shapes that `hits` answered."""
        model = self.compiled
        for a, b, begin, end in model.blocks[:, :4]:
            if begin <= number < end:
                return self.nodes[a].name, self.nodes[b].name
        raise InputError(f"there is no pair {number}")

    def __repr__(self) -> str:
        moving = sum(node.carrier >= 0 for node in self.nodes)
        return f"<CollisionModel of {self.robot.name!r}: {moving} moving, {len(self.nodes) - moving} standing things>"


def _neighbours(count: int) -> int:
    """How many of *count* problems in a row use what was found before them: whatever the number of threads."""
    return min(max(count // 8, 1), 32)
