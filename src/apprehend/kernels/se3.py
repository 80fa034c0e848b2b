"""Rigid motions: exponential and logarithm, exact to the last digits at every angle and size of translation.

Twists are rows of six (v, w), poses rows of sixteen (row-major, last row 0 0 0 1).
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .so3 import exp_one, inverse_left_jacobian_one, left_jacobian_one, log_one, norm3, sinc_coefficients


@kernel(fast=False)
def exp_many(twists, out):
    """``exp(v, w) = (exp ŵ, V v)`` for twists ``(N, 6)``, into poses ``(N, 16)``."""
    R = np.empty(9)
    V = np.empty(9)
    for i in range(twists.shape[0]):
        vx, vy, vz = twists[i, 0], twists[i, 1], twists[i, 2]
        x, y, z = twists[i, 3], twists[i, 4], twists[i, 5]
        exp_one(x, y, z, R)
        left_jacobian_one(x, y, z, V)
        for k in range(3):
            for j in range(3):
                out[i, 4 * k + j] = R[3 * k + j]
            out[i, 4 * k + 3] = V[3 * k] * vx + V[3 * k + 1] * vy + V[3 * k + 2] * vz
            out[i, 12 + k] = 0.0
        out[i, 15] = 1.0


@kernel(fast=False)
def log_many(poses, out):
    """Twists ``(N, 6)`` with rotation vectors of length ≤ π whose exponentials are the poses ``(N, 16)``."""
    R = np.empty(9)
    W = np.empty(9)
    for i in range(poses.shape[0]):
        for k in range(3):
            for j in range(3):
                R[3 * k + j] = poses[i, 4 * k + j]
        x, y, z = log_one(R)
        inverse_left_jacobian_one(x, y, z, W)
        px, py, pz = poses[i, 3], poses[i, 7], poses[i, 11]
        for k in range(3):
            out[i, k] = W[3 * k] * px + W[3 * k + 1] * py + W[3 * k + 2] * pz
        out[i, 3] = x
        out[i, 4] = y
        out[i, 5] = z


@kernel(fast=False)
def _cross_matrix(x, y, z, out):
    out[0, 0] = 0.0
    out[0, 1] = -z
    out[0, 2] = y
    out[1, 0] = z
    out[1, 1] = 0.0
    out[1, 2] = -x
    out[2, 0] = -y
    out[2, 1] = x
    out[2, 2] = 0.0


@kernel(fast=False)
def _product(A, B, out):
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@kernel(fast=False)
def left_jacobians(twists, out):
    """Left Jacobians of SE(3), ``out (N, 36)``: ``[[V, Q], [0, V]]`` for twists (v, w) (Barfoot, State Estimation, 7.86).

    Q = v̂/2 + c (ŵv̂ + v̂ŵ + ŵv̂ŵ) + e (ŵŵv̂ + v̂ŵŵ − 3 ŵv̂ŵ) + f (ŵv̂ŵŵ + ŵŵv̂ŵ)
    """
    V = np.empty(9)
    w = np.empty((3, 3))
    v = np.empty((3, 3))
    wv = np.empty((3, 3))
    vw = np.empty((3, 3))
    wvw = np.empty((3, 3))
    wwv = np.empty((3, 3))
    vww = np.empty((3, 3))
    wvww = np.empty((3, 3))
    wwvw = np.empty((3, 3))
    for i in range(twists.shape[0]):
        x, y, z = twists[i, 3], twists[i, 4], twists[i, 5]
        angle = norm3(x, y, z)
        left_jacobian_one(x, y, z, V)
        _, _, c = sinc_coefficients(angle)
        s = angle * angle
        if angle < 0.5:
            # (θ² + 2 cos θ − 2) / (2 θ⁴) and (2 θ − 3 sin θ + θ cos θ) / (2 θ⁵)
            e = (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0 * (1.0 - s / 132.0 * (1.0 - s / 182.0))))) / 24.0
            f = 1.0 / 120.0 - s * (1.0 / 2520.0 - s * (1.0 / 120960.0 - s * (1.0 / 9979200.0 - s / 1245404160.0)))
        else:
            e = (s + 2.0 * math.cos(angle) - 2.0) / (2.0 * s * s)
            f = (2.0 * angle - 3.0 * math.sin(angle) + angle * math.cos(angle)) / (2.0 * s * s * angle)
        _cross_matrix(x, y, z, w)
        _cross_matrix(twists[i, 0], twists[i, 1], twists[i, 2], v)
        _product(w, v, wv)
        _product(v, w, vw)
        _product(wv, w, wvw)
        _product(w, wv, wwv)
        _product(vw, w, vww)
        _product(wvw, w, wvww)
        _product(w, wvw, wwvw)
        for a in range(3):
            for b in range(3):
                q = 0.5 * v[a, b] + c * (wv[a, b] + vw[a, b] + wvw[a, b])
                q += e * (wwv[a, b] + vww[a, b] - 3.0 * wvw[a, b]) + f * (wvww[a, b] + wwvw[a, b])
                out[i, 6 * a + b] = V[3 * a + b]
                out[i, 6 * a + 3 + b] = q
                out[i, 6 * (a + 3) + b] = 0.0
                out[i, 6 * (a + 3) + 3 + b] = V[3 * a + b]
