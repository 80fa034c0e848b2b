"""The linear algebra of a cone program on lanes: products with the constraint matrix, and its normal equations.

The matrix is kept by columns ``(n, rows, WIDTH)``. Rows go in threes, so that sums stay in registers: their number is a
multiple of three, filled up with rows of zeros, which `factor` leaves out.
"""

from __future__ import annotations

from ._jit import kernel
from .vector import of_width, root, select, store

WIDTH = 8
"""Problems side by side."""
load, splat = of_width(WIDTH)


@kernel(borrow=True)
def spread(A, rows, y, columns, out):  # type: ignore[no-untyped-def]
    """``columns[out] = Aᵀ rows[y]``, one entry for each column."""
    for r in range(0, A.shape[1], 3):
        y0, y1, y2 = load(rows, y, r), load(rows, y, r + 1), load(rows, y, r + 2)
        for j in range(A.shape[0]):
            before = splat(0.0) if r == 0 else load(columns, out, j)
            t = load(A, j, r) * y0 + load(A, j, r + 1) * y1 + load(A, j, r + 2) * y2
            store(columns, out, j, before + t)


@kernel(borrow=True)
def gather(A, columns, x, rows, out):  # type: ignore[no-untyped-def]
    """``rows[out] = A columns[x]``, one entry for each row."""
    for r in range(0, A.shape[1], 3):
        t0, t1, t2 = splat(0.0), splat(0.0), splat(0.0)
        for j in range(A.shape[0]):
            v = load(columns, x, j)
            t0 += load(A, j, r) * v
            t1 += load(A, j, r + 1) * v
            t2 += load(A, j, r + 2) * v
        store(rows, out, r, t0)
        store(rows, out, r + 1, t1)
        store(rows, out, r + 2, t2)


@kernel(inline=True)
def gram(A, S):  # type: ignore[no-untyped-def]
    """``S = A Aᵀ``, its lower part."""
    n, rows = A.shape[0], A.shape[1]
    for r in range(0, rows, 3):
        for q in range(0, r + 1, 3):
            s00, s01, s02 = splat(0.0), splat(0.0), splat(0.0)
            s10, s11, s12 = splat(0.0), splat(0.0), splat(0.0)
            s20, s21, s22 = splat(0.0), splat(0.0), splat(0.0)
            for j in range(n):
                a0, a1, a2 = load(A, j, r), load(A, j, r + 1), load(A, j, r + 2)
                b0, b1, b2 = load(A, j, q), load(A, j, q + 1), load(A, j, q + 2)
                s00 += a0 * b0
                s01 += a0 * b1
                s02 += a0 * b2
                s10 += a1 * b0
                s11 += a1 * b1
                s12 += a1 * b2
                s20 += a2 * b0
                s21 += a2 * b1
                s22 += a2 * b2
            store(S, r, q, s00)
            store(S, r, q + 1, s01)
            store(S, r, q + 2, s02)
            store(S, r + 1, q, s10)
            store(S, r + 1, q + 1, s11)
            store(S, r + 1, q + 2, s12)
            store(S, r + 2, q, s20)
            store(S, r + 2, q + 1, s21)
            store(S, r + 2, q + 2, s22)


@kernel(borrow=True)
def factor(S, at, n):  # type: ignore[no-untyped-def]
    """Cholesky factor in place of the n rows from *at* on (lower part); the diagonal holds reciprocals.

    A pivot lost to rounding is left out.
    """
    for j in range(n):
        before = load(S, at + j, j)
        t = before
        for m in range(j):
            a = load(S, at + j, m)
            t -= a * a
        inverse = select(t > 1e-15 * before, 1.0 / root(t), 0.0)
        store(S, at + j, j, inverse)
        for i in range(j + 1, n):
            t = load(S, at + i, j)
            for m in range(j):
                t -= load(S, at + i, m) * load(S, at + j, m)
            store(S, at + i, j, t * inverse)


@kernel(borrow=True)
def forward(S, at, n, v, k):  # type: ignore[no-untyped-def]
    """``L⁻¹ v[k]`` in place, for the n entries from *at* on."""
    for j in range(n):
        t = load(v, k, at + j)
        for m in range(j):
            t -= load(S, at + j, m) * load(v, k, at + m)
        store(v, k, at + j, t * load(S, at + j, j))


@kernel(borrow=True)
def backward(S, at, n, v, k):  # type: ignore[no-untyped-def]
    """``L⁻ᵀ v[k]`` in place, for the n entries from *at* on."""
    for back in range(n):
        j = n - 1 - back
        t = load(v, k, at + j)
        for m in range(j + 1, n):
            t -= load(S, at + m, j) * load(v, k, at + m)
        store(v, k, at + j, t * load(S, at + j, j))
