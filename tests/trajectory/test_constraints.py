"""Torque, power and Cartesian limits: kept at all times, recomputed by others, and failures that name themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import apprehend as ap
from apprehend import trajectory as tj
from apprehend.errors import InputError, UnsuccessfulError


@pytest.fixture(scope="module", params=["panda", "ur5"])
def robot(request) -> ap.Robot:
    try:
        return ap.Robot.load(request.param)
    except ap.errors.MissingDependencyError as error:
        pytest.skip(str(error))


def spline(robot: ap.Robot, seed: int) -> tj.Spline:
    rng = np.random.default_rng(seed)
    low, high = np.maximum(robot.limits.lower, -2.0), np.minimum(robot.limits.upper, 2.0)
    return tj.Spline(rng.uniform(low, high, size=(4, robot.n)))


def limits(robot: ap.Robot) -> tj.Limits:
    return tj.Limits(velocity=robot.limits.velocity, acceleration=3.0 * np.minimum(robot.limits.acceleration, 10.0))


def tool(robot: ap.Robot) -> str:
    """The frame that most coordinates move."""
    return max(robot.frame_names, key=lambda f: len(robot.chain(f)))


@pytest.mark.parametrize("seed", range(3))
def test_torques_stay_within_limits_at_all_times(robot: ap.Robot, seed: int) -> None:
    path = spline(robot, seed)
    still = np.abs(robot.gravity(path(np.linspace(0.0, 1.0, 300)))).max(axis=0)
    effort = np.maximum(0.35 * robot.limits.effort, 1.3 * still)
    timing = tj.time_optimal(path, limits(robot), constraints=[tj.TorqueLimits(robot, effort)], grid=100)
    motion = timing.require_success().motion
    assert timing.report.success
    t = np.linspace(0.0, motion.duration, 4001)
    torque = robot.inverse_dynamics(motion(t), motion(t, 1), motion(t, 2))
    used = (np.abs(torque) / effort).max(axis=1)
    assert used.max() <= 1.0 + 1e-9
    free = tj.time_optimal(path, limits(robot), grid=100)
    assert timing.duration >= free.duration * 0.999
    assert used.max() > 0.9 or timing.duration == pytest.approx(free.duration, rel=1e-2)


@pytest.mark.parametrize("kind", ["torque", "power", "speed", "acceleration"])
@pytest.mark.parametrize("grid", [20, 150])
def test_the_proven_violation_is_zero_and_true(robot: ap.Robot, kind: str, grid: int) -> None:
    """On coarse and fine grids, for cubics and quintics: what is proven holds at times that no sample saw."""
    frame = tool(robot)
    still = np.abs(robot.gravity(spline(robot, 8)(np.linspace(0.0, 1.0, 300)))).max(axis=0)
    effort = np.maximum(0.35 * robot.limits.effort, 1.5 * still)
    constraint = {
        "torque": lambda: tj.TorqueLimits(robot, effort),
        "power": lambda: tj.PowerLimits(robot, 12.0),
        "speed": lambda: tj.CartesianSpeed(robot, frame, linear=0.3, angular=0.7),
        "acceleration": lambda: tj.CartesianAcceleration(robot, frame, linear=1.0, angular=3.0),
    }[kind]()
    for path in (spline(robot, 8), tj.rounded(spline(robot, 8).waypoints, 0.2)):
        timing = tj.time_optimal(path, limits(robot), constraints=[constraint], grid=grid).require_success()
        assert timing.proven
        assert timing.violation <= 1e-9
        motion = timing.motion
        t = np.linspace(0.0, motion.duration, 20011)
        q, v, a = motion(t), motion(t, 1), motion(t, 2)
        if kind in ("torque", "power"):
            torque = robot.inverse_dynamics(q, v, a)
            used = np.abs(torque) / effort if kind == "torque" else np.abs(torque * v) / 12.0
        else:
            values = np.einsum("mij,mj->mi", robot.jacobian(q, frame), v)
            bounds = (0.3, 0.7)
            if kind == "acceleration":
                values, bounds = ap.kinematics.acceleration(robot, q, v, a, frame), (1.0, 3.0)
            used = np.linalg.norm(values.reshape(-1, 2, 3), axis=-1) / bounds
        assert used.max() <= 1.0 + 1e-9
        assert used.max() > 0.9 or (np.abs(v) / robot.limits.velocity).max() > 0.99


def test_torques_recomputed_by_pinocchio(robot: ap.Robot) -> None:
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromUrdf(str(robot.description.source))
    data = model.createData()
    mimics = {j.name: j.mimic.joint for j in robot.description.joints if j.mimic}  # the fingers: multiplier 1
    column = [robot.index(mimics.get(name, name)) for name in list(model.names)[1:]]
    assert [model.joints[k + 1].idx_q for k in range(len(column))] == list(range(model.nq))
    path = spline(robot, 5)
    still = np.abs(robot.gravity(path(np.linspace(0.0, 1.0, 300)))).max(axis=0)
    effort = np.maximum(0.35 * robot.limits.effort, 1.3 * still)
    timing = tj.time_optimal(path, limits(robot), constraints=[tj.TorqueLimits(robot, effort)], grid=100)
    motion = timing.require_success().motion
    used = 0.0
    for t in np.linspace(0.0, motion.duration, 1500):
        torque = np.zeros(robot.n)
        np.add.at(torque, column, pin.rnea(model, data, motion(t)[column], motion(t, 1)[column], motion(t, 2)[column]))
        used = max(used, float((np.abs(torque) / effort).max()))
    assert 0.9 < used <= 1.0 + 1e-9


def test_cartesian_speed(robot: ap.Robot) -> None:
    path, frame = spline(robot, 3), tool(robot)
    speed = tj.CartesianSpeed(robot, frame, linear=0.3, angular=0.7)
    motion = tj.time_optimal(path, limits(robot), constraints=[speed], grid=150).require_success().motion
    t = np.linspace(0.0, motion.duration, 4001)
    twist = np.einsum("mij,mj->mi", robot.jacobian(motion(t), frame), motion(t, 1))
    linear, angular = np.linalg.norm(twist[:, :3], axis=1), np.linalg.norm(twist[:, 3:], axis=1)
    assert linear.max() <= 0.3 + 1e-9
    assert angular.max() <= 0.7 + 1e-9
    assert max(linear.max() / 0.3, angular.max() / 0.7) > 0.99


def test_cartesian_acceleration(robot: ap.Robot) -> None:
    path, frame = spline(robot, 4), tool(robot)
    bound = tj.CartesianAcceleration(robot, frame, linear=1.0)
    motion = tj.time_optimal(path, limits(robot), constraints=[bound], grid=200).require_success().motion
    t = np.linspace(0.0, motion.duration, 20001)
    p = robot.fk(motion(t), frame)[:, :3, 3]
    dt = t[1] - t[0]
    acceleration = np.linalg.norm(p[2:] - 2 * p[1:-1] + p[:-2], axis=1) / dt**2
    assert acceleration.max() <= 1.0 + 1e-3  # finite differences
    assert np.median(acceleration) > 0.5


def test_power(robot: ap.Robot) -> None:
    path = spline(robot, 6)
    motion = (
        tj.time_optimal(path, limits(robot), constraints=[tj.PowerLimits(robot, 15.0)], grid=150)
        .require_success()
        .motion
    )
    t = np.linspace(0.0, motion.duration, 4001)
    power = robot.inverse_dynamics(motion(t), motion(t, 1), motion(t, 2)) * motion(t, 1)
    assert np.abs(power).max() <= 15.0 * (1 + 1e-9)
    assert np.abs(power).max() > 10.0


def test_a_torque_that_does_not_even_hold_the_arm_is_named(robot: ap.Robot) -> None:
    path = spline(robot, 1)
    still = np.abs(robot.gravity(path(np.linspace(0.0, 1.0, 300)))).max(axis=0)
    j = int(still.argmax())
    effort = robot.limits.effort.copy()
    effort[j] = 0.5 * still[j]
    timing = tj.time_optimal(path, limits(robot), constraints=[tj.TorqueLimits(robot, effort)])
    assert timing.status is tj.TimingStatus.INFEASIBLE
    with pytest.raises(UnsuccessfulError, match=f"At s = .*torque of '{robot.joint_names[j]}' is .* even at rest"):
        timing.require_success()


def test_contradicting_constraints_are_named() -> None:
    class Pushing:
        def rows(self, path, s):
            one = np.ones((*s.shape, 1))
            inside = ((s > 0.4) & (s < 0.5))[..., None] * 1.0
            return tj.Rows(one, 0 * one, -20.0 * inside, np.zeros(1) - 1.0, np.full(1, np.inf), ("the push",))

    path = tj.polyline([[0.0], [1.0]])
    timing = tj.time_optimal(path, tj.Limits(velocity=1.0, acceleration=2.0), constraints=[Pushing()], grid=50)
    assert not timing.success
    assert "the push" in timing.explain()


def test_what_happens_between_the_samples_is_accounted_for(monkeypatch) -> None:
    class Noise:
        """Far from quadratic between the samples of a coarse grid."""

        def rows(self, path, s):
            rough = 1e3 * np.sin(1e5 * s)[..., None] ** 2
            zero = np.zeros_like(rough)
            return tj.Rows(zero, 1.0 + rough, zero, np.full(1, -np.inf), np.ones(1), ("noise",))

    class TwoSided(Noise):
        def rows(self, path, s):
            return replace(super().rows(path, s), lower=np.full(1, -9.0))

    def solve(noise: Noise) -> tj.Timing:
        path = tj.polyline([[0.0], [1.0]])
        return tj.time_optimal(path, tj.Limits(velocity=1.0, acceleration=2.0), constraints=[noise], grid=20)

    timing = solve(Noise()).require_success()
    assert timing.margin > 0.1
    assert timing.duration > 10.0  # ṡ² ≤ 1/1001 at the peaks
    assert not timing.proven  # the errors are estimated
    monkeypatch.setattr("apprehend.trajectory.timing.MARGIN_ROUNDS", 1)
    coarse = solve(TwoSided())
    assert coarse.status is tj.TimingStatus.COARSE
    assert "noise varies too fast between the samples" in coarse.explain()


def test_a_given_grid_that_is_too_coarse_is_named(robot: ap.Robot) -> None:
    """A grid that the caller gives is kept; a number of intervals is refined where it has to be."""
    path = spline(robot, 2)
    still = np.abs(robot.gravity(path(np.linspace(0.0, 1.0, 300)))).max(axis=0)
    torque = tj.TorqueLimits(robot, np.maximum(0.1 * robot.limits.effort, 1.3 * still))
    grids = [np.linspace(0.0, 1.0, k) for k in range(3, 13)]
    answers = [tj.time_optimal(path, limits(robot), constraints=[torque], grid=g) for g in grids]
    coarse = [a for a in answers if a.status is tj.TimingStatus.COARSE]
    assert coarse
    assert "limit would have to be held back" in coarse[-1].explain()
    assert all(a.violation <= 1e-9 for a in answers if a.success)
    fine = tj.time_optimal(path, limits(robot), constraints=[torque], grid=3)
    assert fine.require_success().grid.size > 10


def test_all_limits_together(robot: ap.Robot) -> None:
    path, frame = spline(robot, 7), tool(robot)
    still = np.abs(robot.gravity(path(np.linspace(0.0, 1.0, 300)))).max(axis=0)
    effort = np.maximum(robot.limits.effort, 1.3 * still)
    effort[-1] = np.inf
    together = [
        tj.TorqueLimits(robot, effort), tj.PowerLimits(robot, 30.0), tj.CartesianSpeed(robot, frame, linear=0.4),
        tj.CartesianAcceleration(robot, frame, linear=2.0),
    ]  # fmt: skip
    whole = tj.time_optimal(path, limits(robot), constraints=together, grid=80).require_success()
    assert whole.violation <= 1e-9
    for one in together:
        assert whole.duration >= tj.time_optimal(path, limits(robot), constraints=[one], grid=80).duration * 0.99
    # with no limits on joints, those of torque alone do
    assert tj.time_optimal(path, tj.Limits(), constraints=together[:1], grid=80).violation == 0.0
    # a frame that does not move is never too fast
    root = tj.CartesianAcceleration(robot, robot.frame_names[0], linear=1.0)
    still_frame = tj.time_optimal(path, limits(robot), constraints=[root], grid=80)
    assert still_frame.duration == pytest.approx(tj.time_optimal(path, limits(robot), grid=80).duration)


def test_a_path_for_another_robot_is_refused(robot: ap.Robot) -> None:
    path, frame = tj.polyline([[0.0, 0.0], [1.0, 1.0]]), tool(robot)
    for limit in (
        tj.TorqueLimits(robot), tj.PowerLimits(robot, 1.0), tj.CartesianSpeed(robot, frame, linear=1.0),
        tj.CartesianAcceleration(robot, frame, linear=1.0),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"the path has 2 coordinates; {type(limit).__name__} is for robot"):
            tj.time_optimal(path, tj.Limits(1.0, 1.0), constraints=[limit])


def test_rows_of_a_wrong_shape_are_refused() -> None:
    class Flat:
        def rows(self, path, s):
            zero = np.zeros((s.shape[0], 1))
            return tj.Rows(zero, zero, zero, np.zeros(1), np.ones(1), ("flat",))

    class Loose(Flat):
        def rows(self, path, s):
            zero = np.zeros((*s.shape, 1))
            return tj.Rows(zero, zero, zero, np.zeros(2), np.ones(1), ("loose",))

    class Wild(Flat):
        def rows(self, path, s):
            wild = np.full((*s.shape, 1), np.nan)
            return tj.Rows(wild, wild, wild, np.zeros(1), np.ones(1), ("wild",))

    for bad, message in (
        (Flat(), r"Flat gives A of shape \(20, 1\); expected \(20, 5, 1\)"),
        (Loose(), r"Loose gives lower of shape \(2,\); expected \(1,\)"),
        (Wild(), "Wild is not finite at s = 0 of the path"),
    ):
        with pytest.raises(InputError, match=message):
            tj.time_optimal(tj.polyline([[0.0], [1.0]]), tj.Limits(1.0, 1.0), constraints=[bad], grid=20)


def test_custom_path_is_replaced_by_polynomials() -> None:
    class Circle:
        n = 2
        interval = (0.0, np.pi)

        def __call__(self, s, order=0, /):
            s = np.asarray(s)
            shift = order * np.pi / 2
            return np.stack([np.cos(s + shift), np.sin(s + shift)], axis=-1)

    timing = tj.time_optimal(Circle(), tj.Limits(velocity=1.0, acceleration=1.0), grid=300)
    assert timing.report.success
    q = timing.motion.sample(count=500).position
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-8)
    with pytest.raises(InputError, match="path is list; expected a Path"):
        tj.time_optimal([[0.0], [1.0]], tj.Limits(acceleration=1.0))

    class Jump(Circle):
        def __call__(self, s, order=0, /):
            s = np.asarray(s)
            values = (np.sign(s - 1.0), 0 * s, 0 * s)[order]
            return np.stack([values, values], axis=-1)

    with pytest.raises(InputError, match=r"not smooth near s = 1"):
        tj.as_polynomial(Jump())


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda r: tj.TorqueLimits(r, np.inf), "effort is infinite for every joint"),
        (lambda r: tj.TorqueLimits(r, 0.0), "expected a positive torque"),
        (lambda r: tj.TorqueLimits(r, margin=1.0), "margin is 1.0"),
        (lambda r: tj.PowerLimits(r, -1.0), "expected a positive power"),
        (lambda r: tj.CartesianSpeed(r, tool(r)), "a linear limit, an angular limit, or both"),
        (lambda r: tj.CartesianSpeed(r, tool(r), linear=-1.0), "linear is -1.0"),
        (lambda r: tj.CartesianSpeed(r, "nowhere", linear=1.0), "no .*named 'nowhere'"),
    ],
)
def test_bad_input(robot: ap.Robot, call, message: str) -> None:
    with pytest.raises((InputError, ap.errors.UnknownNameError), match=message):
        call(robot)
