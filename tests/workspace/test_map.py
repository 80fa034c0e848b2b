"""Reachability maps: cells, what they hold, queries, placements, files, and agreement with inverse kinematics."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from apprehend import ReachabilityMap, Robot
from apprehend.errors import InputError
from apprehend.kernels import reach_map as kernels
from apprehend.kinematics import manipulability
from apprehend.robots.description import Description, Joint, JointLimits, JointType, Link
from apprehend.spatial import Rotation
from tests.ik.makers import chain
from tests.support import shared


def straight_arm(axes: str, lengths: list[float], limits: list[tuple[float, float]] | None = None) -> Robot:
    """Links along x, of the given lengths, each turned about an axis at its root."""
    unit = {"y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    joints, x = [], 0.0
    for i, (axis, length) in enumerate(zip(axes, lengths, strict=True)):
        T = np.eye(4)
        T[0, 3] = x
        kind = JointType.REVOLUTE if limits else JointType.CONTINUOUS
        bounds = JointLimits(*limits[i]) if limits else JointLimits()
        joints.append(Joint(f"j{i}", kind, f"l{i}", f"l{i + 1}", T, np.array(unit[axis]), bounds))
        x = length
    T = np.eye(4)
    T[0, 3] = x
    joints.append(Joint("end", JointType.FIXED, f"l{len(axes)}", "tip", T))
    names = (*(f"l{i}" for i in range(len(axes) + 1)), "tip")
    return Robot(Description("arm", "l0", {name: Link(name) for name in names}, tuple(joints)))


@pytest.fixture(scope="module")
def arm() -> Robot:
    return chain("RRRRRR", seed=3)


@pytest.fixture(scope="module")
def reach(arm: Robot) -> ReachabilityMap:
    size = float(np.ptp(arm.fk(arm_samples(arm, 2000), "tip")[:, :3, 3], axis=0).max())
    return ReachabilityMap.build(arm, "tip", resolution=size / 12, angle=np.pi / 3, coverage=0.97)


def arm_samples(arm: Robot, n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(arm.limits.lower, arm.limits.upper, (n, arm.n))


# cells ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("k", [1, 2, 5])
def test_orientation_cells_are_all_used_about_equally_and_small(k: int) -> None:
    R = Rotation.random(np.random.default_rng(0), 40_000).matrix
    cells = np.array([kernels.orientation_cell(r.ravel(), k) for r in R])
    counts = np.bincount(cells, minlength=4 * k**3)
    assert len(counts) == 4 * k**3
    assert counts.min() > 0.45 * counts.mean()
    assert counts.max() < 1.8 * counts.mean()
    for cell in range(0, 4 * k**3, max(1, k**3 // 4)):
        members = Rotation(R[cells == cell])
        angles = np.asarray(members.angle_to(Rotation(R[np.flatnonzero(cells == cell)[0]])))
        assert angles.max() <= np.sqrt(3.0) * np.pi / k + 1e-9  # the diagonal of a cell with edges π/k


def test_the_cell_does_not_depend_on_the_sign_of_the_quaternion() -> None:
    rng = np.random.default_rng(1)
    half = Rotation.from_axis_angle(rng.normal(size=(100, 3)), np.pi).matrix
    again = np.linalg.inv(np.linalg.inv(half))
    for a, b in zip(half, again, strict=True):
        assert 0 <= kernels.orientation_cell(a.ravel(), 4) < 256
        assert kernels.orientation_cell(a.ravel(), 1) in range(4)
        assert b.shape == (3, 3)


# what it holds --------------------------------------------------------------------------------------------------------


def test_sampled_configurations_are_found_as_often_as_the_coverage_says(arm: Robot, reach: ReachabilityMap) -> None:
    T = arm.fk(arm_samples(arm, 20_000, seed=7), "tip")
    assert np.mean(reach.reachable(T)) == pytest.approx(reach.coverage, abs=0.01)
    assert reach.coverage >= 0.97


def test_it_agrees_with_inverse_kinematics(reach: ReachabilityMap) -> None:
    checked = reach.accuracy(3000, rng=np.random.default_rng(2))
    assert checked.agreement > 0.85
    assert checked.recall > 0.85
    assert "precision" in str(checked)
    total = checked.true_positive + checked.false_positive + checked.false_negative + checked.true_negative
    assert total == 3000


@pytest.mark.parametrize(
    ("measure", "part"), [("yoshikawa", "both"), ("mu1", "both"), ("mu2", "linear"), ("mu3", "angular")]
)
def test_the_measure_is_that_of_kinematics(arm: Robot, measure: str, part: str) -> None:
    size = 0.2
    one = ReachabilityMap.build(
        arm, "tip", resolution=size, angle=np.pi, measure=measure, part=part, length=0.5, samples=4000
    )
    q = np.empty((4000, arm.n))
    kernels.random_rows(0, 0, 0, 4000, arm.home, arm.chain_model("tip").free, arm.limits.lower, arm.limits.upper, q)
    exact = getattr(manipulability(arm, q, "tip", part, length=0.5), measure)
    cells = one.cells(arm.fk(q, "tip"))
    best = np.zeros(one.hits.size)
    np.maximum.at(best, cells[cells >= 0], exact[cells >= 0])
    expected = np.minimum(np.round(best / one.level), 255)
    assert np.abs(one.best - expected).max() <= 1
    counts = np.bincount(cells[cells >= 0], minlength=one.hits.size)
    assert np.array_equal(one.hits, np.minimum(counts, 255))


def test_threads_do_not_change_it(arm: Robot) -> None:
    from apprehend import parallel

    before = parallel.threads()
    try:
        maps = []
        for count in (1, 2):
            parallel.set_threads(count)
            maps.append(ReachabilityMap.build(arm, "tip", resolution=0.1, angle=np.pi / 2, samples=50_000))
    finally:
        parallel.set_threads(before)
    assert np.array_equal(maps[0].hits, maps[1].hits)
    assert np.array_equal(maps[0].best, maps[1].best)


def test_areas_of_planar_arms() -> None:
    for case in json.loads(shared("reference/reachability.json").read_text())["cases"]:
        if not case["id"].startswith("reach/2r_limits"):
            continue
        given = case["inputs"]
        robot = straight_arm("zz", [given["l1"], given["l2"]], [tuple(given["q1"]), tuple(given["q2"])])
        h = 0.01
        flat = ReachabilityMap.build(robot, "tip", resolution=h, angle=np.inf, coverage=0.9999, part="linear")
        area = np.count_nonzero(flat.capability.any(axis=2)) * h * h
        exact = case["expected"]["area"]
        rim = 2.0 * (given["l1"] + given["l2"]) * (np.ptp(given["q1"]) + np.ptp(given["q2"]))  # more than its length
        assert exact - 2.0 * h * h <= area <= exact + 1.5 * h * rim


def test_volume_of_an_anthropomorphic_arm() -> None:
    for case in json.loads(shared("reference/reachability.json").read_text())["cases"]:
        if not case["id"].startswith("reach/anthropomorphic"):
            continue
        l1, l2 = case["inputs"]["l1"], case["inputs"]["l2"]
        robot = straight_arm("zyy", [0.0, l1, l2])
        h = (l1 + l2) / 30
        solid = ReachabilityMap.build(robot, "tip", resolution=h, angle=np.inf, coverage=0.999)
        inner, outer = case["expected"]["radii"]
        exact = case["expected"]["volume"]
        assert (
            0.97 * exact
            < solid.volume
            < 4.0 / 3.0 * np.pi * ((outer + np.sqrt(3) * h) ** 3 - max(inner - 2 * h, 0.0) ** 3)
        )


def test_what_is_not_valid_is_left_out(arm: Robot) -> None:
    half = ReachabilityMap.build(
        arm,
        "tip",
        resolution=0.1,
        angle=np.pi,
        samples=20_000,
        valid=lambda q: q[:, 0] > 0.5 * (arm.limits.lower + arm.limits.upper)[0],
    )
    assert 0.45 < half.counts.invalid / half.counts.samples < 0.55
    assert int(half.hits.astype(int).sum()) <= half.counts.samples - half.counts.invalid
    with pytest.raises(InputError, match="refuses each of"):
        ReachabilityMap.build(arm, "tip", samples=10, valid=lambda q: np.zeros(len(q), bool))
    with pytest.raises(InputError, match="expected booleans"):
        ReachabilityMap.build(arm, "tip", samples=10, valid=lambda q: np.zeros(3))


# queries --------------------------------------------------------------------------------------------------------------


def test_queries_are_batched_and_follow_the_base(arm: Robot, reach: ReachabilityMap) -> None:
    T = arm.fk(arm_samples(arm, 12), "tip").reshape(3, 4, 4, 4)
    values = reach.manipulability(T)
    assert values.shape == (3, 4)
    assert isinstance(reach.reachable(T[0, 0]), bool)
    assert reach.manipulability(T[0, 0]) == values[0, 0]
    far = np.eye(4)
    far[0, 3] = 100.0
    assert not reach.reachable(far)
    assert reach.manipulability(far) == 0.0
    base = np.eye(4)
    base[:3, :3], base[:3, 3] = Rotation.from_rpy([0.3, -0.2, 1.0]).matrix, (1.0, 2.0, 3.0)
    moved = ReachabilityMap.build(
        arm.placed(base), "tip", resolution=reach.resolution, angle=np.pi / 3, samples=reach.counts.samples
    )
    assert np.array_equal(moved.hits, reach.hits)
    assert np.array_equal(moved.cells(base @ T), reach.cells(T))


def test_wrong_poses_are_refused(reach: ReachabilityMap) -> None:
    with pytest.raises(InputError, match="not a rotation"):
        reach.reachable(2.0 * np.diag([1.0, 1.0, 1.0, 0.5]))
    with pytest.raises(InputError, match=r"expected \(\.\.\., 4, 4\)"):
        reach.reachable(np.eye(3))
    with pytest.raises(InputError, match="finite"):
        reach.manipulability(np.full((4, 4), np.nan))


def test_base_placements_reach_their_targets(arm: Robot, reach: ReachabilityMap) -> None:
    centre = arm.fk(arm.home, "tip")
    targets = np.array([centre, centre])
    targets[1, :3, 3] += 0.5 * reach.resolution
    found = reach.base_placements(targets, n=8)
    assert found.success
    assert (np.diff(found.scores) <= 0).all()
    assert found.poses[:, 2, 3] == pytest.approx(0.0)
    for pose, score in zip(found.poses, found.scores, strict=True):
        local = np.linalg.inv(pose) @ targets
        inside = ReachabilityMap.manipulability(reach, reach.base @ local)
        assert score == pytest.approx(inside.min())
    for pose, q in zip(found.poses, found.q, strict=True):
        assert arm.placed(pose).fk(q, "tip") == pytest.approx(targets, abs=5e-6)
        assert arm.limits.contains(q, -1e-9).all()
    gaps = np.linalg.norm(found.poses[:, None, :2, 3] - found.poses[None, :, :2, 3], axis=-1)
    turns = np.einsum("aij,bij->ab", found.poses[:, :3, :3], found.poses[:, :3, :3])
    near = (gaps < 2.0 * reach.resolution - 1e-9) & (turns > 2.0 + 1e-9)
    assert near.sum() == len(found.poses)  # each with itself
    given = reach.base_placements(targets, bases=found.poses[:3])
    assert given.tried == 3


def test_placements_that_do_not_exist(reach: ReachabilityMap) -> None:
    target = np.eye(4)
    answer = reach.base_placements(target, height=50.0)
    assert not answer.success
    assert "From no base pose" in answer.explain()
    with pytest.raises(InputError, match="lower below upper"):
        reach.base_placements(target, region=[[1, 1], [0, 0]])
    with pytest.raises(InputError, match="at least one target"):
        reach.base_placements(np.zeros((0, 4, 4)))
    with pytest.raises(InputError, match="shrink it"):
        reach.base_placements(target, region=[[-1e4, -1e4], [1e4, 1e4]])


# files, pictures, wrong input -----------------------------------------------------------------------------------------


def test_a_file_gives_the_map_back(arm: Robot, reach: ReachabilityMap, tmp_path: Path) -> None:
    path = tmp_path / "arm.reach"
    reach.save(path)
    again = ReachabilityMap.load(path, arm)
    assert np.array_equal(again.hits, reach.hits)
    assert np.array_equal(again.best, reach.best)
    assert (again.settings, again.counts, again.scale) == (reach.settings, reach.counts, reach.scale)
    alone = ReachabilityMap.load(path)
    assert alone.reachable(arm.fk(arm.home, "tip")) == reach.reachable(arm.fk(arm.home, "tip"))
    with pytest.raises(InputError, match="loaded without its robot"):
        alone.accuracy(10, rng=np.random.default_rng(0))
    with pytest.raises(InputError, match="the chain of"):
        ReachabilityMap.load(path, chain("RRRRRR", seed=4))
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(InputError, match="not a reachability map"):
        ReachabilityMap.load(path)


def test_an_interrupted_build_goes_on(arm: Robot, tmp_path: Path) -> None:
    path = tmp_path / "arm.reach"
    options = {"resolution": 0.1, "angle": np.pi / 2}
    ReachabilityMap.build(arm, "tip", samples=700_000, file=path, **options)
    resumed = ReachabilityMap.build(arm, "tip", samples=1_000_000, file=path, **options)
    whole = ReachabilityMap.build(arm, "tip", samples=1_000_000, **options)
    assert np.array_equal(resumed.hits, whole.hits)
    assert np.array_equal(resumed.best, whole.best)
    with pytest.raises(InputError, match="holds another map"):
        ReachabilityMap.build(arm, "tip", resolution=0.2, samples=10, file=path)


def test_pictures(reach: ReachabilityMap, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    axes = reach.draw("xy", None, "manipulability")
    axes.figure.savefig(tmp_path / "m.png")
    assert (tmp_path / "m.png").stat().st_size > 5000
    assert axes.get_xlabel() == "x (m)"
    with pytest.raises(InputError, match="the map goes from"):
        reach.draw("xz", 1e3)
    with pytest.raises(InputError, match="plane is 'zz'"):
        reach.draw("zz")


def test_wrong_arguments_are_said(arm: Robot) -> None:
    with pytest.raises(InputError, match="choose a larger resolution"):
        ReachabilityMap.build(arm, "tip", resolution=1e-3)
    with pytest.raises(InputError, match="resolution is -1"):
        ReachabilityMap.build(arm, "tip", resolution=-1.0)
    with pytest.raises(InputError, match="coverage is 2"):
        ReachabilityMap.build(arm, "tip", coverage=2.0)
    with pytest.raises(InputError, match="no joint moves"):
        ReachabilityMap.build(arm, arm.frame_names[0])
    with pytest.raises(InputError, match="measure is 'mu9'"):
        ReachabilityMap.build(arm, "tip", measure="mu9")
