"""Steps around the grasp itself: plan it, open the hand, close it until contact, and rate what is held."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import grasp
from ..arrays import Array
from ..sim import grip
from .choose import choose
from .context import Context
from .motion import ACCELERATION, in_hand
from .step import Outcome

GRASPS = 80
"""Grasps that are planned; the arm takes the best that it can carry out."""

SAME_POSTURE = 0.05
"""Largest change of the supporting planes (unit normal, offset in m) at which planned grasps stay good."""

OPEN_TIME = 3.0
SAFETY = 1.5
"""Factor on weight and acceleration that a planned grasp must withstand."""

FORCE_FACTOR = 1.4
"""The grip is this many times what the planner computed to be needed, as far as the hand can press."""


@dataclass(frozen=True)
class PlanGrasp:
    """Plan grasps on the mesh, and choose the best that the arm can approach, lift and place."""

    name: str = "plan"
    title: str = "Plan the grasp"

    def run(self, context: Context) -> Outcome:
        """Set ``context.plan``, unless there is one for this posture of the object, and ``context.choice``."""
        assert context.pose is not None
        planes = np.array([support_plane(context, T) for T in (context.pose, context.goal)])
        if context.plan is None or np.abs(planes - context.planes).max() > SAME_POSTURE:
            context.tell("searching the surface")
            context.plan = grasp.plan(
                context.hand, context.body, GRASPS, rng=context.rng, table=planes, safety=SAFETY,
                acceleration=ACCELERATION,
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
            inputs={"grasps": GRASPS, "body": context.body.name, "hand": context.hand.root},
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
    """Open the hand to the width of the pre-grasp."""

    name: str = "preshape"
    title: str = "Open the hand"

    def run(self, context: Context) -> Outcome:
        """Move the jaws by position."""
        width = context.chosen.candidate.opening
        context.gripper.move(context.world, width)
        context.world.run(
            OPEN_TIME, context.arm, context.gripper, until=lambda w: context.gripper.state.name == "ARRIVED"
        )
        reached = context.gripper.width(context.world)
        ok = abs(reached - width) < 1e-3
        return Outcome(ok, f"opened to {reached * 1e3:.1f} mm", {"width": width}, {"width": reached})


@dataclass(frozen=True)
class Close:
    """Close the hand until both pads feel the object, then press with the force that the grasp needs."""

    name: str = "close"
    title: str = "Close until contact"

    def run(self, context: Context) -> Outcome:
        """Grip."""
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

    SLIP = 0.01
    """Slip in m during the lift from which on another grasp is tried."""

    def run(self, context: Context) -> Outcome:
        """Compare the pad forces with the command, and the object's pose in the hand with that at contact."""
        one, two = context.gripper.pad_forces(context.world)
        wrench = context.world.contact_force(context.name, context.hand.robot.frame_names)
        weight = context.body.mass * context.scene.gravity
        if min(one, two) <= 0.0 or context.dropped:
            return Outcome(False, "the object is not in the hand any more", retry=True)
        if context.slip > self.SLIP:
            return Outcome(False, f"the object slipped {context.slip * 1e3:.1f} mm while it was lifted", retry=True)
        context.held = in_hand(context)
        return Outcome(
            True,
            f"held with {one:.1f} and {two:.1f} N, carries {wrench[2]:.2f} of {weight:.2f} N, "
            f"slip {context.slip * 1e3:.2f} mm",
            outputs={"forces": [one, two], "wrench": wrench},
            margins={"slip": context.slip, "carried": float(wrench[2] / weight)},
        )
