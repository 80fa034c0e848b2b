"""Steps around the grasp itself: plan it, open the hand, close it until contact, and rate what is held."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import grasp
from ..arrays import Array
from ..sim import Gripper, grip
from .choose import choose
from .context import Context
from .motion import acceleration_of, in_hand
from .posture import opened, spread
from .step import Outcome

GRASPS, FINGER_GRASPS = 80, 24
"""Grasps that are planned for jaws and for fingers; the arm takes the best that it can carry out."""

SAME_POSTURE = 0.05
"""Largest change of the supporting planes (unit normal, offset in m) at which planned grasps stay good."""

OPEN_TIME = 3.0
SAFETY, FINGER_SAFETY = 1.5, 1.25
"""Factor on weight and acceleration that a planned grasp must withstand, by jaws and by fingers."""

FORCE_FACTOR = 1.4
"""The grip is this many times what the planner computed to be needed, as far as the hand can press."""

SLIP = 0.01
"""Slip in m during the lift from which on another grasp is tried."""

ARRIVED = 0.05
"""Largest deviation of a finger joint from its pre-grasp, in rad."""


@dataclass(frozen=True)
class PlanGrasp:
    """Plan grasps on the mesh, and choose the best that the arm can approach, lift and place.

    *samples* are the tries of the planner, as many as it thinks right where None (`grasp.plan`).
    """

    samples: int | None = None
    name: str = "plan"
    title: str = "Plan the grasp"

    def run(self, context: Context) -> Outcome:
        """Set ``context.plan``, unless there is one for this posture of the object, and ``context.choice``."""
        assert context.pose is not None
        planes = np.array([support_plane(context, T) for T in (context.pose, context.goal)])
        if context.plan is None or np.abs(planes - context.planes).max() > SAME_POSTURE:
            context.tell("searching the surface")
            wanted, safety = (GRASPS, SAFETY) if context.hand.is_jaw else (FINGER_GRASPS, FINGER_SAFETY)
            context.plan = grasp.plan(
                context.hand, context.body, wanted, rng=context.rng, table=planes, safety=safety,
                acceleration=acceleration_of(context), samples=self.samples,
            )  # fmt: skip
            context.planes, context.tried = planes, set()
        plan = context.plan
        if not plan.success:
            return Outcome(False, plan.explain())
        context.choice, reasons = choose(context)
        if context.choice is None:
            told = ", ".join(f"{count} × {reason}" for reason, count in reasons.most_common())
            return Outcome(False, f"the arm can carry out none of {len(plan.candidates)} grasps: {told}")
        best = context.choice.candidate
        return Outcome(
            True,
            f"grasp {context.choice.index + 1} of {len(plan.candidates)}: {best.width * 1e3:.0f} mm wide, "
            f"needs {best.required_force:.1f} N",
            inputs={"grasps": len(plan.candidates), "body": context.body.name, "hand": context.hand.root},
            outputs={
                "pose": best.pose, "tcp": best.tcp, "width": best.width, "opening": best.opening,
                "contacts": [c.position for c in best.contacts], "normals": [c.normal for c in best.contacts],
                "rejected": dict(reasons),
            },
            margins={k: float(v) for k, v in best.margins.items()},
        )  # fmt: skip


def support_plane(context: Context, T: Array) -> Array:
    """What the body at *T* (T_world_body) rests on, as a half-space in its frame: (n, d) with n·x ≥ d free."""
    lowest = float((context.body.vertices @ T[2, :3]).min())
    return np.append(T[2, :3], lowest)


@dataclass(frozen=True)
class Preshape:
    """Open the hand for the pre-grasp."""

    name: str = "preshape"
    title: str = "Open the hand"

    def run(self, context: Context) -> Outcome:
        """Move the fingers by position."""
        candidate = context.chosen.candidate
        left = spread(context, candidate, OPEN_TIME)
        inputs = {"width": candidate.opening, "joints": opened(context, candidate)}
        if isinstance(context.gripper, Gripper):
            width = context.gripper.width(context.world)
            return Outcome(left < 1e-3, f"opened to {width * 1e3:.1f} mm", inputs, {"width": width})
        told = f"the worst joint is {np.degrees(left):.1f}° from its pre-grasp"
        return Outcome(left < ARRIVED, told, inputs, {"joints": context.gripper.positions(context.world)})


@dataclass(frozen=True)
class Close:
    """Close the hand until both pads feel the object, then press with the force that the grasp needs."""

    name: str = "close"
    title: str = "Close until contact"

    def run(self, context: Context) -> Outcome:
        """Grip."""
        assert isinstance(context.gripper, Gripper)
        needed = context.chosen.candidate.required_force
        force = float(np.clip(FORCE_FACTOR * needed, 5.0, context.hand.jaw.max_force))
        result = grip(context.world, context.gripper, force, context.arm)
        planned = context.chosen.candidate.width
        return Outcome(
            result.success,
            f"{result.explain()}",
            inputs={"force": force, "needed": needed},
            outputs={"width": result.width, "forces": list(result.forces), "time": result.time},
            margins={"width_error": result.width - planned, "force_reserve": force / needed if needed > 0 else np.inf},
            retry=True,
        )


@dataclass(frozen=True)
class Rate:
    """Rate what is held after the lift: contact forces, and whether the object moved in the hand (haptic rating)."""

    name: str = "rate"
    title: str = "Rate the grasp"

    def run(self, context: Context) -> Outcome:
        """Compare the pad forces with the command, and the object's pose in the hand with that at contact."""
        assert isinstance(context.gripper, Gripper)
        one, two = context.gripper.pad_forces(context.world)
        wrench = context.world.contact_force(context.name, context.hand.robot.frame_names)
        weight = context.body.mass * context.scene.gravity
        if min(one, two) <= 0.0 or context.dropped:
            return Outcome(False, "the object is not in the hand any more", retry=True)
        if context.slip > SLIP:
            return Outcome(False, f"the object slipped {context.slip * 1e3:.1f} mm while it was lifted", retry=True)
        context.held = in_hand(context)
        return Outcome(
            True,
            f"held with {one:.1f} and {two:.1f} N, carries {wrench[2]:.2f} of {weight:.2f} N, "
            f"slip {context.slip * 1e3:.2f} mm",
            outputs={"forces": [one, two], "wrench": wrench},
            margins={"slip": context.slip, "carried": float(wrench[2] / weight)},
        )
