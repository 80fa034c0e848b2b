"""Polytopes of the velocities and forces that a frame can have under its joints' limits (K; Chiacchio, 1997)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, as_array, as_shaped
from ..errors import InputError
from .manipulability import jacobian_part

if TYPE_CHECKING:
    from .robot import Robot


@dataclass(frozen=True, eq=False)
class Polytope:
    """A convex polytope ``{x : normals · x ≤ offsets}`` with its vertices."""

    vertices: Array  # (V, d)
    normals: Array  # (K, d), unit, outward
    offsets: Array  # (K,)

    def contains(self, x: ArrayLike, tolerance: float = 1e-9) -> BoolArray:
        """Whether points ``(..., d)`` lie inside."""
        point = as_shaped(x, "x", self.normals.shape[1])
        return np.asarray((point @ self.normals.T <= self.offsets + tolerance).all(axis=-1))

    def reach(self, direction: ArrayLike) -> float:
        """How far the polytope, which holds the origin, extends from it along the unit vector of *direction*."""
        d = as_array(direction, "direction")
        length = float(np.linalg.norm(d))
        if d.shape != (self.normals.shape[1],) or length == 0.0:
            raise InputError(f"direction {d} is not a direction in {self.normals.shape[1]} dimensions")
        rate = self.normals @ (d / length)
        facing = rate > 1e-15
        return float((self.offsets[facing] / rate[facing]).min()) if facing.any() else np.inf


def velocity_polytope(robot: Robot, q: ArrayLike, frame: str, part: str = "linear", *, length: float = 1.0) -> Polytope:
    """All velocities ``J q̇`` of *frame* with every joint within its velocity limit: a zonotope.

    ``InputError`` where a moving joint states no velocity limit, or where the Jacobian's *part* loses a direction.
    """
    J = jacobian_part(robot, as_shaped(q, "q", robot.n), frame, part, length)
    if J.ndim != 2:
        raise InputError(f"q has shape {np.shape(q)}; a polytope belongs to one configuration ({robot.n},)")
    columns = [i for i in robot.chain(frame) if np.abs(J[:, i]).max() > 0.0]
    limit = _finite_limits(robot, robot.limits.velocity, columns, "velocity")
    return _zonotope(J[:, columns] * limit, f"the velocity polytope of {frame!r}")


def force_polytope(robot: Robot, q: ArrayLike, frame: str, part: str = "linear", *, gravity: bool = False) -> Polytope:
    """All forces (or torques, or wrenches: *part*) F of *frame* with every joint torque ``Jᵀ F`` within its limit.

    With *gravity*, what holding the robot costs is taken off the limits first. ``InputError`` where a moving joint
    states no effort limit, or where some direction loads no joint (the polytope is then unbounded).
    """
    J = jacobian_part(robot, as_shaped(q, "q", robot.n), frame, part, 1.0)
    if J.ndim != 2:
        raise InputError(f"q has shape {np.shape(q)}; a polytope belongs to one configuration ({robot.n},)")
    columns = [i for i in robot.chain(frame) if np.abs(J[:, i]).max() > 1e-12]
    limit = _finite_limits(robot, robot.limits.effort, columns, "effort")
    held = robot.gravity(q)[columns] if gravity else np.zeros(len(columns))
    upper, lower = limit - held, -limit - held
    if (upper <= 0.0).any() or (lower >= 0.0).any():
        i = int(np.argmax((upper <= 0.0) | (lower >= 0.0)))
        raise InputError(
            f"joint {robot.joint_names[columns[i]]!r} cannot hold the robot: gravity asks for {held[i]:.4g}, "
            f"its limit is {limit[i]:.4g}"
        )
    A = np.vstack([J[:, columns].T, -J[:, columns].T])
    b = np.concatenate([upper, -lower])
    if not columns or np.linalg.matrix_rank(A, tol=1e-9 * np.abs(A).max()) < A.shape[1]:
        raise InputError(f"the force polytope of {frame!r} is unbounded here: some direction loads no joint (singular)")
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    size = np.linalg.norm(A, axis=1)
    vertices = HalfspaceIntersection(np.column_stack([A, -b]), np.zeros(A.shape[1])).intersections
    hull = ConvexHull(vertices)
    return Polytope(vertices[np.sort(hull.vertices)], A / size[:, None], b / size)


def _finite_limits(robot: Robot, limits: Array, columns: list[int], kind: str) -> Array:
    for i in columns:
        if not np.isfinite(limits[i]) or limits[i] <= 0.0:
            raise InputError(
                f"joint {robot.joint_names[i]!r} of robot {robot.name!r} states no {kind} limit "
                f"({limits[i]:g}); the polytope needs one of every joint that moves the frame"
            )
    return np.asarray(limits[columns])


def _zonotope(generators: Array, what: str) -> Polytope:
    """The sum of the segments ±g over the columns of *generators* ``(d, k)``."""
    d, k = generators.shape
    if k < d or np.linalg.matrix_rank(generators, tol=1e-9 * np.abs(generators).max(initial=0.0)) < d:
        raise InputError(f"{what} is flat here: the frame cannot move in every direction (singular configuration)")
    normals: list[Array] = []
    for chosen in combinations(range(k), d - 1):
        basis = generators[:, list(chosen)]
        U, s, _ = np.linalg.svd(basis)
        if s[-1] <= 1e-9 * s[0]:
            continue
        normals += [U[:, -1], -U[:, -1]]
    _, first = np.unique(np.round(np.array(normals), 9), axis=0, return_index=True)
    N = np.array(normals)[first]
    along = N @ generators
    in_facet = np.abs(along) < 1e-9 * np.linalg.norm(generators, axis=0)
    offsets = np.abs(along).sum(axis=1)
    from scipy.spatial import ConvexHull

    points = np.vstack([_facet_corners(signs, generators) for signs in np.where(in_facet, 0.0, np.sign(along))])
    hull = ConvexHull(points)
    return Polytope(points[np.sort(hull.vertices)], N, offsets)


def _facet_corners(signs: Array, generators: Array) -> Array:
    """Sums of ±g with the signs of a facet; where a generator lies in the facet (0), both signs."""
    free = np.flatnonzero(signs == 0.0)
    choices = np.array(np.meshgrid(*[[-1.0, 1.0]] * len(free), indexing="ij")).reshape(len(free), -1).T
    full = np.tile(signs, (len(choices), 1))
    full[:, free] = choices
    return np.asarray(full @ generators.T)
