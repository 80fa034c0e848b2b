"""The script's own ways to forward kinematics and Jacobian: product of exponentials, and leaf to root (G 1.5, 1.7).

They give the same numbers as `Robot.fk` and `Robot.jacobian`, which are faster; here are the twists to look at.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped
from ..kernels.chain import REVOLUTE
from ..spatial import se3

if TYPE_CHECKING:
    from .robot import Robot


@dataclass(frozen=True, eq=False)
class ProductOfExponentials:
    """``T(θ) = e^{ξ̂₁θ₁} … e^{ξ̂ₘθₘ} T(0)`` of one chain (G 1.5); row i of *twists* is ξᵢ = (v, ω) in the world.

    A joint's value is ``gain[i, 0] * q[coordinate[i]] + gain[i, 1]`` (1 and 0 but for joints that mimic).
    """

    frame: str
    twists: Array  # (m, 6)
    home: Array  # (4, 4), T(0): pose of the frame with every joint value at 0
    coordinate: tuple[int, ...]
    gain: Array  # (m, 2)
    n: int

    @classmethod
    def of(cls, robot: Robot, frame: str) -> Self:
        """Read off the chain from the root of *robot* to *frame*: ξ = (−ω × p, ω) or (ω, 0)."""
        model = robot.chain_model(frame)
        T = np.eye(4)
        twists = np.zeros((len(model.kind), 6))
        for i, row in enumerate(model.place):
            T = T @ se3.transform(row[:9].reshape(3, 3), row[9:])
            if i < len(model.kind):
                axis, point = T[:3, 2], T[:3, 3]
                if model.kind[i] == REVOLUTE:
                    twists[i] = [*np.cross(point, axis), *axis]
                else:
                    twists[i, :3] = axis
        return cls(frame, twists, T, tuple(int(c) for c in model.coordinate), model.gain.copy(), robot.n)

    def values(self, q: ArrayLike) -> Array:
        """Joint values ``(..., m)`` of the chain."""
        q = as_shaped(q, "q", self.n)
        return np.asarray(q[..., list(self.coordinate)] * self.gain[:, 0] + self.gain[:, 1])

    def fk(self, q: ArrayLike) -> Array:
        """Pose of the frame ``(..., 4, 4)``."""
        theta = self.values(q)
        T = np.broadcast_to(np.eye(4), (*theta.shape[:-1], 4, 4))
        for i, xi in enumerate(self.twists):
            T = T @ se3.exp(theta[..., i, None] * xi)
        return np.asarray(T @ self.home)

    def jacobian(self, q: ArrayLike) -> Array:
        """Spatial Jacobian ``(..., 6, n)``: column i is ``Ad(e^{ξ̂₁θ₁} … e^{ξ̂ᵢ₋₁θᵢ₋₁}) ξᵢ`` (G 1.7)."""
        theta = self.values(q)
        T = np.broadcast_to(np.eye(4), (*theta.shape[:-1], 4, 4))
        J = np.zeros((*theta.shape[:-1], 6, self.n))
        for i, xi in enumerate(self.twists):
            J[..., self.coordinate[i]] += self.gain[i, 0] * np.einsum("...ij,j->...i", se3.adjoint(T), xi)
            T = T @ se3.exp(theta[..., i, None] * xi)
        return J


def leaf_to_root_jacobian(robot: Robot, q: ArrayLike, frame: str) -> Array:
    """Mixed Jacobian ``(..., 6, n)`` by the iterative algorithm for trees (G 1.7.2), from the frame up to the root.

    T grows from the leaf: at each joint its unit twist is brought into the tool's frame by Ad(T⁻¹); in the end all
    columns are turned into the axes of the world.
    """
    model = robot.chain_model(frame)
    vector = as_shaped(q, "q", robot.n)
    J = np.zeros((*vector.shape[:-1], 6, robot.n))
    T = se3.transform(model.place[-1, :9].reshape(3, 3), model.place[-1, 9:])
    for i in reversed(range(len(model.kind))):
        c, revolute = model.coordinate[i], model.kind[i] == REVOLUTE
        xi = np.eye(6)[5 if revolute else 2]
        theta = model.gain[i, 0] * vector[..., c] + model.gain[i, 1]
        J[..., c] += model.gain[i, 0] * se3.adjoint(se3.inverse(T)) @ xi
        place = se3.transform(model.place[i, :9].reshape(3, 3), model.place[i, 9:])
        T = place @ se3.exp(theta[..., None] * xi) @ T
    R = T[..., :3, :3]
    return np.concatenate([R @ J[..., :3, :], R @ J[..., 3:, :]], axis=-2)
