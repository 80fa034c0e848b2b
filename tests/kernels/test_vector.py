"""Lanes as values: every operator against NumPy."""

from __future__ import annotations

import numpy as np

from apprehend.kernels._jit import kernel
from apprehend.kernels.lanes import LANES
from apprehend.kernels.vector import larger, load, magnitude, root, select, smaller, some, splat, store

L = LANES


@kernel
def arithmetic(a, b, out):
    x, y = load(a, 0), load(b, 0)
    store(out, 0, x + y)
    store(out, L, x - 2.0)
    store(out, 2 * L, 3.0 * y)
    store(out, 3 * L, x / y)
    store(out, 4 * L, -x)
    store(out, 5 * L, root(magnitude(x)))
    store(out, 6 * L, larger(x, y))
    store(out, 7 * L, smaller(x, 0.1))
    store(out, 8 * L, 1.0 / y - x * y + splat(0.5))


@kernel
def masks(a, b, out):
    x, y = load(a, 0), load(b, 0)
    store(out, 0, select((x < y) & (x > 0.0), x, y))
    store(out, L, select((x <= y) | (y >= 0.5), 1.0, 0.0))
    store(out, 2 * L, select(~(x == y), 1.0, x))
    store(out, 3 * L, select(x != 0.0, y, -1.0))
    return some(x > 2.0), some(x > 0.0)


def test_arithmetic_on_all_lanes() -> None:
    rng = np.random.default_rng(0)
    a, b, out = rng.normal(size=L), rng.uniform(0.1, 1.0, L), np.empty(9 * L)
    arithmetic(a, b, out)
    expected = [
        a + b, a - 2.0, 3.0 * b, a / b, -a, np.sqrt(abs(a)), np.maximum(a, b), np.minimum(a, 0.1), 1.0 / b - a * b + 0.5
    ]  # fmt: skip
    assert np.allclose(out.reshape(9, L), expected, rtol=1e-15, atol=1e-15)


def test_masks_choose_lane_by_lane() -> None:
    rng = np.random.default_rng(1)
    a, b, out = rng.uniform(-1.0, 1.0, L), rng.uniform(0.0, 1.0, L), np.empty(4 * L)
    a[3] = b[3]
    a[5] = 0.0
    assert masks(a, b, out) == (False, True)
    expected = [
        np.where((a < b) & (a > 0.0), a, b), np.where((a <= b) | (b >= 0.5), 1.0, 0.0), np.where(a != b, 1.0, a),
        np.where(a != 0.0, b, -1.0),
    ]  # fmt: skip
    assert np.array_equal(out.reshape(4, L), expected)


def test_nan_gives_the_second_of_larger_and_smaller() -> None:
    a, b, out = np.full(L, np.nan), np.ones(L), np.empty(9 * L)
    arithmetic(a, b, out)
    assert (out[6 * L : 7 * L] == 1.0).all()
    assert (out[7 * L : 8 * L] == 0.1).all()
