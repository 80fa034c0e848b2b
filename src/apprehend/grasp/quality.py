"""How good a grasp is: wrench spaces and the standard measures (G 2.2.3, 2.8; Roa and Suárez 2015)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, choice
from ..errors import InputError
from ..kernels import hull
from .ball import Ball, Generators, largest

if TYPE_CHECKING:
    from .grasp import Grasp

KINDS = (
    "epsilon", "volume", "mean_facet_distance", "min_singular_value", "isotropy", "grasp_volume", "task_ellipsoid",
    "centroid_distance", "polygon_area",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Quality:
    """A quality between certified bounds; exact measures have ``lower == upper``."""

    value: float
    lower: float
    upper: float
    worst_wrench: Array
    """Unit vector ``(p,)`` in scaled wrench space that is hardest to produce; zero where that has no meaning."""
    kind: str

    def __float__(self) -> float:
        return self.value


def measure(grasp: Grasp, kind: str = "epsilon", **options: Any) -> Quality:
    """The quality *kind* of a grasp; wrenches are scaled (torques over `Grasp.length`) and taken about its reference.

    ``epsilon`` (*norm*, *cone*, *m*, *gap*, *subspace*): radius of the largest ball in the wrench space
    (Ferrari and Canny 1992). *norm* ``"l1"``: normal forces that sum to at most one (convex hull of the union);
    ``"linf"``: at most one each (Minkowski sum). *cone* ``"exact"``: friction cones as they are, the answer an
    interval with ``upper − lower ≤ gap · upper``; or ``"polyhedral"`` with *m* edges, an exact number and a lower
    bound of the former. *subspace* ``(s, p)``: orthonormal rows onto which the wrench space is projected first, or
    ``"force"``, ``"torque"`` (G 2.2.3: forces or torques only). Zero if the grasp is not force-closure.

    ``volume``, ``mean_facet_distance`` (*m*, *subspace*): of the polyhedral L1 hull, the origin included.

    ``task_ellipsoid`` (*sigma* ``(p, p)``, *centre* ``(p,)``, *norm*, *cone*, *m*, *gap*): the largest ε for which all
    wrenches with ``(w − c)ᵗ Σ⁻¹ (w − c) ≤ ε`` can be exerted (G 2.8.1, by default with L∞); in scaled wrench space.

    ``min_singular_value`` of G, ``isotropy`` (σ_min / σ_max), ``grasp_volume`` (√det GGᵗ, the product of the singular
    values); ``centroid_distance``: from the middle of the contacts to the reference, in m; ``polygon_area``: of the
    three contacts of a three-finger grasp, in m².
    """
    choice(kind, "kind", KINDS)
    calls: dict[str, Callable[..., Quality]] = {
        "epsilon": _epsilon, "volume": _volume, "mean_facet_distance": _mean, "task_ellipsoid": _task_ellipsoid,
    }  # fmt: skip
    if kind in calls:
        return calls[kind](grasp, **options)
    if options:
        raise InputError(f"quality {kind!r} takes no options; got {', '.join(options)}")
    p = grasp.wrench_size
    s = np.zeros(p)
    found = np.linalg.svd(grasp.matrix * grasp.scale[:, None], compute_uv=False)
    s[: len(found)] = found[:p]
    points = np.array([c.position for c in grasp.contacts])
    if kind == "min_singular_value":
        return _exact(kind, float(s[-1]), grasp._svd[0][:, -1].copy())
    if kind == "isotropy":
        return _exact(kind, float(s[-1] / s[0]) if s[0] > 0.0 else 0.0, grasp._svd[0][:, -1].copy())
    if kind == "grasp_volume":
        return _exact(kind, float(np.prod(s)), np.zeros(p))
    if kind == "centroid_distance":
        return _exact(kind, float(np.linalg.norm(points.mean(axis=0) - grasp.reference)), np.zeros(p))
    if len(points) != 3:
        raise InputError(f"polygon_area is defined for three contacts; this grasp has {len(points)}")
    a, b = points[1] - points[0], points[2] - points[0]
    squared = float((a @ a) * (b @ b) - (a @ b) ** 2)
    return _exact(kind, 0.5 * float(np.sqrt(max(squared, 0.0))), np.zeros(p))


def _exact(kind: str, value: float, worst: Array) -> Quality:
    return Quality(value, value, value, worst, kind)


def _parts(grasp: Grasp, norm: str, cone: str, m: int) -> tuple[int, Generators]:
    """The kind of set and its generators for `ball.largest`."""
    choice(norm, "norm", ("l1", "linf"))
    choice(cone, "cone", ("exact", "polyhedral"))
    p = grasp.wrench_size
    if cone == "exact" or (grasp.dimension == 2 and norm == "linf"):
        return (hull.UNION if norm == "l1" else hull.SUM), grasp.generators
    if norm == "linf":
        raise InputError(
            'norm "linf" is computed with exact cones; the polyhedral sum has m^k points and is only its lower bound: '
            'use cone="exact"'
        )
    points = np.concatenate([grasp.edges(m), np.zeros((1, p))])
    return hull.POINTS, _points(points)


def _points(points: Array) -> Generators:
    return Generators(np.ascontiguousarray(points), np.zeros((1, 3, points.shape[1])), np.zeros(1, np.bool_))


def _mapped(parts: Generators, rows: Array) -> Generators:
    """The set under the linear map *rows* ``(s, p)``."""
    return Generators(np.ascontiguousarray(parts.base @ rows.T), np.ascontiguousarray(parts.spread @ rows.T), parts.box)


def _rows(grasp: Grasp, subspace: ArrayLike | str | None) -> Array | None:
    if subspace is None:
        return None
    p, d = grasp.wrench_size, grasp.dimension
    if isinstance(subspace, str):
        choice(subspace, "subspace", ("force", "torque"))
        return np.eye(p)[:d] if subspace == "force" else np.eye(p)[d:]
    rows = np.atleast_2d(as_array(subspace, "subspace"))
    if rows.shape[1] != p or np.abs(rows @ rows.T - np.eye(len(rows))).max() > 1e-9:
        raise InputError(f"subspace has shape {rows.shape}; expected orthonormal rows (s, {p})")
    if len(rows) < 2:
        raise InputError("subspace has one row; use Grasp.largest_force along that direction and its opposite")
    return rows


def _interval(grasp: Grasp, kind: str, ball: Ball, rows: Array | None, power: int = 1) -> Quality:
    worst = ball.worst if rows is None else rows.T @ ball.worst
    lower, upper = max(ball.lower, 0.0) ** power, max(ball.upper, 0.0) ** power
    return Quality(lower, lower, upper, worst, kind)


def _epsilon(
    grasp: Grasp,
    *,
    norm: str = "l1",
    cone: str = "exact",
    m: int = 8,
    gap: float = 0.01,
    subspace: ArrayLike | str | None = None,
) -> Quality:
    kind, parts = _parts(grasp, norm, cone, m)
    rows = _rows(grasp, subspace)
    if rows is not None:
        parts = _mapped(parts, rows)
    tolerance = 0.0 if kind == hull.POINTS else gap
    return _interval(grasp, "epsilon", largest(kind, parts, tolerance=tolerance), rows)


def _whole(grasp: Grasp, m: int, subspace: ArrayLike | str | None) -> Ball:
    points = np.concatenate([grasp.edges(m), np.zeros((1, grasp.wrench_size))])
    rows = _rows(grasp, subspace)
    return largest(hull.POINTS, _points(points if rows is None else points @ rows.T), whole=True)


def _volume(grasp: Grasp, *, m: int = 8, subspace: ArrayLike | str | None = None) -> Quality:
    return _exact("volume", _whole(grasp, m, subspace).volume, np.zeros(grasp.wrench_size))


def _mean(grasp: Grasp, *, m: int = 8, subspace: ArrayLike | str | None = None) -> Quality:
    return _exact("mean_facet_distance", _whole(grasp, m, subspace).mean, np.zeros(grasp.wrench_size))


def _task_ellipsoid(
    grasp: Grasp,
    *,
    sigma: ArrayLike,
    centre: ArrayLike | None = None,
    norm: str = "linf",
    cone: str = "exact",
    m: int = 8,
    gap: float = 0.01,
) -> Quality:
    p = grasp.wrench_size
    S = as_array(sigma, "sigma")
    if S.shape != (p, p) or np.abs(S - S.T).max() > 1e-9 * np.abs(S).max():
        raise InputError(f"sigma has shape {S.shape}; expected a symmetric matrix ({p}, {p})")
    values, vectors = np.linalg.eigh(S)
    if values[0] <= 1e-12 * values[-1]:
        raise InputError(f"sigma has the eigenvalue {values[0]:.3g}; expected a positive definite matrix")
    root = (vectors / np.sqrt(values)) @ vectors.T
    c = np.zeros(p) if centre is None else as_array(centre, "centre")
    if c.shape != (p,):
        raise InputError(f"centre has shape {c.shape}; expected ({p},)")
    kind, parts = _parts(grasp, norm, cone, m)
    tolerance = 0.0 if kind == hull.POINTS else 0.5 * gap
    ball = largest(kind, _mapped(parts, root), tolerance=tolerance, centre=root @ c)
    answer = _interval(grasp, "task_ellipsoid", ball, None, power=2)
    worst = root @ ball.worst
    length = float(np.linalg.norm(worst))
    return Quality(answer.value, answer.lower, answer.upper, worst / length if length else worst, "task_ellipsoid")
