"""Algebra of the cones of a cone program, in wide numbers: half-lines and second-order cones, side by side in one vector.

All vectors of a program are one array ``V (vectors, n, WIDTH)``, and functions are told which of them to take: arrays
are expensive to pass. *cones* lists their sizes, all odd: the entries behind the first go in pairs, filled up with columns of zeros. Here are
Nesterov and Todd's scaling W of a primal-dual pair of points, products with it, the quotient of the cones' Jordan
algebra, and the room that a step leaves.
"""

from __future__ import annotations

from ._jit import kernel
from .cone_rows import backward, factor, forward
from .wide import larger, load2, root, store2, wide

SCALING, LAMBDA, BETA, BACK, SHARE, DEPTH, TILT = 0, 1, 2, 3, 4, 5, 6
"""Vectors that hold the scaling: unit vectors w and λ; then numbers at the first entry of each cone: β, 1 / β,
1 / (1 + w₀), the inverse of λ's depth √(λ₀² − ‖λ₁…‖²), and 1 / (λ₀ + depth)."""


@kernel(inline=True)
def scaling(V, cones, x, z):  # type: ignore[no-untyped-def]
    """Nesterov–Todd scaling of each cone: unit vector w and factor β with ``W z = W⁻¹ x = λ``; NaN outside."""
    s = 0
    for i in range(cones.shape[0]):
        end = s + cones[i]
        x0, z0 = load2(V, x, s), load2(V, z, s)
        xs, zs, xz = wide(0.0), wide(0.0), x0 * z0
        for j in range(s + 1, end, 2):
            x1, x2, z1, z2 = load2(V, x, j), load2(V, x, j + 1), load2(V, z, j), load2(V, z, j + 1)
            xs += x1 * x1 + x2 * x2
            zs += z1 * z1 + z2 * z2
            xz += x1 * z1 + x2 * z2
        xs, zs = root(xs), root(zs)
        xn, zn = root((x0 - xs) * (x0 + xs)), root((z0 - zs) * (z0 + zs))
        ix, iz = 1.0 / xn, 1.0 / zn
        b = root(xn * iz)
        h = 0.5 / root(0.5 + 0.5 * xz * ix * iz)
        jx, ix, iz = ix, ix * h, iz * h
        w0, dot = x0 * ix + z0 * iz, wide(0.0)
        for j in range(s + 1, end, 2):
            z1, z2 = load2(V, z, j), load2(V, z, j + 1)
            w1, w2 = load2(V, x, j) * ix - z1 * iz, load2(V, x, j + 1) * ix - z2 * iz
            dot += w1 * z1 + w2 * z2
            store2(V, SCALING, j, w1)
            store2(V, SCALING, j + 1, w2)
        store2(V, SCALING, s, w0)
        share, l0 = 1.0 / (1.0 + w0), b * (w0 * z0 + dot)
        t = dot * share + z0
        store2(V, LAMBDA, s, l0)
        store2(V, BETA, s, b)
        store2(V, BACK, s, b * zn * jx)
        store2(V, SHARE, s, share)
        store2(V, DEPTH, s, b * jx)
        store2(V, TILT, s, 1.0 / (l0 + b * zn))
        for j in range(s + 1, end, 2):
            store2(V, LAMBDA, j, b * (load2(V, z, j) + t * load2(V, SCALING, j)))
            store2(V, LAMBDA, j + 1, b * (load2(V, z, j + 1) + t * load2(V, SCALING, j + 1)))
        s = end


@kernel(borrow=True)
def apply(V, cones, sign, v, out):  # type: ignore[no-untyped-def]
    """``W v`` (sign +1) or ``W⁻¹ v`` (sign −1)."""
    s = 0
    for i in range(cones.shape[0]):
        end = s + cones[i]
        b, w0, v0, dot = load2(V, BETA if sign > 0.0 else BACK, s), load2(V, SCALING, s), load2(V, v, s), wide(0.0)
        for j in range(s + 1, end, 2):
            dot += load2(V, SCALING, j) * load2(V, v, j) + load2(V, SCALING, j + 1) * load2(V, v, j + 1)
        t = dot * load2(V, SHARE, s) + sign * v0
        store2(V, out, s, b * (w0 * v0 + sign * dot))
        for j in range(s + 1, end, 2):
            store2(V, out, j, b * (load2(V, v, j) + t * load2(V, SCALING, j)))
            store2(V, out, j + 1, b * (load2(V, v, j + 1) + t * load2(V, SCALING, j + 1)))
        s = end


@kernel(inline=True)
def apply_rows(V, cones, A, out):  # type: ignore[no-untyped-def]
    """``W Aᵀ`` for a matrix by columns ``(n, rows, WIDTH)``: `apply` to each of its rows."""
    s = 0
    for i in range(cones.shape[0]):
        end = s + cones[i]
        b, w0, share = load2(V, BETA, s), load2(V, SCALING, s), load2(V, SHARE, s)
        if end == s + 3:  # Coulomb's cone, with w in registers
            w1, w2 = load2(V, SCALING, s + 1), load2(V, SCALING, s + 2)
            for r in range(A.shape[1]):
                v0, v1, v2 = b * load2(A, s, r), b * load2(A, s + 1, r), b * load2(A, s + 2, r)
                dot = w1 * v1 + w2 * v2
                t = dot * share + v0
                store2(out, s, r, w0 * v0 + dot)
                store2(out, s + 1, r, v1 + t * w1)
                store2(out, s + 2, r, v2 + t * w2)
            s = end
            continue
        for r in range(A.shape[1]):
            v0, dot = load2(A, s, r), wide(0.0)
            for j in range(s + 1, end, 2):
                dot += load2(V, SCALING, j) * load2(A, j, r) + load2(V, SCALING, j + 1) * load2(A, j + 1, r)
            t = dot * share + v0
            store2(out, s, r, b * (w0 * v0 + dot))
            for j in range(s + 1, end, 2):
                store2(out, j, r, b * (load2(A, j, r) + t * load2(V, SCALING, j)))
                store2(out, j + 1, r, b * (load2(A, j + 1, r) + t * load2(V, SCALING, j + 1)))
        s = end


@kernel(inline=True)
def quotient(V, cones, a, b, minus, out):  # type: ignore[no-untyped-def]
    """The u with ``λ ∘ u = a ∘ b − minus e`` in the Jordan algebra of each cone."""
    s = 0
    for i in range(cones.shape[0]):
        end = s + cones[i]
        a0, b0, l0 = load2(V, a, s), load2(V, b, s), load2(V, LAMBDA, s)
        d0, dot, depth = a0 * b0 - minus, wide(0.0), load2(V, DEPTH, s)
        for j in range(s + 1, end, 2):
            a1, a2, b1, b2, l1, l2 = load2(V, a, j), load2(V, a, j + 1), load2(V, b, j), load2(V, b, j + 1), load2(V, LAMBDA, j), load2(V, LAMBDA, j + 1)  # fmt: skip
            d1, d2 = a0 * b1 + b0 * a1, a0 * b2 + b0 * a2
            d0 += a1 * b1 + a2 * b2
            dot += l1 * d1 + l2 * d2
            store2(V, out, j, d1)
            store2(V, out, j + 1, d2)
        u0, inverse = (l0 * d0 - dot) * depth * depth, 1.0 / l0
        store2(V, out, s, u0)
        for j in range(s + 1, end):
            store2(V, out, j, (load2(V, out, j) - u0 * load2(V, LAMBDA, j)) * inverse)
        s = end


@kernel(borrow=True)
def room(V, cones, d, e):  # type: ignore[no-untyped-def]
    """The inverse of the largest α with ``λ + α d`` and ``λ + α e`` in the cones, at least 0."""
    worst, s = wide(0.0), 0
    for i in range(cones.shape[0]):
        end = s + cones[i]
        x0, d0, e0 = load2(V, LAMBDA, s), load2(V, d, s), load2(V, e, s)
        inverse, tilt = load2(V, DEPTH, s), load2(V, TILT, s)
        xd, xe = wide(0.0), wide(0.0)
        for j in range(s + 1, end):
            x1 = load2(V, LAMBDA, j)
            xd += x1 * load2(V, d, j)
            xe += x1 * load2(V, e, j)
        d1, e1 = (x0 * d0 - xd) * inverse, (x0 * e0 - xe) * inverse
        t, u = (d1 + d0) * tilt, (e1 + e0) * tilt
        dd, ee = wide(0.0), wide(0.0)
        for j in range(s + 1, end):
            x1 = load2(V, LAMBDA, j)
            v, q = load2(V, d, j) - t * x1, load2(V, e, j) - u * x1
            dd += v * v
            ee += q * q
        worst = larger(worst, larger(root(dd) - d1, root(ee) - e1) * inverse)
        s = end
    return worst


@kernel(borrow=True)
def quadratic(V, cones, Q, W, L, A):  # type: ignore[no-untyped-def]
    """Factors ``L Lᵀ = 1 + W diag(Q) W`` of each cone's block, and ``L⁻¹`` applied to the columns' blocks of A."""
    s = 0
    for i in range(cones.shape[0]):
        k = cones[i]
        b, w0 = load2(V, BETA, s), load2(V, SCALING, s)
        share = b / (1.0 + w0)
        for p in range(k):  # W of this cone, with the roots of Q
            for q in range(k):
                v = (
                    load2(V, SCALING, s + p) * load2(V, SCALING, s + q) * share
                    if p and q
                    else b * load2(V, SCALING, s + p + q)
                )
                store2(W, p, q, v + b if p == q and p else v)
        for p in range(k):
            for q in range(p + 1):
                t = wide(1.0 if p == q else 0.0)
                for m in range(k):
                    t += load2(W, p, m) * load2(W, m, q) * load2(V, Q, s + m)
                store2(L, s + p, q, t)
        factor(L, s, k)
        for r in range(A.shape[1]):
            for p in range(k):
                t = load2(A, s + p, r)
                for m in range(p):
                    t -= load2(L, s + p, m) * load2(A, s + m, r)
                store2(A, s + p, r, t * load2(L, s + p, p))
        s += k


@kernel(borrow=True)
def triangular(V, cones, L, v, transposed):  # type: ignore[no-untyped-def]
    """``L⁻¹ v``, or ``L⁻ᵀ v``, block by block, in place."""
    s = 0
    for i in range(cones.shape[0]):
        if transposed:
            backward(L, s, cones[i], V, v)
        else:
            forward(L, s, cones[i], V, v)
        s += cones[i]
