"""Trajectories: paths, their timing, and motions whose limits are proven (T)."""

from .blends import blend, blend_through
from .constraints import CartesianAcceleration, CartesianSpeed, Constraint, PowerLimits, Rows, TorqueLimits
from .follow import follow, rounded, smoothed, through_samples
from .geometry import NaturalPath, arc_length, bending_energy, curvature, tangent, torsion
from .jerk import jerk_limited, state_to_state
from .limits import LimitReport, Limits, LimitStatus
from .motion import Samples, Trajectory, concatenate, pause
from .path import Path, PolynomialPath, as_polynomial, polyline
from .piecewise import Extrema, Piecewise
from .polynomials import cubic, minimum_jerk, quintic, septic, squared_integral
from .spline import BSpline, Spline
from .timing import Timing, TimingStatus, time_optimal
from .via import cartesian_velocities, through, via_velocities

__all__ = [
    "BSpline",
    "CartesianAcceleration",
    "CartesianSpeed",
    "Constraint",
    "Extrema",
    "LimitReport",
    "LimitStatus",
    "Limits",
    "NaturalPath",
    "Path",
    "Piecewise",
    "PolynomialPath",
    "PowerLimits",
    "Rows",
    "Samples",
    "Spline",
    "Timing",
    "TimingStatus",
    "TorqueLimits",
    "Trajectory",
    "arc_length",
    "as_polynomial",
    "bending_energy",
    "blend",
    "blend_through",
    "cartesian_velocities",
    "concatenate",
    "cubic",
    "curvature",
    "follow",
    "jerk_limited",
    "minimum_jerk",
    "pause",
    "polyline",
    "quintic",
    "rounded",
    "septic",
    "smoothed",
    "squared_integral",
    "state_to_state",
    "tangent",
    "through",
    "through_samples",
    "time_optimal",
    "torsion",
    "via_velocities",
]
