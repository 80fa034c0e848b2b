"""Balance rows of many grasps made orthonormal."""

from __future__ import annotations

import numpy as np

from ._jit import kernel


@kernel
def orthonormal(A, least, onto, columns, weak):  # type: ignore[no-untyped-def]
    """Gram and Schmidt, twice: ``onto[g] @ A[g]`` has orthonormal rows, written by columns into ``columns[g, :, :rows]``.

    ``A (N, rows, n)``. *weak* where less than the share *least* of a row is left of it: such a grasp has (nearly)
    dependent rows.
    """
    rows, n = A.shape[1], A.shape[2]
    v, T = np.empty((rows, n)), np.empty((rows, rows))
    for g in range(A.shape[0]):
        weak[g] = False
        largest = 0.0
        for r in range(rows):
            for q in range(rows):
                T[r, q] = 1.0 if q == r else 0.0
            before = 0.0
            for j in range(n):
                v[r, j] = A[g, r, j]
                before += v[r, j] * v[r, j]
            largest = max(largest, before)
            for _ in range(2):
                for q in range(r):
                    dot = 0.0
                    for j in range(n):
                        dot += v[r, j] * v[q, j]
                    for j in range(n):
                        v[r, j] -= dot * v[q, j]
                    for j in range(r):
                        T[r, j] -= dot * T[q, j]
            square = 0.0
            for j in range(n):
                square += v[r, j] * v[r, j]
            if not square > least * least * largest:
                weak[g] = True
                square = 1.0
            inverse = 1.0 / np.sqrt(square)
            for j in range(n):
                v[r, j] *= inverse
                columns[g, j, r] = v[r, j]
            for q in range(rows):
                T[r, q] *= inverse
                onto[g, r, q] = T[r, q]
