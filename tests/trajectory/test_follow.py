"""From polylines and samples to motions: on the polyline or within the proven deviation, within limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apprehend import trajectory as tj
from apprehend.errors import InputError

LIMITS = tj.Limits(velocity=[2.0, 1.0, 3.0, 2.0], acceleration=[4.0, 9.0, 5.0, 7.0])


def distance_to_polyline(q: np.ndarray, points: np.ndarray) -> np.ndarray:
    best = np.full(q.shape[0], np.inf)
    for a, b in zip(points[:-1], points[1:], strict=True):
        d = b - a
        u = np.clip((q - a) @ d / (d @ d), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(q - a - u[:, None] * d, axis=1))
    return best


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.integers(2, 9), st.sampled_from([0.0, 1e-4, 1e-2, 0.3]))
def test_stays_within_the_deviation_and_the_limits(seed: int, count: int, deviation: float) -> None:
    points = np.random.default_rng(seed).normal(size=(count, 4))
    motion = tj.follow(points, LIMITS, deviation=deviation)
    assert motion.check(LIMITS).success
    assert motion.continuity() >= 1
    np.testing.assert_allclose(motion.start, points[0], atol=1e-12)
    np.testing.assert_allclose(motion.end, points[-1], atol=1e-9)
    np.testing.assert_allclose(motion(np.array(motion.interval), 1), 0.0, atol=1e-7)
    q = motion.sample(count=4000).position
    assert distance_to_polyline(q, points).max() <= deviation + 1e-9


def test_rounding_saves_time_and_stopping_is_the_limit() -> None:
    points = np.random.default_rng(5).normal(size=(8, 4))
    durations = [tj.follow(points, LIMITS, deviation=d).duration for d in (0.3, 0.1, 0.01, 0.0)]
    assert durations == sorted(durations)


def test_rounded_corner_is_smooth_and_reaches_its_bound() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    path = tj.rounded(points, 0.02)
    assert path.continuity() >= 2
    q = path(np.linspace(*path.interval, 20001))
    corner = np.linalg.norm(q - points[1], axis=1).min()
    assert corner == pytest.approx(0.02, rel=1e-6)  # the distance from the corner itself is what the bound uses


def test_reversal_and_straight_corners() -> None:
    there_and_back = np.array([[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.2, 0.0, 0.0, 0.0]])
    for deviation in (0.0, 0.01):
        motion = tj.follow(there_and_back, LIMITS, deviation=deviation)
        assert motion.check(LIMITS).success
        assert motion.extrema(0).upper[0] == pytest.approx(1.0, abs=max(1.01 * deviation, 1e-12))
    straight_on = np.outer([0.0, 0.3, 1.0], [1.0, 0.5, 0.0, 0.2])
    one = tj.follow(straight_on[[0, 2]], LIMITS)
    assert tj.follow(straight_on, LIMITS).duration == pytest.approx(one.duration, rel=1e-12)
    assert tj.follow(straight_on, LIMITS, deviation=0.1).duration == pytest.approx(one.duration, rel=1e-3)


def test_two_sided_limits() -> None:
    limits = tj.Limits(velocity=[[-1.0, 3.0]], acceleration=[[-2.0, 8.0]])
    there, back = tj.follow([[0.0], [4.0]], limits), tj.follow([[4.0], [0.0]], limits)
    assert there.check(limits).success
    assert back.check(limits).success
    assert there.extrema(1).upper[0] == pytest.approx(3.0)
    assert back.extrema(1).lower[0] == pytest.approx(-1.0)


def test_dense_samples() -> None:
    x = np.linspace(0.0, 2.0, 400)
    samples = np.stack([np.sin((j + 1) * x) for j in range(4)], axis=1)
    path = tj.smoothed(samples, 1e-4)
    assert path.breaks.size < 100
    motion = tj.through_samples(samples, LIMITS, deviation=1e-4)
    assert motion.check(LIMITS).success
    assert motion.continuity() >= 1
    dense = np.linspace(0.0, 2.0, 200001)
    curve = np.stack([np.sin((j + 1) * dense) for j in range(4)], axis=1)
    from scipy.spatial import cKDTree

    gap, _ = cKDTree(curve).query(motion.sample(count=500).position)
    assert gap.max() < 2e-4
    assert tj.smoothed(samples[:2], 1e-4).degree == 1


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.follow([[0.0, 1.0]], LIMITS), "at least two points"),
        (lambda: tj.follow([[0.0], [0.0]], {"acceleration": 1.0}), "all 2 points coincide"),
        (lambda: tj.follow([[0.0], [1.0]], {"acceleration": 1.0}, deviation=-1.0), "deviation is -1.0"),
        (lambda: tj.rounded([[0.0], [1.0]], 0.0), "deviation is 0.0"),
        (lambda: tj.follow([[0.0], [1.0]], {"velocity": 1.0}), "acceleration is infinite along a segment"),
        (lambda: tj.follow([[0.0], [1.0]], {"speed": 1.0}), "limits has the key 'speed'"),
        (lambda: tj.follow([[0.0], [1.0]], {"acceleration": -1.0}), r"limits.acceleration\[0\] is \[1.0, -1.0\]"),
        (lambda: tj.follow([[0.0], [1.0]], {"acceleration": [1.0, 2.0]}), r"limits.acceleration has shape \(2,\)"),
        (lambda: tj.follow([[0.0], [1.0]], {"acceleration": np.nan}), "limits.acceleration contains NaN"),
        (lambda: tj.follow([[0.0], [1.0]], 3.0), "limits is float; expected Limits"),
        (lambda: tj.smoothed([[0.0], [1.0], [2.0]], 0.0), "deviation is 0.0"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
