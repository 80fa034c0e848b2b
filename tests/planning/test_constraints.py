"""Constraints on paths: their derivatives, their proofs along motions, and paths that keep them."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.collision import Box, CollisionModel, RobotSource, Scene
from apprehend.errors import InputError
from apprehend.kinematics import Robot
from apprehend.planning import Constraints, Inside, PlanStatus, Turned, Upright, plan, smooth
from apprehend.robots import Description, Joint, JointLimits, JointType, Link, Shape, ShapeKind
from tests.collision.makers import gantry, planar, pose, rotation


@pytest.fixture(scope="module")
def ur5e() -> Robot:
    return RobotSource("ur5e").build()[0]


def model_of(robot, *boxes: Box) -> CollisionModel:
    return CollisionModel(robot, Scene(robot, RobotSource("in code"), boxes=boxes))


def dense(path: np.ndarray, count: int = 200) -> np.ndarray:
    s = np.linspace(0.0, 1.0, count)[None, :, None]
    return (path[:-1, None] + s * np.diff(path, axis=0)[:, None]).reshape(-1, path.shape[1])


def some(frame: str, T: np.ndarray):
    """Constraints that a frame at *T* keeps, but not by far."""
    axis, box = np.array([0.3, -0.2, 1.0]), T.copy()
    box[:3, 3] += 0.1
    return (
        Upright(frame, axis=axis, angle=0.4, up=T[:3, :3] @ axis + [0.1, 0.0, -0.1]),
        Inside(frame, (-0.4, -0.3, -0.3), (0.3, 0.4, 0.4), box, point=(0.1, 0.0, 0.1)),
        Turned(frame, T[:3, :3], (0.4, 0.3, 0.4)),
    )


def test_values_change_as_their_derivatives_say(ur5e: Robot) -> None:
    rng = np.random.default_rng(0)
    items = some("tool0", ur5e.fk(ur5e.home, "tool0"))
    q = ur5e.home + 0.3 * rng.normal(size=6)
    for item in items:
        _, rows = item.values(ur5e.fk(q, "tool0"))
        exact = rows @ ur5e.jacobian(q, "tool0", "mixed")
        step = 1e-6
        for j in range(6):
            e = step * np.eye(6)[j]
            ahead, behind = (item.values(ur5e.fk(q + sign * e, "tool0"))[0] for sign in (1, -1))
            np.testing.assert_allclose((ahead - behind) / (2.0 * step), exact[:, j], atol=1e-6)


@pytest.mark.parametrize("name", ["panda", "tiago_dual", "scara", "allegro_right"])
def test_compiled_values_are_those_of_the_definitions(name: str) -> None:
    """On trees with two arms, sliding joints and joints without limits."""
    robot = Robot.load(name)
    rng = np.random.default_rng(4)
    lower, upper = np.maximum(robot.limits.lower, -3.0), np.minimum(robot.limits.upper, 3.0)
    q = rng.uniform(lower, upper, (30, robot.n))
    frames = [f for f in robot.frame_names if len(robot.chain(f))]
    items = [item for f in (frames[0], frames[-1]) for item in some(f, robot.fk(q[0], f))]
    value = Constraints(robot, items).values(q)
    for k, item in enumerate(items):
        exact, _ = item.values(robot.fk(q, item.frame))
        np.testing.assert_allclose(value[:, k, : exact.shape[1]], exact, atol=1e-9)
        assert not value[:, k, exact.shape[1] :].any()


def test_motions_are_proven_on_any_robot_and_nothing_wrong_is() -> None:
    rng = np.random.default_rng(6)
    for name, frame in (("panda", "panda_hand"), ("tiago_dual", "arm_left_7_link"), ("scara", "tool")):
        robot = Robot.load(name)
        frame = frame if frame in robot.frame_names else robot.frame_names[-1]
        lower, upper = np.maximum(robot.limits.lower, -2.0), np.minimum(robot.limits.upper, 2.0)
        middle = rng.uniform(lower, upper)
        qa = np.clip(middle + 0.15 * rng.normal(size=(80, robot.n)), lower, upper)
        qb = np.clip(qa + 0.15 * rng.normal(size=(80, robot.n)), lower, upper)
        for item in some(frame, robot.fk(middle, frame)):
            keep = Constraints(robot, [item])
            held = keep.hold(qa, qb)
            low, high = item.bounds
            for a, b, good in zip(qa, qb, held, strict=True):
                value, _ = item.values(robot.fk(dense(np.array([a, b])), frame))
                worst = np.maximum(low - value, value - high).max()
                assert worst <= 1e-8 if good else worst > -2e-3


def test_a_motion_off_a_bound_is_proven_only_inwards() -> None:
    robot = planar(2)
    start, away = np.array([0.3, 0.4]), np.array([0.2, 0.1])
    T = robot.fk(start, "tip")
    x, y = T[0, 3], T[1, 3]
    tilt = float(np.arccos(T[0, 0]))
    for item in (
        Upright("tip", (1.0, 0.0, 0.0), tilt, (1.0, 0.0, 0.0)),
        Inside("tip", (x, -9.0, -1.0), (9.0, y, 1.0)),
        Turned("tip", np.eye(3), (0.1, 0.1, tilt)),
    ):
        keep = Constraints(robot, [item])
        ends = np.array([start - away, start + away])
        np.testing.assert_array_equal(keep.hold(np.array([start, start]), ends), [True, False])
        np.testing.assert_array_equal(keep.hold(ends, np.array([start, start])), [True, False])


def test_a_frame_may_turn_around_where_that_is_allowed() -> None:
    """With a tolerance of π about one axis the rotation vector flips its sign half-way."""
    robot = planar(1)
    keep = Constraints(robot, [Turned("tip", np.diag([-1.0, -1.0, 1.0]), (0.1, 0.1, np.pi))])
    assert keep.hold(np.array([[-1.0]]), np.array([[1.0]]))[0]
    narrow = Constraints(robot, [Turned("tip", np.diag([-1.0, -1.0, 1.0]), (0.1, 0.1, 3.0))])
    assert not narrow.hold(np.array([[-1.0]]), np.array([[1.0]]))[0]


def test_joints_that_do_not_tilt_an_axis_cost_nothing(ur5e: Robot) -> None:
    """The first joint turns about the vertical, the last about the tool: any motion of both keeps a narrow cone."""
    keep = Constraints(ur5e, [Upright("tool0", axis=(0.0, 0.0, -1.0), angle=1e-4)])
    q = np.array([-3.0, -1.2, 1.5, 0.0, -0.5 * np.pi, -3.0])
    q[3] = -0.5 * np.pi - q[1] - q[2]
    assert keep.violation(q) == 0.0
    far = q + np.array([6.0, 0.0, 0.0, 0.0, 0.0, 6.0])
    assert keep.hold(q[None], far[None])[0]
    np.testing.assert_array_equal(np.flatnonzero(keep.compiled.levers[0]), [1, 2, 3, 4])


def test_what_is_proven_along_a_motion_holds_everywhere_on_it(ur5e: Robot) -> None:
    rng = np.random.default_rng(1)
    items = some("tool0", ur5e.fk(ur5e.home, "tool0"))
    qa = ur5e.home + 0.15 * rng.normal(size=(60, 6))
    qb = qa + 0.25 * rng.normal(size=(60, 6))
    for chosen in (*((item,) for item in items), items):
        keep = Constraints(ur5e, chosen)
        held = keep.hold(qa, qb)
        for a, b, good in zip(qa, qb, held, strict=True):
            if good:
                assert keep.violation(dense(np.array([a, b]))).max() == 0.0
        if len(chosen) == 1:
            assert held.any()
            assert not held.all()


def test_projection_ends_on_the_constraints(ur5e: Robot) -> None:
    rng = np.random.default_rng(2)
    keep = Constraints(ur5e, some("tool0", ur5e.fk(ur5e.home, "tool0")))
    q = ur5e.home + 0.3 * rng.normal(size=(40, 6))
    lower, upper = ur5e.limits.lower, ur5e.limits.upper
    near, good = keep.project(q, lower, upper)
    assert good.mean() > 0.8
    assert (keep.violation(near[good]) == 0.0).all()
    still = np.array([True, True, False, True, True, True])
    moved, _ = Constraints(ur5e, keep.items, still).project(q, lower, upper)
    np.testing.assert_array_equal(moved[:, 2], q[:, 2])


def mobile() -> Robot:
    """A base that slides and turns without limits, and an arm in a vertical plane on it."""
    names = ["floor", "x", "y", "base", "upper", "fore", "hand"]
    links = {name: Link(name) for name in names}
    for name in names[4:]:
        links[name] = Link(name, collisions=(Shape(ShapeKind.BOX, (0.06, 0.06, 0.3), pose(0.0, 0.0, 0.2)),))
    links["base"] = Link("base", collisions=(Shape(ShapeKind.CYLINDER, (0.2, 0.3), pose(0.0, 0.0, 0.15)),))
    kinds = [JointType.PRISMATIC] * 2 + [JointType.CONTINUOUS] + [JointType.REVOLUTE] * 3
    axes = [(1, 0, 0), (0, 1, 0), (0, 0, 1)] + [(0, 1, 0)] * 3
    places = [pose()] * 3 + [pose(0.0, 0.0, 0.4)] * 3
    bounds = [JointLimits(-3.0, 3.0)] * 2 + [JointLimits()] + [JointLimits(-2.5, 2.5)] * 3
    joints = tuple(
        Joint(f"joint {i}", kinds[i], names[i], names[i + 1], places[i], np.array(axes[i], float), bounds[i])
        for i in range(6)
    )
    return Robot(Description("mobile", "floor", links, joints))


def test_a_mobile_robot_carries_upright_at_one_height() -> None:
    robot = mobile()
    model = model_of(robot, Box("wall", np.array([0.1, 3.0, 1.0]), pose(0.0, 0.0, 0.5)))
    items = [Upright("hand", angle=0.15), Inside("hand", (-9.0, -9.0, 0.7), (9.0, 9.0, 0.9))]
    start = np.array([-1.5, 0.0, 0.0, -0.9, 1.9, -1.0])
    goal = np.array([1.5, 0.3, 15.0, -0.9, 1.9, -1.0])
    result = plan(model, start, goal, rng=np.random.default_rng(0), constraints=items, time_limit=20.0, smooth=True)
    path = result.require_success().path
    np.testing.assert_allclose(path[-1, 2], 15.0 - 4.0 * np.pi, atol=1e-9)  # modulo a turn
    np.testing.assert_array_equal(np.delete(path[-1], 2), np.delete(goal, 2))
    points = dense(path)
    hand = robot.fk(points, "hand")
    assert np.arccos(np.clip(hand[:, 2, 2], -1.0, 1.0)).max() <= 0.15 + 1e-8
    assert (np.abs(hand[:, 2, 3] - 0.8) <= 0.1 + 1e-8).all()
    assert (model.distance(points) > -model.resolution).all()


def test_two_arms_keep_what_one_of_them_holds() -> None:
    robot = Robot.load("tiago_dual")
    frame = "arm_left_7_link"
    rng = np.random.default_rng(0)
    model = model_of(robot, Box("post", np.array([0.1, 0.1, 1.2]), pose(0.6, 0.35, 0.6)))
    lower, upper = np.maximum(robot.limits.lower, -np.pi), np.minimum(robot.limits.upper, np.pi)
    keep = Constraints(robot, [Upright(frame, angle=0.3)])
    q, good = keep.project(rng.uniform(lower, upper, (4000, robot.n)), lower, upper)
    q = q[good & model.free(q)]
    arms = [j for f in (frame, "arm_right_7_link") for j in robot.chain(f)]
    ends = q[:2].copy()
    ends[1] = np.where(np.isin(np.arange(robot.n), arms), ends[1], ends[0])
    result = plan(
        model, *ends, rng=rng, constraints=keep.items, joints=sorted(set(arms)), time_limit=20.0
    ).require_success()
    points = dense(result.path, 50)
    assert keep.violation(points).max() == 0.0
    assert (model.distance(points) > -model.resolution).all()
    still = np.setdiff1d(np.arange(robot.n), arms)
    assert (points[:, still] == ends[0, still]).all()


def test_a_full_mug_goes_around_a_wall_upright(ur5e: Robot) -> None:
    wall = Box("wall", np.array([0.5, 0.04, 0.45]), pose(0.6, 0.0, 0.225))
    model = model_of(ur5e, wall)
    start, goal = ur5e.home.copy(), ur5e.home.copy()
    start[0], goal[0] = -0.9, 0.9
    start[1], goal[1] = -1.0, -1.0  # low, so that the wall is in the way
    start[3] = goal[3] = -2.1
    up = Upright("tool0", axis=(0.0, 0.0, -1.0), angle=0.2)
    for constraints in ((up,), (up, Inside("tool0", (-1.0, -1.0, 0.05), (1.0, 1.0, 0.95)))):
        result = plan(
            model, start, goal, rng=np.random.default_rng(0), time_limit=60.0, constraints=constraints, smooth=True
        ).require_success()
        np.testing.assert_array_equal(result.path[[0, -1]], [start, goal])
        assert len(result.path) > 2
        keep = Constraints(ur5e, constraints)
        points = dense(result.path, 60)
        assert keep.violation(points).max() == 0.0
        assert (model.distance(points) > -model.resolution).all()
        tilt = np.arccos(np.clip(-ur5e.fk(points, "tool0")[:, 2, 2], -1.0, 1.0))
        assert tilt.max() <= 0.2


def test_ends_off_the_constraint_are_named() -> None:
    robot = planar(3)
    model = model_of(robot)
    rng = np.random.default_rng(0)
    box = Inside("tip", (0.0, -0.5, -1.0), (2.0, 0.5, 1.0))
    inside, outside = np.zeros(3), np.array([1.5, 0.0, 0.0])
    start = plan(model, outside, inside, rng=rng, constraints=[box])
    assert start.status is PlanStatus.START_OFF_CONSTRAINT
    assert "tip is at y = 1.197 m of its box, allowed are -0.500 to 0.500 m" in start.explain()
    goal = plan(model, inside, [outside], rng=rng, constraints=[box])
    assert goal.status is PlanStatus.GOALS_OFF_CONSTRAINT
    assert "Goal 0: tip is at y" in goal.explain()
    one_of_two = plan(model, inside, [outside, [0.1, 0.0, 0.0]], rng=rng, constraints=[box])
    assert one_of_two.goal == 1
    tilted = plan(model, inside, outside, rng=rng, constraints=[Upright("tip", (1.0, 0.0, 0.0), 0.1, (1.0, 0.0, 0.0))])
    assert "tip is tilted by 85.9°, allowed are 5.7°" in tilted.explain()
    turned = plan(model, inside, outside, rng=rng, constraints=[Turned("tip", np.eye(3), 0.1)])
    assert "tip is turned by [0.0, 0.0, 85.9]°" in turned.explain()
    assert "away keeps the constraint" in turned.explain()
    above = Inside("tip", (0.0, 2.0, -1.0), (1.0, 3.0, 1.0))
    nowhere = plan(model, outside, inside, rng=rng, constraints=[box, above])
    assert nowhere.status is PlanStatus.START_OFF_CONSTRAINT
    assert "could be moved onto all constraints: they may exclude one another" in nowhere.explain()


def test_what_no_path_can_keep_ends_in_time() -> None:
    ball = gantry()
    wall = Box("wall", np.array([0.05, 1.0, 6.0]), pose())
    low = Inside("ball", (-2.0, -0.3, -0.3), (2.0, 0.3, 0.3))
    ends = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    model = model_of(ball, wall)
    late = plan(model, *ends, rng=np.random.default_rng(0), time_limit=0.2, constraints=[low])
    assert late.status is PlanStatus.TIME_SPENT
    assert "the tree from the start has" in late.explain()
    assert "% left the constraints and" in late.explain()
    assert plan(model, *ends, rng=np.random.default_rng(0), time_limit=60.0).success


def test_bad_constraints_are_named() -> None:
    with pytest.raises(InputError, match="angle of an upright constraint is 0"):
        Upright("tip", angle=0.0)
    with pytest.raises(InputError, match="axis is"):
        Upright("tip", axis=(0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="each lower bound must be smaller"):
        Inside("tip", (0.0, 0.0, 0.0), (1.0, 0.0, 1.0))
    with pytest.raises(InputError, match="must be one rotation matrix"):
        Turned("tip", 2.0 * np.eye(3), 0.1)
    with pytest.raises(InputError, match="three positive angles"):
        Turned("tip", np.eye(3), (0.1, 0.0, 0.1))
    with pytest.raises(KeyError, match="tip2"):
        Constraints(planar(2), [Upright("tip2")])


def test_smoothing_rounds_corners_and_stays_free() -> None:
    robot = gantry()
    model = model_of(robot, Box("post", np.array([0.4, 0.4, 4.0]), pose(0.0, -0.2)))
    path = np.array([[-1.0, -0.5, 0.0], [-0.4, 0.35, 0.0], [0.4, 0.35, 0.0], [1.0, -0.5, 0.0]])
    assert model.path_free(path)
    round_path = smooth(model, path)
    np.testing.assert_array_equal(round_path[[0, -1]], path[[0, -1]])
    assert model.path_free(round_path)
    assert (
        np.linalg.norm(np.diff(round_path, axis=0), axis=1).sum() < np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    )

    def sharpest(points: np.ndarray) -> float:
        way = np.diff(points, axis=0)
        way /= np.linalg.norm(way, axis=1)[:, None]
        return float(np.arccos(np.clip((way[1:] * way[:-1]).sum(axis=1), -1.0, 1.0)).max())

    assert sharpest(round_path) < 0.35 * sharpest(path)
    free = smooth(model_of(robot, Box("far", np.ones(3), pose(9.0))), path, rounds=7)
    # the limit is the uniform cubic B-spline: over an old vertex it passes (a + 4 v + b) / 6
    for k in (1, 2):
        target = (path[k - 1] + 4.0 * path[k] + path[k + 1]) / 6.0
        assert np.linalg.norm(free - target, axis=1).min() < 2e-3
    np.testing.assert_array_equal(smooth(model, path[:2]), path[:2])
    with pytest.raises(InputError, match="path has shape"):
        smooth(model, np.zeros(3))


def test_a_motion_that_is_proven_free_by_planes_is_free(ur5e: Robot) -> None:
    """Straight motions of a robot of meshes near obstacles, against dense exact checks."""
    rng = np.random.default_rng(5)
    boxes = (Box("table", np.array([1.0, 1.5, 0.04]), pose(0.6, 0.0, -0.05)),
             Box("post", np.array([0.1, 0.1, 1.0]), pose(0.4, 0.25, 0.4, rotation(rng))))  # fmt: skip
    model = model_of(ur5e, *boxes)
    qa = ur5e.home + 0.6 * rng.normal(size=(80, 6))
    qb = qa + 0.5 * rng.normal(size=(80, 6))
    free = model.edges_free(qa, qb)
    assert 0.1 < free.mean() < 0.9
    for a, b, good in zip(qa, qb, free, strict=True):
        hits = (model.hits(dense(np.array([a, b]), 400)) >= 0).any()
        if good:
            assert not hits or (model.distance(dense(np.array([a, b]), 400)) > -model.resolution).all()
        else:
            assert model.distance(dense(np.array([a, b]), 1000)).min() < 2e-3
