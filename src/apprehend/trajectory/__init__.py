"""Trajectories: paths, their timing, and motions whose limits are proven (T)."""

from .blends import blend, blend_through
from .constraints import CartesianAcceleration, CartesianSpeed, Constraint, PowerLimits, Rows, TorqueLimits
from .deviation import LineResult, LineStatus, along, arc, screw_line, straight_line, tool_frame
from .export import joint_trajectory, read_json, read_waypoints, to_csv, to_json, to_ros
from .follow import follow, rounded, smoothed, through_samples
from .geometry import NaturalPath, arc_length, bending_energy, curvature, tangent, torsion
from .jerk import jerk_limited, state_to_state
from .limits import LimitReport, Limits, LimitStatus
from .many import Timings, time_optimal_many
from .motion import Samples, Trajectory, concatenate, pause
from .optimise import Compromise, nondominated, optimise, pareto
from .path import Path, PolynomialPath, as_polynomial, polyline
from .pick import pick_and_place
from .piecewise import Extrema, Piecewise
from .plots import plot, plot_pareto
from .polynomials import cubic, minimum_jerk, quintic, septic, squared_integral
from .poses import Arc, Helix, Line, PosePath, PoseSpline, ScrewLine
from .spline import BSpline, Spline
from .timing import Timing, TimingStatus, time_optimal
from .via import cartesian_velocities, through, via_velocities

__all__ = [
    "Arc",
    "BSpline",
    "CartesianAcceleration",
    "CartesianSpeed",
    "Compromise",
    "Constraint",
    "Extrema",
    "Helix",
    "LimitReport",
    "LimitStatus",
    "Limits",
    "Line",
    "LineResult",
    "LineStatus",
    "NaturalPath",
    "Path",
    "Piecewise",
    "PolynomialPath",
    "PosePath",
    "PoseSpline",
    "PowerLimits",
    "Rows",
    "Samples",
    "ScrewLine",
    "Spline",
    "Timing",
    "TimingStatus",
    "Timings",
    "TorqueLimits",
    "Trajectory",
    "along",
    "arc",
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
    "joint_trajectory",
    "minimum_jerk",
    "nondominated",
    "optimise",
    "pareto",
    "pause",
    "pick_and_place",
    "plot",
    "plot_pareto",
    "polyline",
    "quintic",
    "read_json",
    "read_waypoints",
    "rounded",
    "screw_line",
    "septic",
    "smoothed",
    "squared_integral",
    "state_to_state",
    "straight_line",
    "tangent",
    "through",
    "through_samples",
    "time_optimal",
    "time_optimal_many",
    "to_csv",
    "to_json",
    "to_ros",
    "tool_frame",
    "torsion",
    "via_velocities",
]
