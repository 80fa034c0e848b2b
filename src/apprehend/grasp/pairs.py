"""Antipodal pairs of surface points: both contact normals within the friction cone around their connecting line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..bodies import Body
from .surface import Surface


@dataclass(frozen=True, eq=False)
class Pairs:
    """``first, second (N, 3)`` points, ``axis (N, 3)`` the unit vector from first to second, ``width (N,)``,
    ``margin (N,)`` the smaller cone margin of both ends in rad."""

    first: Array
    second: Array
    axis: Array
    width: Array
    margin: Array

    def __len__(self) -> int:
        return len(self.width)

    def take(self, index: NDArray[np.integer[Any]]) -> Pairs:
        """The pairs at *index*."""
        return Pairs(self.first[index], self.second[index], self.axis[index], self.width[index], self.margin[index])


def antipodal(surface: Surface, body: Body, samples: int, friction: float, rng: np.random.Generator) -> Pairs:
    """Pairs found from *samples* points spread over the area (G 2.6: antipodal soft fingers are force-closure).

    From each point one ray runs along the inward normal and one in a random direction of the friction cone; every
    place where a ray leaves the material is a partner if the ray is inside its friction cone too. A ray may pass
    through hollows: the jaw closes on what is outside.
    """
    points, inward, _ = body.sample_surface(samples, rng)
    alpha = np.arctan(friction)
    cosine = 1.0 - rng.random(samples) * (1.0 - np.cos(alpha))
    turn = rng.random(samples) * 2.0 * np.pi
    e1, e2 = _square_to(inward)
    sine = np.sqrt(1.0 - cosine**2)[:, None]
    slanted = cosine[:, None] * inward + sine * (np.cos(turn)[:, None] * e1 + np.sin(turn)[:, None] * e2)
    origins, directions = np.concatenate([points, points]), np.concatenate([inward, slanted])
    normals = np.concatenate([inward, inward])
    skin = 1e-6 * float(np.max(body.extents))
    hits = surface.crossings(origins, directions, low=skin)
    ray, slot = np.nonzero((hits.faces >= 0) & ~hits.entering)
    d, t = directions[ray], hits.times[ray, slot]
    outward = surface.normals[hits.faces[ray, slot]]
    cos_here = np.einsum("ij,ij->i", normals[ray], d)
    cos_there = np.einsum("ij,ij->i", outward, d)
    margin = alpha - np.arccos(np.clip(np.minimum(cos_here, cos_there), -1.0, 1.0))
    good = np.nonzero(margin > 0.0)[0]
    first = origins[ray[good]]
    return Pairs(first, first + t[good, None] * d[good], d[good], t[good], margin[good])


def _square_to(v: Array) -> tuple[Array, Array]:
    """Two unit vectors square to each of the unit vectors ``v (N, 3)``."""
    helper = np.eye(3)[np.argmin(np.abs(v), axis=1)]
    e1 = np.cross(helper, v)
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    return e1, np.cross(v, e1)
