"""First-order immobility: whether fixed contacts without friction leave the body any motion (G 2.2.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..result import Result, Status

if TYPE_CHECKING:
    from .grasp import Grasp

RATE = 1e-7
"""A contact is left if its rate is above this, for motions of at most unit size."""


class ImmobilityStatus(Status):
    """Verdicts on the motions that contacts leave."""

    SUCCESS = "no motion is left: the body is immobile to first order (form closure)"
    SLIDING = "the motions that are left keep every contact to first order; curvature decides whether they are blocked"
    MOBILE = "the body can move and leave contacts without entering any"


@dataclass(frozen=True, eq=False)
class Immobility(Result):
    """Verdict with its proof.

    *motion* ``(p,)``: a twist (v, ω) of the body about the reference point that enters no contact, no part of v above
    1 m/s, nor of ω times the grasp's length; zero if there is none. *rates* ``(k,)``: how fast each contact is left,
    ``nᵀ v_i ≥ 0``, in m/s.
    *freedom*: dimension of the motions that keep every contact, 𝒩(Gᵗ) of the normals.
    """

    status: ImmobilityStatus
    motion: Array
    rates: Array
    freedom: int

    def explain(self) -> str:
        """The verdict with its numbers."""
        if self.success:
            return self.status.value
        if self.status is ImmobilityStatus.SLIDING:
            return f"{self.status.value} ({self.freedom} such motions)"
        left = ", ".join(str(i) for i in np.flatnonzero(self.rates > RATE))
        return f"{self.status.value}: contacts {left} are left"


def immobility(grasp: Grasp) -> Immobility:
    """Decide first-order immobility: ``max Σ r_i`` over ``0 ≤ r = Gᵗ V ≤ 1``, ``|V_j| ≤ 1``, a linear program.

    G holds the normals only. The body is immobile to first order exactly if V = 0 is all there is, which is form
    closure by duality (Farkas). Where all other motions keep every contact, the curvature of body and fingers may
    still block them (immobility of second order), which contacts alone cannot tell.
    """
    from scipy.optimize import linprog

    from .closure import normal_index

    rows = [s.start + normal_index(c) for c, s in zip(grasp.contacts, grasp.slices, strict=True)]
    N = grasp.matrix[:, rows].T * grasp.scale  # rates of scaled twists: lengths for angles
    k, p = N.shape
    _, s, Vt = np.linalg.svd(N)
    rank = int((s > 1e-9 * max(float(s[0]), 1e-300)).sum())
    found = linprog(
        -N.sum(axis=0), A_ub=np.vstack([-N, N]), b_ub=np.append(np.zeros(k), np.ones(k)), bounds=[(-1.0, 1.0)] * p,
        method="highs",
    )  # fmt: skip
    motion = np.asarray(found.x) if found.status == 0 else np.zeros(p)
    rates = N @ motion
    if rates.max() > RATE:
        return Immobility(ImmobilityStatus.MOBILE, motion * grasp.scale, np.maximum(rates, 0.0), p - rank)
    if rank < p:
        return Immobility(ImmobilityStatus.SLIDING, Vt[-1] * grasp.scale, np.zeros(k), p - rank)
    return Immobility(ImmobilityStatus.SUCCESS, np.zeros(p), np.zeros(k), 0)
