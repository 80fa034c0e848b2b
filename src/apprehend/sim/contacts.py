"""Contacts of the last step: who touches whom, where, and how hard."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from .model import Plant


@dataclass(frozen=True, eq=False)
class Touch:
    """One contact point. The wrench is what *second* gets from *first*, in the contact frame (z: the normal).

    *frame* (3, 3) has the contact's axes as columns in world coordinates: z from *first* into *second*, as the
    inward normal of G 2.1.1 is for the body that is touched.
    """

    first: str
    second: str
    position: Array  # (3,) in the world
    frame: Array  # (3, 3)
    depth: float  # m of penetration
    normal_force: float  # N, ≥ 0
    tangential: Array  # (2,) N along the frame's x and y
    torsion: float  # N m about the normal

    @property
    def force(self) -> Array:
        """The force on *second* in world coordinates, in N."""
        return np.asarray(self.frame @ np.array([*self.tangential, self.normal_force]))


@dataclass(frozen=True, eq=False)
class ContactTable:
    """All contacts of one step as arrays; forces are on the second body of the pair, in world coordinates."""

    bodies: IntArray  # (k, 2) engine's bodies
    position: Array  # (k, 3)
    axes: Array  # (k, 3, 3) rows: normal (first → second), tangent, tangent
    depth: Array  # (k,)
    local: Array  # (k, 4) normal force, two tangential forces, torsional torque

    @staticmethod
    def empty() -> ContactTable:
        """No contacts."""
        zero = np.zeros
        return ContactTable(np.zeros((0, 2), np.int64), zero((0, 3)), zero((0, 3, 3)), zero(0), zero((0, 4)))

    @staticmethod
    def read(model: Any, data: Any) -> ContactTable:
        """The contacts that *data* holds between a solved step and the next collision detection."""
        contact = data.contact
        address = contact.efc_address
        active = np.flatnonzero(address >= 0)
        if not active.size:
            return ContactTable.empty()
        start = address[active][:, None] + np.arange(4)
        dims = contact.dim[active][:, None]
        inside = np.arange(4) < dims  # contacts of lower dimension have no torsional row
        local = np.where(inside, data.efc_force[np.minimum(start, data.efc_force.size - 1)], 0.0)
        return ContactTable(
            model.geom_bodyid[contact.geom[active]].astype(np.int64),
            contact.pos[active].copy(),
            contact.frame[active].reshape(-1, 3, 3).copy(),
            -contact.dist[active],
            local,
        )

    def __len__(self) -> int:
        return len(self.depth)

    @property
    def force(self) -> Array:
        """(k, 3) forces on the second body of each pair."""
        return np.asarray(np.einsum("ki,kij->kj", self.local[:, :3], self.axes))

    def touches(self, plant: Plant) -> tuple[Touch, ...]:
        """The rows as values with names."""
        out = []
        for i in range(len(self)):
            normal, x, y = self.axes[i]
            fn, fx, fy, torsion = self.local[i]
            first, second = (plant.owners[b] for b in self.bodies[i])
            frame = np.column_stack([x, y, normal])
            out.append(
                Touch(
                    first, second, self.position[i].copy(), frame, float(self.depth[i]), float(fn),
                    np.array([fx, fy]), float(torsion),
                )
            )  # fmt: skip
        return tuple(out)

    def between(self, one: Iterable[int], other: Iterable[int] | None = None) -> tuple[IntArray, Array]:
        """Rows in which a body of *one* touches a body of *other* (None: anything), and the sign of forces on *one*."""
        mine = np.isin(self.bodies, np.fromiter(one, np.int64))
        theirs = ~mine if other is None else np.isin(self.bodies, np.fromiter(other, np.int64))
        as_second: BoolArray = mine[:, 1] & theirs[:, 0]
        as_first: BoolArray = mine[:, 0] & theirs[:, 1]
        rows = np.flatnonzero(as_second | as_first)
        return rows, np.where(as_second[rows], 1.0, -1.0)

    def wrench(self, one: Iterable[int], about: Array, other: Iterable[int] | None = None) -> Array:
        """Force and torque (6,) about the point *about* that the bodies *one* get from *other*, in the world frame."""
        rows, sign = self.between(one, other)
        force = self.force[rows] * sign[:, None]
        arm = self.position[rows] - about
        torsion = self.local[rows, 3, None] * self.axes[rows, 0] * sign[:, None]
        return np.concatenate([force.sum(axis=0), (np.cross(arm, force) + torsion).sum(axis=0)])

    def normal_force(self, one: Iterable[int], other: Iterable[int] | None = None) -> float:
        """Sum of the normal forces between the bodies *one* and *other*, in N."""
        rows, _ = self.between(one, other)
        return float(self.local[rows, 0].sum())
