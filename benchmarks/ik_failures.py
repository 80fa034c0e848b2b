"""Why targets fail: the reason is right, and the nearest pose is as near as a long search finds.

Targets of known kind are made for each arm:

- out of reach: beyond the reach by 1 to 30 %;
- limits: poses of random configurations of the arm with its limits taken away, which the arm with limits does not reach
  in a long search from 3,000 starts;
- singular: poses at which the arm is singular (found as the nearest to targets far away), moved by 20 to 50 µm along
  the direction that is lost there, which a long search does not reach. Beside them, the same poses unmoved, which it
  must reach;
- collision: the frame inside a box, with the collision model as filter; no solution of any start is free;
- two arms: one target out of reach; targets which ask for opposite ends of the range of the joint that both share.

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

from .ik_chains import Arm, arm

SEARCHED = 100
"""Targets of each kind whose nearest pose is compared with a long search."""


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


def judge(a: Arm, kind: str, T: np.ndarray, right: set[IKStatus]) -> None:
    """Solve, and print the share of right reasons and of nearest poses that a long search does not beat by 1 %."""
    start = time.perf_counter()
    sol = ik.solve(a.robot, T, a.tip)
    seconds = (time.perf_counter() - start) / len(T)
    good = np.mean([status in right for status in sol.status] | sol.certified)  # certified: proven out of reach
    some = np.random.default_rng(1).permutation(len(T))[:SEARCHED]
    best = long_search(a.robot, T[some], a.tip)
    near = np.mean(cost(sol, prepare(a.robot, a.tip).reach)[some] <= best * 1.01 + 1e-13)
    print(
        f"{a.name:8} {kind:13} {len(T):5}: reason right {good:7.2%} ({sol.certified.mean():.0%} certified), nearest "
        f"within 1 % of a long search {near:.0%}, {seconds * 1e3:.2f} ms each"
    )


def out_of_reach(a: Arm, count: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    anchor = prepare(a.robot, a.tip).bound.anchor
    _, T = a.targets(count)
    away = T[:, :3, 3] - anchor
    reached = np.linalg.norm(a.targets(200_000, 9)[1][:, :3, 3] - anchor, axis=1).max()
    far = reached * rng.uniform(1.01, 1.3, (count, 1))
    T[:, :3, 3] = anchor + away / np.linalg.norm(away, axis=1, keepdims=True) * far
    return T


def unreached(a: Arm, T: np.ndarray) -> np.ndarray:
    """Those of the targets that a long search does not reach."""
    return T[~ik.solve(a.robot, T, a.tip, max_starts=3000, diagnose=False).success]


def outside_limits(a: Arm, count: int) -> np.ndarray:
    rng = np.random.default_rng(6)
    robot, chain = a.robot, prepare(a.robot, a.tip)
    wide = np.clip(np.stack([chain.lower, chain.upper]), -np.pi, np.pi)
    low, high = np.minimum(wide[0] - 0.6, -np.pi), np.maximum(wide[1] + 0.6, np.pi)
    found = np.zeros((0, 4, 4))
    for _ in range(40):
        q = np.tile(robot.home, (2 * count, 1))
        q[:, chain.free] = rng.uniform(low, high, (2 * count, chain.free.size))
        found = np.concatenate([found, unreached(a, robot.fk(q, a.tip))])
        if len(found) >= count or len(found) < 5:
            break
    return found[:count]


def singular(a: Arm, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Poses at which the arm is singular, and the same moved along the lost direction."""
    rng = np.random.default_rng(7)
    robot, moving = a.robot, list(a.robot.chain(a.tip))
    poses, moved = [], []
    for seed in range(40):
        _, T = a.targets(count, 100 + seed)
        T[:, :3, 3] *= rng.uniform(2.0, 6.0, (count, 1))
        sol = ik.solve(robot, T, a.tip)
        inner = ~sol.success & ~sol.limiting.any(axis=1)
        q, T = sol.q[inner], T[inner]
        U, sigma, _ = np.linalg.svd(robot.jacobian(q, a.tip)[..., moving])
        lost = U[:, :, 5]
        X = robot.fk(q, a.tip)
        out = np.sign(np.einsum("ni,ni->n", lost[:, :3], T[:, :3, 3] - X[:, :3, 3]))
        flat = (sigma[:, 5] < 1e-4) & (np.linalg.norm(lost[:, :3], axis=1) > 0.1)
        Y = X.copy()
        Y[:, :3, 3] += lost[:, :3] * (out * rng.uniform(20e-6, 50e-6, len(X)))[:, None]
        turn = lost[:, 3:] * (out * rng.uniform(20e-6, 50e-6, len(X)))[:, None]
        spin = np.zeros((len(X), 3, 3))
        spin[:, [2, 0, 1], [1, 2, 0]], spin[:, [1, 2, 0], [2, 0, 1]] = turn, -turn
        U, _, Vt = np.linalg.svd(np.eye(3) + spin)
        Y[:, :3, :3] = U @ Vt @ X[:, :3, :3]
        poses.append(X[flat])
        moved.append(Y[flat])
        if sum(map(len, moved)) >= 2 * count:
            break
    return np.concatenate(poses)[:count], unreached(a, np.concatenate(moved))[:count]


def collision(a: Arm, count: int) -> None:
    from apprehend.collision import Box, CollisionModel, RobotSource, Scene

    _, T = a.targets(200_000, 3)
    reach = prepare(a.robot, a.tip).reach
    centre, size = np.eye(4), np.full(3, 0.35 * reach)
    centre[:3, 3] = (0.45 * reach, 0.0, 0.35 * reach)
    inside = np.abs(T[:, :3, 3] - centre[:3, 3]).max(axis=1) < 0.4 * size[0]
    T = T[inside][:count]
    model = CollisionModel(a.robot, Scene(a.robot, RobotSource("in code"), boxes=(Box("block", size, centre),)))
    start = time.perf_counter()
    sol = ik.solve(a.robot, T, a.tip, accept=model.free)
    seconds = (time.perf_counter() - start) / len(T)
    right = np.mean(sol.codes == IKStatus.COLLISION.code)
    print(f"{a.name:8} collision     {len(T):5}: reason right {right:7.2%}, {seconds * 1e3:.2f} ms each")


def two_arms(count: int) -> None:
    """The two arms of TALOS on its torso."""
    from apprehend.robots import subtree

    a = arm("talos")
    robot = Robot(subtree(Robot.load(a.urdf).description, "torso_1_link"))
    tips = ("arm_left_7_link", "arm_right_7_link")
    rng = np.random.default_rng(8)
    limits = robot.limits
    shared = sorted(set(robot.chain(tips[0])) & set(robot.chain(tips[1])))
    q = rng.uniform(limits.lower, limits.upper, (2, 4 * count, robot.n))
    T = np.stack([robot.fk(q[i], tip) for i, tip in enumerate(tips)], axis=1)
    far = T[:count].copy()
    at = rng.integers(2, size=count)
    for k, tip in enumerate(tips):
        anchor = prepare(robot, tip).bound.anchor
        away = far[at == k, k, :3, 3] - anchor
        reached = np.linalg.norm(robot.fk(q[k], tip)[:, :3, 3] - anchor, axis=1).max()
        away *= (reached * rng.uniform(1.05, 1.4, len(away)) / np.linalg.norm(away, axis=1))[:, None]
        far[at == k, k, :3, 3] = anchor + away
    start = time.perf_counter()
    sol = ik.solve_frames(robot, far, tips)
    seconds = (time.perf_counter() - start) / count
    right = (sol.codes == IKStatus.OUT_OF_REACH.code) & (sol.at_fault == at)
    print(
        f"two arms, one out of reach {count:5}: reason and arm right {right.mean():7.2%}, {seconds * 1e3:.2f} ms each"
    )
    for joint in shared:
        q[0, :, joint], q[1, :, joint] = limits.lower[joint], limits.upper[joint]
    T = np.stack([robot.fk(q[i], tip) for i, tip in enumerate(tips)], axis=1)
    hard = ~ik.solve_frames(robot, T, tips, max_starts=1000, diagnose=False).success
    T = T[hard][:count]
    sol = ik.solve_frames(robot, T, tips)
    right = np.isin(sol.codes, (IKStatus.CONFLICT.code, IKStatus.LIMITS.code)) & (sol.at_fault < 0)
    print(f"two arms, torn             {len(T):5}: reason right {right.mean():7.2%}")
    near = compare_two(robot, tips, T[:SEARCHED], sol.q[:SEARCHED])
    print(f"two arms, torn: nearest within 1 % of a search with twenty times the starts {near:.0%}")


def compare_two(robot: Robot, tips: tuple[str, ...], T: np.ndarray, q: np.ndarray) -> float:
    """Share of joint vectors whose cost a long search does not beat by 1 %."""
    import apprehend.ik.tree  # noqa: F401

    module = sys.modules["apprehend.ik.tree"]
    chains = tuple(prepare(robot, tip) for tip in tips)

    def problem(start: np.ndarray) -> object:
        return module.TreeProblem(robot, tips, chains, T, np.full((len(tips), 6), 1e-6), start[:, None].copy(), 77)

    here = problem(q)
    rows = module._rows(here, np.arange(len(T)), True)
    ours = np.empty(len(T))
    from apprehend.kernels.ik_tree_nearest import descend_tree

    descend_tree(robot.model, rows.tasks, rows.data, rows.box, rows.scale, rows.lower, rows.upper, 1, 0, len(T),
                 q.copy(), ours)  # fmt: skip
    best = ours.copy()
    usual, module.WHY_STARTS = module.WHY_STARTS, 150
    try:
        for seed in range(8):
            start = np.random.default_rng(seed).uniform(robot.limits.lower, robot.limits.upper, q.shape)
            best = np.minimum(best, module.nearest_in_tree(problem(start), np.arange(len(T)))[1])
    finally:
        module.WHY_STARTS = usual
    return float(np.mean(ours <= best * 1.01 + 1e-12))


def report(name: str, count: int) -> None:
    a = arm(name)
    judge(a, "out of reach", out_of_reach(a, count), {IKStatus.OUT_OF_REACH})
    T = outside_limits(a, count)
    if len(T) >= 20:
        judge(a, "limits", T, {IKStatus.LIMITS})
    on, beyond = singular(a, count)
    if len(on):
        print(f"{name:8} at a singular {len(on):5}: solved {ik.solve(a.robot, on, a.tip).success.mean():7.2%}")
    if len(beyond) >= 20:
        judge(a, "singular", beyond, {IKStatus.SINGULAR})
    collision(a, count)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=["panda", "ur5", "baxter", "tiago", "z1"])
    parser.add_argument("--targets", type=int, default=1000)
    options = parser.parse_args()
    parallel.set_threads(1)
    for name in options.names:
        report(name, options.targets)
    two_arms(options.targets)


if __name__ == "__main__":
    main()
