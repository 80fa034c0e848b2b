"""Small dense linear algebra on lanes: symmetric positive systems, packed.

The lower triangle of a symmetric n × n matrix is packed row by row: entry (i, j ≤ i) is component
``i * (i + 1) // 2 + j`` of a flat lane buffer (component c of lane l at ``c * LANES + l``).
"""

from __future__ import annotations

from ._jit import kernel
from .lanes import LANES


@kernel(inline=True)
def entry(i, j):
    """Where entry (i, j ≤ i) of a packed triangle begins; masked so that the compiler knows it is not negative."""
    return ((i * (i + 1) // 2 + j) * LANES) & 0x7FFFFFFF


@kernel
def factor_block(A, n):
    """Factor ``A = L D Lᵀ`` in place (unit lower L, D on the diagonal); A is a packed triangle on lanes."""
    for i in range(n):
        ii = entry(i, i)
        for j in range(i):
            ij = entry(i, j)
            for k in range(j):
                ik = entry(i, k)
                jk = entry(j, k)
                # row i holds L D until its turn ends
                for lane in range(LANES):
                    A[ij + lane] -= A[ik + lane] * A[jk + lane]
        for j in range(i):
            ij = entry(i, j)
            jj = entry(j, j)
            for lane in range(LANES):
                scaled = A[ij + lane]
                factor = scaled / A[jj + lane]
                A[ij + lane] = factor
                A[ii + lane] -= factor * scaled


@kernel
def solve_block(A, n, x):
    """Solve in place for ``x (n * LANES)`` with the factors that `factor_block` left in *A*."""
    for i in range(n):
        xi = (i * LANES) & 0x7FFFFFFF
        for j in range(i):
            ij = entry(i, j)
            xj = (j * LANES) & 0x7FFFFFFF
            for lane in range(LANES):
                x[xi + lane] -= A[ij + lane] * x[xj + lane]
    for i in range(n):
        ii = entry(i, i)
        xi = (i * LANES) & 0x7FFFFFFF
        for lane in range(LANES):
            x[xi + lane] /= A[ii + lane]
    for r in range(n):
        i = n - 1 - r
        xi = (i * LANES) & 0x7FFFFFFF
        for j in range(i):
            ij = entry(i, j)
            xj = (j * LANES) & 0x7FFFFFFF
            for lane in range(LANES):
                x[xj + lane] -= A[ij + lane] * x[xi + lane]
