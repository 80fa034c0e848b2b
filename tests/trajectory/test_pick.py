"""Pick-and-place: the four conditions of the script, and limits that are proven."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import trajectory as tj
from apprehend.errors import InputError

POINTS = np.random.default_rng(0).normal(size=(4, 6))
H = np.array([0.4, 1.3, 0.5])


def test_four_conditions() -> None:
    rng = np.random.default_rng(1)
    v0, a0, vf, af = rng.normal(size=(4, 6))
    motion = tj.pick_and_place(POINTS, H, v0=v0, a0=a0, vf=vf, af=af)
    times = np.concatenate([[0.0], np.cumsum(H)])
    np.testing.assert_allclose(motion(times), POINTS, atol=1e-9)
    for order, start, end in ((1, v0, vf), (2, a0, af)):
        np.testing.assert_allclose(motion(0.0, order), start, atol=1e-8)
        np.testing.assert_allclose(motion(times[-1], order), end, atol=1e-8)
    assert motion.continuity(1e-7) == 2
    rest = tj.pick_and_place(POINTS, H)
    np.testing.assert_allclose(rest(times[[0, -1]], 1), 0.0, atol=1e-9)
    np.testing.assert_allclose(rest(times[[0, -1]], 2), 0.0, atol=1e-8)


def test_fastest_within_limits() -> None:
    limits = tj.Limits(velocity=1.5, acceleration=4.0, jerk=40.0)
    motion = tj.pick_and_place(POINTS, limits=limits)
    report = motion.check(limits)
    assert report.success
    np.testing.assert_allclose(motion(motion.breaks), POINTS, atol=1e-9)
    naive = tj.pick_and_place(POINTS, np.ones(3))
    shrink = max(
        (naive.extrema(order).magnitude.max() / bound) ** (1.0 / order)
        for order, bound in ((1, 1.5), (2, 4.0), (3, 40.0))
    )
    assert motion.duration < 3.0 * shrink


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.pick_and_place(POINTS[:3], H), "pick, lift-off, set-down, place"),
        (lambda: tj.pick_and_place(POINTS), "either durations"),
        (lambda: tj.pick_and_place(POINTS, H, limits=tj.Limits(1.0)), "either durations"),
        (lambda: tj.pick_and_place(POINTS, [1.0, 0.0, 1.0]), "three positive times"),
        (lambda: tj.pick_and_place(POINTS, limits=tj.Limits(1.0, 1.0), v0=1.0), "starts and ends at rest"),
        (lambda: tj.pick_and_place(POINTS[[0, 0, 1, 2]], limits=tj.Limits(1.0, 1.0)), "pick and lift-off coincide"),
        (lambda: tj.pick_and_place(POINTS, limits=tj.Limits(np.inf)), "no finite bound"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
