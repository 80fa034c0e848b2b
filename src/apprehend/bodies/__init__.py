"""Bodies: objects to be handled, from mesh files or generated, with mass, friction, rest poses, and their models."""

from .body import ASSUMED_DENSITY, ROUGHNESS, Body
from .deviation import Deviation
from .distance_field import DistanceField
from .household import HOUSEHOLD
from .index import MeshIndex, Nearest
from .load import FORMATS, UNITS
from .models import MODELS
from .outline import Outline
from .picture import draw, save_picture
from .primitives import Boxes, Capsules, ConvexPieces, Primitives, Spheres
from .rest import RestPose
from .surface_mesh import SurfaceMesh
from .voxels import Voxels
from .wireframe import Wireframe

__all__ = [
    "ASSUMED_DENSITY",
    "FORMATS",
    "HOUSEHOLD",
    "MODELS",
    "ROUGHNESS",
    "UNITS",
    "Body",
    "Boxes",
    "Capsules",
    "ConvexPieces",
    "Deviation",
    "DistanceField",
    "MeshIndex",
    "Nearest",
    "Outline",
    "Primitives",
    "RestPose",
    "Spheres",
    "SurfaceMesh",
    "Voxels",
    "Wireframe",
    "draw",
    "save_picture",
]
