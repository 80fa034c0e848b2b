"""Paths of poses in SE(3): lines, arcs, screws, and splines through poses.

Every one is a callable ``path(s, order)`` over ``path.interval``: order 0 gives poses ``(..., 4, 4)``, order 1 the
twist by s ``(..., 6)`` = (velocity of the origin, angular velocity), both in the axes of the fixed frame, order 2 its
derivative.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_pose, as_shaped
from ..errors import InputError
from ..spatial import so3
from .piecewise import check_order
from .spline import Spline, chord_knots


class PosePath(Protocol):
    """A path of poses; see the module."""

    @property
    def interval(self) -> tuple[float, float]:
        """First and last value of s."""

    def __call__(self, s: ArrayLike, order: int = 0, /) -> Array:
        """Poses (order 0), twists (1) or their derivatives (2) at *s*."""


class Helix:
    """``p(s) = c + rot(a, s φ) r0 + s v``, ``R(s) = rot(w, s θ) R0`` on s ∈ [0, 1].

    The common form of straight lines, circular arcs and screw motions: made by `Line`, `Arc` and `ScrewLine`.
    """

    interval = (0.0, 1.0)

    def __init__(self, start: Array, centre: Array, axis: Array, angle: float, velocity: Array, turn: Array) -> None:
        self.start = start
        self.centre, self.axis, self.angle = centre, axis, float(angle)
        self.velocity = velocity
        self.radius = start[:3, 3] - centre
        self.theta = float(np.linalg.norm(turn))
        self.turn = turn

    @property
    def packed(self) -> Array:
        """The parameters as one array, as kernels read them."""
        w = self.turn / self.theta if self.theta > 0.0 else np.array([1.0, 0.0, 0.0])
        parts = [
            self.centre, self.axis, self.radius, self.velocity, [self.angle], self.start[:3, :3].ravel(), w,
            [self.theta],
        ]  # fmt: skip
        return np.concatenate([np.asarray(p, dtype=np.float64).ravel() for p in parts])

    @property
    def length(self) -> float:
        """Length of the way of the origin, in m."""
        across = self.angle * np.linalg.norm(np.cross(self.axis, self.radius))
        return float(np.hypot(across, np.linalg.norm(self.velocity)))

    def __call__(self, s: ArrayLike, order: int = 0, /) -> Array:
        """Poses (order 0), twists (1) or their derivatives (2) at *s* ``(...)``."""
        values, order = as_array(s, "s"), check_order(order)
        if values.size and (values.min() < -1e-9 or values.max() > 1.0 + 1e-9):
            raise InputError(f"s = {values.min():.9g} … {values.max():.9g} lies outside [0, 1]")
        reach = np.asarray(so3.exp(values[..., None] * self.angle * self.axis) @ self.radius)
        if order == 0:
            out = np.zeros((*values.shape, 4, 4))
            out[..., :3, 3] = self.centre + reach + values[..., None] * self.velocity
            out[..., :3, :3] = so3.exp(values[..., None] * self.turn) @ self.start[:3, :3]
            out[..., 3, 3] = 1.0
            return out
        spin = self.angle * self.axis
        if order == 1:
            linear, angular = np.cross(spin, reach) + self.velocity, self.turn
        elif order == 2:
            linear, angular = np.cross(spin, np.cross(spin, reach)), np.zeros(3)
        else:
            raise InputError(f"order is {order}; a path of poses has orders 0, 1 and 2")
        return np.concatenate([linear, np.broadcast_to(angular, linear.shape)], axis=-1)


class Line(Helix):
    """The straight line from *T0* to *T1*, turning evenly about one fixed axis (decoupled: position and slerp)."""

    def __init__(self, T0: ArrayLike, T1: ArrayLike) -> None:
        start, end = _two(T0, T1)
        zero = np.zeros(3)
        turn = so3.log(end[:3, :3] @ start[:3, :3].T)
        super().__init__(start, start[:3, 3], np.array([0.0, 0.0, 1.0]), 0.0, end[:3, 3] - start[:3, 3] + zero, turn)


class ScrewLine(Helix):
    """The screw motion from *T0* to *T1*: ``T(s) = exp(s ξ) T0`` with ``ξ = log(T1 T0⁻¹)`` (Chasles, G 1.6)."""

    def __init__(self, T0: ArrayLike, T1: ArrayLike) -> None:
        from ..spatial import se3

        start, end = _two(T0, T1)
        twist = se3.log(end @ se3.inverse(start))
        v, w = twist[:3], twist[3:]
        angle = float(np.linalg.norm(w))
        if angle < 1e-12:
            super().__init__(start, start[:3, 3], np.array([0.0, 0.0, 1.0]), 0.0, end[:3, 3] - start[:3, 3], w)
            return
        axis = w / angle
        super().__init__(start, np.cross(axis, v) / angle, axis, angle, (v @ axis) * axis, w)


class Arc(Helix):
    """The circular arc from *T0* through the point *via* ``(3,)`` to *T1*, turning evenly about one fixed axis."""

    def __init__(self, T0: ArrayLike, via: ArrayLike, T1: ArrayLike) -> None:
        start, end = _two(T0, T1)
        b = as_shaped(via, "via", 3)
        a, c = start[:3, 3], end[:3, 3]
        u, v = b - a, c - a
        normal = np.cross(u, v)
        square = float(normal @ normal)
        if square <= 1e-18 * float(u @ u) * float(v @ v) or square == 0.0:
            raise InputError("the three points of the arc lie on a straight line; use Line, or another via point")
        centre = a + (np.cross(normal, u) * (v @ v) + np.cross(v, normal) * (u @ u)) / (2.0 * square)
        axis = normal / np.sqrt(square)
        r0, r1 = a - centre, c - centre
        angle = float(np.arctan2(np.cross(r0, r1) @ axis, r0 @ r1)) % (2.0 * np.pi)
        turn = so3.log(end[:3, :3] @ start[:3, :3].T)
        super().__init__(start, centre, axis, angle, np.zeros(3), turn)


class PoseSpline:
    """The C² path through *poses* ``(M, 4, 4)``: a cubic spline of positions and a rotation spline.

    The rotation spline has continuous angular velocity and acceleration (SciPy's `RotationSpline`, least angular
    acceleration). *knots* ``(M,)`` are s at the poses; by default chord lengths of position and angle together, scaled
    to [0, 1], where one radian counts as *radian* metres.
    """

    def __init__(self, poses: ArrayLike, knots: ArrayLike | None = None, *, radian: float = 0.1) -> None:
        from scipy.spatial.transform import Rotation, RotationSpline

        T = as_pose(poses, "poses")
        if T.ndim != 3 or T.shape[0] < 2:
            raise InputError(f"poses has shape {T.shape}; expected (M, 4, 4) with M ≥ 2")
        if knots is None:
            angles = np.linalg.norm(so3.log(np.swapaxes(T[:-1, :3, :3], 1, 2) @ T[1:, :3, :3]), axis=-1)
            steps = np.concatenate([np.diff(T[:, :3, 3], axis=0), radian * angles[:, None]], axis=1)
            if not steps.any():
                raise InputError(f"all {len(T)} poses coincide; a path needs at least two different ones")
            knots = chord_knots(np.concatenate([np.zeros((1, 4)), np.cumsum(np.abs(steps), axis=0)]))
        self.poses = T
        self.knots = as_array(knots, "knots")
        if self.knots.shape != (T.shape[0],) or np.diff(self.knots).min() <= 0.0:
            raise InputError(f"knots must be {T.shape[0]} strictly increasing values; two equal poses need their own")
        self._position = Spline.through_knots(T[:, :3, 3], self.knots)
        self._rotation = RotationSpline(self.knots, Rotation.from_matrix(T[:, :3, :3]))

    @property
    def interval(self) -> tuple[float, float]:
        """First and last knot."""
        return float(self.knots[0]), float(self.knots[-1])

    def __call__(self, s: ArrayLike, order: int = 0, /) -> Array:
        """Poses (order 0), twists (1) or their derivatives (2) at *s* ``(...)``."""
        values, order = as_array(s, "s"), check_order(order)
        if order > 2:
            raise InputError(f"order is {order}; a path of poses has orders 0, 1 and 2")
        position = self._position(values, order)
        flat = np.clip(values.reshape(-1), *self.interval)
        R = self._rotation(flat).as_matrix()
        if order == 0:
            out = np.zeros((*values.shape, 4, 4))
            out[..., :3, 3] = position
            out[..., :3, :3] = R.reshape(*values.shape, 3, 3)
            out[..., 3, 3] = 1.0
            return out
        rates = np.einsum("mij,mj->mi", R, self._rotation(flat, order)).reshape(*values.shape, 3)
        return np.concatenate([position, rates], axis=-1)


def _two(T0: ArrayLike, T1: ArrayLike) -> tuple[Array, Array]:
    start, end = as_pose(T0, "T0"), as_pose(T1, "T1")
    for name, T in (("T0", start), ("T1", end)):
        if T.shape != (4, 4):
            raise InputError(f"{name} has shape {T.shape}; expected one (4, 4) pose")
    return start.copy(), end.copy()
