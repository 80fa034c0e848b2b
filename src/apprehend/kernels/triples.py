"""Vectors in space as tuples of three numbers, which stay in registers."""

from __future__ import annotations

from ._jit import kernel
from .lanes import sincos


@kernel
def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def add(a, b):
    """Sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def sub(a, b):
    """Difference."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def row(M, i):
    """Row of a matrix with three columns."""
    return M[i, 0], M[i, 1], M[i, 2]


@kernel
def turn(h, angle, v):
    """Rodrigues: *v* turned about the unit vector *h*."""
    s, c = sincos(angle)
    return turn_by(h, s, c, v)


@kernel
def turn_by(h, s, c, v):
    """As `turn`, by an angle whose sine and cosine are known."""
    k = cross(h, v)
    f = (1.0 - c) * dot(h, v)
    return c * v[0] + s * k[0] + f * h[0], c * v[1] + s * k[1] + f * h[1], c * v[2] + s * k[2] + f * h[2]


@kernel
def apply(R, v):
    """R v for a matrix."""
    return (
        R[0, 0] * v[0] + R[0, 1] * v[1] + R[0, 2] * v[2],
        R[1, 0] * v[0] + R[1, 1] * v[1] + R[1, 2] * v[2],
        R[2, 0] * v[0] + R[2, 1] * v[1] + R[2, 2] * v[2],
    )


@kernel
def across(h):
    """A vector of length about one across *h*."""
    if abs(h[0]) < 0.6:
        return cross(h, (1.0, 0.0, 0.0))
    return cross(h, (0.0, 1.0, 0.0))
