"""Steps of hands with several fingers: close until they feel the object, press as the mechanics asks, and rate it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..conventions import GRAVITY
from ..errors import InputError
from ..grasp import ContactForces, HandCandidate, Limits, hand_jacobian
from ..sim import Fingers, Held, close_fingers, held_in
from .context import Context
from .grasping import FINGER_SAFETY, FORCE_FACTOR, SLIP
from .motion import acceleration_of, in_hand
from .posture import closed, opened
from .step import Outcome

PAD_SPEED, TOUCH_SPEED = 0.06, 0.02
"""Speeds in m/s of the fastest pad: towards where it should touch, and on from there."""

BEYOND = 0.02
"""A finger goes on for that distance in m where it does not feel what it should."""

MOST_TURN = 0.5
"""Largest turn of a joint in rad for that."""

RESERVE = 0.9
"""Share of the joints' efforts that contact forces may take."""

LEAST_FORCE = 3.0
"""Normal force in N that a contact may always take: less than the joints' dry friction holds nothing."""

FIRST = 0.3
"""Share of the forces with which the fingers press until the contacts are felt anew."""

PRESS_TIME = 0.4


@dataclass(frozen=True)
class CloseFingers:
    """Close each finger until it feels the object, then press with the contact forces farthest from slipping.

    The contacts are those that the hand feels, not those that were planned. The forces f balance the weight, lie within
    the friction cones as far from their walls as a bound on their normal parts allows, and take no more than the
    joints' efforts (G 2.7); the joints get ``J_Hᵗ f``.
    """

    name: str = "close"
    title: str = "Close until contact"

    def run(self, context: Context) -> Outcome:
        """Close, feel, press a little, feel again, press."""
        world, fingers, candidate = context.world, context.gripper, context.chosen.candidate
        assert isinstance(fingers, Fingers)
        assert isinstance(candidate, HandCandidate)
        path, durations = way_in(context, candidate)
        result = close_fingers(world, fingers, path, durations, context.arm)
        if not result.success:
            return Outcome(False, result.explain(), outputs={"forces": list(result.forces)}, retry=True)
        grip = press(context, fingers, FIRST)
        grip = grip if isinstance(grip, str) else press(context, fingers)
        if isinstance(grip, str):
            return Outcome(False, grip, outputs={"forces": list(fingers.forces(world))}, retry=True)
        forces = fingers.forces(world)
        told = ", ".join(f"{force:.1f}" for force in forces)
        return Outcome(
            True,
            f"{len(grip.held.grasp)} contacts of {len(set(grip.held.touching))} links press with {told} N, "
            f"{grip.needed:.1f} N at one would do",
            inputs={"planned": list(candidate.links), "planned_force": candidate.required_force},
            outputs={
                "links": sorted(set(grip.held.touching)), "forces": list(forces), "torques": grip.torques,
                "contacts": [c.position for c in grip.held.grasp.contacts], "time": result.time,
            },
            margins={"closure": grip.closure, "slack": grip.slack, "force_reserve": FORCE_FACTOR},
            retry=True,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Grip:
    """What the hand feels, and how it should press: joint torques ``(n,)`` of the contact forces."""

    held: Held
    torques: Array
    needed: float  # N, least bound on the normal forces with which weight and acceleration are held
    closure: float
    slack: float  # N, least distance of a contact's force from the wall of its friction cone


def press(context: Context, fingers: Fingers, share: float = 1.0) -> Grip | str:
    """Press with a *share* of the forces for the contacts that are felt; what is felt then, or why it does not hold."""
    grip = felt_grip(context)
    if isinstance(grip, str):
        return grip
    fingers.rest(context.world)
    fingers.press(share * grip.torques)
    context.world.run(PRESS_TIME, context.arm, fingers)
    return felt_grip(context)


def felt_grip(context: Context) -> Grip | str:
    """The contacts of the hand with the body, and the forces for them; or why they do not hold it."""
    world, hand = context.world, context.hand
    try:
        held = held_in(world, context.name, hand.robot.frame_names)
    except InputError:
        return "no link of the hand touches the object"
    closure = held.grasp.force_closure()
    links = sorted(set(held.touching))
    if not closure.success:
        return f"the contacts of {', '.join(links)} do not close: {closure.explain()}"
    joints = np.asarray(context.gripper.coordinates)
    q = world.q[joints]
    jacobian = hand_jacobian(hand, q, held.grasp, held.touching, np.linalg.inv(world.frame(hand.root)) @ held.pose)
    effort = np.asarray(context.robot.limits.effort)[joints]
    bound = RESERVE * np.where(np.isfinite(effort) & (effort > 0.0), effort, 1e6)
    weight = np.zeros(6)
    weight[:3] = -context.body.mass * GRAVITY * held.pose[2, :3]
    hard = FINGER_SAFETY * (1.0 + acceleration_of(context) / GRAVITY) * weight

    def forces(wrench: Array, objective: str, normal: float | None = None) -> ContactForces:
        found = held.grasp.contact_forces(
            wrench, objective, None if normal is None else Limits(normal=normal), torque_limits=bound,
            hand_jacobian=jacobian,
        )  # fmt: skip
        assert isinstance(found, ContactForces)
        return found

    least = forces(hard, "min_largest")
    if not least.success:
        return f"the contacts of {', '.join(links)} cannot hold the weight with the torques of the joints"
    best = forces(weight, "max_margin", max(FORCE_FACTOR * least.value, LEAST_FORCE))
    if not best.success:
        return f"no contact forces were found: {best.explain()}"
    return Grip(held, best.torques, least.value, closure.margin, float(best.slack.min()))


def way_in(context: Context, candidate: HandCandidate) -> tuple[list[Array], list[float]]:
    """Joints on the way from the open hand to contact and on from there, and the times in s for each part.

    On from contact every finger moves so that its contacts go along their normals.
    """
    hand, touch = context.hand, closed(context, candidate)
    jacobian = hand_jacobian(hand, touch, candidate.grasp(context.body), candidate.links, np.linalg.inv(candidate.pose))
    rows = np.array([part.start + 2 for part in candidate.grasp(context.body).slices])
    beyond = np.zeros(hand.n)
    for finger in hand.fingers:
        mine = [row for row, link in zip(rows, candidate.links, strict=True) if link in finger.links]
        if mine:
            own = np.array(finger.joints)
            J = jacobian[np.ix_(mine, own)]
            step = J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(len(mine)), np.full(len(mine), BEYOND))
            beyond[own] = step * min(1.0, MOST_TURN / max(float(np.abs(step).max()), 1e-12))
    last = hand.robot.limits.clip(touch + beyond)
    places = [np.array([hand.robot.fk(q, f.tip) @ np.append(f.tip_point, 1.0) for f in hand.fingers])
              for q in (opened(context, candidate), touch, last)]  # fmt: skip
    travel = [float(np.linalg.norm(b - a, axis=1).max()) for a, b in zip(places[:-1], places[1:], strict=True)]
    return [touch, last], [max(travel[0] / PAD_SPEED, 0.2), max(travel[1] / TOUCH_SPEED, 0.2)]


@dataclass(frozen=True)
class RateFingers:
    """Rate what is held after the lift: finger forces, and whether the object moved in the hand (haptic rating)."""

    name: str = "rate"
    title: str = "Rate the grasp"

    def run(self, context: Context) -> Outcome:
        """Feel the contacts again: they must still close."""
        fingers = context.gripper
        assert isinstance(fingers, Fingers)
        forces = fingers.forces(context.world)
        wrench = context.world.contact_force(context.name, context.hand.robot.frame_names)
        weight = context.body.mass * context.scene.gravity
        if context.dropped or not any(forces):
            return Outcome(False, "the object is not in the hand any more", retry=True)
        if context.slip > SLIP:
            return Outcome(False, f"the object slipped {context.slip * 1e3:.1f} mm while it was lifted", retry=True)
        grip = felt_grip(context)
        if isinstance(grip, str):
            return Outcome(False, grip, retry=True)
        context.held = in_hand(context)
        told = ", ".join(f"{force:.1f}" for force in forces)
        return Outcome(
            True,
            f"held with {told} N, carries {wrench[2]:.2f} of {weight:.2f} N, slip {context.slip * 1e3:.2f} mm",
            outputs={"forces": list(forces), "wrench": wrench},
            margins={"slip": context.slip, "carried": float(wrench[2] / weight), "closure": grip.closure},
        )
