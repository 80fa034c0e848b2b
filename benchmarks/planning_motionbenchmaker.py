"""The MotionBenchMaker problems (Chamzas et al. 2022): time to plan and to simplify, and every path checked again.

Robots are modelled by the spheres that come with the problems (Panda), or by their meshes (UR5). Published times on
the same Panda problems, with planning code compiled for that robot on a Ryzen 7950X (Thomason, Kingston & Kavraki
2024): 699 of 700 solved (VAMP's 100 per set), median 35 µs, mean 76 µs, 95 % 343 µs.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from apprehend.collision import CollisionModel, Convex
from apprehend.kinematics import Robot
from apprehend.parallel import set_threads
from apprehend.planning import plan, shortcut

REFERENCE = Path(__file__).resolve().parents[2] / "shared" / "reference"
FINER = 100
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


def timed(model: CollisionModel, start: np.ndarray, goal: np.ndarray, arm: list[int], seed: int):
    """One attempt: the answer, the simplified path, and the seconds for either."""
    rng = np.random.default_rng(seed)
    began = time.perf_counter()
    result = plan(model, start, goal, rng=rng, time_limit=1.0, joints=arm, simplify=False)
    middle = time.perf_counter()
    path = shortcut(model, result.path, rng=rng) if result.success else result.path
    return result, path, middle - began, time.perf_counter() - middle


def run(robot_name: str, per_set: int, seed: int = 0) -> None:
    data = json.loads((REFERENCE / f"motionbenchmaker_{robot_name}.json").read_text())
    robot = Robot.load(REFERENCE / "models" / f"{robot_name}.urdf") if robot_name == "ur5" else Robot.load("panda")
    bare = CollisionModel(robot, geometry=panda_geometry(data) if robot_name == "panda" else None)
    planning, simplifying, solved, valid, wrong, lengths = [], [], 0, 0, 0, []
    example = next(iter(data["problems"].values()))[0]
    names = {name: robot.index(name) for name in example["start"] if name in robot.joint_names}
    arm = [robot.index(name) for name in example["goal"]]
    unsolved = []
    for set_name, problems in data["problems"].items():
        for problem in problems[:per_set]:
            model = bare
            for k, entry in enumerate(problem["obstacles"]):
                shape, T = obstacle(entry)
                model = model.add(f"{entry['name']} {k}", [shape], T)
            start = np.zeros(robot.n)
            for name, j in names.items():
                start[j] = problem["start"][name]
            goal = start.copy()
            for name, value in problem["goal"].items():
                goal[robot.index(name)] = value
            if not model.free(np.array([start, goal])).all():
                continue
            valid += 1
            rounds = [timed(model, start, goal, arm, seed) for _ in range(ROUNDS)]
            result, path, _, _ = rounds[0]
            if not result.success:
                unsolved.append((set_name, problem["index"], result.explain()))
                continue
            solved += 1
            planning.append(min(r[2] for r in rounds))
            simplifying.append(min(r[2] + r[3] for r in rounds))
            lengths.append(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
            wrong += not recheck(model, path)
    for what in unsolved[:10]:
        print("   unsolved:", *what)
    print(f"{robot_name}: {solved} of {valid} valid problems solved within 1 s; {wrong} paths fail the finer check")
    for label, values in (("planning", planning), ("with simplifying", simplifying)):
        micro = 1e6 * np.array(values)
        median, tail = np.percentile(micro, [50, 95])
        print(f"   {label:<17} median {median:8.0f} µs   mean {micro.mean():8.0f}   95 % {tail:8.0f}")
    print(f"   path length       median {np.median(lengths):.2f} rad")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--per-set", type=int, default=50)
    parser.add_argument("--robots", nargs="*", default=["panda", "ur5"])
    options = parser.parse_args()
    set_threads(1)
    for robot in options.robots:
        run(robot, options.per_set)


if __name__ == "__main__":
    main()
