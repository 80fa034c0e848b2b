"""A scene from a MuJoCo model: its robot, the bodies that move freely, and what stands around."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ApprehendError, MeshError
from ..kinematics import Robot
from ..robots import FixedThing, FreeBody, read_world, shape_surface
from ..robots.description import ShapeKind
from .obstacles import HalfSpace, Union
from .scene import Box, Obstacle, Placed, RobotSource, Scene
from .shapes import Convex, shape_convexes

if TYPE_CHECKING:
    from ..bodies import Body


def from_mujoco(source: object, *, robot: str | None = None) -> Scene:
    """The scene of a model: *source* is the path of an MJCF file or a compiled ``mujoco.MjModel``.

    - Bodies with a free joint become movable bodies with the model's masses, where the keyframe ``home`` (or the only
      one, or the reference) has them; geoms of one body are united.
    - Geoms that stand still become boxes (boxes), half-spaces (planes), surfaces (height fields), ellipsoids, and
      convex obstacles (everything else; meshes as a few hulls that contain them).
    - What moves by other joints is the robot; *robot* names one of its bodies where there are several. Its home is
      the keyframe. See `read_world`.

    Pairs that the model excludes from contact are allowed. `scene.robot.description.repairs` lists what could not be
    taken over.
    """
    world = read_world(source, robot)
    made = Robot(world.description)
    names = {*made.frame_names}
    things = {name: [name] for name in made.frame_names if name != world.description.root}  # of the model's bodies
    bodies: dict[str, Placed] = {}
    for body in world.bodies:
        if body.shapes:
            name = _unused(body.name, names)
            bodies[name] = Placed(_body(body, name, str(source)), body.pose)
            things[body.name] = [name]
    boxes: list[Box] = []
    obstacles: dict[str, Obstacle] = {}
    for thing in world.fixed:
        name = _unused(thing.name, names)
        things.setdefault(thing.body, []).append(name)
        if thing.shape is not None and thing.shape.kind is ShapeKind.BOX:
            boxes.append(Box(name, np.array(thing.shape.size), thing.shape.pose, thing.rgba, thing.friction))
        else:
            obstacles[name] = _obstacle(thing, name)
    pairs = sorted(sorted(p) for p in world.excluded if len(p) == 2)
    allowed = [(one, other) for a, b in pairs for one in things.get(a, ()) for other in things.get(b, ())]
    arm = str(Path(str(source)).resolve()) if world.source is not None else "a model in memory"
    return Scene(
        robot=made,
        robot_source=RobotSource(arm, within=robot or ""),
        bodies=bodies,
        boxes=tuple(boxes),
        obstacles=obstacles,
        gravity=world.gravity,
        allowed=tuple(allowed),
        source=world.source,
    )


def _unused(name: str, names: set[str]) -> str:
    """*name*, or the first of name_2, name_3, … that is not taken; it is taken then."""
    free, count = name, 1
    while free in names:
        count += 1
        free = f"{name}_{count}"
    names.add(free)
    return free


def _body(body: FreeBody, name: str, where: str) -> Body:
    from ..bodies import Body

    parts = [shape_surface(shape) for shape in body.shapes]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    vertices = np.concatenate([vertices for vertices, _ in parts])
    faces = np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=True)])
    try:
        return Body.from_mesh(
            vertices, faces, mass=body.mass, com=body.com, inertia=body.inertia, friction=body.friction, name=name
        )
    except ApprehendError as error:
        raise MeshError(f"{where}: body {body.name!r} cannot be taken over: {error}") from error


def _obstacle(thing: FixedThing, name: str) -> Obstacle:
    look: dict[str, Any] = {"rgba": thing.rgba, "friction": thing.friction}
    if thing.surface is not None:
        return Obstacle.of(name, Union.surface(*thing.surface), thing.pose, **look)
    if thing.radii is not None:
        return Obstacle.of(name, Convex.ellipsoid(thing.radii), thing.pose, **look)
    if thing.shape is None:
        return Obstacle.of(name, HalfSpace(thing.pose), **look)
    return Obstacle.of(name, shape_convexes(thing.shape), **look)
