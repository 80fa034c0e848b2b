"""Scenes as TOML files.

::

    clearance = 0.005                       # m, optional
    gravity = 9.81                          # m/s², optional
    allowed = [["table", "base_link"]]      # pairs of links, bodies, boxes and obstacles that may touch; optional
    srdf = "robot.srdf"                     # more such pairs of links; optional

    [robot]
    arm = "ur5e"                            # catalogue name, or a path beside this file
    hand = "robotiq_2f_85"                  # optional
    at = "tool0"                            # the arm's link that carries the hand; optional
    mount = {xyz = [0, 0, 0.01]}            # pose of the hand in that link; optional
    base = {xyz = [0, 0, 0], rpy_deg = [0, 0, 90]}

    [[box]]                                 # fixed; any number
    name = "table"
    size = [1.0, 1.4, 0.04]
    pose = {xyz = [0.6, 0, -0.02]}

    [[body]]                                # any number
    mesh = "mug.obj"                        # or household = "mug", box = [x, y, z],
                                            # cylinder = [radius, length], sphere = radius
    mass = 0.3                              # kg; or density in kg/m³
    # com = [0, 0, 0.04]                    # where they were measured: in the mesh's coordinates, in m,
    # inertia = [ixx, iyy, izz, ixy, ixz, iyz]    # and about it, in kg m²
    pose = {xyz = [0.5, -0.2, 0.05], rpy_deg = [0, 0, 30]}
    # or: rest = {on = "table", xy = [0.5, -0.2], yaw_deg = 30}      choose = 0: the most probable stable pose

    [[obstacle]]                            # fixed, of any geometry; any number: see `obstacle_tables`
    name = "floor"
    half_space = [0, 0, 1]
    pose = {xyz = [0, 0, -0.75]}

    [task]
    pick = "mug"
    place = {xyz = [0.5, 0.2, 0.05]}
    upright = true

Poses hold ``xyz`` in m and one of ``rpy_deg``, ``rpy`` (fixed axes x, y, z in this order, as in URDF) or ``wxyz``
(unit quaternion). Anything unknown is an error that names the file, the table and the key.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..conventions import DEGREE, GRAVITY
from ..errors import ApprehendError, DescriptionError, InputError, suggestion
from ..files import replace_file
from . import obstacle_tables
from .allowed import srdf_pairs
from .scene import Box, Placed, RobotSource, Scene
from .table import FAR, Table, pose_text, quoted
from .tabletop import resting

if TYPE_CHECKING:
    from ..bodies import Body
    from ..kinematics import Robot

SIZE_LIMIT = 1_000_000
"""Largest scene file in bytes."""

TOP = ("robot", "box", "body", "obstacle", "goal", "task", "clearance", "gravity", "allowed", "srdf")
ROBOT = ("arm", "hand", "at", "mount", "base", "prefix", "within")
BOX = ("name", "size", "pose", "rgba", "friction")
SHAPES = ("mesh", "household", "box", "cylinder", "sphere")
BODY = ("name", *SHAPES, "units", "mass", "density", "com", "inertia", "friction", "torsional_friction",
        "pose", "rest", "movable")  # fmt: skip
NUMBERS = ("mass", "density", "friction", "torsional_friction")
REST = ("on", "xy", "yaw_deg", "choose")
TASK = ("pick", "place", "upright")
GOAL = ("body", "pose")


def load(path: Path) -> Scene:
    """Read the scene file *path*."""
    where = f"scene {path}"
    try:
        if path.stat().st_size > SIZE_LIMIT:
            raise DescriptionError(f"{where} has {path.stat().st_size} bytes; a scene file has at most {SIZE_LIMIT}")
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        near = [p.name for p in path.parent.glob("*.toml")] if path.parent.is_dir() else []
        raise DescriptionError(f"there is no scene file {path}.{suggestion(path.name, near)}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise DescriptionError(f"{where} cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise DescriptionError(f"{where} is not TOML: {error}") from error
    top = Table(data, where, TOP)
    if "robot" not in data:
        raise DescriptionError(f'{where} has no [robot] table; expected for instance [robot] with arm = "ur5e"')
    source = _robot(Table(data["robot"], f"{where}, [robot]", ROBOT), path.parent)
    boxes = tuple(_box(table) for table in _tables(data, "box", where, BOX))
    tables = _tables(data, "body", where, BODY)
    placed = [_body(table, path.parent, boxes) for table in tables]
    names = [p.body.name for p in placed]
    for name, table in zip(names, tables, strict=True):
        if names.count(name) > 1:
            raise DescriptionError(
                f"{table.where}: there are {names.count(name)} bodies named {name!r}; give each a name"
            )
    bodies = {p.body.name: p for p in placed}
    goals, pick, upright = _task(data, where, bodies)
    obstacles = {}
    for table in _tables(data, "obstacle", where, obstacle_tables.OBSTACLE):
        obstacle = _at(table.where, obstacle_tables.read, table, path.parent)
        if obstacle.name in obstacles:
            raise DescriptionError(f"{table.where}: {obstacle.name!r} is the name of another obstacle; choose another")
        obstacles[obstacle.name] = obstacle
    robot, hand_root = _at(f"{where}, [robot]", source.build)
    scene: Scene = _at(
        where,
        Scene,
        robot=robot,
        robot_source=source,
        bodies=bodies,
        boxes=boxes,
        goals=goals,
        pick=pick,
        upright=upright,
        clearance=top.number("clearance", 0.0, at_least=0.0),
        gravity=top.number("gravity", GRAVITY),
        obstacles=obstacles,
        allowed=_allowed(top, path.parent, robot),
        hand_root=hand_root,
        source=path,
    )
    return scene


def _allowed(top: Table, folder: Path, robot: Robot) -> tuple[tuple[str, str], ...]:
    """Pairs that may touch: those of the file, and of an SRDF beside it."""
    pairs = top.values.get("allowed", [])
    if not isinstance(pairs, list) or any(
        not isinstance(p, list) or len(p) != 2 or not all(isinstance(name, str) for name in p) for p in pairs
    ):
        raise top.error("allowed", 'a list of pairs of names, such as [["table", "base_link"]]')
    found = [(str(a), str(b)) for a, b in pairs]
    if "srdf" in top:
        pairs = _at(f"{top.where}, srdf", srdf_pairs, folder / top.need_text("srdf"), robot)
        found += [(a, b) for a, b in sorted(sorted(p) for p in pairs)]
    return tuple(found)


def _at(where: str, call: Any, *args: Any, **options: Any) -> Any:
    """Call, and put *where* before the message of an error."""
    try:
        return call(*args, **options)
    except ApprehendError as error:
        if str(error).startswith(where):
            raise
        raise type(error)(f"{where}: {error}") from error


def _tables(data: Mapping[str, Any], key: str, where: str, allowed: tuple[str, ...]) -> list[Table]:
    values = data.get(key, [])
    if not isinstance(values, list):
        raise DescriptionError(f"{where}: write [[{key}]] with two brackets, for there may be several")
    return [Table(v, f"{where}, [[{key}]] number {i + 1}", allowed) for i, v in enumerate(values)]


def _beside(folder: Path, name: str) -> str:
    """*name* as a path beside the scene file where it looks like a file, else as it is (a catalogue name)."""
    looks_like_file = "/" in name or "\\" in name or Path(name).suffix.lower() in (".urdf", ".xml", ".toml")
    return str(folder / name) if looks_like_file and (folder / name).exists() else name


def _robot(table: Table, folder: Path) -> RobotSource:
    hand = table.text("hand")
    if hand is None and ("at" in table or "mount" in table or "prefix" in table):
        raise DescriptionError(f"{table.where} says where a hand is mounted but names no hand")
    prefix = table.values.get("prefix")
    if prefix is not None and not isinstance(prefix, str):
        raise table.error("prefix", "a text in quotes")
    return RobotSource(
        arm=_beside(folder, table.need_text("arm")),
        hand=None if hand is None else _beside(folder, hand),
        at=table.text("at"),
        mount=table.pose("mount") if "mount" in table else None,
        base=table.pose("base") if "base" in table else np.eye(4),
        prefix=prefix,
        within=_text_or_empty(table, "within"),
    )


def _text_or_empty(table: Table, key: str) -> str | None:
    return "" if table.values.get(key) == "" else table.text(key)


def _box(table: Table) -> Box:
    options: dict[str, Any] = {}
    if "rgba" in table:
        options["rgba"] = table.colour("rgba")
    if "friction" in table:
        options["friction"] = table.number("friction", 0.0, at_least=0.0)
    pose = table.pose("pose")
    if table.numbers("size", 3).min() > 0.1 * FAR:
        raise table.error("size", "full extents in metres; are they in millimetres?")
    box: Box = _at(table.where, Box, table.need_text("name"), table.numbers("size", 3), pose, **options)
    return box


def _body(table: Table, folder: Path, boxes: tuple[Box, ...]) -> Placed:
    from ..bodies import Body

    shapes = [k for k in SHAPES if k in table]
    if len(shapes) != 1:
        found = " and ".join(shapes) if shapes else "none"
        raise DescriptionError(f"{table.where} needs one of {', '.join(SHAPES)}; it has {found}")
    kind = shapes[0]
    if "mass" in table and "density" in table:
        raise DescriptionError(f"{table.where} has both mass and density; give one")
    if "units" in table and kind != "mesh":
        raise DescriptionError(f"{table.where}: units belong to a mesh; a {kind} is given in metres")
    options: dict[str, Any] = {k: table.number(k, 0.0) for k in NUMBERS if k in table}
    options |= {k: table.need_text(k) for k in ("name", "units") if k in table}
    origin: dict[str, object] = {}
    if kind == "mesh":
        mesh = folder / table.need_text("mesh")
        origin = {"mesh": str(mesh.resolve())} | ({"units": options["units"]} if "units" in options else {})
        body = _at(table.where, Body.load, mesh, **options)
    elif kind == "household":
        origin = {"household": table.need_text("household")}
        body = _at(table.where, Body.household, table.need_text("household"))
        if "density" in options:
            options["mass"] = options.pop("density") * body.volume
        body = _at(table.where, body.with_, **options)
    elif kind == "sphere":
        origin = {"sphere": table.number("sphere", 0.0)}
        body = _at(table.where, Body.sphere, origin["sphere"], **options)
    else:
        numbers = table.numbers(kind, 3 if kind == "box" else 2)
        origin = {kind: numbers.tolist()}
        make = Body.box if kind == "box" else Body.cylinder
        body = _at(
            table.where,
            make,
            numbers if kind == "box" else numbers[0],
            *([] if kind == "box" else numbers[1:]),
            **options,
        )
    body = _measured(table, body)
    if ("pose" in table) == ("rest" in table):
        raise DescriptionError(f"{table.where} needs either a pose or a rest on a box")
    pose = table.pose("pose") if "pose" in table else _rest(table, body, boxes)
    return Placed(body, pose, table.flag("movable", True), origin)


def _measured(table: Table, body: Body) -> Body:
    """The body with the centre of mass and the inertia that the table states, if it does."""
    if "com" not in table and "inertia" not in table:
        return body
    com = table.numbers("com", 3) if "com" in table else body.com
    inertia = None
    if "inertia" in table:
        xx, yy, zz, xy, xz, yz = table.numbers("inertia", 6)
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    made: Body = _at(table.where, body.weighed, com, inertia)
    return made


def _rest(table: Table, body: Body, boxes: tuple[Box, ...]) -> Array:
    rest = Table(table.values["rest"], f"{table.where}, rest", REST)
    on = rest.need_text("on")
    for box in boxes:
        if box.name == on:
            break
    else:
        hint = suggestion(on, [b.name for b in boxes]) or (
            f" A body rests on a box; there are: {', '.join(b.name for b in boxes) or 'none'}."
        )
        raise DescriptionError(f"{rest.where}: there is no box named {on!r} in this scene.{hint}")
    x, y = rest.numbers("xy", 2)
    beyond = np.abs((np.array([x, y, box.top]) - box.pose[:3, 3]) @ box.pose[:3, :3]) - 0.5 * box.size
    if beyond.max() > 1e-6:
        low, high = _footprint(box)
        raise rest.error("xy", f"a place on {on!r}, which spans {low[0]:g} to {high[0]:g} m in x and "
                               f"{low[1]:g} to {high[1]:g} m in y")  # fmt: skip
    choose = rest.values.get("choose")
    if choose is not None and (isinstance(choose, bool) or not isinstance(choose, int)):
        raise rest.error("choose", "a whole number (0: the most probable stable pose)")
    yaw = rest.number("yaw_deg", 0.0) * DEGREE
    pose: Array = _at(rest.where, resting, body, float(x), float(y), box.top, yaw=yaw, choose=choose)
    return pose


def _footprint(box: Box) -> tuple[Array, Array]:
    """Lower and upper end of a box in x and y of the world."""
    half = 0.5 * np.abs(box.pose[:2, :3]) @ box.size
    return box.pose[:2, 3] - half, box.pose[:2, 3] + half


def _task(
    data: Mapping[str, Any], where: str, bodies: Mapping[str, Placed]
) -> tuple[dict[str, Array], str | None, bool]:
    goals: dict[str, Array] = {}

    def known(table: Table, key: str) -> str:
        name = table.need_text(key)
        if name not in bodies:
            hint = suggestion(name, bodies) or f" There are: {', '.join(bodies) or 'none'}."
            raise DescriptionError(f"{table.where}: {key} names {name!r}, which is no body of this scene.{hint}")
        return name

    for table in _tables(data, "goal", where, GOAL):
        goals[known(table, "body")] = table.pose("pose")
    if "task" not in data:
        return goals, None, False
    if isinstance(data["task"], list):
        raise DescriptionError(f"{where}: write [task] with one bracket on each side, for there is one task")
    task = Table(data["task"], f"{where}, [task]", TASK)
    pick = known(task, "pick")
    if "place" in task:
        goals[pick] = task.pose("place")
    return goals, pick, task.flag("upright", False)


def _near(name: str, folder: Path) -> str:
    """A file in *folder* as seen from there; another name as it is."""
    file, root = Path(name).resolve(), folder.resolve()
    if not Path(name).is_file():
        return name
    return file.relative_to(root).as_posix() if file.is_relative_to(root) else str(file)


def _allowed_lines(allowed: tuple[tuple[str, str], ...]) -> list[str]:
    pairs = ", ".join(f"[{quoted(a)}, {quoted(b)}]" for a, b in allowed)
    return [f"allowed = [{pairs}]"] if pairs else []


def _measured_lines(body: Body) -> list[str]:
    """Centre of mass and inertia, where they are not those of the solid of even density."""
    even = type(body).from_mesh(body.vertices, body.faces, mass=body.mass, name=body.name)
    lines = []
    if not np.allclose(even.com, body.com, rtol=0.0, atol=1e-9 * body.radius):
        lines.append(f"com = {body.com.tolist()}")
    if lines or not np.allclose(even.inertia, body.inertia, rtol=0.0, atol=1e-9 * float(np.trace(body.inertia))):
        moments = body.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        lines.append(f"inertia = {moments.tolist()}")
    return lines


# --- writing -------------------------------------------------------------------------------------------------------
def save(scene: Scene, path: Path) -> Path:
    """Write *scene* to *path* (whole or not at all); bodies without an origin go into meshes beside it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    source = scene.robot_source
    if source.within is not None and not Path(source.arm).is_file():
        raise InputError("the robot of this scene was read from a model in memory; save that model and read the file")
    lines = [
        f"clearance = {scene.clearance!r}",
        f"gravity = {scene.gravity!r}",
        *_allowed_lines(scene.allowed),
        "",
        "[robot]",
        f"arm = {quoted(_near(source.arm, path.parent))}",
    ]
    lines += [f"within = {quoted(source.within)}"] * (source.within is not None)
    if source.hand is not None:
        lines.append(f"hand = {quoted(_near(source.hand, path.parent))}")
        lines += [f"at = {quoted(source.at)}"] * (source.at is not None)
        lines += [f"prefix = {quoted(source.prefix)}"] * (source.prefix is not None)
        lines += [f"mount = {pose_text(source.mount)}"] if source.mount is not None else []
    lines.append(f"base = {pose_text(source.base)}")
    for box in scene.boxes:
        lines += [
            "",
            "[[box]]",
            f"name = {quoted(box.name)}",
            f"size = {box.size.tolist()}",
            f"pose = {pose_text(box.pose)}",
        ]
        lines += [f"rgba = {[float(c) for c in box.rgba]}", f"friction = {box.friction!r}"]
    for name, placed in scene.bodies.items():
        body, origin = placed.body, placed.origin
        if origin is None:
            mesh = path.parent / f"{path.stem}_{name}.obj"
            body.save(mesh)
            origin = {"mesh": str(mesh)}
        lines += ["", "[[body]]", f"name = {quoted(name)}"]
        for key, value in origin.items():
            if key == "mesh":
                value = _near(str(value), path.parent)
            lines.append(f"{key} = {quoted(value) if isinstance(value, str) else value}")
        lines += [f"mass = {float(body.mass)!r}", *_measured_lines(body), f"friction = {float(body.friction)!r}"]
        if body.torsional_friction != type(body).torsional_friction:
            lines.append(f"torsional_friction = {float(body.torsional_friction)!r}")
        lines.append(f"pose = {pose_text(placed.pose)}")
        lines += ["movable = false"] * (not placed.movable)
    for obstacle in scene.obstacles.values():
        lines += obstacle_tables.lines(obstacle, path)
    for name, goal in scene.goals.items():
        if name != scene.pick:
            lines += ["", "[[goal]]", f"body = {quoted(name)}", f"pose = {pose_text(goal)}"]
    if scene.pick is not None:
        lines += ["", "[task]", f"pick = {quoted(scene.pick)}", f"upright = {str(scene.upright).lower()}"]
        if scene.pick in scene.goals:
            lines.append(f"place = {pose_text(scene.goals[scene.pick])}")
    with replace_file(path) as work:
        work.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
