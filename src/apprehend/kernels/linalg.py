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


@kernel(borrow=True)
def factor_block(A, n, scratch):
    """Factor ``A = L D Lᵀ`` in place (unit lower L, D on the diagonal); A is a packed triangle, *scratch* (1) on lanes.

    Sums gather in *scratch*: a loop that reads and writes one array at offsets known at run time does not vectorise.
    """
    for i in range(n):
        ii = entry(i, i)
        for j in range(i):
            ij = entry(i, j)
            for lane in range(LANES):
                scratch[lane] = A[ij + lane]
            for k in range(j):
                ik = entry(i, k)
                jk = entry(j, k)
                # row i holds L D until its turn ends
                for lane in range(LANES):
                    scratch[lane] -= A[ik + lane] * A[jk + lane]
            for lane in range(LANES):
                A[ij + lane] = scratch[lane]
        for lane in range(LANES):
            scratch[lane] = A[ii + lane]
        for j in range(i):
            _scale(A, entry(i, j), entry(j, j), scratch)
        for lane in range(LANES):
            A[ii + lane] = scratch[lane]


@kernel(borrow=True)
def _scale(A, ij, jj, diagonal):
    """Turn entry ij of L D into L and take its part off the diagonal of its row."""
    ij = ij & 0x7FFFFFFF
    jj = jj & 0x7FFFFFFF
    for lane in range(LANES):
        before = A[ij + lane]
        factor = before / A[jj + lane]
        diagonal[lane] -= factor * before
        A[ij + lane] = factor


@kernel(borrow=True)
def solve_block(A, n, x, scratch):
    """Solve in place for ``x (n * LANES)`` with the factors that `factor_block` left in *A*; *scratch* (1) on lanes."""
    for i in range(n):
        xi = (i * LANES) & 0x7FFFFFFF
        for lane in range(LANES):
            scratch[lane] = x[xi + lane]
        for j in range(i):
            ij = entry(i, j)
            xj = (j * LANES) & 0x7FFFFFFF
            for lane in range(LANES):
                scratch[lane] -= A[ij + lane] * x[xj + lane]
        for lane in range(LANES):
            x[xi + lane] = scratch[lane]
    for r in range(n):
        i = n - 1 - r
        ii = entry(i, i)
        xi = (i * LANES) & 0x7FFFFFFF
        for lane in range(LANES):
            scratch[lane] = x[xi + lane] / A[ii + lane]
        for j in range(i + 1, n):
            ji = entry(j, i)
            xj = (j * LANES) & 0x7FFFFFFF
            for lane in range(LANES):
                scratch[lane] -= A[ji + lane] * x[xj + lane]
        for lane in range(LANES):
            x[xi + lane] = scratch[lane]
