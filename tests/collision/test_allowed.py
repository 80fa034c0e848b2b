"""Allowed pairs by sampling and SRDF, motions proven free, distances of every pair."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.collision import Box, CollisionModel, Convex, RobotSource, Scene, find_allowed_pairs
from apprehend.collision.allowed import sampled
from apprehend.errors import DescriptionError, InputError
from apprehend.kinematics import Robot
from apprehend.robots import Description, Joint, JointLimits, JointType, Link, Shape, ShapeKind, parse_srdf
from tests.collision.makers import gantry, planar, pose


def pair(a: str, b: str) -> frozenset[str]:
    return frozenset((a, b))


def test_pairs_are_found_as_setup_assistants_do(tmp_path) -> None:
    robot = planar(4)
    found = find_allowed_pairs(robot, rng=np.random.default_rng(0), samples=300)
    assert found.reasons[pair("link1", "link2")] == "connected by a joint"
    assert pair("link1", "link3") not in found.reasons  # folds onto it in a few configurations
    assert 0.0 < found.rates[pair("link1", "link3")] < 0.5
    # a long first link that nothing can reach
    far = {"link1": [Convex.sphere(0.05)], "link4": [Convex.sphere(0.01)], "link2": [Convex.sphere(0.01)]}
    apart = find_allowed_pairs(robot, rng=np.random.default_rng(0), samples=300, geometry=far)
    assert apart.reasons[pair("link2", "link4")] == "touch in none of the sampled configurations"
    wary = find_allowed_pairs(robot, rng=np.random.default_rng(0), samples=300, geometry=far, never=False)
    assert pair("link2", "link4") not in wary.reasons
    always = {"link1": [Convex.sphere(1.5)], "link4": [Convex.sphere(0.1)]}
    inside = find_allowed_pairs(robot, rng=np.random.default_rng(0), samples=300, geometry=always)
    assert inside.reasons[pair("link1", "link4")] == "touch in nearly every configuration"
    assert apart.matrix.shape == (3, 3)
    assert (apart.matrix == apart.matrix.T).all()
    assert apart.matrix.diagonal().all()
    with pytest.raises(InputError, match="samples is 0"):
        find_allowed_pairs(robot, rng=np.random.default_rng(0), samples=0)
    # written and read again
    model = CollisionModel(robot)
    again = model.allow_srdf(found.save(tmp_path / "planar.srdf"))
    assert again.allowed >= set(found.reasons)
    assert again.reasons[pair("link1", "link2")] == "allowed by planar.srdf"
    assert model.allow_srdf(parse_srdf(found.to_srdf())).allowed == again.allowed


def test_srdf_as_text_and_its_errors(tmp_path) -> None:
    model = CollisionModel(planar(3))
    folded = np.array([0.0, 2.9, 2.9])
    assert not model.free(folded)
    text = '<robot name="planar"><disable_collisions link1="link1" link2="link3" reason="User"/></robot>'
    assert model.allow_srdf(text).free(folded)
    with pytest.raises(DescriptionError, match=r"names 'link9', which is no link of robot 'planar'\. Did you mean"):
        model.allow_srdf(text.replace("link3", "link9"))
    with pytest.raises(DescriptionError, match="expected <robot>"):
        model.allow_srdf("<sdf/>")
    with pytest.raises(DescriptionError, match="malformed XML"):
        model.allow_srdf("<robot><disable_collisions")
    with pytest.raises(DescriptionError, match=r"no\.srdf does not exist"):
        model.allow_srdf(tmp_path / "no.srdf")


def test_motions_are_proven_free_up_to_the_first_contact() -> None:
    robot = gantry()
    wall = Box("wall", np.array([0.2, 4.0, 4.0]), pose(1.0))
    model = CollisionModel(robot, Scene(robot, RobotSource("in code"), boxes=(wall,)))
    a = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.5, 0.0, 0.0]])
    b = np.array([[1.6, 0.0, 0.0], [0.79, 1.0, 1.0], [1.9, 1.0, 0.0]])
    found = model.sweep(a, b, tolerance=1e-6)
    assert found.free.tolist() == [False, True, True]
    assert found.until[0] == pytest.approx(0.8 / 1.6, abs=1e-6)  # the ball of 0.1 reaches the wall at 0.9
    assert found.until[0] <= 0.5
    assert found.names == (("ball", "wall"), None, None)
    inside = model.sweep([1.0, 0.0, 0.0], [1.0, 0.5, 0.0])
    assert inside.until == 0.0
    assert not inside.free
    wide = model.with_clearance(0.3).sweep(a[0], b[0], tolerance=1e-6)
    assert wide.until == pytest.approx(0.5 / 1.6, abs=1e-6)
    with pytest.raises(InputError, match="tolerance is 0"):
        model.sweep(a, b, tolerance=0.0)
    with pytest.raises(InputError, match="qb slides joint 'slide_x' to 5 m from its zero"):
        model.sweep([0.0, 0.0, 0.0], [5.0, 0.0, 0.0])
    with pytest.raises(InputError, match="qa slides joint 'slide_y'"):
        model.edges_free([0.0, 3.0, 0.0], [0.0, 0.0, 0.0])


def test_distances_of_every_pair_with_gradients() -> None:
    robot = planar(4)
    boxes = (Box("post", np.array([0.2, 0.3, 0.5]), pose(0.5, 0.4)), Box("far", np.ones(3), pose(9.0)))
    model = CollisionModel(robot, Scene(robot, RobotSource("in code"), boxes=boxes))
    q = np.random.default_rng(1).uniform(-2.5, 2.5, (2, 20, robot.n))
    found = model.distances(q)
    pairs = len(found.names)
    assert found.distance.shape == (2, 20, pairs)
    assert found.gradient.shape == (2, 20, pairs, robot.n)
    np.testing.assert_allclose(found.distance.min(axis=-1), model.distance(q), atol=1e-12)
    step = 1e-6
    slopes = np.stack(
        [(model.distances(q + step * e).distance - model.distances(q - step * e).distance) / (2.0 * step)
         for e in np.eye(robot.n)], axis=-1,
    )  # fmt: skip
    wrong = np.abs(slopes - found.gradient).max(axis=-1) > 1e-4
    assert wrong.mean() < 0.02  # kinks
    near = model.distances(q, within=0.1)
    close = found.distance <= 0.1
    np.testing.assert_allclose(near.distance[close], found.distance[close], atol=1e-12)
    assert (near.distance[~close] > 0.1).all()
    assert (near.distance <= found.distance + 1e-9).all()
    far = np.array([name == ("link4", "far") for name in found.names])
    assert not near.gradient[..., far, :].any()
    touching = model.why(q[0, 0])
    names = {frozenset(n) for n, d in zip(found.names, found.distance[0, 0], strict=True) if d <= 0.0}
    assert {frozenset((touch.a, touch.b)) for touch in touching} == names
    with pytest.raises(InputError, match="within is NaN"):
        model.distances(q, within=float("nan"))


def test_what_hangs_on_a_link_without_geometry_is_checked_unless_it_is_near() -> None:
    """A table and a socket fixed to an empty root: the first link turns in the socket, and may hit the table."""

    def link(name: str, *size: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Link:
        return Link(name, collisions=(Shape(ShapeKind.BOX, size, pose(*at)),) if size else ())

    links = [link("root"), link("socket", 0.1, 0.1, 0.1), link("table", 0.2, 0.2, 0.1), link("arm", 0.5, 0.05, 0.05)]
    limits = JointLimits(-3.0, 3.0, 1.0)
    joints = (
        Joint("mount", JointType.FIXED, "root", "socket", np.eye(4)),
        Joint("stand", JointType.FIXED, "root", "table", pose(0.3)),
        Joint("turn", JointType.REVOLUTE, "root", "arm", np.eye(4), np.array([0.0, 0.0, 1.0]), limits),
    )
    links[3] = link("arm", 0.5, 0.05, 0.05, at=(0.25, 0.0, 0.0))
    robot = Robot(Description("turner", "root", {link.name: link for link in links}, joints))
    model = CollisionModel(robot)
    assert model.reasons == {pair("arm", "socket"): "connected by a joint"}
    assert model.free([1.5])
    assert [(t.a, t.b) for t in model.why([0.0])] == [("arm", "table")]


def test_joints_are_sampled_within_their_limits() -> None:
    """A slide that is nowhere within π m of its zero, and a joint that turns on and on."""
    axis, limits = np.array([1.0, 0.0, 0.0]), JointLimits(4.0, 6.0, 1.0)
    ball = (Shape(ShapeKind.SPHERE, (0.1,), np.eye(4)),)
    names = ["base", "cart", "wheel"]
    joints = (
        Joint("slide", JointType.PRISMATIC, "base", "cart", np.eye(4), axis, limits),
        Joint("spin", JointType.CONTINUOUS, "cart", "wheel", pose(0.5), axis),
    )
    robot = Robot(Description("cart", "base", {n: Link(n, collisions=ball) for n in names}, joints))
    low, high = sampled(robot)
    np.testing.assert_allclose([low, high], [[4.0, -np.pi], [6.0, np.pi]])
    assert CollisionModel(robot).free([5.0, 0.0])
