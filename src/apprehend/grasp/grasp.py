"""`Grasp`: contacts on a body, the grasp matrix, and what follows from it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_own, as_shaped
from ..bodies import Body
from ..errors import InputError, expect
from ..kernels.hull_support import BOX, SAME
from .ball import Generators
from .closure import Closure, force_closure, form_closure
from .contact import Contact, ContactModel, model_of
from .forces import ContactForces, ForceBatch, contact_forces
from .immobility import Immobility, immobility
from .limits import Limits, with_torques
from .patch import Patch
from .program import ContactCone, contact_cone
from .push import Push, largest_force
from .quality import Quality, measure

RANK_TOLERANCE = 1e-9
"""Singular values below this share of the largest count as zero."""
OFF_SURFACE = 0.02
"""Contacts may lie this share of the body's radius off its surface."""


class Grasp:
    """A set of contacts that hold a body (G 2.1.2: the pair of grasp matrix and friction cones).

    *contacts*: `Contact` and `Patch`, all in space, or all in the plane; models may be mixed. A patch counts as the
    contacts at its corners; *parts* are the indices of the contacts that each thing given became. *body* gives the
    reference point (its centre of mass) and the length that torques are divided by in qualities (its radius);
    *reference* ``(d,)`` and *length* set them by hand. Without a body the reference is the origin and the length 1 m.
    Wrenches are (f, τ) about the reference point, in axes of the body; in the plane (f_x, f_y, τ).
    Raises `InputError` for no contacts, mixed dimensions, and contacts that do not lie on the body.
    """

    def __init__(
        self,
        contacts: Iterable[Contact | Patch],
        body: Body | None = None,
        *,
        reference: ArrayLike | None = None,
        length: float | None = None,
    ) -> None:
        if body is not None:
            expect(body, "Body", "body")
        if isinstance(contacts, Contact | Patch):
            raise InputError("contacts is a single contact; expected a sequence of them: [contact]")
        contacts = list(contacts)
        for i, c in enumerate(contacts):
            if not isinstance(c, Contact | Patch):
                raise InputError(f"contacts[{i}] is a {type(c).__name__}; expected a Contact or a Patch")
        given = [c.contacts if isinstance(c, Patch) else (c,) for c in contacts]
        self.contacts = tuple(c for group in given for c in group)
        ends = np.cumsum([0, *map(len, given)]).tolist()
        self.parts = tuple(tuple(range(a, b)) for a, b in zip(ends[:-1], ends[1:], strict=True))
        if not self.contacts:
            raise InputError("contacts is empty; a grasp needs at least one contact")
        dimensions = {c.dimension for c in self.contacts}
        if len(dimensions) > 1:
            raise InputError("contacts in the plane and in space are mixed; expected all (2,) or all (3,)")
        self.dimension = dimensions.pop()
        self.body = body
        if reference is None:
            reference = body.com if body is not None and self.dimension == 3 else np.zeros(self.dimension)
        self.reference = as_own(reference, "reference")
        if self.reference.shape != (self.dimension,):
            raise InputError(f"reference has shape {self.reference.shape}; expected ({self.dimension},)")
        self.length = float(length if length is not None else body.radius if body is not None else 1.0)
        if not (np.isfinite(self.length) and self.length > 0.0):
            raise InputError(f"length is {self.length}; expected a positive length in m")
        if body is not None and self.dimension == 3:
            self._check_on_surface(body)

    def _check_on_surface(self, body: Body) -> None:
        from .surface import Surface

        points = np.array([c.position for c in self.contacts])
        distance = Surface(body.vertices, body.faces).nearest(points)[1]
        worst = int(np.argmax(distance))
        if distance[worst] > OFF_SURFACE * body.radius:
            raise InputError(
                f"contact {worst} at {points[worst].tolist()} lies {1e3 * distance[worst]:.2f} mm off the surface of "
                f"{body.name!r} (allowed {1e3 * OFF_SURFACE * body.radius:.2f} mm); are its coordinates in the body's "
                "frame, in metres?"
            )

    def __len__(self) -> int:
        return len(self.contacts)

    def __repr__(self) -> str:
        models = ", ".join(c.model.value for c in self.contacts)
        return f"<Grasp: {len(self)} contacts ({models})>"

    # the matrix and its maps

    @property
    def wrench_size(self) -> int:
        """Dimension p of wrenches: 6, in the plane 3."""
        return 6 if self.dimension == 3 else 3

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Where each contact's components lie in the stacked contact forces."""
        ends = np.cumsum([0, *(c.size for c in self.contacts)])
        return tuple(slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True))

    @cached_property
    def matrix(self) -> Array:
        """G ``(p, m)``: ``F_o = G f_c`` with ``G_i = Ad(T_oc⁻¹)ᵗ B_c`` (G 2.1.2; the script's formula in the text
        writes Ad(T_oc)ᵗ, its written-out matrix is the right one)."""
        columns = []
        for contact in self.contacts:
            D = contact.directions.copy()
            arm = contact.position - self.reference
            if self.dimension == 3:
                D[3:] += np.cross(arm, D[:3], axisb=0).T
            else:
                D[2] += arm[0] * D[1] - arm[1] * D[0]
            columns.append(D)
        return np.concatenate(columns, axis=1)

    @cached_property
    def scale(self) -> Array:
        """``(p,)``: factors that make wrenches comparable, 1 for forces and 1 / length for torques.

        The script divides only ``p × f`` by the length (G 2.2.3); the moment of a soft finger is a torque like any
        other and is divided too, so that qualities do not change with the unit of length.
        """
        d = self.dimension
        return np.concatenate([np.ones(d), np.full(self.wrench_size - d, 1.0 / self.length)])

    @cached_property
    def _svd(self) -> tuple[Array, Array, Array]:
        U, s, Vt = np.linalg.svd(self.matrix * self.scale[:, None])
        return U, s, Vt

    @cached_property
    def rank(self) -> int:
        """Rank of G."""
        s = self._svd[1]
        return int((s > RANK_TOLERANCE * max(float(s[0]), 1e-300)).sum())

    @property
    def null_space(self) -> Array:
        """Orthonormal basis ``(m, m − rank)`` of the internal forces 𝒩(G)."""
        return self._svd[2][self.rank :].T.copy()

    def object_wrench(self, forces: ArrayLike) -> Array:
        """``F_o = G f_c`` ``(..., p)`` of stacked contact forces ``(..., m)``."""
        out: Array = as_shaped(forces, "forces", self.matrix.shape[1]) @ self.matrix.T
        return out

    def contact_velocity(self, twist: ArrayLike) -> Array:
        """``Gᵗ V_po`` ``(..., m)``: contact velocities along what contacts transmit, for object twists ``(..., p)``.

        The twist is (v, ω) of the object at the reference point, in its axes.
        """
        out: Array = as_shaped(twist, "twist", self.wrench_size) @ self.matrix
        return out

    # cones in standard form

    @cached_property
    def cones(self) -> tuple[ContactCone, ...]:
        """The friction cones in standard form."""
        return tuple(contact_cone(c) for c in self.contacts)

    @cached_property
    def generators(self) -> Generators:
        """Bases of the cones with unit normal force, in scaled wrench space."""
        k, p = len(self), self.wrench_size
        base, spread, flags = np.zeros((k, p)), np.zeros((k, 3, p)), np.zeros(k, np.int64)
        for part in self.parts:
            flags[list(part[1:])] = SAME
        G = self.matrix * self.scale[:, None]
        for i, (contact, s) in enumerate(zip(self.contacts, self.slices, strict=True)):
            columns = G[:, s]
            if contact.size == 1:
                base[i] = columns[:, 0]
            elif contact.dimension == 2:
                base[i], spread[i, 0] = columns[:, 1], contact.friction * columns[:, 0]
            else:
                base[i] = columns[:, 2]
                spread[i, 0], spread[i, 1] = contact.friction * columns[:, 0], contact.friction * columns[:, 1]
                if contact.size == 4:
                    spread[i, 2] = contact.torsion * columns[:, 3]
                    flags[i] |= BOX if contact.model is ContactModel.SOFT_BOX else 0
        return Generators(base, spread, flags)

    def edges(self, m: int = 8) -> Array:
        """Wrenches ``(E, p)``, scaled, of cones with *m* edges inscribed in each friction cone, unit normal force each.

        Edges lie at angles 2πk/m from t₁ towards t₂; those of a soft finger are doubled with ``±γ`` (box), or joined
        by the two poles of the ellipsoid (elliptic). In the plane two edges are exact.
        """
        return np.concatenate(self.edge_groups(m))

    def edge_groups(self, m: int = 8) -> list[Array]:
        """As `edges`, for each contact its own ``(E_i, p)``."""
        if m < 3:
            raise InputError(f"m is {m}; a polyhedral cone needs at least 3 edges")
        base, spread, flags = self.generators
        turn = 2.0 * np.pi * np.arange(m) / m
        rings = base[:, None] + np.cos(turn)[:, None] * spread[:, None, 0] + np.sin(turn)[:, None] * spread[:, None, 1]
        if all(c.size == 3 for c in self.contacts):
            return list(rings)
        rows = []
        for contact, b, s, flag, ring in zip(self.contacts, base, spread, flags, rings, strict=True):
            if contact.size == 1:
                rows.append(b[None])
            elif contact.dimension == 2:
                rows.append(np.stack([b + s[0], b - s[0]]))
            else:
                if flag & BOX:
                    rows.append(np.concatenate([ring + s[2], ring - s[2]]))
                elif contact.size == 4:
                    rows.append(np.concatenate([ring, np.stack([b + s[2], b - s[2]])]))
                else:
                    rows.append(ring)
        return rows

    # properties

    def force_closure(self) -> Closure:
        """Whether the contacts resist every wrench: see `closure.force_closure`."""
        return force_closure(self)

    def form_closure(self) -> Closure:
        """Whether the contacts hold the body without friction: see `closure.form_closure`."""
        return form_closure(self)

    def immobility(self) -> Immobility:
        """Which motions the contacts leave the body if they do not move and have no friction: see `immobility`."""
        return immobility(self)

    def removable(self) -> tuple[int, ...]:
        """Indices of contacts (of *parts*, where there are patches) any one of which the grasp can lose and stay
        force-closure."""
        keep = []
        for i, part in enumerate(self.parts):
            rest = [c for j, c in enumerate(self.contacts) if j not in part]
            if rest and Grasp(rest, reference=self.reference, length=self.length).force_closure().success:
                keep.append(i)
        return tuple(keep)

    def antipodal(self) -> bool:
        """Whether two contacts see each other within their friction cones (G 2.5, 2.6).

        In the plane with Coulomb contacts, and in space with soft fingers, this is force closure.
        """
        if len(self) != 2:
            raise InputError(f"antipodal is a property of two contacts; this grasp has {len(self)}")
        a, b = self.contacts
        line = b.position - a.position
        if float(np.linalg.norm(line)) == 0.0:
            return False
        return a.angle_margin(line) > 0.0 and b.angle_margin(-line) > 0.0

    def quality(self, kind: str = "epsilon", **options: Any) -> Quality:
        """A number for how good the grasp is: see `quality.measure`."""
        return measure(self, kind, **options)

    def contact_forces(
        self,
        wrench: ArrayLike,
        objective: str = "min_normal",
        limits: Limits | None = None,
        *,
        torque_limits: ArrayLike | None = None,
        hand_jacobian: ArrayLike | None = None,
        **options: Any,
    ) -> ContactForces | ForceBatch:
        """Contact forces that balance an external wrench: see `forces.contact_forces`.

        *torque_limits*: largest joint torques ``(n,)`` either way, or pairs of lowest and highest ``(n, 2)``, in N m,
        with *hand_jacobian* J_H ``(m, n)`` (`hand_jacobian`): ``lower ≤ J_Hᵗ f ≤ upper``.
        """
        if torque_limits is not None:
            limits = with_torques(limits, torque_limits, hand_jacobian)
        elif hand_jacobian is not None:
            limits = replace(limits or Limits(), hand_jacobian=hand_jacobian)
        return contact_forces(self, wrench, objective, limits, **options)

    def largest_force(self, direction: ArrayLike, limits: Limits, **options: Any) -> Push:
        """The largest force along a direction, or within a cone of directions: see `push.largest_force`."""
        return largest_force(self, direction, limits, **options)

    # making

    @classmethod
    def on_surface(
        cls,
        body: Body,
        points: ArrayLike,
        *,
        friction: float | None = None,
        model: ContactModel | str = ContactModel.COULOMB,
        torsion: float | None = None,
    ) -> Grasp:
        """Contacts at the places of the surface nearest to *points* ``(k, 3)``, with its inward normals there."""
        from .surface import Surface

        surface = Surface(body.vertices, body.faces)
        near, _, faces = surface.nearest(points)
        mu = body.friction if friction is None else friction
        gamma = body.torsional_friction if torsion is None else torsion
        made = [Contact(p, -surface.normals[f], mu, model_of(model), gamma) for p, f in zip(near, faces, strict=True)]
        return cls(made, body)
