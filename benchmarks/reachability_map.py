"""Reachability map of the Panda: building it, asking it, and how far it agrees with inverse kinematics.

    python -m benchmarks.reachability_map

The peer for building is the same sampling with Pinocchio called from Python for the pose and the Jacobian (the cells
entered with NumPy, all at once); for asking, our own inverse kinematics and TRAC-IK on the same poses.
"""

from __future__ import annotations

import numpy as np

from apprehend import ReachabilityMap, Robot, ik, parallel
from apprehend.workspace.accuracy import random_poses

from ._harness import interleave, seconds, table

FRAME = "panda_hand"
SAMPLES = 1 << 20
PEER = 5_000
POSES = 100_000


def with_pinocchio(robot: Robot, reach: ReachabilityMap) -> object:
    """The same samples by Pinocchio, one call each."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(robot.description.source))
    data, frame = model.createData(), model.getFrameId(FRAME)
    q = np.random.default_rng(0).uniform(model.lowerPositionLimit, model.upperPositionLimit, (PEER, model.nq))

    def run() -> None:
        T, best = np.empty((PEER, 4, 4)), np.empty(PEER)
        for i, row in enumerate(q):
            pin.computeJointJacobians(model, data, row)
            pin.updateFramePlacement(model, data, frame)
            J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            T[i], best[i] = data.oMf[frame].homogeneous, np.linalg.det(J @ J.T)
        cells = reach.cells(T)
        np.maximum.at(np.zeros(reach.hits.size, np.float32), cells, np.sqrt(np.maximum(best, 0.0)))

    return run


def main() -> None:
    robot = Robot.load("panda")
    reach = ReachabilityMap.build(robot, FRAME)
    print(f"{reach.counts.samples / 1e6:.0f} million samples, coverage {reach.coverage:.1%}")
    print(f"on 50,000 random poses in its box: {reach.accuracy(50_000, rng=np.random.default_rng(0))}")
    for threads in (1, 2):
        parallel.set_threads(threads)
        timings = interleave(
            {
                "ours": (lambda: ReachabilityMap.build(robot, FRAME, samples=SAMPLES), SAMPLES),
                "Pinocchio from Python": (with_pinocchio(robot, reach), PEER),  # type: ignore[dict-item]
            },
            rounds=3,
        )
        table(f"one sample (pose, manipulability, cell), {threads} thread(s)", timings, "ours")
    parallel.set_threads(1)
    T = random_poses(reach, POSES, np.random.default_rng(1))
    contenders = {
        "map": (lambda: reach.reachable(T), POSES),
        "ik.solve": (lambda: ik.solve(robot, T[:5000], FRAME, diagnose=False, max_starts=20), 5000),
    }
    try:
        from trac_ik import TracIK

        solver = TracIK("panda_link0", FRAME, str(robot.description.source), timeout=0.005, epsilon=1e-6)
        contenders["TRAC-IK"] = (lambda: [solver.ik(M[:3, 3], M[:3, :3]) for M in T[:50]], 50)
    except ImportError:
        print("TRAC-IK is not installed; left out")
    table("is a pose reachable? one thread", interleave(contenders, rounds=5), "map")
    targets = robot.fk(robot.home, FRAME)[None]
    placed = interleave({"placements": (lambda: reach.base_placements(targets), 1)}, rounds=5)["placements"]
    print(f"\nbest ten of {reach.base_placements(targets).tried} base poses, confirmed by IK: {seconds(placed.median)}")


if __name__ == "__main__":
    main()
