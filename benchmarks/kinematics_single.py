"""One configuration from Python: pose and Jacobian of the Panda's hand; loading its URDF.

python -m benchmarks.kinematics_single
"""

from __future__ import annotations

from collections.abc import Callable

from apprehend.kinematics import Robot

from ._harness import interleave, table

FRAME = "panda_hand"
CALLS = 2_000


def repeated(call: Callable[[], object], count: int = CALLS) -> tuple[Callable[[], None], int]:
    def run() -> None:
        for _ in range(count):
            call()

    return run, count


def main() -> None:
    import pinocchio as pin

    robot = Robot.load("panda")
    path = str(robot.description.source)
    model = pin.buildModelFromUrdf(path)
    data = model.createData()
    frame = model.getFrameId(FRAME)
    q, x = robot.home.copy(), pin.neutral(model)
    aligned = pin.LOCAL_WORLD_ALIGNED
    timings = interleave(
        {
            "ours": repeated(lambda: robot.fk(q, FRAME)),
            "Pinocchio": repeated(lambda: _placed(pin, model, data, x, frame)),
        }
    )
    table("pose of one frame", timings, "ours")
    timings = interleave(
        {
            "ours": repeated(lambda: robot.jacobian(q, FRAME)),
            "Pinocchio": repeated(lambda: pin.computeFrameJacobian(model, data, x, frame, aligned)),
        }
    )
    table("Jacobian of one frame", timings, "ours")
    timings = interleave(
        {
            "ours": repeated(lambda: Robot.load("panda", meshes="ignore"), 5),
            "Pinocchio": repeated(lambda: pin.buildModelFromUrdf(path), 5),
        }
    )
    table("reading the URDF", timings, "ours")


def _placed(pin, model, data, x, frame):  # type: ignore[no-untyped-def]
    pin.framesForwardKinematics(model, data, x)
    return data.oMf[frame].homogeneous


if __name__ == "__main__":
    main()
