"""Linear motion with parabolic blends: closed forms, signs, feasibility bounds."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import trajectory as tj
from apprehend.errors import InputError
from tests.support import reference


def test_reference_blends() -> None:
    cases = [c for c in reference("traj_polynomial_splines.json")["cases"] if c["id"].startswith("lspb/")]
    assert len(cases) > 5
    for case in cases:
        g, e = case["inputs"], case["expected"]
        if "feasible" in e:
            with pytest.raises(InputError, match=f"at least {e['minimum_acceleration']:g}"):
                tj.blend(g["q0"], g["q1"], g["T"], acceleration=g["a"])
            continue
        if g["given"] == "T,V":
            motions = [
                tj.blend(g["q0"], g["q1"], g["T"], velocity=abs(g["V"])),
                tj.blend(g["q0"], g["q1"], g["T"], acceleration=abs(g["a"])),
            ]
        else:
            motions = [tj.blend(g["q0"], g["q1"], velocity=g["vmax"], acceleration=g["amax"])]
        for motion in motions:
            assert motion.duration == pytest.approx(e["duration"], abs=1e-12)
            t = np.minimum(e["t"], motion.duration)
            np.testing.assert_allclose(motion(t)[:, 0], e["q"], atol=1e-9)
            np.testing.assert_allclose(motion(t, 1)[:, 0], e["qd"], atol=1e-7)
            assert motion(0.0, 2)[0] == pytest.approx(e["acceleration"], rel=1e-7)


def test_blend_time_is_the_formula_of_the_script_with_the_sign_of_the_motion() -> None:
    for delta in (1.3, -1.3):
        a, T = 7.0, 1.1
        signed = np.sign(delta) * a
        t_b = T / 2 - np.sqrt(signed**2 * T**2 - 4 * signed * delta) / (2 * abs(signed))
        motion = tj.blend(0.2, 0.2 + delta, T, acceleration=a)
        assert motion.breaks[1] == pytest.approx(t_b, abs=1e-12)
        assert motion(T)[0] == pytest.approx(0.2 + delta, abs=1e-12)
        assert motion(0.0, 2)[0] == pytest.approx(signed)
        assert motion.continuity() == 1


def test_coordinates_have_their_own_blend_times_and_may_stand_still() -> None:
    motion = tj.blend([0.0, 1.0, 2.0], [1.0, -1.0, 2.0], 2.0, acceleration=[5.0, 4.0, 1.0])
    np.testing.assert_allclose(motion(2.0), [1.0, -1.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(motion.extrema(2).magnitude, [5.0, 4.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(motion(2.0, 1), 0.0, atol=1e-12)


def test_fastest_blend_is_a_straight_line_within_limits() -> None:
    q0, qf = np.array([0.0, 1.0, -2.0]), np.array([1.0, -1.0, -1.9])
    v, a = np.array([1.0, 0.8, 3.0]), np.array([2.0, 9.0, 1.0])
    motion = tj.blend(q0, qf, velocity=v, acceleration=a)
    assert motion.check(tj.Limits(velocity=v, acceleration=a)).success
    fraction = (motion.sample(count=50).position - q0) / (qf - q0)
    np.testing.assert_allclose(fraction, fraction[:, :1] * np.ones(3), atol=1e-12)
    used = max((motion.extrema(1).magnitude / v).max(), (motion.extrema(2).magnitude / a).max())
    assert used == pytest.approx(1.0, abs=1e-12)


def test_blends_through_via_points_are_the_textbook_example() -> None:
    # the well-known example: 10, 35, 25, 10 degrees in 2, 1, 3 s with 50 degrees/s²
    points = np.radians([[10.0], [35.0], [25.0], [10.0]])
    motion = tj.blend_through(points, [2.0, 1.0, 3.0], np.radians(50.0))
    t1 = 2.0 - np.sqrt(4.0 - 2.0 * 25.0 / 50.0)
    assert motion.breaks[1] == pytest.approx(t1, abs=1e-12)
    v12 = 25.0 / (2.0 - t1 / 2)
    assert np.degrees(motion(1.0, 1)[0]) == pytest.approx(v12, abs=1e-9)
    assert np.degrees(motion(2.5, 1)[0]) == pytest.approx(-10.0, abs=1e-9)
    np.testing.assert_allclose(np.degrees(motion.end), 10.0, atol=1e-9)
    np.testing.assert_allclose(motion(6.0, 1), 0.0, atol=1e-9)
    assert motion.continuity() == 1
    for case in reference("traj_polynomial_splines.json")["cases"]:
        if case["id"] == "lspb_via/craig_7.3":
            e = case["expected"]
            ends = np.cumsum([e["t1"], e["t12"], e["t2"], e["t23"], e["t3"], e["t34"], e["t4"]])
            np.testing.assert_allclose(motion.breaks[1:], ends, atol=1e-9)


def test_blends_through_many_points_in_many_coordinates() -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(6, 4))
    motion = tj.blend_through(points, np.full(5, 2.0), 20.0)
    np.testing.assert_allclose(motion.start, points[0], atol=1e-12)
    np.testing.assert_allclose(motion.end, points[-1], atol=1e-9)
    assert motion.continuity() == 1
    # the largest acceleration is the given one: every blend uses it in full
    np.testing.assert_allclose(motion.extrema(2).magnitude, 20.0, rtol=1e-6)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.blend(0.0, 1.0, 1.0), "exactly two of duration, velocity and acceleration"),
        (lambda: tj.blend(0.0, 1.0, 1.0, acceleration=3.9), r"acceleration\[0\] is 3.9; this motion needs at least 4"),
        (lambda: tj.blend(0.0, -1.0, 1.0, acceleration=3.9), "needs at least 4"),
        (lambda: tj.blend(0.0, 1.0, 1.0, velocity=0.9), "needs at least 1"),
        (lambda: tj.blend(0.0, 1.0, 1.0, velocity=2.1), "needs at most 2"),
        (lambda: tj.blend(0.0, 1.0, 1.0, velocity=1.0), "leaves no time to accelerate"),
        (lambda: tj.blend(0.0, 1.0, 1.0, acceleration=-8.0), "expected a positive magnitude"),
        (lambda: tj.blend(0.0, 1.0, -1.0, acceleration=8.0), "duration is -1.0"),
        (lambda: tj.blend(1.0, 1.0, velocity=1.0, acceleration=1.0), "q0 equals qf"),
        (lambda: tj.blend([1.0], [1.0, 2.0], 1.0, acceleration=1.0), "expected the same"),
        (lambda: tj.blend_through([[0.0], [1.0], [0.0]], [1.0, 1.0], 1.0), "needs at least 2"),
        (
            lambda: tj.blend_through([[0.0], [1.0], [0.0]], [1.0, 1.0], 2.5),
            r"blends of segment \d overlap in coordinate 0 by 0\.10557",
        ),
        (lambda: tj.blend_through([[0.0], [1.0], [0.0]], [1.0, 0.0], 9.0), r"durations\[1\] is 0"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
