"""Rotations: exponential, logarithm and quaternions, exact to the last digits at every angle.

Strict IEEE order (``fast=False``): what is exact here rests on the order of operations. Matrices are rows of nine
(row-major), vectors of three, quaternions of four (w, x, y, z).
"""

from __future__ import annotations

import math

from ._jit import kernel


@kernel(inline=True, fast=False)
def norm3(x, y, z):
    """Length of a vector, without overflow or underflow of the squares."""
    return math.hypot(math.hypot(x, y), z)


@kernel(fast=False)
def sinc_coefficients(angle):
    """sin θ / θ, (1 − cos θ) / θ² and (θ − sin θ) / θ³ for θ ≥ 0; series below 0.25, where the last would cancel."""
    if angle < 0.25:
        z = angle * angle
        a = 1.0 - z / 6.0 * (1.0 - z / 20.0 * (1.0 - z / 42.0 * (1.0 - z / 72.0 * (1.0 - z / 110.0))))
        b = 0.5 * (1.0 - z / 12.0 * (1.0 - z / 30.0 * (1.0 - z / 56.0 * (1.0 - z / 90.0 * (1.0 - z / 132.0)))))
        c = (1.0 - z / 20.0 * (1.0 - z / 42.0 * (1.0 - z / 72.0 * (1.0 - z / 110.0 * (1.0 - z / 156.0))))) / 6.0
        return a, b, c
    s = math.sin(angle)
    half = math.sin(0.5 * angle) / (0.5 * angle)
    return s / angle, 0.5 * half * half, (angle - s) / (angle * angle * angle)


@kernel(fast=False)
def exp_one(x, y, z, R):
    """Rodrigues: ``R = 1 + a ŵ + b ŵ²`` for the rotation vector (x, y, z)."""
    a, b, _ = sinc_coefficients(norm3(x, y, z))
    R[0] = 1.0 - b * (y * y + z * z)
    R[1] = b * x * y - a * z
    R[2] = b * x * z + a * y
    R[3] = b * x * y + a * z
    R[4] = 1.0 - b * (x * x + z * z)
    R[5] = b * y * z - a * x
    R[6] = b * x * z - a * y
    R[7] = b * y * z + a * x
    R[8] = 1.0 - b * (x * x + y * y)


@kernel(fast=False)
def quaternion_one(R):
    """Unit quaternion with w ≥ 0 of the matrix R, read from its largest component (Shepperd), so never by cancellation."""
    trace = R[0] + R[4] + R[8]
    if trace >= R[0] and trace >= R[4] and trace >= R[8]:
        w, x, y, z = 1.0 + trace, R[7] - R[5], R[2] - R[6], R[3] - R[1]
    elif R[0] >= R[4] and R[0] >= R[8]:
        w, x, y, z = R[7] - R[5], 1.0 + R[0] - R[4] - R[8], R[1] + R[3], R[2] + R[6]
    elif R[4] >= R[8]:
        w, x, y, z = R[2] - R[6], R[1] + R[3], 1.0 + R[4] - R[0] - R[8], R[5] + R[7]
    else:
        w, x, y, z = R[3] - R[1], R[2] + R[6], R[5] + R[7], 1.0 + R[8] - R[0] - R[4]
    negative = w < 0.0 or (w == 0.0 and (x < 0.0 or (x == 0.0 and (y < 0.0 or (y == 0.0 and z < 0.0)))))
    length = math.hypot(w, norm3(x, y, z))
    f = -1.0 / length if negative else 1.0 / length
    return w * f, x * f, y * f, z * f


@kernel(fast=False)
def log_one(R):
    """Rotation vector of length ≤ π; at a half turn the first component of the axis that is not zero is positive."""
    w, x, y, z = quaternion_one(R)
    s = norm3(x, y, z)
    if s == 0.0:
        return 0.0, 0.0, 0.0
    f = 2.0 * math.atan2(s, w) / s
    return x * f, y * f, z * f


@kernel(fast=False)
def matrix_one(w, x, y, z, R):
    """Matrix of a unit quaternion."""
    R[0] = 1.0 - 2.0 * (y * y + z * z)
    R[1] = 2.0 * (x * y - w * z)
    R[2] = 2.0 * (x * z + w * y)
    R[3] = 2.0 * (x * y + w * z)
    R[4] = 1.0 - 2.0 * (x * x + z * z)
    R[5] = 2.0 * (y * z - w * x)
    R[6] = 2.0 * (x * z - w * y)
    R[7] = 2.0 * (y * z + w * x)
    R[8] = 1.0 - 2.0 * (x * x + y * y)


@kernel(fast=False)
def exp_many(vectors, out):
    """Rotation vectors ``(N, 3)`` to matrices ``(N, 9)``."""
    for i in range(vectors.shape[0]):
        exp_one(vectors[i, 0], vectors[i, 1], vectors[i, 2], out[i])


@kernel(fast=False)
def log_many(matrices, out):
    """Matrices ``(N, 9)`` to rotation vectors ``(N, 3)``."""
    for i in range(matrices.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = log_one(matrices[i])


@kernel(fast=False)
def quaternions(matrices, out):
    """Matrices ``(N, 9)`` to unit quaternions ``(N, 4)`` with w ≥ 0."""
    for i in range(matrices.shape[0]):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = quaternion_one(matrices[i])


@kernel(fast=False)
def matrices(quaternion, out):
    """Quaternions ``(N, 4)`` of any length but zero to matrices ``(N, 9)``."""
    for i in range(quaternion.shape[0]):
        w, x, y, z = quaternion[i, 0], quaternion[i, 1], quaternion[i, 2], quaternion[i, 3]
        f = 1.0 / math.hypot(w, norm3(x, y, z))
        matrix_one(w * f, x * f, y * f, z * f, out[i])


@kernel(fast=False)
def left_jacobian_one(x, y, z, out):
    """``V = 1 + b ŵ + c ŵ²``: the rate of exp, and what turns v into the translation of exp(v, w)."""
    _, b, c = sinc_coefficients(norm3(x, y, z))
    out[0] = 1.0 - c * (y * y + z * z)
    out[1] = c * x * y - b * z
    out[2] = c * x * z + b * y
    out[3] = c * x * y + b * z
    out[4] = 1.0 - c * (x * x + z * z)
    out[5] = c * y * z - b * x
    out[6] = c * x * z - b * y
    out[7] = c * y * z + b * x
    out[8] = 1.0 - c * (x * x + y * y)


@kernel(fast=False)
def inverse_coefficient(angle):
    """(1 − (θ/2) cot(θ/2)) / θ² for 0 ≤ θ < 2 π."""
    if angle < 0.25:
        z = angle * angle
        return (1.0 + z / 60.0 * (1.0 + z / 42.0 * (1.0 + z / 40.0 * (1.0 + z / 39.6)))) / 12.0
    half = 0.5 * angle
    return (1.0 - half * math.cos(half) / math.sin(half)) / (angle * angle)


@kernel(fast=False)
def inverse_left_jacobian_one(x, y, z, out):
    """``V⁻¹ = 1 − ŵ / 2 + d ŵ²``, for |w| < 2 π."""
    d = inverse_coefficient(norm3(x, y, z))
    out[0] = 1.0 - d * (y * y + z * z)
    out[1] = d * x * y + 0.5 * z
    out[2] = d * x * z - 0.5 * y
    out[3] = d * x * y - 0.5 * z
    out[4] = 1.0 - d * (x * x + z * z)
    out[5] = d * y * z + 0.5 * x
    out[6] = d * x * z + 0.5 * y
    out[7] = d * y * z - 0.5 * x
    out[8] = 1.0 - d * (x * x + y * y)


@kernel(fast=False)
def left_jacobians(vectors, inverse, out):
    """Left Jacobians of SO(3), or their inverses, ``(N, 9)``, at rotation vectors ``(N, 3)``."""
    for i in range(vectors.shape[0]):
        x, y, z = vectors[i, 0], vectors[i, 1], vectors[i, 2]
        if inverse:
            inverse_left_jacobian_one(x, y, z, out[i])
        else:
            left_jacobian_one(x, y, z, out[i])
