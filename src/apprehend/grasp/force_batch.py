"""Optimal contact forces of many grasps at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_shaped, as_vector, choice
from ..errors import InputError
from .contact import ContactModel
from .force_program import Parts, answers, build
from .forces import OBJECTIVES, ForceBatch, batch, contact_forces
from .limits import NO_LIMITS, Limits, check_limits
from .many import Many, read_many

CHUNK = 1024
"""Grasps whose programs are written at a time: they stay in the cache until they are solved."""


def optimal_forces(
    positions: ArrayLike,
    normals: ArrayLike,
    wrenches: ArrayLike,
    friction: ArrayLike = 0.6,
    model: ContactModel | str = ContactModel.COULOMB,
    torsion: ArrayLike = 0.0,
    *,
    objective: str = "min_normal",
    limits: Limits | None = None,
    weights: ArrayLike | None = None,
    reference: ArrayLike = (0.0, 0.0, 0.0),
    length: ArrayLike = 1.0,
) -> ForceBatch:
    """Contact forces of many grasps in space, each against its own wrench: `contact_forces` in batches.

    *positions*, *normals* ``(..., k, 3)`` (unit, inward); *wrenches* ``(..., 6)`` that act on the bodies from outside,
    about *reference* ``(..., 3)``; *friction*, *torsion* ``(..., k)`` or numbers; *length* ``(...)`` as in `Grasp`.
    *limits* and *weights* ``(k,)`` hold for all of them; any objective but ``barrier``. Raises `InputError` as
    `Contact` does, naming the first entry.
    """
    choice(objective, "objective", tuple(o for o in OBJECTIVES if o != "barrier"))
    many = read_many(positions, normals, friction, model, torsion, reference, length)
    limits = NO_LIMITS if limits is None else limits
    check_limits(limits)
    weight = None if weights is None else as_vector(weights, "weights", many.friction.shape[1])
    w = as_shaped(wrenches, "wrenches", 6)
    try:
        w = np.array(np.broadcast_to(w, (*many.shape, 6)), order="C").reshape(-1, 6)
    except ValueError:
        raise InputError(f"wrenches have shape {w.shape}; expected {(*many.shape, 6)}, one for each grasp") from None
    if not len(many):
        k, m = many.friction.shape[1], many.model.components
        empty = np.zeros(many.shape)
        return ForceBatch(
            np.zeros((*many.shape, k * m)),
            empty,
            empty,
            empty,
            np.zeros((*many.shape, 6)),
            empty.astype(np.int64),
            empty,
        )
    if len(many) < 2 or (many.model.components == 4 and not many.torsion.all()):
        found = [
            contact_forces(many.grasp(i), w[i : i + 1], objective, limits, weights=weight) for i in range(len(many))
        ]
        return _joined([b for b in found if isinstance(b, ForceBatch)], many)
    parts, template = [], Parts.of(many.grasp(0))
    for i in range(0, len(many), CHUNK):
        some = many[i : max(i + CHUNK, i + 2)]
        program = build(_parts(some, template), objective, limits, weight)
        mine = w[i : i + CHUNK]
        part = batch(program, mine, answers(program, mine), (len(mine),))
        for j in np.flatnonzero(program.weak).tolist():
            part.put(j, _alone(some, mine, j, objective, limits, weight))
        parts.append(part)
    return _joined(parts, many)


def _alone(many: Many, w: Array, i: int, objective: str, limits: Limits, weights: Array | None) -> ForceBatch:
    """One of them, as a batch of one."""
    found = contact_forces(many.grasp(i), w[i : i + 1], objective, limits, weights=weights)
    assert isinstance(found, ForceBatch)
    return found


def _joined(parts: list[ForceBatch], many: Many) -> ForceBatch:
    def whole(name: str) -> Array:
        out: Array = np.concatenate([getattr(p, name) for p in parts])
        return out.reshape(many.shape + out.shape[1:])

    return ForceBatch(
        whole("forces"), whole("value"), whole("bound"), whole("residual"), whole("certificate"),
        whole("codes").astype(np.int64), whole("steps"),
    )  # fmt: skip


def _parts(many: Many, template: Parts) -> Parts:
    """The cone programs' parts, from the bases of the friction cones."""
    base, spread, _ = many.generators
    count, k = many.friction.shape
    m, n = template.maps.shape[1:]
    wide, each = n // k, m // k
    wrenches, maps = np.zeros((count, 6, n)), np.zeros((count, m, n))
    wrenches[:, :, ::wide] = base.transpose(0, 2, 1)
    maps[:, np.arange(k) * each + (2 if each > 1 else 0), np.arange(k) * wide] = 1.0
    twist = 4 if many.model is ContactModel.SOFT_BOX else 3
    for axis, column, factor in ((0, 1, many.friction), (1, 2, many.friction), (3, twist, many.torsion)):
        if axis < each > 1:
            wrenches[:, :, column::wide] = spread[:, :, min(axis, 2)].transpose(0, 2, 1)
            maps[:, np.arange(k) * each + axis, np.arange(k) * wide + column] = factor
    scale = np.ones((count, 6))
    scale[:, 3:] /= many.length[:, None]
    return Parts(
        wrenches, maps, template.e, template.links, template.cones, template.normals, many.friction, many.torsion,
        scale, template.grasp,
    )  # fmt: skip
