"""Jerk-limited motion against ruckig's own runs and the closed double-S form."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import trajectory as tj
from apprehend.errors import InputError
from tests.support import reference

_SYNC = {"time": "time", "phase": "phase", "no": "none", "none": "none"}


def test_reference_states() -> None:
    seen = 0
    for case in reference("traj_ruckig.json")["cases"]:
        if not case["id"].startswith("ruckig_random"):
            continue
        g, e = case["inputs"], case["expected"]
        limits = tj.Limits(g["max_velocity"], g["max_acceleration"], g["max_jerk"])
        motion = tj.state_to_state(
            g["current_position"], g["target_position"], limits,
            v0=g["current_velocity"], vf=g["target_velocity"],
            a0=g["current_acceleration"], af=g["target_acceleration"],
            synchronization=_SYNC[g["synchronization"].lower()],
        )  # fmt: skip
        assert motion.duration == pytest.approx(e["duration"], abs=1e-9)
        assert motion.continuity(1e-7) >= 2
        t = np.minimum(e["samples_t"], motion.duration)
        samples = np.array(e["samples_pva"])
        for order in range(3):
            np.testing.assert_allclose(motion(t, order), samples[:, order], atol=1e-6)
        seen += 1
    assert seen > 10


def test_limits_are_proven() -> None:
    rng = np.random.default_rng(0)
    limits = tj.Limits(velocity=1.0, acceleration=2.0, jerk=9.0)
    for _ in range(5):
        motion = tj.state_to_state(rng.normal(size=4), rng.normal(size=4), limits, v0=rng.uniform(-0.5, 0.5, 4))
        assert motion.check(limits).success
    slow = tj.state_to_state(0.0, 1.0, limits, duration=9.0)
    assert slow.duration == pytest.approx(9.0)


def test_double_s_is_the_optimum_on_a_line() -> None:
    for case in reference("traj_ruckig.json")["cases"]:
        if case["id"].startswith("scurve"):
            g = case["inputs"]
            limits = tj.Limits(g["vmax"], g["amax"], g["jmax"])
            assert tj.state_to_state(0.0, g["distance"], limits).duration == pytest.approx(
                case["expected"]["duration"], rel=1e-9
            )
            along = tj.jerk_limited(tj.polyline([[0.0], [g["distance"]]]), limits)
            assert along.duration == pytest.approx(case["expected"]["duration"], rel=1e-9)


def test_straight_lines_in_many_coordinates_are_exact() -> None:
    rng = np.random.default_rng(2)
    q0, q1 = rng.normal(size=(2, 5))
    limits = tj.Limits(rng.uniform(0.5, 2.0, 5), rng.uniform(1.0, 4.0, 5), rng.uniform(5.0, 20.0, 5))
    line = tj.jerk_limited(tj.polyline([q0, 0.3 * q0 + 0.7 * q1, q1]), limits)
    assert line.check(limits).success
    assert line.duration == pytest.approx(tj.state_to_state(q0, q1, limits, synchronization="phase").duration, rel=1e-9)
    np.testing.assert_allclose(line([0.0, line.duration]), [q0, q1], atol=1e-12)
    # one that bends a little takes little longer: the search along curves is near the optimum there
    bent = tj.Spline([q0, 0.5 * (q0 + q1) + 1e-3, q1])
    assert tj.jerk_limited(bent, limits, trials=20).duration < 1.06 * line.duration


def test_a_line_driven_forth_and_back_is_no_straight_line() -> None:
    limits = tj.Limits(1.0, 2.0, 8.0)
    there = tj.Spline([[0.0], [1.5], [1.0]], [0.0, 1.0, 2.0])
    motion = tj.jerk_limited(there, limits, trials=10)
    assert motion.check(limits).success
    assert float(motion.extrema(0).upper[0]) > 1.4
    with pytest.raises(InputError, match="acceleration is infinite along the line"):
        tj.jerk_limited(tj.polyline([[0.0], [1.0]]), tj.Limits(velocity=1.0, jerk=1.0))


def test_jerk_limited_along_a_path() -> None:
    path = tj.Spline(np.random.default_rng(1).normal(size=(5, 3)))
    limits = tj.Limits(velocity=1.0, acceleration=3.0, jerk=15.0)
    motion = tj.jerk_limited(path, limits, trials=20)
    report = motion.check(limits)
    assert report.success, report.explain()
    assert motion.continuity(1e-6) >= 2
    np.testing.assert_allclose(motion([0.0, motion.duration]), path([0.0, 1.0]), atol=1e-9)
    assert motion.duration < 1.4 * tj.time_optimal(path, limits).duration
    # it stays on the path
    dense = path(np.linspace(0.0, 1.0, 40001))
    from scipy.spatial import cKDTree

    gap, _ = cKDTree(dense).query(motion.sample(count=200).position)
    assert gap.max() < 1e-3


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.state_to_state(0.0, 1.0, tj.Limits(1.0, 1.0)), "limits.jerk is not finite"),
        (lambda: tj.state_to_state(0.0, [1.0, 2.0], tj.Limits(1.0, 1.0, 1.0)), "expected the same"),
        (lambda: tj.state_to_state(0.0, 0.0, tj.Limits(1.0, 1.0, 1.0)), "same state"),
        (lambda: tj.state_to_state(0.0, 1.0, tj.Limits(1.0, 1.0, 1.0), vf=3.0), "cannot be joined"),
        (lambda: tj.state_to_state(0.0, 1.0, tj.Limits(1.0, 1.0, 1.0), v0=[1.0, 1.0]), "v0 has shape"),
        (lambda: tj.state_to_state(0.0, 1.0, tj.Limits(1.0, 1.0, [[-1.0, 2.0]])), "same in both directions"),
        (lambda: tj.state_to_state(0.0, 1.0, tj.Limits(1.0, 1.0, 1.0), synchronization="x"), "synchronization is 'x'"),
        (lambda: tj.jerk_limited(tj.polyline([[0.0], [1.0]]), tj.Limits(1.0, 1.0)), r"limits.jerk\[0\] is"),
        (lambda: tj.jerk_limited(tj.polyline(np.eye(2).tolist() + [[2, 2]]), tj.Limits(1.0, 1.0, 1.0)), "not C²"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
