"""Denavit–Hartenberg tables: the standard (distal) and the modified (Craig's, proximal) convention, named as such.

Standard: A_i = Rot_z(θ_i) Trans_z(d_i) Trans_x(a_i) Rot_x(α_i); frame i sits at the far end of link i (K DH).
Modified: A_i = Rot_x(α_{i−1}) Trans_x(a_{i−1}) Rot_z(θ_i) Trans_z(d_i); frame i sits on the axis of joint i.
The script K calls its convention "modified after Waldron and Paul"; what it writes down is the standard one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array, as_shaped, choice
from ..errors import InputError
from .description import Description, Inertial, Joint, JointLimits, JointType, Link
from .poses import shift, turn

CONVENTIONS = ("standard", "modified")
_X, _Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def dh_transform(theta: ArrayLike, d: ArrayLike, a: ArrayLike, alpha: ArrayLike, convention: str = "standard") -> Array:
    """``A_{i−1,i} (..., 4, 4)`` of the four parameters, which broadcast (K DH-Transformationsmatrizen)."""
    choice(convention, "convention", CONVENTIONS)
    th, dd, aa, al = np.broadcast_arrays(*(as_array(v, n) for v, n in zip((theta, d, a, alpha), "θdaα", strict=True)))
    c, s, ca, sa, zero, one = np.cos(th), np.sin(th), np.cos(al), np.sin(al), np.zeros_like(th), np.ones_like(th)
    if convention == "standard":
        rows = [[c, -s * ca, s * sa, aa * c], [s, c * ca, -c * sa, aa * s], [zero, sa, ca, dd]]
    else:
        rows = [[c, -s, zero, aa], [s * ca, c * ca, -sa, -dd * sa], [s * sa, c * sa, ca, dd * ca]]
    rows.append([zero, zero, zero, one])
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def inverse_dh_transform(
    theta: ArrayLike, d: ArrayLike, a: ArrayLike, alpha: ArrayLike, convention: str = "standard"
) -> Array:
    """``A_{i,i−1} = A_{i−1,i}⁻¹ (..., 4, 4)`` (K Inverse DH-Transformation)."""
    A = dh_transform(theta, d, a, alpha, convention)
    inverse = np.zeros_like(A)
    inverse[..., :3, :3] = np.swapaxes(A[..., :3, :3], -1, -2)
    inverse[..., :3, 3] = -(inverse[..., :3, :3] @ A[..., :3, 3:])[..., 0]
    inverse[..., 3, 3] = 1.0
    return inverse


@dataclass(frozen=True, eq=False)
class DHChain:
    """A chain of n joints by four numbers each, in m and rad, between a constant *base* and a constant *tool*.

    T_base_tool(q) = base · A_1(q_1) ⋯ A_n(q_n) · tool, where q_i adds to θ_i (revolute) or to d_i (prismatic), with a
    minus sign where *flip* is set. In the modified convention row i holds α_{i−1} and a_{i−1}.
    """

    convention: str
    names: tuple[str, ...]
    types: tuple[JointType, ...]
    theta: Array  # (n,)
    d: Array  # (n,)
    a: Array  # (n,)
    alpha: Array  # (n,)
    base: Array = field(default_factory=lambda: np.eye(4))
    tool: Array = field(default_factory=lambda: np.eye(4))
    flip: tuple[bool, ...] = ()
    limits: tuple[JointLimits, ...] = ()
    inertials: tuple[Inertial | None, ...] = ()
    name: str = "chain"
    home: Mapping[str, float] = field(default_factory=dict)
    dynamics: tuple[Mapping[str, float], ...] = ()  # of each joint: damping, friction, armature

    def __post_init__(self) -> None:
        choice(self.convention, "convention", CONVENTIONS)
        if not self.flip:
            object.__setattr__(self, "flip", (False,) * self.n)
        if not self.limits:
            object.__setattr__(self, "limits", (JointLimits(),) * self.n)
        if not self.inertials:
            object.__setattr__(self, "inertials", (None,) * self.n)
        if not self.dynamics:
            object.__setattr__(self, "dynamics", ({},) * self.n)
        for what in ("types", "theta", "d", "a", "alpha", "flip", "limits", "inertials", "dynamics"):
            if len(getattr(self, what)) != self.n:
                raise InputError(
                    f"{what} has {len(getattr(self, what))} entries; expected {self.n}, one for each joint"
                )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.names)

    def transforms(self, q: ArrayLike) -> Array:
        """A_1 … A_n at ``q (..., n)``: ``(..., n, 4, 4)``."""
        q = as_shaped(q, "q", self.n) * np.where(self.flip, -1.0, 1.0)
        slides = np.array([t is JointType.PRISMATIC for t in self.types])
        theta, d = self.theta + np.where(slides, 0.0, q), self.d + np.where(slides, q, 0.0)
        return dh_transform(theta, d, self.a, self.alpha, self.convention)

    def fk(self, q: ArrayLike) -> Array:
        """T_base_tool ``(..., 4, 4)`` at ``q (..., n)``."""
        A = self.transforms(q)
        T = np.broadcast_to(self.base, (*A.shape[:-3], 4, 4))
        for i in range(self.n):
            T = T @ A[..., i, :, :]
        result: Array = T @ self.tool
        return result

    def description(self) -> Description:
        """The chain as a description whose links ``link1`` … ``linkn`` have the frames of the table.

        The root is ``base`` (``world`` if the base is not the identity), the tool frame is ``tool`` if there is one. In
        the standard convention a revolute joint with a ≠ 0 needs a link of its own before the frame: ``link1_axis`` ….
        """
        links = {"base": Link("base")}
        joints: list[Joint] = []
        root = "base"
        if not np.array_equal(self.base, np.eye(4)):
            root = "world"
            links = {"world": Link("world"), "base": Link("base")}
            joints.append(Joint("world_to_base", JointType.FIXED, "world", "base", self.base.copy()))
        parent = "base"
        for i in range(self.n):
            parent = self._add_row(i, parent, links, joints)
        tool = parent
        if not np.array_equal(self.tool, np.eye(4)):
            tool = "tool"
            links["tool"] = Link("tool")
            joints.append(Joint("to_tool", JointType.FIXED, parent, "tool", self.tool.copy()))
        return Description(self.name, root, links, tuple(joints), home=dict(self.home), tool=tool)

    def _add_row(self, i: int, parent: str, links: dict[str, Link], joints: list[Joint]) -> str:
        name = f"link{i + 1}"
        link = Link(name, self.inertials[i])
        sign = -1.0 if self.flip[i] else 1.0
        about_z = turn(_Z, float(self.theta[i])) @ shift((0.0, 0.0, float(self.d[i])))
        along_x = shift((float(self.a[i]), 0.0, 0.0)) @ turn(_X, float(self.alpha[i]))
        more = self.dynamics[i]
        joint = Joint(
            self.names[i], self.types[i], parent, name, about_z, sign * _Z, self.limits[i],
            damping=more.get("damping", 0.0), friction=more.get("friction", 0.0), armature=more.get("armature", 0.0),
        )  # fmt: skip
        if self.convention == "modified":
            links[name] = link
            joints.append(replace(joint, pose=along_x @ about_z))
        elif self.a[i] == 0.0 or self.types[i] is JointType.PRISMATIC:
            # the motion commutes with the rest of the row when its axis is written in the frame of the link
            links[name] = link
            axis = np.array([0.0, math.sin(self.alpha[i]), math.cos(self.alpha[i])])
            joints.append(replace(joint, pose=about_z @ along_x, axis=sign * axis))
        else:
            links[f"{name}_axis"] = Link(f"{name}_axis")
            links[name] = link
            joints.append(replace(joint, child=f"{name}_axis"))
            joints.append(Joint(f"{name}_fixed", JointType.FIXED, f"{name}_axis", name, along_x))
        return name

    def __str__(self) -> str:
        """The table as a person writes it: lengths in mm, angles in degrees."""
        previous = "" if self.convention == "standard" else "(i−1)"
        heads = (f"a{previous} [mm]", f"α{previous} [°]", "d [mm]", "θ [°]")
        head = f"{'joint':20s} {'type':10s} " + " ".join(f"{h:>12s}" for h in heads)
        lines = [f"{self.name}: DH table, {self.convention} convention", head]
        for i, name in enumerate(self.names):
            slides = self.types[i] is JointType.PRISMATIC
            variable = "−q" if self.flip[i] else "+q"
            numbers = [1e3 * self.a[i], math.degrees(self.alpha[i]), 1e3 * self.d[i], math.degrees(self.theta[i])]
            cells = [f"{x + 0.0:.6g}" for x in numbers]
            cells[2 if slides else 3] += variable
            lines.append(f"{name:20s} {self.types[i].value:10s} " + " ".join(f"{c:>12s}" for c in cells))
        return "\n".join(lines)
