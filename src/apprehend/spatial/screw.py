"""Screws: an axis in space, a pitch and a magnitude; what twists and wrenches both are (G 1.4, 1.9.1, 1.9.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, as_array, as_shaped
from ..errors import InputError
from ._batch import unit
from .pose import Pose
from .twist import Twist, Wrench


@dataclass(frozen=True, eq=False, init=False)
class Screw:
    """The axis ``point + λ direction``, the pitch h and the magnitude M, each with the batch shape in front.

    As a motion: a turn by M about the axis and a shift by h M along it; with h = ∞ a shift by M. As a wrench: a force
    M along the axis and a torque h M about it; with h = ∞ a pure torque M.
    """

    direction: Array  # (..., 3), unit
    point: Array  # (..., 3), the axis' point nearest to the origin
    pitch: Array  # (...), m per rad, may be infinite
    magnitude: Array  # (...), ≥ 0

    def __init__(
        self,
        direction: ArrayLike,
        point: ArrayLike = (0.0, 0.0, 0.0),
        pitch: ArrayLike = 0.0,
        magnitude: ArrayLike = 1.0,
    ) -> None:
        w = unit(as_shaped(direction, "direction", 3), "direction")
        p = as_shaped(point, "point", 3)
        h = as_array(pitch, "pitch", finite=False)
        if np.isnan(h).any():
            raise InputError("pitch contains NaN; expected a number, or inf for a pure translation or torque")
        M = as_array(magnitude, "magnitude")
        if (M < 0.0).any():
            raise InputError(f"magnitude is {float(M.min())}; expected ≥ 0 (turn the direction round instead)")
        shape = np.broadcast_shapes(w.shape[:-1], p.shape[:-1], h.shape, M.shape)
        p = p - (p * w).sum(axis=-1, keepdims=True) * w
        for name, value, tail in (("direction", w, (3,)), ("point", p, (3,)), ("pitch", h, ()), ("magnitude", M, ())):
            kept = np.broadcast_to(value, (*shape, *tail)).copy()
            kept.flags.writeable = False
            object.__setattr__(self, name, kept)

    @property
    def shape(self) -> tuple[int, ...]:
        """The batch shape."""
        return self.magnitude.shape

    @classmethod
    def of_twist(cls, twist: Twist | ArrayLike) -> Self:
        """Screw of twist coordinates ``(..., 6)`` (G 1.4): axis ω × v / |ω|², pitch ω·v / |ω|², magnitude |ω|.

        For ω = 0: through the origin along v, pitch ∞, magnitude |v|. The zero twist has magnitude 0, and x is given
        for its direction.
        """
        xi = as_shaped(np.asarray(twist), "twist", 6)
        return cls._of_vectors(xi[..., 3:], xi[..., :3])

    @classmethod
    def of_wrench(cls, wrench: Wrench | ArrayLike) -> Self:
        """Screw of wrench coordinates ``(..., 6)`` (G 1.9.1); force and torque play the parts of ω and v."""
        F = as_shaped(np.asarray(wrench), "wrench", 6)
        return cls._of_vectors(F[..., :3], F[..., 3:])

    @classmethod
    def _of_vectors(cls, line: Array, moment: Array) -> Self:
        """From the vector along the axis and the one that a shift of the axis changes."""
        # lengths by the largest entry, so that 1e-200 squares to something
        size = np.abs(line).max(axis=-1)
        finite = size > 0.0
        safe = np.where(finite, size, 1.0)[..., None]
        l = line / safe
        squared = np.where(finite, (l * l).sum(axis=-1), 1.0)[..., None]
        length = np.sqrt(squared)[..., 0] * safe[..., 0]
        along = l / np.sqrt(squared)
        free = np.linalg.norm(moment, axis=-1)
        along_free = np.where((free > 0.0)[..., None], moment / np.where(free > 0.0, free, 1.0)[..., None], [1.0, 0, 0])
        with np.errstate(over="ignore"):
            pitch = (along * moment).sum(axis=-1) / np.where(finite, length, 1.0)
            point = np.cross(along, moment) / np.where(finite, length, 1.0)[..., None]
        finite &= np.isfinite(pitch) & np.isfinite(point).all(axis=-1)  # else too little to tell from none
        return cls(
            direction=np.where(finite[..., None], along, along_free),
            point=np.where(finite[..., None], point, 0.0),
            pitch=np.where(finite, pitch, np.inf),
            magnitude=np.where(finite, length, free),
        )

    def _vectors(self) -> tuple[Array, Array]:
        M = self.magnitude[..., None]
        pure = np.isinf(self.pitch)[..., None]
        h = np.where(pure, 0.0, self.pitch[..., None])
        line = np.where(pure, 0.0, M * self.direction)
        moment = np.where(pure, M * self.direction, M * (np.cross(self.point, self.direction) + h * self.direction))
        return line, moment

    def twist(self) -> Twist:
        """``M (−ω × p + h ω, ω)``, or ``M (ω, 0)`` for infinite pitch."""
        line, moment = self._vectors()
        return Twist(np.concatenate([moment, line], axis=-1))

    def wrench(self) -> Wrench:
        """``M (ω, −ω × p + h ω)``, or ``M (0, ω)`` for infinite pitch."""
        line, moment = self._vectors()
        return Wrench(np.concatenate([line, moment], axis=-1))

    def motion(self) -> Pose:
        """The screw motion: turn and shift along the axis (Chasles)."""
        return self.twist().exp()

    def reciprocal_to(self, other: Screw, tolerance: float = 1e-12) -> BoolArray:
        """Whether a wrench on the one screw does no work on a twist about the other (G Def. 1.22)."""
        F, V = self.wrench().coordinates, other.twist().coordinates
        size = np.linalg.norm(F, axis=-1) * np.linalg.norm(V, axis=-1)
        return np.asarray(np.abs((F * V).sum(axis=-1)) <= tolerance * size)


def reciprocal(vectors: ArrayLike, tolerance: float = 1e-10) -> Array:
    """Orthonormal basis ``(6 − m, 6)`` of what is reciprocal to the rows of *vectors* ``(k, 6)`` of rank m (G 1.9.2).

    For twists: the wrenches that cannot work on any of them. For wrenches: the twists that they cannot resist.
    Singular values below *tolerance* times the largest count as zero.
    """
    A = as_shaped(vectors, "vectors", 6)
    if A.ndim != 2:
        raise InputError(f"vectors has shape {A.shape}; expected (k, 6)")
    if not len(A):
        return np.eye(6)
    _, s, Vt = np.linalg.svd(A)
    rank = int((s > tolerance * s[0]).sum()) if s[0] > 0.0 else 0
    return np.asarray(Vt[rank:])
