"""What contact forces must respect besides the friction cones (G 2.7)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_vector
from ..errors import InputError, described

if TYPE_CHECKING:
    from .grasp import Grasp


@dataclass(frozen=True, eq=False)
class Limits:
    """What contact forces must respect besides the friction cones; None: no limit.

    *normal*: largest normal force, one number or one per contact; *total*: of their sum; *hand_jacobian* ``(m, n)``
    with *torque_lower*, *torque_upper* ``(n,)`` (or one number, or ``(−x, x)`` from *torque_upper* alone) and
    *torque_offset* ``(n,)``: ``lower ≤ J_Hᵗ f + offset ≤ upper`` (motor limits pass through a transmission by
    multiplying *hand_jacobian* with it).
    """

    normal: ArrayLike | None = None
    total: float | None = None
    hand_jacobian: ArrayLike | None = None
    torque_lower: ArrayLike | None = None
    torque_upper: ArrayLike | None = None
    torque_offset: ArrayLike | None = None


NO_LIMITS = Limits()


def check_limits(limits: Limits) -> None:
    """Raise `InputError` for limits of normal forces that are negative or NaN, or for another thing."""
    if not isinstance(limits, Limits):
        raise InputError(f"limits is {described(limits)}; expected apprehend.grasp.Limits(normal=...)")
    for name, value in (("normal", limits.normal), ("total", limits.total)):
        if value is not None and not (as_array(value, f"limits.{name}", finite=False) >= 0.0).all():
            raise InputError(f"limits.{name} is {value}; expected numbers from zero on: it bounds a normal force")


def with_torques(limits: Limits | None, torque_limits: ArrayLike, hand_jacobian: ArrayLike | None) -> Limits:
    """*limits* with the joint torques bounded by *torque_limits* ``(n,)`` either way or ``(n, 2)`` pairs."""
    limits = limits or NO_LIMITS
    J = limits.hand_jacobian if hand_jacobian is None else hand_jacobian
    if J is None:
        raise InputError("torque_limits need hand_jacobian= the matrix J_H (m, n) that maps contact forces to torques")
    bounds = as_array(torque_limits, "torque_limits", finite=False)
    if bounds.ndim == 2 and bounds.shape[1] == 2:
        return replace(limits, hand_jacobian=J, torque_lower=bounds[:, 0], torque_upper=bounds[:, 1])
    if bounds.ndim > 1:
        raise InputError(f"torque_limits has shape {bounds.shape}; expected (n,) or (n, 2)")
    return replace(limits, hand_jacobian=J, torque_lower=-bounds, torque_upper=bounds)


def joint_torques(grasp: Grasp, limits: Limits) -> tuple[Array, Array] | None:
    """J_H ``(m, n)`` and the offset ``(n,)`` of *limits*, checked; None without a hand Jacobian."""
    if limits.hand_jacobian is None:
        if limits.torque_lower is not None or limits.torque_upper is not None:
            raise InputError("torque limits are given without limits.hand_jacobian (m, n)")
        return None
    J = as_array(limits.hand_jacobian, "limits.hand_jacobian")
    m = grasp.matrix.shape[1]
    if J.ndim != 2 or len(J) != m:
        raise InputError(f"limits.hand_jacobian has shape {J.shape}; expected ({m}, n): one row per force component")
    n = J.shape[1]
    offset = np.zeros(n) if limits.torque_offset is None else as_vector(limits.torque_offset, "torque_offset", n)
    return J, offset


def torque_bounds(limits: Limits, n: int) -> tuple[Array, Array]:
    """Lower and upper limits of n joint torques, infinite where none is given."""
    upper = np.full(n, np.inf) if limits.torque_upper is None else as_vector(limits.torque_upper, "torque_upper", n)
    if limits.torque_lower is None:
        lower = -upper if limits.torque_upper is not None else np.full(n, -np.inf)
    else:
        lower = as_vector(limits.torque_lower, "torque_lower", n)
    bad = np.nonzero(lower > upper)[0]
    if len(bad):
        j = int(bad[0])
        raise InputError(f"torque limits of joint {j} exclude each other: lower {lower[j]:g} > upper {upper[j]:g}")
    return lower, upper
