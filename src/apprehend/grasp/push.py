"""The largest force that a grasp can exert along a direction: virtual contacts (G 2.8.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from ..kernels import cone as kernel
from ..result import Result
from .force_program import Parts, build
from .forces import ForceStatus
from .limits import Limits
from .program import solve

if TYPE_CHECKING:
    from .grasp import Grasp


@dataclass(frozen=True, eq=False)
class Push(Result):
    """The largest multiple α of a wrench: *value*, its certified *bound*, the *wrench* ``(p,)`` that is exerted, and
    the contact *forces* ``(m,)``."""

    status: ForceStatus
    value: float
    bound: float
    wrench: Array
    forces: Array


def largest_force(
    grasp: Grasp,
    direction: ArrayLike,
    limits: Limits,
    *,
    external: ArrayLike | None = None,
    opening: float = 0.0,
) -> Push:
    """Maximise α over ``G f = α F − F_e`` with f in the cones and *limits* (G 2.8.2, gravity included).

    *direction* F ``(p,)`` is the wrench to exert on what the body touches; *external* F_e acts on the body. With
    *opening* µ_v > 0 the virtual contact has friction: the force may turn within the cone of half-angle arctan µ_v
    around F (whose torque part is kept), and α counts the component along F. UNBOUNDED if the limits do not stop it.
    """
    p, d = grasp.wrench_size, grasp.dimension
    F = as_array(direction, "direction")
    if F.shape != (p,) or not F.any():
        raise InputError(f"direction has shape {F.shape}; expected ({p},) and not all zero")
    F_e = np.zeros(p) if external is None else as_array(external, "external")
    if F_e.shape != (p,):
        raise InputError(f"external has shape {F_e.shape}; expected ({p},)")
    if not (np.isfinite(opening) and opening >= 0.0):
        raise InputError(f"opening is {opening}; expected a finite number, zero or more")
    columns = [F]
    size = float(np.linalg.norm(F[:d]))
    if opening > 0.0:
        if size == 0.0:
            raise InputError("direction has no force part; a cone of directions needs one")
        basis = np.linalg.svd(F[:d][None])[2][1:]
        columns += [np.concatenate([opening * size * e, np.zeros(p - d)]) for e in basis]
    program = build(Parts.of(grasp), "feasible", limits)
    virtual = -np.array(columns).T * grasp.scale[:, None]
    rows, n = program.A.shape[1:]
    A = np.hstack([program.A[0], np.vstack([virtual, np.zeros((rows - p, len(columns)))])])
    c = np.zeros(A.shape[1])
    c[n] = -1.0
    b = program.b0[0] - program.B @ F_e
    force, unit = float(np.abs(b).max()) or 1.0, float(np.linalg.norm(F * grasp.scale))  # what the numbers count in
    A[:, n:] /= unit
    answer = solve(A[None], b[None] / force, c[None], (*program.cones.tolist(), len(columns)))
    status = {
        kernel.OPTIMAL: ForceStatus.OPTIMAL, kernel.INFEASIBLE: ForceStatus.INFEASIBLE,
        kernel.UNBOUNDED: ForceStatus.UNBOUNDED,
    }.get(int(answer.status[0]), ForceStatus.INACCURATE)  # fmt: skip
    good = status is ForceStatus.OPTIMAL
    x = answer.x[0] * force if good else np.zeros(A.shape[1])
    x[n:] /= unit
    value = (
        float(-answer.primal[0]) * force / unit if good else float("inf") if status is ForceStatus.UNBOUNDED else 0.0
    )
    bound = float(-answer.dual[0]) * force / unit if good else value
    return Push(status, value, bound, np.array(columns).T @ x[n:], program.maps[0] @ x[:n])
