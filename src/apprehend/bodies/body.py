"""`Body`: a rigid object to be handled, with its surface, mass properties and friction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_shaped
from ..errors import InputError, MeshError, expect_path
from . import rest
from .convex import ConvexParts, Piece, decompose
from .load import check_mesh, read_mesh
from .mass import Solid, check_inertia, solid
from .models import Models
from .repair import Mended, mend, union
from .rest import RestPose

ASSUMED_DENSITY = 500.0
"""Density in kg/m³ if neither mass nor density is given (`Body.mass_source` then says so): between a filled bottle
and the hollow things that make up most of a household."""

DENSEST = 22_600.0
"""Density of osmium in kg/m³: a body from a file that is denser has a wrong mass or a wrong unit."""

ROUGHNESS = 3e-4
"""Rise in m below which two resting poses count as one, at most 2 % of the radius: a scan is that rough, and a round
side has facets. At 0.3 kg it is an energy of 1 mJ."""


@dataclass(frozen=True, eq=False)
class Body(Models):
    """A rigid body. Everything is in the coordinates of its mesh file, in SI units; make one with `Body.load`.

    The centre of mass and the inertia are those of the solid of even density that the surface encloses, unless given.
    """

    name: str
    vertices: Array
    """``(V, 3)`` in m."""
    faces: IntArray
    """``(F, 3)``, counter-clockwise seen from outside."""
    mass: float
    """In kg."""
    com: Array
    """``(3,)`` centre of mass in m."""
    inertia: Array
    """``(3, 3)`` about the centre of mass, in kg m²."""
    volume: float
    """In m³."""
    friction: float = 0.6
    """Coulomb coefficient µ of the surface."""
    torsional_friction: float = 0.005
    """Radius γ in m of the soft-finger model: the largest torsional moment is γ times the normal force."""
    watertight: bool = True
    """Whether the surface, after repair, is closed and encloses the body."""
    repairs: tuple[str, ...] = ()
    """What had to be done to the mesh to make it usable, in words; empty if nothing."""
    mass_source: str = "given"
    """``"given"``, ``"density"`` or ``"assumed"`` (see `ASSUMED_DENSITY`)."""
    source: Path | None = None
    """The file that it was read from."""

    @classmethod
    def load(
        cls,
        path: str | Path,
        mass: float | None = None,
        density: float | None = None,
        friction: float = 0.6,
        units: str | None = None,
        name: str | None = None,
        *,
        torsional_friction: float = 0.005,
    ) -> Self:
        """The body whose surface is the mesh at *path* (``.obj``, ``.stl``, ``.ply``, ``.glb``, ``.off``).

        *mass* in kg or *density* in kg/m³; with neither, `ASSUMED_DENSITY`. *units* of the file: ``"m"``, ``"cm"``,
        ``"mm"`` or ``"in"``; None means metres, and refuses sizes that no hand could handle.
        Raises `MeshError` if the file is missing, unreadable, too large, flat, or cannot be made to enclose a volume,
        and `InputError` for a mass, density or friction that no body has.
        """
        expect_path(path, "path", "the path of a mesh file")
        path = Path(path)
        vertices, faces = read_mesh(path, units)
        body = cls.from_mesh(
            vertices,
            faces,
            mass=mass,
            density=density,
            friction=friction,
            torsional_friction=torsional_friction,
            name=name or path.stem,
            source=path,
        )
        if body.mass > DENSEST * body.volume:
            raise InputError(
                f"{path}: a mass of {body.mass:g} kg in {1e6 * body.volume:.4g} cm³ is {body.mass / body.volume:.3g} "
                f"kg/m³, denser than any material ({DENSEST:g} kg/m³): check the mass (in kg) and the mesh's units"
            )
        return body

    @classmethod
    def from_mesh(
        cls,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        mass: float | None = None,
        density: float | None = None,
        friction: float = 0.6,
        torsional_friction: float = 0.005,
        com: ArrayLike | None = None,
        inertia: ArrayLike | None = None,
        name: str = "body",
        source: Path | None = None,
    ) -> Self:
        """The body with the surface ``vertices (V, 3)`` in m, ``faces (F, 3)``; repaired like a file.

        *com* and *inertia* (about the centre of mass) may be given where they were measured.
        """
        where = str(source or name)
        points = np.asarray(vertices, dtype=np.float64)
        triangles = np.asarray(faces)
        if triangles.size and not np.issubdtype(triangles.dtype, np.integer):
            raise MeshError(f"{where}: faces are of type {triangles.dtype}; expected integers (indices of vertices)")
        triangles = triangles.astype(np.int64)
        check_mesh(points, triangles, where)
        for label, value in (("friction", friction), ("torsional_friction", torsional_friction)):
            if not (_is_number(value) and value >= 0.0):
                raise InputError(f"{where}: {label} is {value!r}; expected a finite number, zero or more")
        kilograms, per_volume, mass_source = _mass_arguments(mass, density, where)
        mesh = mend(points, triangles)
        region, mesh, sound = _enclosed(mesh, where)
        if per_volume is not None:
            kilograms = per_volume * region.volume
        centre = region.centroid if com is None else as_shaped(com, f"{where}: com", 3)
        tensor = region.inertia * (kilograms / region.volume)
        if inertia is not None:
            tensor = as_shaped(inertia, f"{where}: inertia", 3, 3)
        check_inertia(tensor, f"{where}: inertia")
        body = cls(
            name=name,
            vertices=mesh.vertices,
            faces=mesh.faces,
            mass=kilograms,
            com=centre,
            inertia=0.5 * (tensor + tensor.T),
            volume=region.volume,
            friction=float(friction),
            torsional_friction=float(torsional_friction),
            watertight=sound,
            repairs=mesh.repairs,
            mass_source=mass_source,
            source=source,
        )
        if com is not None and not _within_hull(body.vertices, centre):
            raise InputError(f"{where}: com is {centre.tolist()}, outside the convex hull of the body")
        return body

    @classmethod
    def household(cls, name: str) -> Body:
        """One of the generated household objects (`bodies.HOUSEHOLD`), e.g. ``"mug"``."""
        from .household import household

        return household(name)

    @classmethod
    def box(cls, size: ArrayLike, **options: object) -> Self:
        """A box of full extents *size* (3,) in m, centred at the origin; *options* as for `from_mesh`."""
        from . import shapes

        extents = as_shaped(size, "size", 3)
        if extents.min() <= 0.0:
            raise InputError(f"size is {extents.tolist()}; every extent of a box must be positive")
        return cls.from_mesh(*shapes.box(extents), **{"name": "box", **options})  # type: ignore[arg-type]

    @classmethod
    def cylinder(cls, radius: float, height: float, **options: object) -> Self:
        """A cylinder along z, centred at the origin, of 64 sides; *options* as for `from_mesh`."""
        from . import shapes

        _positive(radius=radius, height=height)
        return cls.from_mesh(*shapes.cylinder(radius, height), **{"name": "cylinder", **options})  # type: ignore[arg-type]

    @classmethod
    def sphere(cls, radius: float, **options: object) -> Self:
        """A sphere about the origin (an icosphere of 1280 faces); *options* as for `from_mesh`."""
        from . import shapes

        _positive(radius=radius)
        return cls.from_mesh(*shapes.sphere(radius), **{"name": "sphere", **options})  # type: ignore[arg-type]

    # the surface

    @cached_property
    def triangles(self) -> Array:
        """Corners of the faces, ``(F, 3, 3)``."""
        return np.asarray(self.vertices[self.faces])

    @cached_property
    def face_areas(self) -> Array:
        """Area of each face in m², ``(F,)``."""
        a, b, c = (self.triangles[:, k] for k in range(3))
        return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))

    @cached_property
    def face_normals(self) -> Array:
        """Outward unit normals ``(F, 3)``; a face without area takes the direction of its nearest sound neighbour."""
        from .surface import unit_normals

        return unit_normals(self.triangles)

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper corner of the axis-aligned box, ``(2, 3)``."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def extents(self) -> Array:
        """Size of the axis-aligned box, ``(3,)`` in m."""
        return np.asarray(self.bounds[1] - self.bounds[0])

    @cached_property
    def radius(self) -> float:
        """Largest distance of the surface from the centre of mass, in m (the torque scale of grasp qualities)."""
        return float(np.linalg.norm(self.vertices - self.com, axis=1).max())

    @property
    def area(self) -> float:
        """Area of the surface in m²."""
        return float(self.face_areas.sum())

    def sample_surface(self, n: int, rng: np.random.Generator) -> tuple[Array, Array, IntArray]:
        """*n* points spread evenly over the area: points ``(n, 3)``, inward unit normals ``(n, 3)``, faces ``(n,)``."""
        from .surface import sample

        if n < 0:
            raise InputError(f"n is {n}; expected zero or more points")
        return sample(self.triangles, self.face_areas, self.face_normals, n, rng)

    # contact geometry

    @cached_property
    def _parts(self) -> ConvexParts:
        return decompose(self.vertices, self.faces, self.watertight)

    @property
    def convex_pieces(self) -> tuple[Piece, ...]:
        """Convex pieces ``(vertices, faces)`` that together cover the body, for contact; kept on disk.

        `convex_error` states how far their surface is from the body's.
        """
        return self._parts.pieces

    @property
    def convex_error(self) -> float:
        """Largest distance in m found between a point of the convex pieces' outer surface and the body."""
        return self._parts.error

    # rest

    def stable_poses(
        self, *, roughness: float | None = None, min_probability: float = 0.0, min_tip_angle: float = 0.0
    ) -> tuple[RestPose, ...]:
        """The poses in which the body rests on the plane z = 0, the likeliest first (see `bodies.rest`).

        Poses that are separated by a rise of the centre of mass below *roughness* (m; None: `ROUGHNESS`) are one; with
        0 every facet of the convex hull that holds the foot of the centre of mass is a pose. The probabilities of all
        poses add up to one; those below *min_probability*, or that tip within *min_tip_angle* (rad), are left out.
        """
        if roughness is None:
            roughness = min(ROUGHNESS, 0.02 * self.radius)
        if not roughness >= 0.0:
            raise InputError(f"roughness is {roughness}; expected zero or a length in m")
        poses = rest.stable_poses(self.vertices, self.com, roughness)
        return tuple(p for p in poses if p.probability >= min_probability and p.tip_angle >= min_tip_angle)

    # copies and files

    def with_(self, **changes: object) -> Body:
        """A copy with other *friction*, *torsional_friction*, *name*, or *mass* (which scales the inertia)."""
        from dataclasses import replace

        allowed = ("friction", "torsional_friction", "name", "mass")
        for key, value in changes.items():
            if key not in allowed:
                raise InputError(f"a body has no changeable {key!r}; expected one of {', '.join(allowed)}")
            if "friction" in key and not (_is_number(value) and value >= 0.0):  # type: ignore[operator]
                raise InputError(f"{self.name}: {key} is {value!r}; expected a finite number, zero or more")
        if "mass" in changes:
            kilograms, _, mass_source = _mass_arguments(changes["mass"], None, self.name)  # type: ignore[arg-type]
            changes.update(mass=kilograms, inertia=self.inertia * (kilograms / self.mass), mass_source=mass_source)
        return replace(self, **changes)  # type: ignore[arg-type]

    def weighed(self, com: ArrayLike, inertia: ArrayLike | None = None) -> Body:
        """A copy with a measured centre of mass *com* ``(3,)`` and *inertia* ``(3, 3)`` about it (None: as it is)."""
        from dataclasses import replace

        centre = as_shaped(com, f"{self.name}: com", 3)
        if not _within_hull(self.vertices, centre):
            raise InputError(f"{self.name}: com is {centre.tolist()}, outside the convex hull of the body")
        tensor = self.inertia if inertia is None else as_shaped(inertia, f"{self.name}: inertia", 3, 3)
        check_inertia(tensor, f"{self.name}: inertia")
        return replace(self, com=centre, inertia=0.5 * (tensor + tensor.T))

    def save(self, path: str | Path) -> Path:
        """Write the mesh in metres (one of `FORMATS`), under a temporary name first."""
        from . import files

        return files.write_mesh(path, self.vertices, self.faces)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and math.isfinite(value)


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (_is_number(value) and value > 0.0):
            raise InputError(f"{name} is {value!r}; expected a positive length in m")


def _mass_arguments(mass: float | None, density: float | None, where: str) -> tuple[float, float | None, str]:
    """Mass, or 0 and the density to compute it from, and which it was."""
    if mass is not None and density is not None:
        raise InputError(f"{where}: mass {mass} and density {density} are both given; give one")
    for label, value, unit in (("mass", mass, "kg"), ("density", density, "kg/m³")):
        if value is not None and not (_is_number(value) and value > 0.0):
            raise InputError(f"{where}: {label} is {value!r} {unit}; expected a positive, finite number")
    if mass is not None:
        return float(mass), None, "given"
    return 0.0, float(density or ASSUMED_DENSITY), "density" if density is not None else "assumed"


def _enclosed(mesh: Mended, where: str) -> tuple[Solid, Mended, bool]:
    """The region that the mesh encloses, the mesh, and whether its own surface is that region's.

    For an open mesh, or one that winds about itself, it is the union of its convex pieces, and a note says so.
    """
    if mesh.closed:
        region = solid(mesh.vertices, mesh.faces)
        from scipy.spatial import ConvexHull

        hull = float(ConvexHull(mesh.vertices).volume)
        sound = 1e-6 * hull < region.volume <= hull * (1.0 + 1e-6)
        if sound and np.linalg.eigvalsh(region.moments)[0] > 0.0:
            return region, mesh, True
        trouble = f"closed surface encloses {region.volume * 1e6:.3g} cm³ of a hull of {hull * 1e6:.3g} cm³"
    elif len(mesh.faces):
        trouble = "surface is still open"
    else:
        raise MeshError(f"{where} has no face left once collapsed and doubled ones are dropped: re-export the mesh")
    parts = decompose(mesh.vertices, mesh.faces, False)
    whole = union(list(parts.pieces)) if parts.pieces else None
    if whole is None or not len(whole[1]) or (region := solid(*whole)).volume <= 0.0:
        raise MeshError(
            f"{where} does not enclose a volume ({trouble}) and could not be repaired: "
            f"{'; '.join(mesh.repairs) or 'no repair applied'}. Close it in a mesh tool, or give the sheet a thickness"
        )
    note = f"the {trouble}: mass properties are those of {len(parts.pieces)} convex pieces that cover it"
    return region, mesh.then(mesh.vertices, mesh.faces, note), False


def _within_hull(vertices: Array, point: Array) -> bool:
    from scipy.spatial import ConvexHull

    equations = ConvexHull(vertices).equations
    return bool((equations[:, :3] @ point + equations[:, 3] <= 1e-9 * np.ptp(vertices)).all())
