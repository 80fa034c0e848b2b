"""The MotionBenchMaker problems (Chamzas et al. 2022): time to plan and to simplify, and every path checked again.

Robots are modelled by the spheres that come with the problems (Panda), or by their meshes (UR5). A motion counts as
free when it is proven so down to 20 µm of movement (`CollisionModel.resolution`), not sampled. Paths are checked
again by the exact kernels at steps of 0.0002 rad, 100 times finer than the usual 0.02 rad, and every so many of them by
coal, pair by pair, at 0.002 rad.

Beside it OMPL's RRT-Connect with the same validity function, called from Python for each state, at steps of 0.02 rad.
Published times on the same Panda problems, with planning code compiled for that robot on a Ryzen 7950X (Thomason,
Kingston & Kavraki 2024): 699 of 700 solved (100 per set), median 35 µs, mean 76 µs, 95 % 343 µs.
"""

from __future__ import annotations

import argparse
import json
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from apprehend.collision import CollisionModel, Convex
from apprehend.collision.nodes import matrix
from apprehend.kinematics import Robot
from apprehend.parallel import set_threads
from apprehend.planning import plan, shortcut

from .collision_pairs import coal_of

REFERENCE = Path(__file__).resolve().parents[2] / "shared" / "reference"
FINER = 100
COAL_EVERY = 25
ROUNDS = 3  # the fastest of so many equal attempts counts: other load on the machine does not


def rotation(wxyz: list[float]) -> np.ndarray:
    w, x, y, z = np.array(wxyz) / np.linalg.norm(wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def obstacle(entry: dict[str, Any]) -> tuple[Convex, np.ndarray]:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(entry["quaternion_wxyz"]), entry["position"]
    d = entry["dimensions"]
    return {"box": lambda: Convex.box(d), "cylinder": lambda: Convex.cylinder(d[1], d[0])}[entry["type"]](), T


def panda_geometry(data: dict[str, Any]) -> dict[str, list[Convex]]:
    def ball(entry: dict[str, Any]) -> Convex:
        T = np.eye(4)
        T[:3, 3] = entry["center"]
        return Convex.sphere(entry["radius"]).at(T)

    return {link: [ball(entry) for entry in entries] for link, entries in data["panda_spheres"].items()}


def recheck(model: CollisionModel, path: np.ndarray) -> bool:
    """The path free at steps `FINER` times finer than the checked resolution, by plain sampling of sphere distances."""
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    for a, b, length in zip(path[:-1], path[1:], lengths, strict=True):
        steps = int(np.ceil(length / (0.02 / FINER))) + 1
        q = a + np.linspace(0.0, 1.0, steps)[:, None] * (b - a)
        if (model.hits(q) >= 0).any():
            return False
    return True


def free_by_coal(model: CollisionModel, path: np.ndarray, step: float = 0.002) -> bool:
    """The same by coal's distances between the same shapes, at steps of *step* rad."""
    import coal

    robot, tree = model.robot, model.robot.model
    bodies: list[list[Any]] = []
    for node in model.nodes:
        frame = robot.frame_index(node.name) if node.carrier >= 0 else -1
        place = matrix(tree.frame_place[frame]) if frame >= 0 else np.eye(4)
        made = [coal_of(shape) for shape in node.shapes]
        bodies.append([(frame, shape, np.linalg.inv(place) @ at) for shape, at in made])
    checked = [(a, b) for i, j in model.compiled.blocks[:, :2] for a in bodies[i] for b in bodies[j]]
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    for q0, q1, length in zip(path[:-1], path[1:], lengths, strict=True):
        q = q0 + np.linspace(0.0, 1.0, int(np.ceil(length / step)) + 1)[:, None] * (q1 - q0)
        for T in robot.fk(q):
            placed = {}
            for frame, shape, at in (body for node in bodies for body in node):
                X = (T[frame] if frame >= 0 else np.eye(4)) @ at
                placed[id(shape)] = coal.Transform3s(X[:3, :3], X[:3, 3])
            for (_, a, _), (_, b, _) in checked:
                result.clear()
                if coal.collide(a, placed[id(a)], b, placed[id(b)], request, result):
                    return False
    return True


def timed(model: CollisionModel, start: np.ndarray, goal: np.ndarray, arm: list[int], seed: int):
    """One attempt: the answer, the simplified path, and the seconds for either."""
    rng = np.random.default_rng(seed)
    began = time.perf_counter()
    result = plan(model, start, goal, rng=rng, time_limit=1.0, joints=arm, simplify=False)
    middle = time.perf_counter()
    path = shortcut(model, result.path, rng=rng) if result.success else result.path
    return result, path, middle - began, time.perf_counter() - middle


def ompl_time(model: CollisionModel, start: np.ndarray, goal: np.ndarray, arm: list[int]) -> float | None:
    """Seconds of OMPL's RRT-Connect with `CollisionModel.free` as validity function; None: not solved in 10 s."""
    from ompl import base, geometric, util

    util.setLogLevel(util.LogLevel.LOG_NONE)
    lower, upper = model.robot.limits.lower[arm], model.robot.limits.upper[arm]
    space, bounds = base.RealVectorStateSpace(len(arm)), base.RealVectorBounds(len(arm))
    for i in range(len(arm)):
        bounds.setLow(i, float(min(lower[i], start[arm[i]], goal[arm[i]])))
        bounds.setHigh(i, float(max(upper[i], start[arm[i]], goal[arm[i]])))
    space.setBounds(bounds)
    setup, q = geometric.SimpleSetup(space), start.copy()

    def valid(state: Any) -> bool:
        q[arm] = [state[i] for i in range(len(arm))]
        return bool(model.free(q))

    setup.setStateValidityChecker(valid)
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(0.02 / space.getMaximumExtent())
    ends = [space.allocState() for _ in range(2)]
    for state, values in zip(ends, (start[arm], goal[arm]), strict=True):
        for i, value in enumerate(values):
            state[i] = float(value)
    setup.setStartAndGoalStates(*ends)
    planner = geometric.RRTConnect(information)
    planner.setRange(0.8)
    setup.setPlanner(planner)
    began = time.perf_counter()
    setup.solve(10.0)
    return time.perf_counter() - began if setup.haveExactSolutionPath() else None


def problems(robot_name: str, per_set: int):
    """Every problem: its set and number, the collision model, start, goal, and the arm's coordinates."""
    data = json.loads((REFERENCE / f"motionbenchmaker_{robot_name}.json").read_text())
    robot = Robot.load(REFERENCE / "models" / f"{robot_name}.urdf") if robot_name == "ur5" else Robot.load("panda")
    bare = CollisionModel(robot, geometry=panda_geometry(data) if robot_name == "panda" else None)
    for set_name, entries in data["problems"].items():
        for entry in entries[:per_set]:
            model = bare
            for k, thing in enumerate(entry["obstacles"]):
                shape, T = obstacle(thing)
                model = model.add(f"{thing['name']} {k}", [shape], T)
            start = np.zeros(robot.n)
            for name, value in entry["start"].items():
                if name in robot.joint_names:
                    start[robot.index(name)] = value
            goal = start.copy()
            arm = [robot.index(name) for name in entry["goal"]]
            goal[arm] = list(entry["goal"].values())
            yield set_name, entry["index"], model, start, goal, arm


def run(robot_name: str, per_set: int, ompl_every: int, seed: int = 0) -> None:
    planning, simplifying, solved, valid, wrong, lengths, unsolved = [], [], 0, 0, 0, [], []
    peer, ours_beside, peer_failed, by_coal = [], [], 0, []
    for number, (set_name, index, model, start, goal, arm) in enumerate(problems(robot_name, per_set)):
        if not model.free(np.array([start, goal])).all():
            continue
        if not valid:
            timed(model, start, goal, arm, seed)  # compile
        valid += 1
        rounds = [timed(model, start, goal, arm, seed) for _ in range(ROUNDS)]
        result, path, _, _ = rounds[0]
        if not result.success:
            unsolved.append((set_name, index, result.explain()))
            continue
        solved += 1
        planning.append(min(r[2] for r in rounds))
        simplifying.append(min(r[2] + r[3] for r in rounds))
        lengths.append(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        wrong += not recheck(model, path)
        if number % COAL_EVERY == 0:
            by_coal.append(free_by_coal(model, path))
        if ompl_every and number % ompl_every == 0:
            seconds = ompl_time(model, start, goal, arm)
            peer_failed += seconds is None
            if seconds is not None:
                peer.append(seconds)
                ours_beside.append(planning[-1])
    for what in unsolved[:10]:
        print("   unsolved:", *what)
    print(f"{robot_name}: {solved} of {valid} valid problems solved within 1 s; {wrong} paths fail the finer check")
    print(f"   by coal {sum(by_coal)} of {len(by_coal)} paths are free")
    for label, values in (("planning", planning), ("with simplifying", simplifying)):
        micro = 1e6 * np.array(values)
        median, tail = np.percentile(micro, [50, 95])
        print(f"   {label:<17} median {median:8.0f} µs   mean {micro.mean():8.0f}   95 % {tail:8.0f}")
    print(f"   path length       median {np.median(lengths):.2f} rad")
    if peer:
        ours, theirs = 1e6 * np.median(ours_beside), 1e6 * np.median(peer)
        print(
            f"   OMPL on {len(peer) + peer_failed} of them, {peer_failed} not solved in 10 s: median {theirs:.0f} µs, "
            f"ours {ours:.0f} µs, ratio {theirs / ours:.0f}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--per-set", type=int, default=50)
    parser.add_argument("--robots", nargs="*", default=["panda", "ur5"])
    parser.add_argument("--ompl-every", type=int, default=10, help="ask OMPL every so many problems; 0: never")
    options = parser.parse_args()
    if options.ompl_every and find_spec("ompl") is None:
        print("ompl is not installed (pip install ompl): no peer")
        options.ompl_every = 0
    set_threads(1)
    for robot in options.robots:
        run(robot, options.per_set, options.ompl_every)


if __name__ == "__main__":
    main()
