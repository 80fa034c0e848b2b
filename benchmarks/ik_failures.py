"""Why targets fail: the reason is right, and the nearest pose is as near as a long search finds.

Targets of known kind are made for each arm: out of reach (beyond the reach by 1 to 30 %), outside the limits (poses of
random configurations of the arm with its limits taken away, which the arm with limits does not reach in a long search
from 3,000 starts), and refused by a collision check.

    python -m benchmarks.ik_failures [NAME …] [--targets 1000]
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from apprehend import Robot, ik, parallel
from apprehend.ik import IKStatus
from apprehend.ik.chain import prepare

from .ik_chains import arm


def cost(sol: ik.IKResult, reach: float) -> np.ndarray:
    """What the nearest pose minimises."""
    return 0.5 * (sol.residual[:, 0] / reach) ** 2 + 1.0 - np.cos(sol.residual[:, 1])


def long_search(robot: Robot, T: np.ndarray, frame: str) -> np.ndarray:
    """Costs of the nearest poses by a search with fifty times as many starts."""
    import apprehend.ik.diagnose  # noqa: F401

    module = sys.modules["apprehend.ik.diagnose"]
    chain = prepare(robot, frame)
    usual = module.NEAREST_STARTS, module.NEAREST_STEPS
    module.NEAREST_STARTS, module.NEAREST_STEPS = 50 * usual[0], 3 * usual[1]
    try:
        return module.nearest(chain, chain.targets(T), None, 12345)[1]
    finally:
        module.NEAREST_STARTS, module.NEAREST_STEPS = usual


def report(name: str, count: int) -> None:
    a = arm(name)
    robot, frame = a.robot, a.tip
    rng = np.random.default_rng(5)
    chain = prepare(robot, frame)
    _, T = a.targets(count)
    out = T.copy()
    away = T[:, :3, 3] - chain.bound.anchor
    reached = np.linalg.norm(a.targets(20_000, 9)[1][:, :3, 3] - chain.bound.anchor, axis=1).max()
    out[:, :3, 3] = chain.bound.anchor + away / np.linalg.norm(away, axis=1, keepdims=True) * reached * rng.uniform(
        1.01, 1.3, (count, 1)
    )
    start = time.perf_counter()
    sol = ik.solve(robot, out, frame)
    seconds = (time.perf_counter() - start) / count
    right = np.mean(sol.codes == IKStatus.OUT_OF_REACH.code)
    some = rng.permutation(count)[:100]
    best = long_search(robot, out[some], frame)
    near = np.mean(cost(sol, chain.reach)[some] <= best * 1.01 + 1e-12)
    print(
        f"{name:8} out of reach: reason right {right:.1%} ({sol.certified.mean():.0%} certified), nearest within 1 % "
        f"of a long search {near:.0%}, {seconds * 1e3:.2f} ms each"
    )
    wide = np.clip(np.stack([chain.lower, chain.upper]), -np.pi, np.pi)
    q = np.tile(robot.home, (6 * count, 1))
    q[:, chain.free] = rng.uniform(
        np.minimum(wide[0] - 0.6, -np.pi), np.maximum(wide[1] + 0.6, np.pi), (6 * count, chain.free.size)
    )
    T = robot.fk(q, frame)
    hard = ~ik.solve(robot, T, frame, max_starts=3000, diagnose=False).success
    T = T[hard][:count]
    if len(T) >= 20:
        start = time.perf_counter()
        sol = ik.solve(robot, T, frame)
        seconds = (time.perf_counter() - start) / len(T)
        right = np.mean(sol.codes == IKStatus.LIMITS.code)
        best = long_search(robot, T[:100], frame)
        near = np.mean(cost(sol, chain.reach)[:100] <= best * 1.01 + 1e-12)
        print(
            f"{name:8} limits ({len(T)}): reason right {right:.1%}, nearest within 1 % of a long search {near:.0%}, "
            f"{seconds * 1e3:.2f} ms each"
        )
    _, T = a.targets(count)
    sol = ik.solve(robot, T, frame, accept=lambda q: np.zeros(len(q), dtype=bool))
    print(f"{name:8} collision: reason right {np.mean(sol.codes == IKStatus.COLLISION.code):.1%}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=["panda", "ur5", "baxter", "tiago", "z1"])
    parser.add_argument("--targets", type=int, default=1000)
    options = parser.parse_args()
    parallel.set_threads(1)
    for name in options.names:
        report(name, options.targets)


if __name__ == "__main__":
    main()
