"""Paths that are free of collision, with constraints where wanted, and straight lines of a tool."""

from .constraints import Inside, PathConstraint, Turned, Upright
from .keeping import Constraints
from .plan import plan
from .result import PlanResult, PlanStatus
from .search import shortcut
from .smoothing import smooth
from .straight import straight

__all__ = [
    "Constraints",
    "Inside",
    "PathConstraint",
    "PlanResult",
    "PlanStatus",
    "Turned",
    "Upright",
    "plan",
    "shortcut",
    "smooth",
    "straight",
]
