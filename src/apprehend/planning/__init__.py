"""Paths that are free of collision, and straight lines of a tool."""

from .plan import plan, shortcut
from .result import PlanResult, PlanStatus
from .straight import straight

__all__ = ["PlanResult", "PlanStatus", "plan", "shortcut", "straight"]
