"""Wide numbers compute place by place what NumPy computes."""

import numpy as np
import pytest

from apprehend.kernels import wide as w
from apprehend.kernels._jit import kernel


@kernel
def _all(a, b, out):
    x, y = w.load(a, 0), w.load2(b, 1, 2)
    results = w.wide(0.0)
    results += x * y - 2.0 / y
    w.store2(out, 0, 0, results)
    w.store2(out, 0, 1, -x + 3.0)
    w.store2(out, 0, 2, w.root(x * x))
    w.store2(out, 0, 3, w.size(x))
    w.store2(out, 1, 0, w.larger(x, y))
    w.store2(out, 1, 1, w.smaller(x, 0.25))
    w.store2(out, 1, 2, w.where(x > y, x, 7.0))
    w.store2(out, 1, 3, w.where(x < 0.0, 1.0, y))


@kernel
def _nan(a, out):
    w.store(out, 0, w.larger(w.load(a, 0), w.load(a, 1)))
    w.store(out, 1, w.smaller(w.load(a, 0), w.load(a, 1)))


def test_operators():
    rng = np.random.default_rng(0)
    a, b, out = rng.normal(size=(2, w.WIDTH)), rng.normal(size=(3, 4, w.WIDTH)), np.zeros((2, 4, w.WIDTH))
    _all(a, b, out)
    x, y = a[0], b[1, 2]
    want = [
        [x * y - 2.0 / y, 3.0 - x, np.abs(x), np.abs(x)],
        [np.maximum(x, y), np.minimum(x, 0.25), np.where(x > y, x, 7.0), np.where(x < 0.0, 1.0, y)],
    ]
    np.testing.assert_allclose(out, want, rtol=1e-14)


@pytest.mark.parametrize("which", [0, 1])
def test_comparisons_with_nan_take_the_second(which):
    a = np.ones((2, w.WIDTH))
    a[which] = np.nan
    out = np.zeros((2, w.WIDTH))
    _nan(a, out)
    np.testing.assert_array_equal(out, np.broadcast_to(a[1], out.shape))
