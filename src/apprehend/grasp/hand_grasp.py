"""A grasp in the fingers of a hand: hand Jacobian, grasp condition, manipulability, structural forces (G 2.3–2.6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_pose, as_shaped, choice
from ..errors import InputError
from ..kinematics import Hand, Robot
from .grasp import RANK_TOLERANCE, Grasp


def hand_jacobian(
    hand: Hand | Robot, q: ArrayLike, grasp: Grasp, frames: Sequence[str], body_pose: ArrayLike | None = None
) -> Array:
    """J_H ``(m, n)``: rows ``B_cᵀ Ad(T_pc⁻¹) J_pf(q)``, the velocity of each fingertip at its contact (G 2.12).

    *frames*: for each contact the link that touches; *q* ``(n,)`` joints of the hand; *body_pose* T_hand_body (default
    the identity). Spatial grasps only. Raises `InputError` if frames and contacts differ in number.
    """
    robot = hand.robot if isinstance(hand, Hand) else hand
    if len(frames) != len(grasp):
        raise InputError(f"frames names {len(frames)} links; the grasp has {len(grasp)} contacts")
    if grasp.dimension != 3:
        raise InputError("the hand Jacobian of a grasp in the plane is not defined; use contacts in space")
    T = np.eye(4) if body_pose is None else as_pose(body_pose, "body_pose")
    joints = as_array(q, "q")
    blocks = []
    for contact, frame in zip(grasp.contacts, frames, strict=True):
        J = robot.jacobian(joints, frame, "spatial")
        point = T[:3, :3] @ contact.position + T[:3, 3]
        R = T[:3, :3] @ contact.rotation
        linear = R.T @ (J[:3] + np.cross(J[3:], point, axisa=0).T)
        blocks.append(contact.basis.T @ np.concatenate([linear, R.T @ J[3:]]))
    return np.concatenate(blocks)


class Row(NamedTuple):
    """One line of the table of G 2.6."""

    property: str
    formula: str
    holds: bool
    dimension: int
    """Of the space of such forces or motions; for the two verdicts the dimension that is missing."""


@dataclass(frozen=True, eq=False)
class HandGrasp:
    """A grasp (G, FC, J_H). The four maps of G 2.6: ``J_H`` and ``Gᵗ`` into contact velocities, ``G`` and ``J_Hᵗ`` out
    of contact forces."""

    grasp: Grasp
    jacobian: Array

    def __post_init__(self) -> None:
        J = as_array(self.jacobian, "jacobian")
        m = self.grasp.matrix.shape[1]
        if J.ndim != 2 or len(J) != m:
            raise InputError(f"jacobian has shape {J.shape}; expected ({m}, n): one row per force component")
        object.__setattr__(self, "jacobian", J)

    @classmethod
    def of(
        cls, hand: Hand | Robot, q: ArrayLike, grasp: Grasp, frames: Sequence[str], body_pose: ArrayLike | None = None
    ) -> HandGrasp:
        """The grasp with the Jacobian of a hand: see `hand_jacobian`."""
        return cls(grasp, hand_jacobian(hand, q, grasp, frames, body_pose))

    @cached_property
    def _svd(self) -> tuple[Array, Array, Array, int]:
        U, s, Vt = np.linalg.svd(self.jacobian)
        return U, s, Vt, int((s > RANK_TOLERANCE * max(float(s.max(initial=0.0)), 1e-300)).sum())

    def torques(self, forces: ArrayLike) -> Array:
        """τ = J_Hᵗ f_c ``(..., n)`` (G 2.5)."""
        out: Array = as_shaped(forces, "forces", len(self.jacobian)) @ self.jacobian
        return out

    def contact_velocity(self, joint_velocity: ArrayLike) -> Array:
        """J_H θ̇ ``(..., m)``."""
        out: Array = as_shaped(joint_velocity, "joint_velocity", self.jacobian.shape[1]) @ self.jacobian.T
        return out

    def object_twist(self, joint_velocity: ArrayLike) -> tuple[Array, Array]:
        """The smallest object twist V ``(..., p)`` that comes closest to following joint rates ``(..., n)``, and what
        is left of ``J_H θ̇ = Gᵗ V``, as a norm ``(...)``: zero if no contact slips or is lost."""
        moving = self.contact_velocity(joint_velocity)
        twist = moving @ np.linalg.pinv(self.grasp.matrix.T, rcond=RANK_TOLERANCE).T
        return twist, np.linalg.norm(self.grasp.contact_velocity(twist) - moving, axis=-1)

    def contact_forces(self, torques: ArrayLike) -> tuple[Array, Array]:
        """The smallest contact forces f ``(..., m)`` that come closest to what joint torques ``(..., n)`` exert, and
        what is left of ``τ = J_Hᵗ f``, as a norm ``(...)``: torques that work on internal motions meet no contact.

        Structural forces may be added freely; friction cones are not looked at (`Grasp.contact_forces` does).
        """
        tau = as_shaped(torques, "torques", self.jacobian.shape[1])
        f = tau @ np.linalg.pinv(self.jacobian.T, rcond=RANK_TOLERANCE).T
        return f, np.linalg.norm(self.torques(f) - tau, axis=-1)

    @cached_property
    def object_jacobian(self) -> Array:
        """H ``(p, n)``: ``V = H θ̇`` where the grasp condition holds, ``H = (Gᵗ)⁺ J_H``."""
        H: Array = np.linalg.pinv(self.grasp.matrix.T, rcond=RANK_TOLERANCE) @ self.jacobian
        return H

    def quality(self, kind: str = "singular_distance", **options: Any) -> float:
        """The measures of the hand's configuration in the review of Roa and Suárez (2015).

        Of the hand-object Jacobian H (angles times `Grasp.length`): ``"singular_distance"`` its smallest singular
        value, ``"manipulability"`` √det HHᵗ, the product of them, ``"uniformity"`` smallest over largest.
        ``"transmission"`` (*direction* ``(p,)``, a twist): the largest rate along it for joint rates of norm one,
        ``(dᵗ (H Hᵗ)⁻¹ d)^{-1/2}``, zero if it cannot be made. ``"joint_centring"`` (*q*, *lower*, *upper* ``(n,)``):
        the mean of ``((q − middle) / half range)²``, 0 in the middle, 1 at the limits.
        """
        choice(kind, "kind", ("singular_distance", "manipulability", "uniformity", "transmission", "joint_centring"))
        if kind == "joint_centring":
            n = self.jacobian.shape[1]
            q, low, high = (as_shaped(_need(options, name, kind), name, n) for name in ("q", "lower", "upper"))
            if not (high > low).all():
                raise InputError("upper must be above lower for every joint")
            _no_more(options, kind)
            return float((((2.0 * q - low - high) / (high - low)) ** 2).mean())
        weight = np.append(
            np.ones(self.grasp.dimension), np.full(self.grasp.wrench_size - self.grasp.dimension, self.grasp.length)
        )
        H = weight[:, None] * self.object_jacobian
        if kind == "transmission":
            d = as_array(_need(options, "direction", kind), "direction")
            if d.shape != (len(H),) or not d.any():
                raise InputError(f"direction has shape {d.shape}; expected a twist ({len(H)},), not all zero")
            _no_more(options, kind)
            d = weight * d / np.linalg.norm(weight * d)
            U, s, _ = np.linalg.svd(H, full_matrices=True)
            full = np.zeros(len(H))
            full[: len(s)] = s
            good = full > RANK_TOLERANCE * max(float(full[0]), 1e-300)
            parts = U.T @ d
            if np.abs(parts[~good]).max(initial=0.0) > 1e-9:
                return 0.0
            return float(1.0 / np.linalg.norm(parts[good] / full[good]))
        _no_more(options, kind)
        s = np.zeros(len(H))
        found = np.linalg.svd(H, compute_uv=False)
        s[: len(found)] = found[: len(H)]
        if kind == "manipulability":
            return float(np.prod(s))
        return float(s[-1]) if kind == "singular_distance" else float(s[-1] / s[0]) if s[0] > 0.0 else 0.0

    def joint_velocity(self, twist: ArrayLike) -> tuple[Array, Array]:
        """The smallest θ̇ ``(..., n)`` that comes closest to moving the object with *twist* ``(..., p)``, and what is
        left of the grasp condition ``J_H θ̇ = Gᵗ V`` (eq. 2.1), as a norm ``(...)``."""
        wanted = self.grasp.contact_velocity(twist)
        rate = wanted @ np.linalg.pinv(self.jacobian, rcond=RANK_TOLERANCE).T
        return rate, np.linalg.norm(self.contact_velocity(rate) - wanted, axis=-1)

    @cached_property
    def immovable(self) -> Array:
        """Basis ``(p, r)`` of the object motions that the fingers cannot follow; empty if manipulable (Satz 2.14)."""
        U, _, _, rank = self._svd
        outside = U[:, rank:].T @ self.grasp.matrix.T
        if not outside.size:
            return np.empty((self.grasp.wrench_size, 0))
        _, s, Vt = np.linalg.svd(outside)
        return Vt[: int((s > 1e-8 * max(float(np.abs(self.grasp.matrix).max()), 1e-300)).sum())].T.copy()

    @property
    def manipulable(self) -> bool:
        """Whether ℛ(Gᵗ) ⊆ ℛ(J_H): every object motion can be made by the joints (Satz 2.14)."""
        return len(self.immovable.T) == 0

    @property
    def internal_motions(self) -> Array:
        """Basis ``(n, r)`` of 𝒩(J_H): joint motions that move no contact."""
        _, _, Vt, rank = self._svd
        return Vt[rank:].T.copy()

    @property
    def structural_forces(self) -> Array:
        """Basis ``(m, r)`` of 𝒩(J_Hᵗ): contact forces that take no torque."""
        U, _, _, rank = self._svd
        return U[:, rank:].copy()

    @property
    def loose_motions(self) -> Array:
        """Basis ``(p, r)`` of 𝒩(Gᵗ): object motions that the contacts do not feel."""
        U = np.linalg.svd(self.grasp.matrix)[0]
        return U[:, self.grasp.rank :].copy()

    def table(self) -> tuple[Row, ...]:
        """The table of G 2.6 for this grasp."""
        p = self.grasp.wrench_size
        closure = self.grasp.force_closure()
        internal, motions = self.grasp.null_space.shape[1], self.internal_motions.shape[1]
        structural, loose = self.structural_forces.shape[1], self.loose_motions.shape[1]
        return (
            Row("force closure", "G(FC) = ℝᵖ", closure.success, p - closure.rank),
            Row("manipulable", "ℛ(Gᵗ) ⊆ ℛ(J_H)", self.manipulable, self.immovable.shape[1]),
            Row("internal forces", "f ∈ 𝒩(G)", internal > 0, internal),
            Row("internal motions", "θ̇ ∈ 𝒩(J_H)", motions > 0, motions),
            Row("structural forces", "f ∈ 𝒩(J_Hᵗ)", structural > 0, structural),
            Row("loose object motions", "V ∈ 𝒩(Gᵗ)", loose > 0, loose),
        )


def _no_more(options: dict[str, Any], kind: str) -> None:
    if options:
        raise InputError(f"quality {kind!r} does not take {', '.join(options)}")


def _need(options: dict[str, Any], name: str, kind: str) -> Any:
    if name not in options:
        raise InputError(f"quality {kind!r} needs {name}")
    return options.pop(name)
