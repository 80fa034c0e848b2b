"""What closed form fits an arm: found from the axes of its joints, not from its name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..kernels.chain import PRISMATIC, ChainModel
from ..kernels.ik_branches import SPHERICAL_WRIST, THREE_PARALLEL

EXACT = 1e-9
"""Axes that miss their ideal place by less than this share of the reach (or rad) count as ideal."""
CALIBRATED = 0.02
"""Up to this share of the reach (or rad) the ideal branches are found first and refined on the true arm."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """Six revolute axes at zero: directions ``h (6, 3)``, points ``o (7, 3)`` (last: the frame), rotation ``R0``."""

    h: Array
    o: Array
    R0: Array

    def reversed(self) -> Geometry:
        """The same arm seen from its frame: T⁻¹ = Π exp(−Ad(T0⁻¹) ξ_i θ_i) T0⁻¹, the axes in the other order."""
        R, p = self.R0, self.o[6]
        h = -self.h[::-1] @ R
        o = np.vstack([(self.o[5::-1] - p) @ R, -p @ R])
        return Geometry(h, o, R.T)


@dataclass(frozen=True, eq=False)
class Structure:
    """A closed form: its family, the ideal geometry (of the arm or of its reverse), and how far the arm is from it."""

    family: int
    geometry: Geometry
    backwards: bool
    deviation: float  # share of the reach, or rad

    @property
    def name(self) -> str:
        """The family in words."""
        text = {SPHERICAL_WRIST: "three axes in one point", THREE_PARALLEL: "three parallel axes"}[self.family]
        return text + (" (seen from the tool)" if self.backwards else "")


def lines(model: ChainModel, locked: dict[int, float] | None = None) -> Geometry:
    """Axes of a chain of revolute joints at zero (each joint with a coordinate of its own), those of *locked* joints
    (number → value) left out."""
    T = np.eye(4)
    h, o = [], []
    for i in range(model.kind.size):
        T = T @ pose_of(model.place[i])
        multiplier, offset = model.gain[i]
        angle = offset
        if locked and i in locked:
            angle = offset + multiplier * locked[i]
        else:
            h.append(multiplier * T[:3, 2])
            o.append(T[:3, 3])
        turn = np.eye(4)
        c, s = np.cos(angle), np.sin(angle)
        turn[:2, :2] = [[c, -s], [s, c]]
        T = T @ turn
    T = T @ pose_of(model.place[-1])
    return Geometry(np.array(h), np.array([*o, T[:3, 3]]), T[:3, :3])


def pose_of(place: Array) -> Array:
    """Twelve numbers of a kernel model as ``(4, 4)``."""
    T = np.eye(4)
    T[:3, :3] = place[:9].reshape(3, 3)
    T[:3, 3] = place[9:]
    return T


def meeting_point(h: Array, o: Array) -> tuple[Array, float]:
    """The point nearest to the lines (least squares) and its largest distance from one of them."""
    P = np.eye(3) - h[:, :, None] * h[:, None, :]
    point = np.linalg.lstsq(P.sum(axis=0), np.einsum("kij,kj->i", P, o), rcond=1e-9)[0]
    return point, float(np.linalg.norm(np.einsum("kij,kj->ki", P, point - o), axis=1).max())


def feet(h1: Array, o1: Array, h2: Array, o2: Array) -> tuple[Array, Array]:
    """The points at which two lines are nearest; for parallel ones, o1 and its foot on the second."""
    g = float(h1 @ h2)
    d = o2 - o1
    if 1.0 - g * g < 1e-12:
        return o1, o2 - h2 * (h2 @ d)
    s = (h1 @ d - g * (h2 @ d)) / (1.0 - g * g)
    t = (g * (h1 @ d) - h2 @ d) / (1.0 - g * g)
    return o1 + s * h1, o2 + t * h2


def detect(geometry: Geometry) -> Structure | None:
    """The closed form that is nearest to the arm, if any is within `CALIBRATED`; exact ones first."""
    found: list[Structure] = []
    for backwards in (False, True):
        g = geometry.reversed() if backwards else geometry
        for fit in (_spherical, _parallel):
            s = fit(g, backwards)
            if s is not None and s.deviation <= CALIBRATED:
                found.append(s)
    return min(found, key=lambda s: (s.deviation > EXACT, s.deviation if s.deviation > EXACT else 0.0), default=None)


def _reach(g: Geometry) -> float:
    """Length along the axes; where the arm stands and what tool it holds do not count."""
    return max(float(np.linalg.norm(np.diff(g.o[:6], axis=0), axis=1).sum()), 1e-9)


def _spherical(g: Geometry, backwards: bool) -> Structure | None:
    h, o = g.h, g.o.copy()
    reach = _reach(g)
    if np.linalg.norm(np.cross(h[3], h[4])) < 0.05 or np.linalg.norm(np.cross(h[4], h[5])) < 0.05:
        return None
    point, miss = meeting_point(h[3:6], o[3:6])
    o[3:6] = point
    o[0], o[1] = feet(h[0], o[0], h[1], o[1])
    deviation = miss / reach
    # nearly, but not quite, parallel or meeting first axes lose their digits: take them as such
    h = h.copy()
    slant = float(np.linalg.norm(np.cross(h[0], h[1])))
    if 0.0 < slant < CALIBRATED:
        h[1] = h[0] * np.sign(h[0] @ h[1])
        o[1] = o[1] - h[0] * (h[0] @ (o[1] - o[0]))
        deviation = max(deviation, slant)
    gap = float(np.linalg.norm(o[1] - o[0]))
    if slant >= CALIBRATED and 0.0 < gap < 1e-3 * reach:
        o[0] = o[1] = 0.5 * (o[0] + o[1])
        deviation = max(deviation, gap / reach)
    # the second and third axis, likewise
    slant = float(np.linalg.norm(np.cross(h[1], h[2])))
    if 0.0 < slant < 1e-6:
        h[2] = h[1] * np.sign(h[1] @ h[2])
        deviation = max(deviation, slant)
    return Structure(SPHERICAL_WRIST, Geometry(h, o, g.R0), backwards, deviation)


def _parallel(g: Geometry, backwards: bool) -> Structure | None:
    h, o = g.h.copy(), g.o.copy()
    reach = _reach(g)
    signs = np.sign(h[1:4] @ h[1])
    mean = (h[1:4] * signs[:, None]).sum(axis=0)
    mean /= np.linalg.norm(mean)
    deviation = float(np.linalg.norm(np.cross(h[1:4], mean), axis=1).max())
    h[1:4] = mean * signs[:, None]
    if abs(h[0] @ mean) > 1.0 - 1e-6 or abs(h[4] @ mean) > 1.0 - 1e-6:
        return None
    if np.linalg.norm(np.cross(h[4], h[5])) < 0.05:
        return None
    o[4], o[5] = feet(h[4], o[4], h[5], o[5])
    gap = float(np.linalg.norm(o[5] - o[4]))
    if 0.0 < gap < (1e-7 if deviation < EXACT else 5e-3) * reach:
        o[4] = o[5] = 0.5 * (o[4] + o[5])
        deviation = max(deviation, gap / reach)
    return Structure(THREE_PARALLEL, Geometry(h, o, g.R0), backwards, deviation)


def locked_geometry(seven: Geometry, joint: int, values: Array) -> tuple[Array, Array, Array]:
    """Axes ``(N, 6, 3)``, points ``(N, 7, 3)`` and rotations ``(N, 3, 3)`` of seven axes with one turned and locked."""
    n, at = seven.h[joint], seven.o[joint]
    c, s = np.cos(values)[:, None, None], np.sin(values)[:, None, None]
    K = np.array([[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]])
    R = np.eye(3) + s * K + (1.0 - c) * (K @ K)
    h = np.repeat(np.delete(seven.h, joint, axis=0)[None], values.size, axis=0)
    o = np.repeat(np.delete(seven.o, joint, axis=0)[None], values.size, axis=0)
    h[:, joint:] = np.einsum("nij,kj->nki", R, seven.h[joint + 1 :])
    o[:, joint:] = at + np.einsum("nij,kj->nki", R, seven.o[joint + 1 :] - at)
    return h, o, R @ seven.R0


def idealised(structure: Structure, h: Array, o: Array, R0: Array) -> tuple[Array, Array, Array]:
    """Geometries ``(N, …)`` of an exact structure, from the end it is solved from, with the points where the closed
    form wants them."""
    if structure.backwards:
        p = o[:, 6:7]
        h, o = -(h[:, ::-1] @ R0), np.concatenate([(o[:, 5::-1] - p) @ R0, -p @ R0], axis=1)
        R0 = np.swapaxes(R0, 1, 2)
    o = o.copy()
    if structure.family == SPHERICAL_WRIST:
        P = np.eye(3) - h[:, 3:6, :, None] * h[:, 3:6, None, :]
        right = np.einsum("nkij,nkj->ni", P, o[:, 3:6])
        o[:, 3:6] = np.linalg.solve(P.sum(axis=1), right[..., None])[:, None, :, 0]
        first = 0
    else:
        first = 4
    a, b = h[:, first], h[:, first + 1]
    d = o[:, first + 1] - o[:, first]
    g = np.einsum("ni,ni->n", a, b)
    ad, bd = np.einsum("ni,ni->n", a, d), np.einsum("ni,ni->n", b, d)
    sine2 = 1.0 - g * g
    parallel = sine2 < 1e-12
    sine2 = np.where(parallel, 1.0, sine2)
    o[:, first] += np.where(parallel, 0.0, (ad - g * bd) / sine2)[:, None] * a
    o[:, first + 1] += np.where(parallel, -bd, (g * ad - bd) / sine2)[:, None] * b
    return np.ascontiguousarray(h), o, np.ascontiguousarray(R0)


def revolute_only(model: ChainModel) -> bool:
    """Whether every joint turns, with a coordinate of its own that follows it one to one."""
    own = model.free.size == model.kind.size and bool((np.abs(model.gain[:, 0]) == 1.0).all())
    return own and not (model.kind == PRISMATIC).any()
