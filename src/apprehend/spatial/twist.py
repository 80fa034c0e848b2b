"""`Twist` and `Wrench`: velocities and forces of rigid bodies, their frames, and their power (G 1.6, 1.9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_pose, as_shaped
from . import se3
from ._value import Value, same_frame
from .pose import Pose
from .so3 import vee

if TYPE_CHECKING:
    from .screw import Screw


class Twist(Value):
    """Twist coordinates ``(v, ω) (..., 6)``: V_{base, body}^{frame} in the notation of the script.

    The motion of *body* relative to *base*, in coordinates of *frame*; v is the velocity of the point of the body that
    passes *frame*'s origin. With ``frame == base`` it is the spatial velocity, with ``frame == body`` the body
    velocity (G Def. 1.16). Names may stay empty; where given they are checked.
    """

    _tail: ClassVar[tuple[int, ...]] = (6,)
    __slots__ = ("base", "body", "frame")
    body: str
    base: str
    frame: str

    def __init__(self, coordinates: ArrayLike, *, body: str = "", base: str = "", frame: str = "") -> None:
        super().__init__(as_shaped(coordinates, "coordinates", 6))
        for name, value in (("body", body), ("base", base), ("frame", frame)):
            object.__setattr__(self, name, value)

    def _like(self, array: Array) -> Self:
        return type(self)(array, body=self.body, base=self.base, frame=self.frame)

    @classmethod
    def spatial(cls, pose: Pose | ArrayLike, rate: ArrayLike) -> Self:
        """``Ṫ T⁻¹`` from a pose T_ab and its rate ``(..., 4, 4)``: V_ab^a."""
        T, dT = as_pose(pose, "pose"), as_shaped(rate, "rate", 4, 4)
        to, of = (pose.to, pose.of) if isinstance(pose, Pose) else ("", "")
        return cls(_coordinates(dT @ se3.inverse(T)), body=of, base=to, frame=to)

    @classmethod
    def of_body(cls, pose: Pose | ArrayLike, rate: ArrayLike) -> Self:
        """``T⁻¹ Ṫ`` from a pose T_ab and its rate ``(..., 4, 4)``: V_ab^b."""
        T, dT = as_pose(pose, "pose"), as_shaped(rate, "rate", 4, 4)
        to, of = (pose.to, pose.of) if isinstance(pose, Pose) else ("", "")
        return cls(_coordinates(se3.inverse(T) @ dT), body=of, base=to, frame=of)

    @property
    def coordinates(self) -> Array:
        """``(v, ω) (..., 6)``, read-only."""
        return self._array

    @property
    def linear(self) -> Array:
        """v ``(..., 3)``."""
        return self._array[..., :3]

    @property
    def angular(self) -> Array:
        """ω ``(..., 3)``."""
        return self._array[..., 3:]

    def transformed(self, pose: Pose | ArrayLike) -> Self:
        """The same motion in coordinates of another frame: ``Ad_T ξ`` with T_new_frame (G Lemma 1.18)."""
        to, of = (pose.to, pose.of) if isinstance(pose, Pose) else ("", "")
        same_frame(of, self.frame, "transformation of a twist")
        moved = np.einsum("...ij,...j->...i", se3.adjoint(np.asarray(pose)), self._array)
        return type(self)(moved, body=self.body, base=self.base, frame=to)

    def __add__(self, other: Twist) -> Self:
        """Composition of motions in one frame: V_ab + V_bc = V_ac (G Lemma 1.20, after transformation)."""
        if not isinstance(other, Twist):
            return NotImplemented
        same_frame(self.frame, other.frame, "sum of twists")
        same_frame(self.body, other.base, "sum of twists (body of the first, base of the second)")
        total = self._array + other._array
        return type(self)(total, body=other.body, base=self.base, frame=self.frame or other.frame)

    def __neg__(self) -> Self:
        """The motion of the base relative to the body: V_ba = −V_ab in the same frame."""
        return type(self)(-self._array, body=self.base, base=self.body, frame=self.frame)

    def __mul__(self, factor: ArrayLike) -> Self:
        return self._like(self._array * as_array(factor, "factor")[..., None])

    __rmul__ = __mul__

    def at(self, point: ArrayLike) -> Array:
        """Velocity ``ω × q + v (..., 3)`` of the body's point at *point* ``(..., 3)`` in *frame*."""
        return np.asarray(np.cross(self.angular, as_shaped(point, "point", 3)) + self.linear)

    def exp(self) -> Pose:
        """The motion of the twist held for one unit of time."""
        return Pose.exp(self._array)

    def screw(self) -> Screw:
        """Axis, pitch and magnitude (G 1.4)."""
        from .screw import Screw

        return Screw.of_twist(self._array)

    def power(self, wrench: Wrench) -> Array:
        """``F · V (...)``: the power of *wrench* on the moving body (G 1.9)."""
        same_frame(self.frame, wrench.frame, "power of a wrench on a twist")
        return np.asarray((self._array * wrench.coordinates).sum(axis=-1))


class Wrench(Value):
    """Wrench coordinates ``(f, τ) (..., 6)``; force and torque act at the origin of *frame*, in its axes (G 1.9)."""

    _tail: ClassVar[tuple[int, ...]] = (6,)
    __slots__ = ("frame",)
    frame: str

    def __init__(self, coordinates: ArrayLike, *, frame: str = "") -> None:
        super().__init__(as_shaped(coordinates, "coordinates", 6))
        object.__setattr__(self, "frame", frame)

    def _like(self, array: Array) -> Self:
        return type(self)(array, frame=self.frame)

    @classmethod
    def of_force(cls, force: ArrayLike, point: ArrayLike, *, frame: str = "") -> Self:
        """A pure *force* ``(..., 3)`` at *point* ``(..., 3)`` of *frame*: ``(f, p × f)``."""
        f, p = np.broadcast_arrays(as_shaped(force, "force", 3), as_shaped(point, "point", 3))
        return cls(np.concatenate([f, np.cross(p, f)], axis=-1), frame=frame)

    @property
    def coordinates(self) -> Array:
        """``(f, τ) (..., 6)``, read-only."""
        return self._array

    @property
    def force(self) -> Array:
        """f ``(..., 3)``."""
        return self._array[..., :3]

    @property
    def torque(self) -> Array:
        """τ ``(..., 3)`` about the origin of *frame*."""
        return self._array[..., 3:]

    def transformed(self, pose: Pose | ArrayLike) -> Self:
        """The same wrench in another frame: ``F_o = Ad(T_oc⁻¹)ᵀ F_c`` with T_new_frame.

        The script's eq. 1.24 writes Ad(T_oc)ᵗ; its written-out matrix is the one used here.
        """
        to, of = (pose.to, pose.of) if isinstance(pose, Pose) else ("", "")
        same_frame(of, self.frame, "transformation of a wrench")
        moved = np.einsum("...ij,...j->...i", se3.coadjoint(np.asarray(pose)), self._array)
        return type(self)(moved, frame=to)

    def __add__(self, other: Wrench) -> Self:
        if not isinstance(other, Wrench):
            return NotImplemented
        same_frame(self.frame, other.frame, "sum of wrenches")
        return type(self)(self._array + other._array, frame=self.frame or other.frame)

    def __neg__(self) -> Self:
        return self._like(-self._array)

    def __mul__(self, factor: ArrayLike) -> Self:
        return self._like(self._array * as_array(factor, "factor")[..., None])

    __rmul__ = __mul__

    def power(self, twist: Twist) -> Array:
        """``F · V (...)``."""
        return twist.power(self)

    def screw(self) -> Screw:
        """The line along which the force acts, the pitch (torque per force), and the magnitude (G 1.9.1)."""
        from .screw import Screw

        return Screw.of_wrench(self._array)


def _coordinates(matrix: Array) -> Array:
    """Twist coordinates of ξ̂ ``(..., 4, 4)``."""
    return np.concatenate([matrix[..., :3, 3], vee(matrix[..., :3, :3])], axis=-1)
