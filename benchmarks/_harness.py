"""Interleaved timing: every contender runs once per round, and medians over the rounds are compared.

Interleaving makes the noise of a shared machine hit all contenders alike; the median drops the outliers.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Timing:
    """Seconds per item: median and fastest of the rounds."""

    median: float
    fastest: float


def interleave(contenders: Mapping[str, tuple[Callable[[], object], int]], rounds: int = 7) -> dict[str, Timing]:
    """Time ``{name: (call, items per call)}``; every call runs once untimed first (compilation, caches)."""
    for call, _ in contenders.values():
        call()
    samples: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(rounds):
        for name, (call, items) in contenders.items():
            start = time.perf_counter()
            call()
            samples[name].append((time.perf_counter() - start) / items)
    return {name: Timing(statistics.median(s), min(s)) for name, s in samples.items()}


def seconds(value: float) -> str:
    """A duration with a readable unit."""
    for scale, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")):
        if value >= scale:
            return f"{value / scale:.3g} {unit}"
    return f"{value / 1e-9:.3g} ns"


def table(title: str, timings: Mapping[str, Timing], ours: str) -> None:
    """Print each contender's time per item and how many times slower than *ours* it is."""
    print(f"\n{title}")
    width = max(map(len, timings))
    for name, timing in timings.items():
        ratio = timing.median / timings[ours].median
        note = "" if name == ours else f"   {ratio:6.2f} × ours"
        print(f"  {name:<{width}}  {seconds(timing.median):>9}  (fastest {seconds(timing.fastest)}){note}")
