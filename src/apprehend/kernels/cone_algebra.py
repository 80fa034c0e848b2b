"""Algebra of the cones of a cone program: half-lines and second-order cones, side by side in one vector.

Cone i occupies ``starts[i] … starts[i] + cones[i]``. Here are Nesterov and Todd's scaling W of a primal-dual pair of
points, products with it, the quotient of the cones' Jordan algebra, and the room that a step leaves.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel


@kernel
def scaling(x, z, cones, starts, w, beta, lam):  # type: ignore[no-untyped-def]
    """Nesterov–Todd scaling of each cone: unit vector w and factor β with ``W z = W⁻¹ x = λ``. False if it fails."""
    for i in range(cones.shape[0]):
        k, s = cones[i], starts[i]
        if k == 1:
            if not (x[s] > 0.0 and z[s] > 0.0):
                return False
            w[s], beta[i], lam[s] = 1.0, np.sqrt(x[s] / z[s]), np.sqrt(x[s] * z[s])
            continue
        xs, zs, xz = 0.0, 0.0, x[s] * z[s]
        for j in range(s + 1, s + k):
            xs += x[j] * x[j]
            zs += z[j] * z[j]
            xz += x[j] * z[j]
        xs, zs = np.sqrt(xs), np.sqrt(zs)
        if not (x[s] > xs and z[s] > zs):
            return False
        xn, zn = np.sqrt((x[s] - xs) * (x[s] + xs)), np.sqrt((z[s] - zs) * (z[s] + zs))
        g = np.sqrt(0.5 * (1.0 + xz / (xn * zn)))
        w[s] = 0.5 * (x[s] / xn + z[s] / zn) / g
        beta[i] = np.sqrt(xn / zn)
        dot = 0.0
        for j in range(s + 1, s + k):
            w[j] = 0.5 * (x[j] / xn - z[j] / zn) / g
            dot += w[j] * z[j]
        lam[s] = beta[i] * (w[s] * z[s] + dot)
        t = dot / (1.0 + w[s]) + z[s]
        for j in range(s + 1, s + k):
            lam[j] = beta[i] * (z[j] + t * w[j])
    return True


@kernel
def apply(v, cones, starts, w, beta, sign, out):  # type: ignore[no-untyped-def]
    """``W v`` (sign +1) or ``W⁻¹ v`` (sign −1)."""
    for i in range(cones.shape[0]):
        k, s = cones[i], starts[i]
        b = beta[i] if sign > 0.0 else 1.0 / beta[i]
        dot = 0.0
        for j in range(s + 1, s + k):
            dot += w[j] * v[j]
        t = dot / (1.0 + w[s]) + sign * v[s]
        out[s] = b * (w[s] * v[s] + sign * dot)
        for j in range(s + 1, s + k):
            out[j] = b * (v[j] + t * w[j])


@kernel
def second_order(lam, a, b, minus, cones, starts, out):  # type: ignore[no-untyped-def]
    """The u with ``λ ∘ u = a ∘ b − minus e`` in the Jordan algebra of each cone."""
    for i in range(cones.shape[0]):
        k, s = cones[i], starts[i]
        if k == 1:
            out[s] = (a[s] * b[s] - minus) / lam[s]
            continue
        d0, n2, dot = -minus, 0.0, 0.0
        for j in range(s, s + k):
            d0 += a[j] * b[j]
        for j in range(s + 1, s + k):
            out[j] = a[s] * b[j] + b[s] * a[j]
            n2 += lam[j] * lam[j]
            dot += lam[j] * out[j]
        n = np.sqrt(n2)
        u0 = (lam[s] * d0 - dot) / max((lam[s] - n) * (lam[s] + n), 1e-300)
        out[s] = u0
        for j in range(s + 1, s + k):
            out[j] = (out[j] - u0 * lam[j]) / lam[s]


@kernel
def room(x, d, cones, starts):  # type: ignore[no-untyped-def]
    """The inverse of the largest α with ``x + α d`` in the cone, at least 0."""
    worst = 0.0
    for i in range(cones.shape[0]):
        k, s = cones[i], starts[i]
        if k == 1:
            worst = max(worst, -d[s] / x[s])
            continue
        n2, dot = 0.0, 0.0
        for j in range(s + 1, s + k):
            n2 += x[j] * x[j]
            dot += x[j] * d[j]
        n = np.sqrt(n2)
        norm = np.sqrt(max((x[s] - n) * (x[s] + n), 1e-300))
        r0 = (x[s] * d[s] - dot) / norm
        t = (r0 + d[s]) / (x[s] + norm)
        r1 = 0.0
        for j in range(s + 1, s + k):
            e = d[j] - t * x[j]
            r1 += e * e
        worst = max(worst, (np.sqrt(r1) - r0) / norm)
    return worst
