"""The collision model against closed forms, dense sampling and coal."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.collision import Box, CollisionModel, Convex, RobotSource, Scene, signed_distance
from apprehend.errors import ApprehendError, InputError, UnknownNameError
from tests.collision.makers import gantry, planar, pose, rotation

RNG = np.random.default_rng(8)


def scene(robot, *boxes: Box, **options) -> Scene:
    return Scene(robot, RobotSource("in code"), boxes=boxes, **options)


def test_a_ball_among_boxes_has_closed_form_distances() -> None:
    robot = gantry()
    low, high = np.array([0.3, -0.5, -0.2]), np.array([0.7, 0.5, 0.2])
    model = CollisionModel(robot, scene(robot, Box("wall", high - low, pose(*(0.5 * (low + high))))))
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (500, 3))
    out = np.maximum(np.maximum(low - q, q - high), 0.0)
    inside = -np.minimum(q - low, high - q).min(axis=1)
    expected = np.where(out.any(axis=1), np.linalg.norm(out, axis=1), inside) - 0.1
    np.testing.assert_allclose(model.distance(q), expected, atol=1e-10)
    assert (model.free(q) == (expected > 0.0)).all()
    wide = model.with_clearance(0.05)
    assert (wide.free(q) == (expected > 0.05)).all()


def test_motions_cannot_tunnel_a_thin_wall() -> None:
    robot = gantry()
    model = CollisionModel(robot, scene(robot, Box("sheet", np.array([1e-6, 3.0, 3.0]), pose(0.5))))
    a, b = np.array([-1.9, 0.0, 0.0]), np.array([1.9, 0.1, 0.0])
    assert model.free(np.array([a, b])).all()
    assert not model.edges_free(a, b)
    hit, where = model.edge_hits(a, b)
    assert model.names_of(int(hit)) == ("ball", "sheet")
    assert not model.free(a + where * (b - a))
    assert model.edges_free(a, a + [2.0, 0.5, 0.0])


def test_edges_agree_with_dense_sampling() -> None:
    """Free edges stay free at a fine resolution up to the stated slack; refused ones touch somewhere."""
    robot = planar(4)
    boxes = [
        Box(f"post{i}", np.array([0.1, 0.1, 0.4]), pose(x, y)) for i, (x, y) in enumerate([(0.6, 0.5), (-0.5, 0.8)])
    ]
    model = CollisionModel(robot, scene(robot, *boxes))
    rng = np.random.default_rng(1)
    q = rng.uniform(-2.5, 2.5, (100, robot.n))
    q = q[model.free(q)]
    a, b = q[:-1], q[1:]
    free = model.edges_free(a, b)
    assert 0.05 < free.mean() < 0.95
    s = np.linspace(0.0, 1.0, 501)[:, None, None]
    least = model.distance(a + s * (b - a)).min(axis=0)
    assert (least[free] > -model.resolution).all()
    assert (least[~free] < 8e-3).all()


def test_self_collision_of_a_folded_arm() -> None:
    robot = planar(3)
    model = CollisionModel(robot)
    assert model.free(np.zeros(3))
    folded = np.array([0.0, 2.9, 2.9])
    assert not model.free(folded)
    names = {frozenset((touch.a, touch.b)) for touch in model.why(folded)}
    assert names == {frozenset(("link1", "link3"))}
    assert model.allow([("link1", "link3")]).free(folded)
    assert not model.allow([("link1", "link3")]).forbid([("link3", "link1")]).free(folded)
    assert model.reasons[frozenset(("link1", "link2"))] == "connected by a joint"


def test_distance_is_the_least_over_all_pairs() -> None:
    """The pruned search against every pair of shapes, one by one."""
    robot = planar(4)
    model = CollisionModel(robot, scene(robot, Box("post", np.array([0.2, 0.3, 0.5]), pose(0.5, 0.4))))
    rng = np.random.default_rng(2)
    for q in rng.uniform(-2.9, 2.9, (40, robot.n)):
        frames = dict(zip(robot.frame_names, robot.fk(q), strict=True))
        box = Convex.box([0.34, 0.06, 0.06])
        placed = {f"link{i}": frames[f"link{i}"] @ pose(0.2) for i in range(1, 5)}
        least = np.inf
        for i in range(1, 5):
            T = placed[f"link{i}"]
            post = signed_distance(box, Convex.box([0.2, 0.3, 0.5]), T, pose(0.5, 0.4)).distance
            others = [signed_distance(box, box, T, placed[f"link{j}"]).distance for j in range(1, i - 1)]
            least = min(least, post, *others)
        found = model.closest(q)
        assert found.distance == pytest.approx(least, abs=1e-9)
        assert (found.points[0] - found.points[1]) @ found.normal == pytest.approx(found.distance, abs=1e-8)
        assert bool(model.free(q)) == (least > 0.0)


def test_attached_bodies_move_along_and_are_put_down_where_they_are_told() -> None:
    robot = planar(3)
    wall = Box("wall", np.array([0.1, 2.0, 0.5]), pose(1.5))
    model = CollisionModel(robot, scene(robot, wall))
    stick = Body.box([0.5, 0.04, 0.04], name="stick")
    q = np.zeros(3)
    assert model.free(q)
    held = model.attach(stick, "tip", pose(0.2), touching=["link3"])
    assert not held.free(q)
    assert {(touch.a, touch.b) for touch in held.why(q)} <= {("stick", "wall"), ("wall", "stick")}
    assert held.free(np.array([1.5, 0.0, 0.0]))
    assert model.free(q)  # the first model is unchanged
    down = held.detach("stick", pose(0.0, 1.0))
    assert down.free(q)
    assert not down.free(np.array([np.pi / 2.0, 0.0, 0.0]))
    assert held.detach("stick").names == model.names
    # by default what moves with the frame, or beyond it, may touch
    assert held.attach(stick, "tip", pose(0.2)).reasons[frozenset(("stick", "link3"))] == "holds the body"
    with pytest.raises(InputError, match="'wall' is not attached"):
        held.detach("wall")


def test_obstacles_come_and_go() -> None:
    robot = gantry()
    model = CollisionModel(robot)
    assert model.free(np.zeros(3))
    full = model.add("ball2", [Convex.sphere(0.1)], pose(0.15))
    assert not full.free(np.zeros(3))
    assert full.add("ball2", [Convex.sphere(0.1)], pose(0.25)).free(np.zeros(3))
    assert full.remove("ball2").free(np.zeros(3))
    with pytest.raises(InputError, match="'ball' is a link of the robot"):
        full.remove("ball")
    with pytest.raises(InputError, match="'ball' is a link"):
        full.add("ball", [Convex.sphere(0.1)], pose())
    with pytest.raises(InputError, match="no pair of things"):
        model.distance(np.zeros(3))


def test_distances_of_a_real_arm_are_the_same_bits_with_any_number_of_threads() -> None:
    from apprehend import parallel

    scene = Scene.tabletop("ur5e", body="mug")
    model = CollisionModel(scene.robot, scene)
    limits = scene.robot.limits
    q = np.random.default_rng(0).uniform(limits.lower, limits.upper, (2, 150, scene.robot.n)).clip(-3.0, 3.0)
    before, answers = parallel.threads(), []
    try:
        for count in (1, 2, 3):
            parallel.set_threads(count)
            pairs, closest = model.distances(q[0, :50]), model.closest(q[0])
            answers.append(
                (closest.distance, closest.points, pairs.distance, *model.edge_hits(*q), model.edges_free(*q))
            )
    finally:
        parallel.set_threads(before)
    for other in answers[1:]:
        for one, same in zip(answers[0], other, strict=True):
            np.testing.assert_array_equal(one, same)


def test_batches_keep_their_shape_and_do_not_depend_on_threads() -> None:
    from apprehend.parallel import set_threads, threads

    robot = planar(4)
    model = CollisionModel(robot, scene(robot, Box("post", np.array([0.2, 0.3, 0.5]), pose(0.5, 0.4))))
    q = np.random.default_rng(3).uniform(-2.9, 2.9, (5, 40, robot.n))
    before = threads()
    try:
        answers = []
        for count in (1, 3):
            set_threads(count)
            answers.append((model.free(q), model.distance(q), model.edges_free(q[:-1], q[1:])))
    finally:
        set_threads(before)
    assert answers[0][0].shape == (5, 40)
    for one, three in zip(*answers, strict=True):
        np.testing.assert_array_equal(one, three)
    assert model.free(np.zeros((0, robot.n))).shape == (0,)
    assert model.free(q[0, 0]) == model.free(q)[0, 0]


@pytest.mark.parametrize(("arm", "hand"), [("ur5e", "robotiq_2f_85"), ("panda", None)])
def test_real_robots_against_coal(arm: str, hand: str | None) -> None:
    """Signed distances of hulls of the links' meshes at random configurations, through coal."""
    coal = pytest.importorskip("coal")
    try:
        robot, _ = RobotSource(arm, hand).build()
    except ApprehendError as error:
        pytest.skip(str(error))
    table = Box("table", np.array([1.0, 1.4, 0.04]), pose(0.75, 0.0, -0.02))
    model = CollisionModel(robot, scene(robot, table))
    rng = np.random.default_rng(4)
    q = rng.uniform(np.maximum(robot.limits.lower, -np.pi), np.minimum(robot.limits.upper, np.pi), (60, robot.n))
    mine = model.distance(q)
    free = model.free(q)
    nodes, arrays = model.nodes, model.compiled
    start = np.cumsum([0, *(len(node.shapes) for node in nodes)])
    shapes = [shape for node in nodes for shape in node.shapes]

    def coal_shape(shape: Convex):
        if not len(shape.points):
            return coal.Box(2.0 * shape.size)
        points = coal.StdVec_Vec3s()
        for p in shape.points:
            points.append(p)
        triangles = coal.StdVec_Triangle()
        for f in shape.faces:
            triangles.append(coal.Triangle(*map(int, f)))
        return coal.Convex(points, triangles)

    theirs = [coal_shape(shape) for shape in shapes]
    request = coal.DistanceRequest(True, True)
    request.gjk_tolerance = 1e-10
    for i in range(0, len(q), 6):
        frames = robot.fk(q[i])
        poses = {name: frames[f] for f, name in enumerate(robot.frame_names)}
        least = np.inf
        for a, b in arrays.blocks[:, :2]:
            for g in range(start[a], start[a + 1]):
                for h in range(start[b], start[b + 1]):
                    T = []
                    for node, shape in ((nodes[a], shapes[g]), (nodes[b], shapes[h])):
                        world = np.eye(4)
                        if node.carrier >= 0:
                            f = robot.frame_names.index(node.name)
                            local = np.eye(4)
                            local[:3, :3] = robot.model.frame_place[f][:9].reshape(3, 3)
                            local[:3, 3] = robot.model.frame_place[f][9:]
                            world = poses[node.name] @ np.linalg.inv(local)
                        placed = world @ shape.pose
                        T.append(coal.Transform3s(placed[:3, :3], placed[:3, 3]))
                    result = coal.DistanceResult()
                    least = min(least, coal.distance(theirs[g], T[0], theirs[h], T[1], request, result))
        if least > 0.0:
            assert mine[i] == pytest.approx(least, abs=1e-6)
        assert free[i] == (least > 0.0)


def test_motion_bound_holds() -> None:
    """No point of a link moves farther than reach × motion of the joints, on random robots and motions."""
    rng = np.random.default_rng(5)
    robot = planar(4)
    model = CollisionModel(robot).compiled
    for _ in range(50):
        a, b = rng.uniform(-3.0, 3.0, (2, robot.n))
        fa, fb = robot.fk(a), robot.fk(b)
        corners = np.array([[x, y, z, 1.0] for x in (0.03, 0.37) for y in (-0.03, 0.03) for z in (-0.03, 0.03)])
        for i in range(1, 5):
            f = robot.frame_names.index(f"link{i}")
            moved = np.linalg.norm((corners @ (fa[f] - fb[f]).T)[:, :3], axis=1).max()
            assert moved <= np.abs(b - a) @ model.nodes[i - 1, 5:] + 1e-12


def test_the_gradient_of_the_distance_is_its_derivative() -> None:
    robot = planar(4)
    model = CollisionModel(robot, scene(robot, Box("post", np.array([0.2, 0.3, 0.5]), pose(0.6, 0.7, R=rotation(RNG)))))
    q = np.random.default_rng(7).uniform(-1.5, 1.5, (200, robot.n))
    distance, slope = model.distance_gradient(q)
    np.testing.assert_array_equal(distance, model.distance(q))
    step = 1e-6
    found = np.stack(
        [(model.distance(q + step * e) - model.distance(q - step * e)) / (2.0 * step) for e in np.eye(robot.n)], axis=-1
    )
    wrong = np.abs(found - slope).max(axis=1) > 1e-4
    assert wrong.mean() < 0.05  # kinks, where the nearest pair or the nearest feature changes
    sliding = gantry()
    ball = CollisionModel(sliding, scene(sliding, Box("wall", np.array([0.4, 1.0, 0.4]), pose(0.5))))
    np.testing.assert_allclose(ball.distance_gradient(np.zeros(3))[1], [-1.0, 0.0, 0.0], atol=1e-9)


def test_bad_arguments_are_named() -> None:
    robot = planar(3)
    model = CollisionModel(robot)
    with pytest.raises(InputError, match="clearance is -1"):
        CollisionModel(robot, clearance=-1.0)
    with pytest.raises(InputError, match="resolution is 0"):
        CollisionModel(robot, resolution=0.0)
    with pytest.raises(InputError, match="step is nan"):
        model.edges_free(np.zeros(3), np.ones(3), step=float("nan"))
    with pytest.raises(InputError, match=r"q has shape \(2,\); expected \(..., 3\)"):
        model.free(np.zeros(2))
    with pytest.raises(InputError, match=r"every entry must be finite"):
        model.free(np.array([0.0, np.nan, 0.0]))
    with pytest.raises(UnknownNameError, match="Did you mean 'link1'"):
        model.allow([("lnk1", "link2")])
    with pytest.raises(UnknownNameError, match="no frame named 'tipp'"):
        model.attach([Convex.sphere(0.1)], "tipp", np.eye(4), name="ball")
    with pytest.raises(InputError, match="shapes need a name"):
        model.attach([Convex.sphere(0.1)], "tip", np.eye(4))
    with pytest.raises(InputError, match="names both a link"):
        CollisionModel(robot, scene(robot, Box("link1", np.ones(3), np.eye(4))))
    with pytest.raises(InputError, match="one configuration"):
        model.why(np.zeros((2, 3)))


def test_random_attached_poses_equal_the_body_moved_by_hand() -> None:
    robot = planar(2)
    wall = Box("wall", np.array([0.2, 0.2, 0.2]), pose(0.9, 0.5))
    model = CollisionModel(robot, scene(robot, wall))
    shape = Convex.box([0.2, 0.1, 0.3])
    rng = np.random.default_rng(6)
    for _ in range(20):
        T = pose(*(rng.normal(size=3) * 0.2), rotation(rng))
        held = model.attach([shape], "tip", T, name="thing").allow([("thing", "link1")])
        q = rng.uniform(-2.0, 2.0, 2)
        alone = signed_distance(shape, Convex.box(wall.size), robot.fk(q, "tip") @ T, wall.pose).distance
        assert held.distance(q) == pytest.approx(min(alone, model.distance(q)), abs=1e-9)
