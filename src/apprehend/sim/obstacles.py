"""Fixed obstacles of any geometry as geoms of the physics engine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from ..arrays import Array
from ..collision import Convex, HalfSpace, Union
from ..kernels.gjk import BOX, CYLINDER, ELLIPSOID
from .shapes import FIXED_GROUP, STATIC, add_mesh, is_flat, place

if TYPE_CHECKING:
    from ..collision import Obstacle
    from ..collision.geometry import Geometry
    from .physics import Physics

MANY = 500
"""Largest union that the engine gets piece by piece."""

PLATE = 2e-3
"""Thickness in m of a triangle in the engine."""


def add_obstacle(spec: Any, obstacle: Obstacle, physics: Physics) -> str | None:
    """Add a fixed obstacle to the world; returns a sentence where the engine cannot have all of it.

    Half-spaces become planes and convex shapes primitives or hulls; triangles, such as those of a height field, become
    plates that reach `PLATE` below their faces. Clouds and distance fields have no contact in the engine: what is
    planned keeps clear of them, what is simulated does not feel them.
    """
    holder = spec.worldbody.add_body(name=f"obstacle:{obstacle.name}")
    options: dict[str, Any] = {
        "contype": STATIC,
        "conaffinity": 0,
        "group": FIXED_GROUP,
        "rgba": obstacle.rgba,
        "friction": [obstacle.friction, 0.0, 0.0],
        "solref": physics.solref,
        "solimp": physics.solimp,
    }
    missing = set()
    shapes: list[Geometry] = []
    for shape in obstacle.shapes:
        if isinstance(shape, Union) and len(shape.shapes) <= MANY:
            shapes += [part.at(shape.pose) for part in shape.shapes]
        else:
            shapes.append(shape)
    for i, shape in enumerate(shapes):
        if not _add(spec, holder, shape, f"obstacle:{obstacle.name}:{i}", options):
            missing.add(type(shape).__name__)
    if not missing:
        return None
    return f"obstacle {obstacle.name}: the engine has no contacts for its {', '.join(sorted(missing))}; it is not felt"


def _add(spec: Any, holder: Any, shape: Geometry, name: str, options: dict[str, Any]) -> bool:
    """Add one shape; False for what the engine does not have."""
    kinds = mujoco.mjtGeom
    if isinstance(shape, HalfSpace):
        place(holder.add_geom(type=kinds.mjGEOM_PLANE, size=[0.0, 0.0, 0.05], **options), shape.pose)
        return True
    if not isinstance(shape, Convex):
        return False
    size = [float(x) for x in shape.size]
    if shape.kind == BOX:
        geom = holder.add_geom(type=kinds.mjGEOM_BOX, size=size, **options)
    elif shape.kind == CYLINDER:
        geom = holder.add_geom(type=kinds.mjGEOM_CYLINDER, size=size, **options)
    elif shape.kind == ELLIPSOID:
        geom = holder.add_geom(type=kinds.mjGEOM_ELLIPSOID, size=size, **options)
    elif len(shape.points) in (1, 2):
        return _round(holder, shape, options)
    else:
        points = plate(shape.points) if len(shape.points) == 3 else shape.points
        if not len(points) or shape.radius > 0.0 or is_flat(points):
            return False
        geom = holder.add_geom(type=kinds.mjGEOM_MESH, meshname=add_mesh(spec, name, points), **options)
    place(geom, shape.pose)
    return True


def plate(triangle: Array) -> Array:
    """Corners ``(6, 3)`` of the prism of thickness `PLATE` below a triangle ``(3, 3)``."""
    normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    below: Array = triangle - PLATE * normal / max(float(np.linalg.norm(normal)), 1e-300)
    return np.concatenate([triangle, below])


def _round(holder: Any, shape: Convex, options: dict[str, Any]) -> bool:
    """A sphere or a capsule from its point or its two."""
    if shape.radius <= 0.0:
        return False
    ends = shape.points @ shape.pose[:3, :3].T + shape.pose[:3, 3]
    if len(ends) == 1:
        holder.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[shape.radius, 0.0, 0.0], pos=ends[0], **options)
    else:
        holder.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[shape.radius, 0.0, 0.0], fromto=ends.ravel(), **options
        )
    return True
