"""Pages to look at one thing: a robot with a slider for every joint, a body, or grasps of a body by a hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from ..arrays import Array, choice
from ..bodies import MODELS
from ..errors import ApprehendError, InputError
from .draw import overlaid, stage_of
from .live import Page, Serving, serve
from .looks import RGBA, link_parts
from .marks import arrow, friction_cone
from .models import things
from .picture import Camera, bounds, corners_of
from .replay import switch
from .stage import BODY_COLOURS, Stage, Thing
from .words import number, significant

if TYPE_CHECKING:
    from ..bodies import Body, RestPose
    from ..collision import Scene
    from ..grasp.candidates import Candidate
    from ..kinematics import Hand, LinkModels, Robot

NO_MODEL = "none"
"""What the menu of models says when none is shown."""


def show_robot(
    what: Robot | Scene,
    *,
    models: LinkModels | None = None,
    **serving: Unpack[Serving],
) -> Page:
    """A page with a robot (in its scene) and a slider for every joint, in degrees or millimetres; frames can be shown.

    With *models* of its links, these are laid over them.
    """
    stage = stage_of(what) if models is None else overlaid(what, models)
    robot = stage.robot
    if robot is None:
        raise InputError(f"there is no robot in a {type(what).__name__}; pass a robot or a scene")
    return serve(robot.name, lambda page: _robot_controls(page, robot, stage), **serving)


def _robot_controls(page: Page, robot: Robot, stage: Stage) -> None:
    from ..robots.description import JointType

    page.add(stage)
    items = stage.items()
    low, high = bounds(items) if items else (np.full(3, -0.5), np.full(3, 0.5))
    page.grid(float((high - low).max()))
    page.look(Camera.around(corners_of(low, high)))
    gui = page.server.gui
    gui.add_markdown(f"**{robot.name}**: {robot.n} joints, {len(robot.frame_names)} frames, {robot.mass:.2f} kg")
    q = robot.home.copy()
    sliders: list[tuple[int, float, Any]] = []

    def move(_: Any) -> None:
        for i, factor, slider in sliders:
            q[i] = slider.value / factor
        page.draw(dict(zip(robot.frame_names, robot.fk(q))))

    with gui.add_folder("Joints"):
        reset = gui.add_button("Home")
        for i, name in enumerate(robot.joint_names):
            sliding = robot.description.joint(name).type is JointType.PRISMATIC
            factor, unit = (1e3, "mm") if sliding else (180.0 / math.pi, "°")
            free = 1000.0 if sliding else 180.0
            lower, upper = factor * float(robot.limits.lower[i]), factor * float(robot.limits.upper[i])
            lower = math.ceil(10.0 * lower) / 10.0 if math.isfinite(lower) else -free
            upper = math.floor(10.0 * upper) / 10.0 if math.isfinite(upper) else free
            upper = max(upper, lower + 0.1)
            start = min(max(round(factor * float(q[i]), 1), lower), upper)
            slider = gui.add_slider(f"{name} in {unit}", lower, upper, 0.1, start)
            slider.on_update(move)
            sliders.append((i, factor, slider))

    def home(_: Any) -> None:
        for i, factor, slider in sliders:
            slider.value = round(factor * float(robot.home[i]), 1)
        q[:] = robot.home
        page.draw(dict(zip(robot.frame_names, robot.fk(q))))

    reset.on_click(home)
    with gui.add_folder("Show"):
        size = 0.06 * float((high - low).max())
        frames = [
            page.server.scene.add_frame(f"/robot/{name}/axes", axes_length=size, axes_radius=0.04 * size, visible=False)
            for name in page.link_names
        ]
        switch(gui, "frames of the links", frames, shown=False)


def show_body(
    body: Body,
    *,
    model: str | None = None,
    **serving: Unpack[Serving],
) -> Page:
    """A page with *body*: its mass properties, its resting poses, and its models (*model*: the one shown first)."""
    if model is not None:
        choice(model, "model", MODELS[1:])
    return serve(body.name, lambda page: _body_controls(page, body, model), **serving)


def _body_controls(page: Page, body: Body, model: str | None = None) -> None:
    poses = body.stable_poses(min_probability=0.001)
    page.add(Stage(bodies=(Thing(body.name, body.vertices, body.faces, poses[0].pose, BODY_COLOURS[0]),)))
    reach = body.radius
    page.grid(2.0 * reach)
    page.look(Camera.around(corners_of(np.array([-reach, -reach, 0.0]), np.array([reach, reach, 2.0 * reach]))))
    gui, scene = page.server.gui, page.server.scene
    gui.add_markdown(facts(body))
    names = [_pose_name(i, pose) for i, pose in enumerate(poses)]
    chosen = gui.add_dropdown("resting pose", tuple(names))
    chosen.on_update(lambda _: page.draw(bodies={body.name: poses[names.index(chosen.value)].pose}))
    below = f"/bodies/{body.name}"
    with gui.add_folder("Show"):
        surface = page.handles[f"{below}/mesh"]
        switch(gui, "surface", [surface])
        moments, axes = np.linalg.eigh(body.inertia)
        lengths = 0.9 * reach * np.sqrt(moments[0] / moments)
        marks = [scene.add_icosphere(f"{below}/com", radius=0.05 * reach, color=(20, 20, 20), position=body.com)]
        colours: tuple[RGBA, ...] = ((0.85, 0.2, 0.2, 1.0), (0.2, 0.65, 0.25, 1.0), (0.2, 0.35, 0.85, 1.0))
        for k in range(3):
            mesh = arrow(body.com, lengths[k] * axes[:, k], 0.012 * reach)
            marks.append(page.mesh(f"{below}/axis{k}", *mesh, colours[k]))
        for mark in marks:
            mark.visible = False
        switch(gui, "centre of mass and principal axes", marks, shown=False)
    _model_menu(page, body, below, model)


def _model_menu(page: Page, body: Body, below: str, start: str | None) -> None:
    """A menu of the body's models (K): the chosen one is drawn over it, and what is lost is said."""
    gui = page.server.gui
    with gui.add_folder("Model"):
        menu = gui.add_dropdown("model", (NO_MODEL, *MODELS[1:]), initial_value=start or NO_MODEL)
        count = gui.add_number("shapes at most", 24, min=1, max=512, step=1)
        text = gui.add_markdown("")
    drawn: list[Any] = []

    def show(_: Any) -> None:
        for handle in drawn:
            handle.remove()
        drawn.clear()
        text.content = ""
        if menu.value == NO_MODEL:
            return
        many = int(count.value) if menu.value in ("blocks", "boxes", "spheres", "capsules") else None
        try:
            model = body.model(menu.value, many)
        except ApprehendError as error:
            text.content = str(error)
            return
        alpha = 1.0 if menu.value == "wireframe" else 0.45
        for thing in things(model, alpha=alpha):
            drawn.append(page.mesh(f"{below}/{thing.name}", thing.vertices, thing.faces, thing.rgba))
        text.content = f"{len(model) if hasattr(model, '__len__') else ''} {menu.value}: {body.deviation(model)}"

    menu.on_update(show)
    count.on_update(show)
    show(None)


def facts(body: Body) -> str:
    """What is known of a body, as Markdown for a person."""
    size = " × ".join(f"{1e3 * x:.1f}" for x in body.extents)
    moments = ", ".join(significant(1e6 * m) for m in np.linalg.eigvalsh(body.inertia))
    repairs = "".join(f"\n* repaired: {note}" for note in body.repairs)
    source = {"given": "given", "density": "from the density", "assumed": "assumed density"}[body.mass_source]
    return (
        f"**{body.name}**\n\n* size {size} mm\n* mass {number(body.mass, 3)} kg ({source}), "
        f"volume {significant(1e6 * body.volume)} cm³\n* principal moments of inertia {moments} kg mm²\n"
        f"* friction µ = {body.friction:g}\n* {len(body.faces)} triangles, "
        f"{'closed' if body.watertight else 'open'}{repairs}"
    )


def _pose_name(index: int, pose: RestPose) -> str:
    return f"{index + 1}: {100 * pose.probability:.1f} %, tips at {math.degrees(pose.tip_angle):.0f}°"


def show_grasp(
    body: Body,
    candidates: Candidate | Sequence[Candidate],
    hand: Hand,
    **serving: Unpack[Serving],
) -> Page:
    """A page with *body* and *hand* at each of the *candidates* (best first), contacts and friction cones drawn."""
    from ..grasp.candidates import Candidate

    options = [candidates] if isinstance(candidates, Candidate) else list(candidates)
    if not options:
        raise InputError("there are no grasps to show: candidates is empty; the plan's explain() says why")
    return serve(f"grasps of {body.name}", lambda page: _grasp_controls(page, body, options, hand), **serving)


def _grasp_controls(page: Page, body: Body, options: Sequence[Candidate], hand: Hand) -> None:
    from ..grasp import HandCandidate

    robot = hand.robot
    stage = Stage(
        robot, link_parts(robot.description), (Thing(body.name, body.vertices, body.faces, np.eye(4), BODY_COLOURS[0]),)
    )
    page.add(stage)
    reach = body.radius + 0.05
    page.look(Camera.around(corners_of(body.com - reach, body.com + reach), margin=1.0))
    gui = page.server.gui
    text = gui.add_markdown("")
    rank = gui.add_slider("rank", 1, max(len(options), 2), 1, 1, disabled=len(options) < 2)
    back = gui.add_slider("retreat in mm", 0, 150, 1, 0)
    marks: list[Any] = []

    def draw(_: Any) -> None:
        grasp = options[min(int(rank.value), len(options)) - 1]
        retreat = 1e-3 * back.value
        if isinstance(grasp, HandCandidate):
            q = grasp.pregrasp if retreat else grasp.q
        else:
            q = hand.jaw.q_at(grasp.opening if retreat else grasp.width)
        frames = _hand_frames(grasp.retreated(retreat), robot, q)
        page.draw(links=dict(zip(robot.frame_names, frames)))
        for mark in marks:
            mark.remove()
        marks.clear()
        for i, contact in enumerate(grasp.contacts):
            cone = friction_cone(contact.position, contact.normal, contact.friction, 0.4 * body.radius)
            marks.append(page.mesh(f"/contacts/cone{i}", *cone, (0.16, 0.45, 0.80, 0.35)))
        text.content = describe(grasp)

    rank.on_update(draw)
    back.on_update(draw)
    draw(None)


def _hand_frames(T_body_hand: Array, robot: Robot, q: Array) -> Array:
    """Poses ``(F, 4, 4)`` of the hand's frames in the body's frame, its root link at *T_body_hand*."""
    frames = robot.fk(q)
    return np.asarray(T_body_hand @ np.linalg.inv(frames[0]) @ frames)


def describe(grasp: Candidate) -> str:
    """The facts of a grasp, as Markdown for a person."""
    from .words import quantity

    margins = "".join(f"\n* {k.replace('_', ' ')}: {quantity(k, v)}" for k, v in grasp.margins.items())
    from ..grasp import HandCandidate

    if isinstance(grasp, HandCandidate):
        how = f"{len(grasp.links)} contacts by {grasp.method}: {', '.join(grasp.links)}; up to"
    else:
        how = f"{1e3 * grasp.width:.1f} mm wide, needs"
    return f"**quality {grasp.quality:.3f}**, {how} {grasp.required_force:.1f} N at each pad\n{margins}"
