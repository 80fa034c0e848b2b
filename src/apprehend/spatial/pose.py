"""`Pose`: a frozen, batched homogeneous transform T_ab, whose frames are checked where they are named (G 1.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_pose
from . import se3
from ._value import Value, same_frame
from .rotation import Rotation

if TYPE_CHECKING:
    from .screw import Screw
    from .twist import Twist


class Pose(Value):
    """Transforms T_to_of ``(..., 4, 4)``: they map coordinates of frame *of* into frame *to*.

    The same matrix moves the cross of axes *to* onto *of* (G 1.1: change of coordinates, or motion). Frames may stay
    unnamed; where two names meet in a product they must be the same: ``T_ab @ T_bc``.
    """

    _tail: ClassVar[tuple[int, ...]] = (4, 4)
    __slots__ = ("of", "to")
    to: str
    of: str

    def __init__(self, matrix: ArrayLike | None = None, *, to: str = "", of: str = "") -> None:
        super().__init__(np.eye(4) if matrix is None else as_pose(matrix, "matrix"))
        object.__setattr__(self, "to", to)
        object.__setattr__(self, "of", of)

    def _like(self, array: Array) -> Self:
        return self._of(array, self.to, self.of)

    @classmethod
    def _of(cls, matrix: Array, to: str = "", of: str = "") -> Self:
        value = object.__new__(cls)
        Value.__init__(value, matrix)
        object.__setattr__(value, "to", to)
        object.__setattr__(value, "of", of)
        return value

    @classmethod
    def from_parts(
        cls,
        rotation: Rotation | ArrayLike | None = None,
        translation: ArrayLike | None = None,
        *,
        to: str = "",
        of: str = "",
    ) -> Self:
        """From a rotation and the origin of *of* in *to* ``(..., 3)``; absent parts are the identity."""
        R = rotation.matrix if isinstance(rotation, Rotation) else rotation
        return cls._of(se3.transform(R, translation), to, of)

    @classmethod
    def exp(cls, twist: Twist | ArrayLike) -> Self:
        """The motion ``e^ξ̂`` of twist coordinates ``(..., 6)`` (G 1.3)."""
        return cls._of(se3.exp(np.asarray(twist)))

    @property
    def matrix(self) -> Array:
        """The matrices ``(..., 4, 4)``, read-only."""
        return self._array

    @property
    def rotation(self) -> Rotation:
        """The rotation part."""
        return Rotation._of(self._array[..., :3, :3])

    @property
    def translation(self) -> Array:
        """Origin of *of* in *to*, ``(..., 3)``."""
        return self._array[..., :3, 3]

    def __matmul__(self, other: Pose) -> Self:
        if not isinstance(other, Pose):
            return NotImplemented
        same_frame(self.of, other.to, f"T_{self.to}_{self.of} @ T_{other.to}_{other.of}")
        return self._of(self._array @ other._array, self.to, other.of)

    def inverse(self) -> Self:
        """T_of_to."""
        return self._of(se3.inverse(self._array), self.of, self.to)

    def points(self, coordinates: ArrayLike) -> Array:
        """Coordinates ``(..., 3)`` of points in *of*, in *to* (or: the moved points)."""
        return se3.points(self._array, coordinates)

    def directions(self, coordinates: ArrayLike) -> Array:
        """Directions ``(..., 3)`` are turned and not moved."""
        return se3.directions(self._array, coordinates)

    def log(self) -> Twist:
        """The twist, of rotation angle ≤ π, whose exponential is this motion (G Satz 1.10)."""
        from .twist import Twist

        return Twist(se3.log(self._array), body=self.of, base=self.to, frame=self.to)

    def screw(self) -> Screw:
        """Chasles (G Satz 1.6): the screw axis about which, and along which, this motion goes; magnitude included."""
        return self.log().screw()

    def adjoint(self) -> Array:
        """``Ad_T (..., 6, 6)``: twist coordinates from *of* to *to*."""
        return se3.adjoint(self._array)

    def power(self, exponent: ArrayLike) -> Self:
        """``exp(t log T)``: the fraction t of the screw motion."""
        return self._like(se3.exp(as_array(exponent, "exponent")[..., None] * se3.log(self._array)))

    def interpolate(self, other: Pose, t: ArrayLike) -> Self:
        """By one screw motion from this pose (t = 0) to *other* (t = 1)."""
        same_frame(self.to, other.to, "interpolation between poses")
        return self._of(se3.interpolate(self._array, other._array, t), self.to, self.of)
