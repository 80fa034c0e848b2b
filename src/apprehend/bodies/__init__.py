"""Bodies: objects to be handled, from mesh files or generated, with mass, friction, rest poses and convex pieces."""

from .body import ASSUMED_DENSITY, ROUGHNESS, Body
from .distance_field import DistanceField
from .household import HOUSEHOLD
from .index import MeshIndex, Nearest
from .load import FORMATS, UNITS
from .rest import RestPose

__all__ = [
    "ASSUMED_DENSITY",
    "FORMATS",
    "HOUSEHOLD",
    "ROUGHNESS",
    "UNITS",
    "Body",
    "DistanceField",
    "MeshIndex",
    "Nearest",
    "RestPose",
]
