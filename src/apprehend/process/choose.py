"""From ranked grasps to the one that the arm can carry out: approach, lift, and placing, all before it moves."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .. import ik, planning
from ..arrays import Array
from ..collision import CollisionModel
from ..grasp import Candidate
from .context import Context
from .posture import closed, opened

STANDOFF = 0.08
"""Distance in m from which the open hand approaches in a straight line, and to which it backs off."""

LIFT = 0.12
"""Height in m of the straight lift and of the straight set-down."""

SHORTEST = 0.4
"""Share of the standoff that backing off needs at the least."""

POSTURES = 6
"""Arm postures that are tried for one pose of the hand."""


@dataclass(frozen=True, eq=False)
class Choice:
    """A grasp with the straight joint paths around it, each ``(m, n)``, first point to last.

    *approach*: standoff to grasp, open; *lift*: grasp upwards. That there is a way down to the place and back from it
    was checked; those paths are made anew from how the object is then held.
    """

    index: int
    candidate: Candidate
    approach: Array
    lift: Array


class Models:
    """The collision models of the phases; what may touch differs from phase to phase."""

    def __init__(self, context: Context, pose: Array) -> None:
        self._context = context
        self._body = context.body
        self._name = context.name
        self._hand = [name for name in context.hand.robot.frame_names if name in context.collisions.names]
        self.free = context.collisions.add(self._name, self._body, pose)

    @property
    def touching(self) -> list[tuple[str, str]]:
        """Links of the hand with the body: the grasp planner has checked them on the actual mesh."""
        return [(link, self._name) for link in self._hand]

    @cached_property
    def open(self) -> CollisionModel:
        """The body where it was located; the hand may touch it."""
        return self.free.allow(self.touching)

    @property
    def way(self) -> CollisionModel:
        """The body where it was located, on the way to it: jaws may come near, fingers must not touch it before."""
        return self.open if self._context.hand.is_jaw else self.free

    def carrying(self, held: Array) -> CollisionModel:
        """The body in the hand at *held* (T_hand_body)."""
        return self.free.attach(self._body, self._context.hand.root, held)

    def supported(self, held: Array) -> CollisionModel:
        """The body in the hand, and allowed to touch what it stood on or will stand on."""
        return self.carrying(held).allow((box.name, self._name) for box in self._context.scene.boxes)

    @cached_property
    def placed(self) -> CollisionModel:
        """The body at its goal; the hand may touch it."""
        return self.free.add(self._name, self._body, self._context.goal).allow(self.touching)


def choose(context: Context) -> tuple[Choice | None, Counter[str]]:
    """The first of the ranked grasps that has a way in, up, and down again; and why the others had none."""
    assert context.plan is not None
    assert context.pose is not None
    models = Models(context, context.pose)
    reasons: Counter[str] = Counter()
    candidates = context.plan.candidates
    order = [i for i in range(len(candidates)) if i not in context.tried]
    if not order:
        return None, reasons
    poses = np.array([context.pose @ candidates[i].pose for i in order])
    found = ik.solve(context.robot, poses, context.hand.root, n_solutions=POSTURES, diagnose=False, rng=context.rng)
    for k, i in enumerate(order):
        context.tell(f"grasp {k + 1} of {len(order)}")
        if not found.found[k]:
            reasons["out of reach"] += 1
            continue
        outcome = feasible(context, models, i, found.solutions(k))
        if isinstance(outcome, Choice):
            return outcome, reasons
        reasons[outcome] += 1
    return None, reasons


def feasible(context: Context, models: Models, index: int, postures: Array) -> Choice | str:
    """The grasp with its paths, or the first stage at which the most promising posture failed."""
    candidate: Candidate = context.plan.candidates[index]  # type: ignore[union-attr]
    open_ = context.with_fingers(postures, opened(context, candidate))
    free = models.way.free(open_)
    if not free.any():
        return "arm or hand collides at the grasp"
    distance = np.abs(open_ - context.q)[:, context.joints].max(axis=1)
    furthest = "the approach is blocked"
    for q in open_[np.argsort(distance)]:
        if not models.way.free(q):
            continue
        T = context.robot.fk(q, context.hand.root)
        back = line(context, models.way, q, T @ shift(-STANDOFF * approach_axis(candidate)))
        if back is None:
            continue
        held = np.asarray(np.linalg.inv(candidate.pose), dtype=np.float64)
        gripping = context.with_fingers(q, closed(context, candidate))
        up = line(context, models.supported(held), gripping, shift([0.0, 0.0, LIFT]) @ T)
        if up is None:
            furthest = "the lift is blocked"
            continue
        down = place_line(context, models, up[-1], held)
        if down is None:
            furthest = "the place cannot be reached"
            continue
        release = context.with_fingers(down[-1], opened(context, candidate))
        T_place = context.robot.fk(release, context.hand.root)
        away = line(context, models.placed, release, T_place @ shift(-STANDOFF * approach_axis(candidate)))
        if away is None:
            furthest = "the retreat is blocked"
            continue
        return Choice(index, candidate, back[::-1], up)
    return furthest


def place_line(context: Context, models: Models, q: Array, held: Array) -> Array | None:
    """The straight set-down ``(m, n)`` from `LIFT` above the goal, in a posture near *q*; None where there is none."""
    T = context.goal @ np.linalg.inv(held)
    found = ik.solve(context.robot, T, context.hand.root, q, n_solutions=POSTURES, diagnose=False, rng=context.rng)
    model = models.supported(held)
    if not found.success:
        return None
    postures = found.solutions()
    postures[:, context.fingers] = q[context.fingers]
    distance = np.abs(postures - q)[:, context.joints].max(axis=1)
    for posture in postures[np.argsort(distance)]:
        if model.free(posture):
            up = line(context, model, posture, shift([0.0, 0.0, LIFT]) @ T)
            if up is not None:
                return up[::-1]
    return None


def line(context: Context, model: CollisionModel, q: Array, T: Array) -> Array | None:
    """Joint samples of the straight line of the hand from *q* to pose *T*, or None."""
    result = planning.straight(context.robot, model, q, context.hand.root, T)
    return result.path if result.success else None


def withdraw(context: Context, model: CollisionModel, candidate: Candidate) -> Array | None:
    """Joint samples of the straight way back from the object, as far as there is one, at least `SHORTEST` of it."""
    q = context.q
    T = context.robot.fk(q, context.hand.root)
    for share in (1.0, 0.7, SHORTEST):
        samples = line(context, model, q, T @ shift(-share * STANDOFF * approach_axis(candidate)))
        if samples is not None:
            return samples
    return None


def approach_axis(candidate: Candidate) -> Array:
    """Direction of the approach in the hand's frame, (3,)."""
    return np.asarray((np.linalg.inv(candidate.pose) @ candidate.tcp)[:3, 2])


def shift(offset: Array | list[float]) -> Array:
    """A translation (4, 4)."""
    T = np.eye(4)
    T[:3, 3] = offset
    return T
