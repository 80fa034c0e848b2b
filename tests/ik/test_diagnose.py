"""Reasons for failure: certified bounds, limits, refused solutions, and the nearest pose."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import ik
from apprehend.errors import InputError
from apprehend.ik import IKStatus
from apprehend.ik.chain import prepare
from apprehend.kinematics import Robot
from apprehend.robots.description import Description, Joint, JointLimits

from ..support import reference
from .makers import chain, configurations, from_axes, from_dh


def narrowed(robot: Robot, share: float) -> Robot:
    """The same robot with its ranges shortened to a share around their middle."""
    joints = []
    for j in robot.description.joints:
        limits = j.limits
        if np.isfinite(limits.upper):
            middle, half = 0.5 * (limits.lower + limits.upper), 0.5 * share * (limits.upper - limits.lower)
            limits = JointLimits(middle - half, middle + half)
        joints.append(Joint(j.name, j.type, j.parent, j.child, j.pose, j.axis, limits, j.mimic))
    d = robot.description
    return Robot(Description(d.name, d.root, d.links, tuple(joints)))


@pytest.mark.parametrize("kinds", ["RRRRRR", "RRRRRRR", "PRRRRRR", "RRPRRR", "RRRRRP", "CCCCCC"])
def test_the_reach_bound_holds_for_every_joint_vector(kinds: str) -> None:
    for seed in range(5):
        robot = chain(kinds, seed)
        bound = prepare(robot, "tip").bound
        T = robot.fk(configurations(robot, 3000, seed), "tip")
        assert bound.excess(T).max() <= 1e-9
        assert not bound.beyond(T, 1e-6, 1e-6).any()
        far = np.linalg.norm(T[:, :3, 3] - bound.anchor, axis=1).max()
        assert bound.length < 2.5 * far  # and says something


def test_the_reach_bound_is_near_the_largest_known_distance() -> None:
    for case in reference("reachability.json")["cases"]:
        if "max_from_shoulder" not in case["id"]:
            continue
        robot = from_dh(case["inputs"]["links"])
        bound = prepare(robot, "tip").bound
        assert bound.length >= 0.99 * case["expected"]["max_distance"] - 0.7  # their shoulder is not our anchor
        T = robot.fk(configurations(robot, 20000), "tip")
        far = np.linalg.norm(T[:, :3, 3] - bound.anchor, axis=1).max()
        assert far <= bound.length <= 1.25 * far, case["id"]


def test_targets_beyond_the_reach_are_certified() -> None:
    robot = chain("RRRRRR", 1)
    bound = prepare(robot, "tip").bound
    T = robot.fk(configurations(robot, 50), "tip")
    away = T[:, :3, 3] - bound.anchor
    T[:, :3, 3] = bound.anchor + away / np.linalg.norm(away, axis=1, keepdims=True) * (bound.length + 1e-3)
    sol = ik.solve(robot, T, "tip")
    assert sol.certified.all()
    assert (sol.status == IKStatus.OUT_OF_REACH).all()
    assert (sol.starts == 0).all()
    assert robot.limits.contains(sol.q).all()


def test_out_of_reach_without_a_certificate_is_found_by_search() -> None:
    # a planar-like arm with equal links: poses inside the sphere, but tilted away from what two joints can do
    robot = from_axes(np.eye(3)[[2, 1, 1]], np.array([[0, 0, 0.3], [0, 0, 0], [0.4, 0, 0], [0.4, 0, 0]]))
    T = robot.fk(configurations(robot, 20), "tip")
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    T[:, :3, :3] = T[:, :3, :3] @ turn
    sol = ik.solve(robot, T, "tip")
    assert (sol.status == IKStatus.OUT_OF_REACH).mean() >= 0.9
    assert "by search" in sol.reason(int(np.flatnonzero(~sol.certified & (sol.codes == 1))[0]))


def test_limits_are_named() -> None:
    wide = chain("RRRRRR", 3)
    robot = narrowed(wide, 0.35)
    T = wide.fk(configurations(wide, 300), "tip")
    sol = ik.solve(robot, T, "tip")
    failed = ~sol.success
    assert failed.sum() > 100
    assert (sol.status[failed] == IKStatus.LIMITS).mean() > 0.97
    first = int(np.flatnonzero(sol.codes == IKStatus.LIMITS.code)[0])
    assert "only outside the joint limits" in sol.reason(first)
    assert "at a limit" in sol.reason(first)
    assert sol.limiting[first].any()
    assert not sol.limiting[sol.success].any()
    assert robot.limits.contains(sol.q).all()


def test_the_nearest_pose_is_a_minimum_no_other_method_beats() -> None:
    optimize = pytest.importorskip("scipy.optimize")
    wide = chain("RRRRRRR", 3)
    robot = narrowed(wide, 0.25)
    reach = prepare(robot, "tip").reach
    T = wide.fk(configurations(wide, 30), "tip")
    sol = ik.solve(robot, T, "tip")
    rng = np.random.default_rng(0)

    def cost(q: np.ndarray, target: np.ndarray) -> float:
        X = robot.fk(q, "tip")
        gap = (X[:3, 3] - target[:3, 3]) / reach
        return float(0.5 * gap @ gap + 0.5 * (3.0 - np.trace(X[:3, :3].T @ target[:3, :3])))

    beaten = 0
    for i in np.flatnonzero(~sol.success)[:8]:
        ours = cost(sol.q[i], T[i])
        best = min(
            optimize.minimize(
                cost,
                rng.uniform(robot.limits.lower, robot.limits.upper),
                (T[i],),
                method="L-BFGS-B",
                bounds=list(zip(robot.limits.lower, robot.limits.upper, strict=True)),
            ).fun
            for _ in range(15)
        )
        beaten += ours > best * 1.01 + 1e-9
    assert beaten == 0


def test_refused_solutions_are_told_apart_and_the_filter_is_obeyed() -> None:
    robot = chain("RRRRRRR", 2)
    T = robot.fk(configurations(robot, 60), "tip")

    def positive(q: np.ndarray) -> np.ndarray:
        return q[:, 0] > 0.0

    sol = ik.solve(robot, T, "tip", accept=positive)
    assert sol.success.mean() > 0.6
    assert (sol.q[sol.success, 0] > 0.0).all()
    several = ik.solve(robot, T, "tip", accept=positive, n_solutions=3)
    for i in np.flatnonzero(several.success):
        assert (several.solutions(int(i))[:, 0] > 0.0).all()
        assert np.abs(robot.fk(several.solutions(int(i)), "tip") - T[i]).max() < 1e-5
    none = ik.solve(robot, T, "tip", accept=lambda q: np.zeros(len(q), dtype=bool))
    assert (none.status == IKStatus.COLLISION).all()
    assert "free of collision" in none.reason(0)
    with pytest.raises(InputError, match=r"accept returned shape \(1,\) for"):
        ik.solve(robot, T, "tip", accept=lambda q: np.zeros(1, dtype=bool))


def test_without_diagnosis_nothing_is_searched() -> None:
    wide = chain("RRRRRR", 3)
    robot = narrowed(wide, 0.3)
    T = wide.fk(configurations(wide, 40), "tip")
    sol = ik.solve(robot, T, "tip", diagnose=False)
    failed = ~sol.success
    assert (sol.status[failed] == IKStatus.NOT_FOUND).all()
    assert np.array_equal(sol.q[failed], np.broadcast_to(robot.home, (failed.sum(), 6)))
    assert "no start led to the target (200 were tried)" in sol.reason(int(np.flatnonzero(failed)[0]))


def test_the_nearest_position_alone_where_the_rotation_is_free() -> None:
    optimize = pytest.importorskip("scipy.optimize")
    wide = chain("RRRRRR", 5)
    robot = narrowed(wide, 0.25)
    T = wide.fk(configurations(wide, 60), "tip")
    sol = ik.solve(robot, T, "tip", tolerance=[1e-6] * 3 + [np.inf] * 3)
    failed = np.flatnonzero(~sol.success)
    assert failed.size >= 10
    assert set(sol.status[failed]) <= {IKStatus.LIMITS, IKStatus.OUT_OF_REACH, IKStatus.SINGULAR}
    rng = np.random.default_rng(0)
    bounds = list(zip(robot.limits.lower, robot.limits.upper, strict=True))
    for i in failed[:6]:
        goal = T[i, :3, 3]

        def cost(q: np.ndarray, goal: np.ndarray = goal) -> float:
            return float(((robot.fk(q, "tip")[:3, 3] - goal) ** 2).sum())

        starts = [rng.uniform(robot.limits.lower, robot.limits.upper) for _ in range(12)]
        best = min(optimize.minimize(cost, start, method="L-BFGS-B", bounds=bounds).fun for start in starts)
        assert sol.residual[i, 0] <= 1.01 * np.sqrt(best) + 1e-7


def test_a_hair_beyond_the_boundary_is_called_singular_and_beyond_a_limit_is_not() -> None:
    robot = chain("CCCCCC", 1)
    T = robot.fk(configurations(robot, 40), "tip")
    T[:, :3, 3] *= 4.0
    far = ik.solve(robot, T, "tip")
    inner = np.flatnonzero(~far.limiting.any(axis=1))
    assert inner.size >= 5
    edge = robot.fk(far.q[inner], "tip")  # the boundary of what the arm reaches with these orientations
    assert ik.solve(robot, edge, "tip").success.all()
    away = T[inner, :3, 3] - edge[:, :3, 3]
    beyond = edge.copy()
    beyond[:, :3, 3] += 3e-5 * away / np.linalg.norm(away, axis=1, keepdims=True)
    sol = ik.solve(robot, beyond, "tip")
    assert (sol.status[~sol.success] == IKStatus.SINGULAR).mean() > 0.7
    i = int(np.flatnonzero(sol.status == IKStatus.SINGULAR)[0])
    assert "comes within a hair" in sol.reason(i)
    narrow = narrowed(chain("RRRRRR", 3), 0.35)
    q = np.where(np.arange(6) == 3, narrow.limits.upper + 2e-5, configurations(narrow, 30))
    just = ik.solve(narrow, narrow.fk(q, "tip"), "tip")
    assert (just.status[~just.success] == IKStatus.LIMITS).all()
    assert (~just.success).sum() >= 3
