"""Hands with several fingers: postures, closing until each finger feels the object, pressing with given torques.

Every joint has a spring and a damper about a reference, and the torques that the mechanics of the grasp asks for on
top: ``τ = K (q* − q) + D (q̇* − q̇) + h + s τ_grasp`` with the bias forces h of the rigid-body model and a share s that
rises to one. The torques ``τ_grasp = J_Hᵗ f`` press with the contact forces f (G 2.5); the springs, about where the
fingers stood when they felt the object, keep it from turning between forces that know only one posture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_vector
from ..errors import InputError
from ..result import Result, Status

if TYPE_CHECKING:
    from ..kinematics import Hand
    from .world import Controller, World

TOUCH = 0.15  # N on a finger that counts as felt
FEELING_STEPS = 10  # steps in a row in which every finger must feel it, or be at its end
SMOOTHING = 0.1  # share of the present force in what is felt: fingers chatter when they meet something hard
RAMP = 0.3  # s from touch to full force, and from full force to none before the fingers open
GIVE = 0.1  # rad (or 0.1 m of a slide) by which a joint yields to its full effort
SOFTEST = 0.08  # of the stiffness that one step of the engine could bear
DAMPING = 0.4  # largest share of a velocity error that one step takes out
HURRY = 3.0  # rad/s of the fastest joint in free motion


class FingerState(Enum):
    """What the fingers are doing."""

    MOVING = "They move to a posture."
    ARRIVED = "They stand in the posture they were sent to."
    CLOSING = "They close; not every finger has felt the object or come to its end."
    CLOSED = "Every finger feels the object or has come to its end."
    LOADING = "The torques rise."
    HOLDING = "They press with the torques given."


class CloseStatus(Status):
    """How closing ended."""

    SUCCESS = "At least two fingers feel the object."
    EMPTY = "The fingers closed and felt nothing."
    ONE_SIDED = "Only one finger felt the object."
    TIMEOUT = "The fingers were still moving when the time was up."


@dataclass(frozen=True)
class CloseResult(Result):
    """How many fingers feel the object, their normal forces in N in the order of `Hand.fingers`, and the simulated time
    of closing in s."""

    status: CloseStatus
    felt: int
    forces: tuple[float, ...]
    time: float

    def explain(self) -> str:
        """The outcome with its numbers."""
        return f"{self.status.value} {self.felt} of {len(self.forces)} fingers touch, after {self.time:.2f} s."


class Fingers:
    """Controls the joints of *hand*, which is part of the robot in *world*.

    Raises `InputError` for a hand that is not part of the robot.
    """

    def __init__(self, world: World, hand: Hand) -> None:
        robot = world.robot
        missing = [name for name in hand.robot.joint_names if name not in robot.joint_names]
        if missing:
            raise InputError(f"joint {missing[0]!r} of the hand is not a joint of robot {robot.name!r}")
        self.hand = hand
        self.coordinates: IntArray = hand.indices_in(robot)
        self.effort: Array = np.asarray(robot.limits.effort)[self.coordinates]
        self.links = [[world.plant.links[link] for link in finger.links] for finger in hand.fingers]
        self.joints = [np.array(finger.joints, dtype=np.int64) for finger in hand.fingers]
        self.state = FingerState.ARRIVED
        self._column = world.plant.expand[:, self.coordinates]
        self._friction = self._column.T @ world.model.dof_frictionloss[world.plant.joint_v]
        self._reference = self.positions(world)
        self._speed = np.zeros(self.coordinates.size)
        self._waypoints = self._reference[None]
        self._times = np.zeros(1)
        self._others = np.setdiff1d(np.arange(self.coordinates.size), np.concatenate(self.joints))
        self._clock = np.zeros(len(self.joints) + 1)  # of each finger, and of the joints of none
        self._quiet = 0
        self._feeling = np.zeros(len(self.joints))  # N, smoothed
        self._pressing = np.zeros(self.coordinates.size)
        self._goal = np.zeros(self.coordinates.size)
        self._step = np.zeros(self.coordinates.size)

    # --- commands ------------------------------------------------------------------------------------------------
    def move(self, world: World, q: ArrayLike, *, speed: float = HURRY) -> None:
        """Go straight to the joints *q* (n,) with at most *speed* (rad/s) in the fastest; a grip is first let go of."""
        target = as_vector(q, "q", self.coordinates.size)
        self._plan(world, [target], [float(np.abs(target - self._reference).max()) / self._checked(speed)])
        self.press(np.zeros(self.coordinates.size))
        self.state = FingerState.MOVING

    def close(self, world: World, path: Sequence[ArrayLike], durations: Sequence[float]) -> None:
        """Close along the joints in *path*, each reached after its duration (s); who feels something waits."""
        points = [as_vector(q, "path", self.coordinates.size) for q in path]
        if len(points) != len(durations) or not points:
            raise InputError(f"path has {len(points)} points, durations {len(durations)}; expected the same, 1 or more")
        self._plan(world, points, list(durations))
        self._quiet = 0
        self._feeling[:] = 0.0
        self.state = FingerState.CLOSING

    def press(self, torques: ArrayLike, *, ramp: float = RAMP) -> None:
        """Let the joints exert *torques* (n,) besides holding their posture, rising or falling within *ramp* s."""
        self._goal = as_vector(torques, "torques", self.coordinates.size)
        self._step = np.abs(self._goal - self._pressing) / max(ramp, 1e-3)
        if self.state is not FingerState.MOVING:
            self.state = FingerState.LOADING

    def rest(self, world: World) -> None:
        """Take the present posture as the reference of the springs."""
        self._plan(world, [self.positions(world)], [0.0])
        self._reference = self._waypoints[-1].copy()

    def _plan(self, world: World, points: list[Array], durations: list[float]) -> None:
        self._waypoints = np.array([self._reference, *points])
        self._times = np.concatenate([[0.0], np.cumsum(np.maximum(durations, world.timestep))])
        self._clock[:] = 0.0
        self._speed = np.zeros(self.coordinates.size)

    def _checked(self, speed: float) -> float:
        if not (np.isfinite(speed) and speed > 0.0):
            raise InputError(f"speed is {speed} rad/s; expected a positive number")
        return speed

    # --- measurements --------------------------------------------------------------------------------------------
    def positions(self, world: World) -> Array:
        """Joints of the hand (n,)."""
        return np.asarray(world.q[self.coordinates])

    def forces(self, world: World) -> tuple[float, ...]:
        """Normal forces in N that the fingers exert on movable bodies."""
        bodies = list(world.plant.bodies.values())
        return tuple(world.table.normal_force(links, bodies) for links in self.links)

    @property
    def felt(self) -> BoolArray:
        """Which fingers felt the object when they last closed."""
        out: BoolArray = self._feeling >= TOUCH
        return out

    # --- control -------------------------------------------------------------------------------------------------
    def torque(self, world: World) -> Array:
        """Torques (n,) of this step."""
        dt = world.timestep
        self._advance(world)
        change = self._goal - self._pressing
        self._pressing = self._pressing + np.clip(change, -self._step * dt, self._step * dt)
        if self.state is FingerState.LOADING and np.abs(self._goal - self._pressing).max(initial=0.0) < 1e-9:
            self.state = FingerState.HOLDING
        q, qd = world.q[self.coordinates], world.qd[self.coordinates]
        mass, bias = self._dynamics(world)
        effort = np.where(np.isfinite(self.effort) & (self.effort > 0.0), self.effort, np.inf)
        stiffness = np.minimum(effort / GIVE, SOFTEST * mass / dt**2)
        damping = np.minimum(2.0 * np.sqrt(stiffness * mass), DAMPING * mass / dt)
        dry = self._friction * np.clip(self._speed / 0.05, -1.0, 1.0)
        spring = stiffness * (self._reference - q) + damping * (self._speed - qd)
        out = np.zeros(world.robot.n)
        out[self.coordinates] = np.clip(spring + bias + dry + self._pressing, -effort, effort)
        return out

    def _advance(self, world: World) -> None:
        """Move the reference along its way."""
        if self.state not in (FingerState.MOVING, FingerState.CLOSING):
            self._speed = np.zeros(self.coordinates.size)
            return
        if self.state is FingerState.MOVING and np.abs(self._pressing).max(initial=0.0) > 1e-9:
            return  # let go first
        dt, end = world.timestep, self._times[-1]
        if self.state is FingerState.CLOSING:
            self._feeling += SMOOTHING * (np.array(self.forces(world)) - self._feeling)
            felt = self.felt
            self._clock[:-1] += np.where(felt, 0.0, dt)
            self._clock[-1] += dt
            self._quiet = self._quiet + 1 if (felt | (self._clock[:-1] >= end)).all() else 0
        else:
            self._clock += dt
        place = self._reference.copy()
        for clock, joints in zip(self._clock, [*self.joints, self._others], strict=True):
            place[joints] = [np.interp(clock, self._times, column) for column in self._waypoints.T[joints]]
        done = bool((self._clock >= end).all())
        if self.state is FingerState.CLOSING:
            self.state = FingerState.CLOSED if self._quiet >= FEELING_STEPS else self.state
        elif done and np.abs(place - world.q[self.coordinates]).max() < 0.02:
            self.state = FingerState.ARRIVED
        self._speed = (place - self._reference) / dt
        self._reference = place

    def _dynamics(self, world: World) -> tuple[Array, Array]:
        """Diagonal of the mass matrix and bias forces (without damping's share) of the hand's coordinates."""
        plant, model, data = world.plant, world.model, world.data
        full = np.empty((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        rows = plant.joint_v
        moved = full[np.ix_(rows, rows)] @ self._column
        mass = np.einsum("ij,ij->j", self._column, moved)
        bias = self._column.T @ (data.qfrc_bias - data.qfrc_passive)[rows]
        return mass, np.asarray(bias)


def close_fingers(
    world: World, fingers: Fingers, path: Sequence[ArrayLike], durations: Sequence[float], *controllers: Controller,
    patience: float = 1.0,
) -> CloseResult:  # fmt: skip
    """Close the fingers along *path* and wait until each feels the object or is at its end; *controllers* drive the
    rest of the robot meanwhile."""
    start = world.time
    fingers.close(world, path, durations)
    limit = float(np.sum(durations)) + patience
    over = world.run(limit, *controllers, fingers, until=lambda _: fingers.state is FingerState.CLOSED)
    felt = int(fingers.felt.sum())
    status = (CloseStatus.EMPTY, CloseStatus.ONE_SIDED, CloseStatus.SUCCESS)[min(felt, 2)]
    return CloseResult(status if over else CloseStatus.TIMEOUT, felt, fingers.forces(world), world.time - start)
