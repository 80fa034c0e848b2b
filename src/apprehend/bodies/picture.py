"""Pictures of models in the plane: silhouettes, edges, circles, sections, distances. They need matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array
from ..errors import InputError, MissingDependencyError, unknown_name
from .distance_field import DistanceField
from .index import MeshIndex
from .models import Models
from .outline import Outline
from .primitives import Primitives, Spheres
from .section import plane_frame, silhouette
from .surface_mesh import SurfaceMesh
from .voxels import Voxels
from .wireframe import Wireframe

VIEWS = {"front": (0.0, -1.0, 0.0), "side": (1.0, 0.0, 0.0), "top": (0.0, 0.0, 1.0)}
"""Directions from which one looks, towards the eye: the front shows x to the right and z up."""

COLOURS = ("#4878a8", "#d1743f", "#5c9455", "#8c6bb1", "#b8963e")


def draw(*models: Any, view: str | ArrayLike = "front", axes: Any = None) -> Any:
    """Draw bodies and models in one plane, as seen from *view* (see `VIEWS`, or a direction towards the eye ``(3,)``).

    Of surfaces and shapes the silhouettes are filled, wireframes are lines, an `Outline` is drawn in its own plane,
    and a `DistanceField` as its section through the middle, with lines of equal distance and the surface bold.
    Returns the matplotlib axes, in mm; ``axes.figure.savefig(...)`` writes the picture.
    """
    if not models:
        raise InputError("there is nothing to draw; give a body or a model")
    if isinstance(view, str):
        if view not in VIEWS:
            unknown_name("view", view, VIEWS)
        direction: Any = VIEWS[view]
    else:
        direction = view
    frame = plane_frame(np.zeros(3), direction, "view")
    if axes is None:
        axes = _new_axes()
    for i, model in enumerate(models):
        _draw_one(axes, model, frame, COLOURS[i % len(COLOURS)])
    axes.set_aspect("equal")
    axes.autoscale_view()
    names = [_axis_name(frame[:3, k]) for k in range(2)]
    axes.set_xlabel(f"{names[0]} in mm")
    axes.set_ylabel(f"{names[1]} in mm")
    return axes


def save_picture(path: str | Path, *models: Any, view: str | ArrayLike = "front") -> Path:
    """`draw` into a file: .png, .svg or .pdf."""
    target = Path(path)
    if target.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise InputError(f"{target.name} is not a picture's name; expected .png, .svg or .pdf")
    draw(*models, view=view).figure.savefig(target, dpi=150)
    return target


def _new_axes() -> Any:
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError("pictures need matplotlib: pip install 'apprehend[plot]'") from error
    figure = Figure(figsize=(6.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    return figure.add_subplot()


def _draw_one(axes: Any, model: Any, frame: Array, colour: str) -> None:
    if isinstance(model, Outline):
        _polygons(axes, model.loops, colour)
        _lines(axes, list(model.lines), colour, 1.2)
    elif isinstance(model, Wireframe):
        _lines(axes, [line @ frame[:3, :2] for line in model.polylines], colour, 0.9)
    elif isinstance(model, DistanceField):
        _levels(axes, model, frame)
    elif isinstance(model, Spheres):
        angle = np.linspace(0.0, 2.0 * np.pi, 97)
        ring = np.column_stack([np.cos(angle), np.sin(angle)])
        for centre, radius in zip(model.centres @ frame[:3, :2], model.radii):
            _polygons(axes, (centre + radius * ring,), colour, 0.15)
    elif isinstance(model, Primitives):
        for mesh in model.meshes():
            _polygons(axes, silhouette(MeshIndex(*mesh), frame[:3, 2]).loops, colour, 0.2)
    elif isinstance(model, (Models, SurfaceMesh, Voxels)):
        index = MeshIndex(*model.mesh) if isinstance(model, Voxels) else model.index
        _polygons(axes, silhouette(index, frame[:3, 2]).loops, colour)
        edges = Wireframe.of(index, rings=0)
        _lines(axes, [line @ frame[:3, :2] for line in edges.polylines], colour, 0.3)
    else:
        raise InputError(f"cannot draw a {type(model).__name__}; expected a body or one of its models")


def _polygons(axes: Any, loops: tuple[Array, ...], colour: str, alpha: float = 0.3) -> None:
    """The figure that *loops* enclose, holes left out."""
    from matplotlib.colors import to_rgba
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Curve

    if not loops:
        return
    corners, codes = [], []
    for loop in loops:
        corners.append(1e3 * np.vstack([loop, loop[:1]]))
        codes += [Curve.MOVETO] + [Curve.LINETO] * (len(loop) - 1) + [Curve.CLOSEPOLY]
    shape = Curve(np.concatenate(corners), codes)
    axes.add_patch(PathPatch(shape, facecolor=to_rgba(colour, alpha), edgecolor=colour, linewidth=1.0))


def _lines(axes: Any, lines: list[Array], colour: str, width: float) -> None:
    from matplotlib.collections import LineCollection

    if lines:
        axes.add_collection(LineCollection([1e3 * line for line in lines], colors=colour, linewidths=width))


def _levels(axes: Any, field: DistanceField, frame: Array) -> None:
    """The section of *field* through the middle of its grid, coloured by distance."""
    low, high = field.origin, field.upper
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (high - low) + low
    flat = corners @ frame[:3, :2]
    steps = np.maximum(np.ceil(np.ptp(flat, axis=0) / field.spacing).astype(int), 2)
    x, y = (np.linspace(flat[:, k].min(), flat[:, k].max(), min(2 * int(steps[k]), 800)) for k in range(2))
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    depth = float(0.5 * (low + high) @ frame[:3, 2])
    points = grid @ frame[:3, :2].T + depth * frame[:3, 2]
    values = 1e3 * field.distance(points)
    shown = axes.contourf(1e3 * x, 1e3 * y, values, levels=24, cmap="RdBu", vmin=-np.abs(values).max(),
                          vmax=np.abs(values).max())  # fmt: skip
    axes.contour(1e3 * x, 1e3 * y, values, levels=12, colors="k", linewidths=0.2)
    axes.contour(1e3 * x, 1e3 * y, values, levels=[0.0], colors="k", linewidths=1.5)
    axes.figure.colorbar(shown, ax=axes, label="signed distance in mm", shrink=0.8)


def _axis_name(axis: Array) -> str:
    """The letter of a coordinate axis with its sign, or the direction."""
    k = int(np.argmax(np.abs(axis)))
    if abs(axis[k]) > 1.0 - 1e-9:
        return ("" if axis[k] > 0.0 else "−") + "xyz"[k]
    return "(" + ", ".join(f"{x:.2f}" for x in np.round(axis, 2) + 0.0) + ")"
