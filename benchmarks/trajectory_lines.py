"""Cartesian lines by few joint points: points, certified and measured deviation, time; against T's halving.

Claims: 1 mm over a 0.6 m line on the Panda in at most 1 ms, deviation ≤ ε at 10,000 samples, fewest points within one
of the minimum (a test compares with an exhaustive search).
"""

from __future__ import annotations

from typing import Any

import numpy as np

import apprehend as ap
from apprehend import trajectory as tj
from apprehend.spatial import so3

from ._harness import interleave, seconds


def down(x: float, y: float, z: float) -> np.ndarray:
    """The tool pointing down at a place."""
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[:3, 3] = x, y, z
    return T


def measured(answer: tj.LineResult, count: int = 10000) -> float:
    """Largest distance from the straight line over the whole joint motion."""
    m = answer.points.shape[0]
    u = np.linspace(0.0, m - 1.0, count)
    k = np.minimum(u.astype(int), m - 2)
    z = (u - k)[:, None]
    p = answer.robot.fk(answer.points[k] * (1 - z) + answer.points[k + 1] * z, answer.frame)[:, :3, 3]
    a, b = answer.line(0.0)[:3, 3], answer.line(1.0)[:3, 3]
    s = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return float(np.linalg.norm(p - a - s[:, None] * (b - a), axis=1).max())


def halving(answer: tj.LineResult, deviation: float) -> int:
    """Points of T's algorithm from the same start: halve until the middle is near enough."""
    robot, frame, line = answer.robot, answer.frame, answer.line

    def points(a: float, qa: np.ndarray, b: float, qb: np.ndarray) -> int:
        middle = robot.fk(0.5 * (qa + qb), frame)[:3, 3]
        m = 0.5 * (a + b)
        if np.linalg.norm(middle - line(m)[:3, 3]) <= deviation:
            return 1
        qm = ap.ik.solve(robot, line(m), frame, 0.5 * (qa + qb)).q
        return points(a, qa, m, qm) + points(m, qm, b, qb)

    return points(0.0, answer.points[0], 1.0, answer.points[-1]) + 1


def turned(x: float, y: float, z: float, turn: tuple[float, float, float]) -> np.ndarray:
    """The tool turned away from pointing down."""
    T = down(x, y, z)
    T[:3, :3] = so3.exp(turn) @ T[:3, :3]
    return T


def main() -> None:
    """A 0.6 m line on two arms, at three deviations; a screw and an arc."""
    T0, T1 = down(0.4, -0.3, 0.3), down(0.4, 0.3, 0.3)
    for name in ("panda", "ur5"):
        robot = ap.Robot.load(name)
        start = tj.straight_line(robot, T0, T1).require_success().points[0]
        for deviation in (1e-2, 1e-3, 1e-4):

            def run(robot: ap.Robot = robot, deviation: float = deviation, **options: Any) -> tj.LineResult:
                return tj.straight_line(robot, T0, T1, deviation=deviation, **options)

            timing = interleave({"given": (lambda q0=start, run=run: run(q0=q0), 1), "found": (run, 1)}, 31)
            answer = run(q0=start)
            print(
                f"{name:6} 0.6 m, {1e3 * deviation:5.1f} mm: {answer.points.shape[0]:3} points (halving "
                f"{halving(answer, deviation):3}), proven {1e3 * answer.deviation:.5f} mm, measured at 10,000 samples "
                f"{1e3 * measured(answer):.5f} mm; {seconds(timing['given'].median)} (fastest "
                f"{seconds(timing['given'].fastest)}), with the inverse kinematics of its start "
                f"{seconds(timing['found'].median)}"
            )
        ends = down(0.4, -0.2, 0.3), turned(0.5, 0.2, 0.4, (0.3, 0.2, 0.9))
        for kind, call in {
            "screw": lambda robot=robot, ends=ends: tj.screw_line(robot, *ends),
            "arc": lambda robot=robot, ends=ends: tj.arc(robot, ends[0], [0.5, 0.0, 0.35], down(0.4, 0.2, 0.3)),
        }.items():
            timing = interleave({kind: (call, 1)}, 31)
            answer = call().require_success()
            print(
                f"{name:6} {kind:6} 1.0 mm: {answer.points.shape[0]:3} points, proven {1e3 * answer.deviation:.5f} mm "
                f"and {1e3 * answer.rotation:.3f} mrad; {seconds(timing[kind].median)} with its inverse kinematics"
            )


if __name__ == "__main__":
    main()
