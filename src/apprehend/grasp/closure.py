"""Force closure and form closure, each with its proof (G 2.2.1, 2.2.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..kernels import hull
from ..result import Result, Status
from .ball import largest
from .contact import Contact, ContactModel
from .program import solve

if TYPE_CHECKING:
    from .grasp import Grasp

MARGIN = 1e-7
"""A strict internal force must lie this far inside every cone, with normal forces that sum to one."""


class ClosureStatus(Status):
    """Verdicts of the closure tests."""

    SUCCESS = "the grasp resists every wrench"
    FLAT = "the contacts cannot produce every wrench: the grasp matrix is not of full rank"
    OPEN = "some wrench cannot be resisted: no internal force lies strictly inside all friction cones"


@dataclass(frozen=True, eq=False)
class Closure(Result):
    """Verdict with its proof.

    For SUCCESS *internal_force* ``(m,)`` has ``G f = 0``, normal forces that sum to one, and lies *margin* inside
    every cone (as a normal force: see `Contact.slack`; Satz 2.4). Otherwise *wrench* ``(p,)`` is a unit vector in
    scaled wrench space along which no contact can push: ``wrench · (scale G f) ≤ tolerance · Σ f_n`` in all cones.
    """

    status: ClosureStatus
    margin: float
    internal_force: Array
    wrench: Array
    rank: int
    tolerance: float
    contacts: int
    needed: int
    """The least number of contacts that the test can need (Carathéodory: p + 1 without friction; Steinitz: 2 p always
    suffice, if any number does)."""

    def explain(self) -> str:
        """The verdict with its numbers."""
        if self.success:
            return f"{self.status.value}; an internal force lies {self.margin:.3g} inside all cones (per unit of force)"
        least = ""
        if self.contacts < self.needed:
            least = f"; such contacts must be at least {self.needed}, there are {self.contacts}"
        return f"{self.status.value}{least} (rank {self.rank} of {len(self.wrench)}, margin {self.margin:.3g})"


def force_closure(grasp: Grasp) -> Closure:
    """Decide force closure exactly: ``max t`` over ``G f = 0``, ``f − t e`` in the cones, ``Σ f_n`` bounded.

    e is the unit normal force of every contact. The grasp is force-closure exactly if G is onto and t > 0 (Satz 2.4);
    at t = 0 the dual solution is a wrench that the contacts cannot resist. One cone program, no discretised cones;
    the tolerance is `MARGIN`.
    """
    needed = {ContactModel.FRICTIONLESS: grasp.wrench_size + 1}.get(grasp.contacts[0].model, 2)
    if len({c.model for c in grasp.contacts}) > 1:
        needed = 2
    elif grasp.dimension == 3 and grasp.contacts[0].model is ContactModel.COULOMB:
        needed = 3
    m = grasp.matrix.shape[1]
    p = grasp.wrench_size
    U, s, _ = np.linalg.svd(grasp.matrix * grasp.scale[:, None] @ _stacked(grasp)[0])
    rank = int((s > 1e-9 * max(float(s[0]), 1e-300)).sum())  # of what the cones can use: µ = 0 transmits no friction
    if rank < p:
        return Closure(ClosureStatus.FLAT, 0.0, np.zeros(m), U[:, -1].copy(), rank, MARGIN, len(grasp), needed)
    t, force, wrench = _strict_internal(grasp)
    if t > MARGIN:
        return Closure(ClosureStatus.SUCCESS, t, force, np.zeros(p), rank, MARGIN, len(grasp), needed)
    ball = largest(hull.BASES, grasp.generators, tolerance=1.0 - 1e-9)
    if ball.outcome == hull.OUTSIDE:  # the sharper of two proofs
        wrench = ball.worst
    return Closure(ClosureStatus.OPEN, max(t, 0.0), np.zeros(m), wrench, rank, MARGIN, len(grasp), needed)


def _strict_internal(grasp: Grasp) -> tuple[float, Array, Array]:
    """Margin t, the internal force, and the dual wrench direction."""
    G = grasp.matrix * grasp.scale[:, None]
    p, k = grasp.wrench_size, len(grasp)
    cones = [c for cc in grasp.cones for c in cc.cones]
    maps, e, links = _stacked(grasp)
    n = maps.shape[1]
    normal = _normals(grasp) @ maps
    A = np.zeros((p + len(links) + 1, n + 2))
    A[:p, :n], A[:p, n] = G @ maps, G @ maps @ e
    A[p : p + len(links), :n] = links
    A[-1, :n], A[-1, n], A[-1, n + 1] = normal / k, normal @ e / k, 1.0  # the normal forces of f sum to at most k
    b = np.zeros(len(A))
    b[:p], b[-1] = G @ maps @ e, 1.0 + normal @ e / k
    c = np.zeros(n + 2)
    c[n] = -1.0
    answer = solve(A[None], b[None], c[None], (*cones, 1, 1))
    t = float(answer.x[0, n]) - 1.0
    force = maps @ (answer.x[0, :n] + t * e) / k
    usable = maps.any(axis=1)  # µ = 0 leaves the tangential components zero
    force[usable] -= np.linalg.lstsq(G[:, usable], G @ force, rcond=None)[0]  # onto G f = 0 to the last digit
    if t > MARGIN:
        force /= float(_normals(grasp) @ force)
        t = min(float(c.slack(force[s])) for c, s in zip(grasp.contacts, grasp.slices, strict=True))
    wrench = answer.y[0, :p]
    length = float(np.linalg.norm(wrench))
    return t, force, wrench / length if length > 0.0 else wrench


def _stacked(grasp: Grasp) -> tuple[Array, Array, Array]:
    """``maps (m, n)`` from cone coordinates to forces, the interior element e ``(n,)``, and link rows ``(L, n)``."""
    cones = grasp.cones
    n = sum(c.map.shape[1] for c in cones)
    maps, e, links = np.zeros((grasp.matrix.shape[1], n)), np.zeros(n), []
    column = 0
    for cc, s in zip(cones, grasp.slices, strict=True):
        width = cc.map.shape[1]
        maps[s, column : column + width] = cc.map
        start = column
        for size in cc.cones:
            e[start] = 1.0
            start += size
        for row in cc.link:
            full = np.zeros(n)
            full[column : column + width] = row
            links.append(full)
        column += width
    return maps, e, np.array(links).reshape(-1, n)


def _normals(grasp: Grasp) -> Array:
    """Row ``(m,)`` that sums the normal forces."""
    row = np.zeros(grasp.matrix.shape[1])
    for contact, s in zip(grasp.contacts, grasp.slices, strict=True):
        row[s.start + normal_index(contact)] = 1.0
    return row


def normal_index(contact: Contact) -> int:
    """Which component of a contact's force is the normal one."""
    return 0 if contact.size == 1 else 1 if contact.dimension == 2 else 2


def form_closure(grasp: Grasp) -> Closure:
    """Decide form closure: force closure of the same contacts without friction (G 2.2.2), a linear program.

    The normals must span wrench space positively; this needs p + 1 contacts (7 in space, 4 in the plane). It is
    immobility of first order: a body that curvature alone holds is not counted.
    """
    from .grasp import Grasp

    bare = Grasp(
        [Contact(c.position, c.normal, 0.0, ContactModel.FRICTIONLESS) for c in grasp.contacts],
        reference=grasp.reference,
        length=grasp.length,
    )
    return force_closure(bare)
