"""Global inverse kinematics on made-up chains: what it returns is checked with the robot's forward kinematics."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import ik, parallel
from apprehend.errors import InputError, UnknownNameError, UnsuccessfulError
from apprehend.ik import IKStatus
from apprehend.kinematics import Robot

from .makers import chain, configurations, two_arms


def errors(robot: Robot, q: np.ndarray, T: np.ndarray, frame: str) -> tuple[np.ndarray, np.ndarray]:
    X = robot.fk(q, frame)
    distance = np.linalg.norm(X[..., :3, 3] - T[..., :3, 3], axis=-1)
    R = X[..., :3, :3] @ np.swapaxes(T[..., :3, :3], -1, -2)
    angle = np.linalg.norm(R - np.eye(3), axis=(-2, -1)) / np.sqrt(2.0)  # 2 sin(θ/2)
    return distance, angle


@pytest.mark.parametrize(
    "kinds", ["RRRRRR", "RRRRRRR", "RCRFRCRR", "PRRRRRR", "RRPRRPR", "CCCCCC", "RR", "RPR", "RRRRRRRRR"]
)
def test_reaches_what_its_own_joints_reach(kinds: str) -> None:
    robot = chain(kinds, seed=len(kinds))
    T = robot.fk(configurations(robot, 400), "tip")
    sol = ik.solve(robot, T, "tip")
    assert sol.success.mean() >= 0.995
    good = sol.success
    distance, angle = errors(robot, sol.q[good], T[good], "tip")
    assert distance.max() <= 1e-6
    assert angle.max() <= 1e-6
    assert np.allclose(sol.residual[good], np.stack([distance, angle], axis=1), atol=1e-9)
    assert robot.limits.contains(sol.q).all()


def test_mimicking_joints_move_with_their_driver() -> None:
    robot = chain("RRRRPRRR", seed=3, mimic={3: (1, 0.5, 0.1), 6: (5, -1.0, 0.0)})
    assert robot.n == 6
    T = robot.fk(configurations(robot, 300), "tip")
    sol = ik.solve(robot, T, "tip")
    assert sol.success.mean() >= 0.99
    distance, angle = errors(robot, sol.q[sol.success], T[sol.success], "tip")
    assert max(distance.max(), angle.max()) <= 1e-6


def test_only_the_chain_moves_in_a_tree_and_the_base_counts() -> None:
    placed = np.eye(4)
    placed[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    placed[:3, 3] = (0.5, -2.0, 1.0)
    robot = two_arms().placed(placed)
    q = configurations(robot, 200)
    T = robot.fk(q, "left_tip")
    sol = ik.solve(robot, T, "left_tip", q0=robot.home + 0.01)
    assert sol.success.mean() >= 0.98
    others = [i for i in range(robot.n) if i not in robot.chain("left_tip")]
    assert len(others) == 6
    assert np.array_equal(sol.q[:, others], np.broadcast_to((robot.home + 0.01)[others], (200, 6)))
    distance, angle = errors(robot, sol.q[sol.success], T[sol.success], "left_tip")
    assert max(distance.max(), angle.max()) <= 1e-6


def test_a_guess_at_the_solution_is_kept() -> None:
    robot = chain("RRRRRRR", seed=2)
    q = configurations(robot, 100)
    sol = ik.solve(robot, robot.fk(q, "tip"), "tip", q0=q)
    assert np.array_equal(sol.q, q)
    near = robot.limits.clip(q + 1e-3)
    close = ik.solve(robot, robot.fk(q, "tip"), "tip", q0=near)
    assert np.abs(close.q - q).max() < 0.05


def test_the_answer_depends_neither_on_the_batch_nor_on_threads() -> None:
    robot = chain("RRRRRR", seed=5)
    T = robot.fk(configurations(robot, 600), "tip")
    before = parallel.threads()
    try:
        parallel.set_threads(1)
        one = ik.solve(robot, T, "tip")
        parallel.set_threads(2)
        two = ik.solve(robot, T, "tip")
    finally:
        parallel.set_threads(before)
    assert np.array_equal(one.q, two.q)
    assert np.array_equal(one.starts, two.starts)
    for i in (0, 17, 599):
        alone = ik.solve(robot, T[i], "tip")
        assert np.allclose(alone.q, one.q[i], atol=1e-9)
        assert int(alone.starts) == one.starts[i]
        assert alone.success is bool(one.success[i])


def test_several_solutions_differ_and_all_reach() -> None:
    robot = chain("RRRRRRR", seed=7)
    T = robot.fk(configurations(robot, 40), "tip")
    sol = ik.solve(robot, T, "tip", n_solutions=6, distinct=0.2)
    assert sol.q.shape == (40, 6, 7)
    assert sol.found.min() >= 1
    assert sol.found.mean() > 3
    for i in range(40):
        q = sol.solutions(i)
        assert q.shape == (sol.found[i], 7)
        distance, angle = errors(robot, q, T[i], "tip")
        assert max(distance.max(), angle.max()) <= 1e-6
        for a in range(len(q)):
            for b in range(a):
                assert np.abs(q[a] - q[b]).max() > 0.2
    alone = ik.solve(robot, T[3], "tip", n_solutions=6, distinct=0.2)
    assert np.allclose(alone.q, sol.q[3], atol=1e-9)


def test_whole_turns_are_taken_near_the_guess() -> None:
    robot = chain("CCCCCC", seed=1)
    q = configurations(robot, 50)
    T = robot.fk(q, "tip")
    guess = q + 4 * np.pi
    sol = ik.solve(robot, T, "tip", q0=guess)
    assert np.abs(sol.q - guess).max() < 1e-6
    home = ik.solve(robot, T, "tip")
    assert np.abs(home.q).max() <= np.pi + 1e-9


def test_tolerances_per_axis() -> None:
    robot = chain("RRRRRR", seed=11)
    T = robot.fk(configurations(robot, 200), "tip")
    inf = np.inf
    position = ik.solve(robot, T, "tip", tolerance=[1e-6] * 3 + [inf] * 3)
    assert position.success.all()
    assert position.residual[:, 0].max() <= 1.8e-6
    assert np.median(position.residual[:, 1]) > 0.1
    spin = ik.solve(robot, T, "tip", tolerance=[1e-6] * 5 + [inf])
    assert spin.success.all()
    z = robot.fk(spin.q, "tip")[:, :3, 2]
    assert np.abs(np.cross(z, T[:, :3, 2])).max() <= 1.8e-6
    assert (np.einsum("ij,ij->i", z, T[:, :3, 2]) > 0).all()
    box = np.array([0.01, 0.02, 1e-5, 0.1, 0.2, 0.05])
    loose = ik.solve(robot, T, "tip", tolerance=box)
    assert loose.success.all()
    X = robot.fk(loose.q, "tip")
    inside = np.einsum("nji,nj->ni", T[:, :3, :3], X[:, :3, 3] - T[:, :3, 3])
    assert (np.abs(inside) <= box[:3] + 1e-12).all()
    assert loose.starts.mean() <= position.starts.mean() + 2


@pytest.mark.parametrize("tolerance", [1e-6, 1e-4, 1e-3])
def test_six_equal_tolerances_are_as_quick_as_one_number(tolerance: float) -> None:
    robot = chain("RRRRRRR", seed=5)
    T = robot.fk(configurations(robot, 300), "tip")
    boxed = ik.solve(robot, T, "tip", tolerance=np.full(6, tolerance))
    plain = ik.solve(robot, T, "tip", tolerance=tolerance)
    assert boxed.success.all()
    assert boxed.starts.mean() <= plain.starts.mean() + 1.0


def test_out_of_reach_is_certified_and_told_apart() -> None:
    robot = chain("RRRRRR", seed=4)
    T = robot.fk(configurations(robot, 3), "tip")
    T[1, :3, 3] += (50.0, 0.0, 0.0)
    sol = ik.solve(robot, T, "tip", max_starts=30)
    assert list(sol.status) == [IKStatus.SUCCESS, IKStatus.OUT_OF_REACH, IKStatus.SUCCESS]
    assert sol.starts[1] == 0
    assert sol.certified.tolist() == [False, True, False]
    assert "certified by the lengths of the links" in sol.reason(1)
    assert "2 of 3 targets solved; target 1" in sol.explain()
    with pytest.raises(UnsuccessfulError, match="2 of 3 targets solved"):
        sol.require_success()
    assert np.isfinite(sol.q).all()


def test_bad_arguments_are_named() -> None:
    robot = chain("RRRRRR")
    T = np.eye(4)
    with pytest.raises(UnknownNameError, match=r"no frame named 'tipp'.*Did you mean 'tip'"):
        ik.solve(robot, T, "tipp")
    with pytest.raises(InputError, match="'base' of robot 'made' is fixed to its root"):
        ik.solve(robot, T, "base")
    with pytest.raises(InputError, match="T is not a rotation"):
        ik.solve(robot, np.diag([1.0, 2.0, 1.0, 1.0]), "tip")
    with pytest.raises(InputError, match=r"q0 has shape \(5,\); expected \(..., 6\)"):
        ik.solve(robot, T, "tip", q0=np.zeros(5))
    with pytest.raises(InputError, match=r"do not broadcast"):
        ik.solve(robot, np.broadcast_to(T, (3, 4, 4)), "tip", q0=np.zeros((2, 6)))
    with pytest.raises(InputError, match=r"tolerance has shape \(3,\)"):
        ik.solve(robot, T, "tip", tolerance=[1e-6] * 3)
    with pytest.raises(InputError, match="every entry must be positive"):
        ik.solve(robot, T, "tip", tolerance=0.0)
    with pytest.raises(InputError, match="nothing is asked for"):
        ik.solve(robot, T, "tip", tolerance=[np.inf] * 6)
    with pytest.raises(InputError, match="n_solutions is 0"):
        ik.solve(robot, T, "tip", n_solutions=0)
    with pytest.raises(InputError, match="max_starts is 0"):
        ik.solve(robot, T, "tip", max_starts=0)


def test_empty_and_shaped_batches() -> None:
    robot = chain("RRRRRR")
    assert ik.solve(robot, np.zeros((0, 4, 4)) + np.eye(4), "tip").q.shape == (0, 6)
    T = robot.fk(configurations(robot, 6).reshape(2, 3, 6), "tip")
    sol = ik.solve(robot, T, "tip", rng=np.random.default_rng(0))
    assert sol.q.shape == (2, 3, 6)
    assert sol.success.shape == (2, 3)
    assert sol.residual.shape == (2, 3, 2)
    assert "reaches the target" in sol.reason(1, 2)


def test_the_preferred_solution_comes_first() -> None:
    robot = chain("RRRRRRR", 4)
    T = robot.fk(configurations(robot, 40), "tip")
    wish = configurations(robot, 1, 9)[0]
    many = ik.solve(robot, T, "tip", n_solutions=16)
    best = ik.solve(robot, T, "tip", prefer=wish)
    three = ik.solve(robot, T, "tip", prefer=lambda q: np.abs(q - wish).max(axis=1), n_solutions=3)
    assert best.success.all()
    assert np.abs(robot.fk(best.q, "tip") - T).max() < 1e-5
    for i in range(40):
        gaps = np.sort(np.abs(many.solutions(i) - wish).max(axis=1))
        assert np.isclose(np.abs(best.q[i] - wish).max(), gaps[0])
        mine = np.abs(three.solutions(i) - wish).max(axis=1)
        assert np.allclose(mine, gaps[: len(mine)])
    assert np.array_equal(three.q[:, 0], best.q)
    assert best.residual.max() < 2e-6
    with pytest.raises(InputError, match=r"prefer has shape \(2,\)"):
        ik.solve(robot, T, "tip", prefer=[0.0, 1.0])
    with pytest.raises(InputError, match=r"prefer returned shape \(\) for 640"):
        ik.solve(robot, T, "tip", prefer=lambda q: 1.0)
    with pytest.raises(InputError, match="prefer returned NaN"):
        ik.solve(robot, T, "tip", prefer=lambda q: np.full(len(q), np.nan))


def test_numbers_and_generators_are_checked() -> None:
    robot = chain("RRRRRR")
    with pytest.raises(InputError, match=r"n_solutions is 2\.5; expected a whole number"):
        ik.solve(robot, np.eye(4), "tip", n_solutions=2.5)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="distinct is -1"):
        ik.solve(robot, np.eye(4), "tip", n_solutions=2, distinct=-1)
    with pytest.raises(InputError, match="rng is 3; expected a generator"):
        ik.solve(robot, np.eye(4), "tip", rng=3)  # type: ignore[arg-type]
