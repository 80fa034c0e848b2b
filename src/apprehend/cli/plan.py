"""``apprehend plan``: a collision-free path of a robot in a scene, or the reason why there is none."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import console, print_json
from .options import Browser, Json, Port, check_file, is_scene

if TYPE_CHECKING:
    from ..arrays import Array
    from ..collision import Scene
    from ..kinematics import Robot
    from ..planning import PlanResult

EPILOG = "Exit code 0: a path, checked; 1: there is none, and the reason is printed; 2: wrong input."

BRANCHES = 32
"""Postures that are sought for a goal that is a pose."""


def command(
    what: Annotated[str, typer.Argument(help="scene (.toml), catalogue name or description file of a robot")],
    goal: Annotated[
        list[str] | None,
        typer.Option(
            "--goal", help="joint values a,b,… (rad, m) or joint=value,… or 'home'; may be given again: any of them"
        ),
    ] = None,
    xyz: Annotated[
        list[str] | None, typer.Option(help="goal as position x,y,z of --frame in m; may be given again")
    ] = None,
    rpy: Annotated[
        str | None, typer.Option(help="with --xyz: fixed-axis roll,pitch,yaw in rad", show_default="as at the start")
    ] = None,
    start: Annotated[str, typer.Option(help="joint values a,b,… (rad, m), joint=value,… or 'home'")] = "home",
    frame: Annotated[
        str | None, typer.Option(help="frame of --xyz, --upright and the drawn way", show_default="the tool")
    ] = None,
    straight: Annotated[bool, typer.Option("--straight", help="move --frame to --xyz in a straight line")] = False,
    upright: Annotated[
        float | None,
        typer.Option(help="keep the frame's z axis within so many degrees of where it points at the start"),
    ] = None,
    smooth: Annotated[bool, typer.Option("--smooth", help="round the corners")] = False,
    clearance: Annotated[float | None, typer.Option(help="distance to keep in m", show_default="the scene's")] = None,
    time_limit: Annotated[float, typer.Option(help="seconds to search")] = 5.0,
    seed: Annotated[int, typer.Option(min=0, help="of the random samples")] = 0,
    deg: Annotated[bool, typer.Option("--deg", help="joint values and rpy in degrees")] = False,
    out: Annotated[Path | None, typer.Option(help="write the path (.json or .csv), for 'apprehend trajectory'")] = None,
    picture: Annotated[Path | None, typer.Option(help="draw the path (.png)")] = None,
    view: Annotated[bool, typer.Option("--view", help="show the path in the browser, with a slider")] = False,
    port: Port = 8080,
    browser: Browser = True,
    as_json: Json = False,
) -> int:
    """Exit code 0: a path, checked; 1: there is none, and why; 2: wrong input. See `EPILOG`."""
    import numpy as np

    from .. import planning
    from ..collision import CollisionModel
    from ..errors import InputError

    check_file("--out", out, ".json", ".csv")
    check_file("--picture", picture, ".png")
    if rpy is not None and not xyz:
        raise InputError("--rpy turns the goal of --xyz; give --xyz, or drop --rpy")
    scene, robot = read(what)
    rng = np.random.default_rng(seed)
    q0 = posture(start, "--start", robot, deg)
    tool = _frame(robot, frame)
    poses = [_pose(robot, q0, tool, text, rpy, deg) for text in xyz or ()]
    goals = [posture(text, "--goal", robot, deg, q0)[None] for text in goal or ()]
    if not poses and not goals:
        raise InputError("there is no goal; give --goal with joint values, or --xyz")
    if straight and (len(poses) != 1 or goals):
        raise InputError("--straight goes to one pose: give --xyz (and --rpy) once, and no --goal")
    model = CollisionModel(robot, scene, clearance=clearance)
    if straight:
        result = planning.straight(robot, model, q0, tool, poses[0])
    else:
        missed = []
        for T in poses:
            found, reason = branches(robot, T, tool, q0, rng)
            goals.append(found)
            missed += [f"The goal at {T[:3, 3].round(4).tolist()} m: {reason}."] if reason else []
        if not sum(map(len, goals)):
            return unreached(missed, as_json)
        up = robot.fk(q0, tool)[:3, 2]
        keep = [] if upright is None else [planning.Upright(tool, angle=float(np.radians(upright)), up=up)]
        result = planning.plan(
            model, q0, np.concatenate(goals), rng=rng, time_limit=time_limit, smooth=smooth, constraints=keep
        )
    show(result, robot, scene, tool, out=out, picture=picture, as_json=as_json)
    if view and result.success:
        from .. import viewer

        page: dict[str, Any] = {"port": port, "open_browser": browser, "announce": console.print}
        viewer.show_path(scene or robot, result.path, tool, model=model, **page)
    return 0 if result.success else 1


def read(what: str) -> tuple[Scene | None, Robot]:
    """The scene and its robot, or a robot alone."""
    from ..collision import Scene
    from ..kinematics import Robot

    path = Path(what)
    if is_scene(path):
        scene = Scene.load(path)
        return scene, scene.robot
    return None, Robot.load(what)


def posture(text: str, name: str, robot: Robot, deg: bool, base: Array | None = None) -> Array:
    """Joint values as typed, ``home``, or some joints by name, ``joint=value,…``, the others as in *base*."""
    from ..conventions import DEGREE
    from ..errors import InputError
    from .values import joints

    if text == "home":
        return robot.home.copy()
    if "=" not in text:
        try:
            return joints(text, robot, deg, name)
        except InputError as error:
            raise InputError(f"{error}, or 'home', or joint=value pairs") from error
    q = robot.home.copy() if base is None else base.copy()
    for pair in text.split(","):
        joint, _, value = pair.partition("=")
        i = robot.index(joint.strip())
        try:
            q[i] = float(value)
        except ValueError as error:
            raise InputError(f"{name} says {pair.strip()!r}; expected joint=value") from error
        if deg and robot.description.free_joints[i].type.value != "prismatic":
            q[i] *= DEGREE
    return q


def _frame(robot: Robot, frame: str | None) -> str:
    from ..viewer.along import tool_of

    name = frame or tool_of(robot)
    robot.frame_index(name)
    return name


def _pose(robot: Robot, q0: Array, tool: str, xyz: str, rpy: str | None, deg: bool) -> Array:
    """The pose asked for; without --rpy the frame keeps the orientation that it starts with."""
    from .values import pose

    T = pose(xyz, rpy, deg)
    if rpy is None:
        T[:3, :3] = robot.fk(q0, tool)[:3, :3]
    return T


def branches(robot: Robot, T: Array, tool: str, q0: Array, rng: Any) -> tuple[Array, str]:
    """Postures ``(k, n)`` that bring *tool* to *T*, joints that do not move it as in *q0*; and why there are none."""
    import numpy as np

    from ..ik import solve

    answer = solve(robot, T, tool, n_solutions=BRANCHES, rng=rng)
    if not answer.success:
        return np.zeros((0, robot.n)), answer.reason()
    found = np.array(answer.solutions())
    still = np.ones(robot.n, bool)
    still[list(robot.chain(tool))] = False
    found[:, still] = q0[still]
    return found, ""


def unreached(reasons: list[str], as_json: bool) -> int:
    """Say that no posture reaches any of the goals."""
    if as_json:
        print_json({"status": "unreachable", "reason": " ".join(reasons), "path": []})
    else:
        for reason in reasons:
            console.print(reason, markup=False)
    return 1


def show(
    result: PlanResult, robot: Robot, scene: Scene | None, tool: str, *, out: Path | None, picture: Path | None,
    as_json: bool,
) -> None:  # fmt: skip
    """Print the answer, write the path, draw it."""
    written = write(result, robot, out) if out is not None and result.success else None
    if picture is not None and result.success:
        from .. import viewer
        from ..files import replace_file

        with replace_file(picture) as work:
            work.write_bytes(viewer.png(viewer.render_path(scene or robot, result.path, tool)))
    if as_json:
        print_json(facts(result, robot))
        return
    console.print(result.explain(), markup=False)
    if result.success:
        console.print(
            f"{len(result.path)} points, {result.length:.3f} rad and m in joint space, goal {result.goal}; "
            f"{1e3 * result.seconds:.1f} ms, {result.nodes} nodes"
        )
    for path in (written, picture if result.success else None):
        if path is not None:
            console.print(f"written: {path}")


def facts(result: PlanResult, robot: Robot) -> dict[str, Any]:
    """The answer as plain data."""
    return {
        "status": str(result.status), "reason": result.explain(), "joints": list(robot.joint_names),
        "path": result.path.tolist() if result.success else [], "goal": result.goal, "length": result.length,
        "seconds": result.seconds, "nodes": result.nodes, "samples": result.samples,
        "touches": [{"a": t.a, "b": t.b, "distance": t.distance} for t in result.touches],
    }  # fmt: skip


def write(result: PlanResult, robot: Robot, out: Path) -> Path:
    """The waypoints as ``apprehend trajectory`` reads them: a list of lists, or one per row."""
    import json

    import numpy as np

    from ..files import replace_file

    with replace_file(out) as work:
        if out.suffix == ".json":
            work.write_text(json.dumps(result.path.tolist()))
        else:
            np.savetxt(work, result.path, delimiter=",", header=",".join(robot.joint_names))
    return out
