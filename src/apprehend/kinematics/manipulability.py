"""Singularities and manipulability: rank, lost directions, ellipsoids of velocity and force, µ1–µ3 (K).

K takes µ from the singular values of A = J Jᵀ, and σ(A) = σ(J)². What is returned here says which it is: `sigma` are
those of J; µ1, µ2 and µ3 are K's, of A.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped, choice
from ..errors import InputError

if TYPE_CHECKING:
    from .robot import Robot

PARTS = {
    "linear": (0, 1, 2), "angular": (3, 4, 5), "both": (0, 1, 2, 3, 4, 5), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2),
}  # fmt: skip
"""Parts of a twist or wrench that can be asked for: rows of the Jacobian; the last three are planes of the world."""


@dataclass(frozen=True, eq=False)
class Manipulability:
    """Singular values and vectors of the (scaled) Jacobian, with the batch shape in front; k = min(rows, n)."""

    sigma: Array  # (..., k) of J, descending: semi-axes of the velocity ellipsoid for |q̇| = 1
    directions: Array  # (..., rows, rows): columns are the axes of both ellipsoids, matching sigma, then the lost ones
    rank: Array  # (...)
    rows: int

    @property
    def singular(self) -> Array:
        """Whether the rank is below the dimension of the motion (K)."""
        return np.asarray(self.rank < self.rows)

    @property
    def mu1(self) -> Array:
        """K's µ1 = σ_min(A) = σ_min(J)², A = J Jᵀ; 0 with fewer joints than dimensions."""
        return np.asarray(self._all()[..., -1] ** 2)

    @property
    def mu2(self) -> Array:
        """K's µ2 = σ_min(A) / σ_max(A): the inverse condition number of A, the square of that of J."""
        s = self._all()
        largest = np.where(s[..., 0] > 0.0, s[..., 0], 1.0)
        return np.asarray((s[..., -1] / largest) ** 2)

    @property
    def mu3(self) -> Array:
        """K's µ3 = det A = (product of σ(J))²."""
        return np.asarray((self._all() ** 2).prod(axis=-1))

    @property
    def yoshikawa(self) -> Array:
        """Yoshikawa's measure √det(J Jᵀ) = √µ3: proportional to the volume of the velocity ellipsoid."""
        return np.asarray(self._all().prod(axis=-1))

    @property
    def force_semi_axes(self) -> Array:
        """Semi-axes 1/σ of the force ellipsoid ``{F : |Jᵀ F| = 1}`` along `directions`; infinite where lost."""
        s = self._all()
        kept = np.arange(self.rows) < np.asarray(self.rank)[..., None]
        return np.asarray(np.where(kept, 1.0 / np.where(kept, s, 1.0), np.inf))

    def lost(self) -> Array:
        """Orthonormal directions ``(rows − rank, rows)`` in which no joint moves the frame; a single configuration."""
        if self.rank.ndim:
            raise InputError("lost directions differ in number over a batch; ask for one configuration at a time")
        return np.asarray(self.directions[:, int(self.rank) :].T)

    def _all(self) -> Array:
        """σ for every dimension: zeros where there are fewer joints than dimensions."""
        missing = self.rows - self.sigma.shape[-1]
        return np.concatenate([self.sigma, np.zeros((*self.sigma.shape[:-1], missing))], axis=-1)


def manipulability(
    robot: Robot,
    q: ArrayLike,
    frame: str,
    part: str = "both",
    *,
    length: float = 1.0,
    weights: ArrayLike | None = None,
    tolerance: float = 1e-9,
) -> Manipulability:
    """Manipulability of *frame* at ``q (..., n)``, from the mixed Jacobian's *part*: one of `PARTS`.

    *length* (m) makes angular velocities comparable with linear ones in ``"both"``: rows of ω are multiplied by it.
    *weights* ``(n,)`` scale the joints' speeds (the velocity limits, say). The rank counts σ > *tolerance* σ_max.
    """
    J = jacobian_part(robot, q, frame, part, length)
    if weights is not None:
        w = as_shaped(weights, "weights", robot.n)
        if (w < 0.0).any():
            raise InputError(f"weights has the negative entry {float(w.min()):g}")
        J = J * w
    U, s, _ = np.linalg.svd(J)
    largest = s[..., :1] if s.shape[-1] else np.zeros((*s.shape[:-1], 1))
    rank = ((s > tolerance * largest) & (s > 0.0)).sum(axis=-1)
    return Manipulability(sigma=s, directions=U, rank=np.asarray(rank), rows=J.shape[-2])


def jacobian_part(robot: Robot, q: ArrayLike, frame: str, part: str, length: float = 1.0) -> Array:
    """Rows of the mixed Jacobian that `PARTS` names; those of ω times *length* where both kinds are asked for."""
    rows = PARTS[choice(part, "part", tuple(PARTS))]
    if not length > 0.0 or not np.isfinite(length):
        raise InputError(f"length is {length}; expected a positive number of metres")
    J = robot.jacobian(q, frame)
    if part == "both":
        J = J * np.array([1.0, 1.0, 1.0, length, length, length])[:, None]
    return np.ascontiguousarray(J[..., rows, :])
