"""Lanes as values compute lane by lane what NumPy computes, at any width."""

import numpy as np
import pytest

from apprehend.kernels._jit import kernel
from apprehend.kernels.lanes import LANES
from apprehend.kernels.vector import floor, larger, load, magnitude, of_width, root, select, smaller, some, splat, store

load8, splat8 = of_width(8)


@kernel
def _on_eight(a, b, out, truths):
    """Rows as long as the lanes."""
    _all(load8(a, 0), load8(b, 1, 2), splat8(0.5), out, truths)


@kernel
def _on_lanes(a, b, out, truths):
    """Any place of an array where enough entries follow."""
    _all(load(a, 0, 0), load(b, 1, 2, 0), splat(0.5), out, truths)


@kernel(inline=True)
def _all(x, y, half, out, truths):
    results = half
    results += x * y - 2.0 / y
    store(out, 0, results)
    store(out, 1, -x + 3)
    store(out, 2, root(x * x))
    store(out, 3, magnitude(x))
    store(out, 4, larger(x, y))
    store(out, 5, smaller(x, 0.25))
    store(out, 6, select(x > y, x, 7))
    store(out, 7, select((x < 0.0) | (y >= 1.0), 1.0, y))
    store(out, 8, select((x <= y) & ~(x == y), 1.0, 0.0))
    store(out, 9, select(x != 0.0, x - 1.0, y))
    store(out, 10, floor(x))
    truths[0], truths[1] = some(x > 9.0), some(x < 9.0)


@kernel
def _nan(a, out):
    store(out, 0, larger(load8(a, 0), load8(a, 1)))
    store(out, 1, smaller(load8(a, 0), load8(a, 1)))
    store(out, 2, select(load8(a, 0) != load8(a, 1), 1.0, 0.0))


@pytest.mark.parametrize("width,run", [(8, _on_eight), (LANES, _on_lanes)])
def test_operators(width, run):
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, width)), rng.normal(size=(3, 4, width))
    a[0, 3], a[0, 5] = b[1, 2, 3], 0.0
    out, truths = np.zeros((11, width)), np.zeros(2, bool)
    run(a, b, out, truths)
    x, y = a[0], b[1, 2]
    want = [
        0.5 + x * y - 2.0 / y, 3.0 - x, np.abs(x), np.abs(x), np.maximum(x, y), np.minimum(x, 0.25),
        np.where(x > y, x, 7.0), np.where((x < 0.0) | (y >= 1.0), 1.0, y), x < y, np.where(x != 0.0, x - 1.0, y),
        np.floor(x),
    ]  # fmt: skip
    np.testing.assert_allclose(out, want, rtol=1e-14)
    assert truths.tolist() == [False, True]


@pytest.mark.parametrize("which", [0, 1])
def test_comparisons_with_nan_take_the_second(which):
    a = np.ones((2, 8))
    a[which] = np.nan
    out = np.zeros((3, 8))
    _nan(a, out)
    np.testing.assert_array_equal(out[:2], np.broadcast_to(a[1], (2, 8)))
    assert (out[2] == 1.0).all()
