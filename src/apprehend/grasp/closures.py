"""Force closure of many grasps at once, each verdict with its proof."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray
from ..errors import InputError
from ..kernels import closure as kernel
from ..parallel import over_ranges
from .ball import Generators, separated
from .closure import MARGIN, force_closure
from .contact import ContactModel
from .many import read_many

if TYPE_CHECKING:
    from .grasp import Grasp

STEPS = 12
"""Newton steps on lanes before a grasp is settled one by one."""


@dataclass(frozen=True, eq=False)
class Closures:
    """Verdicts on a batch of grasps of k contacts, in the order and shape of the batch.

    Where *closed*, *forces* ``(..., k, 4)`` (f₁, f₂, f₃, τ in the contact frames; zeros where a model lacks them) have
    ``G f = 0``, normal forces that sum to one, and lie *margin* inside all cones (Satz 2.4). Elsewhere *wrenches*
    ``(..., 6)`` are unit vectors in scaled wrench space with ``wrench · (scale G f) ≤ 2e-9 Σ f_n`` for all forces in
    the cones: no contact can push that way.
    """

    closed: BoolArray
    margin: Array
    forces: Array
    wrenches: Array


def force_closures(
    positions: ArrayLike,
    normals: ArrayLike,
    friction: ArrayLike = 0.6,
    model: ContactModel | str = ContactModel.COULOMB,
    torsion: ArrayLike = 0.0,
    *,
    reference: ArrayLike = (0.0, 0.0, 0.0),
    length: ArrayLike = 1.0,
) -> Closures:
    """Decide force closure of many grasps in space exactly, with proofs (`closure.force_closure`, `kernels.closure`).

    *positions*, *normals* ``(..., k, 3)`` (unit, inward); *friction*, *torsion* ``(..., k)`` or numbers; *reference*
    ``(..., 3)`` and *length* ``(...)`` as in `Grasp`. Raises `InputError` as `Contact` does, naming the first entry.
    """
    many = read_many(positions, normals, friction, model, torsion, reference, length)
    shape, kind, mu, gamma = many.shape, many.model, many.friction, many.torsion
    count, k = mu.shape
    verdict, margin, force, wrench = decide(many.generators)
    closed = verdict == kernel.CLOSED
    forces = np.zeros((count, k, 4))
    used = [2] if kind is ContactModel.FRICTIONLESS else [0, 1, 2, 3][: kind.components]
    forces[..., used] = np.stack([mu * force[..., 1], mu * force[..., 2], force[..., 0], gamma * force[..., 3]], -1)[
        ..., used
    ]
    for i in np.flatnonzero(verdict == kernel.UNDECIDED).tolist():
        one = force_closure(many.grasp(i))
        closed[i], margin[i], wrench[i] = one.success, one.margin, one.wrench
        forces[i][:, used] = one.internal_force.reshape(k, -1)
    return Closures(
        closed.reshape(shape), np.where(closed, margin, 0.0).reshape(shape),
        np.where(closed[:, None, None], forces, 0.0).reshape(*shape, k, 4),
        np.where(closed[:, None], 0.0, wrench).reshape(*shape, 6),
    )  # fmt: skip


def decide(parts: Generators) -> tuple[IntArray, Array, Array, Array]:
    """Verdicts of `kernels.closure` for ``N`` grasps, with margins, forces in half-axes, and separating directions.

    What the lanes leave open is settled by the polytope of `kernels.hull`, where it finds a separating direction; what
    stays UNDECIDED is flat, or closed by a hair.
    """
    count, k, d = parts.base.shape
    verdict, margin = np.empty(count, np.int64), np.zeros(count)
    force, wrench = np.zeros((count, k, 4)), np.zeros((count, d))

    def work(a: int, b: int) -> None:
        kernel.prove(*(part[a:b] for part in parts), MARGIN, STEPS, verdict[a:b], margin[a:b], force[a:b], wrench[a:b])

    over_ranges(work, count, 256)
    rest = np.flatnonzero(verdict == kernel.UNDECIDED)
    if len(rest):
        outside, worst = separated(parts.base[rest], parts.spread[rest], parts.flags[rest])
        verdict[rest[outside]], wrench[rest[outside]] = kernel.OPEN, worst[outside]
    return verdict, margin, force, wrench


def closed(grasps: Sequence[Grasp]) -> BoolArray:
    """Force closure of many grasps with equally many contacts of one dimension: booleans ``(N,)``.

    As `Grasp.force_closure` decides, hundreds of times faster; `force_closures` also returns the proofs.
    """
    sizes = {(len(g), g.dimension) for g in grasps}
    if not sizes:
        return np.empty(0, np.bool_)
    if len(sizes) > 1:
        raise InputError(
            f"grasps have {sorted(k for k, _ in sizes)} contacts in {sorted({d for _, d in sizes})} dimensions; "
            "expected equally many in one dimension: call closed for each kind"
        )
    sets = [g.generators for g in grasps]
    parts = Generators(
        np.stack([s.base for s in sets]), np.stack([s.spread for s in sets]), np.stack([s.flags for s in sets])
    )
    verdict = decide(parts)[0]
    answer: BoolArray = verdict == kernel.CLOSED
    for i in np.flatnonzero(verdict == kernel.UNDECIDED).tolist():
        answer[i] = force_closure(grasps[i]).success
    return answer
