"""Algebra of the cones of a cone program, on lanes: half-lines and second-order cones, side by side in one vector.

All vectors of a program are one array ``V (vectors, n, WIDTH)``, and functions are told which of them to take: arrays
are expensive to pass. *cones* lists their sizes, all odd: the entries behind the first go in pairs, filled up with columns of zeros. Here are
Nesterov and Todd's scaling W of a primal-dual pair of points, products with it, the quotient of the cones' Jordan
algebra, and the room that a step leaves.
"""

from __future__ import annotations

from ._jit import kernel
from .cone_rows import backward, factor, forward, load, splat
from .vector import larger, root, store

SCALING, LAMBDA, BETA, BACK, SHARE, DEPTH, TILT = 0, 1, 2, 3, 4, 5, 6
"""Vectors that hold the scaling: unit vectors w and λ; then numbers at the first entry of each cone: β, 1 / β,
1 / (1 + w₀), the inverse of λ's depth √(λ₀² − ‖λ₁…‖²), and 1 / (λ₀ + depth)."""


@kernel(inline=True)
def scaling(V, cones, x, z):  # type: ignore[no-untyped-def]
    """Nesterov–Todd scaling of each cone: unit vector w and factor β with ``W z = W⁻¹ x = λ``; NaN outside."""
    s = 0
    for i in range(cones.shape[0]):
        end = s + cones[i]
        x0, z0 = load(V, x, s), load(V, z, s)
        xs, zs, xz = splat(0.0), splat(0.0), x0 * z0
        for j in range(s + 1, end, 2):
            x1, x2, z1, z2 = load(V, x, j), load(V, x, j + 1), load(V, z, j), load(V, z, j + 1)
            xs += x1 * x1 + x2 * x2
            zs += z1 * z1 + z2 * z2
            xz += x1 * z1 + x2 * z2
        xs, zs = root(xs), root(zs)
        xn, zn = root((x0 - xs) * (x0 + xs)), root((z0 - zs) * (z0 + zs))
        ix, iz = 1.0 / xn, 1.0 / zn
        b = root(xn * iz)
        h = 0.5 / root(0.5 + 0.5 * xz * ix * iz)
        jx, ix, iz = ix, ix * h, iz * h
        w0, dot = x0 * ix + z0 * iz, splat(0.0)
        for j in range(s + 1, end, 2):
            z1, z2 = load(V, z, j), load(V, z, j + 1)
            w1, w2 = load(V, x, j) * ix - z1 * iz, load(V, x, j + 1) * ix - z2 * iz
            dot += w1 * z1 + w2 * z2
            store(V, SCALING, j, w1)
            store(V, SCALING, j + 1, w2)
        store(V, SCALING, s, w0)
        share, l0 = 1.0 / (1.0 + w0), b * (w0 * z0 + dot)
        t = dot * share + z0
        store(V, LAMBDA, s, l0)
        store(V, BETA, s, b)
        store(V, BACK, s, b * zn * jx)
        store(V, SHARE, s, share)
        store(V, DEPTH, s, b * jx)
        store(V, TILT, s, 1.0 / (l0 + b * zn))
        for j in range(s + 1, end, 2):
            store(V, LAMBDA, j, b * (load(V, z, j) + t * load(V, SCALING, j)))
            store(V, LAMBDA, j + 1, b * (load(V, z, j + 1) + t * load(V, SCALING, j + 1)))
        s = end


@kernel(borrow=True)
def apply(V, cones, sign, v, out):  # type: ignore[no-untyped-def]
    """``W v`` (sign +1) or ``W⁻¹ v`` (sign −1)."""
    s = 0
    for i in range(cones.shape[0]):
        end = s + cones[i]
        b, w0, v0, dot = load(V, BETA if sign > 0.0 else BACK, s), load(V, SCALING, s), load(V, v, s), splat(0.0)
        for j in range(s + 1, end, 2):
            dot += load(V, SCALING, j) * load(V, v, j) + load(V, SCALING, j + 1) * load(V, v, j + 1)
        t = dot * load(V, SHARE, s) + sign * v0
        store(V, out, s, b * (w0 * v0 + sign * dot))
        for j in range(s + 1, end, 2):
            store(V, out, j, b * (load(V, v, j) + t * load(V, SCALING, j)))
            store(V, out, j + 1, b * (load(V, v, j + 1) + t * load(V, SCALING, j + 1)))
        s = end


@kernel(inline=True)
def apply_rows(V, cones, A, out):  # type: ignore[no-untyped-def]
    """``W Aᵀ`` for a matrix by columns ``(n, rows, WIDTH)``: `apply` to each of its rows."""
    s = 0
    for i in range(cones.shape[0]):
        end = s + cones[i]
        b, w0, share = load(V, BETA, s), load(V, SCALING, s), load(V, SHARE, s)
        if end == s + 3:  # Coulomb's cone, with w in registers
            w1, w2 = load(V, SCALING, s + 1), load(V, SCALING, s + 2)
            for r in range(A.shape[1]):
                v0, v1, v2 = b * load(A, s, r), b * load(A, s + 1, r), b * load(A, s + 2, r)
                dot = w1 * v1 + w2 * v2
                t = dot * share + v0
                store(out, s, r, w0 * v0 + dot)
                store(out, s + 1, r, v1 + t * w1)
                store(out, s + 2, r, v2 + t * w2)
            s = end
            continue
        for r in range(A.shape[1]):
            v0, dot = load(A, s, r), splat(0.0)
            for j in range(s + 1, end, 2):
                dot += load(V, SCALING, j) * load(A, j, r) + load(V, SCALING, j + 1) * load(A, j + 1, r)
            t = dot * share + v0
            store(out, s, r, b * (w0 * v0 + dot))
            for j in range(s + 1, end, 2):
                store(out, j, r, b * (load(A, j, r) + t * load(V, SCALING, j)))
                store(out, j + 1, r, b * (load(A, j + 1, r) + t * load(V, SCALING, j + 1)))
        s = end


@kernel(inline=True)
def quotient(V, cones, a, b, minus, out):  # type: ignore[no-untyped-def]
    """The u with ``λ ∘ u = a ∘ b − minus e`` in the Jordan algebra of each cone."""
    s = 0
    for i in range(cones.shape[0]):
        end = s + cones[i]
        a0, b0, l0 = load(V, a, s), load(V, b, s), load(V, LAMBDA, s)
        d0, dot, depth = a0 * b0 - minus, splat(0.0), load(V, DEPTH, s)
        for j in range(s + 1, end, 2):
            a1, a2, b1, b2, l1, l2 = load(V, a, j), load(V, a, j + 1), load(V, b, j), load(V, b, j + 1), load(V, LAMBDA, j), load(V, LAMBDA, j + 1)  # fmt: skip
            d1, d2 = a0 * b1 + b0 * a1, a0 * b2 + b0 * a2
            d0 += a1 * b1 + a2 * b2
            dot += l1 * d1 + l2 * d2
            store(V, out, j, d1)
            store(V, out, j + 1, d2)
        u0, inverse = (l0 * d0 - dot) * depth * depth, 1.0 / l0
        store(V, out, s, u0)
        for j in range(s + 1, end):
            store(V, out, j, (load(V, out, j) - u0 * load(V, LAMBDA, j)) * inverse)
        s = end


@kernel(borrow=True)
def room(V, cones, d, e):  # type: ignore[no-untyped-def]
    """The inverse of the largest α with ``λ + α d`` and ``λ + α e`` in the cones, at least 0."""
    worst, s = splat(0.0), 0
    for i in range(cones.shape[0]):
        end = s + cones[i]
        x0, d0, e0 = load(V, LAMBDA, s), load(V, d, s), load(V, e, s)
        inverse, tilt = load(V, DEPTH, s), load(V, TILT, s)
        xd, xe = splat(0.0), splat(0.0)
        for j in range(s + 1, end):
            x1 = load(V, LAMBDA, j)
            xd += x1 * load(V, d, j)
            xe += x1 * load(V, e, j)
        d1, e1 = (x0 * d0 - xd) * inverse, (x0 * e0 - xe) * inverse
        t, u = (d1 + d0) * tilt, (e1 + e0) * tilt
        dd, ee = splat(0.0), splat(0.0)
        for j in range(s + 1, end):
            x1 = load(V, LAMBDA, j)
            v, q = load(V, d, j) - t * x1, load(V, e, j) - u * x1
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
        b, w0 = load(V, BETA, s), load(V, SCALING, s)
        share = b / (1.0 + w0)
        for p in range(k):  # W of this cone, with the roots of Q
            for q in range(k):
                v = (
                    load(V, SCALING, s + p) * load(V, SCALING, s + q) * share
                    if p and q
                    else b * load(V, SCALING, s + p + q)
                )
                store(W, p, q, v + b if p == q and p else v)
        for p in range(k):
            for q in range(p + 1):
                t = splat(1.0 if p == q else 0.0)
                for m in range(k):
                    t += load(W, p, m) * load(W, m, q) * load(V, Q, s + m)
                store(L, s + p, q, t)
        factor(L, s, k)
        for r in range(A.shape[1]):
            for p in range(k):
                t = load(A, s + p, r)
                for m in range(p):
                    t -= load(L, s + p, m) * load(A, s + m, r)
                store(A, s + p, r, t * load(L, s + p, p))
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
