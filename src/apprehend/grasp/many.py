"""Many grasps of one kind as arrays: equally many contacts of one model, in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_shaped
from ..errors import InputError
from ..kernels import closure as kernel
from ..parallel import over_ranges
from .ball import Generators
from .contact import Contact, ContactModel, check_numbers, model_of

if TYPE_CHECKING:
    from .grasp import Grasp

CODES = {
    ContactModel.FRICTIONLESS: 0, ContactModel.COULOMB: 1, ContactModel.SOFT: 2, ContactModel.SOFT_BOX: 3,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Many:
    """N grasps of k contacts: ``points, inward (N, k, 3)``, ``friction, torsion (N, k)``, ``about (N, 3)``,
    ``length (N,)``, and the *shape* of the batch that the caller gave."""

    shape: tuple[int, ...]
    model: ContactModel
    points: Array
    inward: Array
    friction: Array
    torsion: Array
    about: Array
    length: Array

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, which: slice) -> Many:
        """Some of them."""
        arrays = (self.points, self.inward, self.friction, self.torsion, self.about, self.length)
        parts = [v[which] for v in arrays]
        return Many((len(parts[0]),), self.model, *parts)

    def grasp(self, i: int) -> Grasp:
        """One of them."""
        from .grasp import Grasp

        each = zip(self.points[i], self.inward[i], self.friction[i], self.torsion[i], strict=True)
        contacts = [Contact(p, n, float(mu), self.model, float(gamma)) for p, n, mu, gamma in each]
        return Grasp(contacts, reference=self.about[i], length=float(self.length[i]))

    @cached_property
    def generators(self) -> Generators:
        """Bases of the cones with unit normal force, in scaled wrench space."""
        count, k = self.friction.shape
        parts = Generators(np.empty((count, k, 6)), np.empty((count, k, 3, 6)), np.empty((count, k), np.int64))
        codes = np.full((count, k), CODES[self.model], np.int64)
        over_ranges(
            lambda a, b: kernel.generate(
                self.points[a:b], self.inward[a:b], self.friction[a:b], self.torsion[a:b], codes[a:b], self.about[a:b],
                1.0 / self.length[a:b], *(part[a:b] for part in parts),
            ),
            count, 1024,
        )  # fmt: skip
        return parts


def read_many(
    positions: ArrayLike, normals: ArrayLike, friction: ArrayLike, model: ContactModel | str, torsion: ArrayLike,
    reference: ArrayLike, length: ArrayLike,
) -> Many:  # fmt: skip
    """The arguments of a batched function, checked: ``(..., k, 3)`` positions and inward normals, and what spreads.

    Raises `InputError` as `Contact` does, naming the first entry.
    """
    p = as_shaped(positions, "positions", 3)
    n = as_shaped(normals, "normals", 3)
    if p.ndim < 2 or p.shape != n.shape or not p.shape[-2]:
        raise InputError(f"positions have shape {p.shape} and normals {n.shape}; expected (..., k, 3) for both")
    size = np.sqrt(np.einsum("...i,...i->...", n, n))
    bad = np.argwhere(np.abs(size - 1.0) > 1e-6)
    if len(bad):
        at = tuple(int(i) for i in bad[0])
        raise InputError(f"normals{list(at)} has length {size[at]:.6g}; expected 1: divide normals by their length")
    kind = model_of(model)
    shape, k = p.shape[:-2], p.shape[-2]
    count = int(np.prod(shape))

    def spread(value: ArrayLike, name: str, *tail: int) -> Array:
        given = as_array(value, name)
        try:
            full = np.broadcast_to(given, (*shape, *tail))
        except ValueError:
            raise InputError(f"{name} has shape {given.shape}; expected what spreads to {(*shape, *tail)}") from None
        return np.array(full, order="C").reshape(count, *tail)

    mu, gamma = spread(friction, "friction", k), spread(torsion, "torsion", k)
    check_numbers(friction=mu, torsion=gamma)
    about, scale = spread(reference, "reference", 3), spread(length, "length")
    if not (scale > 0.0).all():
        raise InputError(f"length is {scale.min()}; expected positive lengths in m")
    points = np.ascontiguousarray(p.reshape(count, k, 3))
    inward = np.ascontiguousarray((n / size[..., None]).reshape(count, k, 3))
    return Many(shape, kind, points, inward, mu, gamma, about, scale)
