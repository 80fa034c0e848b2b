"""Step *locate*: where is the object in the scene?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .context import Context
from .step import Outcome


@dataclass(frozen=True)
class Locate:
    """Let the scene come to rest, and read the object's pose from the simulator's state.

    This is the step to replace by one that sees: it must set ``context.pose`` to T_world_body.
    """

    name: str = "locate"
    title: str = "Locate the object"

    def run(self, context: Context) -> Outcome:
        """Settle, then read."""
        described = context.scene.bodies[context.name].pose
        settled = context.world.settle(context.arm, context.gripper)
        context.pose = context.world.body_pose(context.name)
        moved = float(np.linalg.norm(context.pose[:3, 3] - described[:3, 3]))
        x, y, z = context.pose[:3, 3]
        if not settled.success:
            return Outcome(False, f"the scene did not come to rest: {settled.explain()}", margins={"moved": moved})
        return Outcome(
            True,
            f"{context.name} rests at ({x:.3f}, {y:.3f}, {z:.3f}) m",
            inputs={"source": "simulator state"},
            outputs={"pose": context.pose},
            margins={"moved": moved},
        )
