"""Frames and distances of spheres on lanes against plain arithmetic."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.kernels._jit import kernel
from apprehend.kernels.lanes import LANES, sincos
from apprehend.kernels.sphere import sine_cosine
from apprehend.kernels.sphere_near import BOX, CYLINDER, to_box, to_cylinder
from apprehend.kernels.vector import load, store


@kernel
def of_angles(x, sines, cosines):
    for i in range(0, x.shape[0], LANES):
        s, c = sine_cosine(load(x, i))
        store(sines, i, s)
        store(cosines, i, c)


@kernel
def one_by_one(x, sines, cosines):
    for i in range(x.shape[0]):
        sines[i], cosines[i] = sincos(x[i])


@kernel
def of_points(fixed, points, out):
    for o in range(fixed.shape[0]):
        if fixed[o, 16] == BOX:
            store(out, o * LANES, to_box(fixed, o, points, 0))
        else:
            store(out, o * LANES, to_cylinder(fixed, o, points, 0))


@pytest.mark.parametrize("kernel_of", [of_angles, one_by_one])
def test_sine_and_cosine_are_within_two_ulp_of_one(kernel_of) -> None:
    rng = np.random.default_rng(0)
    quarters = 0.5 * np.pi * np.arange(-40, 40)
    x = np.concatenate([rng.uniform(-20.0, 20.0, 4096), rng.uniform(-1e5, 1e5, 4096), quarters, quarters + 1e-9])
    sines, cosines = np.empty_like(x), np.empty_like(x)
    kernel_of(x, sines, cosines)
    np.testing.assert_allclose(sines, np.sin(x), atol=4.4e-16, rtol=0.0)
    np.testing.assert_allclose(cosines, np.cos(x), atol=4.4e-16, rtol=0.0)


def turned(rng: np.random.Generator) -> np.ndarray:
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q * np.sign(np.linalg.det(Q))


@pytest.mark.parametrize("kind", [BOX, CYLINDER])
def test_squared_distances_to_fixed_shapes(kind: int) -> None:
    rng, count = np.random.default_rng(1), 200
    points = rng.normal(size=(3, LANES))
    fixed, expected = np.zeros((count, 17)), np.empty((count, LANES))
    for o in range(count):
        R, t, half = turned(rng), rng.normal(size=3), rng.uniform(0.05, 1.0, 3)
        if kind == CYLINDER:
            half[1] = half[0]
        fixed[o] = [*R.ravel(), *t, *half, 0.0, kind]
        local = R.T @ (points - t[:, None])
        if kind == BOX:
            beyond = np.maximum(np.abs(local) - half[:, None], 0.0)
        else:
            beyond = np.maximum([np.hypot(local[0], local[1]) - half[0], np.abs(local[2]) - half[2]], 0.0)
        expected[o] = (beyond**2).sum(axis=0)
    out = np.empty(count * LANES)
    of_points(fixed, points.ravel(), out)
    np.testing.assert_allclose(out.reshape(count, LANES), expected, atol=1e-12)
