"""Steps that bring the object to its place: transport, set down, let go, retreat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import planning
from ..arrays import Array
from .choose import LIFT, Models, place_line, withdraw
from .context import Context
from .motion import CAREFUL, CARRYING, FREE, along_line, along_path, execute, in_hand
from .posture import spread
from .reaching import PLANNING_TIME, facts
from .step import Outcome

RELEASE_TIME = 1.5

UPRIGHT = 0.25
"""Largest tilt in rad of a body that must stay upright, on the planned path; rounded corners may add 0.1."""


@dataclass(frozen=True)
class Transport:
    """Carry the object to above its place."""

    name: str = "transport"
    title: str = "Carry to the place"

    def run(self, context: Context) -> Outcome:
        """Plan with the object in the hand, as it is really held."""
        assert context.held is not None
        models = Models(context, np.asarray(context.world.body_pose(context.name)))
        start = context.q
        down = place_line(context, models, start, context.held)
        if down is None:
            return Outcome(
                False, f"no posture sets the object down from {LIFT * 100:.0f} cm above its goal as it is held"
            )
        model = models.carrying(context.held)
        result = planning.plan(
            model, start, down[:1], rng=context.rng, time_limit=PLANNING_TIME, joints=context.joints,
            constraints=upright(context, context.held),
        )  # fmt: skip
        if not result.success:
            return Outcome(False, result.explain())
        motion = along_path(context, result.path, model, CARRYING)
        done = execute(context, motion)
        if context.dropped:
            return Outcome(False, "the object left the hand")
        return Outcome(
            True,
            f"{len(result.path)} points, {motion.duration:.2f} s, slip {context.slip * 1e3:.2f} mm",
            {"start": start, "goal": down[0]},
            {"path": result.path, "duration": motion.duration},
            {**facts(done), "slip": context.slip},
        )


def upright(context: Context, held: Array) -> list[planning.PathConstraint]:
    """What keeps the body on its way as it will stand at its goal, where the scene wants it upright."""
    if not context.scene.upright:
        return []
    axis = held[:3, :3] @ context.goal[2, :3]  # the body's axis that points up at the goal, in the hand
    return [planning.Upright(context.hand.root, axis, UPRIGHT)]


@dataclass(frozen=True)
class Place:
    """Lower the object in a straight line onto its place."""

    name: str = "place"
    title: str = "Set down"

    def run(self, context: Context) -> Outcome:
        """Lower it to its goal as it is held now."""
        assert context.held is not None
        held = in_hand(context)
        models = Models(context, np.asarray(context.world.body_pose(context.name)))
        target = context.goal @ np.linalg.inv(held)
        result = planning.straight(context.robot, models.supported(held), context.q, context.hand.root, target)
        if not result.success:
            return Outcome(False, f"the set-down is blocked: {result.explain()}")
        motion = along_line(context, result.path, CAREFUL)
        done = execute(context, motion)
        if context.dropped:
            return Outcome(False, "the object left the hand before it stood")
        context.held = None
        return Outcome(
            True, f"lowered in {motion.duration:.2f} s", outputs={"duration": motion.duration}, margins=facts(done)
        )


@dataclass(frozen=True)
class Release:
    """Open the hand."""

    name: str = "release"
    title: str = "Let go"

    def run(self, context: Context) -> Outcome:
        """Open as far as for the approach."""
        context.arm.load = None
        before = context.world.body_pose(context.name)
        spread(context, context.chosen.candidate, RELEASE_TIME)
        moved = float(np.linalg.norm(context.world.body_pose(context.name)[:3, 3] - before[:3, 3]))
        return Outcome(True, f"the object moved {moved * 1e3:.1f} mm", margins={"moved": moved})


@dataclass(frozen=True)
class Retreat:
    """Back off in a straight line, and go home."""

    name: str = "retreat"
    title: str = "Retreat"

    def run(self, context: Context) -> Outcome:
        """Back off along the approach direction, then plan home."""
        models = Models(context, context.world.body_pose(context.name))
        back = withdraw(context, models.open, context.chosen.candidate)
        if back is None:
            return Outcome(False, "the straight way back from the object is blocked")
        done = execute(context, along_line(context, back, CAREFUL))
        away = home_again(context, models)
        return Outcome(True, "backed off" + (", and went home" if away else ""), margins=facts(done))


def home_again(context: Context, models: Models) -> bool:
    """Go to the home posture where there is a way; the object's fate does not depend on it."""
    start: Array = context.q
    goal = start.copy()
    goal[context.joints] = context.robot.home[context.joints]
    result = planning.plan(
        models.free, start, goal[None], rng=context.rng, time_limit=PLANNING_TIME, joints=context.joints
    )
    if result.success:
        execute(context, along_path(context, result.path, models.free, FREE))
    return result.success
