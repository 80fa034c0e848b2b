"""Models of a robot's links: block world, spheres, capsules, wireframe, … of each, with what they miss or add (K)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped, choice
from ..errors import InputError
from ..robots.description import Description, Link, Shape, ShapeKind
from ..robots.meshes import link_surface

if TYPE_CHECKING:  # robots are read far more often than modelled, so functions import what they need
    from ..bodies import Boxes, Capsules, ConvexPieces, Deviation, MeshIndex, Spheres, SurfaceMesh, Wireframe
    from .robot import Robot

    LinkModel = Boxes | Capsules | ConvexPieces | Spheres | SurfaceMesh | Wireframe

KINDS = ("surface", "simplified", "wireframe", "blocks", "boxes", "spheres", "capsules", "convex")
"""Models that a link can have; blocks are boxes along the axes of the link."""

COUNTS = {"simplified": 500, "blocks": 1, "boxes": 1, "spheres": 16, "capsules": 1}
"""Shapes (or faces) per link unless told otherwise."""

ROUND = 1.01
"""Round shapes are known as polyhedra within them; grown by this factor the polyhedra contain the shapes."""


@dataclass(frozen=True, eq=False)
class LinkModels:
    """One model for each link that has a shape, in the frame of the link."""

    robot: Robot
    kind: str
    links: Mapping[str, LinkModel]
    surfaces: Mapping[str, MeshIndex]
    """What was modelled: the links' surfaces."""

    @cached_property
    def deviations(self) -> Mapping[str, Deviation]:
        """What is lost between each link's surface and its model: bounds that hold."""
        return {name: model.deviation(self.surfaces[name]) for name, model in self.links.items()}

    @property
    def outward(self) -> float:
        """No point of any model is farther than this from its link, in m."""
        return max(d.outward for d in self.deviations.values())

    def at(self, q: ArrayLike) -> dict[str, Array]:
        """Poses T_world_link ``(..., 4, 4)`` of the modelled links at ``q (..., n)``."""
        frames = self.robot.fk(q)
        return {name: frames[..., self.robot.frame_names.index(name), :, :] for name in self.links}

    def distance(self, points: ArrayLike, q: ArrayLike) -> Array:
        """Distance ``(...)`` of *points* ``(..., 3)`` in the world from the nearest model at one ``q (n,)``."""
        p = as_shaped(points, "points", 3)
        poses = self.at(as_shaped(q, "q", self.robot.n).reshape(self.robot.n))
        each = [model.distance((p - poses[n][:3, 3]) @ poses[n][:3, :3]) for n, model in self.links.items()]
        return np.asarray(np.min(each, axis=0))

    def description(self) -> Description:
        """The robot with these boxes, spheres or capsules as its collision geometry; looks and all else stay."""
        choice(self.kind, "kind", ("blocks", "boxes", "spheres", "capsules"))
        links = {
            name: replace(link, collisions=tuple(_shapes(self.links[name])) if name in self.links else ())
            for name, link in self.robot.description.links.items()
        }
        return replace(self.robot.description, links=links)

    def save(self, path: str | Path) -> Path:
        """Write the robot with its models as collision geometry: ``.urdf`` (not for capsules) or MJCF ``.xml``."""
        from ..robots import save_mjcf, save_urdf

        path = Path(path)
        if path.suffix.lower() == ".urdf" and self.kind == "capsules":
            raise InputError(f"{path}: URDF has no capsules; write MJCF (.xml), or use boxes or spheres")
        if path.suffix.lower() not in (".urdf", ".xml"):
            raise InputError(f"{path}: the ending {path.suffix!r} is none of a robot; expected .urdf or .xml (MJCF)")
        (save_urdf if path.suffix.lower() == ".urdf" else save_mjcf)(self.description(), path)
        return path

    def report(self) -> str:
        """One line for each link: how many shapes, and what is lost."""
        width = max(map(len, self.links), default=0)
        return "\n".join(
            f"{name:<{width}}  {f'{len(model)} ' if hasattr(model, '__len__') else ''}{self.kind}: "
            f"{self.deviations[name]}"
            for name, model in self.links.items()
        )


def link_models(robot: Robot, kind: str = "capsules", count: int | None = None, *, visual: bool = False) -> LinkModels:
    """Models of every link of *robot* that has a shape: one of `KINDS`, at most *count* shapes (or faces) per link.

    Boxes, spheres and capsules enclose the link's collision shapes (or what is seen of it, if *visual*); convex pieces
    cover them nearly. `LinkModels.deviations` says what each adds or misses.
    """
    from ..bodies import MeshIndex

    choice(kind, "kind", KINDS)
    if count is not None and not 1 <= count <= 100_000:
        raise InputError(f"count is {count}; expected 1 or more shapes per link")
    surfaces, links = {}, {}
    for name, link in robot.description.links.items():
        vertices, faces = link_surface(link, visual=visual)
        if not len(faces):
            continue
        surfaces[name] = MeshIndex(vertices, faces)
        grown = link_surface(_grown(link), visual=visual)
        links[name] = _model(kind, count or COUNTS.get(kind, 1), surfaces[name], MeshIndex(*grown))
    if not links:
        raise InputError(
            f"no link of {robot.name} has a {'visual' if visual else 'collision'} shape, so there is nothing to model; "
            f"try visual={not visual}"
        )
    return LinkModels(robot, kind, links, surfaces)


def _grown(link: Link) -> Link:
    """The link with round shapes grown so that their polyhedra contain them."""

    def grow(shape: Shape) -> Shape:
        if shape.kind in (ShapeKind.MESH, ShapeKind.BOX):
            return shape
        return replace(shape, size=(ROUND * shape.size[0], *shape.size[1:]))

    return replace(link, visuals=tuple(map(grow, link.visuals)), collisions=tuple(map(grow, link.collisions)))


def _model(kind: str, count: int, surface: MeshIndex, grown: MeshIndex) -> LinkModel:
    from ..bodies import Boxes, Capsules, ConvexPieces, Spheres, SurfaceMesh, Wireframe
    from ..bodies.convex import decompose
    from ..bodies.surface_mesh import thinned

    if kind == "surface":
        return SurfaceMesh(surface.vertices, surface.faces)
    if kind == "simplified":
        return thinned(surface, max(count, 4))
    if kind == "wireframe":
        return Wireframe.of(surface)
    if kind == "convex":
        return ConvexPieces(decompose(surface.vertices, surface.faces, surface.closed).pieces)
    if kind == "spheres":
        return Spheres.around(grown, count)
    if kind == "capsules":
        return Capsules.around(grown, count)
    return Boxes.around(grown, count, oriented=kind == "boxes")


def _shapes(model: Any) -> list[Shape]:
    """The shapes of a model as they stand in a description."""
    from ..bodies import Boxes, Spheres

    if isinstance(model, Boxes):
        return [Shape(ShapeKind.BOX, tuple(map(float, s)), p.copy()) for p, s in zip(model.poses, model.sizes)]
    if isinstance(model, Spheres):
        return [Shape(ShapeKind.SPHERE, (float(r),), _at(c)) for c, r in zip(model.centres, model.radii)]
    shapes = []
    for (a, b), radius in zip(model.ends, model.radii):
        length = float(np.linalg.norm(b - a))
        pose = _at(0.5 * (a + b))
        if length > 0.0:
            z = (b - a) / length
            x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
            x /= np.linalg.norm(x)
            pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        shapes.append(Shape(ShapeKind.CAPSULE, (float(radius), length), pose))
    return shapes


def _at(point: Array) -> Array:
    T = np.eye(4)
    T[:3, 3] = point
    return T
