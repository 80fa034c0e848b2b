"""From a `Scene` to a model of the physics engine: links, joints and inertias as the description says.

The engine's kinematics and dynamics equal those of `Robot` to rounding: a link is a body, a joint a joint, and a
mimicking joint is coupled to its driver by a constraint that is as good as rigid.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from ..arrays import Array, IntArray
from ..errors import DescriptionError, InputError
from ..files import replace_file
from ..robots.description import Description, Joint, JointType
from . import shapes
from .obstacles import add_obstacle
from .physics import Physics

if TYPE_CHECKING:
    from ..collision import Scene
    from ..kinematics import Robot

SAMPLES = 24  # random postures in which a pair of links must always touch to be taken as meant to
ROTOR = 300.0  # rad/s², see `_rotor`
MASSLESS = 1e-3  # kg, and the inertia of that at 1 cm, of a moving link that has no mass and carries none
CARRIER = 1e-6  # kg of a moving link without mass that carries others, which have it
MINIMUM = 1e-9  # what the engine takes as positive inertia
ROUNDING = 1e-5  # relative, by which moments of inertia in a file may be rounded
LOSSES = 0.1  # of a joint's effort, see `losses`


@dataclass(frozen=True, eq=False)
class Plant:
    """A compiled model and where things are in it.

    Coordinates are those of *robot*, in its order: ``every joint = expand @ q + offset``, mimicking joints included.
    *assumptions* says, a sentence each, what the descriptions left open or the engine could not take as it stood.
    """

    model: Any  # mujoco.MjModel
    robot: Robot
    physics: Physics
    q_address: IntArray  # (n,) of the robot's coordinates in the engine's positions
    v_address: IntArray  # (n,) in the engine's velocities
    joint_q: IntArray  # (m,) of every moving joint, mimicking ones included
    joint_v: IntArray
    expand: Array  # (m, n)
    offset: Array  # (m,)
    links: Mapping[str, int]  # link → engine's body
    bodies: Mapping[str, int]  # movable body → engine's body
    owners: tuple[str, ...]  # engine's body → name of link, body or box
    kinds: IntArray  # engine's body → shapes.STATIC, ROBOT or BODY
    allowed: frozenset[frozenset[str]]  # pairs of links that do not touch each other here
    assumptions: tuple[str, ...]


def build(scene: Scene, physics: Physics | None = None) -> Plant:
    """Compile *scene* for the physics engine.

    Links touch each other except neighbours, pairs that the description allows, and pairs that touch in every
    posture (the hulls of concave neighbours do); boxes and bodies touch everything.

    Raises `DescriptionError` where the engine refuses the robot, with its reason.
    """
    physics = physics or Physics()
    spec, allowed, assumptions = _specified(scene, physics)
    return _index(_compile(spec, scene.robot.name), scene, physics, allowed, tuple(assumptions))


def specification(scene: Scene, physics: Physics | None = None) -> Any:
    """*scene* as a ``mujoco.MjSpec``: robot, bodies with free joints, boxes, obstacles, and the keyframe ``home``.

    Names carry what they are: ``link:``, ``joint:``, ``body:``, ``box:``, ``obstacle:``. `Scene.from_mujoco` is the way
    back. What the descriptions left open, or the engine cannot take as it stands, is said in the text ``assumptions``.
    """
    spec, _, assumptions = _specified(scene, physics or Physics())
    if assumptions:
        spec.add_text(name="assumptions", data=". ".join(assumptions))
    model = _compile(spec, scene.robot.name)
    data = mujoco.MjData(model)
    expand, offset, names = _expansion(scene.robot.description, scene.robot.joint_names)
    for name, value in zip(names, expand @ scene.robot.home + offset, strict=True):
        data.qpos[model.joint(f"joint:{name}").qposadr[0]] = value
    spec.add_key(name="home", qpos=data.qpos)
    return spec


def to_mujoco(scene: Scene, path: str | Path, physics: Physics | None = None) -> Path:
    """Write *scene* as MJCF, meshes inside; any MuJoCo program loads it."""
    path = Path(path)
    spec = specification(scene, physics)
    spec.compile()
    with replace_file(path) as work:
        work.write_text(spec.to_xml(), encoding="utf-8")
    return path


def _specified(scene: Scene, physics: Physics) -> tuple[Any, frozenset[frozenset[str]], list[str]]:
    if not any(placed.movable for placed in scene.bodies.values()) and not scene.robot.n:
        raise InputError("the scene has neither a movable joint nor a movable body: there is nothing to simulate")
    spec = _empty(scene, physics)
    assumptions = _add_robot(spec, scene.robot, physics)
    allowed = _allowed_pairs(scene.robot.description) | _always_touching(spec, scene.robot)
    for pair in sorted(allowed, key=sorted):
        first, second = sorted(pair)
        spec.add_exclude(bodyname1=f"link:{first}", bodyname2=f"link:{second}")
    for box in scene.boxes:
        shapes.add_box(spec, box, physics)
    for name, placed in scene.bodies.items():
        shapes.add_body(spec, name, placed.body, placed.pose, physics, movable=placed.movable)
    for obstacle in scene.obstacles.values():
        sentence = add_obstacle(spec, obstacle, physics)
        assumptions += [sentence] if sentence else []
    for first, second in _excluded(scene, allowed):
        spec.add_exclude(bodyname1=first, bodyname2=second)
    return spec, allowed, assumptions


def _excluded(scene: Scene, done: frozenset[frozenset[str]]) -> list[tuple[str, str]]:
    """The scene's allowed pairs as bodies of the engine, without those of links that are *done*.

    Two things that stand still never touch there anyway.
    """
    kinds = dict.fromkeys(scene.robot.frame_names, "link") | {box.name: "box" for box in scene.boxes}
    kinds |= dict.fromkeys(scene.bodies, "body") | dict.fromkeys(scene.obstacles, "obstacle")
    still = {*(box.name for box in scene.boxes), *scene.obstacles}
    pairs = {frozenset(p) for p in scene.allowed} - done
    named = [sorted(p) for p in pairs if len(p) == 2 and not p <= still]
    return [(f"{kinds[a]}:{a}", f"{kinds[b]}:{b}") for a, b in sorted(named)]


def _empty(scene: Scene, physics: Physics) -> Any:
    spec = mujoco.MjSpec()
    spec.modelname = scene.robot.name
    spec.compiler.degree = False
    option = spec.option
    option.timestep = physics.timestep
    option.gravity = [0.0, 0.0, -scene.gravity]
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # 4.0.0 factorises the sparse one wrongly
    option.impratio = physics.impratio
    option.iterations = physics.iterations
    option.noslip_iterations = physics.noslip_iterations
    option.noslip_tolerance = physics.noslip_tolerance
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return spec


def _compile(spec: Any, name: str) -> Any:
    try:
        return spec.compile()
    except ValueError as error:
        raise DescriptionError(f"the physics engine refuses the model of {name!r}: {error}") from error


def _add_robot(spec: Any, robot: Robot, physics: Physics) -> list[str]:
    description = robot.description
    assumptions: list[str] = []
    root = spec.worldbody.add_body(name=f"link:{description.root}")
    shapes.place(root, robot.base)
    _add_link(spec, root, description, description.root, assumptions)
    bodies = {description.root: root}
    massive, carriers = _massive_groups(description)
    drives: dict[str, list[str]] = {}  # what is assumed of drives → of which joints
    for joint in description.joints:
        body = bodies[joint.parent].add_body(name=f"link:{joint.child}")
        shapes.place(body, joint.pose)
        bodies[joint.child] = body
        _add_link(spec, body, description, joint.child, assumptions)
        if joint.type is JointType.FIXED:
            continue
        _add_joint(body, joint, physics)
        for sentence in _drive(joint):
            drives.setdefault(sentence, []).append(joint.name)
        if joint.child in massive:
            continue
        carries = joint.child in carriers
        body.explicitinertial = True
        body.mass = CARRIER if carries else MASSLESS
        body.inertia = [body.mass * 0.01**2] * 3
        if not carries:
            assumptions.append(f"link {joint.child} moves and has no mass; {MASSLESS * 1e3:g} g is assumed")
    assumptions += [f"joint {', '.join(names)}: {sentence}" for sentence, names in drives.items()]
    for joint in description.joints:
        if joint.mimic is not None and joint.type is not JointType.FIXED:
            coupling = spec.add_equality(
                type=mujoco.mjtEq.mjEQ_JOINT,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                name1=f"joint:{joint.name}",
                name2=f"joint:{joint.mimic.joint}",
            )
            coupling.data[:5] = [joint.mimic.offset, joint.mimic.multiplier, 0.0, 0.0, 0.0]
            coupling.solref = [2.0 * physics.timestep, 1.0]
            coupling.solimp = physics.joint_solimp
    return assumptions


def _add_link(spec: Any, body: Any, description: Description, name: str, assumptions: list[str]) -> None:
    link = description.links[name]
    if link.inertial is not None and link.inertial.mass > 0.0:
        inertia, sentence = physical(link.inertial.inertia)
        if sentence:
            assumptions.append(f"link {name}: {sentence}")
        body.explicitinertial = True
        body.mass = link.inertial.mass
        body.ipos = link.inertial.com
        body.fullinertia = shapes.full_inertia(inertia)
    for i, shape in enumerate(link.collisions):
        sentence = shapes.add_shape(spec, body, shape, f"link:{name}:{i}")
        if sentence:
            assumptions.append(sentence)


def physical(inertia: Array) -> tuple[Array, str | None]:
    """The nearest inertia that a body can have, and a sentence where *inertia* is not one.

    A body's principal moments are positive, and none exceeds the sum of the other two. A moment that is too small is
    raised; the others stay.
    """
    moments, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    least = max(MINIMUM, 1e-6 * float(moments[-1]))
    fixed = np.maximum(moments, least)
    fixed[0] = max(fixed[0], (1.0 + ROUNDING) * (fixed[2] - fixed[1]))
    if np.allclose(fixed, moments, rtol=1e-9, atol=0.0):
        return inertia, None
    used_inertia = (axes * fixed) @ axes.T
    if np.allclose(fixed, moments, rtol=0.0, atol=2.0 * ROUNDING * float(moments[-1])):
        return used_inertia, None  # a flat body, to the digits of the file
    found = ", ".join(f"{m:.3g}" for m in moments)
    used = ", ".join(f"{m:.3g}" for m in fixed)
    return used_inertia, f"no body has the principal moments of inertia {found} kg m²; {used} are used"


def _massive_groups(description: Description) -> tuple[set[str], set[str]]:
    """Links that have mass themselves or through what is fixed to them; and those that have it beyond moving joints."""
    massive = {name for name, link in description.links.items() if link.inertial is not None and link.inertial.mass > 0}
    carriers: set[str] = set()
    for joint in reversed(description.joints):
        if joint.type is JointType.FIXED and joint.child in massive:
            massive.add(joint.parent)
        elif joint.child in massive | carriers:
            carriers.add(joint.parent)
    return massive, carriers


def _add_joint(body: Any, joint: Joint, physics: Physics) -> None:
    kind = mujoco.mjtJoint.mjJNT_SLIDE if joint.type is JointType.PRISMATIC else mujoco.mjtJoint.mjJNT_HINGE
    made = body.add_joint(name=f"joint:{joint.name}", type=kind, axis=joint.axis)
    made.armature = joint.armature or _rotor(joint)
    made.frictionloss, made.damping[0], _ = losses(joint)
    made.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    lower, upper = joint.limits.lower, joint.limits.upper
    if joint.mimic is None and joint.type is not JointType.CONTINUOUS and np.isfinite([lower, upper]).all():
        made.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        made.range = [lower, upper]
        made.solref_limit = [2.0 * physics.timestep, 1.0]
        made.solimp_limit = physics.joint_solimp


def _drive(joint: Joint) -> list[str]:
    """What is assumed of the drive of a joint, a sentence each."""
    said = [sentence] if (sentence := losses(joint)[2]) else []
    if not joint.armature and _rotor(joint):
        said.append(f"no rotor inertia is stated; {_rotor(joint):.2g} kg m² are assumed")
    return said


def losses(joint: Joint) -> tuple[float, float, str | None]:
    """Dry friction and damping of a joint, and a sentence where those of the file would stop its own drive.

    A drive that moves its joint overcomes the friction, and the damping at the joint's largest velocity; numbers for
    which the effort does not suffice are placeholders, and `LOSSES` of the effort stands for them.
    """
    effort, speed, friction, damping = joint.limits.effort, joint.limits.velocity, joint.friction, joint.damping
    if not (np.isfinite(effort) and effort > 0.0):
        return friction, damping, None
    if friction >= effort:
        friction = LOSSES * effort
    if np.isfinite(speed) and speed > 0.0 and damping * speed >= effort:
        damping = LOSSES * effort / speed
    if (friction, damping) == (joint.friction, joint.damping):
        return friction, damping, None
    said = (
        f"an effort of {effort:.3g} could not move it against its dry friction of {joint.friction:.3g} and damping of "
        f"{joint.damping:.3g}; {friction:.2g} and {damping:.2g} are assumed"
    )
    return friction, damping, said


def _rotor(joint: Joint) -> float:
    """Reflected inertia in kg m² of the rotor behind a joint that states none, but has the dry friction of a gear.

    The order of magnitude of geared arms: full effort would accelerate the rotor alone by `ROTOR` rad/s². Without it
    the last joints of many descriptions have next to no inertia against their friction.
    """
    geared = joint.type is not JointType.PRISMATIC and joint.mimic is None and joint.friction > 0.0
    return joint.limits.effort / ROTOR if geared and np.isfinite(joint.limits.effort) else 0.0


def _allowed_pairs(description: Description) -> frozenset[frozenset[str]]:
    """Pairs that the description allows, and pairs of rigid groups that one joint connects."""
    group = {description.root: description.root}
    for joint in description.joints:
        group[joint.child] = group[joint.parent] if joint.type is JointType.FIXED else joint.child
    members: dict[str, list[str]] = {}
    for link, leader in group.items():
        members.setdefault(leader, []).append(link)
    pairs = {pair for pair in description.allowed_collisions if len(pair) == 2 and pair <= set(group)}
    for joint in description.joints:
        if joint.type is not JointType.FIXED:
            for a in members[group[joint.parent]]:
                pairs |= {frozenset((a, b)) for b in members[group[joint.child]]}
    return frozenset(pairs)


def _always_touching(spec: Any, robot: Robot) -> frozenset[frozenset[str]]:
    """Pairs of links that touch at home and in every one of `SAMPLES` random postures."""
    if robot.n == 0:
        return frozenset()
    model = _compile(spec, robot.name)
    data = mujoco.MjData(model)
    expand, offset, joints = _expansion(robot.description, robot.joint_names)
    address = model.jnt_qposadr[[model.joint(f"joint:{name}").id for name in joints]]
    lower = np.where(np.isfinite(robot.limits.lower), robot.limits.lower, -np.pi)
    upper = np.where(np.isfinite(robot.limits.upper), robot.limits.upper, np.pi)
    postures = np.vstack([robot.home, np.random.default_rng(0).uniform(lower, upper, (SAMPLES, robot.n))])
    names = [model.body(i).name.removeprefix("link:") for i in range(model.nbody)]
    common: set[frozenset[str]] | None = None
    for q in postures:
        data.qpos[address] = expand @ q + offset
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        owners = model.geom_bodyid[data.contact.geom]
        touching = {frozenset((names[a], names[b])) for a, b in owners}
        common = touching if common is None else common & touching
    return frozenset(common or ())


def _expansion(description: Description, coordinates: tuple[str, ...]) -> tuple[Array, Array, list[str]]:
    moving = [joint for joint in description.joints if joint.type is not JointType.FIXED]
    column = {name: i for i, name in enumerate(coordinates)}
    expand, offset = np.zeros((len(moving), len(coordinates))), np.zeros(len(moving))
    for row, joint in enumerate(moving):
        if joint.mimic is None:
            expand[row, column[joint.name]] = 1.0
        else:
            expand[row, column[joint.mimic.joint]] = joint.mimic.multiplier
            offset[row] = joint.mimic.offset
    return expand, offset, [joint.name for joint in moving]


def _index(
    model: Any, scene: Scene, physics: Physics, allowed: frozenset[frozenset[str]], assumptions: tuple[str, ...]
) -> Plant:
    robot = scene.robot
    expand, offset, names = _expansion(robot.description, robot.joint_names)
    joints = np.array([model.joint(f"joint:{name}").id for name in names], dtype=np.int64)
    free = np.array([names.index(name) for name in robot.joint_names], dtype=np.int64)
    joint_q = model.jnt_qposadr[joints].astype(np.int64)
    joint_v = model.jnt_dofadr[joints].astype(np.int64)
    owners, kinds = [], []
    for i in range(model.nbody):
        kind, _, name = model.body(i).name.partition(":")
        owners.append(name or "world")
        movable = kind == "body" and scene.bodies[name].movable
        kinds.append(shapes.ROBOT if kind == "link" else shapes.BODY if movable else shapes.STATIC)
    return Plant(
        model=model,
        robot=robot,
        physics=physics,
        q_address=joint_q[free],
        v_address=joint_v[free],
        joint_q=joint_q,
        joint_v=joint_v,
        expand=expand,
        offset=offset,
        links={link: model.body(f"link:{link}").id for link in robot.frame_names},
        bodies={n: model.body(f"body:{n}").id for n, placed in scene.bodies.items() if placed.movable},
        owners=tuple(owners),
        kinds=np.array(kinds, dtype=np.int64),
        allowed=allowed,
        assumptions=assumptions,
    )
