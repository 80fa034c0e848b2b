"""Pictures of ellipsoids and polytopes, in a plane or in space (K). They need matplotlib (extra ``plot``)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, choice
from ..errors import InputError, MissingDependencyError
from .manipulability import PARTS, manipulability
from .polytopes import Polytope, force_polytope, velocity_polytope

if TYPE_CHECKING:
    from .robot import Robot

KINDS = ("velocity ellipsoid", "force ellipsoid", "velocity polytope", "force polytope")
COLORS = {"velocity ellipsoid": "C0", "force ellipsoid": "C3", "velocity polytope": "C2", "force polytope": "C1"}


def draw(
    robot: Robot,
    q: ArrayLike,
    frame: str,
    kinds: tuple[str, ...] = ("velocity ellipsoid", "force ellipsoid"),
    part: str = "linear",
    *,
    axes: Any = None,
) -> Any:
    """Draw the chain to *frame* at one ``q (n,)`` and, around the frame, each of *kinds* (see `KINDS`).

    *part* is ``"linear"`` or ``"angular"`` (in space), or ``"xy"``, ``"xz"``, ``"yz"`` (in that plane of the world).
    Each shape is scaled to half the size of the arm, and the legend says how far it really extends (an ellipsoid: for
    joint speeds, or torques, whose squares sum to 1); a shape that is unbounded or flat here is refused by its
    function. Returns the matplotlib axes; ``axes.figure.savefig(...)`` writes the picture.
    """
    choice(part, "part", tuple(p for p in PARTS if p != "both"))
    for kind in kinds:
        choice(kind, "kinds", KINDS)
    T = robot.fk(q)
    if T.ndim != 3:
        raise InputError(f"q has shape {np.shape(q)}; a picture shows one configuration ({robot.n},)")
    rows = tuple(r % 3 for r in PARTS[part])
    line = np.array([T[robot.frame_index(link), :3, 3] for link in _links_to(robot, frame)])
    center = line[-1, list(rows)]
    size = 0.5 * max(float(np.ptp(line, axis=0).max()), 1e-3)
    if axes is None:
        axes = new_axes(len(rows))
    axes.plot(*line[:, list(rows)].T, "-o", color="0.4", markersize=4)
    for kind in kinds:
        shape = _outline(robot, q, frame, kind, part)
        scale = size / max(float(np.abs(np.concatenate(shape)).max()), 1e-300)
        extent = float(np.linalg.norm(np.concatenate(shape), axis=1).max())
        label = f"{kind}, to {extent:.3g} {_unit(kind, part)}"
        for k, curve in enumerate(shape):
            points = center + scale * curve
            axes.plot(*points.T, color=COLORS[kind], linewidth=1.2, label=label if k == 0 else None)
    axes.set_aspect("equal")
    for name, r in zip("xyz", rows, strict=False):
        getattr(axes, f"set_{name}label")(f"{'xyz'[r]} (m)")
    axes.set_title(f"{robot.name}: {frame}")
    axes.legend(loc="best", fontsize="small")
    return axes


def _unit(kind: str, part: str) -> str:
    """Of the numbers of a shape; those of the ellipsoids are for joint speeds, or torques, of 1 in all."""
    if kind.startswith("velocity"):
        return "rad/s" if part == "angular" else "m/s"
    return "N m" if part == "angular" else "N"


def new_axes(dimensions: int) -> Any:
    """Axes of a new figure, in two or three dimensions, without a window."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError(
            "pictures need matplotlib, which is not installed; install the extra: pip install 'apprehend[plot]'"
        ) from error
    figure = Figure(figsize=(6.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    return figure.add_subplot(projection="3d" if dimensions == 3 else None)


def _links_to(robot: Robot, frame: str) -> list[str]:
    carrier = robot.description.parent_joint
    links = [frame]
    while links[-1] in carrier:
        links.append(carrier[links[-1]].parent)
    return links[::-1]


def _outline(robot: Robot, q: ArrayLike, frame: str, kind: str, part: str) -> list[Array]:
    """Curves ``(K, d)`` about the origin: rings of an ellipsoid, edges of a polytope."""
    if kind.endswith("polytope"):
        make = velocity_polytope if kind.startswith("velocity") else force_polytope
        return polytope_edges(make(robot, q, frame, part))
    m = manipulability(robot, q, frame, part)
    semi = np.zeros(m.rows)
    semi[: m.sigma.size] = m.sigma
    if kind == "force ellipsoid":
        semi = m.force_semi_axes
        if not np.isfinite(semi).all():
            raise InputError(
                f"the force ellipsoid of {frame!r} is unbounded here: {m.rows - int(m.rank)} lost direction(s)"
            )
    return ellipsoid_rings(semi, m.directions)


def ellipsoid_rings(semi_axes: Array, directions: Array, points: int = 73, rings: int = 7) -> list[Array]:
    """Closed curves ``(points, d)`` on the ellipsoid with semi-axes along the columns of *directions*, d = 2 or 3."""
    t = np.linspace(0.0, 2.0 * np.pi, points)
    circle = np.column_stack([np.cos(t), np.sin(t)])
    if semi_axes.size == 2:
        unit = [circle]
    else:
        unit = []
        for h in np.linspace(-1.0, 1.0, rings + 2)[1:-1]:
            ring = np.sqrt(1.0 - h * h) * circle
            level = np.full(points, h)
            unit += [np.column_stack(np.insert(ring.T, k, level, axis=0)) for k in range(3)]
    return [np.asarray((curve * semi_axes) @ directions.T) for curve in unit]


def polytope_edges(polytope: Polytope) -> list[Array]:
    """The edges of a polytope in 2 or 3 dimensions, each ``(2, d)``: pairs of vertices that share d − 1 facets."""
    d = polytope.normals.shape[1]
    size = np.abs(polytope.offsets).max()
    on = polytope.vertices @ polytope.normals.T > polytope.offsets - 1e-7 * size
    edges = []
    for i in range(len(on)):
        shared = on[i] & on[i + 1 :]
        for j in np.flatnonzero(shared.sum(axis=1) >= d - 1):
            normals = polytope.normals[shared[j]]
            if np.linalg.matrix_rank(normals, tol=1e-6) == d - 1:
                edges.append(polytope.vertices[[i, i + 1 + int(j)]])
    return edges
