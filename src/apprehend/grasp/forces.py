"""Contact forces that balance a wrench: optimal, bounded, and proved (G 2.7, 2.8.2)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_shaped, as_vector, choice
from ..errors import InputError
from ..kernels import cone as kernel
from ..result import Result, Status
from .force_program import TOO_LARGE, Parts, Program, answers, build, missed_direction, refuse
from .limits import NO_LIMITS, Limits, check_limits
from .program import MOST_STEPS

if TYPE_CHECKING:
    from .grasp import Grasp

OBJECTIVES = (
    "min_normal", "min_norm", "min_largest", "min_largest_norm", "max_margin", "min_torque", "barrier", "feasible",
)  # fmt: skip
ACTIVE = 1e-6
"""Relative slack below which a limit counts as reached."""
WARM = 0.02
"""How far an earlier answer is moved towards the middle of the cones before a method starts from it."""
_FLOAT = np.dtype(np.float64)


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
_OBJECTS = np.array([_CODES[code] for code in range(len(_CODES))], dtype=object)


@dataclass(frozen=True, eq=False)
class ContactForces(Result):
    """Forces for one wrench.

    *forces* ``(m,)``, contact by contact, zero unless they were found; *value* of the objective and *bound*, its
    certified lower bound (upper bound of ``max_margin``); *residual*: largest violation of balance, relative.
    """

    status: ForceStatus
    forces: Array
    value: float
    bound: float
    residual: float
    steps: int
    grasp: Grasp
    wrench: Array
    program: Program = field(repr=False)
    answer: Array = field(repr=False)
    """What the kernel found (`kernels.cone`), in units of its own: the start for a wrench nearby."""

    @property
    def gap(self) -> float:
        """|value − bound|."""
        return abs(self.value - self.bound)

    @cached_property
    def slack(self) -> Array:
        """How far each contact's force is inside its cone ``(k,)`` (see `Contact.slack`)."""
        pairs = zip(self.grasp.contacts, self.grasp.slices, strict=True)
        return np.array([float(c.slack(self.forces[s])) for c, s in pairs])

    @cached_property
    def certificate(self) -> Array:
        """Where the status is INFEASIBLE, the proof ``(p,)``, else zeros.

        It is a direction d of scaled wrench space with ``d · (−w) > 0``, although no allowed contact force pushes
        along it by more than the limits give, which is Σ `multipliers` × limit.
        """
        p = self.grasp.wrench_size
        if self.status is not ForceStatus.INFEASIBLE:
            return np.zeros(p)
        missed = self._missed
        return self.program.direction(self.answer[self.program.cuts[1]], p) if missed is None else missed

    @cached_property
    def _missed(self) -> Array | None:
        """The certificate where no forces whatever balance the wrench."""
        return missed_direction(self.program, self.wrench) if self.program.missed.shape[1] else None

    @cached_property
    def multipliers(self) -> dict[str, float]:
        """By limit, how fast the value falls as the limit grows; of the certificate's proof where it is infeasible."""
        program = self.program
        y, first = self.answer[program.cuts[1]], len(program.missed)
        scale = 0.0 if self.status is ForceStatus.INFEASIBLE and self._missed is not None else 1.0
        if self.status is ForceStatus.OPTIMAL:
            scale = float(program.factor[0]) * float(self.answer[-1]) ** (program.power - 1)
        shift = program.onto.shape[1] - first
        return {name: -scale * float(y[r + shift] / program.sizes[r, 0]) for r, name in program.names.items()}

    @cached_property
    def gradient(self) -> Array:
        """The derivative of the value by the wrench ``(p,)``; zeros unless the status is OPTIMAL."""
        program, p = self.program, self.grasp.wrench_size
        if self.status is not ForceStatus.OPTIMAL:
            return np.zeros(p)
        scale = float(program.factor[0]) * float(self.answer[-1]) ** (program.power - 1)
        return -scale * self.grasp.scale * program.direction(self.answer[program.cuts[1]], p)

    @property
    def reached(self) -> tuple[str, ...]:
        """Names of the limits that are reached."""
        program = self.program
        first = program.onto.shape[1] - len(program.missed)
        x = self.answer
        return tuple(name for r, name in program.names.items() if x[program.kinds[r + first]] < ACTIVE)

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
        torque = self.program.torque
        return np.zeros(0) if torque is None else torque[0].T @ self.forces + torque[1]


@dataclass(frozen=True, eq=False)
class ForceBatch(Result):
    """Forces for N wrenches: ``forces (N, m)``, ``value``, ``bound``, ``residual (N,)``, ``certificate (N, p)``."""

    forces: Array
    value: Array
    bound: Array
    residual: Array
    certificate: Array
    codes: IntArray
    steps: Array

    def __len__(self) -> int:
        return len(self.codes)

    @property
    def success(self) -> BoolArray:  # type: ignore[override]
        """Which are optimal ``(N,)``."""
        ok: BoolArray = self.codes == kernel.OPTIMAL
        return ok

    def put(self, i: int, one: ForceBatch) -> None:
        """Set entry *i* to the only one of another batch."""
        for mine, other in zip(vars(self).values(), vars(one).values(), strict=True):
            mine[i] = other[0]

    @property
    def status(self) -> Any:  # type: ignore[override]
        """`ForceStatus` of every wrench, an object array ``(...)``."""
        return _OBJECTS[self.codes]

    def explain(self) -> str:
        """How many wrenches are balanced, and the reason of the first that is not."""
        good = self.success
        text = f"forces for {int(good.sum())} of {good.size} wrenches"
        if good.all():
            return text
        first = tuple(int(i) for i in np.argwhere(~good)[0])
        return f"{text}; wrench {first if len(first) > 1 else first[0]}: {self.status[first].value}"


def contact_forces(
    grasp: Grasp,
    wrench: ArrayLike,
    objective: str = "min_normal",
    limits: Limits | None = None,
    *,
    weights: ArrayLike | None = None,
    start: ContactForces | None = None,
    family: bool = False,
) -> ContactForces | ForceBatch:
    """Contact forces f in the friction cones with ``G f = −wrench``, best in the sense of *objective* (G 2.7).

    *wrench* ``(p,)`` acts on the body from outside, about `Grasp.reference`; ``(N, p)`` gives a `ForceBatch`.
    Objectives: ``min_normal`` Σ wᵢ fᵢⁿ (*weights* ``(k,)``); ``min_norm`` ‖f‖² (all components, moments in N m);
    ``min_largest`` max fᵢⁿ; ``min_largest_norm`` max ‖fᵢ‖ (without moments); ``max_margin`` the smallest eigenvalue
    of the LMI's P (µ f₃ − ‖f_t‖ for Coulomb contacts); ``min_torque`` ‖J_Hᵗ f + offset‖; ``barrier`` Σ wᵢ fᵢⁿ −
    log det P(f), far from all walls; ``feasible``: any.

    Neighbouring wrenches have neighbouring answers: *start*, the answer for such a wrench with the same objective and
    limits, or *family* for a batch in which each wrench is near the one before it, saves steps.

    The dual value is a certified bound; where nothing balances the wrench the answer is a certificate, never an
    exception. Raises `InputError` for limits without meaning.
    """
    program = grasp.__dict__.get("_programs", {}).get(objective) if limits is None and weights is None else None
    if program is None:
        program = _program(grasp, objective, limits, weights)
    if objective == "barrier":
        from .barrier import analytic_centre

        return analytic_centre(grasp, wrench, NO_LIMITS if limits is None else limits, weights, program)
    p = grasp.wrench_size
    if type(wrench) is np.ndarray and wrench.shape == (p,) and wrench.dtype is _FLOAT and wrench.flags.carray:
        return _one(grasp, program, wrench, start)
    w = as_shaped(wrench, "wrench", p)
    if w.ndim == 1:
        return _one(grasp, program, w, start)
    begin, share, chain = None, 0.0, False
    if start is not None:
        begin, share = _earlier(program, start)[None], WARM
    elif family:
        share, chain = WARM, True
    shape, w = w.shape[:-1], w.reshape(-1, p)
    out = answers(program, w, start=begin, share=share, chain=chain)
    return batch(program, w, out, shape)


def _one(grasp: Grasp, program: Program, wrench: Array, start: ContactForces | None) -> ContactForces:
    """The answer for one wrench, made with as little Python as may be: most of the time goes into this call."""
    columns, right = program.columns, program.right
    out = np.empty((1, 2 * columns.shape[1] + right.shape[1] + kernel.EXTRAS))
    begin, share = (out, 0.0) if start is None else (_earlier(program, start)[None], WARM)
    kernel.solve(
        columns, right, wrench[None], program.cones, program.kinds, program.floor, begin, share, False, MOST_STEPS, out
    )  # fmt: skip
    if program.missed.shape[1]:
        refuse(program, wrench[None], out)
    answer = out[0]
    code, primal, dual, error, other, steps, size = answer[-kernel.EXTRAS :].tolist()
    status = _CODES.get(int(code))
    if status is None:
        as_shaped(wrench, "wrench", grasp.wrench_size)  # raises: an entry is not finite
        raise InputError(TOO_LARGE.format("wrench"))
    scale = program.unit * (size**program.power if isfinite(primal) else 1.0)
    forces = program.maps[0].dot(answer[: columns.shape[1]])
    forces *= size if status is ForceStatus.OPTIMAL else 0.0
    return single(
        grasp, program, wrench, answer, status, forces, scale * primal, scale * dual, max(error, other), steps
    )


def single(
    grasp: Grasp, program: Program, wrench: Array, answer: Array,
    status: ForceStatus, forces: Array, value: float, bound: float, residual: float, steps: float,
) -> ContactForces:  # fmt: skip
    """A `ContactForces`, past the slow constructor of frozen dataclasses."""
    made = object.__new__(ContactForces)
    made.__dict__.update(
        status=status, forces=forces, value=value, bound=bound, residual=residual, steps=int(steps), grasp=grasp,
        wrench=wrench, program=program, answer=answer,
    )  # fmt: skip
    return made


def _earlier(program: Program, start: ContactForces) -> Array:
    if start.program.columns.shape != program.columns.shape or start.program.right.shape != program.right.shape:
        raise InputError(
            "start is the answer of another objective, other limits or another grasp; expected one of these"
        )
    return start.answer


def batch(
    program: Program, wrenches: Array, out: Array, shape: tuple[int, ...], done: tuple[Array, ...] | None = None
) -> ForceBatch:
    """The answers of the kernel as a `ForceBatch`; *done*: forces, values, bounds, residuals, steps found otherwise."""
    p, cut, e = wrenches.shape[1], program.cuts, -kernel.EXTRAS
    codes = out[:, e].astype(np.int64)
    if done is None:
        x, size = out[:, cut[0]], out[:, -1]
        one = len(program.maps) == 1  # einsum for the reason given in `force_program`
        forces = np.einsum("nj,ij->ni", x, program.maps[0]) if one else (program.maps @ x[..., None])[..., 0]
        forces *= np.where(codes == kernel.OPTIMAL, size, 0.0)[:, None]
        scale = program.factor * np.where(np.isfinite(out[:, e + 1]), size**program.power, 1.0)
        residual = np.maximum(out[:, e + 3], out[:, e + 4])
        done = (forces, scale * out[:, e + 1], scale * out[:, e + 2], residual, out[:, e + 5])
    certificate = np.zeros((len(out), p))
    bad = np.flatnonzero(codes == kernel.INFEASIBLE)
    if len(bad):
        onto = program.onto if len(program.onto) == 1 else program.onto[bad]
        certificate[bad] = (out[bad, cut[1]][:, None, : onto.shape[1]] @ onto)[:, 0, :p]
    if program.missed.shape[1]:
        for i in bad:
            missed = missed_direction(program, wrenches[i])
            certificate[i] = certificate[i] if missed is None else missed
    forces, value, bound, residual, steps = done

    def shaped(v: Array) -> Array:
        return v.reshape(shape + v.shape[1:])

    return ForceBatch(
        shaped(forces), shaped(value), shaped(bound), shaped(residual), shaped(certificate), codes.reshape(shape),
        shaped(steps),
    )  # fmt: skip


def _program(grasp: Grasp, objective: str, limits: Limits | None, weights: ArrayLike | None) -> Program:
    """The program of an objective and limits, made once per grasp."""
    choice(objective, "objective", OBJECTIVES)
    limits = NO_LIMITS if limits is None else limits
    weight = None if weights is None else as_vector(weights, "weights", len(grasp))
    check_limits(limits)
    content: Any = tuple(
        None if v is None else np.asarray(v, np.float64).tobytes() for v in (*vars(limits).values(), weight)
    )
    plain = all(v is None for v in content)
    key = objective if plain else (objective, content)
    cache: dict[Any, Program] = grasp.__dict__.setdefault("_programs", {})
    if key not in cache:
        if len(cache) > 32:
            cache.clear()
        cache[key] = build(Parts.of(grasp), "max_margin" if objective == "barrier" else objective, limits, weight)
    return cache[key]
