"""Piecewise polynomials: evaluation, proven ranges, continuity."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import trajectory as tj
from apprehend.errors import InputError


def random_piecewise(seed: int, degree: int = 5, pieces: int = 6, n: int = 3) -> tj.Piecewise:
    rng = np.random.default_rng(seed)
    breaks = np.cumsum(rng.uniform(0.1, 1.0, pieces + 1))
    return tj.Piecewise(breaks, rng.normal(size=(pieces, degree + 1, n)))


def naive(f: tj.Piecewise, x: float, order: int) -> np.ndarray:
    k = int(np.clip(np.searchsorted(f.breaks, x, side="right") - 1, 0, f.breaks.size - 2))
    return np.array(
        [np.polynomial.Polynomial(c).deriv(order)(x - f.breaks[k]) for c in f.coefficients[k].T]
        if order
        else [np.polynomial.Polynomial(c)(x - f.breaks[k]) for c in f.coefficients[k].T]
    )


@pytest.mark.parametrize("order", range(7))
def test_evaluation_agrees_with_numpy(order: int) -> None:
    f = random_piecewise(order)
    x = np.linspace(*f.interval, 57).reshape(3, 19)
    values = f(x, order)
    assert values.shape == (3, 19, 3)
    expected = [[naive(f, v, order) for v in row] for row in x]
    np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize("order", range(4))
def test_extrema_enclose_and_are_attained(order: int) -> None:
    for seed in range(8):
        f = random_piecewise(seed, degree=2 + seed % 5)
        found = f.extrema(order)
        dense = f(np.linspace(*f.interval, 20001), order)
        assert (dense.max(axis=0) <= found.upper + 1e-12 * (1 + abs(found.upper))).all()
        assert (dense.min(axis=0) >= found.lower - 1e-12 * (1 + abs(found.lower))).all()
        # tight: the sampled maximum cannot be far below, and inner extrema are attained where stated
        size = 1.0 + found.magnitude.max()
        assert (found.upper - dense.max(axis=0)).max() < 1e-2 * size
        for j in range(f.n):
            at = found.at_upper[j]
            near = np.array([naive(f, np.clip(at + e, *f.interval), order)[j] for e in (-1e-12, 0.0)])
            left = f.coefficients[max(np.searchsorted(f.breaks, at) - 1, 0)]
            k = max(int(np.searchsorted(f.breaks, at)) - 1, 0)
            p = np.polynomial.Polynomial(left[:, j])
            p = p.deriv(order) if order else p
            best = max(near.max(), p(at - f.breaks[k]))
            assert best == pytest.approx(found.upper[j], abs=1e-9 * size)


def test_continuity_counts_derivatives() -> None:
    x = np.linspace(0.0, 3.0, 7)
    spline = tj.Spline(np.random.default_rng(1).normal(size=(7, 2)), x, ends="natural")
    assert spline.continuity() == 2
    assert tj.polyline([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]).continuity() == 0
    assert tj.Piecewise([0, 1, 2], [[[0.0]], [[1.0]]]).continuity() == -1
    assert tj.cubic(0.0, 1.0, 1.0).continuity() == 3


def test_composition_is_the_chain_rule() -> None:
    path = tj.Spline(np.random.default_rng(2).normal(size=(5, 3)))
    motion = tj.time_optimal(path, tj.Limits(velocity=1.0, acceleration=2.0), grid=37).require_success().motion
    t = np.linspace(0.0, motion.duration, 300)
    e = 1e-6
    inner = t[(t > e) & (t < motion.duration - e)]
    numeric = (motion(inner + e) - motion(inner - e)) / (2 * e)
    np.testing.assert_allclose(motion(inner, 1), numeric, atol=1e-5)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.Piecewise([0.0], np.zeros((0, 1, 1))), r"breaks has shape \(1,\)"),
        (lambda: tj.Piecewise([0.0, 1.0, 1.0], np.zeros((2, 1, 1))), r"breaks\[1\] = 1 is followed by 1"),
        (lambda: tj.Piecewise([0.0, 1.0], np.zeros((2, 1, 1))), "one row of polynomials per interval"),
        (lambda: random_piecewise(0)(99.0), "x = 99 lies outside"),
        (lambda: random_piecewise(0)(1.0, -1), "order is -1"),
        (lambda: random_piecewise(0)(1.0, 1.5), "order is 1.5"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
