"""Mass properties of a closed triangle mesh, exactly: integrals over signed tetrahedra.

For the tetrahedron with one corner at the origin and the others at a, b, c, and with d = det[a b c],

    ∫ dV = d / 6,   ∫ x dV = d / 24 · (a + b + c),   ∫ x xᵀ dV = d / 120 · (a aᵀ + b bᵀ + c cᵀ + s sᵀ),   s = a + b + c,

and the sum over all faces is exact for every closed, consistently wound mesh, whatever its shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError


@dataclass(frozen=True, eq=False)
class Solid:
    """Volume in m³, centroid, and second moments ∫ (x−c)(x−c)ᵀ dV about the centroid in m⁵."""

    volume: float
    centroid: Array  # (3,)
    moments: Array  # (3, 3)

    @property
    def inertia(self) -> Array:
        """Inertia about the centroid for unit density: tr(M) 1 − M, in m⁵."""
        return np.asarray(np.trace(self.moments) * np.eye(3) - self.moments)


def solid(vertices: Array, faces: IntArray) -> Solid:
    """Volume, centroid and second moments of the region that ``vertices (V, 3)``, ``faces (F, 3)`` enclose.

    The mesh must be closed; a mesh that is wound inwards has a negative volume.
    """
    origin = vertices[faces].mean(axis=(0, 1))
    corners = vertices[faces] - origin
    d = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    s = corners.sum(axis=1)
    volume = float(d.sum()) / 6.0
    if volume == 0.0:
        return Solid(0.0, origin, np.zeros((3, 3)))
    first = d @ s / 24.0
    second = (np.einsum("f,fki,fkj->ij", d, corners, corners) + np.einsum("f,fi,fj->ij", d, s, s)) / 120.0
    shift = first / volume
    return Solid(volume, origin + shift, second - volume * np.outer(shift, shift))


def check_inertia(inertia: Array, where: str) -> None:
    """Raise `InputError` unless *inertia* ``(3, 3)`` belongs to a rigid body.

    It must be symmetric, positive definite, and its principal moments must obey I₁ + I₂ ≥ I₃: each is a sum of two
    of the three non-negative second moments of mass.
    """
    if not np.allclose(inertia, inertia.T, rtol=0.0, atol=1e-9 * float(np.abs(inertia).max())):
        raise InputError(f"{where} is not symmetric: the products of inertia above and below the diagonal differ")
    principal = np.linalg.eigvalsh(inertia)
    if principal[0] <= 0.0:
        raise InputError(f"{where} has principal moments {principal}; all must be positive")
    if principal[0] + principal[1] < principal[2] * (1.0 - 1e-9):
        raise InputError(
            f"{where} has principal moments {principal}, which no rigid body has: the two smaller ones must add up to "
            "at least the largest"
        )
