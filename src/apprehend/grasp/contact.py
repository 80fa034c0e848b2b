"""A contact: where a finger touches, which way is in, and which forces it can pass on (G 2.1.1)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_own
from ..errors import InputError


class ContactModel(Enum):
    """The contact models of G 2.1.1; forces are written (f₁, f₂, f₃[, τ]) along (t₁, t₂, n) and about n."""

    FRICTIONLESS = "frictionless"
    """A normal force only: f ≥ 0."""
    COULOMB = "coulomb"
    """A point with friction: √(f₁² + f₂²) ≤ µ f₃."""
    SOFT = "soft"
    """A soft finger with the elliptic cone: √((f₁² + f₂²)/µ² + τ²/γ²) ≤ f₃ (the cone of the script's LMI)."""
    SOFT_BOX = "soft_box"
    """A soft finger with independent limits: √(f₁² + f₂²) ≤ µ f₃ and |τ| ≤ γ f₃ (the cone of G 2.1.1)."""

    @property
    def components(self) -> int:
        """Number of force components in space."""
        return {"frictionless": 1, "coulomb": 3}.get(self.value, 4)


@dataclass(frozen=True, eq=False)
class Contact:
    """One contact on a body, in the body's frame; in the plane if position and normal have two coordinates.

    *position* ``(3,)`` in m; *normal* the unit inward normal ``(3,)``; *friction* µ; *model*; *torsion* γ in m
    (soft fingers only: the largest torsional moment is γ f₃). *tangent* fixes t₁; by default t₁ is the normalised
    cross product of the coordinate axis most square to the normal with the normal. Then t₂ = n × t₁.
    Raises `InputError` for a normal that is zero or not of unit length, and for negative friction.
    """

    position: Array
    normal: Array
    friction: float = 0.6
    model: ContactModel = ContactModel.COULOMB
    torsion: float = 0.0
    tangent: Array | None = None

    def __post_init__(self) -> None:
        p, n = as_own(self.position, "contact position"), as_array(self.normal, "contact normal")
        if p.shape not in ((2,), (3,)) or n.shape != p.shape:
            raise InputError(
                f"contact position has shape {p.shape} and normal {n.shape}; "
                "expected (3,) for both, or (2,) in the plane"
            )
        length = float(np.linalg.norm(n))
        if abs(length - 1.0) > 1e-6:
            remedy = "a normal needs a direction" if length == 0.0 else "divide it by its length"
            raise InputError(f"contact normal {n.tolist()} has length {length:.6g}; expected 1: {remedy}")
        model = model_of(self.model)
        check_numbers(friction=self.friction, torsion=self.torsion)
        if model in (ContactModel.SOFT, ContactModel.SOFT_BOX) and len(p) == 2:
            raise InputError(f"contact model {model.value!r} has no meaning in the plane; use 'coulomb'")
        object.__setattr__(self, "position", p)
        object.__setattr__(self, "normal", n / length)
        object.__setattr__(self, "model", model)
        object.__setattr__(self, "friction", float(self.friction))
        object.__setattr__(self, "torsion", float(self.torsion))
        if self.tangent is not None and len(p) == 3:
            t = as_own(self.tangent, "contact tangent")
            if t.shape != (3,) or abs(float(t @ n)) > 1e-6 or abs(float(np.linalg.norm(t)) - 1.0) > 1e-6:
                raise InputError(
                    f"contact tangent {t.tolist()} must be a unit vector square to the normal {n.tolist()}"
                )
            object.__setattr__(self, "tangent", t)

    @classmethod
    def soft(cls, position: ArrayLike, normal: ArrayLike, friction: float, torsion: float) -> Contact:
        """A soft finger with the elliptic cone."""
        return cls(np.asarray(position), np.asarray(normal), friction, ContactModel.SOFT, torsion)

    @property
    def dimension(self) -> int:
        """3 in space, 2 in the plane."""
        return len(self.position)

    @cached_property
    def rotation(self) -> Array:
        """R_oc ``(d, d)`` with columns (t₁, t₂, n), in the plane (t, n)."""
        n = self.normal
        if self.dimension == 2:
            return np.array([[n[1], n[0]], [-n[0], n[1]]])
        t1 = self.tangent
        if t1 is None:
            t1 = np.cross(np.eye(3)[int(np.argmin(np.abs(n)))], n)
            t1 = t1 / np.linalg.norm(t1)
        return np.stack([t1, np.cross(n, t1), n], axis=1)

    @property
    def size(self) -> int:
        """Number of force components m_i."""
        if self.dimension == 2:
            return 1 if self.model is ContactModel.FRICTIONLESS else 2
        return self.model.components

    @cached_property
    def basis(self) -> Array:
        """B_c ``(6, m_i)``, in the plane ``(3, m_i)``: the wrench in the contact frame of each force component."""
        if self.dimension == 2:
            return np.eye(3)[:, [1] if self.size == 1 else [0, 1]]
        return np.eye(6)[:, {1: [2], 3: [0, 1, 2], 4: [0, 1, 2, 5]}[self.size]]

    @cached_property
    def directions(self) -> Array:
        """``(6, m_i)``, in the plane ``(3, m_i)``: wrenches about the contact point, in axes of the body."""
        R, d = self.rotation, self.dimension
        if d == 2:
            return np.vstack([R, np.zeros((1, 2))])[:, [1] if self.size == 1 else [0, 1]]
        Z = np.zeros((3, 3))
        return np.block([[R, Z], [Z, R]]) @ self.basis

    def slack(self, force: ArrayLike) -> Array:
        """How far ``force (..., m_i)`` lies inside the cone, as a normal force: f₃ minus the least f₃ that holds it."""
        f = as_array(force, "force")
        if f.shape[-1:] != (self.size,):
            raise InputError(f"force has shape {f.shape}; a {self.model.value} contact has {self.size} components")
        if self.size == 1:
            return f[..., 0].copy()
        planar = self.dimension == 2
        tangential = np.abs(f[..., 0]) if planar else np.hypot(f[..., 0], f[..., 1])
        normal = f[..., 1] if planar else f[..., 2]
        need = _over(tangential, self.friction)
        if self.size == 4:
            twist = _over(np.abs(f[..., 3]), self.torsion)
            need = np.hypot(need, twist) if self.model is ContactModel.SOFT else np.maximum(need, twist)
        inside: Array = normal - need
        return inside

    def lmi(self, force: ArrayLike) -> Array:
        """The matrix P of G 2.19 at ``force (m_i,)``: positive semidefinite exactly where the force is in the cone.

        For the soft finger with independent limits it is block-diagonal: Coulomb's block, then γ f₃ ± τ (the script
        gives only the LMI of the elliptic cone).
        """
        f = as_array(force, "force")
        if f.shape != (self.size,):
            raise InputError(f"force has shape {f.shape}; a {self.model.value} contact has {self.size} components")
        mu = self.friction
        if self.size == 1:
            return f.reshape((1, 1))
        if self.dimension == 2:
            return np.array([[mu * f[1] + f[0], 0.0], [0.0, mu * f[1] - f[0]]])
        coulomb = np.array([[mu * f[2] + f[0], f[1]], [f[1], mu * f[2] - f[0]]])
        if self.size == 3:
            return coulomb
        if self.model is ContactModel.SOFT_BOX:
            P: Array = np.zeros((4, 4))
            P[:2, :2] = coulomb
            P[2, 2], P[3, 3] = self.torsion * f[2] + f[3], self.torsion * f[2] - f[3]
            return P
        if mu == 0.0 or self.torsion == 0.0:
            raise InputError("the elliptic cone's LMI divides by µ and γ; both must be positive")
        P = f[2] * np.eye(4)
        P[3, :3] = P[:3, 3] = f[0] / mu, f[1] / mu, f[3] / self.torsion
        return P

    def angle_margin(self, direction: ArrayLike) -> float:
        """arctan µ minus the angle between the inward normal and *direction*, in rad: positive inside the cone."""
        d = as_array(direction, "direction")
        cosine = float(self.normal @ d / np.linalg.norm(d))
        return float(np.arctan(self.friction) - np.arccos(np.clip(cosine, -1.0, 1.0)))


def model_of(model: ContactModel | str) -> ContactModel:
    """The contact model of that name, or `InputError` that lists them."""
    try:
        return ContactModel(model)
    except ValueError:
        allowed = ", ".join(repr(m.value) for m in ContactModel)
        raise InputError(f"contact model is {model!r}; expected one of {allowed}") from None


def check_numbers(**values: ArrayLike) -> None:
    """Raise `InputError` for a coefficient of contacts that is negative or not finite."""
    for label, value in values.items():
        given = np.asarray(value, dtype=np.float64)
        bad = np.argwhere(~(np.isfinite(given) & (given >= 0.0)))
        if len(bad):
            at = tuple(int(i) for i in bad[0])
            raise InputError(
                f"contact {label}{list(at) if at else ''} is {float(given[at])}; expected a finite number, zero or more"
            )


def _over(value: Array, limit: float) -> Array:
    """``value / limit``, where a limit of zero allows only zero."""
    ratio: Array = value / limit if limit > 0.0 else np.where(value > 0.0, np.inf, 0.0)
    return ratio
