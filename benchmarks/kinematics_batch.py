"""Panda, 100,000 configurations: ours on one and two threads against Pinocchio called from Python, and equal to it.

python -m benchmarks.kinematics_batch
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from apprehend import parallel
from apprehend.kinematics import Robot

from ._harness import interleave, table

BATCH = 100_000
PEER = 4_000
FRAME = "panda_hand"


def peers(robot: Robot) -> tuple[object, ...]:
    """Pinocchio's model of the same file, fingers as one coordinate each, and its joint order."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(robot.description.source))
    return pin, model, model.createData(), model.getFrameId(FRAME)


def main() -> None:
    full = Robot.load("panda")
    pin, model, data, frame = peers(full)
    locked = [model.getJointId(name) for name in model.names if "finger" in name]
    model = pin.buildReducedModel(model, locked, pin.neutral(model))
    data = model.createData()
    frame = model.getFrameId(FRAME)
    robot = arm_only(full)
    rng = np.random.default_rng(0)
    q = rng.uniform(robot.limits.lower, robot.limits.upper, (BATCH, robot.n))
    qd, qdd = rng.normal(size=(2, BATCH, robot.n))
    tau = robot.inverse_dynamics(q, qd, qdd)
    few = [list(x[:PEER]) for x in (q, qd, qdd, tau)]
    print("largest difference from Pinocchio over 500 configurations")
    for name, error in differences(robot, pin, model, data, frame, q[:500], qd[:500], qdd[:500]).items():
        print(f"  {name:<18} {error:.1e}")

    def looped(call: Callable[..., object], *columns: list[np.ndarray]) -> Callable[[], None]:
        def run() -> None:
            for row in zip(*columns, strict=True):
                call(*row)

        return run

    aligned = pin.LOCAL_WORLD_ALIGNED
    tasks: list[tuple[str, Callable[[], object], Callable[[], None]]] = [
        ("FK", lambda: robot.fk(q, FRAME), looped(lambda x: pin.framesForwardKinematics(model, data, x), few[0])),
        (
            "FK + Jacobian",
            lambda: robot.fk_jacobian(q, FRAME),
            looped(lambda x: fk_jacobian(pin, model, data, x, frame, aligned), few[0]),
        ),
        (
            "inverse dynamics",
            lambda: robot.inverse_dynamics(q, qd, qdd),
            looped(lambda *x: pin.rnea(model, data, *x), *few[:3]),
        ),
        ("mass matrix", lambda: robot.mass_matrix(q), looped(lambda x: pin.crba(model, data, x), few[0])),
        (
            "forward dynamics",
            lambda: robot.forward_dynamics(q, qd, tau),
            looped(lambda a, b, c: pin.aba(model, data, a, b, c), few[0], few[1], few[3]),
        ),
    ]
    for name, ours, peer in tasks:

        def on(threads: int, call: Callable[[], object] = ours) -> Callable[[], object]:
            def run() -> object:
                parallel.set_threads(threads)
                return call()

            return run

        timings = interleave(
            {
                "ours, 1 thread": (on(1), BATCH),
                "ours, 2 threads": (on(2), BATCH),
                "Pinocchio from Python": (peer, PEER),
            },
            rounds=9,
        )
        table(name, timings, "ours, 1 thread")
    parallel.set_threads(2)


def arm_only(robot: Robot) -> Robot:
    """The arm with its fingers held at zero."""
    import dataclasses

    from apprehend.robots import JointType

    joints = tuple(
        dataclasses.replace(j, type=JointType.FIXED, mimic=None) if "finger" in j.name else j
        for j in robot.description.joints
    )
    return Robot(dataclasses.replace(robot.description, joints=joints))


def fk_jacobian(pin, model, data, x, frame, aligned):  # type: ignore[no-untyped-def]
    """What gives both the pose and the Jacobian of a frame: one call for the Jacobian, which also places the frame."""
    J = pin.computeFrameJacobian(model, data, x, frame, aligned)
    return data.oMf[frame], J


def differences(robot, pin, model, data, frame, q, qd, qdd):  # type: ignore[no-untyped-def]
    T, J = robot.fk_jacobian(q, FRAME)
    tau, M = robot.inverse_dynamics(q, qd, qdd), robot.mass_matrix(q)
    a = robot.forward_dynamics(q, qd, tau)
    worst = dict.fromkeys(("FK", "Jacobian", "inverse dynamics", "mass matrix", "forward dynamics"), 0.0)
    for i in range(len(q)):
        pin.framesForwardKinematics(model, data, q[i])
        peer = {
            "FK": (T[i], data.oMf[frame].homogeneous),
            "Jacobian": (J[i], pin.computeFrameJacobian(model, data, q[i], frame, pin.LOCAL_WORLD_ALIGNED)),
            "inverse dynamics": (tau[i], pin.rnea(model, data, q[i], qd[i], qdd[i])),
            "forward dynamics": (a[i], pin.aba(model, data, q[i], qd[i], tau[i])),
        }
        upper = np.triu(pin.crba(model, data, q[i]))
        peer["mass matrix"] = (M[i], upper + np.triu(upper, 1).T)
        for name, (x, y) in peer.items():
            worst[name] = max(worst[name], float(np.abs(x - y).max()))
    return worst


if __name__ == "__main__":
    main()
