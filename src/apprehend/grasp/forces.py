"""Contact forces that balance a wrench: optimal, bounded, and proved (G 2.7, 2.8.2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_array, as_shaped, as_vector, choice
from ..errors import InputError
from ..kernels import cone as kernel
from ..result import Result, Status
from .force_program import NO_LIMITS, Limits, Program, build, run
from .program import Solutions

if TYPE_CHECKING:
    from .grasp import Grasp

OBJECTIVES = (
    "min_normal", "min_norm", "min_largest", "min_largest_norm", "max_margin", "min_torque", "barrier",
)  # fmt: skip
ACTIVE = 1e-6
"""Relative slack below which a limit counts as reached."""


class ForceStatus(Status):
    """Outcomes of a contact-force optimisation."""

    OPTIMAL = "optimal contact forces were found"
    INFEASIBLE = "no contact forces within the friction cones and limits balance the wrench"
    UNBOUNDED = "the objective has no bound: forces may grow without end"
    INACCURATE = "the method stopped before it reached its tolerance"


_CODES = {
    kernel.OPTIMAL: ForceStatus.OPTIMAL, kernel.INFEASIBLE: ForceStatus.INFEASIBLE,
    kernel.UNBOUNDED: ForceStatus.UNBOUNDED, kernel.INACCURATE: ForceStatus.INACCURATE,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class ContactForces(Result):
    """Forces for one wrench.

    *forces* ``(m,)``, contact by contact; *value* of the objective and *bound*, its certified lower bound (upper bound
    of ``max_margin``); *residual*: largest violation of balance, relative. For INFEASIBLE the forces are zero, and
    *certificate* ``(p,)`` is the proof: a direction d of scaled wrench space with ``d · (−w) > 0``, although no allowed
    contact force pushes along it by more than the limits give.
    """

    status: ForceStatus
    forces: Array
    value: float
    bound: float
    residual: float
    certificate: Array
    steps: int
    grasp: Grasp
    reached: tuple[str, ...] = ()
    torque: tuple[Array, Array] | None = None

    @property
    def gap(self) -> float:
        """|value − bound|."""
        return abs(self.value - self.bound)

    @cached_property
    def slack(self) -> Array:
        """How far each contact's force is inside its cone ``(k,)`` (see `Contact.slack`)."""
        pairs = zip(self.grasp.contacts, self.grasp.slices, strict=True)
        return np.array([float(c.slack(self.forces[s])) for c, s in pairs])

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the limits and friction cones that are reached."""
        if not self.success:
            return ()
        near = ACTIVE * (1.0 + float(np.abs(self.forces).max()))
        return (*self.reached, *(f"friction cone of contact {i}" for i, s in enumerate(self.slack) if s < near))

    @property
    def torques(self) -> Array:
        """Joint torques ``J_Hᵗ f + offset`` ``(n,)``; empty without a hand Jacobian in the limits."""
        return np.zeros(0) if self.torque is None else self.torque[0].T @ self.forces + self.torque[1]


@dataclass(frozen=True, eq=False)
class ForceBatch:
    """Forces for N wrenches: ``forces (N, m)``, ``value``, ``bound``, ``residual (N,)``, ``certificate (N, p)``."""

    forces: Array
    value: Array
    bound: Array
    residual: Array
    certificate: Array
    codes: IntArray
    steps: Array

    @property
    def success(self) -> BoolArray:
        """Which are optimal ``(N,)``."""
        ok: BoolArray = self.codes == kernel.OPTIMAL
        return ok

    def status(self, i: int) -> ForceStatus:
        """The outcome of wrench *i*."""
        return _CODES[int(self.codes[i])]


def contact_forces(
    grasp: Grasp,
    wrench: ArrayLike,
    objective: str = "min_normal",
    limits: Limits | None = None,
    *,
    weights: ArrayLike | None = None,
) -> ContactForces | ForceBatch:
    """Contact forces f in the friction cones with ``G f = −wrench``, best in the sense of *objective* (G 2.7).

    *wrench* ``(p,)`` acts on the body from outside, about `Grasp.reference`; ``(N, p)`` gives a `ForceBatch`.
    Objectives: ``min_normal`` Σ wᵢ fᵢⁿ (*weights* ``(k,)``); ``min_norm`` ‖f‖² (all components, moments in N m);
    ``min_largest`` max fᵢⁿ; ``min_largest_norm`` max ‖fᵢ‖ (without moments); ``max_margin`` the smallest eigenvalue
    of the LMI's P (µ f₃ − ‖f_t‖ for Coulomb contacts); ``min_torque`` ‖J_Hᵗ f + offset‖; ``barrier`` Σ wᵢ fᵢⁿ −
    log det P(f), far from all walls (one wrench at a time).

    The dual value is a certified bound; where nothing balances the wrench the answer is a certificate, never an
    exception. Raises `InputError` for limits without meaning.
    """
    choice(objective, "objective", OBJECTIVES)
    limits = NO_LIMITS if limits is None else limits
    w = as_shaped(wrench, "wrench", grasp.wrench_size)
    weight = None if weights is None else as_vector(weights, "weights", len(grasp))
    for name, value in (("normal", limits.normal), ("total", limits.total)):
        if value is not None and float(np.min(as_array(value, f"limits.{name}", finite=False))) < 0.0:
            raise InputError(f"limits.{name} is {value}; a normal force cannot be limited below zero")
    if objective == "barrier":
        from .barrier import analytic_centre

        if w.ndim != 1:
            raise InputError('objective "barrier" takes one wrench (p,) at a time')
        return analytic_centre(grasp, w, limits, np.ones(len(grasp)) if weight is None else weight)
    key = objective if limits is NO_LIMITS and weight is None else None
    cache: dict[str, Program] = grasp.__dict__.setdefault("_programs", {})
    program = cache.get(key) if key else None
    if program is None:
        program = build(grasp, objective, limits, weight)
        if key:
            cache[key] = program
    flat = w.reshape(-1, grasp.wrench_size)
    answer, size = run(program, flat)
    forces = answer.x @ program.maps.T * size[:, None]
    power = 2 if program.Q.any() else 1
    value, bound = (program.sign * v * size**power for v in (answer.primal, answer.dual))
    good = answer.status == kernel.OPTIMAL
    forces[~good] = 0.0
    certificate = np.where((answer.status == kernel.INFEASIBLE)[:, None], answer.y[:, : grasp.wrench_size], 0.0)
    if w.ndim > 1:
        return ForceBatch(forces, value, bound, answer.residual, certificate, answer.status, answer.steps)
    return _single(grasp, program, answer, forces[0], float(value[0]), float(bound[0]), certificate[0])


def _single(
    grasp: Grasp, program: Program, answer: Solutions, f: Array, value: float, bound: float, d: Array
) -> ContactForces:
    status = _CODES[int(answer.status[0])]
    reached: tuple[str, ...] = ()
    if program.names and status is ForceStatus.OPTIMAL:
        reached = tuple(name for j, name in program.names.items() if answer.x[0, j] < ACTIVE)
    return ContactForces(
        status, f, value, bound, float(answer.residual[0]), d, int(answer.steps[0]), grasp, reached, program.torque
    )
