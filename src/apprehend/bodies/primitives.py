"""Simplified models of a body: block world, spheres, capsules, convex pieces (K, block world and collision model).

Boxes, spheres and capsules enclose the body: the surface is cut into parts, and each part is held by a shape that
holds its corners and the rims of the cuts. `Deviation` says how far the model sticks out.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_pose, as_shaped
from ..errors import InputError
from . import files, fit, mass, repair, shapes, topology
from .deviation import Deviation, farthest_of_solid, farthest_of_surface
from .index import MeshIndex
from .parts import Cost, partitions

Mesh = tuple[Array, IntArray]

MOST = 512
"""Most shapes of one model."""

SAMPLES = 8192
"""Points at which models of more and fewer shapes are compared."""


@dataclass(frozen=True, eq=False)
class Primitives(ABC):
    """A union of simple convex shapes in the frame of the body (or link)."""

    KIND: ClassVar[str]
    ENCLOSES: ClassVar[bool] = True
    TAILS: ClassVar[dict[str, tuple[int, ...]]] = {}
    """Shape of the entries of each array: one entry per shape of the model."""

    def __post_init__(self) -> None:
        read = {name: as_shaped(getattr(self, name), name, *tail) for name, tail in self.TAILS.items()}
        for name, tail in self.TAILS.items():
            if read[name].ndim != 1 + len(tail) or not len(read[name]):
                raise InputError(f"{name} has shape {read[name].shape}; expected one entry per shape: (k, …), k ≥ 1")
            if name in ("sizes", "radii") and read[name].min() < 0.0:
                raise InputError(f"{name} contains {read[name].min():g}; expected lengths of zero or more, in m")
            object.__setattr__(self, name, read[name])
        if len({len(array) for array in read.values()}) > 1:
            counts = ", ".join(f"{len(array)} {name}" for name, array in read.items())
            raise InputError(f"a model of {self.KIND} got {counts}; expected as many of each")

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def meshes(self) -> list[Mesh]:
        """One closed mesh per shape; round ones are polyhedra with corners on the shape."""

    @abstractmethod
    def _distance(self, points: Array) -> Array:
        """`distance` of ``points (N, 3)``."""

    @abstractmethod
    def at(self, pose: ArrayLike) -> Self:
        """The same model moved by *pose* ``(4, 4)``."""

    def _arrays(self) -> dict[str, Any]:
        """What `save` writes."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def joined(self, *others: Self) -> Self:
        """One model of the shapes of this one and of *others*."""
        together = {f.name: np.concatenate([getattr(m, f.name) for m in (self, *others)]) for f in fields(self)}
        return replace(self, **together)

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance ``(...)`` of *points* ``(..., 3)`` from the nearest shape, negative inside.

        Exact outside for boxes, spheres and capsules; for convex pieces, and inside, never larger in size than it is.
        """
        p = as_shaped(points, "points", 3)
        return self._distance(p.reshape(-1, 3)).reshape(p.shape[:-1])

    def inside(self, points: ArrayLike) -> BoolArray:
        """Whether *points* ``(..., 3)`` lie in one of the shapes."""
        within: BoolArray = self.distance(points) <= 0.0
        return within

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper corner ``(2, 3)`` of the box around the meshes."""
        points = np.concatenate([v for v, _ in self.meshes()])
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @cached_property
    def union(self) -> Mesh:
        """The surface of the union of `meshes`, closed."""
        meshes = self.meshes()
        whole = repair.union(meshes) if len(meshes) > 1 else meshes[0]
        return whole if whole is not None else _joined(meshes)

    @property
    def mesh(self) -> Mesh:
        """`union`: the model as a surface mesh ``(vertices, faces)``."""
        return self.union

    @cached_property
    def volume(self) -> float:
        """Volume of the union in m³: that of `union`, enlarged by what the polyhedra of round shapes lack."""
        meshes = sum(mass.solid(*mesh).volume for mesh in self.meshes())
        return mass.solid(*self.union).volume * (float(self._volumes().sum()) / meshes if meshes > 0.0 else 1.0)

    def _volumes(self) -> Array:
        """Volume of each shape ``(k,)``."""
        return np.array([mass.solid(*mesh).volume for mesh in self.meshes()])

    def deviation(self, body: MeshIndex) -> Deviation:
        """How much the model differs from *body* (see `Deviation`)."""
        low, high = self.bounds
        pad = 0.02 * float((high - low).max())
        outward = farthest_of_solid(self._distance, low - pad, high + pad, body.capped.signed_distance)[1]
        volume = mass.solid(body.capped.vertices, body.capped.faces).volume
        return Deviation(outward, self._missed(body), self.ENCLOSES, self.volume, max(volume, 0.0))

    def _missed(self, body: MeshIndex) -> float:
        """How far the body may stick out."""
        return 0.0

    def save(self, path: str | Path) -> Path:
        """Write the shapes as ``.npz`` (`load` reads them), or their union as a mesh (``.obj``, ``.stl``, …)."""
        if Path(path).suffix.lower() in (".npz", ""):
            return files.write(path, self.KIND, **self._arrays())
        return files.write_mesh(path, *self.union)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The model that `save` wrote as ``.npz``."""
        data = files.read(path, cls.KIND, *cls.TAILS)
        return cls(**{name: data[name] for name in cls.TAILS})


@dataclass(frozen=True, eq=False)
class Boxes(Primitives):
    """Block world: boxes given by the poses ``(k, 4, 4)`` of their centres and their full extents ``(k, 3)``."""

    poses: Array
    sizes: Array
    KIND: ClassVar[str] = "boxes"
    TAILS: ClassVar[dict[str, tuple[int, ...]]] = {"poses": (4, 4), "sizes": (3,)}

    @staticmethod
    def around(index: MeshIndex, count: int = 1, *, oriented: bool = True) -> Boxes:
        """At most *count* boxes around the parts of a surface; along the axes unless *oriented*."""

        def make(part: Array) -> Boxes:
            box = fit.block(part) if oriented else fit.aligned_block(part)
            return Boxes(box.pose[None], box.size[None])

        return _best(make, index, count, lambda s: float(np.prod(s)))

    def __len__(self) -> int:
        return len(self.sizes)

    def meshes(self) -> list[Mesh]:
        """The boxes as meshes."""
        return [_placed(shapes.box(size), pose) for pose, size in zip(self.poses, self.sizes)]

    def _distance(self, points: Array) -> Array:
        best = np.full(len(points), np.inf)
        for pose, size in zip(self.poses, self.sizes):
            beyond = np.abs((points - pose[:3, 3]) @ pose[:3, :3]) - 0.5 * size
            outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
            best = np.minimum(best, outside + np.minimum(beyond.max(axis=1), 0.0))
        return best

    def at(self, pose: ArrayLike) -> Self:
        """The same boxes moved by *pose* ``(4, 4)``."""
        return replace(self, poses=as_pose(pose, "pose") @ self.poses)


@dataclass(frozen=True, eq=False)
class Spheres(Primitives):
    """Spheres given by centres ``(k, 3)`` and radii ``(k,)``."""

    centres: Array
    radii: Array
    KIND: ClassVar[str] = "spheres"
    TAILS: ClassVar[dict[str, tuple[int, ...]]] = {"centres": (3,), "radii": ()}

    @staticmethod
    def around(index: MeshIndex, count: int = 24) -> Spheres:
        """At most *count* spheres around the parts of a surface."""

        def make(part: Array) -> Spheres:
            ball = fit.ball(part)
            return Spheres(ball.centre[None], np.array([ball.radius]))

        return _best(make, index, count, lambda s: 0.52 * float(s @ s) ** 1.5)

    def __len__(self) -> int:
        return len(self.radii)

    def meshes(self) -> list[Mesh]:
        """The spheres as icospheres of 1280 faces."""
        unit, faces = shapes.sphere(1.0)
        return [(unit * radius + centre, faces) for centre, radius in zip(self.centres, self.radii)]

    def _distance(self, points: Array) -> Array:
        best = np.full(len(points), np.inf)
        for centre, radius in zip(self.centres, self.radii):
            best = np.minimum(best, np.linalg.norm(points - centre, axis=1) - radius)
        return best

    def _volumes(self) -> Array:
        return np.asarray(4.0 / 3.0 * np.pi * self.radii**3)

    def at(self, pose: ArrayLike) -> Self:
        """The same spheres moved by *pose* ``(4, 4)``."""
        T = as_pose(pose, "pose")
        return replace(self, centres=self.centres @ T[:3, :3].T + T[:3, 3])


@dataclass(frozen=True, eq=False)
class Capsules(Primitives):
    """Capsules given by the ends ``(k, 2, 3)`` of their segments and their radii ``(k,)``."""

    ends: Array
    radii: Array
    KIND: ClassVar[str] = "capsules"
    TAILS: ClassVar[dict[str, tuple[int, ...]]] = {"ends": (2, 3), "radii": ()}

    @staticmethod
    def around(index: MeshIndex, count: int = 1) -> Capsules:
        """At most *count* capsules around the parts of a surface."""

        def cost(s: Array) -> float:
            c, b, a = np.sort(s)
            r = 0.5 * np.hypot(b, c)
            return float(np.pi * r * r * (max(a - r, 0.0) + 4.0 / 3.0 * r))

        def make(part: Array) -> Capsules:
            capsule = fit.capsule(part)
            return Capsules(capsule.ends[None], np.array([capsule.radius]))

        return _best(make, index, count, cost)

    def __len__(self) -> int:
        return len(self.radii)

    def meshes(self) -> list[Mesh]:
        """The capsules as polyhedra of 32 sides."""
        return [_capsule(*each) for each in zip(self.ends, self.radii)]

    def _distance(self, points: Array) -> Array:
        best = np.full(len(points), np.inf)
        for (a, b), radius in zip(self.ends, self.radii):
            along, to = b - a, points - a
            t = np.clip(to @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
            best = np.minimum(best, np.linalg.norm(to - t[:, None] * along, axis=1) - radius)
        return best

    def _volumes(self) -> Array:
        return np.array([fit.capsule_volume(fit.Capsule(*each)) for each in zip(self.ends, self.radii)])

    def at(self, pose: ArrayLike) -> Self:
        """The same capsules moved by *pose* ``(4, 4)``."""
        T = as_pose(pose, "pose")
        return replace(self, ends=self.ends @ T[:3, :3].T + T[:3, 3])


@dataclass(frozen=True, eq=False)
class ConvexPieces(Primitives):
    """Convex polyhedra ``(vertices, faces)`` that cover the body nearly (`Body.convex_pieces`), not by construction."""

    pieces: tuple[Mesh, ...]
    KIND: ClassVar[str] = "convex pieces"
    ENCLOSES: ClassVar[bool] = False

    def __len__(self) -> int:
        return len(self.pieces)

    def meshes(self) -> list[Mesh]:
        """The pieces."""
        return list(self.pieces)

    def _missed(self, body: MeshIndex) -> float:
        return farthest_of_surface(body.vertices[body.faces], self._outside, self._outside_on)[1]

    def _outside(self, points: Array) -> Array:
        return np.maximum(self._distance(points), 0.0)

    def _outside_on(self, triangles: Array) -> Array:
        """What `_outside` does not exceed on triangles ``(N, 3, 3)``: for one piece it is largest at a corner."""
        return np.maximum(self._beyond(triangles), 0.0)

    @cached_property
    def _planes(self) -> list[Array]:
        from .convex import _planes

        return [_planes(v[f]) for v, f in self.pieces]

    def _distance(self, points: Array) -> Array:
        return self._beyond(points[:, None])

    def _beyond(self, groups: Array) -> Array:
        """How far the corners of ``groups (N, c, 3)`` are beyond the planes of a piece at most, for the nearest piece.

        The sides of the box around a piece count as planes of it, so that most groups are done with most pieces after
        six of them.
        """
        best = np.full(len(groups), np.inf)
        boxes = np.array([[v.min(axis=0), v.max(axis=0)] for v, _ in self.pieces])
        for first in range(0, len(groups), 4096):
            few = groups[first : first + 4096]
            aside = np.stack([np.maximum(low - few, few - high).max(axis=(1, 2)) for low, high in boxes])
            least = best[first : first + 4096]
            for k in np.argsort(aside.min(axis=1)):
                near = aside[k] < least
                if near.any():
                    planes = self._planes[k]
                    beyond = (few[near] @ planes[:, :3].T - planes[:, 3]).max(axis=(1, 2))
                    least[near] = np.minimum(least[near], np.maximum(beyond, aside[k, near]))
        return best

    def at(self, pose: ArrayLike) -> Self:
        """The same pieces moved by *pose* ``(4, 4)``."""
        T = as_pose(pose, "pose")
        return replace(self, pieces=tuple(_placed(piece, T) for piece in self.pieces))

    def _arrays(self) -> dict[str, Any]:
        arrays: dict[str, Any] = {"count": len(self.pieces)}
        for i, (v, f) in enumerate(self.pieces):
            arrays[f"v{i}"], arrays[f"f{i}"] = v, f
        return arrays

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The pieces that `save` wrote."""
        count = int(files.read(path, cls.KIND, "count")["count"])
        data = files.read(path, cls.KIND, *(f"{letter}{i}" for i in range(count) for letter in "vf"))
        return cls(tuple((data[f"v{i}"], data[f"f{i}"]) for i in range(count)))


Fitted = TypeVar("Fitted", bound=Primitives)


def _best(make: Callable[[Array], Fitted], index: MeshIndex, count: int, cost: Cost) -> Fitted:
    """The model of at most *count* shapes of the smallest union among those that stick out least but for 5 %.

    *make* fits one shape to the corners of each part; every part is fitted once.
    """
    if not 1 <= count <= MOST:
        raise InputError(f"count is {count}; expected 1 to {MOST} shapes")
    low, high = index.tree.boxes[0, :3], index.tree.boxes[0, 3:]
    pad = 0.3 * float((high - low).max())
    points = np.random.default_rng(0).uniform(low - pad, high + pad, (SAMPLES, 3))
    away = index.signed_distance(points) if count > 1 else np.zeros(len(points))
    shapes_of: dict[int, tuple[Fitted, BoolArray, Array]] = {}

    def fitted(part: Array) -> tuple[Fitted, BoolArray, Array]:
        if id(part) not in shapes_of:
            model = make(part)
            shapes_of[id(part)] = model, model.inside(points), part
        return shapes_of[id(part)]

    def sticks_out(part: Array) -> float:
        return float(away[fitted(part)[1]].max(initial=0.0))

    found: list[tuple[float, int, list[Fitted]]] = []
    for partition in partitions(index.vertices, index.faces, count, cost, sticks_out):
        covered = np.any([fitted(part)[1] for part in partition], axis=0)
        outward = float(away[covered].max(initial=0.0))
        found.append((outward, int(covered.sum()), [fitted(part)[0] for part in partition]))
    enough = 1.05 * min(outward for outward, _, _ in found)
    best = min((f for f in found if f[0] <= enough), key=lambda f: f[1])[2]
    first, *others = best
    return first.joined(*others)


def _placed(mesh: Mesh, pose: Array) -> Mesh:
    return mesh[0] @ pose[:3, :3].T + pose[:3, 3], mesh[1]


def _joined(meshes: list[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(v) for v, _ in meshes[:-1])])
    return topology.compact(
        np.concatenate([v for v, _ in meshes]), np.concatenate([f + s for (_, f), s in zip(meshes, starts)])
    )


def _capsule(ends: Array, radius: float, sides: int = 32, rings: int = 8) -> Mesh:
    """A capsule as a solid of revolution, its corners on its surface."""
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along))
    z = along / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    angle = np.linspace(-0.5 * np.pi, 0.0, rings + 1)
    lower = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    lower[0, 0] = 0.0
    profile = np.concatenate([lower, (lower * [1.0, -1.0] + [0.0, length])[::-1]])
    if length == 0.0:
        profile = np.delete(profile, rings, axis=0)
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), ends[0]
    return _placed(shapes.revolve(profile, sides), pose)
