"""Planning while a constraint holds: a mug that stays upright, a tool that stays in a box or keeps its orientation.

Random problems: an arm with a cylinder (the mug) in its hand at a table with a wall across and three posts, from a
random configuration on one side of the wall to a pose of the tool on the other (up to eight goals). Motions of our
paths are proven to keep the constraint and to be free; here every path is checked again at steps of 0.002 rad, its
constraint by forward kinematics and the definition, its freedom by the exact shapes.

Beside it OMPL's RRT-Connect in its projected state space, with the same constraint (how far values are beyond their
bounds, and the derivative) and the same validity function, both called from Python; its motions are sampled at steps
of 0.05 rad and may violate the constraint by 1 mrad or mm.
"""

from __future__ import annotations

import argparse
import time
from importlib.util import find_spec
from typing import Any

import numpy as np

from apprehend import ik
from apprehend.collision import CollisionModel, Convex
from apprehend.kinematics import Robot
from apprehend.parallel import set_threads
from apprehend.planning import Constraints, Inside, Turned, Upright, plan

TOOLS = {"panda": "panda_hand_tcp", "ur5e": "tool0"}
SIDEWAYS = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # the hand reaches forward, the mug stands
LIMIT = 1.0
ROUNDS = 3


def tasks(frame: str) -> dict[str, list[Any]]:
    upright = Upright(frame, axis=(1.0, 0.0, 0.0), angle=0.2)
    box = Inside(frame, (0.15, -0.7, 0.05), (0.9, 0.7, 0.6))
    return {
        "mug upright": [upright],
        "mug upright in a box": [upright, box],
        "tool in a box": [box],
        "orientation kept": [Turned(frame, SIDEWAYS, 0.15)],
    }


def at(x: float, y: float, z: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def surroundings(bare: CollisionModel, rng: np.random.Generator) -> CollisionModel:
    height = rng.uniform(0.2, 0.45)
    model = bare.add("wall", [Convex.box([0.4, 0.04, height])], at(0.6, 0.0, 0.5 * height))
    for k in range(3):
        x, y, tall = rng.uniform(0.3, 0.8), rng.uniform(0.1, 0.5) * rng.choice([-1, 1]), rng.uniform(0.1, 0.5)
        model = model.add(f"post {k}", [Convex.box([0.08, 0.08, tall])], at(x, y, 0.5 * tall))
    return model


def start_of(model: CollisionModel, keep: Constraints, frame: str, side: float, rng: np.random.Generator) -> np.ndarray:
    """A random free configuration on the constraint, with the tool on one *side* of the wall above the table."""
    robot = model.robot
    lower, upper = np.maximum(robot.limits.lower, -np.pi), np.minimum(robot.limits.upper, np.pi)
    while True:
        q, good = keep.project(rng.uniform(lower, upper, (2000, robot.n)), lower, upper)
        p = robot.fk(q, frame)[:, :3, 3]
        good &= (p[:, 0] > 0.25) & (p[:, 0] < 0.85) & (side * p[:, 1] > 0.15) & (p[:, 2] > 0.08) & (p[:, 2] < 0.5)
        good[good] &= model.free(q[good])
        if good.any():
            return q[np.argmax(good)]


def goals_of(model: CollisionModel, keep: Constraints, frame: str, rng: np.random.Generator) -> np.ndarray:
    """Up to eight configurations that hold the tool in one pose on the other side."""
    robot = model.robot
    T = robot.fk(start_of(model, keep, frame, -1.0, rng), frame)
    q = ik.solve(robot, T[None], frame, n_solutions=8, rng=rng).solutions(0)
    good = model.free(q) & (keep.violation(q) == 0.0)
    return q[good] if good.any() else goals_of(model, keep, frame, rng)


def problems(name: str, title: str, count: int, seed: int):
    robot, frame = Robot.load(name), TOOLS[name]
    rng = np.random.default_rng(seed)
    mug = at(0.0, 0.0, 0.0)
    mug[:3, :3] = SIDEWAYS  # its axis along x of the frame
    mug[2, 3] = 0.06 if name == "ur5e" else 0.0
    bare = CollisionModel(robot).add("table", [Convex.box([1.4, 1.6, 0.04])], at(0.5, 0.0, -0.05))
    touching = [link for link in bare.names if "finger" in link or "hand" in link]
    bare = bare.attach([Convex.cylinder(0.035, 0.09)], frame, mug, name="mug", touching=touching or None)
    keep = Constraints(robot, tasks(frame)[title])
    for _ in range(count):
        model = surroundings(bare, rng)
        yield model, keep, start_of(model, keep, frame, 1.0, rng), goals_of(model, keep, frame, rng)


def recheck(model: CollisionModel, keep: Constraints, path: np.ndarray) -> tuple[float, bool]:
    """By how much a path violates its constraints, sampled finely, and whether it hits anything."""
    worst, free = 0.0, True
    for a, b in zip(path[:-1], path[1:], strict=True):
        steps = int(np.ceil(np.linalg.norm(b - a) / 0.002)) + 1
        q = a + np.linspace(0.0, 1.0, steps)[:, None] * (b - a)
        for item in keep.items:
            value, _ = item.values(model.robot.fk(q, item.frame))
            low, high = item.bounds
            worst = max(worst, float(np.maximum(low - value, value - high).max()))
        free &= bool((model.distance(q) > -model.resolution).all())
    return worst, free


def ompl_time(model: CollisionModel, keep: Constraints, start: np.ndarray, goals: np.ndarray) -> float | None:
    """Seconds of OMPL's RRT-Connect on the constraint; None: not solved within `LIMIT`."""
    from ompl import base, geometric, util

    util.setLogLevel(util.LogLevel.LOG_NONE)
    n = model.robot.n
    lower, upper = model.robot.limits.lower, model.robot.limits.upper
    bounds = [item.bounds for item in keep.items]
    low, high = (np.concatenate([b[k] for b in bounds]) for k in (0, 1))

    def values(q: np.ndarray) -> np.ndarray:
        rows = keep.values(q)
        return np.concatenate([row[: len(b[0])] for row, b in zip(rows, bounds, strict=True)])

    class Kept(base.Constraint):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(n, len(low), 1e-3)

        def function(self, q: np.ndarray, out: np.ndarray) -> None:
            v = values(np.array(q))
            out[:] = np.maximum(v - high, 0.0) - np.maximum(low - v, 0.0)

        def jacobian(self, q: np.ndarray, out: np.ndarray) -> None:
            q, first = np.array(q), 0
            for item in keep.items:
                value, rows = item.values(model.robot.fk(q, item.frame))
                J = rows @ model.robot.jacobian(q, item.frame, "mixed")
                off = (value < item.bounds[0]) | (value > item.bounds[1])
                out[first : first + len(value)] = J * off[:, None]
                first += len(value)

    ambient, box = base.RealVectorStateSpace(n), base.RealVectorBounds(n)
    for j in range(n):
        box.setLow(j, float(lower[j]))
        box.setHigh(j, float(upper[j]))
    ambient.setBounds(box)
    constraint = Kept()
    space = base.ProjectedStateSpace(ambient, constraint)
    information = base.ConstrainedSpaceInformation(space)
    space.setDelta(0.05)
    setup = geometric.SimpleSetup(information)
    setup.setStateValidityChecker(lambda state: bool(model.free(np.array([state[j] for j in range(n)]))))
    ends = [space.allocState() for _ in range(1 + len(goals))]
    for state, q in zip(ends, (start, *goals), strict=True):
        state.copy([float(v) for v in q])
    setup.setStartState(ends[0])
    targets = base.GoalStates(information)
    for state in ends[1:]:
        targets.addState(state)
    setup.setGoal(targets)
    planner = geometric.RRTConnect(information)
    planner.setRange(0.8)
    setup.setPlanner(planner)
    began = time.perf_counter()
    setup.solve(LIMIT)
    return time.perf_counter() - began if setup.haveExactSolutionPath() else None


def run(name: str, title: str, count: int, peer: bool, seed: int) -> None:
    planning, shortened, theirs, violations, lengths, free, theirs_only = [], [], [], [], [], 0, 0
    for number, (model, keep, start, goals) in enumerate(problems(name, title, count, seed)):
        if number == 0:
            plan(model, start, goals, rng=np.random.default_rng(0), constraints=keep.items, time_limit=LIMIT)
        seconds = {False: [], True: []}
        for simplify in (False, True) * ROUNDS:
            rng = np.random.default_rng(number)
            result = plan(model, start, goals, rng=rng, constraints=keep.items, time_limit=LIMIT, simplify=simplify)
            if result.success:
                seconds[simplify].append(result.seconds)
        if result.success:
            planning.append(min(seconds[False]))
            shortened.append(min(seconds[True]))
            worst, good = recheck(model, keep, result.path)
            violations.append(worst)
            free += good
            lengths.append(result.length)
        if peer:
            theirs.append(ompl_time(model, keep, start, goals))
            theirs_only += theirs[-1] is not None and not result.success
    if not planning:
        print(f"{name:<6} {title:<21}   0 of {count} solved")
        return
    ours, tail = np.percentile(1e3 * np.array(planning), [50, 95])
    median = 1e3 * np.median(shortened)
    print(f"{name:<6} {title:<21} {len(planning):3} of {count} solved   {ours:7.2f} ms   95 % {tail:7.1f}", end="")
    print(f"   shortened {median:7.2f}   length {np.median(lengths):5.2f}   worst {max(violations):.1e}", end="")
    print(f"   free {free}/{len(planning)}")
    if peer:
        solved = [t for t in theirs if t is not None]
        # those that it did not solve within the limit count as the limit
        mid = 1e3 * np.median([LIMIT if t is None else t for t in theirs])
        print(f"{'':6} {'OMPL':<21} {len(solved):3} of {count} solved   {mid:7.1f} ms   ratio {mid / ours:.0f}", end="")
        print(f"   solved by OMPL only: {theirs_only}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=20, help="problems of each kind")
    parser.add_argument("--robots", nargs="*", default=list(TOOLS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-peer", action="store_true")
    options = parser.parse_args()
    peer = not options.no_peer
    if peer and find_spec("ompl") is None:
        print("ompl is not installed (pip install ompl): no peer")
        peer = False
    set_threads(1)
    for name in options.robots:
        for title in tasks(TOOLS[name]):
            run(name, title, options.count, peer, options.seed)


if __name__ == "__main__":
    main()
