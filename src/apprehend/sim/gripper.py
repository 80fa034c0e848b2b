"""Two-jaw grippers: opening to a width, closing until both pads feel the object, then holding with a set force.

The pads move along one path in the hand's coordinates, q(w) with the width w between them. With its tangent
``t = dq/dw`` and the mass matrix M of the hand, ``m = tᵀ M t`` is the mass that a force along the width feels, and the
torques ``τ = M t F / m`` do the work F dw: they press with F on each pad (G 3, transmission). Coordinates off the
path are kept on it by stiff feedback, so that hands with two independent fingers close in step.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from ..result import Result, Status
from ..robots.description import Description, JointType
from .control import BANDWIDTH, Saturation

if TYPE_CHECKING:
    from ..kinematics import Hand
    from .world import Controller, World

TOUCH = 0.5  # N on a pad that counts as felt
FEELING_STEPS = 3  # steps in a row in which both pads must feel
PUSH = 4.0  # N at most while closing: a free object is pushed between the pads, not knocked over
PUSH_TIME = 0.1  # s in which a stopped jaw comes to push with that
RAMP = 0.15  # s from touch to full force, and from full force to none before the jaws open
START = 0.3  # m/s², with which a motion of the jaws begins: pads that leave at once would drag the object along
STALL = 0.25  # s of standstill with less than both pads felt
SAMPLES = 129  # of the path of the jaw


class JawState(Enum):
    """What the gripper is doing."""

    MOVING = "It moves to a width."
    ARRIVED = "It stands at the width it was sent to."
    CLOSING = "It closes and has not felt the object at both pads."
    LOADING = "Both pads feel the object; the force rises."
    HOLDING = "It holds with the commanded force."
    EMPTY = "It closed to the end without an object between the pads."
    BLOCKED = "It stopped before both pads felt the object."


class GripStatus(Status):
    """How a grip ended."""

    SUCCESS = "Both pads press with the commanded force."
    EMPTY = "The jaws closed without anything between them."
    BLOCKED = "The jaws were stopped before both pads felt the object."
    TIMEOUT = "The jaws were still moving when the time was up."


@dataclass(frozen=True)
class GripResult(Result):
    """Width between the pads in m, normal forces at the pads in N, and the simulated time that closing took in s."""

    status: GripStatus
    width: float
    forces: tuple[float, float]
    time: float

    def explain(self) -> str:
        """The outcome with its numbers."""
        a, b = self.forces
        return f"{self.status.value} Width {self.width * 1e3:.1f} mm, pad forces {a:.1f} and {b:.1f} N."


class Gripper:
    """Controls the jaws of *hand*, which is part of the robot in *world*.

    Raises `InputError` for a hand without a parallel jaw, or one that is not part of the robot.
    """

    def __init__(self, world: World, hand: Hand, *, bandwidth: float = BANDWIDTH) -> None:
        robot = world.robot
        jaw = getattr(hand, "jaw", None)
        if jaw is None:
            raise InputError(f"hand {hand.robot.name!r} has no parallel jaw; this controller drives two-jaw grippers")
        missing = [name for name in hand.robot.joint_names if name not in robot.joint_names]
        if missing:
            raise InputError(f"joint {missing[0]!r} of the hand is not a joint of robot {robot.name!r}")
        self.jaw = jaw
        self.bandwidth = bandwidth
        self.coordinates: IntArray = np.array([robot.index(name) for name in hand.robot.joint_names], dtype=np.int64)
        self.effort: Array = np.asarray(robot.limits.effort)[self.coordinates]
        self.fingers: tuple[list[int], list[int]] = tuple(  # type: ignore[assignment]
            [world.plant.links[link] for link in finger_links(robot.description, hand.root, pad)]
            for pad in jaw.pad_links
        )
        self._widths = np.linspace(jaw.min_width, jaw.max_width, SAMPLES)
        self._path = np.array([jaw.q_at(width) for width in self._widths])
        self._tangent = np.gradient(self._path, self._widths, axis=0)
        self._edge = np.diff(self._path, axis=0)
        self._chord = self._edge / np.maximum((self._edge**2).sum(axis=1, keepdims=True), 1e-300)
        self.state = JawState.ARRIVED
        self._column = world.plant.expand[:, self.coordinates]
        self._target = self.width(world)
        self._reference = self._target
        self._speed = 0.1
        self._rate = 0.0  # present speed of the reference
        self._fade = 0.0  # N/s with which a grip is let go of
        self._force = 0.0  # commanded
        self._pressed = 0.0  # present, on its way to the command
        self._push = 0.0
        self._still = 0.0
        self._felt = 0
        self._clipped = np.zeros(self.coordinates.size, dtype=np.int64)
        self._worst = np.zeros(self.coordinates.size)
        self._steps = 0

    # --- commands ------------------------------------------------------------------------------------------------
    def move(self, world: World, width: float, *, speed: float = 0.1) -> None:
        """Open or close to *width* (m) with *speed* (m/s between the pads), by position.

        A grip is first let go of: its force fades before the pads leave the object.
        """
        low, high = self.jaw.min_width, self.jaw.max_width
        if not (low - 1e-6 <= width <= high + 1e-6):
            raise InputError(f"width is {width} m; these jaws reach {low:.4g} to {high:.4g} m")
        self._check_speed(speed)
        self.state = JawState.MOVING
        self._target, self._speed = float(np.clip(width, low, high)), speed
        self._reference = self.width(world)
        self._fade = self._pressed / RAMP
        self._rate = self._push = 0.0

    def close(self, world: World, force: float, *, speed: float = 0.05) -> None:
        """Close with *speed* until both pads feel the object, then press each pad with *force* (N)."""
        self._check_speed(speed)
        self._check_force(force)
        self.state = JawState.CLOSING
        self._speed, self._force = speed, force
        self._push = self._pressed = self._still = 0.0
        self._felt = 0

    def press(self, force: float) -> None:
        """Change the force of the grip (N)."""
        if self.state not in (JawState.LOADING, JawState.HOLDING):
            raise InputError(f"the gripper holds nothing ({self.state.value}); call close(world, force) first")
        self._check_force(force)
        self._force, self.state = force, JawState.LOADING

    def _check_speed(self, speed: float) -> None:
        if not (np.isfinite(speed) and speed > 0.0):
            raise InputError(f"speed is {speed} m/s; expected a positive number")

    def _check_force(self, force: float) -> None:
        if not (0.0 < force <= self.jaw.max_force * (1.0 + 1e-9)):
            raise InputError(f"force is {force} N; the pads of this hand press with up to {self.jaw.max_force:.4g} N")

    # --- measurements --------------------------------------------------------------------------------------------
    def width(self, world: World) -> float:
        """Width between the pads in m: that of the nearest point of the jaw's path."""
        return self._project(world.q[self.coordinates])[0]

    def pad_forces(self, world: World) -> tuple[float, float]:
        """Normal forces in N that the two fingers exert on movable bodies."""
        one, two = (self._finger_force(world, finger) for finger in self.fingers)
        return one, two

    @property
    def saturation(self) -> Saturation:
        """Clipping at the joints' effort limits since the controller was made."""
        return Saturation(self._clipped.copy(), self._worst.copy(), self._steps)

    def _finger_force(self, world: World, finger: list[int]) -> float:
        return world.table.normal_force(finger, world.plant.bodies.values())

    def _project(self, q: Array) -> tuple[float, Array, Array]:
        """Width, point and tangent of the path nearest to *q*."""
        share = ((q - self._path[:-1]) * self._chord).sum(axis=1).clip(0.0, 1.0)
        nearest = self._path[:-1] + share[:, None] * self._edge
        i = int(((nearest - q) ** 2).sum(axis=1).argmin())
        s = float(share[i])
        width = (1.0 - s) * self._widths[i] + s * self._widths[i + 1]
        return float(width), nearest[i], (1.0 - s) * self._tangent[i] + s * self._tangent[i + 1]

    # --- control -------------------------------------------------------------------------------------------------
    def torque(self, world: World) -> Array:
        """Torques (n,) of this step."""
        q, qd = world.q[self.coordinates], world.qd[self.coordinates]
        width, on_path, tangent = self._project(q)
        M, bias = self._dynamics(world)
        mass = float(tangent @ M @ tangent)
        rate = float(tangent @ M @ qd) / mass
        force = self._width_force(world, width, rate, mass)
        off = on_path - q
        off_rate = -(qd - tangent * rate)
        off -= tangent * float(tangent @ M @ off) / mass
        tau = M @ (tangent * (force / mass) + self.bandwidth**2 * off + 2.0 * self.bandwidth * off_rate) + bias
        self._steps += 1
        ratio = np.abs(tau) / self.effort
        self._clipped += ratio > 1.0
        self._worst = np.maximum(self._worst, ratio)
        out = np.zeros(world.robot.n)
        out[self.coordinates] = np.clip(tau, -self.effort, self.effort)
        return out

    def _dynamics(self, world: World) -> tuple[Array, Array]:
        """Mass matrix and bias forces (without damping's share in them) of the hand's coordinates."""
        plant, model, data = world.plant, world.model, world.data
        M = np.empty((self.coordinates.size, self.coordinates.size))
        full, product = np.zeros(model.nv), np.empty(model.nv)
        for i in range(self.coordinates.size):
            full[plant.joint_v] = self._column[:, i]
            mujoco.mj_mulM(model, data, product, full)
            M[:, i] = self._column.T @ product[plant.joint_v]
        bias = self._column.T @ (data.qfrc_bias - data.qfrc_passive)[plant.joint_v]
        return M, np.asarray(bias)

    def _width_force(self, world: World, width: float, rate: float, mass: float) -> float:
        """Force along the width (positive opens) of the present state, which it advances."""
        dt = world.timestep
        damping = 0.3 * mass / dt  # takes 30 % of the velocity error per step
        if self.state in (JawState.MOVING, JawState.ARRIVED):
            if self._pressed > 0.0:
                self._pressed = max(0.0, self._pressed - self._fade * dt)
                self._reference = width
                return -self._pressed - damping * rate
            self._rate = min(self._speed, self._rate + START * dt)
            step = float(np.clip(self._target - self._reference, -self._rate * dt, self._rate * dt))
            self._reference += step
            if abs(self._target - width) < 2e-4 and step == 0.0:
                self.state = JawState.ARRIVED
            wanted = self.bandwidth**2 * (self._reference - width) + 2.0 * self.bandwidth * (step / dt - rate)
            limit = self.jaw.max_force
            return float(np.clip(mass * wanted, -limit, limit))
        if self.state in (JawState.CLOSING, JawState.EMPTY, JawState.BLOCKED):
            self._feel(world, width, rate)
            if rate < -self._speed:  # a free jaw needs no push
                self._push = 0.0
            elif rate > -0.2 * self._speed:  # stopped by friction or by the object
                self._push = min(self._push + PUSH * dt / PUSH_TIME, PUSH)
            force = float(np.clip(damping * (-self._speed - rate) - self._push, -PUSH, PUSH))
            self._pressed = max(0.0, -force)
            return force
        change = self._force - self._pressed
        self._pressed += float(np.clip(change, -self._force * dt / RAMP, self._force * dt / RAMP))
        if self._pressed == self._force:
            self.state = JawState.HOLDING
        return -self._pressed - damping * rate

    def _feel(self, world: World, width: float, rate: float) -> None:
        if self.state is not JawState.CLOSING:
            return
        one, two = self.pad_forces(world)
        self._felt = self._felt + 1 if min(one, two) >= TOUCH else 0
        self._still = self._still + world.timestep if abs(rate) < 0.05 * self._speed else 0.0
        if self._felt >= FEELING_STEPS:
            self.state = JawState.LOADING
        elif self._still >= STALL:
            end = width - self.jaw.min_width < 1e-3
            self.state = JawState.EMPTY if end and max(one, two) < TOUCH else JawState.BLOCKED


def grip(world: World, gripper: Gripper, force: float, *controllers: Controller, time_limit: float = 6.0,
         speed: float = 0.05) -> GripResult:  # fmt: skip
    """Close the gripper and wait until it holds with *force*; *controllers* drive the rest of the robot meanwhile."""
    start = world.time
    gripper.close(world, force, speed=speed)
    final = (JawState.HOLDING, JawState.EMPTY, JawState.BLOCKED)
    world.run(time_limit, *controllers, gripper, until=lambda _: gripper.state in final)
    status = {
        JawState.HOLDING: GripStatus.SUCCESS, JawState.EMPTY: GripStatus.EMPTY, JawState.BLOCKED: GripStatus.BLOCKED,
    }.get(gripper.state, GripStatus.TIMEOUT)  # fmt: skip
    return GripResult(status, gripper.width(world), gripper.pad_forces(world), world.time - start)


def finger_links(description: Description, root: str, pad: str) -> list[str]:
    """Links of the finger that carries *pad*: all beyond the first moving joint between the hand's base *root* and it.

    Of a jaw that stands still: what is fixed to the base.
    """
    parent = description.parent_joint
    start, link = root, pad
    while link != root:
        if link not in parent:
            raise InputError(f"link {pad!r} is not part of the hand below {root!r}")
        if parent[link].type is not JointType.FIXED:
            start = link
        link = parent[link].parent
    members = {start}
    for joint in description.joints:
        if joint.parent in members and (start != root or joint.type is JointType.FIXED):
            members.add(joint.child)
    return [name for name in description.links if name in members]
