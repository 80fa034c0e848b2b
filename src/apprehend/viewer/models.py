"""How models of bodies and links look in space: shapes in many colours, lines as thin rods."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, IntArray
from ..bodies import DistanceField, Outline, Primitives, SurfaceMesh, Voxels, Wireframe
from ..errors import InputError
from .looks import RGBA, Part
from .stage import Stage, Thing

if TYPE_CHECKING:
    from ..kinematics import LinkModels

Mesh = tuple[Array, IntArray]

TINTS: tuple[RGBA, ...] = (
    (0.29, 0.50, 0.68, 1.0), (0.84, 0.50, 0.28, 1.0), (0.40, 0.62, 0.36, 1.0), (0.60, 0.45, 0.70, 1.0),
    (0.75, 0.62, 0.28, 1.0), (0.35, 0.62, 0.64, 1.0), (0.76, 0.42, 0.50, 1.0), (0.50, 0.52, 0.58, 1.0),
)  # fmt: skip
"""Colours of the shapes of a model, in turn."""
LINE: RGBA = (0.13, 0.24, 0.36, 1.0)
"""Colour of wires and outlines."""
THIN = 0.004
"""Radius of wires as a share of the size of what they show."""


def is_model(thing: Any) -> bool:
    """Whether *thing* is a model of a body that can be drawn."""
    return isinstance(thing, (Primitives, Wireframe, Outline, Voxels, SurfaceMesh, DistanceField))


def meshes_of(model: Any, first: int = 0) -> list[tuple[Mesh, RGBA]]:
    """The meshes of a model, each with its colour; `TINTS` from the *first* on."""
    if isinstance(model, Primitives):
        return [(mesh, TINTS[(first + i) % len(TINTS)]) for i, mesh in enumerate(model.meshes())]
    if isinstance(model, Wireframe):
        return [(rods(model.points[model.edges]), LINE)]
    if isinstance(model, Outline):
        ends = [np.stack([line[:-1], line[1:]], axis=1) for line in model.polylines]
        if not ends:
            raise InputError("the outline is empty: the plane misses the body")
        return [(rods(np.concatenate(ends)), LINE)]
    if isinstance(model, DistanceField):
        return [(model.surface().mesh, TINTS[first % len(TINTS)])]
    return [(model.mesh, TINTS[first % len(TINTS)])]


def rods(ends: Array, radius: float | None = None) -> Mesh:
    """Straight lines ``(E, 2, 3)`` as rods with four sides, `THIN` unless a *radius* is given."""
    ends = ends[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > 0.0]
    if not len(ends):
        raise InputError("there are no lines to draw; give a smaller angle, or rings")
    if radius is None:
        radius = THIN * float(np.ptp(ends.reshape(-1, 3), axis=0).max())
    along = ends[:, 1] - ends[:, 0]
    along /= np.linalg.norm(along, axis=1)[:, None]
    x = np.cross(np.eye(3)[np.abs(along).argmin(axis=1)], along)
    x /= np.linalg.norm(x, axis=1)[:, None]
    y = np.cross(along, x)
    around = np.stack([x, y, -x, -y], axis=1)
    beyond = np.array([-0.5, 0.5])[:, None, None] * along[:, None, None]  # so that rods meet at corners
    corners = ends[:, :, None] + radius * (around[:, None] + beyond)
    side = [(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4)]
    quads = [*side, (3, 2, 1, 0), (4, 5, 6, 7)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    index = (8 * np.arange(len(ends)))[:, None, None] + faces
    return corners.reshape(-1, 3), index.reshape(-1, 3).astype(np.int64)


def things(model: Any, name: str = "model", pose: Array | None = None, alpha: float = 1.0) -> tuple[Thing, ...]:
    """The model as things on a stage, at *pose*."""
    T = np.eye(4) if pose is None else pose
    return tuple(
        Thing(f"{name}{i}", *mesh, T, (*rgba[:3], alpha * rgba[3])) for i, (mesh, rgba) in enumerate(meshes_of(model))
    )


def link_stage(models: LinkModels) -> Stage:
    """The robot made of the models of its links."""
    return Stage(models.robot, link_parts_of(models))


def link_parts_of(models: LinkModels, alpha: float = 1.0) -> Mapping[str, tuple[Part, ...]]:
    """The models of the links as parts to be drawn."""
    return {
        name: tuple(Part(*mesh, (*rgba[:3], alpha * rgba[3])) for mesh, rgba in meshes_of(model, first))
        for first, (name, model) in enumerate(models.links.items())
    }
