"""`Rotation`: a frozen, batched rotation that speaks every representation (G 1.2)."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_shaped
from . import euler, quaternion, so3
from ._value import Value


class Rotation(Value):
    """Rotations of any batch shape, built by the ``from_…`` functions or from matrices ``(..., 3, 3)``.

    ``A @ B`` turns by B, then by A; batches broadcast. The value is frozen, and its arrays are read-only.
    """

    _tail: ClassVar[tuple[int, ...]] = (3, 3)
    __slots__ = ()

    def __init__(self, matrix: ArrayLike) -> None:
        super().__init__(so3.as_rotation(matrix))

    def _like(self, array: Array) -> Self:
        return type(self)._of(array)

    @classmethod
    def _of(cls, matrix: Array) -> Self:
        value = object.__new__(cls)
        Value.__init__(value, matrix)
        return value

    # making -----------------------------------------------------------------------------------------------------

    @classmethod
    def identity(cls, *shape: int) -> Self:
        """No rotation, in a batch of *shape*."""
        return cls._of(np.broadcast_to(np.eye(3), (*shape, 3, 3)))

    @classmethod
    def basic(cls, axis: str, angle: ArrayLike) -> Self:
        """Rotation by *angle* about ``"x"``, ``"y"`` or ``"z"`` (G 1.2.1)."""
        return cls._of(so3.basic(axis, angle))

    @classmethod
    def exp(cls, vector: ArrayLike) -> Self:
        """From exponential coordinates ``(..., 3)``: about the vector by its length in rad (G 1.2.5)."""
        return cls._of(so3.exp(vector))

    @classmethod
    def from_axis_angle(cls, axis: ArrayLike, angle: ArrayLike) -> Self:
        """By *angle* about *axis* ``(..., 3)`` of any length but zero (Rodrigues, G 1.2.2)."""
        return cls._of(so3.axis_angle(axis, angle))

    @classmethod
    def from_axis_angles(cls, phi: ArrayLike, psi: ArrayLike, angle: ArrayLike) -> Self:
        """By *angle* about the axis with the angles (φ, ψ): ``R_z(φ) R_y(ψ) R_x(θ) R_y(ψ)⁻¹ R_z(φ)⁻¹`` (G eq. 1.3)."""
        return cls._of(so3.axis_angle(so3.axis_of_angles(phi, psi), angle))

    @classmethod
    def from_euler(cls, angles: ArrayLike, axes: str, frame: str) -> Self:
        """From Euler angles ``(..., 3)`` about *axes* such as ``"zyx"``, *frame* ``"intrinsic"`` or ``"extrinsic"``."""
        return cls._of(euler.to_matrix(angles, axes, frame))

    @classmethod
    def from_rpy(cls, angles: ArrayLike) -> Self:
        """From roll, pitch, yaw about the fixed axes x, y, z, as URDF has them: ``R_z R_y R_x``."""
        return cls._of(euler.to_matrix(angles, "xyz", "extrinsic"))

    @classmethod
    def from_quaternion(cls, wxyz: ArrayLike) -> Self:
        """From quaternions ``(..., 4)``, w first, of any length but zero."""
        return cls._of(quaternion.to_matrix(wxyz))

    @classmethod
    def between(cls, first: ArrayLike, second: ArrayLike) -> Self:
        """The smallest rotation that turns the direction *first* ``(..., 3)`` into *second*.

        For opposite directions, half a turn about some axis perpendicular to them.
        """
        from ._batch import unit

        a, b = np.broadcast_arrays(
            unit(as_shaped(first, "first", 3), "first"), unit(as_shaped(second, "second", 3), "second")
        )
        cross = np.cross(a, b)
        s = np.linalg.norm(cross, axis=-1)
        angle = 2.0 * np.arctan2(np.linalg.norm(b - a, axis=-1), np.linalg.norm(b + a, axis=-1))
        other = np.cross(a, np.eye(3)[np.abs(a).argmin(axis=-1)])
        axis = np.where((s > 1e-12)[..., None], cross, other)
        return cls._of(so3.axis_angle(axis, angle))

    @classmethod
    def nearest(cls, matrix: ArrayLike) -> Self:
        """The rotation nearest to any *matrix* ``(..., 3, 3)``: to clean rounded or noisy ones."""
        return cls._of(so3.nearest(matrix))

    @classmethod
    def random(cls, rng: np.random.Generator, *shape: int) -> Self:
        """Uniformly distributed rotations."""
        return cls.from_quaternion(rng.normal(size=(*shape, 4)))

    # reading ----------------------------------------------------------------------------------------------------

    @property
    def matrix(self) -> Array:
        """The matrices ``(..., 3, 3)``, read-only."""
        return self._array

    def log(self) -> Array:
        """Exponential coordinates ``(..., 3)``, of length ≤ π."""
        return so3.log(self._array)

    def quaternion(self) -> Array:
        """Unit quaternions ``(..., 4)`` with w ≥ 0; their negatives are the same rotations."""
        return quaternion.from_matrix(self._array)

    def axis_angle(self) -> tuple[Array, Array]:
        """Unit axes ``(..., 3)`` and angles in [0, π]; no rotation has every axis, and x is given (G Satz 1.3)."""
        w = self.log()
        angle = np.linalg.norm(w, axis=-1)
        turned = angle > 0.0
        axis = np.where(turned[..., None], w / np.where(turned, angle, 1.0)[..., None], [1.0, 0.0, 0.0])
        return axis, angle

    def axis_angles(self) -> tuple[Array, Array, Array]:
        """(φ, ψ, θ) of G eq. 1.3; see `from_axis_angles`."""
        axis, angle = self.axis_angle()
        return (*so3.angles_of_axis(axis), angle)

    def euler(self, axes: str, frame: str) -> Array:
        """Euler angles ``(..., 3)``; at gimbal lock the first of the intrinsic order is 0 (see `euler.from_matrix`)."""
        return euler.from_matrix(self._array, axes, frame)

    def rpy(self) -> Array:
        """Roll, pitch, yaw ``(..., 3)`` as URDF has them."""
        return euler.from_matrix(self._array, "xyz", "extrinsic")

    # computing --------------------------------------------------------------------------------------------------

    def __matmul__(self, other: Rotation) -> Self:
        if not isinstance(other, Rotation):
            return NotImplemented
        return self._like(self._array @ other._array)

    def inverse(self) -> Self:
        """The rotation back: Rᵀ."""
        return self._like(np.swapaxes(self._array, -1, -2))

    def power(self, exponent: ArrayLike) -> Self:
        """``exp(t log R)``: the fraction t of the rotation, about the same axis."""
        return self._like(so3.exp(as_array(exponent, "exponent")[..., None] * self.log()))

    def apply(self, vector: ArrayLike) -> Array:
        """Rotated vectors ``(..., 3)``."""
        return np.asarray(np.einsum("...ij,...j->...i", self._array, as_shaped(vector, "vector", 3)))

    def slerp(self, other: Rotation, t: ArrayLike) -> Self:
        """On the short way from this rotation (t = 0) to *other* (t = 1) at constant angular velocity."""
        return self @ (self.inverse() @ other).power(t)

    def angle_to(self, other: Rotation) -> Array:
        """Angle in [0, π] between two rotations."""
        return so3.angle_between(self._array, other._array)

    def mean(self, weights: ArrayLike | None = None) -> Self:
        """The one rotation with the least weighted sum of squared matrix differences to all of the batch."""
        return self._like(so3.mean(self._array, weights))
