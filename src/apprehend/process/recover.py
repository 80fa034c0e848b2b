"""After a grasp that failed: let go, back off, and look again."""

from __future__ import annotations

import numpy as np

from .. import planning
from .choose import STANDOFF, Models, approach_axis, shift
from .context import Context
from .motion import CAREFUL, along_line, execute

OPEN_TIME = 2.0


def back_off(context: Context) -> None:
    """Open the hand, retreat along the approach, let the scene settle, and locate the object anew."""
    world, choice = context.world, context.chosen
    context.held, context.slip, context.dropped, context.arm.load = None, 0.0, False, None
    context.gripper.move(world, choice.candidate.opening)
    world.run(OPEN_TIME, context.arm, context.gripper, until=lambda w: context.gripper.state.name == "ARRIVED")
    q = world.q
    pose = context.robot.fk(q, context.hand.root) @ shift(-STANDOFF * approach_axis(choice.candidate))
    models = Models(context, np.asarray(world.body_pose(context.name)))
    back = planning.straight(context.robot, models.open, q, context.hand.root, pose)
    if back.success:
        execute(context, along_line(context, back.path, CAREFUL))
    world.settle(context.arm, context.gripper)
    before, context.pose = context.pose, world.body_pose(context.name)
    assert before is not None
    moved = np.linalg.norm(context.pose - before) > 0.02
    context.tried = set() if moved else context.tried | {choice.index}
    if moved:
        context.plan = None
