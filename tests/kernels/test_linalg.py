"""Factors of packed symmetric matrices on lanes solve their systems."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.kernels.lanes import LANES
from apprehend.kernels.linalg import factor_block, solve_block


@pytest.mark.parametrize("n", [1, 2, 6, 7, 13])
def test_systems_are_solved_on_every_lane(n: int) -> None:
    rng = np.random.default_rng(n)
    X = rng.normal(size=(LANES, n, n + 3))
    A = X @ np.swapaxes(X, 1, 2)
    b = rng.normal(size=(LANES, n))
    lower = [A[:, i, j] for i in range(n) for j in range(i + 1)]
    packed, x, scratch = np.array(lower).ravel(), b.T.copy().ravel(), np.empty(LANES)
    factor_block(packed, n, scratch)
    solve_block(packed, n, x, scratch)
    expected = np.linalg.solve(A, b[..., None])[..., 0]
    np.testing.assert_allclose(x.reshape(n, LANES).T, expected, rtol=1e-9)
    # the diagonal holds D of A = L D Lᵀ: its product is the determinant
    diagonal = packed.reshape(-1, LANES)[[i * (i + 1) // 2 + i for i in range(n)]]
    np.testing.assert_allclose(diagonal.prod(axis=0), np.linalg.det(A), rtol=1e-9)
