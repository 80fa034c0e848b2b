"""The world in the physics engine: state, steps, contacts and recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_pose, as_vector
from ..errors import InputError, unknown_name
from ..result import Result, Status
from . import shapes
from .contacts import ContactTable, Touch
from .model import Plant, build
from .physics import Physics
from .record import Recorder, Recording
from .stick import carry_along

if TYPE_CHECKING:
    from ..collision import Scene

REST_SPEED = 2e-3  # m/s and, times the body's radius, rad/s below which a body counts as at rest
REST_TIME = 0.2  # s it must stay so


class Controller(Protocol):
    """What drives joints: called once a step, before the engine solves for the motion."""

    def torque(self, world: World) -> Array:
        """Torques or forces (n,) for the robot's coordinates; zero where this controller has no say."""


class SettleStatus(Status):
    """How settling ended."""

    SUCCESS = "Every body came to rest."
    MOVING = "A body was still moving when the time was up."
    DIVERGED = "The simulation produced values that are not finite."


@dataclass(frozen=True)
class SettleResult(Result):
    """How long settling took in simulated seconds, and how fast the fastest body still was, in m/s."""

    status: SettleStatus
    time: float
    speed: float
    body: str | None = None

    def explain(self) -> str:
        """The outcome with its numbers."""
        who = f" {self.body!r} moved with {self.speed * 1e3:.2g} mm/s" if self.body else ""
        return f"{self.status.value} After {self.time:.2f} s{who}."


class World:
    """A scene in motion.

    Positions, velocities and torques of the robot are in the order of `Robot.joint_names`; mimicking joints follow
    by themselves. Poses are T_world_x. Everything read between two steps belongs to the present instant, except
    contact forces and torques, which belong to the step that led to it.

    Raises `DescriptionError` where the engine refuses the robot.
    """

    def __init__(self, scene: Scene, *, physics: Physics | None = None, rng: np.random.Generator | None = None) -> None:
        self.scene = scene
        self.plant: Plant = build(scene, physics)
        self.rng = rng if rng is not None else np.random.default_rng(0)
        self.model = self.plant.model
        self.data: Any = mujoco.MjData(self.model)
        self.tau = np.zeros(scene.robot.n)
        self.table = ContactTable.empty()
        self._recorder: Recorder | None = None
        self.set_q(scene.robot.home)

    # --- state ---------------------------------------------------------------------------------------------------
    @property
    def robot(self) -> Any:
        """The robot of the scene, as placed."""
        return self.scene.robot

    @property
    def time(self) -> float:
        """Simulated seconds."""
        return float(self.data.time)

    @property
    def timestep(self) -> float:
        """Seconds of one step."""
        return float(self.model.opt.timestep)

    @property
    def q(self) -> Array:
        """Joint positions (n,)."""
        return np.asarray(self.data.qpos[self.plant.q_address])

    @property
    def qd(self) -> Array:
        """Joint velocities (n,)."""
        return np.asarray(self.data.qvel[self.plant.v_address])

    def set_q(self, q: ArrayLike, qd: ArrayLike = 0.0) -> None:
        """Put the robot at *q* (n,) with velocity *qd*."""
        plant = self.plant
        self.data.qpos[plant.joint_q] = plant.expand @ as_vector(q, "q", self.robot.n) + plant.offset
        self.data.qvel[plant.joint_v] = plant.expand @ as_vector(qd, "qd", self.robot.n)
        self._refresh()

    def frame(self, link: str) -> Array:
        """Pose (4, 4) of a link."""
        if link not in self.plant.links:
            unknown_name("link", link, self.plant.links, f"robot {self.robot.name!r}")
        return self._pose(self.plant.links[link])

    def body_pose(self, name: str) -> Array:
        """Pose (4, 4) of a body's frame, the one that its mesh is given in."""
        if name in self.scene.bodies and name not in self.plant.bodies:
            return self.scene.bodies[name].pose.copy()
        return self._pose(self._body(name))

    def body_velocity(self, name: str) -> Array:
        """Velocity (v, ω) (6,) of a movable body: of its centre of mass, and angular, in world axes."""
        out = np.empty(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, self._body(name), out, 0)
        return np.concatenate([out[3:], out[:3]])

    def set_body_pose(self, name: str, pose: ArrayLike) -> None:
        """Put a movable body at *pose* (4, 4), at rest."""
        T = as_pose(pose, "pose")
        if T.shape != (4, 4):
            raise InputError(f"pose has shape {T.shape}; expected (4, 4)")
        joint = self.model.body_jntadr[self._body(name)]
        at, speed = self.model.jnt_qposadr[joint], self.model.jnt_dofadr[joint]
        self.data.qpos[at : at + 3] = T[:3, 3]
        self.data.qpos[at + 3 : at + 7] = shapes.quaternion(T[:3, :3])
        self.data.qvel[speed : speed + 6] = 0.0
        self._refresh()

    def snapshot(self) -> Array:
        """The whole state as one vector, for `restore`."""
        spec = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(self.model, spec))
        mujoco.mj_getState(self.model, self.data, state, spec)
        return state

    def restore(self, state: Array) -> None:
        """Return to a `snapshot`: what follows is the same to the last bit."""
        mujoco.mj_setState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_step1(self.model, self.data)
        self.table = ContactTable.empty()

    def _refresh(self) -> None:
        self.data.qacc_warmstart[:] = 0.0
        mujoco.mj_step1(self.model, self.data)
        self.table = ContactTable.empty()

    def _pose(self, body: int) -> Array:
        T = np.eye(4)
        T[:3, :3] = self.data.xmat[body].reshape(3, 3)
        T[:3, 3] = self.data.xpos[body]
        return T

    def _body(self, name: str) -> int:
        if name not in self.plant.bodies:
            unknown_name("movable body", name, self.plant.bodies, "the scene")
        return self.plant.bodies[name]

    # --- motion --------------------------------------------------------------------------------------------------
    def step(self, *controllers: Controller) -> None:
        """One step of the engine; the torques of the controllers add up."""
        tau = np.zeros(self.robot.n)
        for controller in controllers:
            tau += controller.torque(self)
        self.tau = tau
        self.data.qfrc_applied[self.plant.v_address] = tau
        carry_along(self.plant, self.data)
        mujoco.mj_step2(self.model, self.data)
        self.table = ContactTable.read(self.model, self.data)
        mujoco.mj_step1(self.model, self.data)
        if self._recorder is not None:
            self._recorder.take(self)

    def run(self, duration: float, *controllers: Controller, until: Callable[[World], bool] | None = None) -> bool:
        """Step for *duration* simulated seconds, or until *until* is true after a step; returns whether it was."""
        if not (np.isfinite(duration) and duration >= 0.0):
            raise InputError(f"duration is {duration} s; expected 0 or more")
        for _ in range(round(duration / self.timestep)):
            self.step(*controllers)
            if until is not None and until(self):
                return True
        return False

    def settle(
        self, *controllers: Controller, time_limit: float = 3.0, bodies: Sequence[str] | None = None
    ) -> SettleResult:
        """Step until every one of *bodies* (None: all) has been at rest for `REST_TIME`.

        Without controllers the robot is held where it is.
        """
        from .control import JointController

        names = list(self.plant.bodies if bodies is None else bodies)
        radius = {name: self.scene.bodies[name].body.radius for name in names if self._body(name)}
        drives: tuple[Controller, ...] = controllers or (JointController(self),)
        start, quiet, worst, who = self.time, 0.0, 0.0, None
        while self.time - start < time_limit:
            self.step(*drives)
            if not np.isfinite(self.data.qvel).all():
                return SettleResult(SettleStatus.DIVERGED, self.time - start, float("inf"))
            worst, who = 0.0, None
            for name in names:
                v = self.body_velocity(name)
                speed = float(np.linalg.norm(v[:3]) + radius[name] * np.linalg.norm(v[3:]))
                if speed >= worst:
                    worst, who = speed, name
            quiet = quiet + self.timestep if worst < REST_SPEED else 0.0
            if quiet >= REST_TIME:
                return SettleResult(SettleStatus.SUCCESS, self.time - start, worst, who)
        return SettleResult(SettleStatus.MOVING, self.time - start, worst, who)

    # --- contacts ------------------------------------------------------------------------------------------------
    def contacts(
        self, one: str | Iterable[str] | None = None, other: str | Iterable[str] | None = None
    ) -> tuple[Touch, ...]:
        """Contact points of the last step between *one* and *other*: names of links, bodies, boxes; None: anything."""
        touches = self.table.touches(self.plant)
        mine, theirs = self._names(one), self._names(other)
        return tuple(
            t
            for t in touches
            if (_in(t.first, mine) and _in(t.second, theirs)) or (_in(t.second, mine) and _in(t.first, theirs))
        )

    def contact_force(
        self, body: str, links: str | Iterable[str] | None = None, *, about: ArrayLike | None = None
    ) -> Array:
        """Wrench (f, τ) (6,) on *body* from *links* (None: from all that touches it), in world axes.

        The torque is about *about* in world coordinates, by default about the body's centre of mass.
        """
        index = self._body(body)
        point = self.data.xipos[index] if about is None else as_vector(about, "about", 3)
        return self.table.wrench([index], point, self.engine_bodies(links))

    def engine_bodies(self, names: str | Iterable[str] | None) -> list[int] | None:
        """Indices of the engine for names of links, bodies or boxes."""
        wanted = self._names(names)
        return None if wanted is None else [i for i, owner in enumerate(self.plant.owners) if owner in wanted]

    def _names(self, names: str | Iterable[str] | None) -> set[str] | None:
        if names is None:
            return None
        wanted = {names} if isinstance(names, str) else set(names)
        for name in wanted:
            if name not in self.plant.owners:
                unknown_name("link, body or box", name, self.plant.owners, "the world")
        return wanted

    # --- recording -----------------------------------------------------------------------------------------------
    def record(self, rate: float = 60.0) -> None:
        """Start to record *rate* times a simulated second."""
        self._recorder = Recorder(self, rate)

    def recording(self) -> Recording:
        """What has been recorded so far."""
        if self._recorder is None:
            raise InputError("nothing was recorded; call record(rate) before the steps that are to be recorded")
        return self._recorder.result()


def _in(name: str, names: set[str] | None) -> bool:
    return names is None or name in names
