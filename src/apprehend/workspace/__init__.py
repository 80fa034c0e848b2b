"""Maps of what a robot reaches, and how well it moves there (K)."""

from .map import ReachabilityMap
from .placements import BasePlacements, PlacementStatus

__all__ = ["BasePlacements", "PlacementStatus", "ReachabilityMap"]
