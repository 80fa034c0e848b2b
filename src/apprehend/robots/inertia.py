"""Physical consistency of masses and inertias: what a rigid body can have, and the nearest such value.

With the principal moments A, B, C of a body about its centre of mass, A, B, C ≥ 0 and A + B ≥ C for every order:
equivalently, the second moments Σ = ½ tr(I) 1 − I = ∫ r rᵀ dm form a positive semi-definite matrix.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from .description import Inertial

TOLERANCE = 1e-6
"""Violation of A + B ≥ C, relative to the largest moment, that counts as rounding of printed digits."""

ROUNDING = 1e-14
"""Moments below this, in kg m², are zero."""


def second_moments(inertia: Array) -> Array:
    """Σ = ½ tr(I) 1 − I of an inertia ``(3, 3)``."""
    sigma: Array = 0.5 * float(np.trace(inertia)) * np.eye(3) - inertia
    return sigma


def check(inertial: Inertial) -> str:
    """What is impossible about a mass and its inertia, in words; empty if nothing is."""
    moments = np.linalg.eigvalsh(inertial.inertia)
    scale = float(np.abs(moments).max())
    slack = TOLERANCE * scale + ROUNDING
    if moments[0] < -slack:
        return f"the inertia has a negative principal moment, {moments[0]:.4g} kg m²"
    if moments[0] + moments[1] < moments[2] - slack:
        a, b, c = moments
        return f"impossible inertia: principal moments {a:.4g} + {b:.4g} < {c:.4g} kg m² violate A + B ≥ C"
    if inertial.mass == 0.0 and scale > 0.0:
        return f"an inertia of up to {scale:.3g} kg m² with zero mass"
    return ""


def nearest(inertial: Inertial) -> Inertial:
    """The physically consistent inertial nearest in second moments: negative eigenvalues of Σ are raised to zero.

    The principal axes stay. A body without mass has no inertia.
    """
    if inertial.mass == 0.0:
        return Inertial(0.0, inertial.com, np.zeros((3, 3)))
    values, axes = np.linalg.eigh(second_moments(inertial.inertia))
    values = np.maximum(values, 0.0)
    sigma = (axes * values) @ axes.T
    return Inertial(inertial.mass, inertial.com, float(values.sum()) * np.eye(3) - sigma)


def solid_sphere(mass: float, density: float = 1000.0) -> Array:
    """Inertia ``(3, 3)`` of a homogeneous solid sphere of that *mass* and *density* (kg/m³)."""
    radius = (3.0 * mass / (4.0 * np.pi * density)) ** (1.0 / 3.0)
    sphere: Array = np.eye(3) * (0.4 * mass * radius**2)
    return sphere
