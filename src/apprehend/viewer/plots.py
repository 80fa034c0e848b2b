"""Line charts as SVG for a page with its own style sheet: colours are CSS classes, so light and dark both work."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array

POINTS = 400
"""A line is thinned to about twice this number of points, peaks kept."""


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a chart; *shade* is the number of its colour, or −1 for a quiet grey."""

    label: str
    values: Array
    shade: int = 0


@dataclass(frozen=True)
class Band:
    """A stretch of time that is named above the chart."""

    start: float
    stop: float
    label: str


@dataclass(frozen=True, eq=False)
class Chart:
    """A chart over time; *limits* are drawn dashed, with their label, where they are in view."""

    title: str
    unit: str
    time: Array
    lines: Sequence[Line]
    limits: Sequence[tuple[float, str]] = ()
    bands: Sequence[Band] = ()
    low: float | None = None
    high: float | None = None
    digits: int = 1
    note: str = ""
    axis: str = "s"
    """The unit of *time*; along a path it is % of the length."""


def svg(chart: Chart, width: int, height: int, *, labels: bool = True, clock: bool = True) -> str:
    """The chart as an ``<svg>`` element of *width* × *height* units; it scales with the page.

    *labels* writes the bands' names; *clock* the time axis.
    """
    left, right, top, bottom = 46, 10, 18 if labels and chart.bands else 8, 30 if clock else 12
    inner_w, inner_h = width - left - right, height - top - bottom
    t0, t1 = float(chart.time[0]), max(float(chart.time[-1]), float(chart.time[0]) + 1e-9)
    low, high = _range(chart)

    def x(t: float) -> float:
        return left + inner_w * (t - t0) / (t1 - t0)

    def y(value: float) -> float:
        return top + inner_h * (1.0 - (value - low) / (high - low))

    out = [
        f'<svg class="chart" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{html.escape(chart.title, quote=True)}" data-left="{left}" data-width="{inner_w}" '
        f'data-top="{top}" data-height="{inner_h}" data-t0="{t0:.6g}" data-t1="{t1:.6g}">'
    ]
    for i, band in enumerate(chart.bands):
        a, b = x(max(band.start, t0)), x(min(band.stop, t1))
        if b <= a:
            continue
        out.append(f'<rect class="band{i % 2}" x="{a:.1f}" y="{top}" width="{b - a:.1f}" height="{inner_h}"/>')
        if labels and b - a > 6.2 * len(band.label):
            out.append(f'<text class="band" x="{(a + b) / 2:.1f}" y="{top - 5}">{html.escape(band.label)}</text>')
    for value in ticks(low, high, 4 if inner_h > 80 else 3):
        out.append(f'<line class="grid" x1="{left}" x2="{left + inner_w}" y1="{y(value):.1f}" y2="{y(value):.1f}"/>')
        out.append(f'<text class="y" x="{left - 6}" y="{y(value) + 3.5:.1f}">{_number(value)}</text>')
    if clock:
        for value in ticks(t0, t1, max(2, inner_w // 90)):
            out.append(f'<text class="x" x="{x(value):.1f}" y="{top + inner_h + 14}">{_number(value)}</text>')
        out.append(f'<text class="x unit" x="{left + inner_w}" y="{height - 3}">time in s</text>')
    for value, label in chart.limits:
        if low <= value <= high:
            at = y(value)
            out.append(f'<line class="limit" x1="{left}" x2="{left + inner_w}" y1="{at:.1f}" y2="{at:.1f}"/>')
            if label:
                above = at - 4 if at > top + 12 else at + 11
                out.append(f'<text class="limit" x="{left + inner_w - 3}" y="{above:.1f}">{html.escape(label)}</text>')
    for line in chart.lines:
        keep = thin(line.values)
        points = " ".join(f"{x(float(chart.time[i])):.1f},{y(float(line.values[i])):.1f}" for i in keep)
        name = f"s{line.shade}" if line.shade >= 0 else "quiet"
        out.append(f'<polyline class="line {name}" points="{points}"/>')
    out.append(f'<line class="cursor" x1="0" x2="0" y1="{top}" y2="{top + inner_h}" visibility="hidden"/></svg>')
    return "".join(out)


def legend(chart: Chart) -> str:
    """The names of the lines with their colours; quiet ones share one entry."""
    entries = [
        f'<span class="key s{line.shade}">{html.escape(line.label)}</span>' for line in chart.lines if line.shade >= 0
    ]
    quiet = [line.label for line in chart.lines if line.shade < 0]
    if quiet:
        text = quiet[0] if len(quiet) == 1 else f"{len(quiet)} joints of the hand"
        entries.append(f'<span class="key quiet">{html.escape(text)}</span>')
    return f'<p class="legend">{"".join(entries)}</p>' if len(chart.lines) > 1 else ""


def _range(chart: Chart) -> tuple[float, float]:
    values = np.concatenate([line.values for line in chart.lines])
    low = float(values.min()) if chart.low is None else chart.low
    high = float(values.max()) if chart.high is None else chart.high
    if high - low < 1e-9:
        low, high = low - 0.5, high + 0.5
    pad = 0.06 * (high - low)
    return (low - pad if chart.low is None else low), (high + pad if chart.high is None else high)


def ticks(low: float, high: float, count: int) -> list[float]:
    """About *count* round numbers in [low, high]."""
    raw = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if power * m >= raw * 0.999)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [i * step for i in range(first, last + 1)]


def thin(values: Array) -> list[int]:
    """Indices that draw the same line: first, last, and both extremes of each of `POINTS` stretches."""
    n = len(values)
    if n <= 2 * POINTS:
        return list(range(n))
    keep = {0, n - 1}
    edges = np.linspace(0, n, POINTS + 1).astype(int)
    for a, b in zip(edges[:-1], edges[1:]):
        keep.update((a + int(values[a:b].argmin()), a + int(values[a:b].argmax())))
    return sorted(keep)


def _number(value: float) -> str:
    text = f"{value:.6g}"
    return "0" if text in ("-0", "0") else text.replace("-", "−")
