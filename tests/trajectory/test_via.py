"""Velocities at via points, and B-splines."""

from __future__ import annotations

import numpy as np
import pytest

import apprehend as ap
from apprehend import trajectory as tj
from apprehend.errors import InputError

RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(6, 3))
TIMES = np.array([0.0, 0.7, 1.5, 1.9, 3.0, 4.2])


def test_continuous_acceleration() -> None:
    motion = tj.through(POINTS, TIMES, v0=[0.1, 0.2, 0.3], vf=[-1.0, 0.0, 1.0])
    assert motion.continuity() == 2
    np.testing.assert_allclose(motion(TIMES), POINTS, atol=1e-12)
    np.testing.assert_allclose(motion([0.0, 4.2], 1), [[0.1, 0.2, 0.3], [-1.0, 0.0, 1.0]], atol=1e-9)
    clamped = tj.Spline(POINTS, TIMES, ends="clamped")
    rest = tj.through(POINTS, TIMES)
    t = np.linspace(0.0, 4.2, 31)
    np.testing.assert_allclose(rest(t), clamped(t), atol=1e-9)


def test_heuristic_and_rest() -> None:
    v = tj.via_velocities(POINTS, TIMES, "heuristic")
    slope = np.diff(POINTS, axis=0) / np.diff(TIMES)[:, None]
    for k in range(1, 5):
        for j in range(3):
            same = slope[k - 1, j] * slope[k, j] > 0
            assert v[k, j] == pytest.approx(0.5 * (slope[k - 1, j] + slope[k, j]) if same else 0.0)
    # no overshoot where the sign changes
    motion = tj.through(POINTS, TIMES, "heuristic")
    assert motion.continuity() >= 1
    assert not tj.via_velocities(POINTS, TIMES, "rest").any()
    hand = tj.through(POINTS, TIMES, np.ones((6, 3)))
    np.testing.assert_allclose(hand(TIMES[:-1], 1), 1.0, atol=1e-9)


def test_velocities_from_cartesian_twists() -> None:
    robot = ap.Robot.load("ur5")
    frame = max(robot.frame_names, key=lambda f: len(robot.chain(f)))
    q = np.random.default_rng(3).uniform(-2.0, 2.0, size=(4, 6))
    twists = np.random.default_rng(4).normal(size=(4, 6)) * 0.1
    v = tj.cartesian_velocities(robot, frame, q, twists)
    made = np.einsum("mij,mj->mi", robot.jacobian(q, frame), v)
    np.testing.assert_allclose(made, twists, atol=1e-4)
    stretched = np.zeros((1, 6))
    with pytest.raises(InputError, match="the twist at point 0 cannot be made"):
        tj.cartesian_velocities(robot, frame, stretched, np.random.default_rng(5).normal(size=(1, 6)))


def test_b_splines_interpolate_and_approximate() -> None:
    for degree in (1, 3, 5):
        curve = tj.BSpline.through(POINTS, degree)
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(POINTS, axis=0), axis=1))])
        np.testing.assert_allclose(curve(s / s[-1]), POINTS, atol=1e-9)
        assert curve.continuity() >= degree - 1
    x = np.linspace(0.0, 3.0, 200)
    dense = np.stack([np.sin(x), np.cos(2 * x)], axis=1)
    errors = []
    for count in (6, 10, 20):
        curve = tj.BSpline.near(dense, count, parameters=x)
        assert curve.control.shape == (count, 2)
        np.testing.assert_allclose(curve([0.0, 3.0]), dense[[0, -1]], atol=1e-9)
        errors.append(np.abs(curve(x) - dense).max())
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-4


def test_b_spline_lies_in_the_hull_of_its_control_points() -> None:
    curve = tj.BSpline(POINTS, 3)
    found = curve.extrema()
    assert (found.upper <= POINTS.max(axis=0) + 1e-12).all()
    assert (found.lower >= POINTS.min(axis=0) - 1e-12).all()
    np.testing.assert_allclose(curve([0.0, 1.0]), POINTS[[0, -1]], atol=1e-12)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.through(POINTS, TIMES[:3]), r"times has shape \(3,\)"),
        (lambda: tj.through(POINTS, TIMES[::-1]), r"times\[\d\] = .* is followed by"),
        (lambda: tj.through(POINTS[0], TIMES), r"points has shape \(3,\)"),
        (lambda: tj.through(POINTS, TIMES, "fast"), "method is 'fast'"),
        (lambda: tj.through(POINTS, TIMES, np.zeros((6, 3)), v0=0.0), "leave them out"),
        (lambda: tj.through(POINTS, TIMES, v0=[1.0]), r"v0 has shape \(1,\)"),
        (lambda: tj.BSpline(POINTS, 6), "for degree 6"),
        (lambda: tj.BSpline(POINTS, 3, [0.0, 1.0]), "values that do not decrease"),
        (lambda: tj.BSpline.through(POINTS, 4), "odd degree"),
        (lambda: tj.BSpline.through(POINTS, 7), "degree is 7"),
        (lambda: tj.BSpline.near(POINTS, 7), "count is 7"),
        (lambda: tj.BSpline.near(POINTS, 5, parameters=[0.0]), "6 strictly increasing values"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
