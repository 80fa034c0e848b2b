"""Trajectories: paths, their timing, and motions whose limits are proven (T)."""

from .blends import blend, blend_through
from .follow import follow, rounded, smoothed, through_samples
from .limits import LimitReport, Limits, LimitStatus
from .motion import Samples, Trajectory, concatenate, pause
from .path import Path, PolynomialPath, polyline
from .piecewise import Extrema, Piecewise
from .polynomials import cubic, minimum_jerk, quintic, septic, squared_integral
from .spline import Spline
from .timing import Timing, TimingStatus, time_optimal

__all__ = [
    "Extrema",
    "LimitReport",
    "LimitStatus",
    "Limits",
    "Path",
    "Piecewise",
    "PolynomialPath",
    "Samples",
    "Spline",
    "Timing",
    "TimingStatus",
    "Trajectory",
    "blend",
    "blend_through",
    "concatenate",
    "cubic",
    "follow",
    "minimum_jerk",
    "pause",
    "polyline",
    "quintic",
    "rounded",
    "septic",
    "smoothed",
    "squared_integral",
    "through_samples",
    "time_optimal",
]
