"""Polynomials between two states against exact rational solutions and their own laws."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apprehend import trajectory as tj
from apprehend.errors import InputError
from tests.support import reference


@pytest.mark.parametrize("degree", [3, 5, 7])
def test_reference_polynomials(degree: int) -> None:
    cases = [c for c in reference("traj_polynomial_splines.json")["cases"] if c["id"].startswith(f"poly{degree}/")]
    assert cases
    make = {3: tj.cubic, 5: tj.quintic, 7: tj.septic}[degree]
    for case in cases:
        given_, expected = case["inputs"], case["expected"]
        start, end = given_["start_derivatives"], given_["end_derivatives"]
        states = [x for pair in zip(start[1:], end[1:], strict=True) for x in pair]
        motion = make(start[0], end[0], given_["T"], *states)
        low_first = motion.coefficients[0, :, 0]
        np.testing.assert_allclose(low_first, expected["coefficients_low_to_high"], rtol=1e-9, atol=1e-9)
        for order, key in enumerate(("q", "qd", "qdd")):
            np.testing.assert_allclose(motion(expected["t"], order)[:, 0], expected[key], rtol=1e-9, atol=1e-8)
        jerk = tj.squared_integral(motion, 3)[0]
        assert jerk == pytest.approx(expected["jerk_squared_integral"], rel=1e-9)
        assert tj.squared_integral(motion, 2)[0] == pytest.approx(expected["bending_energy_accel_squared"], rel=1e-9)


def test_cubic_is_the_closed_form_of_the_script() -> None:
    rng = np.random.default_rng(0)
    q0, qf, v0, vf = rng.normal(size=(4, 5))
    T = 1.7
    motion = tj.cubic(q0, qf, T, v0, vf)
    d = qf - q0
    closed = [q0, v0, 3 * d / T**2 - 2 * v0 / T - vf / T, -2 * d / T**3 + (v0 + vf) / T**2]
    np.testing.assert_allclose(motion.coefficients[0], closed, rtol=0, atol=1e-12)


def test_quintic_is_the_closed_form() -> None:
    tau = np.linspace(0.0, 1.0, 17)
    closed = 10 * tau**3 - 15 * tau**4 + 6 * tau**5
    motion = tj.minimum_jerk([1.0], [3.0], 2.0)
    np.testing.assert_allclose(motion(2.0 * tau)[:, 0], 1.0 + 2.0 * closed, rtol=0, atol=1e-12)


vectors = st.lists(st.floats(-5, 5), min_size=3, max_size=3)


@settings(deadline=None, max_examples=40)
@given(vectors, vectors, vectors, vectors, vectors, vectors, st.floats(0.05, 20.0))
def test_quintic_meets_its_states(q0, qf, v0, vf, a0, af, T) -> None:
    motion = tj.quintic(q0, qf, T, v0, vf, a0, af)
    for order, (start, end) in enumerate(((q0, qf), (v0, vf), (a0, af))):
        size = 1.0 + float(motion.extrema(order).magnitude.max())
        np.testing.assert_allclose(motion(0.0, order), start, atol=1e-9 * size)
        np.testing.assert_allclose(motion(T, order), end, atol=1e-9 * size)


def test_minimum_jerk_beats_other_polynomials() -> None:
    best = tj.squared_integral(tj.minimum_jerk([0.0], [1.0], 1.0), 3)[0]
    assert best == pytest.approx(720.0)
    assert best < tj.squared_integral(tj.septic([0.0], [1.0], 1.0), 3)[0]


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.cubic(0.0, 1.0, 0.0), "duration is 0.0; expected a positive time"),
        (lambda: tj.cubic([0.0, 1.0], [1.0], 1.0), r"q0 has shape \(2,\) and qf \(1,\)"),
        (
            lambda: tj.cubic([0.0, 1.0], [1.0, 1.0], 1.0, v0=[1.0]),
            r"velocity at the start has shape|velocity has shape",
        ),
        (lambda: tj.cubic(np.nan, 1.0, 1.0), "every entry must be finite"),
        (lambda: tj.squared_integral(tj.cubic(0.0, 1.0, 1.0), -1), "order is -1"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
