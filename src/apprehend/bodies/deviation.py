"""How much a simplified model differs from its body: bounds that hold, found by branch and bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from .convex import point_triangle_squared
from .index import MeshIndex

MOST = 300_000
"""Evaluations after which a bound is left as loose as it is."""

FINE = 0.005
"""Where a bound is taken as tight enough, as a share of the largest extent; 3 % of itself will do, too."""

Distance = Callable[[Array], Array]
"""Distances ``(N,)`` of points ``(N, 3)``."""


@dataclass(frozen=True)
class Deviation:
    """What is lost between a body and a model of it; lengths in m, volumes in m³. Bounds hold, they are not estimates.

    ``outward`` and ``inward`` are the two one-sided Hausdorff distances; their maximum is the Hausdorff distance.
    Solid models are compared with the solid body, its holes closed by fans (`MeshIndex.fans`); surfaces and lines with
    the surface.
    """

    outward: float
    """No point of the model is farther from the body than this."""
    inward: float
    """No point of the body is farther from the model than this; 0 where the model encloses the body."""
    encloses: bool
    """Whether the model contains the whole body, by construction."""
    volume: float
    """Volume of the model; 0 for lines and open surfaces."""
    body_volume: float
    """Volume of what the surface of the body encloses, holes closed by fans."""

    @property
    def hausdorff(self) -> float:
        """The larger of `outward` and `inward`."""
        return max(self.outward, self.inward)

    @property
    def volume_excess(self) -> float:
        """Volume of the model over that of the body, less one (inf where the body has none)."""
        return self.volume / self.body_volume - 1.0 if self.body_volume > 0.0 else float("inf")

    def __str__(self) -> str:
        how = "encloses it, " if self.encloses else f"misses at most {1e3 * self.inward:.2f} mm of it, "
        text = f"{how}sticks out by at most {1e3 * self.outward:.2f} mm"
        if self.volume and self.body_volume:
            text += f", volume {self.volume_excess:+.0%}"
        return text


def farthest_of_solid(model: Distance, low: Array, high: Array, body: Distance) -> tuple[float, float]:
    """Lower and upper bound of the largest distance between a point of a solid model and the body.

    *model* and *body* are signed distances, negative inside, that change no faster than one moves. Cubes of the box
    *low*, *high* that may hold a point of the model are divided as long as they may hold one that is farther away
    than any found: max over a cube ≤ distance at its centre + half its diagonal.
    """
    extent = float((high - low).max())
    half = extent / 16.0
    axes = [np.arange(lo + half, hi + half, 2.0 * half) for lo, hi in zip(low, high)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    step = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    lower, spent = 0.0, 0
    while True:
        reach = np.sqrt(3.0) * half
        inside = model(centres)
        centres, inside = centres[inside <= reach], inside[inside <= reach]
        away = body(centres)
        spent += len(centres)
        lower = max(lower, float(away[inside <= 0.0].max(initial=0.0)))
        enough = max(1.03 * lower, lower + FINE * extent)
        open_ = away + reach > enough
        upper = float((away + reach)[open_].max(initial=enough))
        centres = centres[open_]
        if not len(centres) or spent + 4 * len(centres) > MOST:
            return lower, upper
        centres = (centres[:, None] + half * step).reshape(-1, 3)
        half *= 0.5


def farthest_of_surface(triangles: Array, other: Distance, bound: Distance) -> tuple[float, float]:
    """Lower and upper bound of the largest value of *other* (≥ 0, changes no faster than one moves) on a surface.

    *bound* says of triangles ``(N, 3, 3)`` what *other* does not exceed on them. Triangles ``(F, 3, 3)`` are halved
    across their longest edge as long as they may hold a larger value than any found.
    """
    if not len(triangles):
        return 0.0, 0.0
    extent = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    lower, spent = float(other(triangles.reshape(-1, 3)).max()), 3 * len(triangles)
    while True:
        centre = triangles.mean(axis=1)
        reach = np.linalg.norm(triangles - centre[:, None], axis=2).max(axis=1)
        away = other(centre)
        spent += len(centre)
        lower = max(lower, float(away.max(initial=0.0)))
        most = np.minimum(away + reach, bound(triangles))
        open_ = most > 1.01 * lower + 0.1 * FINE * extent
        upper = float(most[open_].max(initial=1.01 * lower + 0.1 * FINE * extent))
        triangles = triangles[open_]
        if not len(triangles) or spent + 2 * len(triangles) > MOST:
            return lower, upper
        rows = np.arange(len(triangles))
        edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        k = np.argmax(edges, axis=1)
        a, b, c = (triangles[rows, (k + i) % 3] for i in range(3))
        middle = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def farthest_from_mesh(triangles: Array, mesh: MeshIndex) -> float:
    """Upper bound of the largest distance between a point of the *triangles* and the surface of *mesh*.

    On a triangle the distance is at most that from one face of the mesh, which is largest at a corner: it is convex.
    """
    corners = mesh.vertices[mesh.faces]

    def bound(some: Array) -> Array:
        face = corners[mesh.nearest(some.mean(axis=1)).faces]
        return np.asarray(np.sqrt(point_triangle_squared(some, face[:, None]).max(axis=1)))

    return farthest_of_surface(triangles, lambda p: mesh.nearest(p).distance, bound)[1]


def farthest_outside(triangles: Array, solid: MeshIndex) -> float:
    """Upper bound of the largest distance between a point of the *triangles* and a *solid*; 0 within it."""
    return farthest_of_surface(
        triangles,
        lambda p: np.maximum(solid.signed_distance(p), 0.0),
        lambda some: np.full(len(some), np.inf),
    )[1]
