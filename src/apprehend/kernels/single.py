"""Kernels on one configuration of a chain, without lanes: for calls in a loop, where 16 lanes would be paid for one.

Also for what is rarely asked in millions.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .chain import BODY, REVOLUTE, SPATIAL


@kernel
def chain_single(model, q, reference, out, jacobian):
    """Pose ``out (4, 4)`` and, unless it has no rows, ``jacobian (6, n)`` of one ``q (n,)``; 1 if q is not finite."""
    bad = 0
    for j in range(q.shape[0]):
        if not math.isfinite(q[j]):
            bad = 1
    axes = np.empty((model.kind.shape[0], 6))
    _walk(model, q, axes, out)
    if jacobian.shape[0]:
        _fill_jacobian(model, axes, reference, out, jacobian)
    return bad


@kernel
def _walk(model, q, axes, out):
    """Axes of the joints ``(m, 6)`` (point, direction) and pose ``out (4, 4)`` of the chain's end."""
    m = model.kind.shape[0]
    place = model.place
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    x = y = z = 0.0
    for i in range(m + 1):
        e00, e01, e02 = place[i, 0], place[i, 1], place[i, 2]
        e10, e11, e12 = place[i, 3], place[i, 4], place[i, 5]
        e20, e21, e22 = place[i, 6], place[i, 7], place[i, 8]
        ex, ey, ez = place[i, 9], place[i, 10], place[i, 11]
        x += r00 * ex + r01 * ey + r02 * ez
        y += r10 * ex + r11 * ey + r12 * ez
        z += r20 * ex + r21 * ey + r22 * ez
        a00 = r00 * e00 + r01 * e10 + r02 * e20
        a01 = r00 * e01 + r01 * e11 + r02 * e21
        r02 = r00 * e02 + r01 * e12 + r02 * e22
        a10 = r10 * e00 + r11 * e10 + r12 * e20
        a11 = r10 * e01 + r11 * e11 + r12 * e21
        r12 = r10 * e02 + r11 * e12 + r12 * e22
        a20 = r20 * e00 + r21 * e10 + r22 * e20
        a21 = r20 * e01 + r21 * e11 + r22 * e21
        r22 = r20 * e02 + r21 * e12 + r22 * e22
        s, c = 0.0, 1.0
        if i < m:
            value = model.gain[i, 0] * q[model.coordinate[i]] + model.gain[i, 1]
            if model.kind[i] == REVOLUTE:
                s = math.sin(value)
                c = math.cos(value)
            else:
                x += r02 * value
                y += r12 * value
                z += r22 * value
            axes[i, 0] = x
            axes[i, 1] = y
            axes[i, 2] = z
            axes[i, 3] = r02
            axes[i, 4] = r12
            axes[i, 5] = r22
        r00 = a00 * c + a01 * s
        r01 = a01 * c - a00 * s
        r10 = a10 * c + a11 * s
        r11 = a11 * c - a10 * s
        r20 = a20 * c + a21 * s
        r21 = a21 * c - a20 * s
    out[0, 0] = r00
    out[0, 1] = r01
    out[0, 2] = r02
    out[0, 3] = x
    out[1, 0] = r10
    out[1, 1] = r11
    out[1, 2] = r12
    out[1, 3] = y
    out[2, 0] = r20
    out[2, 1] = r21
    out[2, 2] = r22
    out[2, 3] = z
    out[3, 0] = 0.0
    out[3, 1] = 0.0
    out[3, 2] = 0.0
    out[3, 3] = 1.0


@kernel
def _fill_jacobian(model, axes, reference, pose, jacobian):
    """The Jacobian of one configuration from its joint axes."""
    jacobian[:] = 0.0
    x, y, z = pose[0, 3], pose[1, 3], pose[2, 3]
    if reference == SPATIAL:
        x, y, z = 0.0, 0.0, 0.0
    for i in range(axes.shape[0]):
        c = model.coordinate[i]
        gain = model.gain[i, 0]
        zx = gain * axes[i, 3]
        zy = gain * axes[i, 4]
        zz = gain * axes[i, 5]
        if model.kind[i] == REVOLUTE:
            dx = x - axes[i, 0]
            dy = y - axes[i, 1]
            dz = z - axes[i, 2]
            jacobian[0, c] += zy * dz - zz * dy
            jacobian[1, c] += zz * dx - zx * dz
            jacobian[2, c] += zx * dy - zy * dx
            jacobian[3, c] += zx
            jacobian[4, c] += zy
            jacobian[5, c] += zz
        else:
            jacobian[0, c] += zx
            jacobian[1, c] += zy
            jacobian[2, c] += zz
    if reference == BODY:
        for c in model.free:
            for h in (0, 3):
                vx, vy, vz = jacobian[h, c], jacobian[h + 1, c], jacobian[h + 2, c]
                for k in range(3):
                    jacobian[h + k, c] = pose[0, k] * vx + pose[1, k] * vy + pose[2, k] * vz


@kernel
def chain_rates(model, q, qd, jacobians, rates, poses):
    """Spatial Jacobians ``(N, 6, n)``, their time derivatives, and poses ``(N, 4, 4)``, of rows of q, q̇ ``(N, n)``.

    Column i of the spatial Jacobian is fixed to the body before joint i, so its rate is the bracket of that body's
    velocity with it: ``ξ̇ = V × ξ``.
    """
    axes = np.empty((model.kind.shape[0], 6))
    for row in range(q.shape[0]):
        _walk(model, q[row], axes, poses[row])
        _columns(model, axes, qd[row], jacobians[row], rates[row])


@kernel
def _columns(model, axes, qd, jacobian, rate):
    """Spatial Jacobian and its rate from the joint axes."""
    jacobian[:] = 0.0
    rate[:] = 0.0
    V = np.zeros(6)
    xi = np.zeros(6)
    for i in range(axes.shape[0]):
        px, py, pz, zx, zy, zz = axes[i, 0], axes[i, 1], axes[i, 2], axes[i, 3], axes[i, 4], axes[i, 5]
        if model.kind[i] == REVOLUTE:
            xi[0] = py * zz - pz * zy
            xi[1] = pz * zx - px * zz
            xi[2] = px * zy - py * zx
            xi[3], xi[4], xi[5] = zx, zy, zz
        else:
            xi[0], xi[1], xi[2] = zx, zy, zz
            xi[3], xi[4], xi[5] = 0.0, 0.0, 0.0
        c = model.coordinate[i]
        gain = model.gain[i, 0]
        rate[0, c] += gain * (V[4] * xi[2] - V[5] * xi[1] + V[1] * xi[5] - V[2] * xi[4])
        rate[1, c] += gain * (V[5] * xi[0] - V[3] * xi[2] + V[2] * xi[3] - V[0] * xi[5])
        rate[2, c] += gain * (V[3] * xi[1] - V[4] * xi[0] + V[0] * xi[4] - V[1] * xi[3])
        rate[3, c] += gain * (V[4] * xi[5] - V[5] * xi[4])
        rate[4, c] += gain * (V[5] * xi[3] - V[3] * xi[5])
        rate[5, c] += gain * (V[3] * xi[4] - V[4] * xi[3])
        for k in range(6):
            jacobian[k, c] += gain * xi[k]
            V[k] += gain * qd[c] * xi[k]
