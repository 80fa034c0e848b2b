"""A flat patch of contact: pressure may be spread over it in any way."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_own, choice
from ..errors import InputError
from .contact import Contact, ContactModel

if TYPE_CHECKING:
    from ..bodies import Body

FLATNESS = 0.02
"""Corners may lie this share of a patch's extent off its plane."""


@dataclass(frozen=True, eq=False)
class Patch:
    """Contact over a convex flat area with *corners* ``(V, 3)`` in m, in the plane the two ends ``(2, 2)``.

    *normal* points inwards and *friction* is µ, as in `Contact`. The wrenches that a rigid patch passes on under any
    pressure are exactly those of Coulomb contacts at its corners: pressure at a point inside is a mean of pressures at
    corners, and so is its wrench. A `Grasp` takes patches among its contacts; with the L∞ norm the normal force of a
    whole patch is bounded. `soft` is the patch under one given pressure, as a soft finger.
    Raises `InputError` for corners that do not lie in the plane of the normal.
    """

    corners: Array
    normal: Array
    friction: float = 0.6

    def __post_init__(self) -> None:
        corners = as_own(self.corners, "patch corners")
        if corners.ndim != 2 or corners.shape[1] not in (2, 3) or len(corners) < corners.shape[1]:
            raise InputError(
                f"patch corners have shape {corners.shape}; expected (V, 3) with three or more, in the plane (2, 2)"
            )
        first = Contact(corners[0], self.normal, self.friction)
        height = (corners - corners.mean(axis=0)) @ first.normal
        extent = float(np.ptp(corners, axis=0).max())
        if extent == 0.0:
            raise InputError("patch corners coincide; use a Contact for a point")
        worst = int(np.argmax(np.abs(height)))
        if abs(height[worst]) > FLATNESS * extent:
            raise InputError(
                f"patch corner {worst} lies {1e3 * height[worst]:.3g} mm off the plane of the normal (allowed "
                f"{1e3 * FLATNESS * extent:.3g} mm); split the patch, or give the normal of its plane"
            )
        if corners.shape[1] == 3:
            corners = _outline(corners, first.rotation)
        object.__setattr__(self, "corners", corners)
        object.__setattr__(self, "normal", first.normal)

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """Coulomb contacts at the corners, which pass on the same wrenches as the patch."""
        return tuple(Contact(corner, self.normal, self.friction) for corner in self.corners)

    @cached_property
    def _triangles(self) -> tuple[Array, Array]:
        """Triangles ``(V, 3, 3)`` around the mean of the corners, and their areas."""
        middle = np.broadcast_to(self.corners.mean(axis=0), self.corners.shape)
        fan = np.stack([middle, self.corners, np.roll(self.corners, -1, axis=0)], axis=1)
        return fan, 0.5 * np.linalg.norm(np.cross(fan[:, 1] - fan[:, 0], fan[:, 2] - fan[:, 0]), axis=-1)

    @property
    def area(self) -> float:
        """Area in m², in the plane the length in m."""
        if self.corners.shape[1] == 2:
            return float(np.linalg.norm(self.corners[1] - self.corners[0]))
        return float(self._triangles[1].sum())

    @property
    def centroid(self) -> Array:
        """Middle of the area."""
        if self.corners.shape[1] == 2:
            return np.asarray(self.corners.mean(axis=0))
        fan, areas = self._triangles
        return np.asarray(areas @ fan.mean(axis=1) / areas.sum())

    def soft(self, pressure: str = "even", model: ContactModel | str = ContactModel.SOFT) -> Contact:
        """The soft finger at the centroid that stands for the patch under an *even* or a *hertz* pressure.

        When all of it slips by turning, friction yields the moment ``µ ∫ p r dA``: even pressure gives µ times the mean
        distance from the centroid (2/3 µ a on a disc of radius a); Hertz's ``p ∝ √(1 − r²/a²)``, taken on the disc of
        the same area, 3π/16 µ a.
        """
        choice(pressure, "pressure", ("even", "hertz"))
        if self.corners.shape[1] == 2:
            raise InputError("a patch in the plane has no moment about its normal; use the patch itself")
        middle = self.centroid
        if pressure == "hertz":
            arm = 3.0 * np.pi / 16.0 * float(np.sqrt(self.area / np.pi))
        else:
            fan, areas = self._triangles
            grid = (np.arange(32) + 0.5) / 32.0
            s, t = (a.ravel() for a in np.meshgrid(grid, grid))
            weights = np.stack([1.0 - np.sqrt(s), np.sqrt(s) * (1.0 - t), np.sqrt(s) * t], axis=1)  # even over area
            points = np.einsum("gc,vcx->vgx", weights, fan)
            arm = float(areas @ np.linalg.norm(points - middle, axis=-1).mean(axis=1) / areas.sum())
        return Contact(middle, self.normal, self.friction, ContactModel(model), self.friction * arm)

    @classmethod
    def on_surface(
        cls, body: Body, point: ArrayLike, radius: float, *, friction: float | None = None, depth: float = 1e-3
    ) -> Patch:
        """The patch that a flat pad of *radius* touches at the place of the body's surface nearest to *point* ``(3,)``.

        The pad lies on the plane of that face; what is less than *depth* behind the plane counts as touched.
        """
        from .surface import Surface

        if not (np.isfinite(radius) and radius > 0.0 and np.isfinite(depth) and depth > 0.0):
            raise InputError(f"radius is {radius} and depth {depth}; expected positive lengths in m")
        surface = Surface(body.vertices, body.faces)
        near, _, faces = surface.nearest(as_array(point, "point").reshape(1, 3))
        mu = body.friction if friction is None else friction
        frame = Contact(near[0], -surface.normals[faces[0]], mu)
        rings, turn = np.linspace(0.1, 1.0, 10), 2.0 * np.pi * np.arange(24) / 24
        x, y = (radius * np.outer(rings, f(turn)).ravel() for f in (np.cos, np.sin))
        R = frame.rotation
        start = near[0] + np.outer(x, R[:, 0]) + np.outer(y, R[:, 1]) - radius * R[:, 2]
        first = surface.crossings(start, R[:, 2], 0.0, 2.0 * radius).times[:, 0] - radius
        touched = np.abs(first) <= depth
        if touched.sum() < 3:
            raise InputError(
                f"the surface near {near[0].tolist()} bends away within {radius:g} m by more than {depth:g} m: "
                "no patch touches; use a Contact, or a smaller radius"
            )
        return cls(start[touched] + radius * R[:, 2], R[:, 2], mu)


def _outline(points: Array, rotation: Array) -> Array:
    """The corners of the convex hull of flat points, in order around the normal."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        order = ConvexHull(points @ rotation[:, :2]).vertices
    except QhullError:
        raise InputError("patch corners lie on one line; a patch needs an area") from None
    return np.ascontiguousarray(points[order])
