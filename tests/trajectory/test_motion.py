"""`Trajectory`: sampling, concatenation, retiming, and proven limits."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import trajectory as tj
from apprehend.errors import InputError, UnsuccessfulError


def test_concatenation_keeps_every_piece() -> None:
    a, b = tj.cubic([0.0, 1.0], [1.0, 0.0], 1.0), tj.quintic([1.0, 0.0], [3.0, 1.0], 2.0)
    whole = a.then(tj.pause(a.end, 0.5), b)
    assert whole.duration == pytest.approx(3.5)
    np.testing.assert_allclose(whole([0.5, 1.2, 2.5]), [a(0.5), a.end, b(1.0)], atol=1e-12)
    assert whole.continuity() == 1


def test_stretching_and_reversing() -> None:
    motion = tj.time_optimal(
        tj.Spline(np.random.default_rng(0).normal(size=(5, 3))), tj.Limits(velocity=1.0, acceleration=1.0)
    ).motion
    t = np.linspace(0.0, motion.duration, 30)
    slow = motion.stretched(2.5)
    np.testing.assert_allclose(slow(2.5 * t), motion(t), atol=1e-9)
    np.testing.assert_allclose(slow(2.5 * t, 1), motion(t, 1) / 2.5, atol=1e-7)
    back = motion.reversed()
    np.testing.assert_allclose(back(t), motion(motion.duration - t), atol=1e-9)
    inner = t[1:-1]
    np.testing.assert_allclose(back(inner, 1), -motion(motion.duration - inner, 1), atol=1e-7)


def test_sampling() -> None:
    motion = tj.cubic(0.0, 1.0, 1.0)
    s = motion.sample(dt=0.3)
    np.testing.assert_allclose(s.t, [0.0, 0.3, 0.6, 0.9, 1.0])
    assert s.position.shape == s.jerk.shape == (5, 1)
    assert motion.sample(dt=0.25).t.size == 5
    assert motion.sample(count=7).t.size == 7
    np.testing.assert_allclose(motion.select([0])(0.3), motion(0.3))


def test_check_names_the_worst_place() -> None:
    motion = tj.cubic([0.0, 0.0], [1.0, 2.0], 1.0)  # largest speed 1.5 Δ at the middle, largest acceleration 6 Δ
    ok = motion.check({"velocity": [1.5, 3.0], "acceleration": [6.0, 12.0]})
    assert ok.success
    assert "proves" in ok.explain()
    bad = motion.check(tj.Limits(velocity=[1.5, 2.0]))
    assert bad.violation == pytest.approx(0.5)
    assert bad.time == pytest.approx(0.5, abs=1e-6)
    assert bad.coordinate == 1
    with pytest.raises(UnsuccessfulError, match=r"velocity of coordinate 1 is 3 at t = 0\.5 s; the limit is 2"):
        bad.require_success()
    assert motion.check(tj.Limits(position=[[-1.0, 1.0], [-1.0, 1.0]])).limit == "position"


def test_limits_of_a_robot_like_object() -> None:
    class RobotLimits:
        lower, upper = np.array([-1.0]), np.array([2.0])
        velocity, acceleration = np.array([1.0]), np.array([np.inf])

    limits = tj.Limits.read(RobotLimits())
    np.testing.assert_array_equal(limits.pairs("position", 1), [[-1.0, 2.0]])
    np.testing.assert_array_equal(limits.pairs("velocity", 1), [[-1.0, 1.0]])
    with pytest.raises(InputError, match="needs a finite acceleration limit"):
        tj.time_optimal(tj.polyline([[0.0], [1.0]]), RobotLimits())


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.concatenate([]), "at least one motion"),
        (lambda: tj.cubic(0.0, 1.0, 1.0).then(tj.cubic(2.0, 3.0, 1.0)), "starts with position 2 in coordinate 0"),
        (lambda: tj.cubic(0.0, 1.0, 1.0).then(tj.cubic(1.0, 3.0, 1.0, v0=1.0)), "starts with velocity 1"),
        (lambda: tj.cubic(0.0, 1.0, 1.0).then(tj.cubic([1.0, 1.0], [3.0, 1.0], 1.0)), "motion 0 has 1 coordinates"),
        (lambda: tj.cubic(0.0, 1.0, 1.0).stretched(0.0), "factor is 0.0"),
        (lambda: tj.cubic(0.0, 1.0, 1.0).sample(), "either dt"),
        (lambda: tj.cubic(0.0, 1.0, 1.0).sample(dt=0.0), "dt is 0.0"),
        (lambda: tj.cubic(0.0, 1.0, 1.0).sample(count=1), "count is 1"),
        (lambda: tj.cubic(0.0, 1.0, 1.0)(1.1), r"t = 1.1 lies outside \[0, 1\]"),
        (lambda: tj.cubic(0.0, 1.0, 1.0).check(tj.Limits(velocity=np.inf)), "nothing to check"),
        (lambda: tj.cubic(0.0, 1.0, 1.0).check(tj.Limits(position=[1.0])), r"limits.position has shape \(1,\)"),
        (lambda: tj.pause(0.0, 0.0), "duration is 0.0"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
