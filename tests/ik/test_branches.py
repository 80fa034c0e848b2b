"""Closed forms: every branch reaches, the generating joint vector is among them, and the counts agree."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import ik
from apprehend.errors import InputError, UnsuccessfulError
from apprehend.ik import BranchStatus
from apprehend.kinematics import Robot

from ..support import reference
from .makers import chain, configurations, from_axes, from_dh, random_rotation, two_arms

X, Y, Z = np.eye(3)


def unit(rng: np.random.Generator) -> np.ndarray:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def apart(q: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.abs((q - other + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)


def check(robot: Robot, q: np.ndarray, sol: ik.BranchResult, frame: str, near: float = 1e-5) -> None:
    T = robot.fk(q, frame)
    for i in range(len(q)):
        found = sol.solutions(i)
        gap = np.abs(robot.fk(found, frame) - T[i])
        assert gap.max() < 2e-12 * (1.0 + np.abs(T[i]).max()) * 5
        assert apart(found, q[i]).min() < near
        for a in range(len(found)):
            for b in range(a):
                assert apart(found[a], found[b]) > 1e-7
    assert sol.residual.max() < 1e-12


def arms(seed: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(seed)
    P = rng.normal(size=(7, 3)) * 0.3
    general = np.array([unit(rng) for _ in range(6)])
    wrist = P.copy()
    wrist[4:6] = 0.0
    parallel12, parallel23, meeting = general.copy(), general.copy(), wrist.copy()
    parallel12[1] = parallel12[0]
    parallel23[2] = -parallel23[1]
    meeting[1] = 0.0
    three = general.copy()
    three[2], three[3] = three[1], -three[1]
    crossing = P.copy()
    crossing[5] = 0.3 * three[4] - 0.2 * three[5]
    shoulder = P.copy()
    shoulder[1:3] = 0.0
    early = general.copy()
    early[3], early[4] = early[2], early[2]
    return {
        "wrist, general": (general, wrist),
        "wrist, axes 1 and 2 parallel": (parallel12, wrist),
        "wrist, axes 2 and 3 parallel": (parallel23, wrist),
        "wrist, axes 1 and 2 meet": (general, meeting),
        "parallel 2 3 4": (three, P),
        "parallel 2 3 4, axes 5 and 6 meet": (three, crossing),
        "shoulder": (general, shoulder),
        "parallel 3 4 5": (early, P),
    }


@pytest.mark.parametrize("name", list(arms(0)))
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_six_joints(name: str, seed: int) -> None:
    H, P = arms(seed)[name]
    robot = from_axes(H, P, random_rotation(np.random.default_rng(seed)))
    q = configurations(robot, 150, seed)
    sol = ik.branches(robot, robot.fk(q, "tip"))
    assert sol.success.all()
    assert (sol.found <= 8).all()
    check(robot, q, sol, "tip")


def general_arms(seed: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Axes of arms that have neither a spherical wrist or shoulder nor three parallel axes."""
    rng = np.random.default_rng(seed)
    P = rng.normal(size=(7, 3)) * 0.3
    H = np.array([unit(rng) for _ in range(6)])
    out = {"any": (H, P)}
    for name, parallel, meeting in (
        ("two meet at the tool", (), (5,)),
        ("two meet at the base", (), (1,)),
        ("two pairs meet", (), (1, 5)),
        ("parallel 1 2", (1,), ()),
        ("parallel 2 3", (2,), ()),
        ("parallel 1 2 and 4 5", (1, 4), ()),
        ("parallel 3 4, two pairs meet", (3,), (1, 5)),
    ):
        h, p = H.copy(), P.copy()
        for joint in parallel:
            h[joint] = h[joint - 1]
        for joint in meeting:
            p[joint] = 0.0
        out[name] = (h, p)
    return out


@pytest.mark.parametrize("name", list(general_arms(0)))
def test_six_joints_in_any_position(name: str) -> None:
    for seed in (1, 2):
        robot = from_axes(*general_arms(seed)[name], random_rotation(np.random.default_rng(seed)))
        q = configurations(robot, 60, seed)
        sol = ik.branches(robot, robot.fk(q, "tip"))
        assert sol.family == "six revolute joints in any position"
        assert (sol.found <= 16).all()
        check(robot, q, sol, "tip")
        # a long search finds no branch that is not among them
        many = ik.solve(robot, robot.fk(q[:10], "tip"), "tip", n_solutions=16, distinct=1e-3, max_starts=600)
        for i in range(10):
            for row in many.solutions(i):
                assert apart(sol.solutions(i), row).min() < 1e-3


def test_the_general_arm_far_away_and_large_has_the_same_branches() -> None:
    H, P = general_arms(3)["any"]
    robot = from_axes(H, P)
    big = from_axes(H, 40.0 * P)
    q = configurations(robot, 40)
    assert (ik.branches(robot, robot.fk(q, "tip")).found == ik.branches(big, big.fk(q, "tip")).found).all()
    T = np.eye(4)
    T[:3, 3] = (50.0, -20.0, 3.0)
    far = robot.placed(T)
    sol = ik.branches(far, far.fk(q, "tip"))
    assert max(apart(sol.solutions(i), q[i]).min(initial=9.0) for i in range(40)) < 1e-6
    assert ik.branches(robot, far.fk(q[0], "tip")).status is BranchStatus.OUT_OF_REACH


def test_seven_joints_in_any_position_with_one_locked() -> None:
    rng = np.random.default_rng(5)
    robot = from_axes(np.array([unit(rng) for _ in range(7)]), rng.normal(size=(8, 3)) * 0.3)
    assert ik.redundant_joint(robot, "tip") == "j2"
    q = configurations(robot, 60)
    sol = ik.branches(robot, robot.fk(q, "tip"), redundancy=q[:, 2])
    check(robot, q, sol, "tip")


def test_the_references_have_the_same_number_of_solutions() -> None:
    for case in reference("ik_all_solutions_6r.json")["cases"]:
        robot = from_dh(case["inputs"]["links"])
        sol = ik.branches(robot, np.array(case["inputs"]["T"]), "tip")
        expected = np.array(case["expected"]["solutions_wrapped"])
        assert int(sol.found) == case["expected"]["n_solutions"], case["id"]
        for row in expected:
            assert apart(sol.solutions(), row).min() < 1e-5, case["id"]


@pytest.mark.parametrize(
    "family",
    [
        "IK_spherical",
        "IK_spherical_2_intersecting",
        "IK_spherical_2_parallel",
        "IK_3_parallel",
        "IK_3_parallel_2_intersecting",
        "IK_2_intersecting",
        "IK_2_parallel",
        "IK_gen_6_dof",
    ],
)
def test_the_published_rows_of_ik_geo(family: str) -> None:
    cases = [c for c in reference("ik_geo_subproblems.json")["cases"] if c["id"].split("/")[1] == family]
    assert cases
    for case in cases:
        H, P = np.array(case["inputs"]["H"]), np.array(case["inputs"]["P"])
        robot = from_axes(H, P)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = case["inputs"]["R"], case["inputs"]["T"]
        u, _, v = np.linalg.svd(T[:3, :3])
        T[:3, :3] = u @ v
        sol = ik.branches(robot, T)
        assert apart(sol.solutions(), np.array(case["expected"]["Q"])).min() < 1e-6, case["id"]


def srs(seed: int, offset: float = 0.0) -> Robot:
    """Shoulder and wrist spherical, one elbow joint."""
    H = np.array([Z, Y, Z, -Y, Z, Y, Z])
    P = np.zeros((8, 3))
    P[0], P[3], P[4], P[7] = 0.34 * Z, 0.4 * Z + offset * X, 0.4 * Z - offset * X, 0.126 * Z
    return from_axes(H, P, limit=2.8)


@pytest.mark.parametrize("offset", [0.0, 0.08])
def test_seven_joints_with_a_redundant_one(offset: float) -> None:
    robot = srs(0, offset)
    assert ik.redundant_joint(robot, "tip") == "j2"
    q = configurations(robot, 300)
    sol = ik.branches(robot, robot.fk(q, "tip"), redundancy=q[:, 2])
    assert sol.success.all()
    check(robot, q, sol, "tip")
    T = robot.fk(q[0], "tip")
    intervals = ik.redundancy_intervals(robot, T)
    assert ((intervals[:, 0] <= q[0, 2]) & (q[0, 2] <= intervals[:, 1])).any()
    inside = intervals.mean(axis=1)
    assert ik.branches(robot, np.repeat(T[None], len(inside), axis=0), redundancy=inside).success.all()
    edges = intervals[(np.abs(intervals) < 2.8 - 1e-6)]
    outside = np.concatenate([intervals[:, 0] - 1e-4, intervals[:, 1] + 1e-4])
    outside = outside[np.abs(outside) < 2.8]
    assert len(outside) == edges.size
    if len(outside):
        beyond = ik.branches(robot, np.repeat(T[None], len(outside), axis=0), redundancy=outside)
        assert not beyond.success.any()


def test_a_seven_joint_arm_with_a_wrist_offset_is_solved_by_locking_the_last() -> None:
    H = np.array([Z, Y, Z, -Y, Z, -Y, -Z])
    P = np.zeros((8, 3))
    P[0], P[3], P[4], P[5], P[6] = 0.333 * Z, 0.316 * Z + 0.0825 * X, -0.0825 * X + 0.384 * Z, 0 * Z, 0.088 * X
    P[7] = -0.107 * Z
    robot = from_axes(H, P)
    assert ik.redundant_joint(robot, "tip") == "j6"
    q = configurations(robot, 300)
    sol = ik.branches(robot, robot.fk(q, "tip"), redundancy=q[:, 6])
    assert sol.success.all()
    check(robot, q, sol, "tip", near=1e-4)


@pytest.mark.parametrize("kinds", ["RRR", "RR", "RRRP", "RRPR", "PRRR"])
def test_flat_arms(kinds: str) -> None:
    rng = np.random.default_rng(len(kinds))
    n = unit(rng)
    H = np.array([n if i % 2 == 0 else -n for i in range(len(kinds))])
    robot = from_axes(H, rng.normal(size=(len(kinds) + 1, 3)) * 0.3, random_rotation(rng), kinds)
    q = configurations(robot, 100)
    T = robot.fk(q, "tip")
    sol = ik.branches(robot, T)
    assert sol.success.all()
    for i in range(100):
        assert np.abs(robot.fk(sol.solutions(i), "tip") - T[i]).max() < 1e-9
        turning = [k == "R" for k in kinds]
        assert apart(sol.solutions(i)[:, turning], q[i, turning]).min() < 1e-5
    tilted = T[0].copy()
    tilted[:3, :3] = tilted[:3, :3] @ random_rotation(rng)
    assert ik.branches(robot, tilted).status is BranchStatus.OUT_OF_REACH


def test_a_calibrated_arm_is_refined_from_its_ideal_branches() -> None:
    rng = np.random.default_rng(0)
    for name in ("wrist, axes 2 and 3 parallel", "parallel 2 3 4, axes 5 and 6 meet"):
        H, P = arms(3)[name]
        H = H + rng.normal(size=H.shape) * 1e-3
        H /= np.linalg.norm(H, axis=1, keepdims=True)
        robot = from_axes(H, P + rng.normal(size=P.shape) * 1e-3)
        q = configurations(robot, 300)
        sol = ik.branches(robot, robot.fk(q, "tip"))
        near = np.array([apart(sol.solutions(i), q[i]).min(initial=9.0) for i in range(300)])
        assert (near < 1e-6).mean() > 0.93  # near a singularity the ideal arm may have no such branch
        assert sol.residual.max() < 1e-9


def test_limits_choose_turns_and_drop_branches() -> None:
    H, P = arms(0)["wrist, axes 2 and 3 parallel"]
    wide = from_axes(H, P, limit=2 * np.pi)
    q = configurations(wide, 200)
    T = wide.fk(q, "tip")
    sol = ik.branches(wide, T, q0=q)
    best = np.array([np.abs(sol.solutions(i) - q[i]).max(axis=1).min() for i in range(200)])
    assert np.median(best) < 1e-9
    assert (np.abs(sol.q) <= 2 * np.pi + 1e-12).all()
    narrow = from_axes(H, P, limit=1.5)
    some = ik.branches(narrow, T)
    raw = ik.branches(narrow, T, limits=False)
    assert (some.found <= raw.found).all()
    assert set(np.unique(some.codes)) >= {0, 1}
    assert (np.abs(some.q[some.valid]) <= 1.5 + 1e-12).all()
    i = int(np.flatnonzero(some.codes == 1)[0])
    with pytest.raises(UnsuccessfulError, match="every branch leaves the joint limits"):
        ik.branches(narrow, T[i]).require_success()


def test_out_of_reach_and_batches() -> None:
    H, P = arms(0)["parallel 2 3 4"]
    robot = from_axes(H, P)
    T = robot.fk(configurations(robot, 4).reshape(2, 2, 6), "tip")
    T[1, 1, :3, 3] += 40.0
    sol = ik.branches(robot, T)
    assert sol.valid.shape[:2] == (2, 2)
    assert sol.status[1, 1] is BranchStatus.OUT_OF_REACH
    assert sol.success.tolist() == [[True, True], [True, False]]
    assert sol.solutions(1, 1).shape == (0, 6)
    assert "3 of 4 targets have branches" in sol.explain()
    assert np.isfinite(sol.q).all()
    assert ik.branches(robot, T[:0]).q.shape[-1] == 6


def test_what_has_no_closed_form_says_so() -> None:
    with pytest.raises(InputError, match=r"no closed form fits the 6 joints that move frame 'tip'.*ik\.solve"):
        ik.branches(chain("RRRPRR"), np.eye(4))
    with pytest.raises(InputError, match="no closed form fits the 8 joints"):
        ik.branches(chain("RRRRRRRR"), np.eye(4))
    with pytest.raises(InputError, match="give redundancy, the angle of joint 'j2'"):
        ik.branches(srs(0), np.eye(4))
    with pytest.raises(InputError, match="redundancy has shape"):
        ik.branches(srs(0), np.eye(4), redundancy=[0.1, 0.2])
    with pytest.raises(InputError, match="has no redundant joint"):
        ik.redundancy_intervals(from_axes(*arms(0)["parallel 2 3 4"]), np.eye(4))
    with pytest.raises(InputError, match="samples is 1; expected 2 or more"):
        ik.redundancy_intervals(srs(0), np.eye(4), samples=1)
    with pytest.raises(InputError, match="tolerance is 0"):
        ik.redundancy_intervals(srs(0), np.eye(4), tolerance=0)
    with pytest.raises(InputError, match="expected one pose"):
        ik.redundancy_intervals(srs(0), np.eye(4)[None])
    H, P = arms(0)["parallel 2 3 4"]
    with pytest.raises(InputError, match="0 indices for a batch"):
        ik.branches(from_axes(H, P), np.eye(4)[None]).solutions()
    assert ik.redundant_joint(two_arms(), "left_tip") == "left_j1"
    assert ik.redundant_joint(chain("RRRRRR"), "tip") is None


def test_a_target_gets_the_same_bits_whichever_targets_are_asked_for_with_it() -> None:
    robot = Robot.load("panda")
    q = np.random.default_rng(0).uniform(robot.limits.lower, robot.limits.upper, (3000, robot.n))
    T = robot.fk(q, "panda_hand")
    whole = ik.branches(robot, T, "panda_hand", redundancy=q[:, 6])
    part = ik.branches(robot, T[1501:], "panda_hand", redundancy=q[1501:, 6])
    np.testing.assert_array_equal(whole.q[1501:], part.q)
    np.testing.assert_array_equal(whole.residual[1501:], part.residual)
