"""Grasp planning for hands with several fingers, by both ways of the table of G 4."""

from __future__ import annotations

from collections import Counter

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..bodies import Body
from ..ik import solve_frames
from ..kinematics import Hand
from .candidates import GraspPlan, HandCandidate, PlanStatus
from .closing import Touching, close, contacts_of, retract
from .closures import force_closures
from .fingers import Fingers, fingers_of
from .forces import ContactForces
from .grasp import Grasp
from .hand_grasp import hand_jacobian
from .hand_settings import HandSettings
from .limits import Limits
from .surface import Surface

BATCH = 96
"""Hands that are placed at once."""
ENOUGH, MORE = 4, 2
"""With fewer grasps than ENOUGH up to MORE times as many are tried."""
PLACES = 16000
"""Placements of pre-grasps from which the inverse way chooses its contacts; of thrice as many if not all are wanted."""
REACH = 0.06
"""A pad may go this far forwards or back to its contact, in m."""
EASY = 0.02
"""Contacts that are that far from their pads, in m, count half."""
SLANT = np.radians(50.0)
"""Largest angle between the way a pad faces and the normal of its contact."""
OPEN = 0.035
"""A pre-grasp with its pads drawn back by that much must have room where it is placed, in m."""
CLEARANCE = 1e-3
"""An open hand keeps this distance from the body, in m."""
OPENINGS = (0.06, 0.05, 0.04, 0.03, 0.02, 0.012)
"""How far the pads are drawn back for the approach, in m: the first that leaves room all the way, or leaves most."""
WAY = 9
"""Places of the approach at which the open hand is checked."""
FROM_BELOW = 0.35
"""Sine of the angle from below a table at which no hand comes."""
SIDEWAYS = np.radians(30.0)
"""The approach of a grasp differs from that of its pre-grasp by up to about this angle."""
SPARE = 6
"""Times as many placements are drawn by the other way where most of them are not wanted."""
BACK = (0.01, 0.02, 0.035, 0.055, 0.08)
"""Pads are drawn back by the first of these that gives room before they close on a planned contact, in m."""
WRENCHES = np.concatenate([np.eye(3), -np.eye(3)])
"""Directions of gravity when nothing is known of it."""


class HandSearch:
    """One planning run: tries in batches, both ways in turn, until there are enough grasps or tries."""

    def __init__(self, hand: Hand, body: Body, settings: HandSettings, rng: np.random.Generator, n: int) -> None:
        self.hand, self.body, self.settings, self.rng, self.n = hand, body, settings, rng, n
        self.fingers: Fingers = fingers_of(hand)
        self.surface = Surface(body.vertices, body.faces)
        self.rejected: Counter[str] = Counter()
        self.tried: Counter[str] = Counter()
        self.found: list[HandCandidate] = []

    def run(self) -> GraspPlan:
        """Plan, sort, and say why there is nothing."""
        ways = {"inverse": self._inverse, "closing": self._closing}
        share = -(-self.n // len(self.settings.methods))
        for more in (1, MORE):
            for method in self.settings.methods:
                while self.tried[method] < more * self.settings.samples and self._count(method) < 2 * share:
                    ways[method]()
            if len(self.found) >= min(self.n, ENOUGH):
                break
        self.found.sort(key=lambda c: -c.quality)
        chosen = self._distinct()
        facts = {f"tried_{m}": float(self.tried[m]) for m in self.settings.methods}
        facts |= {f"found_{m}": float(self._count(m)) for m in self.settings.methods}
        status = PlanStatus.SUCCESS if chosen else self._why()
        return GraspPlan(
            status, tuple(chosen), self.body.name, self.hand.name, dict(self.rejected), sum(self.tried.values()), facts
        )

    def _count(self, method: str) -> int:
        return sum(c.method == method for c in self.found)

    def _why(self) -> PlanStatus:
        causes = {
            "no contacts that close lie before the pads": PlanStatus.NO_CLOSURE,
            "out of the fingers' reach": PlanStatus.OUT_OF_REACH,
            "comes from another side than asked for": PlanStatus.NO_APPROACH,
            "no room for the open hand": PlanStatus.NO_ROOM, "no way in for the open hand": PlanStatus.NO_ROOM,
            "hits the table": PlanStatus.NO_ROOM,
            "too few contacts": PlanStatus.TOO_FEW, "no force closure": PlanStatus.NO_CLOSURE,
            "too weak": PlanStatus.TOO_WEAK,
        }  # fmt: skip
        worst = max(causes, key=lambda cause: self.rejected[cause])
        return causes[worst]

    # the two ways

    def _inverse(self) -> None:
        """Choose contacts that close where pads would meet the surface; bring the pads there; draw back; close."""
        fingers = self.fingers
        self.tried["inverse"] += BATCH
        pick, pose, _ = self._placed(PLACES)
        points, normals, hit, way = self._ahead(pick, pose)
        chosen, margin = self._closed_sets(points, normals, hit)
        margin /= 1.0 + (np.where(hit, way, 0.0) ** 2).sum(axis=1) / EASY**2
        order = np.argsort(-margin, kind="stable")
        order = order[margin[order] > 0.0]
        best = order[:0]
        for start in range(0, min(len(order), 20 * BATCH), 4 * BATCH):
            few = order[start : start + 4 * BATCH]
            few = few[self._free(retract(fingers, fingers.cages.q[pick[few]], OPEN), pose[few])]
            best = np.concatenate([best, few])[:BATCH]
            if len(best) == BATCH:
                break
        self.rejected["no contacts that close lie before the pads"] += BATCH - len(best)
        robot = fingers.floating
        q, success = np.zeros((len(best), robot.n)), np.zeros(len(best), np.bool_)
        guess = np.concatenate([_coordinates(pose[best], self.body.com), fingers.cages.q[pick[best]]], axis=1)
        goals = np.tile(np.eye(4), (len(best), len(fingers.tips), 1, 1))
        goals[..., :3, :3], goals[..., :3, 3] = _frames(normals[best]), points[best] - self.body.com
        for pads in np.unique(chosen[best], axis=0):
            which = np.flatnonzero((chosen[best] == pads).all(axis=1))
            names = [f"pad_{i}" for i in np.flatnonzero(pads)]
            tolerance = np.tile([3e-3] * 3 + [0.8, 0.8, np.inf], (len(names), 1))
            answer = solve_frames(
                robot, goals[which][:, pads], names, guess[which], tolerance=tolerance, max_starts=12, rng=self.rng
            )
            q[which], success[which] = answer.q, answer.success
        self.rejected["out of the fingers' reach"] += int((~success).sum())
        if not success.any():
            return
        q, best = q[success], best[success]
        placed = robot.fk(q, self.hand.root).copy()
        placed[:, :3, 3] += self.body.com
        joints = np.ascontiguousarray(q[:, 6:])
        inside = points[best] + 0.004 * normals[best] - placed[:, None, :3, 3]
        targets = np.where(
            chosen[best][..., None], np.einsum("nji,nkj->nki", placed[:, :3, :3], inside), fingers.pad_places(joints)[0]
        )
        self._close(self._opened(joints, placed), placed, targets, "inverse")

    def _opened(self, q: Array, pose: Array) -> Array:
        """Joints with the pads drawn back from where they touch as little as gives room, or as much as was tried."""
        out = q.copy()
        left = np.arange(len(q))
        for back in BACK:
            out[left] = retract(self.fingers, q[left], back)
            left = left[~(self._free(out[left], pose[left]) & self.fingers.own.free(out[left]))]
            if not len(left):
                break
        return out

    def _ahead(self, pick: IntArray, pose: Array) -> tuple[Array, Array, BoolArray, Array]:
        """Where each pad of placed pre-grasps would meet the surface going the way it faces: points and inward normals
        ``(N, k, 3)``, whether it would, at an angle that a pad can take, and how far it is."""
        pads, facing = self.fingers.pad_places(self.fingers.cages.q[pick])
        R = pose[:, :3, :3]
        origin = np.einsum("nij,nkj->nki", R, pads) + pose[:, None, :3, 3]
        along = np.einsum("nij,nkj->nki", R, facing)
        found = self.surface.crossings((origin - REACH * along).reshape(-1, 3), along.reshape(-1, 3), 0.0, 2.0 * REACH)
        first = np.argmax(found.entering & np.isfinite(found.times), axis=1)
        rows = np.arange(len(first))
        face, time = found.faces[rows, first], found.times[rows, first]
        hit = found.entering[rows, first] & (face >= 0) & np.isfinite(time)
        normals = np.where(hit[:, None], -self.surface.normals[face], [0.0, 0.0, 1.0]).reshape(along.shape)
        time = np.where(hit, time, 0.0).reshape(along.shape[:2])
        points = origin + (time - REACH)[..., None] * along
        good = hit.reshape(time.shape) & ((normals * along).sum(axis=-1) > np.cos(SLANT))
        return points, normals, good, time - REACH

    def _closed_sets(self, points: Array, normals: Array, hit: BoolArray) -> tuple[BoolArray, Array]:
        """Which pads make a force-closure grasp ``(N, k)``, all that would touch, and its margin (0 if none)."""
        margin = np.zeros(len(hit))
        for pads in np.unique(hit, axis=0):
            which = np.flatnonzero((hit == pads).all(axis=1))
            if pads.sum() < 3:
                continue
            found = force_closures(
                points[which][:, pads], normals[which][:, pads], self.settings.friction, reference=self.body.com,
                length=self.body.radius,
            )  # fmt: skip
            margin[which] = found.margin
        return hit, margin

    def _placed(self, count: int) -> tuple[IntArray, Array, Array]:
        """At most *count* of the random placements of `_drawn`: open hands above the table, from where it is asked."""
        table, wanted = self.settings.table, self.settings.approach
        if not len(table) and wanted is None:
            return self._drawn(count)
        pick, pose, along = self._drawn((3 if count == PLACES else SPARE) * count)
        good = (table[:, :3] @ along.T < FROM_BELOW).all(axis=0)
        if wanted is not None:
            good &= (wanted @ along.T).max(axis=0) > np.cos(min(self.settings.approach_tolerance + SIDEWAYS, np.pi))
        keep = np.flatnonzero(good)
        keep = keep[self._above(self.fingers.cages.q[pick[keep]], pose[keep])][:count]
        return pick[keep], pose[keep], along[keep]

    def _drawn(self, count: int) -> tuple[IntArray, Array, Array]:
        """Random placements: which pre-grasp, T_body_hand ``(N, 4, 4)`` with its focus in the body, and the approach.

        The approach is that of a point of the surface, more or less; the focus lies up to half the thickness behind it.
        """
        rng, cages = self.rng, self.fingers.cages
        pick = rng.integers(len(cages.q), size=count)
        points, normals, _ = self.body.sample_surface(count, rng)
        through = self.surface.crossings(points + 1e-5 * normals, normals).times[:, 0]
        depth = rng.random(count) * np.minimum(np.where(np.isfinite(through), 0.5 * through, 0.0), 0.05)
        along = normals + 0.35 * rng.normal(size=normals.shape)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        pose = np.tile(np.eye(4), (count, 1, 1))
        pose[:, :3, :3] = _turns(cages.approach[pick], along, rng.uniform(0.0, 2.0 * np.pi, count))
        place = points + depth[:, None] * normals
        pose[:, :3, 3] = place - np.einsum("nij,nj->ni", pose[:, :3, :3], cages.focus[pick])
        return pick, pose, along

    def _closing(self) -> None:
        """Put the place that the pads face into the body, come from outside as far as there is room, close."""
        fingers = self.fingers
        self.tried["closing"] += BATCH
        pick, pose, along = self._placed(BATCH)
        if not len(pick):
            self.rejected["hits the table"] += BATCH
            return
        cages = fingers.cages
        q = retract(fingers, cages.q[pick], OPEN)
        tight = ~fingers.own.free(q)
        q[tight] = cages.q[pick[tight]]
        room = np.zeros(len(pick), np.bool_)
        for back in np.linspace(0.0, 0.06, 9):  # the deepest place with room
            left = np.flatnonzero(~room)
            trial = pose[left].copy()
            trial[:, :3, 3] -= back * along[left]
            free = self._free(q[left], trial)
            pose[left[free]], room[left[free]] = trial[free], True
        self.rejected["no room for the open hand"] += int((~room).sum())
        if room.any():
            self._close(q[room], pose[room], cages.targets[pick[room]], "closing")

    # what both share

    def _free(self, q: Array, pose: Array) -> BoolArray:
        """Whether open hands have room: outside the body, and clear of it."""
        distance, _ = self.fingers.distances(self.surface, q, pose, 2.0 * CLEARANCE)
        free = distance.min(axis=1) > CLEARANCE
        middles = self.fingers.shape_poses(q[free], pose[free])[..., :3, 3]
        inside = self.surface.contains(middles.reshape(-1, 3)).reshape(middles.shape[:2]).any(axis=1)
        free[np.flatnonzero(free)[inside]] = False
        out: BoolArray = free
        return out

    def _close(self, q: Array, pose: Array, targets: Array, method: str) -> None:
        free = self._free(q, pose) & self.fingers.own.free(q)
        self.rejected["no room for the open hand"] += int((~free).sum())
        if not free.any():
            return
        q, pose, targets = q[free], pose[free], targets[free]
        touching = close(self.fingers, self.surface, q, pose, targets)
        above = self._above(touching.q, pose)
        for i in range(len(q)):
            if touching.distance[i].min() <= 0.0:
                self.rejected["penetrates the body"] += 1
            elif not above[i]:
                self.rejected["hits the table"] += 1
            else:
                self._judge(touching, i, pose[i], method)

    def _above(self, q: Array, pose: Array) -> BoolArray:
        """Whether all shapes of hands keep out of the table, by their oriented boxes."""
        fingers = self.fingers
        out = np.ones(len(q), np.bool_)
        for start in range(0, len(q), 2048):
            part = slice(start, start + 2048)
            poses = fingers.shape_poses(q[part], pose[part])
            for n, d in zip(self.settings.table[:, :3], self.settings.table[:, 3], strict=True):
                reach = np.abs(np.einsum("i,nsij->nsj", n, poses[..., :3, :3])) * fingers.halves
                lowest = poses[..., :3, 3] @ n - reach.sum(axis=-1)
                out[part] &= (lowest > d + self.settings.table_clearance).all(axis=1)
        return out

    def _way_in(self, q: Array, pose: Array, along: Array) -> Array | None:
        """Joints of the open hand ``(n,)`` that comes along the unit vector *along* to close there, or None.

        Its way is free of body and table, and the fingers of each other.
        """
        fingers, s = self.fingers, self.settings
        opened = np.concatenate([retract(fingers, q[None], back) for back in OPENINGS])
        opened = opened[fingers.own.free(opened)]
        if not len(opened):
            return None
        way = np.tile(pose, (len(opened), WAY, 1, 1))
        way[..., :3, 3] -= np.linspace(0.0, s.standoff, WAY)[:, None] * along
        joints, poses = np.repeat(opened, WAY, axis=0), way.reshape(-1, 4, 4)
        distance, _ = fingers.distances(self.surface, joints, poses, 1.5 * max(s.clearance, CLEARANCE))
        room = np.where(self._above(joints, poses), distance.min(axis=1), 0.0).reshape(-1, WAY).min(axis=1)
        best = int(np.argmax(np.minimum(room, s.clearance)))  # the first of those with enough
        return opened[best].copy() if room[best] > CLEARANCE else None

    def _judge(self, touching: Touching, i: int, pose: Array, method: str) -> None:
        s, body = self.settings, self.body
        contacts, links = contacts_of(self.fingers, touching, i, s.friction, body.torsional_friction)
        if len(contacts) < (2 if body.torsional_friction > 0.0 else 3):
            self.rejected["too few contacts"] += 1
            return
        grasp = Grasp(contacts, reference=body.com, length=body.radius)
        closure = grasp.force_closure()
        if not closure.success:
            self.rejected["no force closure"] += 1
            return
        q = touching.q[i]
        tcp = pose.copy()
        points = np.array([c.position for c in contacts])
        palm = pose @ self.fingers.robot.fk(q, self.hand.palm)
        towards = points.mean(axis=0) - palm[:3, 3]
        tcp[:3, :3], tcp[:3, 3] = _frames((towards / np.linalg.norm(towards))[None])[0], points.mean(axis=0)
        if s.approach is not None and (s.approach @ tcp[:3, 2]).max() < np.cos(s.approach_tolerance):
            self.rejected["comes from another side than asked for"] += 1
            return
        force = self._holding(grasp, q, links, pose)
        if force is None:
            self.rejected["too weak"] += 1
            return
        before = self._way_in(q, pose, tcp[:3, 2])
        if before is None:
            self.rejected["no way in for the open hand"] += 1
            return
        epsilon = grasp.quality(gap=0.05).lower
        margins = {
            "epsilon": epsilon,
            "closure": closure.margin,
            "contacts": float(len(contacts)),
            "position": grasp.quality("position_margin").value,
            "force": force,
            "com_distance": float(np.linalg.norm(points.mean(axis=0) - body.com)),
            "distance": float(touching.distance[i].min()),
        }
        width = float(np.linalg.norm(points[:, None] - points[None], axis=-1).max())
        self.found.append(
            HandCandidate(
                pose.copy(), tcp, width, width, contacts, epsilon, margins, force, q.copy(), before, links,
                method, closure.internal_force,
            )
        )  # fmt: skip

    def _holding(self, grasp: Grasp, q: Array, links: tuple[str, ...], pose: Array) -> float | None:
        """The largest normal force that holds the body against gravity and the acceleration, or None if it is too much
        for the joints, or more than is allowed."""
        s, body = self.settings, self.body
        table = s.table
        effort = self.fingers.robot.limits.effort
        weight = s.safety * body.mass * (9.81 + s.acceleration)
        jacobian = hand_jacobian(self.hand, q, grasp, links, np.linalg.inv(pose))
        limits = Limits(normal=s.max_force) if np.isfinite(s.max_force) else None
        torque = effort if np.isfinite(effort).all() and (effort > 0.0).all() else None
        worst = 0.0
        for direction in -table[:1, :3] if len(table) else WRENCHES:
            wrench = np.concatenate([weight * direction, np.zeros(3)])
            found = grasp.contact_forces(
                wrench, "min_normal", limits, torque_limits=torque,
                hand_jacobian=jacobian if torque is not None else None,
            )  # fmt: skip
            assert isinstance(found, ContactForces)
            if not found.success:
                return None
            normals = [found.forces[part][2] for part in grasp.slices]
            worst = max(worst, *normals)
        return worst

    def _distinct(self) -> list[HandCandidate]:
        near, turn = self.settings.apart
        chosen: list[HandCandidate] = []
        for candidate in self.found:
            if len(chosen) == self.n:
                break
            if not any(
                np.linalg.norm(candidate.pose[:3, 3] - c.pose[:3, 3]) < near
                and np.trace(candidate.pose[:3, :3].T @ c.pose[:3, :3]) > 1.0 + 2.0 * np.cos(turn)
                for c in chosen
            ):
                chosen.append(candidate)
        return chosen


def _frames(z: Array) -> Array:
    """Rotations ``(..., 3, 3)`` with the given z axes."""
    helper = np.eye(3)[np.argmin(np.abs(z), axis=-1)]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _turns(a: Array, b: Array, angle: Array) -> Array:
    """Rotations ``(N, 3, 3)`` that take unit vectors a to b, turned by *angle* about b."""
    A, B = _frames(a), _frames(b)
    c, s = np.cos(angle), np.sin(angle)
    spin = np.zeros((len(a), 3, 3))
    spin[:, 0, 0], spin[:, 0, 1], spin[:, 1, 0], spin[:, 1, 1], spin[:, 2, 2] = c, -s, s, c, 1.0
    return B @ spin @ A.transpose(0, 2, 1)


def _coordinates(pose: Array, about: Array) -> Array:
    """x, y, z from *about* and the turns about z, y, x ``(N, 6)``: the first coordinates of `Fingers.floating`."""
    R = pose[:, :3, :3]
    turns = [np.arctan2(R[:, 1, 0], R[:, 0, 0]), np.arcsin(np.clip(-R[:, 2, 0], -1.0, 1.0)),
             np.arctan2(R[:, 2, 1], R[:, 2, 2])]  # fmt: skip
    return np.concatenate([pose[:, :3, 3] - about, np.stack(turns, axis=1)], axis=1)
