"""From a collision-free polyline to a motion: stop at the corners, or round them within a proven deviation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array
from ..errors import InputError
from .blends import straight
from .limits import Limits
from .motion import Trajectory, concatenate
from .path import PolynomialPath, as_waypoints, polyline
from .timing import time_optimal

CORNER = 3.5 / 32.0
"""Deviation of the rounded corner from the polyline, in units of ``r |d2 − d1|`` (see `rounded`)."""


def rounded(points: ArrayLike, deviation: float) -> PolynomialPath:
    """The polyline through *points* ``(M, n)`` with every corner replaced by a C² quintic, s in units of length.

    The corner p between unit directions d1 and d2 becomes the Bézier curve with the control points
    ``p − r d1, p − r d1/2, p, p, p + r d2/2, p + r d2``, which leaves and joins the segments with their tangent and
    without curvature. Any of its points is ``p − α r d1 + β r d2`` with ``min(α, β) ≤ 3.5/32``, so its distance
    from the polyline is at most ``r |d2 − d1| 3.5/32``: r is the largest for which this is at most *deviation*, and
    at most half of each neighbouring segment. The first and the last point are met exactly.
    """
    if not (np.isfinite(deviation) and deviation > 0.0):
        raise InputError(f"deviation is {deviation}; expected a positive distance in joint space (0: use polyline)")
    q = as_waypoints(points)
    steps = np.diff(q, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    d = steps / lengths[:, None]
    bend = np.linalg.norm(np.diff(d, axis=0), axis=1)
    straight_on = bend < 1e-9
    with np.errstate(divide="ignore"):
        r = np.minimum(deviation / (CORNER * bend), 0.5 * np.minimum(lengths[:-1], lengths[1:]))
    # a full half-segment leaves nothing of the segment itself: keep the corners apart by a hair of it
    r = np.where(straight_on, 0.0, np.minimum(r, 0.499 * np.minimum(lengths[:-1], lengths[1:])))
    trim = np.concatenate([[0.0], r, [0.0]])
    pieces, widths = [], []
    for k in range(steps.shape[0]):
        line = np.zeros((6, q.shape[1]))
        line[0], line[1] = q[k] + trim[k] * d[k], d[k]
        pieces.append(line)
        widths.append(lengths[k] - trim[k] - trim[k + 1])
        if k + 1 < steps.shape[0] and r[k] > 0.0:
            pieces.append(_corner(q[k + 1], d[k], d[k + 1], float(r[k])))
            widths.append(2.5 * r[k])
    return PolynomialPath(np.concatenate([[0.0], np.cumsum(widths)]), np.array(pieces))


def _corner(p: Array, d1: Array, d2: Array, r: float) -> Array:
    """Power coefficients of the rounding over a parameter length of 5r/2 (unit speed at both ends)."""
    control = np.stack([p - r * d1, p - 0.5 * r * d1, p, p, p + 0.5 * r * d2, p + r * d2])
    out = np.empty_like(control)
    difference, binomial = control.copy(), 1.0
    for k in range(6):
        out[k] = binomial * difference[0] / (2.5 * r) ** k
        difference = np.diff(difference, axis=0)
        binomial *= (5 - k) / (k + 1)
    return out


def follow(points: ArrayLike, limits: Limits | Any, *, deviation: float = 0.0, grid: int = 200) -> Trajectory:
    """A motion from rest to rest along straight joint-space segments through *points* ``(M, n)``.

    With ``deviation = 0`` it stays exactly on the polyline, in the fastest way that rests at every corner (linear with
    parabolic blends, all coordinates in step); corners that go straight on are no corners. With ``deviation > 0`` the
    corners are rounded (`rounded`), at most that far (Euclidean, joint space) from the polyline, and the whole is timed
    by `time_optimal` without stopping. Velocity and acceleration limits hold at all times.
    """
    limits = Limits.read(limits)
    if deviation > 0.0:
        return time_optimal(rounded(points, deviation), limits, grid=grid, least=16).require_success().motion
    if deviation != 0.0:
        raise InputError(f"deviation is {deviation}; expected 0 (exactly on the polyline) or a positive distance")
    q = _corners(as_waypoints(points))
    vlim, alim = limits.pairs("velocity", q.shape[1]), limits.pairs("acceleration", q.shape[1])
    parts = []
    for a, b in zip(q[:-1], q[1:]):
        step = b - a
        speed, up, down = _along(step, vlim), _along(step, alim), _along(-step, alim)
        if not np.isfinite(up * down):
            raise InputError("limits.acceleration is infinite along a segment; a motion from rest needs a finite one")
        parts.append(straight(a, b, speed, up, down))
    return concatenate(parts)


def _along(step: Array, pairs: Array) -> float:
    """Largest multiple of *step* within symmetric or two-sided *pairs* ``(n, 2)``."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(step > 0.0, pairs[:, 1] / step, np.where(step < 0.0, pairs[:, 0] / step, np.inf))
    return float(ratio.min())


def _corners(q: Array) -> Array:
    """The points of the polyline without those on the straight between their neighbours."""
    d = np.diff(q, axis=0)
    d /= np.linalg.norm(d, axis=1)[:, None]
    keep = np.concatenate([[True], np.linalg.norm(np.diff(d, axis=0), axis=1) > 1e-9, [True]])
    kept: Array = q[keep]
    return kept


def through_samples(
    samples: ArrayLike, limits: Limits | Any, *, deviation: float = 1e-4, grid: int = 400
) -> Trajectory:
    """A smooth motion along dense joint *samples* ``(M, n)``, such as those of a Cartesian line solved by IK.

    A cubic spline is laid through as few of the samples as keep all others within *deviation* (Euclidean, joint
    space), and timed by `time_optimal`: velocity and acceleration limits hold at all times.
    """
    return time_optimal(smoothed(samples, deviation), limits, grid=grid).require_success().motion


def smoothed(samples: ArrayLike, deviation: float) -> PolynomialPath:
    """The C² cubic spline through few of the dense *samples* that passes all others within *deviation*.

    Knots are inserted at the worst sample until every sample is met within *deviation*; the parameter is the length of
    the polyline through all samples.
    """
    from scipy.interpolate import CubicSpline

    if not (np.isfinite(deviation) and deviation > 0.0):
        raise InputError(f"deviation is {deviation}; expected a positive distance in joint space")
    q = as_waypoints(samples, "samples")
    if q.shape[0] < 3:
        return polyline(q)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    chosen = [0, q.shape[0] - 1]
    while True:
        spline = CubicSpline(s[chosen], q[chosen], bc_type="not-a-knot")
        error = np.linalg.norm(spline(s) - q, axis=1)
        if error.max() <= deviation or len(chosen) == s.size:
            return PolynomialPath(s[chosen], np.ascontiguousarray(np.transpose(spline.c[::-1], (1, 0, 2))))
        worst = [a + 1 + int(error[a + 1 : b].argmax()) for a, b in zip(chosen[:-1], chosen[1:]) if b > a + 1]
        chosen = sorted({*chosen, *(k for k in worst if error[k] > deviation)})
