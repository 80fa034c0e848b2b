"""Prioritised steps: strict priorities, exact limits, and the optimum of every level against a QP solver."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import ik
from apprehend.errors import InputError, UnknownNameError
from apprehend.ik.step import assemble
from apprehend.kernels.ik_priority import brake, prioritised, priority_work
from apprehend.kernels.ik_saturate import saturate_work
from apprehend.kernels.ik_step import steps_block
from apprehend.kernels.ik_tasks import task_block
from apprehend.kernels.lanes import LANES
from apprehend.kernels.tree import tree_block
from apprehend.kinematics import Robot
from apprehend.robots.description import Description, Inertial, Joint, JointLimits, Link

from .makers import chain, configurations, random_pose, two_arms


def with_limits(robot: Robot, velocity: float, acceleration: float) -> Robot:
    d = robot.description
    joints = tuple(
        Joint(
            j.name,
            j.type,
            j.parent,
            j.child,
            j.pose,
            j.axis,
            JointLimits(j.limits.lower, j.limits.upper, velocity, acceleration),
            j.mimic,
        )
        for j in d.joints
    )
    rng = np.random.default_rng(0)
    links = {
        name: Link(name, Inertial(rng.uniform(0.5, 2.0), rng.normal(size=3) * 0.1, np.eye(3) * 0.01))
        for name in d.links
    }
    return Robot(Description(d.name, d.root, links, joints))


def rows_of(robot: Robot, tasks: list, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian and errors of all tasks at one q, from the lanes."""
    program = assemble(robot, tasks, q[None])
    rows, n, m = program.tasks.weight.size, robot.n, robot.model.kind.size
    buffer = np.repeat(q, LANES)
    poses, value = np.empty(12 * m * LANES), np.empty(LANES)
    J, e = np.zeros(rows * n * LANES), np.zeros(rows * LANES)
    tree_block(robot.model, buffer, value, poses)
    task_block(robot.model, program.tasks, program.data, program.goal, buffer, 0, 1, poses, J, e)
    return J.reshape(rows, n, LANES)[..., 3], e.reshape(rows, LANES)[:, 3]


def all_tasks(robot: Robot, seed: int) -> list:
    rng = np.random.default_rng(seed)
    T = random_pose(rng, 0.3)
    return [
        ik.PoseTask("left_tip", T),
        ik.PositionTask("right_tip", rng.normal(size=3), point=(0.1, -0.2, 0.05)),
        ik.OrientationTask("right_tip", random_pose(rng, 0.1)[:3, :3]),
        ik.DirectionTask("left_tip", rng.normal(size=3), axis=(1.0, 2.0, -1.0)),
        ik.LookAtTask("right_tip", rng.normal(size=3), axis=(0.0, 1.0, 0.2), eye=(0.05, 0.0, 0.1)),
        ik.ComTask(rng.normal(size=3)),
        ik.RelativeTask("right_tip", "left_tip", random_pose(rng, 0.3)),
        ik.JointTask(("torso", "left_j3"), [0.1, 0.2]),
    ]


@pytest.mark.parametrize("number", range(8))
def test_a_small_step_removes_the_error_as_the_jacobian_says(number: int) -> None:
    """e(q + h d) = e(q) − h J d to first order: rows against finite differences, near the target where e is small."""
    robot = with_limits(two_arms(1), 2.0, 10.0)
    rng = np.random.default_rng(number)
    for _ in range(5):
        q = configurations(robot, 1, int(rng.integers(1000)))[0] * 0.7
        T = robot.fk(q)
        left, right = T[robot.frame_index("left_tip")], T[robot.frame_index("right_tip")]
        tilt = random_pose(rng, 0.0)
        small = np.eye(4)
        small[:3, :3] = np.linalg.qr(np.eye(3) + 0.01 * (tilt[:3, :3] - tilt[:3, :3].T))[0]
        small[:3, :3] *= np.sign(np.diag(small[:3, :3]))
        axis = left[:3, :3] @ np.array([1.0, 2.0, -1.0])
        ray = right[:3, :3] @ np.array([0.0, 1.0, 0.2])
        eye = right[:3, 3] + right[:3, :3] @ np.array([0.05, 0.0, 0.1])
        task = [
            ik.PoseTask("left_tip", left @ small),
            ik.PositionTask("right_tip", right[:3, 3] + 0.1, point=(0.1, -0.2, 0.05)),
            ik.OrientationTask("right_tip", right[:3, :3] @ small[:3, :3]),
            ik.DirectionTask("left_tip", axis + 0.001 * rng.normal(size=3), axis=(1.0, 2.0, -1.0)),
            ik.LookAtTask("right_tip", eye + 0.7 * ray + 0.001, axis=(0.0, 1.0, 0.2), eye=(0.05, 0.0, 0.1)),
            ik.ComTask(robot.com(q) + 0.1),
            ik.RelativeTask("right_tip", "left_tip", np.linalg.inv(left) @ right @ small),
            ik.JointTask(("torso", "left_j3"), [0.1, 0.2]),
        ][number]
        J, _e = rows_of(robot, [task], q)
        d = rng.normal(size=robot.n)
        h = 1e-6
        _, plus = rows_of(robot, [task], q + h * d)
        _, minus = rows_of(robot, [task], q - h * d)
        change = (plus - minus) / (2 * h)
        assert np.allclose(change, -(J @ d), atol=0.03 * np.linalg.norm(J @ d) + 1e-6), type(task).__name__


def test_tasks_converge_to_what_they_say() -> None:
    robot = with_limits(two_arms(1), 2.0, 10.0)
    goal = configurations(robot, 1, 7)[0] * 0.5
    T = robot.fk(goal)
    left, right = T[robot.frame_index("left_tip")], T[robot.frame_index("right_tip")]
    tasks = [
        ik.RelativeTask("right_tip", "left_tip", np.linalg.inv(left) @ right),
        ik.PositionTask("left_tip", left[:3, 3]),
        ik.LookAtTask("left_tip", left[:3, 3] + 0.5 * left[:3, 2]),
        ik.PostureTask(goal),
    ]
    stepper = ik.Stepper(robot, tasks, 0.05)
    q = goal + 0.1
    for _ in range(600):
        q = robot.limits.clip(q + stepper(q))
    X = robot.fk(q)
    left2, right2 = X[robot.frame_index("left_tip")], X[robot.frame_index("right_tip")]
    assert np.allclose(np.linalg.inv(left2) @ right2, np.linalg.inv(left) @ right, atol=1e-8)
    assert np.allclose(left2[:3, 3], left[:3, 3], atol=1e-8)
    assert np.allclose(left2[:3, 2], left[:3, 2], atol=1e-8)
    assert np.allclose(q, goal, atol=1e-3)


Problem = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def random_problems(rng: np.random.Generator) -> tuple[np.ndarray, list[Problem]]:
    """Levels, and for every lane a Jacobian, errors and bounds."""
    n = int(rng.integers(3, 10))
    sizes = rng.integers(1, 5, int(rng.integers(1, 4)))
    levels = np.cumsum([0, *sizes]).astype(np.int64)
    made = []
    for _ in range(LANES):
        J = rng.normal(size=(levels[-1], n))
        if rng.random() < 0.2 and len(sizes) > 1:  # a row that depends on those above
            J[levels[1]] = J[0] * 0.5
        if rng.random() < 0.2:
            J[-1] = 0.0
        lower = -rng.uniform(0.0, 1.0, n) * (rng.random(n) < 0.9)
        upper = rng.uniform(0.0, 1.0, n) * (rng.random(n) < 0.9)
        made.append((J, rng.normal(size=levels[-1]) * 2.0, lower, upper))
    return levels, made


def on_lanes(levels: np.ndarray, made: list[Problem], damping: float) -> tuple[np.ndarray, np.ndarray]:
    """Steps ``(LANES, n)`` of `steps_block`, and which of them it says not to use."""
    n = made[0][0].shape[1]
    J, e, low, high = (np.ascontiguousarray(np.stack(part, axis=-1)).reshape(-1) for part in zip(*made, strict=True))
    rows = J.size // (n * LANES)
    dq, N, A, H = np.empty(n * LANES), np.empty(n * n * LANES), np.empty(rows * n * LANES), np.empty(n * n * LANES)
    rest, z, y, u = np.empty(rows * LANES), np.empty(n * LANES), np.empty(n * LANES), np.empty(n * LANES)
    irregular = np.empty(LANES)
    steps_block(
        J, e, levels, damping, low, high, n, dq, N, A, H, rest, z, y, u, saturate_work(n), irregular
    )  # fmt: skip
    return dq.reshape(n, LANES).T, irregular


def best_by_clarabel(
    clarabel: object,
    here: np.ndarray,
    above: np.ndarray,
    target: np.ndarray,
    before: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    damping: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The level's quadratic form, and its minimiser with the rows above as they are."""
    from scipy import sparse

    n = before.size
    P = here.T @ here + damping * np.eye(n)
    f = -here.T @ target - damping * before
    _U, s, Vt = np.linalg.svd(above) if above.size else (None, np.zeros(0), np.eye(n))
    E = Vt[: int((s > 1e-9).sum())]
    A = sparse.csc_matrix(np.vstack([E, np.eye(n), -np.eye(n)]))
    b = np.concatenate([E @ before, upper, -lower])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.ZeroConeT(len(E)), clarabel.NonnegativeConeT(2 * n)]
    solver = clarabel.DefaultSolver(sparse.csc_matrix(np.triu(P)), f, A, b, cones, settings)
    return P, f, np.array(solver.solve().x)


def test_every_level_is_optimal_against_a_qp_solver() -> None:
    """Level by level: minimise the damped residual with the higher residuals fixed, by an independent solver; on lanes,
    and by the active-set method for one."""
    clarabel = pytest.importorskip("clarabel")
    rng = np.random.default_rng(0)
    damping = 1e-4
    regular = count = 0
    for _ in range(10):
        levels, made = random_problems(rng)
        n = made[0][0].shape[1]
        before = [[np.clip(0.0, lower, upper)] * 2 for _J, _e, lower, upper in made]
        for depth in range(1, len(levels)):
            lanes, irregular = on_lanes(levels[: depth + 1], made, damping)
            for i, (J, e, lower, upper) in enumerate(made):
                one = np.empty(n)
                prioritised(J, e, levels[: depth + 1], damping, lower, upper, one, priority_work(n, J.shape[0]))
                above, here = J[: levels[depth - 1]], J[levels[depth - 1] : levels[depth]]
                target = e[levels[depth - 1] : levels[depth]]
                count += 1
                regular += irregular[i] == 0.0
                for way, dq in enumerate((one, lanes[i] if irregular[i] == 0.0 else one)):
                    assert (dq >= lower).all()
                    assert (dq <= upper).all()
                    assert np.abs(above @ (dq - before[i][way])).max(initial=0.0) < 1e-9
                    P, f, x = best_by_clarabel(clarabel, here, above, target, before[i][way], lower, upper, damping)
                    ours = 0.5 * dq @ P @ dq + f @ dq
                    theirs = 0.5 * x @ P @ x + f @ x
                    assert ours <= theirs + 1e-6 * (1.0 + abs(theirs))
                    before[i][way] = dq
    assert regular > 0.6 * count  # rows that depend on others are left to the method for one


def test_lanes_and_active_set_agree_and_nothing_is_ever_violated() -> None:
    robot = with_limits(chain("RRRRRRR", seed=3), 1.5, 8.0)
    q = configurations(robot, 4000)
    goal = robot.limits.clip(q + np.random.default_rng(1).normal(size=q.shape) * 0.018)
    T = robot.fk(goal, "tip")
    pose, look = ik.PositionTask("tip", T[:, :3, 3]), ik.DirectionTask("tip", T[:, :3, 2])
    posture = ik.PostureTask(robot.home, gain=0.01)
    dt = 0.02
    three = ik.step(robot, q, [pose, look, posture], dt)
    two = ik.step(robot, q, [pose, look], dt)
    one = ik.step(robot, q, [pose], dt)
    lower, upper = robot.limits.lower, robot.limits.upper
    assert np.max(np.maximum(q + three - upper, lower - q - three)) <= 1e-12
    assert np.abs(three).max() <= 1.5 * dt + 1e-12
    J = robot.jacobian(q, "tip")
    first = np.einsum("nij,nj->ni", J[:, :3], three - one)
    assert np.abs(first).max() < 1e-9
    axis = robot.fk(q, "tip")[:, :3, 2]
    turn = np.cross(np.einsum("nij,nj->ni", J[:, 3:], three - two), axis)
    assert np.abs(turn).max() < 1e-9
    # some met a bound, some did not: both ways were taken
    met = (np.abs(three) >= 1.5 * dt - 1e-12).any(axis=1)
    assert 0.05 < met.mean() < 0.95
    for i in (0, 100, 3999):
        alone = ik.step(
            robot,
            q[i],
            [ik.PositionTask("tip", T[i, :3, 3]), ik.DirectionTask("tip", T[i, :3, 2]), posture],
            dt,
        )
        assert np.allclose(alone, three[i], atol=1e-9)


def test_position_velocity_and_acceleration_limits_hold_over_a_long_run() -> None:
    robot = with_limits(chain("RRRRRRR", seed=4), 1.5, 6.0)
    rng = np.random.default_rng(0)
    dt = 0.01
    q = configurations(robot, 200) * 0.5
    v = np.zeros_like(q)
    for _ in range(15):
        T = robot.fk(configurations(robot, 200, int(rng.integers(10**6))), "tip")
        stepper = ik.Stepper(robot, [ik.PoseTask("tip", T), ik.DescentTask("limits")], dt)
        for _ in range(20):
            dq = stepper(q, velocity=v)
            assert np.abs(dq / dt).max() <= 1.5 + 1e-12 / dt
            assert np.abs(dq / dt - v).max() <= 6.0 * dt + 1e-9
            q, v = q + dq, dq / dt
            assert np.max(np.maximum(q - robot.limits.upper, robot.limits.lower - q)) <= 1e-12


def test_braking_is_the_largest_velocity_that_can_still_stop() -> None:
    rng = np.random.default_rng(0)
    for _ in range(500):
        d, a, dt = rng.uniform(0.0, 2.0), rng.uniform(0.1, 20.0), rng.uniform(1e-3, 0.1)
        v = brake(d, a, dt)
        way, w = 0.0, v
        while w > 0.0:
            way += w * dt
            w -= a * dt
        assert way <= d * (1 + 1e-12)
        w, way = v * 1.01 + 1e-9, 0.0
        while w > 0.0:
            way += w * dt
            w -= a * dt
        assert way > d


def test_weights_gains_and_shared_levels() -> None:
    robot = chain("RRRRRRR", seed=5)
    q = configurations(robot, 1)[0] * 0.5
    T = robot.fk(q, "tip")
    T[:3, 3] += 0.01
    J = robot.jacobian(q, "tip")
    full = ik.step(robot, q, [ik.PoseTask("tip", T)], 1.0, damping=0.0)
    assert np.allclose(J[:3] @ full, 0.01, atol=1e-7)
    half = ik.step(robot, q, [ik.PoseTask("tip", T, gain=0.5)], 1.0, damping=0.0)
    assert np.allclose(half, 0.5 * full, atol=1e-7)
    partial = ik.step(robot, q, [ik.PoseTask("tip", T, weight=[1, 1, 1, 0, 0, 0])], 1.0, damping=0.0)
    position = ik.step(robot, q, [ik.PositionTask("tip", T[:3, 3])], 1.0, damping=0.0)
    assert np.allclose(J[:3] @ partial, J[:3] @ position, atol=1e-9)
    conflict = [ik.PositionTask("tip", T[:3, 3]), ik.PositionTask("tip", T[:3, 3] - 0.02)]
    both = ik.step(robot, q, [conflict], 1.0, damping=0.0)
    assert np.allclose(J[:3] @ both, 0.0, atol=1e-7)
    strict = ik.step(robot, q, conflict, 1.0, damping=0.0)
    assert np.allclose(J[:3] @ strict, 0.01, atol=1e-7)


def test_descent_lowers_its_cost_without_moving_the_frame() -> None:
    robot = chain("RRRRRRR", seed=6)
    q = configurations(robot, 1)[0] * 0.8
    T = robot.fk(q, "tip")
    middle, span = robot.home, robot.limits.upper - robot.limits.lower

    def limits(x: np.ndarray) -> float:
        return float((((x - middle) / span) ** 2).sum())

    def manipulability(x: np.ndarray) -> float:
        J = robot.jacobian(x, "tip")
        return float(np.sqrt(np.linalg.det(J @ J.T)))

    x = q.copy()
    for _ in range(100):
        x = x + ik.step(robot, x, [ik.PoseTask("tip", T), ik.DescentTask("limits")], 0.1)
    assert limits(x) < limits(q)
    assert np.allclose(robot.fk(x, "tip"), T, atol=1e-5)
    y = q.copy()
    for _ in range(100):
        y = y + ik.step(robot, y, [ik.PoseTask("tip", T), ik.DescentTask("manipulability", 0.02, "tip")], 0.1)
    assert manipulability(y) > manipulability(q)
    own = ik.step(robot, q, [ik.DescentTask(lambda z: z - middle, 0.5)], 10.0)
    assert np.allclose(own, 0.5 * (middle - q), atol=1e-5)


def test_track_follows_a_path_without_a_jump_and_says_where_it_is_lost() -> None:
    robot = chain("RRRRRRR", seed=2)
    q0 = configurations(robot, 1, 3)[0] * 0.4
    T0 = robot.fk(q0, "tip")
    path = np.repeat(T0[None], 40, axis=0)
    path[:, :3, 3] += np.linspace(0.0, 1.0, 40)[:, None] * np.array([0.03, -0.05, 0.02])
    done = ik.track(robot, path, "tip", q0)
    assert done.success
    assert done.largest_step < 0.2
    assert np.allclose(robot.fk(done.q, "tip"), path, atol=2e-6)
    assert "largest joint step" in done.explain()
    path[20:, :3, 3] += 50.0
    lost = ik.track(robot, path, "tip", q0, max_steps=5)
    assert not lost.success
    assert "the first is pose 20 of 40" in lost.explain()


def test_bad_arguments_are_named() -> None:
    robot = chain("RRRRRR")
    q = robot.home
    T = np.eye(4)
    pose = ik.PoseTask("tip", T)
    with pytest.raises(InputError, match="tasks is empty"):
        ik.step(robot, q, [], 0.1)
    with pytest.raises(InputError, match="tasks is one PoseTask; expected a sequence"):
        ik.step(robot, q, pose, 0.1)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="dt is 0"):
        ik.step(robot, q, [pose], 0)
    with pytest.raises(InputError, match="damping is -1"):
        ik.step(robot, q, [pose], 0.1, damping=-1)
    with pytest.raises(InputError, match="q of joint 'j2' is 9, outside its limits"):
        ik.step(robot, np.where(np.arange(6) == 2, 9.0, q), [pose], 0.1)
    with pytest.raises(InputError, match="tasks holds 'tip'; expected tasks"):
        ik.step(robot, q, [["tip"]], 0.1)  # type: ignore[list-item]
    with pytest.raises(UnknownNameError, match="no frame named 'tap'"):
        ik.step(robot, q, [ik.PoseTask("tap", T)], 0.1)
    with pytest.raises(InputError, match=r"PoseTask.weight has shape \(3,\)"):
        ik.step(robot, q, [ik.PoseTask("tip", T, weight=[1, 1, 1])], 0.1)
    with pytest.raises(InputError, match="weights must not be negative"):
        ik.step(robot, q, [ik.PoseTask("tip", T, weight=-1)], 0.1)
    with pytest.raises(InputError, match=r"PoseTask.gain is 2"):
        ik.step(robot, q, [ik.PoseTask("tip", T, gain=2)], 0.1)
    with pytest.raises(InputError, match=r"DirectionTask.direction is zero"):
        ik.step(robot, q, [ik.DirectionTask("tip", [0, 0, 0])], 0.1)
    with pytest.raises(InputError, match="has no mass"):
        ik.step(robot, q, [ik.ComTask([0, 0, 0])], 0.1)
    with pytest.raises(InputError, match="the manipulability is that of a frame"):
        ik.step(robot, q, [ik.DescentTask("manipulability")], 0.1)
    with pytest.raises(UnknownNameError, match="no cost named 'limit'"):
        ik.step(robot, q, [ik.DescentTask("limit")], 0.1)
    with pytest.raises(InputError, match=r"DescentTask.rate is 0"):
        ik.step(robot, q, [ik.DescentTask("limits", 0)], 0.1)
    with pytest.raises(InputError, match="task 0 has a batch of 2 targets, but there are 3 joint vectors"):
        ik.step(robot, np.tile(q, (3, 1)), [ik.PoseTask("tip", np.tile(T, (2, 1, 1)))], 0.1)
    with pytest.raises(InputError, match="task 0 cannot become a PostureTask; the tasks are PoseTask"):
        ik.Stepper(robot, [pose], 0.1).retarget(0, ik.PostureTask(q))
    with pytest.raises(InputError, match="expected a path"):
        ik.track(robot, T, "tip", q)
    with pytest.raises(InputError, match="tolerance is 0"):
        ik.track(robot, T[None], "tip", q, tolerance=0)


def test_bad_targets_are_named_for_one_and_in_batches() -> None:
    robot = with_limits(chain("RRRRRRR"), 1.0, 5.0)
    q = np.tile(robot.home, (40, 1))
    T = np.tile(np.eye(4), (40, 1, 1))
    bad = T.copy()
    bad[33, 0, 3] = np.nan
    with pytest.raises(InputError, match=r"PoseTask.T\[33, 0, 3\] is nan"):
        ik.step(robot, q, [ik.PostureTask(q), ik.PoseTask("tip", bad)], 0.1)
    skew = np.eye(4)
    skew[0, 1] = 0.1
    for task in (
        ik.PoseTask("tip", skew),
        ik.RelativeTask("tip", "base", skew),
        ik.OrientationTask("tip", skew[:3, :3]),
    ):
        with pytest.raises(InputError, match=r"is not a rotation: RᵀR differs from 1 by 0.1"):
            ik.step(robot, q[0], [task], 0.1)
    with pytest.raises(InputError, match="is a reflection"):
        ik.step(robot, q[0], [ik.OrientationTask("tip", -np.eye(3))], 0.1)
    with pytest.raises(InputError, match="a last row other than"):
        ik.step(robot, q[0], [ik.PoseTask("tip", np.ones((4, 4)))], 0.1)
    for task, name in (
        (ik.PositionTask("tip", [0, np.inf, 0]), "PositionTask.position"),
        (ik.LookAtTask("tip", [0, np.nan, 0]), "LookAtTask.target"),
        (ik.DirectionTask("tip", [0, np.nan, 0]), "DirectionTask.direction"),
        (ik.ComTask([0, np.nan, 0]), "ComTask.position"),
    ):
        with pytest.raises(InputError, match=rf"{name}\[1\] is (nan|inf); every entry must be finite"):
            ik.step(robot, q[0], [task], 0.1)
    with pytest.raises(InputError, match=r"PostureTask.q\[2\] is nan"):
        ik.step(robot, q[0], [ik.PostureTask(np.where(np.arange(7) == 2, np.nan, 0.0))], 0.1)
    with pytest.raises(InputError, match=r"JointTask.values\[0\] is nan"):
        ik.step(robot, q[0], [ik.JointTask(["j1"], [np.nan])], 0.1)
    with pytest.raises(InputError, match="expected a sequence of names"):
        ik.step(robot, q[0], [ik.JointTask("j1", [0.0])], 0.1)
    with pytest.raises(InputError, match=r"q\[0, 3\] is nan"):
        ik.step(robot, np.where(np.arange(7) == 3, np.nan, q[0]), [ik.PostureTask(q[0])], 0.1)
    with pytest.raises(InputError, match=r"the gradient of DescentTask.cost\[0, 0\] is nan"):
        ik.step(robot, q[0], [ik.DescentTask(lambda x: np.full_like(x, np.nan))], 0.1)


def test_a_batch_of_targets_is_as_its_members_one_by_one() -> None:
    robot = with_limits(two_arms(1), 1.0, 5.0)
    q = configurations(robot, 20) * 0.5
    T = robot.fk(configurations(robot, 20, 1), "left_tip")
    posture = ik.PostureTask(configurations(robot, 20, 2), weight=0.0)
    look = ik.LookAtTask("right_tip", T[:, :3, 3], weight=[1.0, 0.0])
    every = ik.step(robot, q, [[ik.PoseTask("left_tip", T), look], posture], 0.05)
    for i in range(20):
        alone = [ik.PoseTask("left_tip", T[i]), ik.LookAtTask("right_tip", T[i, :3, 3], weight=(1.0, 0.0))]
        assert np.allclose(ik.step(robot, q[i], [alone], 0.05), every[i], atol=1e-9)
