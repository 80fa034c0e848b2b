"""Joint control by computed torque, within the effort limits of the joints.

``τ = M(q) (q̈* + 3ω (q̇* − q̇) + 3ω² (q* − q) + ω³ ∫(q* − q) dt) + h(q, q̇) + f sign(q̇*)``: the rigid-body model cancels
inertia, Coriolis, gravity and the dry friction f of the joints, and what remains is an error with the triple pole −ω.
The integral takes up what the model does not know, such as a joint that sticks; it stands still while a torque is at
its limit. A load in the hand enters as a known mass.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_array, as_vector
from ..errors import InputError

if TYPE_CHECKING:
    from .world import World

Motion = Callable[[float, int], Array]
"""``motion(t, order)``: position (0), velocity (1) and acceleration (2) at time t, each (n,)."""

BANDWIDTH = 40.0  # rad/s; a step of 2 ms is a phase of 5°
MOVING = 1e-3  # rad/s or m/s of the reference from which on dry friction acts against it


@dataclass(frozen=True, eq=False)
class Saturation:
    """How often and how badly the wanted torques exceeded the limits: per coordinate, (n,)."""

    steps: IntArray  # number of steps in which it was clipped
    worst: Array  # largest wanted torque over its limit; below one: never clipped
    total_steps: int

    @property
    def any(self) -> bool:
        """Whether any torque was clipped."""
        return bool(self.steps.any())


@dataclass(frozen=True, eq=False)
class Load:
    """A point mass that the hand carries: kg, and its place in the frame of *link*."""

    link: str
    mass: float
    com: Array  # (3,)


class JointController:
    """Drives some coordinates of a robot along a motion, from the time of its first step on.

    Before a motion is given, and after it has ended, the last position is held. Effort limits clip the torque; how
    often is in `saturation`, and the largest deviation from the motion in `worst_error`.

    Raises `InputError` for coordinates that do not exist.
    """

    def __init__(
        self,
        world: World,
        coordinates: Iterable[int] | None = None,
        motion: Motion | None = None,
        *,
        duration: float | None = None,
        bandwidth: float = BANDWIDTH,
        effort: ArrayLike | None = None,
    ) -> None:
        n = world.robot.n
        self.coordinates: IntArray = np.array(sorted(range(n) if coordinates is None else coordinates), dtype=np.int64)
        if self.coordinates.size and not (self.coordinates[0] >= 0 and self.coordinates[-1] < n):
            raise InputError(f"coordinates are {self.coordinates.tolist()}; the robot has 0 to {n - 1}")
        if not (0.0 < bandwidth <= 0.5 / world.timestep):
            raise InputError(
                f"bandwidth is {bandwidth} rad/s; expected more than 0 and at most {0.5 / world.timestep:g}"
            )
        self.bandwidth = bandwidth
        limit = world.robot.limits.effort if effort is None else as_vector(effort, "effort", n)
        self.effort: Array = np.asarray(limit)[self.coordinates]
        self.load: Load | None = None
        self._clipped = np.zeros(self.coordinates.size, dtype=np.int64)
        self._worst = np.zeros(self.coordinates.size)
        self._steps = 0
        self.worst_error = np.zeros(self.coordinates.size)
        self.target: Array = world.q[self.coordinates]
        self._motion: Motion | None = None
        self._start = world.time
        self._duration = 0.0
        self._acceleration = np.zeros(world.model.nv)
        self._product = np.zeros(world.model.nv)
        self._integral = np.zeros(self.coordinates.size)
        self._friction: Array = world.plant.expand.T @ world.model.dof_frictionloss[world.plant.joint_v]
        if motion is not None:
            self.follow(world, motion, duration)

    def follow(self, world: World, motion: Motion, duration: float | None = None) -> None:
        """Start *motion* now; its positions are of this controller's coordinates, or of all n of the robot.

        *duration* defaults to ``motion.duration``; after it the end of the motion is held.
        """
        length = getattr(motion, "duration", None) if duration is None else duration
        if length is None or not (np.isfinite(length) and length >= 0.0):
            raise InputError(f"the motion has duration {length}; give duration=, a finite number of seconds")
        start = self._sample(world, motion, 0.0, 0)
        self._motion, self._start, self._duration = motion, world.time, float(length)
        self.target = start
        self.worst_error = np.zeros(self.coordinates.size)

    def hold(self, world: World, q: ArrayLike | None = None) -> None:
        """Hold the coordinates at *q* (k,), by default at their present target."""
        self._motion = None
        if q is not None:
            self.target = as_vector(q, "q", self.coordinates.size)

    @property
    def duration(self) -> float:
        """Seconds of the present motion."""
        return self._duration if self._motion is not None else 0.0

    def finished(self, world: World) -> bool:
        """Whether the motion has been played to its end."""
        return self._motion is None or world.time - self._start >= self._duration - 0.5 * world.timestep

    @property
    def saturation(self) -> Saturation:
        """Clipping since the controller was made."""
        return Saturation(self._clipped.copy(), self._worst.copy(), self._steps)

    def error(self, world: World) -> Array:
        """Present deviation q* − q of the coordinates."""
        return np.asarray(self.target - world.q[self.coordinates])

    def torque(self, world: World) -> Array:
        """Torques (n,) of this step."""
        mine = self.coordinates
        acceleration = np.zeros(mine.size)
        velocity = np.zeros(mine.size)
        if self._motion is not None:
            t = world.time - self._start
            if t < self._duration:
                self.target = self._sample(world, self._motion, t, 0)
                velocity = self._sample(world, self._motion, t, 1)
                acceleration = self._sample(world, self._motion, t, 2)
            else:
                self.target = self._sample(world, self._motion, self._duration, 0)
        q, qd = world.q[mine], world.qd[mine]
        error = self.target - q
        self.worst_error = np.maximum(self.worst_error, np.abs(error))
        w = self.bandwidth
        integral = self._integral + error * world.timestep
        wanted = acceleration + 3.0 * w * (velocity - qd) + 3.0 * w**2 * error + w**3 * integral
        tau = self._model_torque(world, wanted) + self._friction[mine] * np.sign(velocity) * (np.abs(velocity) > MOVING)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(self.effort > 0.0, np.abs(tau) / self.effort, np.where(tau == 0.0, 0.0, np.inf))
        self._integral = np.where(ratio > 1.0, self._integral, integral)
        self._steps += 1
        self._clipped += ratio > 1.0
        self._worst = np.maximum(self._worst, ratio)
        out = np.zeros(world.robot.n)
        out[mine] = np.clip(tau, -self.effort, self.effort)
        return out

    def _model_torque(self, world: World, acceleration: Array) -> Array:
        """Inverse dynamics of the robot for accelerations of these coordinates (the others': zero), with the load."""
        plant, data = world.plant, world.data
        full = np.zeros(world.robot.n)
        full[self.coordinates] = acceleration
        self._acceleration[plant.joint_v] = plant.expand @ full
        mujoco.mj_mulM(world.model, data, self._product, self._acceleration)
        joint = (self._product + data.qfrc_bias - data.qfrc_passive)[plant.joint_v]
        tau = plant.expand.T @ joint
        if self.load is not None:
            tau = tau + self._load_torque(world, self.load)
        return np.asarray(tau[self.coordinates])

    def _load_torque(self, world: World, load: Load) -> Array:
        """``Jᵀ m (J q̈ − g)`` of the load's centre of mass; its rotational inertia is left to the feedback."""
        plant = world.plant
        body = plant.links[load.link]
        jacobian = np.empty((3, world.model.nv))
        point = world.data.xpos[body] + world.data.xmat[body].reshape(3, 3) @ load.com
        mujoco.mj_jac(world.model, world.data, jacobian, None, point, body)
        force = load.mass * (jacobian @ self._acceleration - world.model.opt.gravity)
        return np.asarray(plant.expand.T @ (jacobian.T @ force)[plant.joint_v])

    def _sample(self, world: World, motion: Motion, t: float, order: int) -> Array:
        value = as_array(motion(t, order), f"motion({t:.6g}, {order})")
        if value.shape == (self.coordinates.size,):
            return value
        if value.shape == (world.robot.n,):
            return value[self.coordinates]
        raise InputError(
            f"motion({t:.6g}, {order}) has shape {value.shape}; expected ({self.coordinates.size},), "
            f"or ({world.robot.n},) for all coordinates of the robot"
        )
