"""Pictures of a grasp: contacts with their friction cones, and the wrench space seen as forces and as torques."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..errors import InputError, MissingDependencyError

if TYPE_CHECKING:
    from .grasp import Grasp


def save_picture(grasp: Grasp, path: str | Path, forces: Array | None = None) -> Path:
    """Write a PNG or SVG: the contacts with their cones (and contact *forces* ``(m,)``), and the L1 wrench space
    projected onto forces and onto torques with its largest ball. Needs matplotlib (extra ``plot``)."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError("pictures need matplotlib: pip install 'apprehend[plot]'") from error
    if grasp.dimension != 3:
        raise InputError("pictures show grasps in space; this one lies in the plane")
    target = Path(path)
    if target.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise InputError(f"{target.name} is not a picture's name; expected .png, .svg or .pdf")
    figure = Figure(figsize=(13.5, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.add_subplot(1, 3, 1, projection="3d")
    _contacts(axes, grasp, forces)
    epsilon = grasp.quality(gap=0.01)
    edges = np.concatenate([grasp.edges(24), np.zeros((1, 6))])
    for i, (title, part, unit) in enumerate(
        (("forces of the wrench space", slice(0, 3), "N"), ("torques of the wrench space", slice(3, 6), "N m / length"))
    ):
        axes = figure.add_subplot(1, 3, 2 + i, projection="3d")
        _hull(axes, edges[:, part])
        ball = grasp.quality(subspace="force" if i == 0 else "torque", gap=0.01)
        _ball(axes, ball.value)
        axes.set_title(f"{title}\nball {ball.value:.3g} {unit}", fontsize=10)
        axes.set_aspect("equal")
    figure.suptitle(f"{len(grasp)} contacts, ε between {epsilon.lower:.4g} and {epsilon.upper:.4g} (L1, exact cones)")
    figure.savefig(target, dpi=120)
    return target


def _contacts(axes: Any, grasp: Grasp, forces: Array | None) -> None:
    points = np.array([c.position for c in grasp.contacts])
    size = 0.35 * float(max(np.ptp(points, axis=0).max(), 0.2 * grasp.length))
    if grasp.body is not None:
        v, f = grasp.body.vertices, grasp.body.faces
        keep = f[:: max(1, len(f) // 4000)]
        axes.plot_trisurf(v[:, 0], v[:, 1], v[:, 2], triangles=keep, color="0.8", alpha=0.35, linewidth=0)
    turn = np.linspace(0.0, 2.0 * np.pi, 33)
    for i, (contact, s) in enumerate(zip(grasp.contacts, grasp.slices, strict=True)):
        R, p = contact.rotation, contact.position
        mu = contact.friction if contact.size > 1 else 0.0
        rim = p - size * (R[:, 2] + mu * (np.cos(turn)[:, None] * R[:, 0] + np.sin(turn)[:, None] * R[:, 1]))
        for q in rim[::4]:
            axes.plot(*np.stack([p, q]).T, color="C0", linewidth=0.6)
        axes.plot(*rim.T, color="C0", linewidth=0.9)
        axes.text(*p, f" {i}")
        if forces is not None and float(np.abs(forces).max()) > 0.0:
            arrow = size * contact.directions[:3] @ forces[s] / float(np.abs(forces).max())
            axes.quiver(*(p - arrow), *arrow, color="C3", linewidth=1.5, arrow_length_ratio=0.15)
    axes.scatter(*points.T, color="k", s=12)
    axes.scatter(*grasp.reference, color="C1", s=30, marker="x")
    axes.set_title("contacts, friction cones, reference point", fontsize=10)
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
