"""Steps that bring the hand to the object and up with it: reach, approach, lift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import planning
from .choose import Models
from .context import Context
from .motion import CAREFUL, FREE, Done, along_line, along_path, execute, in_hand
from .step import Outcome

PLANNING_TIME = 5.0
RAISED = 0.02
"""Height in m that the object must have gained after the lift."""


def facts(done: Done) -> dict[str, float]:
    """Margins of an executed motion."""
    return {"tracking_error": done.worst_error, "final_error": done.final_error, "effort": done.peak_effort}


@dataclass(frozen=True)
class Reach:
    """Coarse positioning: a collision-free motion of the arm to the standoff before the object."""

    name: str = "reach"
    title: str = "Reach the standoff"

    def run(self, context: Context) -> Outcome:
        """Plan in joint space, time within the limits, execute."""
        assert context.pose is not None
        model = Models(context, context.pose).free
        start = context.q
        goal = start.copy()
        goal[context.joints] = context.chosen.approach[0][context.joints]
        result = planning.plan(
            model, start, goal[None], rng=context.rng, time_limit=PLANNING_TIME, joints=context.joints
        )
        if not result.success:
            return Outcome(False, result.explain(), {"goal": goal})
        motion = along_path(context, result.path, model, FREE)
        done = execute(context, motion)
        return Outcome(
            True,
            f"{len(result.path)} points, {motion.duration:.2f} s",
            {"start": start, "goal": goal},
            {"path": result.path, "duration": motion.duration},
            facts(done),
        )


@dataclass(frozen=True)
class Approach:
    """Fine positioning: the open hand moves in a straight line over the object."""

    name: str = "approach"
    title: str = "Approach in a line"

    def run(self, context: Context) -> Outcome:
        """Time the line's joint samples within the limits, execute."""
        motion = along_line(context, context.chosen.approach, CAREFUL)
        before = context.world.body_pose(context.name)
        done = execute(context, motion)
        pushed = float(np.linalg.norm(context.world.body_pose(context.name)[:3, 3] - before[:3, 3]))
        return Outcome(
            pushed < 0.02,
            f"{motion.duration:.2f} s, moved the object {pushed * 1e3:.1f} mm",
            {"samples": len(context.chosen.approach)},
            {"duration": motion.duration},
            {**facts(done), "pushed": pushed},
            retry=True,
        )


@dataclass(frozen=True)
class Lift:
    """Lift the object straight up."""

    name: str = "lift"
    title: str = "Lift"

    def run(self, context: Context) -> Outcome:
        """Carry the load in the arm's model, watch the slip, and check that the object came along."""
        world = context.world
        context.held = in_hand(context)
        context.slip, context.dropped = 0.0, False
        carry(context)
        height = float(world.body_pose(context.name)[2, 3])
        motion = along_line(context, context.chosen.lift, CAREFUL)
        done = execute(context, motion)
        raised = float(world.body_pose(context.name)[2, 3]) - height
        if context.dropped or raised < RAISED:
            return Outcome(False, f"the object rose by {raised * 1e3:.0f} mm only: the grasp does not hold", retry=True)
        return Outcome(
            True,
            f"raised {raised * 1e3:.0f} mm, slip {context.slip * 1e3:.2f} mm",
            outputs={"raised": raised, "duration": motion.duration},
            margins={**facts(done), "slip": context.slip},
        )


def carry(context: Context) -> None:
    """Tell the arm's controller of the load in the hand."""
    from ..sim import Load

    assert context.held is not None
    com = context.held[:3, :3] @ context.body.com + context.held[:3, 3]
    context.arm.load = Load(context.hand.root, context.body.mass, com)
