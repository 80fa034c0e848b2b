"""Compile the kernels of the main job before its first run, on two cores at once and with a word about it.

Numba compiles a kernel when it is first called and keeps the machine code on disk. One process compiles one kernel at
a time, so two processes halve the wait. Whatever fails here is compiled when it is needed.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import time
from pathlib import Path

from ..process import Observer, StepRecord, StepStatus

PARTS = ("arm", "grasp")


def warm_up(observer: Observer) -> None:
    """Compile what `pick` needs, unless this machine has done so for these sources."""
    marker = _marker()
    if marker.exists():
        return
    title = "Compile the kernels"
    observer.started("compile", title)
    observer.progress("once on this machine, about a minute")
    start = time.perf_counter()
    command = "from apprehend.cli import warm; warm.{}()"
    running = [
        subprocess.Popen(
            [sys.executable, "-c", command.format(part)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        for part in PARTS
    ]
    good = [process.wait() == 0 for process in running]
    if all(good):
        marker.parent.mkdir(parents=True, exist_ok=True)
        marker.touch()
    wall = time.perf_counter() - start
    observer.finished(StepRecord("compile", title, StepStatus.SUCCESS, "once on this machine", wall))


def _marker() -> Path:
    from ..kernels import _jit

    state = hashlib.sha256()
    for path in sorted(_jit.HERE.glob("*.py")):
        state.update(path.read_bytes())
    return _jit.cache_dir(Path(_jit.__file__)).parent / f"warm-{state.hexdigest()[:16]}"


def arm() -> None:
    """Inverse kinematics, collision checks, planning and timing."""
    import numpy as np

    from .. import ik, planning, trajectory
    from ..collision import Box, CollisionModel, Scene
    from ..collision.tabletop import translation
    from ..process.motion import FREE
    from ..trajectory import Limits

    scene = Scene.tabletop(body="can")
    robot, root, model = scene.robot, scene.hand.root, CollisionModel(scene.robot, scene)
    joints = list(robot.chain(root))
    lower = np.eye(4)
    lower[2, 3] = -0.05
    rng = np.random.default_rng(0)
    found = ik.solve(robot, (lower @ robot.fk(robot.home, root))[None], root, n_solutions=4, rng=rng)
    model.free(found.solutions(0))
    down = planning.straight(robot, model, robot.home, root, lower @ robot.fk(robot.home, root)).path
    wall = Box("wall", np.array([0.4, 0.05, 1.4]), translation(0.75, 0.0, 0.7))  # something to plan around
    beside = robot.home.copy()
    beside[joints[0]] = -0.8
    goal = np.repeat(robot.home[None], 2, axis=0)
    goal[:, joints[0]] = (0.8, 0.9)
    walled = CollisionModel(robot, scene.with_box(wall))
    way = planning.plan(walled, beside, goal, rng=rng, joints=joints).path
    limits = Limits(velocity=np.full(len(joints), FREE), acceleration=np.full(len(joints), FREE))
    trajectory.through_samples(down[:, joints], limits)
    bent = np.concatenate([way[:, joints], down[-1:, joints]])
    trajectory.follow(bent, limits, deviation=0.02)
    trajectory.follow(bent, limits)
    held = model.attach(scene.bodies["can"].body, root, lower).allow([("table", "can")])
    held.edges_free(down[:-1], down[1:])


def grasp() -> None:
    """Seeing, grasp planning and drawing."""
    import numpy as np

    from .. import grasp as room
    from .. import viewer
    from ..collision import Scene
    from ..process import Context
    from ..process.grasping import support_plane
    from ..process.locate import Locate

    context = Context.begin(Scene.tabletop(body="can"), np.random.default_rng(0))
    Locate().run(context)
    assert context.pose is not None
    table = support_plane(context, context.pose)[None]
    room.plan(context.hand, context.body, 20, rng=context.rng, table=table)
    viewer.render(context.scene, size=(64, 48))
