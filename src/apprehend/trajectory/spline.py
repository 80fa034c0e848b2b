"""Splines through joint waypoints (T, piecewise polynomials)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, choice
from ..errors import InputError
from .path import PolynomialPath, as_waypoints

_ENDS = ("not-a-knot", "natural", "clamped", "periodic")


class Spline(PolynomialPath):
    """The C² cubic spline through *waypoints* ``(M, n)``.

    Parameters
    ----------
    waypoints
        ``(M, n)``, M ≥ 2.
    knots
        s of every waypoint, strictly increasing ``(M,)``; by default the chord lengths, raised to *exponent*
        (1: chord length; ½: centripetal, which avoids loops near short chords) and scaled to [0, 1].
    ends
        ``"not-a-knot"``, ``"natural"`` (no curvature), ``"clamped"`` (zero derivative) or ``"periodic"``.
    """

    def __init__(
        self, waypoints: ArrayLike, knots: ArrayLike | None = None, *, ends: str = "not-a-knot", exponent: float = 1.0
    ) -> None:
        from scipy.interpolate import CubicSpline

        choice(ends, "ends", _ENDS)
        points = as_waypoints(waypoints, "waypoints")
        given = as_array(waypoints, "waypoints").shape[0]
        if knots is None:
            knots = chord_knots(points, exponent)
        else:
            knots = as_array(knots, "knots")
            if knots.shape != (given,) or given != points.shape[0]:
                points = as_array(waypoints, "waypoints")
            if knots.shape != (given,):
                raise InputError(f"knots has shape {knots.shape}; expected ({given},), one per waypoint")
            if np.diff(knots).min() <= 0.0:
                k = int(np.diff(knots).argmin())
                raise InputError(f"knots must increase strictly; knots[{k}] = {knots[k]:.9g}, then {knots[k + 1]:.9g}")
        if ends == "periodic":
            if float(np.abs(points[0] - points[-1]).max()) > 1e-9:
                raise InputError(
                    "a periodic spline must end where it starts; repeat the first waypoint at the end of waypoints"
                )
            points = np.concatenate([points[:-1], points[:1]])
        self.waypoints = points
        self.knots = knots
        made = CubicSpline(knots, points, bc_type=ends)
        super().__init__(knots, np.ascontiguousarray(np.transpose(made.c[::-1], (1, 0, 2))))


def chord_knots(points: Array, exponent: float = 1.0) -> Array:
    """Knots on [0, 1] whose spacing is the chord length to the power *exponent*."""
    if not 0.0 <= exponent <= 1.0:
        raise InputError(f"exponent is {exponent}; expected 0 (uniform) to 1 (chord length)")
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1) ** exponent
    knots = np.concatenate([[0.0], np.cumsum(steps)])
    result: Array = knots / knots[-1]
    result[-1] = 1.0
    return result
