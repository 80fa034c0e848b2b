"""Global inverse kinematics to 1e-6 m and rad within limits, on the arms of `ik_chains`, beside TRAC-IK and ik_LM.

The protocol is TRAC-IK's: poses of random configurations within the limits, no guess. Means include failures. Our
solutions are checked by Pinocchio's forward kinematics where it is installed.

    python -m benchmarks.ik_solve [NAME …] [--poses 10000] [--tolerance 1e-6]
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

import numpy as np

from apprehend import ik, parallel

from .ik_chains import CHAINS, Arm, arm


def timed_rounds(call: Any, rounds: int) -> tuple[float, Any]:
    """Median seconds of *call* and its last answer."""
    call()
    times = []
    answer = None
    for _ in range(rounds):
        start = time.perf_counter()
        answer = call()
        times.append(time.perf_counter() - start)
    return float(np.median(times)), answer


def checked_by_pinocchio(a: Arm, q: np.ndarray, T: np.ndarray) -> float | None:
    """Largest distance or angle of our solutions by an independent forward kinematics."""
    try:
        import pinocchio as pin
    except ImportError:
        return None
    model = pin.buildModelFromUrdf(str(a.urdf))
    data = model.createData()
    tip, base = model.getFrameId(a.tip), model.getFrameId(a.base)
    worst = 0.0
    for row, target in zip(q, T, strict=True):
        full = pin.neutral(model)
        for name, value in zip(a.robot.joint_names, row, strict=True):
            joint = model.joints[model.getJointId(name)]
            full[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
        pin.framesForwardKinematics(model, data, full)
        X = (data.oMf[base].inverse() * data.oMf[tip]).homogeneous
        gap = pin.log3(X[:3, :3] @ target[:3, :3].T)
        worst = max(worst, float(np.linalg.norm(X[:3, 3] - target[:3, 3])), float(np.linalg.norm(gap)))
    return worst


def trac_ik(a: Arm, T: np.ndarray, tolerance: float) -> tuple[float, float] | None:
    """Seconds per pose and share solved by TRAC-IK (5 ms limit), from the middle of the limits."""
    try:
        from trac_ik import TracIK

        solver = TracIK(a.base, a.tip, str(a.urdf), timeout=0.005, epsilon=tolerance)
        chain = list(a.robot.chain(a.tip))
        lower = np.where(np.isfinite(a.robot.limits.lower[chain]), a.robot.limits.lower[chain], -np.pi)
        upper = np.where(np.isfinite(a.robot.limits.upper[chain]), a.robot.limits.upper[chain], np.pi)
        solver.joint_limits = (lower.tolist(), upper.tolist())  # the wheel reads them from the file as zeros
    except Exception as error:  # a wheel that fails to load or to read the file is reported, not fatal
        print(f"    TRAC-IK does not run on {a.name}: {error}", file=sys.stderr)
        return None
    guess = 0.5 * (lower + upper)
    start = time.perf_counter()
    solved = sum(solver.ik(X[:3, 3], X[:3, :3], guess) is not None for X in T)
    return (time.perf_counter() - start) / len(T), solved / len(T)


def ik_lm(a: Arm, T: np.ndarray, tolerance: float) -> tuple[float, float] | None:
    """Seconds per pose and share solved by roboticstoolbox's compiled Levenberg–Marquardt, within limits."""
    try:
        import roboticstoolbox as rtb
    except Exception as error:
        print(f"    roboticstoolbox does not load: {error}", file=sys.stderr)
        return None
    model = a.robot.chain_model(a.tip)
    parts = []
    for i, place in enumerate(model.place):
        fixed = np.eye(4)
        fixed[:3, :3], fixed[:3, 3] = place[:9].reshape(3, 3), place[9:]
        parts.append(rtb.ET.SE3(fixed))
        if i < model.kind.size:
            c = model.coordinate[i]
            limits = np.clip([a.robot.limits.lower[c], a.robot.limits.upper[c]], -np.pi * 2, np.pi * 2)
            parts.append(rtb.ET.tz(qlim=limits) if model.kind[i] else rtb.ET.Rz(qlim=limits))
    ets = rtb.ETS(parts)
    start = time.perf_counter()
    solved = sum(
        bool(ets.ik_LM(X, tol=0.5 * tolerance**2, ilimit=30, slimit=100, joint_limits=True).success) for X in T
    )
    return (time.perf_counter() - start) / len(T), solved / len(T)


def report(a: Arm, count: int, tolerance: float = 1e-6) -> None:
    _, T = a.targets(count)
    call = lambda: ik.solve(a.robot, T, a.tip, tolerance=tolerance)  # noqa: E731
    parallel.set_threads(1)
    one, sol = timed_rounds(call, 5)
    parallel.set_threads(2)
    two, _ = timed_rounds(call, 5)
    worst = checked_by_pinocchio(a, sol.q[sol.success], T[sol.success])
    inside = bool(a.robot.limits.contains(sol.q).all())
    chain = len(a.robot.chain(a.tip))
    print(
        f"{a.name:12} {chain} joints: {1e2 * sol.success.mean():8.3f} % in {one / count * 1e6:6.2f} µs on one thread, "
        f"{count / two:9,.0f} solutions/s on two; limits kept: {inside}; "
        f"worst by Pinocchio: {'not installed' if worst is None else f'{worst:.1e}'}"
    )
    for name, peer in (("TRAC-IK", trac_ik), ("ik_LM", ik_lm)):
        answer = peer(a, T[:300], tolerance)
        if answer is not None:
            seconds, share = answer
            print(
                f"    {name:9} {1e2 * share:8.2f} % in {seconds * 1e6:8.1f} µs: {seconds / (one / count):6.0f} × ours"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=list(CHAINS))
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--tolerance", type=float, default=1e-6)
    options = parser.parse_args()
    for name in options.names:
        report(arm(name), options.poses, options.tolerance)


if __name__ == "__main__":
    main()
