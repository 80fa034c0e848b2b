"""Pictures of a grasp: contacts with their friction cones, and projections of the wrench space."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, as_array
from ..errors import InputError, MissingDependencyError

if TYPE_CHECKING:
    from .grasp import Grasp

FINE = 24
"""Edges of the cones whose hull is drawn."""


def save_picture(grasp: Grasp, path: str | Path, forces: Array | None = None) -> Path:
    """Write a PNG, SVG or PDF: the contacts with their cones (and contact *forces* ``(m,)``), and the L1 wrench space
    with its largest ball: projected onto forces and onto torques; in the plane as it is. Needs matplotlib (extra
    ``plot``)."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError("pictures need matplotlib: pip install 'apprehend[plot]'") from error
    target = Path(path)
    if target.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise InputError(f"{target.name} is not a picture's name; expected .png, .svg or .pdf")
    if forces is not None:
        forces = as_array(forces, "forces")
        if forces.shape != (grasp.matrix.shape[1],):
            raise InputError(f"forces has shape {forces.shape}; expected ({grasp.matrix.shape[1]},)")
    planar = grasp.dimension == 2
    figure = Figure(figsize=(9.0 if planar else 13.5, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.add_subplot(1, 2, 1) if planar else figure.add_subplot(1, 3, 1, projection="3d")
    (_flat_contacts if planar else _contacts)(axes, grasp, forces)
    epsilon = grasp.quality(gap=0.01)
    edges = np.concatenate([grasp.edges(FINE), np.zeros((1, grasp.wrench_size))])
    if planar:
        views = [("wrench space", slice(0, 3), epsilon.value, ("$f_x$ / N", "$f_y$ / N", r"$\tau$ / (N · length)"))]
    else:
        views = [
            (f"{name}s of the wrench space", part, grasp.quality(subspace=name, gap=0.01).value, labels)
            for name, part, labels in (
                ("force", slice(0, 3), ("$f_x$ / N", "$f_y$ / N", "$f_z$ / N")),
                ("torque", slice(3, 6), (r"$\tau_x$ / (N · length)", r"$\tau_y$", r"$\tau_z$")),
            )
        ]
    for i, (title, part, radius, labels) in enumerate(views):
        axes = figure.add_subplot(1, 1 + len(views), 2 + i, projection="3d")
        _hull(axes, edges[:, part])
        _ball(axes, radius)
        axes.set_title(f"{title}\nlargest ball: {radius:.3g}", fontsize=10)
        axes.set_xlabel(labels[0], fontsize=8)
        axes.set_ylabel(labels[1], fontsize=8)
        axes.set_zlabel(labels[2], fontsize=8)
        axes.tick_params(labelsize=7)
        axes.set_aspect("equal")
    closed = "force closure" if grasp.force_closure().success else "no force closure"
    figure.suptitle(
        f"{len(grasp)} contacts, {closed}, ε between {epsilon.lower:.4g} and {epsilon.upper:.4g} (L1, exact cones)"
    )
    figure.savefig(target, dpi=120)
    return target


def _size(grasp: Grasp) -> float:
    points = np.array([c.position for c in grasp.contacts])
    return 0.35 * float(max(np.ptp(points, axis=0).max(), 0.2 * grasp.length))


def _arrow(grasp: Grasp, i: int, forces: Array, size: float) -> Array:
    """The force of a contact as an arrow that ends at it, the largest of all *size* long."""
    d = grasp.dimension
    pushes = [c.directions[:d] @ forces[s] for c, s in zip(grasp.contacts, grasp.slices, strict=True)]
    largest = max(float(np.linalg.norm(p)) for p in pushes)
    arrow: Array = size * pushes[i] / largest if largest > 0.0 else 0.0 * pushes[i]
    return arrow


def _contacts(axes: Any, grasp: Grasp, forces: Array | None) -> None:
    points = np.array([c.position for c in grasp.contacts])
    size = _size(grasp)
    if grasp.body is not None:
        v, f = grasp.body.vertices, grasp.body.faces
        keep = f[:: max(1, len(f) // 4000)]
        axes.plot_trisurf(v[:, 0], v[:, 1], v[:, 2], triangles=keep, color="0.8", alpha=0.35, linewidth=0)
    turn = np.linspace(0.0, 2.0 * np.pi, 33)
    for i, contact in enumerate(grasp.contacts):
        R, p = contact.rotation, contact.position
        mu = contact.friction if contact.size > 1 else 0.0
        rim = p - size * (R[:, 2] + mu * (np.cos(turn)[:, None] * R[:, 0] + np.sin(turn)[:, None] * R[:, 1]))
        for q in rim[::4]:
            axes.plot(*np.stack([p, q]).T, color="C0", linewidth=0.6)
        axes.plot(*rim.T, color="C0", linewidth=0.9)
        axes.text(*p, f" {i}")
        if forces is not None and np.linalg.norm(arrow := _arrow(grasp, i, forces, size)) > 0.02 * size:
            axes.quiver(*(p - arrow), *arrow, color="C3", linewidth=1.5, arrow_length_ratio=0.15)
    axes.scatter(*points.T, color="k", s=12)
    axes.scatter(*grasp.reference, color="C1", s=30, marker="x")
    axes.set_title("contacts, friction cones, reference point (m)", fontsize=10)
    axes.tick_params(labelsize=7)
    axes.set_aspect("equal")


def _flat_contacts(axes: Any, grasp: Grasp, forces: Array | None) -> None:
    size = _size(grasp)
    for i, contact in enumerate(grasp.contacts):
        p, (t, n) = contact.position, contact.rotation.T
        mu = contact.friction if contact.size > 1 else 0.0
        corners = np.stack([p, p - size * (n + mu * t), p - size * (n - mu * t)])
        axes.fill(*corners.T, color="C0", alpha=0.3)
        axes.plot(*np.stack([p + 0.4 * size * t, p - 0.4 * size * t]).T, color="0.3", linewidth=2.0)
        axes.annotate(str(i), p, textcoords="offset points", xytext=(4, 4))
        if forces is not None and np.linalg.norm(arrow := _arrow(grasp, i, forces, size)) > 0.02 * size:
            axes.annotate("", p, p - arrow, arrowprops={"arrowstyle": "->", "color": "C3", "linewidth": 1.8})
    axes.plot(*grasp.reference, "x", color="C1")
    axes.set_title("contacts, friction cones, reference point (m)", fontsize=10)
    axes.margins(0.15)
    axes.set_aspect("equal")


def _hull(axes: Any, points: Array) -> None:
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points, qhull_options="QJ")
    except QhullError:
        axes.scatter(*points.T, s=4)
        return
    axes.plot_trisurf(*points.T, triangles=hull.simplices, color="C0", alpha=0.25, linewidth=0.2, edgecolor="C0")


def _ball(axes: Any, radius: float) -> None:
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    axes.plot_surface(
        radius * np.cos(u) * np.sin(v), radius * np.sin(u) * np.sin(v), radius * np.cos(v), color="C3", alpha=0.5
    )
