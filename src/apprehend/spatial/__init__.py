"""Space: rotations, poses, twists, wrenches and screws (G 1.1–1.6, 1.9).

Values are `Rotation`, `Pose`, `Twist`, `Wrench`, `Screw`; the modules `so3`, `quaternion`, `euler` and `se3` hold the
same as functions of arrays.
"""

from . import euler, quaternion, se3, so3
from .pose import Pose
from .rotation import Rotation
from .screw import Screw, reciprocal
from .twist import Twist, Wrench

__all__ = [
    "Pose",
    "Rotation",
    "Screw",
    "Twist",
    "Wrench",
    "euler",
    "quaternion",
    "reciprocal",
    "se3",
    "so3",
]
