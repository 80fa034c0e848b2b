"""`render`: a picture of whatever there is: a scene, a robot, a body, a stage, or bare meshes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import as_shaped
from ..errors import InputError
from . import picture
from .looks import link_parts
from .picture import Image, Item
from .stage import BODY_COLOURS, GHOST_ALPHA, Stage, Thing, box

if TYPE_CHECKING:
    from ..bodies import Body
    from ..collision import Scene
    from ..kinematics import LinkModels, Robot

OVERLAY_ALPHA = 0.4
"""How much of what is behind it a model hides that is laid over its body."""


def render(
    what: Scene | Robot | Body | LinkModels | Stage | Sequence[Item] | Any,
    q: ArrayLike | None = None,
    *,
    model: Any = None,
    **options: Any,
) -> Image:
    """The picture ``(height, width, 3)`` of *what*, the robot in it at *q* ``(n,)`` (else at home).

    *what* may also be a model of a body (spheres, a wireframe, …) or of a robot's links. With *model*, a name of
    `bodies.MODELS` or a model, a body or a robot is drawn with its model laid over it, seen through.
    *options* are those of `picture.render`: ``camera``, ``size``, ``floor``, ``focus``, ``background``.
    """
    if isinstance(what, Sequence):
        if q is not None:
            raise InputError("q is given, but there is no robot among bare meshes; pass a robot or a scene")
        return picture.render(what, **options)
    stage = stage_of(what) if model is None else overlaid(what, model)
    if q is not None and stage.robot is None:
        raise InputError("q is given, but there is no robot in what is to be drawn")
    joints = None if q is None or stage.robot is None else as_shaped(q, "q", stage.robot.n)
    items = stage.items(joints)
    if stage.boxes and "focus" not in options:
        cast = stage.items(joints)[: len(items) - len(stage.boxes) - len(stage.ghosts)]
        if cast:
            options["focus"] = picture.bounds(cast)
    return picture.render(items, **options)


def stage_of(what: Any) -> Stage:
    """The stage with *what* on it."""
    from ..bodies import Body
    from ..collision import Scene
    from ..kinematics import LinkModels, Robot
    from .models import is_model, link_stage
    from .models import things as model_things

    if isinstance(what, Stage):
        return what
    if isinstance(what, LinkModels):
        return link_stage(what)
    if is_model(what):
        return Stage(bodies=model_things(what))
    if isinstance(what, Robot):
        return Stage(what, link_parts(what.description))
    if isinstance(what, Body):
        return Stage(bodies=(Thing(what.name, what.vertices, what.faces, np.eye(4), BODY_COLOURS[0]),))
    if isinstance(what, Scene):
        names = sorted(what.bodies, key=lambda name: name != what.pick)
        things = {}
        for i, name in enumerate(names):
            placed = what.bodies[name]
            colour = BODY_COLOURS[i % len(BODY_COLOURS)]
            things[name] = Thing(name, placed.body.vertices, placed.body.faces, placed.pose, colour)
        boxes = tuple(box(b.name, b.size.tolist(), b.pose, b.rgba) for b in what.boxes) + obstacles_of(what)
        ghosts = tuple(
            Thing(f"goal of {name}", things[name].vertices, things[name].faces, pose, (0.25, 0.62, 0.36, GHOST_ALPHA))
            for name, pose in what.goals.items()
        )
        return Stage(what.robot, link_parts(what.robot.description), tuple(things.values()), boxes, ghosts)
    raise InputError(
        f"cannot draw a {type(what).__name__}; expected a scene, robot, body, their models, a stage, or a list of Items"
    )


def obstacles_of(scene: Scene) -> tuple[Thing, ...]:
    """The scene's obstacles as things to draw."""
    from ..collision.outlines import triangles

    return tuple(
        Thing(name, *triangles(shape), np.eye(4), obstacle.rgba)
        for name, obstacle in scene.obstacles.items()
        for shape in obstacle.shapes
    )


def overlaid(what: Any, model: Any) -> Stage:
    """The stage with a body or a robot, and its *model* (or a name of one) see-through over it."""
    from ..bodies import Body, Wireframe
    from ..kinematics import LinkModels, Robot, link_models
    from .models import link_parts_of, things

    if isinstance(what, Body):
        shown = what.model(model) if isinstance(model, str) else model
        alpha = 1.0 if isinstance(shown, Wireframe) else OVERLAY_ALPHA
        return replace(stage_of(what), ghosts=things(shown, alpha=alpha))
    if not isinstance(what, Robot):
        raise InputError(f"model is given, but a {type(what).__name__} has none; pass a body or a robot")
    links = model if isinstance(model, LinkModels) else link_models(what, model)
    parts = link_parts_of(links, 1.0 if links.kind == "wireframe" else OVERLAY_ALPHA)
    looks = link_parts(what.description)
    return Stage(what, {name: (*looks.get(name, ()), *parts.get(name, ())) for name in what.frame_names})
