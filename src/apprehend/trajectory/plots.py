"""Pictures of motions and of compromises (needs matplotlib, the extra ``plot``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import InputError, MissingDependencyError
from .limits import _ORDERS, Limits
from .motion import Trajectory
from .optimise import Compromise

_UNITS = ("rad or m", "1/s", "1/s²", "1/s³")


def plot(
    motion: Trajectory,
    limits: Limits | Any | None = None,
    *,
    names: Sequence[str] | None = None,
    relative: bool = False,
    count: int = 1000,
) -> Any:
    """Position, velocity, acceleration and jerk over time, one line per coordinate, with the limits dashed.

    With *relative* every coordinate is drawn as a share of its limit, so that all share the dashed lines at ±1 (rows
    without limits are left as they are). Returns the matplotlib figure.
    """
    samples = motion.sample(count=count)
    rows = (samples.position, samples.velocity, samples.acceleration, samples.jerk)
    if names is not None and len(names) != motion.n:
        raise InputError(f"names has {len(names)} entries; expected {motion.n}")
    labels = list(names) if names is not None else [f"q{j + 1}" for j in range(motion.n)]
    figure = _figure(8.0, 9.0)
    axes = figure.subplots(4, 1, sharex=True)
    limits = Limits.read(limits) if limits is not None else Limits()
    for axis, values, name, unit in zip(axes, rows, _ORDERS, _UNITS):
        pairs = limits.pairs(name, motion.n)
        shares = relative and name != "position" and bool(np.isfinite(pairs).all())
        for j in range(motion.n):
            y = values[:, j] / np.where(values[:, j] > 0.0, pairs[j, 1], -pairs[j, 0]) if shares else values[:, j]
            (line,) = axis.plot(samples.t, y, label=labels[j], linewidth=1.2)
            for bound in () if shares else pairs[j][np.isfinite(pairs[j])]:
                axis.axhline(bound, color=line.get_color(), linestyle="--", linewidth=0.6)
        if shares:
            for bound in (-1.0, 1.0):
                axis.axhline(bound, color="0.3", linestyle="--", linewidth=0.8)
        axis.set_ylabel(f"{name} / limit" if shares else f"{name} ({unit})")
        axis.grid(visible=True, linewidth=0.3)
    axes[-1].set_xlabel("t (s)")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", fontsize="small", ncols=min(motion.n, 5))
    return figure


def plot_pareto(front: Sequence[Compromise]) -> Any:
    """Length against bending energy, coloured by motion time, one point per compromise. Returns the figure."""
    if not front:
        raise InputError("the front is empty; make one with pareto(waypoints, limits)")
    figure = _figure(6.5, 4.5)
    axis = figure.subplots()
    factors = np.array([c.factors for c in front])
    drawn = axis.scatter(factors[:, 0], factors[:, 1], c=factors[:, 2], cmap="viridis", s=50)
    # the best in each factor is named; what is far apart is drawn to a logarithmic scale
    best: dict[int, list[str]] = {}
    for k, name in enumerate(("shortest", "smoothest", "fastest")):
        best.setdefault(int(factors[:, k].argmin()), []).append(name)
    for i, names in best.items():
        left = factors[i, 0] < factors[:, 0].mean()
        axis.annotate(
            f"{', '.join(names)}: {factors[i, 2]:.2f} s", factors[i, :2], fontsize="small",
            textcoords="offset points", xytext=(8 if left else -8, -3), ha="left" if left else "right",
        )  # fmt: skip
    for values, scale in ((factors[:, 0], axis.set_xscale), (factors[:, 1], axis.set_yscale)):
        if values.min() > 0.0 and values.max() > 10.0 * values.min():
            scale("log")
    figure.colorbar(drawn, label="motion time (s)")
    axis.set_xlabel("arc length")
    axis.set_ylabel("bending energy")
    axis.grid(visible=True, linewidth=0.3)
    return figure


def _figure(width: float, height: float) -> Any:
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError("plots need matplotlib: pip install 'apprehend[plot]'") from error
    return Figure(figsize=(width, height), layout="constrained")
