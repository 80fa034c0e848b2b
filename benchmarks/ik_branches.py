"""Closed forms: all branches of UR5- and Puma-like arms, beside EAIK on the same poses in the same run.

And of an arm whose six axes lie anywhere, which subproblems do not decompose (on a fiftieth of the poses).

python -m benchmarks.ik_branches [--poses 100000]
"""

from __future__ import annotations

import argparse

import numpy as np

from apprehend import Robot, ik, parallel
from apprehend.ik.structure import lines
from apprehend.robots.description import Description, Joint, JointLimits, JointType, Link

from ._harness import interleave, table
from .ik_chains import arm


def puma() -> Robot:
    """The Puma 560 by its standard Denavit–Hartenberg table (Corke)."""
    rows = [
        (0.672, 0.0, 90),
        (0.0, 0.4318, 0),
        (0.15005, 0.0203, -90),
        (0.4318, 0.0, 90),
        (0.0, 0.0, -90),
        (0.0, 0.0, 0),
    ]
    names = ["base", *(f"link{i}" for i in range(6))]
    joints = []
    T = np.eye(4)
    for i, (d, a, alpha) in enumerate(rows):
        joints.append(Joint(f"j{i}", JointType.REVOLUTE, names[i], names[i + 1], T, limits=JointLimits(-np.pi, np.pi)))
        c, s = np.cos(np.radians(alpha)), np.sin(np.radians(alpha))
        T = np.array([[1, 0, 0, a], [0, c, -s, 0], [0, s, c, d], [0, 0, 0, 1.0]])
    joints.append(Joint("tool", JointType.FIXED, names[-1], "tool0", T))
    names.append("tool0")
    return Robot(Description("puma560", "base", {n: Link(n) for n in names}, tuple(joints)))


def anywhere() -> Robot:
    """Six revolute joints with random axes."""
    rng = np.random.default_rng(1)
    links = ["base", *(f"link{i}" for i in range(6))]
    joints = []
    for i in range(6):
        T = np.eye(4)
        T[:3, 3] = rng.normal(size=3) * 0.25
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        limits = JointLimits(-np.pi, np.pi)
        joints.append(Joint(f"j{i}", JointType.REVOLUTE, links[i], links[i + 1], T, axis, limits))
    return Robot(Description("anywhere", "base", {n: Link(n) for n in links}, tuple(joints)))


def report(name: str, robot: Robot, frame: str, count: int) -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (count, 6))
    T = robot.fk(q, frame)
    sol = ik.branches(robot, T, frame, limits=False)
    gap = np.abs((sol.q - q[:, None] + np.pi) % (2 * np.pi) - np.pi).max(axis=2)
    gap = np.where(sol.valid, gap, np.inf).min(axis=1)
    sample = rng.permutation(count)[:2000]
    worst = max(np.abs(robot.fk(sol.solutions(i), frame) - T[i]).max() for i in sample)
    print(
        f"{name}: {sol.family}; the generating joint vector is among the branches in {np.mean(gap < 1e-5):.4%} of "
        f"{count:,}; largest residual {sol.residual.max():.1e}, by forward kinematics {worst:.1e}; "
        f"{sol.found.mean():.2f} branches per pose"
    )
    contenders = {}
    for threads in (1, 2):

        def ours(threads: int = threads) -> None:
            parallel.set_threads(threads)
            ik.branches(robot, T, frame, limits=False)

        contenders[f"ours, {threads} thread{'s' * (threads > 1)}"] = (ours, count)
    try:
        import eaik.pybindings.EAIK as EAIK

        g = lines(robot.chain_model(frame))
        P = np.vstack([g.o[:1], np.diff(g.o, axis=0)])
        peer = EAIK.Robot(g.h.T, P.T, g.R0, [], True)
        few = T[:5000]
        peer.calculate_IK(few[0])
        contenders["EAIK, one by one from Python"] = (lambda: [peer.calculate_IK(X) for X in few], len(few))
    except Exception as error:
        print(f"    EAIK does not run: {error}")
    table(f"{name}, all branches, per pose", interleave(contenders, 5), "ours, 1 thread")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=100_000)
    count = parser.parse_args().poses
    ur5 = arm("ur5")
    report("UR5", ur5.robot, ur5.tip, count)
    report("Puma 560", puma(), "tool0", count)
    report("axes anywhere", anywhere(), "link5", max(count // 50, 100))


if __name__ == "__main__":
    main()
