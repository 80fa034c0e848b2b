"""One differential step with three prioritised tasks and limits on the Panda: alone, and in batches.

The targets lie about one step away, so that some steps meet a velocity or position limit and most do not; then the same
with far targets, where nearly every step saturates. What is promised is checked over a million steps: no limit is
exceeded by more than 1e-12, and no lower task changes what a higher one gets by more than 1e-9.

    python -m benchmarks.ik_step [--steps 1000000]
"""

from __future__ import annotations

import argparse

import numpy as np

from apprehend import Robot, ik, parallel

from ._harness import interleave, table
from .ik_chains import arm

DT = 0.01


def seven_joints() -> tuple[Robot, str]:
    """The Panda's arm without its fingers, ending at the hand."""
    from apprehend.robots import without

    a = arm("panda")
    description = a.robot.description
    fingers = [j.child for j in description.joints if "finger" in j.name]
    for link in fingers:
        if link in description.links:
            description = without(description, link)
    robot = Robot(description)
    return robot, a.tip


def problem(robot: Robot, tip: str, count: int, far: float, seed: int) -> tuple[np.ndarray, list[ik.Task]]:
    rng = np.random.default_rng(seed)
    q = rng.uniform(robot.limits.lower, robot.limits.upper, (count, robot.n))
    goal = robot.limits.clip(q + rng.normal(size=q.shape) * far)
    T = robot.fk(goal, tip)
    return q, [
        ik.PositionTask(tip, T[:, :3, 3]),
        ik.DirectionTask(tip, T[:, :3, 2]),
        ik.PostureTask(robot.home, gain=0.01),
    ]


def check(robot: Robot, tip: str, count: int) -> None:
    over = disturbed = share = 0.0
    block = 20_000
    for seed in range(max(count // block, 1)):
        q, tasks = problem(robot, tip, block, 0.02 if seed % 2 else 0.5, seed)
        dq = ik.step(robot, q, tasks, DT)
        limits = robot.limits
        over = max(
            over,
            float(np.maximum(q + dq - limits.upper, limits.lower - q - dq).max()),
            float((np.abs(dq) - limits.velocity * DT).max()),
        )
        share += float((np.abs(dq) >= limits.velocity * DT - 1e-12).any(axis=1).mean()) / (count // block)
        J = robot.jacobian(q, tip)
        first = ik.step(robot, q, tasks[:1], DT)
        second = ik.step(robot, q, tasks[:2], DT)
        z = robot.fk(q, tip)[:, :3, 2]
        disturbed = max(
            disturbed,
            float(np.abs(np.einsum("nij,nj->ni", J[:, :3], dq - first)).max()),
            float(np.abs(np.cross(np.einsum("nij,nj->ni", J[:, 3:], dq - second), z)).max()),
        )
    print(
        f"{count:,} steps ({share:.0%} at a velocity limit): limits exceeded by at most {over:.1e}, "
        f"higher tasks disturbed by at most {disturbed:.1e}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=1_000_000)
    options = parser.parse_args()
    robot, tip = seven_joints()
    contenders = {}
    count = 20_000
    for name, far in (("near targets", 0.005), ("far targets, all saturated", 0.5)):
        q, tasks = problem(robot, tip, count, far, 1)
        for threads in (1, 2):
            stepper = ik.Stepper(robot, tasks, DT)

            def run(stepper: ik.Stepper = stepper, q: np.ndarray = q, threads: int = threads) -> None:
                parallel.set_threads(threads)
                stepper(q)

            contenders[f"{name}, batch, {threads} thread{'s' * (threads > 1)}"] = (run, count)
    one, tasks = problem(robot, tip, 1, 0.005, 2)
    alone = ik.Stepper(robot, tasks, DT)
    contenders["alone, prepared (Stepper)"] = (lambda: [alone(one[0]) for _ in range(200)], 200)

    def anew() -> None:
        for _ in range(200):
            made = [
                ik.PositionTask(tip, place),
                ik.DirectionTask(tip, way),
                ik.PostureTask(robot.home, gain=0.01),
            ]
            ik.step(robot, one[0], made, DT)

    place, way = tasks[0].position[0].copy(), tasks[1].direction[0].copy()
    contenders["alone, tasks made anew (step)"] = (anew, 200)
    table(
        f"{robot.n} joints, position, direction and posture, per step",
        interleave(contenders, 5),
        "near targets, batch, 1 thread",
    )
    parallel.set_threads(1)
    check(robot, tip, options.steps)


if __name__ == "__main__":
    main()
