"""How good a grasp is: wrench spaces and the standard measures (G 2.2.3, 2.8; Roa and Suárez 2015)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from inspect import signature
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, choice
from ..errors import InputError
from ..kernels import hull
from .ball import Ball, Generators, largest
from .measures import MORE, PLAIN

if TYPE_CHECKING:
    from .grasp import Grasp

KINDS = ("epsilon", "volume", "mean_facet_distance", "task_ellipsoid", *MORE, *PLAIN)


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

    ``epsilon`` (*norm*, *cone*, *m*, *gap*, *subspace*, *bound*): radius of the largest ball in the wrench space
    (Ferrari and Canny 1992). *norm* ``"l1"``: contact forces that sum to at most one (convex hull of the union);
    ``"linf"``: at most one each, patches as a whole (Minkowski sum). *bound* says what is summed: ``"normal"`` forces
    (G 2.2.3), or the ``"magnitude"`` of forces (the original; Coulomb contacts and frictionless ones). *cone*
    ``"exact"``: friction cones as they are, the answer an interval with ``upper − lower ≤ gap · upper``; or
    ``"polyhedral"`` with *m* edges, an exact number and a lower bound of the former. *subspace* ``(s, p)``:
    orthonormal rows onto which the wrench space is projected first, or ``"force"``, ``"torque"`` (G 2.2.3: forces or
    torques only). Zero if the grasp is not force-closure.

    ``volume``, ``mean_facet_distance`` (*m*, *subspace*): of the polyhedral L1 hull, the origin included.

    ``task_ellipsoid`` (*sigma* ``(p, p)``, *centre* ``(p,)``, *norm*, *cone*, *m*, *gap*): the largest ε for which all
    wrenches with ``(w − c)ᵗ Σ⁻¹ (w − c) ≤ ε`` can be exerted (G 2.8.1, by default with L∞); in scaled wrench space.

    Without a wrench space: ``min_singular_value`` of G, ``isotropy`` (σ_min / σ_max), ``grasp_volume`` (√det GGᵗ, the
    product of the singular values); ``centroid_distance`` from the middle of the contacts to the reference, in m;
    ``polygon_area`` in m² of the contacts, seen in their plane, and ``polygon_shape``, 0 if regular, 1 at worst;
    ``normal_balance``, 1 if the normals cancel; ``orthogonality`` (*approach* ``(3,)``) in rad, 0 if the hand comes
    along or square to the body's long axis; ``min_weight`` (*m*): the largest least weight of the edges that balance;
    ``position_margin``: every contact may be off by that many m, its normal kept, and force closure is certain (a
    lower bound). Of the hand: `HandGrasp.quality`.
    """
    choice(kind, "kind", KINDS)
    calls: dict[str, Callable[..., Quality]] = {
        "epsilon": _epsilon, "volume": _volume, "mean_facet_distance": _mean, "task_ellipsoid": _task_ellipsoid,
    }  # fmt: skip
    made = calls.get(kind) or MORE.get(kind)
    if made is not None:
        _check_options(kind, made, options)
    if kind in calls:
        return calls[kind](grasp, **options)
    if kind in MORE:
        return _exact(kind, *MORE[kind](grasp, **options))
    if options:
        raise InputError(f"quality {kind!r} takes no options; got {', '.join(options)}")
    answer = _exact(kind, *PLAIN[kind](grasp))
    return replace(answer, upper=np.inf) if kind == "position_margin" else answer


def _check_options(kind: str, made: Callable[..., Any], options: dict[str, Any]) -> None:
    """Raise `InputError` for options that a quality lacks, or that it needs and were not given."""
    known = {name: p for name, p in signature(made).parameters.items() if name != "grasp"}
    for name in options:
        if name not in known:
            raise InputError(f"quality {kind!r} has no option {name!r}; it takes {', '.join(known) or 'none'}")
    for name, parameter in known.items():
        if parameter.default is parameter.empty and name not in options:
            raise InputError(f"quality {kind!r} needs the option {name!r}")


def _exact(kind: str, value: float, worst: Array) -> Quality:
    return Quality(value, value, value, worst, kind)


def _parts(grasp: Grasp, norm: str, cone: str, m: int, bound: str = "normal") -> tuple[int, Generators]:
    """The kind of set and its generators for `ball.largest`."""
    choice(norm, "norm", ("l1", "linf"))
    choice(cone, "cone", ("exact", "polyhedral"))
    choice(bound, "bound", ("normal", "magnitude"))
    magnitude = bound == "magnitude"
    if magnitude and any(c.torsion > 0.0 and c.size == 4 for c in grasp.contacts):
        raise InputError('bound "magnitude" is defined for point contacts; soft fingers pass on a moment: use "normal"')
    if magnitude and any(len(part) > 1 for part in grasp.parts) and norm == "linf":
        raise InputError('bound "magnitude" with norm "linf" is not defined for patches; use "normal"')
    if cone == "exact":
        if not magnitude:
            return (hull.UNION if norm == "l1" else hull.SUM), grasp.generators
        base, spread, flags = grasp.generators
        mu = np.array([c.friction if c.size > 1 else 0.0 for c in grasp.contacts])
        caps = spread / np.where(mu > 0.0, mu, 1.0)[:, None, None]
        caps[:, 2] = 0.0
        caps[:, 2, 0] = mu
        return (hull.CAP_UNION if norm == "l1" else hull.CAP_SUM), Generators(base, caps, flags)
    groups = grasp.edge_groups(m)
    if magnitude:
        groups = [
            edges / np.sqrt(1.0 + (c.friction if c.size > 1 else 0.0) ** 2)
            for edges, c in zip(groups, grasp.contacts, strict=True)
        ]
    points = np.concatenate(groups)
    if norm == "l1":
        return hull.POINTS, _points(np.concatenate([points, np.zeros((1, grasp.wrench_size))]))
    flags = np.full(len(points), hull.SAME, np.int64)
    ends = np.cumsum([0, *map(len, groups)])
    flags[ends[[part[0] for part in grasp.parts]]] = 0
    return hull.SUM, Generators(points, np.zeros((len(points), 3, grasp.wrench_size)), flags)


def _points(points: Array) -> Generators:
    return Generators(np.ascontiguousarray(points), np.zeros((1, 3, points.shape[1])), np.zeros(1, np.int64))


def _mapped(kind: int, parts: Generators, rows: Array) -> Generators:
    """The set under the linear map *rows* ``(s, p)``."""
    spread = np.ascontiguousarray(parts.spread @ rows.T)
    if kind in (hull.CAP_UNION, hull.CAP_SUM):
        spread[:, 2, 0] = parts.spread[:, 2, 0]  # µ, not a wrench
    return Generators(np.ascontiguousarray(parts.base @ rows.T), spread, parts.flags)


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
    bound: str = "normal",
) -> Quality:
    kind, parts = _parts(grasp, norm, cone, m, bound)
    rows = _rows(grasp, subspace)
    if rows is not None:
        parts = _mapped(kind, parts, rows)
        if len(rows) == 1:
            return _line(kind, parts, rows[0])
    tolerance = 0.0 if cone == "polyhedral" else _gap(gap)
    return _interval(grasp, "epsilon", largest(kind, parts, tolerance=tolerance), rows)


def _gap(gap: float) -> float:
    if not 0.0 < gap < 1.0:
        raise InputError(f"gap is {gap}; expected a share of the upper bound between 0 and 1, such as 0.01")
    return float(gap)


def _line(kind: int, parts: Generators, row: Array) -> Quality:
    """The ball on a line: the nearer end of what the set reaches along it."""
    out, zero = np.empty(1), np.zeros(1)
    ends = {sign: float(hull.support(kind, *parts, zero, np.array([sign]), out)) for sign in (1.0, -1.0)}
    worst = min(ends, key=lambda sign: ends[sign])
    return _exact("epsilon", max(ends[worst], 0.0), worst * row)


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
    tolerance = 0.0 if cone == "polyhedral" else 0.5 * _gap(gap)
    ball = largest(kind, _mapped(kind, parts, root), tolerance=tolerance, centre=root @ c)
    answer = _interval(grasp, "task_ellipsoid", ball, None, power=2)
    worst = root @ ball.worst
    length = float(np.linalg.norm(worst))
    return Quality(answer.value, answer.lower, answer.upper, worst / length if length else worst, "task_ellipsoid")
