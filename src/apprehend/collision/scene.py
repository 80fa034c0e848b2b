"""What stands where: a robot in the world, fixed boxes, bodies with poses, and where a body should go.

A `Scene` is a value: every change makes a new one. Its TOML form is read and written by `scene_file`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_pose, as_vector
from ..conventions import GRAVITY
from ..errors import InputError, expect_path, unknown_name
from ..kinematics import Robot
from ..kinematics.mounting import mounting
from ..robots.description import Description, JointType
from .geometry import Geometry
from .obstacles import as_geometry

if TYPE_CHECKING:
    from ..bodies import Body
    from ..kinematics import Hand

AUTO = "auto"
"""Value of *hand* that means: the arm's own hand where its description has one, else the default gripper."""

DEFAULT_HAND = "robotiq_2f_85"


@dataclass(frozen=True, eq=False)
class RobotSource:
    """Which files the robot of a scene is made of, and where its base stands: what a scene file says."""

    arm: str
    hand: str | None = None
    at: str | None = None  # the arm's link that carries the hand; None: where its own sits, else the end of the arm
    mount: Array | None = None  # T_at_handroot; None: as `mounting` finds it
    base: Array = field(default_factory=lambda: np.eye(4))  # T_world_base
    prefix: str | None = None  # before the names of the hand; None: "" where no name occurs twice, else "hand_"
    within: str | None = None  # *arm* is a MuJoCo model of a whole scene; this body of it, or "": the one that moves

    def build(self) -> tuple[Robot, str | None]:
        """The placed robot with its hand, and the name of the hand's root link (None: no hand was attached).

        A hand takes the place of the arm's own.
        """
        if self.within is None:
            arm = Robot.load(self.arm)
        else:
            from ..robots import read_world

            arm = Robot(read_world(self.arm, self.within or None).description)
        if self.hand is None:
            return arm.placed(self.base), None
        hand = Robot.load(self.hand)
        at, flange = self.at, np.eye(4)
        if at is None and arm.description.hand in arm.description.parent_joint:
            arm, at, flange = _bare(arm)
        at = at or arm.description.tool or end_link(arm.description)
        if at not in arm.frame_names:
            unknown_name("link", at, arm.frame_names, f"robot {arm.name!r} (to carry {self.hand!r})")
        prefix = self.prefix
        if prefix is None:
            taken = {*arm.frame_names, *(joint.name for joint in arm.description.joints)}
            names = {*hand.frame_names, *(joint.name for joint in hand.description.joints)}
            prefix = "hand_" if taken & names else ""
        mount = flange @ mounting(hand) if self.mount is None else self.mount
        robot = arm.attach(hand, at, mount, prefix).placed(self.base)
        return robot, prefix + hand.description.root


def _bare(arm: Robot) -> tuple[Robot, str, Array]:
    """*arm* without its own hand, the link that carried it, and the flange on that link, its z axis outwards."""
    from ..robots import subtree, without

    description = arm.description
    joint = description.parent_joint[description.hand]
    own = Robot(subtree(description, description.hand))
    return Robot(without(description, description.hand)), joint.parent, joint.pose @ np.linalg.inv(mounting(own))


@dataclass(frozen=True, eq=False)
class Box:
    """A fixed box, such as a table top: full extents in m and the pose of its centre."""

    name: str
    size: Array  # (3,)
    pose: Array  # (4, 4), T_world_box
    rgba: tuple[float, float, float, float] = (0.62, 0.55, 0.47, 1.0)
    friction: float = 0.8

    def __post_init__(self) -> None:
        size = as_vector(self.size, f"the size of box {self.name!r}", 3)
        if not (np.isfinite(size).all() and (size > 0.0).all()):
            raise InputError(f"box {self.name!r} has size {size.tolist()}; every extent must be positive, in m")
        if not (np.isfinite(self.friction) and self.friction >= 0.0):
            raise InputError(f"box {self.name!r} has friction {self.friction}; expected 0 or more")
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "pose", _one_pose(self.pose, f"the pose of box {self.name!r}"))

    @property
    def top(self) -> float:
        """Height of the highest point in m."""
        return float(self.pose[2, 3] + 0.5 * np.abs(self.pose[2, :3]) @ self.size)


@dataclass(frozen=True, eq=False)
class Obstacle:
    """Something fixed of any geometry, in the world: a floor, a pillar, what a camera saw.

    *origin* remembers what the scene file said, for saving. Make one with `of`.
    """

    name: str
    shapes: tuple[Geometry, ...]  # at their poses in the world
    rgba: tuple[float, float, float, float] = (0.62, 0.58, 0.52, 1.0)
    friction: float = 0.8
    origin: Mapping[str, object] | None = None

    @staticmethod
    def of(name: str, thing: object, pose: ArrayLike | None = None, **options: Any) -> Obstacle:
        """*thing* (geometry, several of it, a body, a distance field) at *pose* (T_world_thing)."""
        if not name:
            raise InputError("an obstacle needs a name")
        T = np.eye(4) if pose is None else _one_pose(pose, f"the pose of obstacle {name!r}")
        return Obstacle(name, tuple(shape.at(T) for shape in as_geometry(thing, name)), **options)


@dataclass(frozen=True, eq=False)
class Placed:
    """A body at a pose; *origin* remembers what the scene file said (``{"mesh": "mug.obj"}``), for saving."""

    body: Body
    pose: Array  # (4, 4), T_world_body
    movable: bool = True
    origin: Mapping[str, object] | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """A robot in its surroundings, and the task in it; poses are T_world_x."""

    robot: Robot
    robot_source: RobotSource
    bodies: Mapping[str, Placed] = field(default_factory=dict)
    boxes: tuple[Box, ...] = ()
    goals: Mapping[str, Array] = field(default_factory=dict)  # body name → T_world_body wanted
    pick: str | None = None  # the body that the task is about
    upright: bool = False  # the picked body must stay upright on its way
    clearance: float = 0.0  # m that must stay between the robot and anything that it does not mean to touch
    gravity: float = GRAVITY  # m/s², along −z of the world
    obstacles: Mapping[str, Obstacle] = field(default_factory=dict)
    allowed: tuple[tuple[str, str], ...] = ()  # pairs of links, bodies, boxes and obstacles that may touch
    hand_root: str | None = None  # root link of an attached hand; None: the hand is part of the arm's description
    source: Path | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.clearance) and self.clearance >= 0.0):
            raise InputError(f"the clearance of a scene is {self.clearance} m; expected 0 or more")
        if not np.isfinite(self.gravity):
            raise InputError(f"gravity is {self.gravity} m/s²; expected a finite number")
        names = [box.name for box in self.boxes] + list(self.bodies) + list(self.obstacles)
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"{twice[0]!r} names two things in one scene; every thing in it needs a name of its own")
        for name in (*self.goals, *([] if self.pick is None else [self.pick])):
            if name not in self.bodies:
                unknown_name("body", name, self.bodies, "the scene")
        known = {*names, *self.robot.frame_names}
        for one, other in self.allowed:
            for name in (one, other):
                if name not in known:
                    unknown_name("link, body, box or obstacle", name, known, "the scene (in its allowed pairs)")
        bodies = {n: replace(p, pose=_one_pose(p.pose, f"the pose of body {n!r}")) for n, p in self.bodies.items()}
        goals = {n: _one_pose(T, f"the goal of body {n!r}") for n, T in self.goals.items()}
        object.__setattr__(self, "bodies", MappingProxyType(bodies))
        object.__setattr__(self, "goals", MappingProxyType(goals))
        object.__setattr__(self, "obstacles", MappingProxyType(dict(self.obstacles)))
        object.__setattr__(self, "allowed", tuple((str(a), str(b)) for a, b in self.allowed))

    def __getstate__(self) -> dict[str, Any]:
        return {n: dict(v) if isinstance(v, MappingProxyType) else v for n, v in vars(self).items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            proxy = name in ("bodies", "goals", "obstacles")
            object.__setattr__(self, name, MappingProxyType(value) if proxy else value)

    # --- changes, each a new scene -------------------------------------------------------------------------------
    def moved(self, name: str, pose: ArrayLike) -> Scene:
        """The scene with body *name* at *pose* (4, 4)."""
        placed = self.placed_body(name)
        return replace(self, bodies={**self.bodies, name: replace(placed, pose=as_pose(pose, f"pose of {name!r}"))})

    def with_body(self, name: str, body: Body, pose: ArrayLike, *, movable: bool = True) -> Scene:
        """The scene with one more body, or with another body of that name."""
        return replace(self, bodies={**self.bodies, name: Placed(body, as_pose(pose, f"pose of {name!r}"), movable)})

    def without(self, name: str) -> Scene:
        """The scene without the body, box or obstacle *name*, its goal, its task and its allowed pairs."""
        allowed = tuple(p for p in self.allowed if name not in p)
        if name in self.obstacles:
            left = {n: o for n, o in self.obstacles.items() if n != name}
            return replace(self, obstacles=left, allowed=allowed)
        if name in self.bodies:
            return replace(
                self,
                allowed=allowed,
                bodies={n: p for n, p in self.bodies.items() if n != name},
                goals={n: T for n, T in self.goals.items() if n != name},
                pick=None if self.pick == name else self.pick,
            )
        self.box(name)
        return replace(self, boxes=tuple(box for box in self.boxes if box.name != name), allowed=allowed)

    def with_box(self, box: Box) -> Scene:
        """The scene with one more fixed box."""
        return replace(self, boxes=(*self.boxes, box))

    def with_obstacle(self, name: str, thing: object, pose: ArrayLike | None = None) -> Scene:
        """The scene with one more fixed obstacle (or another one of that name) of any geometry; see `Obstacle.of`."""
        return replace(self, obstacles={**self.obstacles, name: Obstacle.of(name, thing, pose)})

    def allowing(self, *pairs: tuple[str, str]) -> Scene:
        """The scene in which these pairs of names may touch, too."""
        return replace(self, allowed=(*self.allowed, *pairs))

    def with_task(self, pick: str, place: ArrayLike, *, upright: bool = False) -> Scene:
        """The scene with the task of bringing body *pick* to pose *place* (4, 4)."""
        return replace(self, pick=pick, goals={**self.goals, pick: as_pose(place, "place")}, upright=upright)

    # --- questions -----------------------------------------------------------------------------------------------
    def placed_body(self, name: str) -> Placed:
        """The body of that name with its pose."""
        if name not in self.bodies:
            unknown_name("body", name, self.bodies, "the scene")
        return self.bodies[name]

    def box(self, name: str) -> Box:
        """The fixed box of that name."""
        for box in self.boxes:
            if box.name == name:
                return box
        unknown_name("box", name, (box.name for box in self.boxes), "the scene")

    @property
    def hand(self) -> Hand:
        """The hand at the end of the arm."""
        from ..kinematics import Hand

        return Hand.within(self.robot, self.hand_root)

    # --- files and the standard scene ----------------------------------------------------------------------------
    @staticmethod
    def load(path: str | Path) -> Scene:
        """Read a scene from TOML; unknown tables and keys are errors that name file, table and key."""
        expect_path(path, "path", "the path of a scene file (.toml)")
        from .scene_file import load

        return load(Path(path))

    def save(self, path: str | Path) -> Path:
        """Write the scene as TOML; bodies without a file or a generator are written as meshes beside it."""
        from .scene_file import save

        return save(self, Path(path))

    @staticmethod
    def from_mujoco(source: object, *, robot: str | None = None) -> Scene:
        """The scene of a MuJoCo model: an MJCF file's path, or an ``mjModel``; see `mujoco_scene.from_mujoco`."""
        from .mujoco_scene import from_mujoco

        return from_mujoco(source, robot=robot)

    @staticmethod
    def tabletop(
        robot: str = "ur5e",
        hand: str | None = AUTO,
        *,
        body: Body | str | None = None,
        pose: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        upright: bool = False,
    ) -> Scene:
        """A robot at the edge of a table with one *body* within comfortable reach; see `tabletop.tabletop`."""
        from .tabletop import tabletop

        return tabletop(robot, hand, body=body, pose=pose, goal=goal, upright=upright)


def _one_pose(value: ArrayLike, name: str) -> Array:
    pose = as_pose(value, name)
    if pose.shape != (4, 4):
        raise InputError(f"{name} has shape {pose.shape}; expected one (4, 4) pose")
    return pose


def end_link(description: Description) -> str:
    """The link at the end of the longest chain of moving joints, as far out as fixed joints lead."""
    moving: dict[str, tuple[int, int]] = {description.root: (0, 0)}
    for joint in description.joints:
        m, total = moving[joint.parent]
        moving[joint.child] = (m + (joint.type is not JointType.FIXED), total + 1)
    return max(moving, key=lambda link: moving[link])


def has_hand(description: Description) -> bool:
    """Whether the longest chain of the tree carries, beyond its first moving joint, a link with two moving branches."""
    parent = description.parent_joint
    branches: dict[str, set[str]] = {}  # link → children whose subtree moves against it
    for joint in description.joints:
        if joint.type is JointType.FIXED:
            continue
        child, link = joint.child, joint.parent
        branches.setdefault(link, set()).add(child)
        while link in parent and parent[link].type is JointType.FIXED:  # a finger may hang on a fixed part of the palm
            child, link = link, parent[link].parent
            branches.setdefault(link, set()).add(child)
    link = end_link(description)
    while link in parent:
        link = parent[link].parent
        if len(branches.get(link, ())) >= 2 and _moves(description, link):
            return True
    return False


def _moves(description: Description, link: str) -> bool:
    parent = description.parent_joint
    while link in parent:
        if parent[link].type is not JointType.FIXED:
            return True
        link = parent[link].parent
    return False
