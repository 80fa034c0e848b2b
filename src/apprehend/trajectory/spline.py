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

    @classmethod
    def through_knots(cls, points: Array, knots: Array) -> PolynomialPath:
        """The spline of *points* that may repeat, at given *knots*."""
        from scipy.interpolate import CubicSpline

        made = CubicSpline(knots, points, bc_type="not-a-knot")
        return PolynomialPath(knots, np.ascontiguousarray(np.transpose(made.c[::-1], (1, 0, 2))))


def chord_knots(points: Array, exponent: float = 1.0) -> Array:
    """Knots on [0, 1] whose spacing is the chord length to the power *exponent*."""
    if not 0.0 <= exponent <= 1.0:
        raise InputError(f"exponent is {exponent}; expected 0 (uniform) to 1 (chord length)")
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1) ** exponent
    knots = np.concatenate([[0.0], np.cumsum(steps)])
    result: Array = knots / knots[-1]
    result[-1] = 1.0
    return result


class BSpline(PolynomialPath):
    """A B-spline curve of *degree* d with control points ``(C, n)`` on a clamped knot vector ``(C + d + 1,)``.

    It is C^{d−1} and lies in the convex hull of its control points; it starts and ends at the first and last one.
    """

    def __init__(self, control: ArrayLike, degree: int = 3, knots: ArrayLike | None = None) -> None:
        from scipy.interpolate import BSpline as Curve

        points = as_array(control, "control")
        if points.ndim != 2 or not 1 <= degree < points.shape[0]:
            raise InputError(
                f"control has shape {points.shape} for degree {degree}; expected (C, n) with 1 ≤ degree < C"
            )
        count = points.shape[0]
        if knots is None:
            inner = np.linspace(0.0, 1.0, count - degree + 1)
            knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
        t = as_array(knots, "knots")
        if t.shape != (count + degree + 1,) or np.diff(t).min() < 0.0:
            raise InputError(f"knots must be {count + degree + 1} values that do not decrease; got shape {t.shape}")
        self.control, self.knots = points, t
        curve, breaks = Curve(t, points, degree), np.unique(t[degree : count + 1])
        scale = np.cumprod([1.0, *range(1, degree + 1)])
        pieces = np.stack([curve(breaks[:-1], nu=p) / scale[p] for p in range(degree + 1)], axis=1)
        super().__init__(breaks, pieces)

    @classmethod
    def through(
        cls, points: ArrayLike, degree: int = 3, parameters: ArrayLike | None = None, *, exponent: float = 1.0
    ) -> BSpline:
        """The B-spline that meets every one of *points* ``(M, n)``, M > degree (not-a-knot ends).

        *parameters* ``(M,)`` are s at the points, by default their chord lengths to the power *exponent*, on [0, 1].
        """
        from scipy.interpolate import make_interp_spline

        q = as_waypoints(points, "points")
        s = _parameters(q, parameters, exponent)
        if not 1 <= degree < q.shape[0]:
            raise InputError(
                f"degree is {degree}; expected at least 1 and less than the number of points, {q.shape[0]}"
            )
        if degree % 2 == 0:
            raise InputError(f"degree is {degree}; interpolation needs an odd degree (3, 5, 7)")
        made = make_interp_spline(s, q, k=degree)
        return cls(made.c, degree, made.t)

    @classmethod
    def near(cls, points: ArrayLike, count: int, degree: int = 3, parameters: ArrayLike | None = None) -> BSpline:
        """The least-squares B-spline with *count* control points near *points* ``(M, n)``, M ≥ count.

        It starts and ends at the first and last of them. Knots divide the parameters evenly (so that the
        Schoenberg–Whitney conditions hold).
        """
        from scipy.interpolate import BSpline as Curve

        q = as_waypoints(points, "points")
        s = _parameters(q, parameters, 1.0)
        if not degree < count <= q.shape[0]:
            raise InputError(
                f"count is {count}; expected more than the degree, {degree}, and at most the number of points, "
                f"{q.shape[0]}"
            )
        inner = np.interp(np.linspace(0.0, q.shape[0] - 1, count - degree + 1)[1:-1], np.arange(q.shape[0]), s)
        t = np.concatenate([np.full(degree + 1, s[0]), inner, np.full(degree + 1, s[-1])])
        basis = Curve.design_matrix(s, t, degree).toarray()
        control = np.zeros((count, q.shape[1]))
        control[0], control[-1] = q[0], q[-1]
        rest = q - basis[:, [0, -1]] @ control[[0, -1]]
        control[1:-1] = np.linalg.lstsq(basis[:, 1:-1], rest, rcond=None)[0]
        return cls(control, degree, t)


def _parameters(q: Array, parameters: ArrayLike | None, exponent: float) -> Array:
    if parameters is None:
        return chord_knots(q, exponent)
    s = as_array(parameters, "parameters")
    if s.shape != (q.shape[0],) or np.diff(s).min() <= 0.0:
        raise InputError(f"parameters must be {q.shape[0]} strictly increasing values; got shape {s.shape}")
    return s
