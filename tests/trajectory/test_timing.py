"""Time-optimal timing: certified limits, closed forms, toppra's problems, and failures that name their place."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PPoly
from scipy.optimize import linprog

from apprehend import trajectory as tj
from apprehend.errors import InputError, UnsuccessfulError
from tests.support import reference


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10**6), st.integers(2, 7), st.integers(3, 8), st.sampled_from([20, 100, 333]))
def test_limits_hold_at_all_times(seed: int, n: int, count: int, grid: int) -> None:
    rng = np.random.default_rng(seed)
    path = tj.Spline(rng.normal(size=(count, n)))
    limits = tj.Limits(
        velocity=np.stack([-rng.uniform(0.3, 3.0, n), rng.uniform(0.3, 3.0, n)], axis=1),
        acceleration=np.stack([-rng.uniform(0.5, 9.0, n), rng.uniform(0.5, 9.0, n)], axis=1),
    )
    timing = tj.time_optimal(path, limits, grid=grid).require_success()
    motion = timing.motion
    report = motion.check(limits, tolerance=1e-9)
    assert report.success, report.explain()
    np.testing.assert_allclose(motion.end, path(1.0), atol=1e-9)
    assert motion.continuity(1e-7) >= 1
    # something is always at its limit, up to the discretisation
    t = np.linspace(0.0, motion.duration, 2000)[1:-1]
    used = np.maximum(
        np.abs(motion(t, 1)) / np.where(motion(t, 1) > 0, limits.velocity[:, 1], -limits.velocity[:, 0]),
        np.abs(motion(t, 2)) / np.where(motion(t, 2) > 0, limits.acceleration[:, 1], -limits.acceleration[:, 0]),
    ).max(axis=1)
    assert grid < 50 or np.median(used) > 0.95


def test_straight_lines_have_the_closed_form() -> None:
    for case in reference("traj_toppra.json")["cases"]:
        if case["id"].startswith("topp_line"):
            g = case["inputs"]
            path = tj.polyline([np.zeros(3), g["displacement"]])
            limits = tj.Limits(velocity=g["vmax"], acceleration=g["amax"])
            timing = tj.time_optimal(path, limits, grid=500)
            assert timing.duration == pytest.approx(case["expected"]["duration"], rel=1e-4)
            assert tj.follow([np.zeros(3), g["displacement"]], limits).duration == pytest.approx(
                case["expected"]["duration"], rel=1e-12
            )


def test_problems_of_toppra() -> None:
    solved = 0
    for case in reference("traj_toppra.json")["cases"]:
        g, e = case["inputs"], case["expected"]
        if "waypoints" not in g:
            continue
        path = tj.Spline(g["waypoints"], g["ss"])
        limits = tj.Limits(velocity=g["vlim"], acceleration=g["alim"])
        timing = tj.time_optimal(path, limits, grid=1000)
        assert timing.success, (case["id"], timing.explain())
        assert timing.motion.check(limits).success
        solved += 1
        for key in ("duration_N1000_interpolation", "duration_N1600_interpolation", "duration_N1000"):
            if e.get(key):
                assert timing.duration <= e[key] * 1.001, (case["id"], key)
                assert timing.duration >= e[key] * 0.99, (case["id"], key)
    assert solved >= 10


def test_the_piecewise_problem_of_toppra() -> None:
    for case in reference("traj_toppra.json")["cases"]:
        if case["id"] == "toppra_test/cpp_piecewise":
            g = case["inputs"]
            c = np.transpose(np.array(g["coefficients_high_to_low"])[::-1], (1, 0, 2))
            path = tj.PolynomialPath(g["breaks"], c)
            timing = tj.time_optimal(path, tj.Limits(velocity=g["vlim"], acceleration=g["alim"]), grid=1000)
            printed = np.array(case["expected"]["parametrization_printed"])  # squared speeds at 51 points
            # their table chatters beside the jump of curvature at s = 2; elsewhere the profiles agree
            ours = np.interp(np.linspace(*path.interval, printed.size), timing.grid, timing.speed**2)
            apart = np.abs(ours - printed)
            assert np.sort(apart)[45] < 0.003
            assert np.median(apart) < 1e-3


def test_agrees_with_a_linear_program_on_the_same_grid() -> None:
    """Largest mean squared speed under the rows at the grid points only: an upper bound that is nearly reached."""
    rng = np.random.default_rng(4)
    path = tj.Spline(rng.normal(size=(5, 3)))
    V, A, N = np.full(3, 1.5), np.full(3, 3.0), 200
    timing = tj.time_optimal(path, tj.Limits(velocity=V, acceleration=A), grid=N)
    s = timing.grid
    h = np.diff(s)
    left = (path(s[:-1], 1), path(s[:-1], 2))
    right = (path(s[1:] - 1e-12, 1), path(s[1:] - 1e-12, 2))
    rows, bounds = [], []
    for i in range(h.size):
        for (q1, q2), end in ((left, i), (right, i + 1)):
            for j in range(3):
                row = np.zeros(s.size)
                row[i + 1], row[i] = q1[i, j] / (2 * h[i]), -q1[i, j] / (2 * h[i])
                row[end] += q2[i, j]
                rows += [row, -row]
                bounds += [A[j], A[j]]
    cap = (V**2 / np.maximum(path(s, 1) ** 2, 1e-12)).min(axis=1)
    cap[[0, -1]] = 0.0
    best = linprog(-np.ones(s.size), rows, bounds, bounds=np.stack([np.zeros(s.size), cap], axis=1))
    assert best.status == 0
    ours = float((timing.speed**2).sum())
    assert ours <= -best.fun * (1 + 1e-9)
    assert ours >= -best.fun * 0.97


def test_speeds_at_the_ends() -> None:
    path = tj.Spline(np.random.default_rng(1).normal(size=(4, 3)))
    limits = tj.Limits(velocity=2.0, acceleration=4.0)
    rest = tj.time_optimal(path, limits)
    rolling = tj.time_optimal(path, limits, start_speed=0.1, end_speed=0.05)
    assert rolling.duration < rest.duration
    np.testing.assert_allclose(rolling.motion(0.0, 1), path(0.0, 1) * 0.1, atol=1e-9)
    np.testing.assert_allclose(rolling.motion(rolling.duration, 1), path(1.0, 1) * 0.05, atol=1e-7)
    fast = tj.time_optimal(path, limits, start_speed=50.0)
    assert fast.status is tj.TimingStatus.START_SPEED
    with pytest.raises(UnsuccessfulError, match="start_speed is 50; expected at least 0 and at most"):
        fast.require_success()
    end = tj.time_optimal(path, limits, end_speed=50.0)
    assert end.status is tj.TimingStatus.END_SPEED
    assert "end_speed is 50" in end.explain()


def test_kinks_are_passed_at_rest() -> None:
    path = tj.polyline([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    limits = tj.Limits(velocity=10.0, acceleration=1.0)
    timing = tj.time_optimal(path, limits, grid=400)
    assert timing.motion.check(limits).success
    assert timing.duration == pytest.approx(4.0, rel=1e-3)  # two bang-bang metres
    assert timing.speed[np.searchsorted(timing.grid, 1.0)] == 0.0


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_the_unit_of_a_path_does_not_matter(unit: float) -> None:
    """Kinks, extrema and jumps are measured by the size of the path: the same motion in every unit."""
    points = np.array([[0.0, 5.0, 0.0], [1.0, 5.0, 0.3], [1.0, 5.0, 1.0], [0.4, 5.0, -1.0]])
    limits = tj.Limits(velocity=unit, acceleration=2.0 * unit)
    for path, same in (
        (tj.polyline(points), tj.polyline(points * unit)),
        (tj.Spline(points), tj.Spline(points * unit)),
    ):
        one = tj.time_optimal(path, {"velocity": 1.0, "acceleration": 2.0})
        timing = tj.time_optimal(same, limits)
        assert timing.duration == pytest.approx(one.duration, rel=1e-6)
        assert timing.violation == 0.0
        assert timing.motion.continuity(1e-7) == 1


def test_a_path_that_leaves_its_limits_of_position_is_named() -> None:
    """A spline through points within the limits may overshoot them; no timing mends that."""
    points = [[0.0, 0.0], [1.0, 0.1], [1.0, 1.0], [0.0, 0.9]]
    limits = tj.Limits(velocity=1.0, acceleration=2.0, position=[[-0.1, 1.0], [-1.0, 2.0]])
    timing = tj.time_optimal(tj.Spline(points), limits)
    assert timing.status is tj.TimingStatus.INFEASIBLE
    with pytest.raises(
        UnsuccessfulError, match=r"At s = 0\.[45].*position of coordinate 0 is 1\.1.*limit is \[-0\.1, 1"
    ):
        timing.require_success()
    assert tj.time_optimal(tj.polyline(points), limits).violation == 0.0
    many = tj.time_optimal_many([tj.polyline(points), tj.Spline(points)], limits)
    assert many.success.tolist() == [True, False]
    assert repr(timing).startswith("Timing(No speed along the path")
    assert repr(many).startswith("Timings(1 of 2 paths timed; path 1")


def test_a_torn_path_is_refused() -> None:
    torn = tj.PolynomialPath([0.0, 1.0, 2.0], [[[0.0, 0.0], [1.0, 0.0]], [[5.0, 0.0], [1.0, 0.0]]])
    with pytest.raises(InputError, match=r"the path jumps by 4 at s = 1; its pieces must meet"):
        tj.time_optimal(torn, tj.Limits(1.0, 1.0))
    with pytest.raises(InputError, match=r"the path jumps by 4 at s = 1"):
        tj.time_optimal_many([tj.polyline([[0.0, 0.0], [1.0, 1.0], [1.0, 2.0]])] * 20 + [torn], tj.Limits(1.0, 1.0))


def test_paths_whose_parameter_stands_still() -> None:
    """q' = 0 at the ends or inside (singular parametrisation): the same motion as along the regular path."""
    line = tj.time_optimal(tj.polyline([[0.0, 0.0], [1.0, 2.0]]), tj.Limits(1.0, 2.0)).duration
    for piece in ([[0.0, 0.0], [0.0, 0.0], [1.0, 2.0]], [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [1.0, 2.0]]):
        timing = tj.time_optimal(tj.PolynomialPath([0.0, 1.0], [piece]), tj.Limits(1.0, 2.0))
        assert timing.violation == 0.0
        assert timing.duration == pytest.approx(line, rel=5e-3)
    inside = tj.PolynomialPath([-1.0, 1.0], [[[-1.0, -2.0], [3.0, 6.0], [-3.0, -6.0], [1.0, 2.0]]])  # (s³, 2 s³)
    timing = tj.time_optimal(inside, tj.Limits(1.0, 2.0))
    assert timing.violation == 0.0
    assert 4.5 <= timing.duration < 5.1  # 4.5 along the regular path; ṡ would have to be infinite in the middle


def test_refining_the_grid_never_breaks_limits_and_converges() -> None:
    path = tj.Spline(np.random.default_rng(9).normal(size=(6, 7)))
    limits = tj.Limits(velocity=1.0, acceleration=3.0)
    durations = [tj.time_optimal(path, limits, grid=n).duration for n in (100, 400, 1600)]
    assert abs(durations[2] - durations[1]) < 0.003 * durations[2]
    own = tj.time_optimal(path, limits, grid=np.linspace(0.0, 1.0, 401))
    assert own.grid.size >= 401
    assert own.duration == pytest.approx(durations[1], rel=1e-2)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6))
def test_any_path_any_scale_any_grid(seed: int) -> None:
    """Splines, B-splines, rounded and bare polylines over many magnitudes: solved, proven, and at the goal."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 9)), int(rng.integers(6, 12))
    points = rng.normal(size=(m, n)) * 10 ** rng.uniform(-3, 2)
    path = [
        lambda: tj.Spline(points, exponent=0.5),
        lambda: tj.BSpline.through(points, 5),
        lambda: tj.rounded(points, 10 ** rng.uniform(-4, 0)),
        lambda: tj.polyline(points),
    ][int(rng.integers(4))]()
    limits = tj.Limits(velocity=10 ** rng.uniform(-2, 2, n), acceleration=10 ** rng.uniform(-2, 2, n))
    timing = tj.time_optimal(path, limits, grid=int(rng.choice([1, 7, 40, 300])))
    timing.require_success()
    assert timing.report.success, timing.report.explain()
    np.testing.assert_allclose(timing.motion.end, points[-1], atol=1e-7 * (1.0 + np.abs(points).max()))


def test_a_grid_too_coarse_to_move_is_named() -> None:
    path = tj.polyline([[0.0], [1.0]])
    timing = tj.time_optimal(path, tj.Limits(acceleration=1.0), grid=[0.0, 1.0])
    assert timing.status is tj.TimingStatus.STALLED
    assert "give a finer grid" in timing.explain()
    assert tj.time_optimal(path, tj.Limits(acceleration=1.0), grid=1).success


def test_toppra_is_not_faster_at_the_same_grid() -> None:
    toppra = pytest.importorskip("toppra")
    toppra.setup_logging("ERROR")
    rng = np.random.default_rng(11)
    for _ in range(3):
        W, knots = rng.normal(size=(5, 7)), np.linspace(0.0, 1.0, 5)
        V, A = rng.uniform(1.0, 3.0, 7), rng.uniform(4.0, 10.0, 7)
        peer = toppra.algorithm.TOPPRA(
            [toppra.constraint.JointVelocityConstraint(V), toppra.constraint.JointAccelerationConstraint(A)],
            toppra.SplineInterpolator(knots, W),
            gridpoints=np.linspace(0.0, 1.0, 1001),
        )
        peer.compute_parameterization(0, 0)
        sd = peer.problem_data.sd_vec
        theirs = float(np.sum(2e-3 / (sd[1:] + sd[:-1])))
        ours = tj.time_optimal(tj.Spline(W, knots), tj.Limits(velocity=V, acceleration=A), grid=1000).duration
        assert ours <= theirs * 1.001


def test_spline_is_the_interpolant_of_scipy() -> None:
    for case in reference("traj_polynomial_splines.json")["cases"]:
        if case["id"].startswith("cubic_spline/"):
            g, e = case["inputs"], case["expected"]
            spline = tj.Spline(g["values"], g["knots"], ends=g["bc"])
            for order, key in enumerate(("q", "qd", "qdd")):
                np.testing.assert_allclose(spline(e["x"], order), e[key], atol=1e-8)


def test_polynomials_agree_with_scipy() -> None:
    spline = tj.Spline(np.random.default_rng(0).normal(size=(6, 2)))
    pp = PPoly(np.transpose(spline.coefficients[:, ::-1], (1, 0, 2)), spline.breaks)
    s = np.linspace(0.0, 1.0, 41)
    np.testing.assert_allclose(spline(s, 1), pp(s, 1), atol=1e-9)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda p: tj.time_optimal(p, {"velocity": 1.0, "acceleration": 1.0}, grid=0), "grid is 0"),
        (lambda p: tj.time_optimal(p, {"velocity": 1.0, "acceleration": 1.0}, grid=[0.0, 0.5]), "from 0 to 1"),
        (lambda p: tj.time_optimal(p, {"acceleration": 1.0}, start_speed=-1.0), "start_speed is -1.0"),
        (lambda p: tj.time_optimal(p, {"acceleration": 1.0}, least=0), "least is 0"),
        (lambda p: tj.time_optimal(p, {"acceleration": 1.0}, end_speed=np.nan), "end_speed is nan"),
        (lambda p: tj.Spline([[0.0], [1.0]], [0.0]), "one per waypoint"),
        (lambda p: tj.Spline([[0.0], [1.0]], [1.0, 0.0]), r"knots\[0\] = 1"),
        (lambda p: tj.Spline([[0.0], [1.0], [0.5]], ends="periodic"), "must end where it starts"),
        (lambda p: tj.Spline([[0.0], [1.0]], ends="loose"), "ends is 'loose'"),
        (lambda p: tj.Spline([[0.0], [1.0]], exponent=2.0), "exponent is 2.0"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call(tj.Spline([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]]))
