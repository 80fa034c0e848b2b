"""Trading arc length, bending energy and time."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import trajectory as tj
from apprehend.errors import InputError

POINTS = np.random.default_rng(3).normal(size=(5, 3))
LIMITS = tj.Limits(velocity=1.0, acceleration=2.0)


def start() -> np.ndarray:
    path = tj.Spline(POINTS)
    return np.array([tj.arc_length(path), tj.bending_energy(path), tj.time_optimal(path, LIMITS, grid=100).duration])


@pytest.mark.parametrize("factor", [0, 1, 2])
def test_each_factor_can_be_lowered(factor: int) -> None:
    weights = np.full(3, 0.01)
    weights[factor] = 1.0
    found = tj.optimise(POINTS, LIMITS, weights=weights, freedom=0.2, iterations=15)
    assert found.factors[factor] < 0.97 * start()[factor]
    moved = np.abs(found.path.waypoints - POINTS)
    assert moved[1:-1].max() <= 0.2 + 1e-12
    assert moved[[0, -1]].max() == 0.0
    assert found.timing.report.success
    assert tj.arc_length(found.path) == pytest.approx(found.length)


def test_fixed_via_points_still_leave_the_knots() -> None:
    found = tj.optimise(POINTS, LIMITS, weights=[0.0, 0.0, 1.0], iterations=15)
    np.testing.assert_array_equal(found.path.waypoints, POINTS)
    assert found.time <= start()[2] * (1 + 1e-9)


def test_pareto_front() -> None:
    front = tj.pareto(POINTS, LIMITS, freedom=0.3, count=2, iterations=8)
    assert len(front) >= 2
    factors = np.array([c.factors for c in front])
    assert (np.diff(factors[:, 2]) >= 0.0).all()
    assert tj.nondominated(factors).all()
    pytest.importorskip("matplotlib")
    figure = tj.plot_pareto(front)
    assert len(figure.axes[0].collections[0].get_offsets()) == len(front)


def test_nondominated() -> None:
    keep = tj.nondominated([[1.0, 2.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]])
    assert keep.tolist() == [True, True, False, True]


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.optimise(POINTS[:2], LIMITS), "three waypoints"),
        (lambda: tj.optimise(POINTS, LIMITS, weights=[1.0, 1.0]), "three numbers"),
        (lambda: tj.optimise(POINTS, LIMITS, weights=[0.0, 0.0, 0.0]), "not all zero"),
        (lambda: tj.optimise(POINTS, LIMITS, freedom=-1.0), "freedom is -1"),
        (lambda: tj.optimise(POINTS, LIMITS, freedom=[1.0, 2.0]), "freedom has shape"),
        (lambda: tj.pareto(POINTS, LIMITS, count=-1), "count is -1"),
        (lambda: tj.plot_pareto([]), "the front is empty"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
