"""After a grasp that failed: let go and back off."""

from __future__ import annotations

import numpy as np

from .choose import Models, withdraw
from .context import Context
from .motion import CAREFUL, along_line, execute
from .posture import spread

OPEN_TIME = 2.0


def back_off(context: Context) -> None:
    """Open the hand, retreat along the approach, and note the grasp as tried; locating and planning come again."""
    world, choice = context.world, context.chosen
    context.held, context.slip, context.dropped, context.arm.load = None, 0.0, False, None
    spread(context, choice.candidate, OPEN_TIME)
    models = Models(context, np.asarray(world.body_pose(context.name)))
    back = withdraw(context, models.open, choice.candidate)
    if back is not None:
        execute(context, along_line(context, back, CAREFUL))
    context.tried.add(choice.index)
