"""Many paths in one call: the answers of single calls, on any number of threads."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import parallel
from apprehend import trajectory as tj
from apprehend.errors import InputError, UnsuccessfulError

LIMITS = tj.Limits(velocity=[1.0, 2.0, 1.5], acceleration=[3.0, 4.0, 5.0])


def paths(count: int, seed: int = 0) -> list[tj.PolynomialPath]:
    rng = np.random.default_rng(seed)
    made: list[tj.PolynomialPath] = [tj.Spline(rng.normal(size=(rng.integers(3, 7), 3))) for _ in range(count)]
    made[3] = tj.polyline(rng.normal(size=(4, 3)))  # kinks, another degree
    made[5] = tj.BSpline.through(rng.normal(size=(8, 3)), 5)
    return made


@pytest.mark.parametrize("options", [{}, {"start_speed": 0.05, "end_speed": 0.02}, {"least": 20}])
def test_answers_of_single_calls(options: dict) -> None:
    curves = paths(41)
    many = tj.time_optimal_many(curves, LIMITS, grid=90, **options)
    assert len(many) == 41
    for i, curve in enumerate(curves):
        single = tj.time_optimal(curve, LIMITS, grid=90, **options)
        assert many.success[i] == single.success
        assert many.status[i] is single.status
        if single.success:
            assert many.durations[i] == pytest.approx(single.duration, rel=1e-12)
            np.testing.assert_allclose(many[i].speed, single.speed, rtol=1e-12, atol=1e-12)
            assert many[i].motion.duration == pytest.approx(many.durations[i], rel=1e-12)


def test_blocks_with_all_that_can_happen_to_a_lane() -> None:
    """Two blocks: kinks, standing joints, straight lines, rest in the middle, many sizes, asymmetric limits."""
    rng = np.random.default_rng(5)
    limits = tj.Limits(velocity=[[-1.0, 2.0]] * 3, acceleration=[[-3.0, 1.0]] * 3)
    curves: list[tj.PolynomialPath] = [
        tj.Spline(rng.normal(size=(5, 3)) * 10.0 ** rng.integers(-4, 4)) for _ in range(70)
    ]
    curves[2] = tj.polyline(rng.normal(size=(6, 3)))
    curves[9] = tj.Spline(rng.normal(size=(5, 3)) * [1.0, 0.0, 1.0])
    curves[11] = tj.polyline([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    curves[66] = tj.PolynomialPath([0.0, 1.0], [[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0] * 3, [1.0, 2.0, 3.0]]])
    many = tj.time_optimal_many(curves, limits, grid=60).require_success()
    for i, curve in enumerate(curves):
        single = tj.time_optimal(curve, limits, grid=60)
        assert many.durations[i] == pytest.approx(single.duration, rel=1e-9), i
        if i % 10 < 3:
            assert many[i].motion.check(limits).success


def test_threads_do_not_change_the_bits() -> None:
    curves = paths(140, seed=1)
    before = parallel.threads()
    try:
        found = []
        for threads in (1, 2, 3):
            parallel.set_threads(threads)
            found.append(tj.time_optimal_many(curves, LIMITS).durations)
    finally:
        parallel.set_threads(before)
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


def test_failures_are_named() -> None:
    curves = paths(8)
    many = tj.time_optimal_many(curves, LIMITS, start_speed=0.5)
    single = [tj.time_optimal(c, LIMITS, start_speed=0.5).success for c in curves]
    assert many.success.tolist() == single
    fast = tj.time_optimal_many(curves, LIMITS, start_speed=99.0)
    assert not fast.success.any()
    with pytest.raises(UnsuccessfulError, match=r"0 of 8 paths timed; path 0: .*start_speed is 99"):
        fast.require_success()
    assert tj.time_optimal_many(curves, LIMITS).require_success().explain() == "8 of 8 paths timed"


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.time_optimal_many([], LIMITS), "paths is empty"),
        (lambda: tj.time_optimal_many([*paths(6), tj.polyline([[0.0], [1.0]])], LIMITS), "path 6 has 1 coordinates"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
