"""Values keep what they were made of: nobody else's memory, and they can be copied and sent to other processes."""

from __future__ import annotations

import copy
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import apprehend as ap
from apprehend.arrays import as_array, as_own
from apprehend.collision import CollisionModel
from apprehend.errors import InputError, UnknownNameError
from apprehend.kernels.ik_step import steps
from apprehend.spatial import Pose, Rotation

T1 = Pose.from_parts(Rotation.from_rpy([0.1, 0.2, 0.3]), [0.1, 0.2, 0.3]).matrix
X, Z = np.eye(3)[0], np.eye(3)[2]
WAYPOINTS = np.array([[0.0, 0.0], [1.0, 2.0], [2.0, 1.0], [3.0, 3.0]])
QUICK = ap.trajectory.Limits(velocity=1.0, acceleration=1.0)


def timed(waypoints: np.ndarray, bound: np.ndarray) -> Any:
    limits = ap.trajectory.Limits(velocity=bound, acceleration=bound)
    return ap.trajectory.time_optimal(ap.trajectory.Spline(waypoints), limits=limits)


MADE: dict[str, tuple[Callable[..., Any], tuple[Any, ...], Callable[[Any], Any]]] = {
    "contact": (ap.Contact, (X, Z), lambda c: [c.position, c.normal, c.rotation[0]]),
    "tangent": (lambda t: ap.Contact(X, Z, tangent=t), (X,), lambda c: c.rotation),
    "patch": (ap.grasp.Patch, (np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.0]]), Z), lambda p: p.corners),
    "grasp": (lambda r: ap.Grasp([ap.Contact(X, Z)], reference=r), (X,), lambda g: [*g.matrix, g.reference[[0, 1, 2]]]),
    "limits": (lambda v: ap.trajectory.Limits(velocity=v), (np.ones(2),), lambda lim: lim.pairs("velocity", 2)),
    "spline": (ap.trajectory.Spline, (WAYPOINTS,), lambda s: s(0.3)),
    "timing": (timed, (WAYPOINTS, np.ones(2)), lambda r: [*r.motion(0.3 * r.duration), r.duration]),
    "pause": (lambda q: ap.trajectory.pause(q, 1.0), (np.ones(2),), lambda m: m(0.3)),
    "line": (ap.trajectory.Line, (np.eye(4), T1), lambda p: p(0.3)),
    "screw line": (ap.trajectory.ScrewLine, (np.eye(4), T1), lambda p: p(0.3)),
    "poses": (ap.trajectory.PoseSpline, (np.stack([np.eye(4), T1, T1 @ T1]),), lambda p: p(0.3)),
    "pose": (Pose, (T1,), lambda p: p.matrix),
}


@pytest.mark.parametrize("name", list(MADE))
def test_a_value_does_not_share_memory_with_its_arguments(name: str) -> None:
    make, arguments, probe = MADE[name]
    given = [np.array(a, dtype=np.float64) for a in arguments]
    value = make(*given)
    before = np.array([np.asarray(v).copy() for v in np.atleast_1d(probe(make(*arguments)))], dtype=object)
    for array, original in zip(given, arguments, strict=True):
        assert np.array_equal(array, original)  # nothing is written into an argument
        array *= 0.5
        array += 0.125
    after = np.array([np.asarray(v) for v in np.atleast_1d(probe(value))], dtype=object)
    assert str(before.tolist()) == str(after.tolist())
    for again in (copy.copy(value), copy.deepcopy(value), pickle.loads(pickle.dumps(value))):
        assert str(np.asarray(probe(again)).tolist()) == str(np.asarray(probe(value)).tolist())


def test_a_robot_cannot_be_changed_through_what_it_returns() -> None:
    robot = ap.Robot.load("ur5e")
    q = robot.home
    q += 0.5
    assert not np.array_equal(robot.home, q)
    with pytest.raises(ValueError, match="read-only"):
        robot.limits.velocity[0] = 0.1
    with pytest.raises(ValueError, match="read-only"):
        robot.base[0, 3] = 0.1


def test_read_only_limits_reach_no_kernel() -> None:
    robot = ap.Robot.load("ur5e")
    task = ap.ik.PoseTask("tool0", robot.fk(robot.home + 0.1, "tool0"))
    ap.ik.step(robot, robot.home, [task], 0.01)
    ap.ik.step(robot, robot.home, [task], 0.01, velocity=np.zeros(6))
    assert len(steps.signatures) == 1


def test_a_stepper_keeps_the_targets_that_it_was_given() -> None:
    robot = ap.Robot.load("ur5e")
    T = robot.fk(robot.home + 0.1, "tool0")
    expected = ap.ik.step(robot, robot.home, [ap.ik.PoseTask("tool0", T)], 0.01)
    stepper = ap.ik.Stepper(robot, [ap.ik.PoseTask("tool0", T)], 0.01)
    T[:3, 3] += 1.0
    assert np.array_equal(stepper(robot.home), expected)


def test_large_values_can_be_sent_to_other_processes() -> None:
    robot = ap.Robot.load("ur5e")
    T = robot.fk(robot.home, "tool0")
    scene = ap.Scene.tabletop("ur5e", body="mug")
    model = CollisionModel(scene.robot, scene)
    q = scene.robot.home
    for again in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
        assert list(again.bodies) == list(scene.bodies)
        assert np.array_equal(again.placed_body("mug").pose, scene.placed_body("mug").pose)
        with pytest.raises(TypeError):
            again.bodies["mug"] = None
    assert np.array_equal(pickle.loads(pickle.dumps(model)).distance(q), model.distance(q))
    assert np.array_equal(pickle.loads(pickle.dumps(robot)).fk(q[:6], "tool0"), robot.fk(q[:6], "tool0"))
    solution = ap.ik.solve(robot, T, "tool0")
    assert pickle.loads(pickle.dumps(solution)).status is solution.status


def test_complex_numbers_and_names_that_are_none_are_refused() -> None:
    robot = ap.Robot.load("ur5e")
    with pytest.raises(InputError, match="q is complex; expected real numbers"):
        robot.fk(np.zeros(6) + 1j, "tool0")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(InputError, match="q is complex; expected real numbers"):
            robot.fk(np.zeros(6) + 1j, "tool0")
    with pytest.raises(InputError, match="x is complex"):
        as_array(np.complex64(1.0), "x")
    with pytest.raises(UnknownNameError, match=r"no frame named None in robot 'ur5e'\. There are: "):
        robot.jacobian(np.zeros(6), None)  # type: ignore[arg-type]


def test_what_is_kept_is_copied_only_where_it_must_be() -> None:
    given = np.zeros(3)
    assert as_array(given, "x") is given
    assert not np.shares_memory(as_own(given, "x"), given)
    assert as_own([0, 1], "x").tolist() == [0.0, 1.0]


def test_poses_that_coincide_are_no_path() -> None:
    with pytest.raises(InputError, match="all 2 poses coincide"):
        ap.trajectory.PoseSpline(np.stack([T1, T1]))
