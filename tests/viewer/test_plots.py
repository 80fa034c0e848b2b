"""Charts and words: round ticks, peaks kept, units as people use them."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from apprehend.viewer.plots import POINTS, Band, Chart, Line, legend, svg, thin, ticks
from apprehend.viewer.words import number, quantity, significant


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e4), st.integers(2, 8))
def test_ticks_are_round_and_inside(low: float, span: float, count: int) -> None:
    values = ticks(low, low + span, count)
    assert len(values) <= count + 1
    assert all(low - 1e-6 * span <= v <= low + span * (1 + 1e-6) for v in values)
    if len(values) > 2:
        step = np.diff(values)
        assert np.allclose(step, step[0])
        mantissa = step[0] / 10 ** np.floor(np.log10(step[0]) + 1e-12)
        assert min(abs(mantissa - m) for m in (1.0, 2.0, 2.5, 5.0, 10.0)) < 1e-6


def test_thinning_keeps_peaks() -> None:
    values = np.zeros(10_000)
    values[1234], values[7777] = 5.0, -3.0
    keep = thin(values)
    assert len(keep) <= 2 * POINTS + 2
    assert {0, 1234, 7777, 9999} <= set(keep)
    assert thin(np.arange(10.0)) == list(range(10))


def test_a_line_is_drawn_where_its_values_are() -> None:
    time = np.array([0.0, 1.0, 2.0])
    chart = Chart("speed <x>", "%", time, [Line("a", np.array([0.0, 50.0, 100.0]))], low=0.0, high=100.0)
    text = svg(chart, 200, 100)
    width, left, top, height = (
        float(re.search(f'data-{k}="([^"]+)"', text)[1]) for k in ("width", "left", "top", "height")
    )  # type: ignore[index]
    points = [tuple(map(float, p.split(","))) for p in re.search('points="([^"]+)"', text)[1].split()]  # type: ignore[index]
    expected = [(left, top + height), (left + width / 2, top + height / 2), (left + width, top)]
    assert np.allclose(points, expected, atol=0.06)
    assert "speed &lt;x&gt;" in text


def test_limits_are_drawn_where_they_are_in_view() -> None:
    chart = Chart("q", "°", np.arange(3.0), [Line("q", np.arange(3.0))], limits=((1.0, "near"), (99.0, "far")))
    text = svg(chart, 200, 100)
    assert "near" in text
    assert "far" not in text


def test_bands_are_named_where_there_is_room() -> None:
    chart = Chart(
        "q",
        "°",
        np.arange(11.0),
        [Line("q", np.arange(11.0))],
        bands=(Band(0, 9, "a long stretch"), Band(9, 9.1, "blink")),
    )
    text = svg(chart, 300, 100)
    assert "a long stretch" in text
    assert "blink" not in text
    assert text.count('class="band') == 3


def test_legend_groups_the_quiet_lines() -> None:
    lines = [Line("a", np.zeros(2), 0), Line("x", np.zeros(2), -1), Line("y", np.zeros(2), -1)]
    text = legend(Chart("t", "", np.arange(2.0), lines))
    assert ">a<" in text
    assert "2 joints of the hand" in text
    assert legend(Chart("t", "", np.arange(2.0), lines[:1])) == ""


def test_a_constant_has_a_range() -> None:
    assert "polyline" in svg(Chart("t", "", np.arange(3.0), [Line("a", np.full(3, 7.0))]), 200, 100)


@pytest.mark.parametrize(
    "value, digits, text",
    [
        (1.234, 2, "1.23"),
        (-1.0, 1, "−1.0"),
        (1e-5, 2, "< 0.01"),
        (0.0, 2, "0.00"),
        (float("inf"), 1, "∞"),
        (float("nan"), 1, "–"),
    ],
)
def test_numbers(value: float, digits: int, text: str) -> None:
    assert number(value, digits) == text


@pytest.mark.parametrize(
    "value, text", [(0.123456, "0.123"), (12345.6, "12346"), (3, "3"), (-2.0, "−2"), (1e-9, "< 0.001"), (0.0, "0")]
)
def test_significant_digits(value: float, text: str) -> None:
    assert significant(value) == text


@pytest.mark.parametrize(
    "name, value, text",
    [
        ("slip", 0.00037, "0.37 mm"), ("angle_error", np.pi, "180°"), ("forces", [1.0, 2.5], "1, 2.5 N"),
        ("tracking_error", 1e-4, "0.1 mrad"), ("pose", np.eye(4).tolist(), "at (0, 0, 0) m"),
        ("path", [[0.0] * 7] * 3, "3 × 7 numbers"), ("q", list(range(20)), "20 values"), ("upright", True, "yes"),
        ("rejected", {"too wide": 3}, "3 too wide"), ("robot", "ur5e", "ur5e"), ("coverage", 0.5, "0.5"),
        ("carried", -2.5e-5, "−2.50·10⁻⁵"),
    ],
)  # fmt: skip
def test_quantities(name: str, value: object, text: str) -> None:
    assert quantity(name, value) == text
