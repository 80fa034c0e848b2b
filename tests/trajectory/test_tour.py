"""What the README's users write: a timing is itself a motion."""

from __future__ import annotations

import numpy as np

from apprehend.trajectory import Limits, Spline, time_optimal


def test_a_timing_is_called_like_its_motion() -> None:
    path = Spline(np.cumsum(np.random.default_rng(0).normal(size=(5, 3)), axis=0))
    timing = time_optimal(path, Limits(velocity=1.0, acceleration=2.0))
    t = np.linspace(0.0, timing.duration, 7)
    for order in range(3):
        assert np.array_equal(timing(t, order), timing.motion(t, order))
