"""The search behind `plan`: from closing lines to grasps that hold, each step in batches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..bodies import Body
from ..conventions import GRAVITY
from ..kernels import grasp as kernels
from ..kinematics import Hand, ParallelJaw
from ..parallel import over_ranges
from . import shape
from .candidates import Candidate, GraspPlan, PlanStatus
from .contact import Contact
from .grasp import Grasp
from .hold import pressing_force
from .jaw_settings import Settings
from .pairs import Pairs, antipodal
from .surface import Surface

CELLS = 6
"""Rays along each side of a pad."""
KEPT_PAIRS = 400
"""Closing lines that are tried with every approach angle."""
ENOUGH, MORE = 10, 4
"""With fewer grasps than ENOUGH, a second pass tries MORE times as many samples."""
SHIFTS = (0.0, 0.5, 0.85, -0.6)
"""Depths that are tried, in halves of the pad: in its middle, towards the tip, at the tip, deeper."""
FINGER = 0.004
"""No finger is thinner than this, in m."""
WEIGHTS = {"cone": 0.3, "force": 0.25, "centre": 0.25, "coverage": 0.2}
"""Exponents of the four parts of the quality."""


@dataclass
class Search:
    """One run of `plan`: each step narrows the arrays of poses and counts what it rejects."""

    hand: Hand
    jaw: ParallelJaw
    body: Body
    s: Settings
    rng: np.random.Generator
    n: int

    def run(self) -> GraspPlan:
        """One pass, and a second with more samples where the first finds few."""
        self.rejected: dict[str, int]
        self.facts: dict[str, float] = {"friction": self.s.friction, "max_force": self.s.max_force}
        self.surface = Surface(self.body.vertices, self.body.faces)
        self.sampled = 0
        best = self._attempt(1)
        if len(best) < min(self.n, ENOUGH) and best.status not in (PlanStatus.TOO_WIDE, PlanStatus.TOO_THIN):
            more = self._attempt(MORE)
            best = more if len(more) >= len(best) else best
        return best

    def _attempt(self, factor: int) -> GraspPlan:
        """One pass with *factor* times the samples."""
        self.rejected = {}
        sampled = antipodal(self.surface, self.body, factor * int(self.s.samples), self.s.friction, self.rng)
        self.sampled = len(sampled)
        if not self.sampled:
            return self._none(PlanStatus.NO_OPPOSITE_SIDES)
        pairs = self._graspable(sampled, factor * KEPT_PAIRS)
        if isinstance(pairs, PlanStatus):
            return self._none(pairs)
        tcp, width = self._approaches(pairs)
        if not len(tcp):
            return self._none(PlanStatus.NO_APPROACH)
        tcp, opening = self._reachable(tcp, width)
        if not len(tcp):
            return self._none(PlanStatus.NO_ROOM)
        found = self._touching(tcp, opening)
        if not len(found.width):
            return self._none(PlanStatus.NO_CONTACT)
        found = self._spread(found, 6 * self.n)
        found = self._closed(found)
        if not len(found.width):
            return self._none(PlanStatus.NO_ROOM)
        found = self._strong(found)
        if not len(found.width):
            return self._none(PlanStatus.TOO_WEAK)
        found = self._spread(found, self.n)
        return self._plan(PlanStatus.SUCCESS, tuple(self._candidate(found, i) for i in range(len(found.width))))

    def _plan(self, status: PlanStatus, candidates: tuple[Candidate, ...]) -> GraspPlan:
        return GraspPlan(
            status, candidates, self.body.name, self.hand.name, dict(self.rejected), self.sampled, dict(self.facts)
        )

    def _none(self, status: PlanStatus) -> GraspPlan:
        return self._plan(status, ())

    # closing lines

    def _graspable(self, pairs: Pairs, most: int) -> Pairs | PlanStatus:
        """Pairs within the stroke, at most *most*: half the best by margin and distance, half as they come."""
        widest = self.jaw.max_width - 2.0 * min(self.s.clearance, 0.001)
        self.facts |= {
            "smallest_width": float(pairs.width.min()), "largest_width": float(pairs.width.max()),
            "widest_grasp": widest, "max_width": self.jaw.max_width, "min_width": self.jaw.min_width,
        }  # fmt: skip
        wide, thin = pairs.width > widest, pairs.width < self.jaw.min_width
        self.rejected["too wide"], self.rejected["too thin"] = int(wide.sum()), int(thin.sum())
        keep = np.nonzero(~wide & ~thin)[0]
        if not len(keep):
            return PlanStatus.TOO_WIDE if wide.any() else PlanStatus.TOO_THIN
        pairs = pairs.take(keep)
        if len(self.s.table):  # a finger as thick as a thin one must fit under the lower end of the line
            ends = np.stack([pairs.first - FINGER * pairs.axis, pairs.second + FINGER * pairs.axis])
            clear = (ends @ self.s.table[:, :3].T >= self.s.table[:, 3] + self.s.room).all(axis=(0, 2))
            self.rejected["no finger fits between line and table"] = int((~clear).sum())
            if not clear.any():
                return PlanStatus.NO_ROOM
            pairs = pairs.take(np.nonzero(clear)[0])
        if len(pairs) > most:
            middle = 0.5 * (pairs.first + pairs.second)
            away = self._com_distance(middle, pairs.axis)
            value = pairs.margin / np.arctan(self.s.friction) / (1.0 + (2.0 * away / self.body.radius) ** 2)
            order = np.argsort(-value, kind="stable")
            rest = self.rng.permutation(order[most // 2 :])[: most - most // 2]
            pairs = pairs.take(np.sort(np.concatenate([order[: most // 2], rest])))
        return pairs

    def _com_distance(self, points: Array, axes: Array) -> Array:
        lever = self.body.com - points
        distance: Array = np.linalg.norm(lever - np.einsum("ij,ij->i", lever, axes)[:, None] * axes, axis=1)
        return distance

    def _approaches(self, pairs: Pairs) -> tuple[Array, Array]:
        """T_body_tcp of every closing line at every angle, and the widths."""
        down = -self.s.table[0, :3] if len(self.s.table) else np.array([0.0, 0.0, -1.0])
        x = pairs.axis
        start = down - (x @ down)[:, None] * x
        weak = np.linalg.norm(start, axis=1) < 0.1
        start[weak] = np.cross(x[weak], np.eye(3)[np.argmin(np.abs(x[weak]), axis=1)])
        start /= np.linalg.norm(start, axis=1, keepdims=True)
        side = np.cross(x, start)
        turn = 2.0 * np.pi * np.arange(int(self.s.angles)) / self.s.angles
        z = np.cos(turn)[None, :, None] * start[:, None] + np.sin(turn)[None, :, None] * side[:, None]
        T = np.zeros((*z.shape[:2], 4, 4))
        xs = np.broadcast_to(x[:, None], z.shape)
        T[..., :3, 0], T[..., :3, 1], T[..., :3, 2] = xs, np.cross(z, xs), z
        T[..., :3, 3] = 0.5 * (pairs.first + pairs.second)[:, None]
        T[..., 3, 3] = 1.0
        width = np.broadcast_to(pairs.width[:, None], T.shape[:2]).reshape(-1)
        T = T.reshape(-1, 4, 4)
        if self.s.approach is not None:
            near = (T[:, :3, 2] @ self.s.approach.T).max(axis=1) >= np.cos(self.s.approach_tolerance)
            self.rejected["from another side than asked for"] = int((~near).sum())
            T, width = T[near], width[near]
        return T, width

    # room for the open hand

    def _reachable(self, tcp: Array, width: Array) -> tuple[Array, Array]:
        """Poses, at the depth nearest to the middle of the pads, at which the open hand has room; and their opening."""
        levels, postures = shape.swept(self.hand, self.s.standoff)
        level = np.minimum(np.searchsorted(levels, width + 2.0 * self.s.clearance), len(levels) - 1)
        to_hand = np.linalg.inv(self.jaw.tcp_at(np.clip(width, self.jaw.min_width, self.jaw.max_width)))
        half = 0.5 * self.jaw.pad_size[1]
        margins = np.full(len(postures.links), 5e-4)
        pending = np.arange(len(tcp))
        placed = np.zeros(len(tcp), bool)
        tcp = tcp.copy()
        code = np.full(len(tcp), -1, np.int64)
        for shift in SHIFTS:
            moved = tcp[pending].copy()
            moved[:, :3, 3] -= shift * half * moved[:, :3, 2]
            hit = postures.obstacles(
                self.surface.tree, moved @ to_hand[pending], level[pending], self.s.table, margins, self.s.room
            )
            free = hit < 0
            tcp[pending[free]] = moved[free]
            placed[pending[free]] = True
            code[pending] = hit
            pending = pending[~free]
            if not len(pending):
                break
        pieces = len(postures.links)
        self.rejected["open hand hits the table"] = int((code[pending] >= pieces).sum())
        self.rejected["open hand hits the body"] = int((code[pending] < pieces).sum())
        return tcp[placed], levels[level[placed]]

    # contact

    def _touching(self, tcp: Array, opening: Array) -> _Found:
        """Rest the pads on the surface; keep what touches firmly, inside the cones."""
        out = np.empty((len(tcp), 2, 10))
        half_y, half_z = 0.5 * self.jaw.pad_size[0], 0.5 * self.jaw.pad_size[1]
        tcp = np.ascontiguousarray(tcp)
        half = np.ascontiguousarray(0.5 * opening)
        over_ranges(
            lambda a, b: kernels.patches(
                self.surface.tree, self.surface.normals, tcp[a:b], half[a:b], half_y, half_z, CELLS,
                self.s.compliance, out[a:b],
            ),
            len(tcp),
            64,
        )  # fmt: skip
        touching = (out[:, :, 9] > 0).all(axis=1)
        out[~touching, :, 0] = 0.0
        width = out[:, 0, 0] - out[:, 1, 0]
        points = np.einsum("nij,npj->npi", tcp[:, :3, :3], out[:, :, 1:4]) + tcp[:, None, :3, 3]
        normals = out[:, :, 4:7]
        on_surface, off, _ = self.surface.nearest(points.reshape(-1, 3))
        points, off = on_surface.reshape(-1, 2, 3), off.reshape(-1, 2).max(axis=1)
        line = points[:, 0] - points[:, 1]
        line /= np.maximum(np.linalg.norm(line, axis=1, keepdims=True), 1e-12)
        cosine = np.stack([-np.einsum("ij,ij->i", line, normals[:, 0]), np.einsum("ij,ij->i", line, normals[:, 1])], 1)
        margin = np.arctan(self.s.friction) - np.arccos(np.clip(cosine, -1.0, 1.0)).max(axis=1)
        fits = (width >= self.jaw.min_width) & (width <= opening) & touching
        firm = fits & (margin >= self.s.cone_margin)
        self.rejected["pads meet no surface"] = int((~fits).sum())
        self.rejected["slips: outside the friction cones"] = int((fits & ~firm).sum())
        i = np.nonzero(firm)[0]
        whole = off[i] <= 2.0 * self.s.compliance  # else the pad rests on two ridges, with nothing in between
        self.rejected["pads bridge a hollow"] = int((~whole).sum())
        i = i[whole]
        tcp = tcp[i].copy()
        tcp[:, :3, 3] += 0.5 * (out[i, 0, 0] + out[i, 1, 0])[:, None] * tcp[:, :3, 0]
        away = self._com_distance(points[i, 0], line[i])
        torsion = np.maximum(self.s.friction * out[i, :, 8], self.body.torsional_friction)
        coverage = out[i, :, 7].min(axis=1)
        parts = {
            "cone": np.clip(margin[i] / np.arctan(self.s.friction), 0.0, 1.0),
            "centre": 1.0 / (1.0 + (2.0 * away / self.body.radius) ** 2),
            "coverage": np.sqrt(coverage),
        }
        quality = np.prod([parts[k] ** WEIGHTS[k] for k in parts], axis=0)
        return _Found(
            tcp, width[i], opening[i], points[i], normals[i], margin[i], coverage, torsion, away,
            np.full(len(i), np.inf), quality,
        )  # fmt: skip

    def _spread(self, found: _Found, n: int) -> _Found:
        """The best *n* that lie apart from each other."""
        order = np.argsort(-found.quality, kind="stable")
        distance, angle = self.s.apart
        cosine = np.cos(angle)
        kept: list[int] = []
        p, R = found.tcp[:, :3, 3], found.tcp[:, :3, :3]
        for i in (int(j) for j in order):
            if len(kept) == n:
                break
            k = np.array(kept, dtype=np.int64)
            near = np.linalg.norm(p[k] - p[i], axis=1) < distance
            near &= (R[k, :, 2] @ R[i, :, 2] > cosine) & (np.abs(R[k, :, 0] @ R[i, :, 0]) > cosine)
            if not near.any():
                kept.append(i)
        self.rejected["copies of a better grasp"] = self.rejected.get("copies of a better grasp", 0) + (
            len(order) - len(kept) if len(kept) < n else 0
        )
        return found.take(np.array(kept, dtype=np.int64))

    def _closed(self, found: _Found) -> _Found:
        """Those whose hand, closed on the body and open at the final place, meets nothing but pads on their patches."""
        widths = np.clip(found.width, self.jaw.min_width, self.jaw.max_width)
        postures = shape.at(self.hand, widths)
        poses = found.tcp @ np.linalg.inv(self.jaw.tcp_at(widths))
        pads = np.array([link in self.jaw.pad_links for link in postures.links])
        margins = np.where(pads, -(self.s.compliance + 5e-4), 0.0)
        hit = postures.obstacles(
            self.surface.tree, poses, np.arange(len(poses)), self.s.table, margins, 0.5 * self.s.room
        )
        levels, swept = shape.swept(self.hand, self.s.standoff)
        level = np.searchsorted(levels, found.opening - 1e-9)
        again = swept.obstacles(
            self.surface.tree, poses, level, self.s.table, np.full(len(swept.links), 2.5e-4), 0.5 * self.s.room
        )
        free = (hit < 0) & (again < 0)
        self.rejected["closed hand hits the body or the table"] = int((~free).sum())
        return found.take(np.nonzero(free)[0])

    # force

    def _wrenches(self) -> Array:
        """Wrenches about the centre of mass against which the grasp must hold: weight and accelerations."""
        m, a = self.body.mass, self.s.acceleration
        if len(self.s.table):
            up = self.s.table[0, :3]
            e1 = np.cross(np.eye(3)[int(np.argmin(np.abs(up)))], up)
            e1 /= np.linalg.norm(e1)
            e2 = np.cross(up, e1)
            turn = 2.0 * np.pi * np.arange(6) / 6
            sideways = np.cos(turn)[:, None] * e1 + np.sin(turn)[:, None] * e2
            forces = -m * GRAVITY * up + m * a * np.concatenate([-up[None], sideways])
        else:
            corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T / np.sqrt(3.0)
            forces = m * (GRAVITY + a) * np.concatenate([np.eye(3), -np.eye(3), corners])
        return np.concatenate([forces, np.zeros_like(forces)], axis=1)

    def _strong(self, found: _Found) -> _Found:
        """Those that the hand can hold, with the force that it takes, and the quality complete."""
        n = len(found.width)
        directions = np.empty((n, 2, 6, 4))
        for i in range(n):
            for k in range(2):
                contact = self._contact(found, i, k)
                D = contact.directions.copy()
                D[3:] += np.cross(contact.position - self.body.com, D[:3], axisb=0).T
                directions[i, k] = D
        mu = np.full((n, 2), self.s.friction)
        force = pressing_force(directions, mu, found.torsion, self._wrenches(), self.body.radius).max(axis=1)
        force *= self.s.safety
        strong = force <= self.s.max_force
        finite = force[np.isfinite(force)]
        if len(finite):
            self.facts["least_force"] = float(finite.min())
        else:
            self.facts["least_force"] = float("inf")
        self.rejected["needs more force than allowed"] = int((~strong).sum())
        found = replace(found, force=force)
        found = found.take(np.nonzero(strong)[0])
        part = np.clip(1.0 - found.force / self.s.max_force, 0.0, 1.0)
        return replace(found, quality=found.quality * part ** WEIGHTS["force"])

    def _contact(self, found: _Found, i: int, k: int) -> Contact:
        return Contact.soft(found.points[i, k], found.normals[i, k], self.s.friction, float(found.torsion[i, k]))

    def _candidate(self, found: _Found, i: int) -> Candidate:
        width = float(np.clip(found.width[i], self.jaw.min_width, self.jaw.max_width))
        force = float(found.force[i])
        alpha = float(np.arctan(self.s.friction))
        contacts = (self._contact(found, i, 0), self._contact(found, i, 1))
        closure = Grasp(contacts, reference=self.body.com, length=self.body.radius)
        margins = {
            "epsilon": closure.quality(gap=0.05).lower,
            "cone": float(found.margin[i]), "force": self.s.max_force - force,
            "com_distance": float(found.away[i]), "coverage": float(found.coverage[i]),
            "torsion": float(found.torsion[i].min()),
            "cone_part": float(np.clip(found.margin[i] / alpha, 0.0, 1.0)),
            "force_part": float(np.clip(1.0 - force / self.s.max_force, 0.0, 1.0)),
            "centre_part": float(1.0 / (1.0 + (2.0 * found.away[i] / self.body.radius) ** 2)),
            "coverage_part": float(np.sqrt(found.coverage[i])),
        }  # fmt: skip
        return Candidate(
            pose=found.tcp[i] @ np.linalg.inv(self.jaw.tcp_at(width)),
            tcp=found.tcp[i].copy(),
            width=width,
            opening=float(found.opening[i]),
            contacts=contacts,
            quality=float(found.quality[i]),
            margins=margins,
            required_force=force,
        )


@dataclass(frozen=True, eq=False)
class _Found:
    """Grasps as arrays over N."""

    tcp: Array
    width: Array
    opening: Array
    points: Array  # (N, 2, 3)
    normals: Array  # (N, 2, 3)
    margin: Array
    coverage: Array
    torsion: Array  # (N, 2)
    away: Array
    force: Array
    quality: Array

    def take(self, index: NDArray[np.integer[Any]]) -> _Found:
        """The grasps at *index*."""
        return _Found(*(getattr(self, name)[index] for name in self.__dataclass_fields__))
