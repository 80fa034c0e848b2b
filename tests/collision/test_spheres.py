"""Spheres cover what they stand for, and lanes never call free what the exact model calls a collision."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.bodies.fit import ball
from apprehend.collision import Box, CollisionModel, Convex, RobotSource, Scene
from apprehend.collision.spheres import cover, excess
from apprehend.errors import UnknownNameError
from tests.collision.makers import gantry, planar, pose, rotation

MAKE = {
    "sphere": lambda rng: Convex.sphere(rng.uniform(0.05, 0.3)),
    "capsule": lambda rng: Convex.capsule(rng.uniform(0.03, 0.1), rng.uniform(0.1, 0.5)),
    "box": lambda rng: Convex.box(rng.uniform(0.02, 0.5, 3)),
    "cylinder": lambda rng: Convex.cylinder(rng.uniform(0.03, 0.2), rng.uniform(0.05, 0.5)),
    "cone": lambda rng: Convex.cone(rng.uniform(0.03, 0.2), rng.uniform(0.05, 0.5)),
    "ellipsoid": lambda rng: Convex.ellipsoid(rng.uniform(0.03, 0.3, 3)),
    "hull": lambda rng: Convex.hull(rng.normal(size=(60, 3)) * rng.uniform(0.02, 0.2, 3)),
    "flat": lambda rng: Convex.hull(rng.normal(size=(30, 3)) * [0.2, 0.1, 0.0]),
}


@pytest.mark.parametrize("kind", MAKE)
def test_covers_hold_the_whole_shape(kind: str) -> None:
    """The farthest point of the shape in any direction, and mixtures of such points, lie in some sphere."""
    from apprehend.collision.geometry import pack
    from apprehend.kernels.gjk import support

    rng = np.random.default_rng([1, *map(ord, kind)])
    for _ in range(4):
        shape = MAKE[kind](rng).at(pose(*rng.normal(size=3), rotation(rng)))
        balls = cover(shape, small=0.01)
        assert len(balls) <= 24
        arrays = pack((shape,))[:4]
        far = [support(*arrays, 0, *rng.normal(size=3), 0)[:3] for _ in range(60)]
        weights = rng.dirichlet(np.full(3, 0.5), 2000)
        core = np.einsum("nk,nkc->nc", weights, np.array(far)[rng.integers(60, size=(2000, 3))])
        local = core + shape.radius * rng.uniform(size=(2000, 1)) * unit(rng, 2000)
        points = local @ shape.pose[:3, :3].T + shape.pose[:3, 3]
        gaps = np.linalg.norm(points[:, None] - balls[None, :, :3], axis=2) - balls[None, :, 3]
        assert gaps.min(axis=1).max() < 1e-9


def unit(rng: np.random.Generator, count: int) -> np.ndarray:
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1)[:, None]


def test_more_spheres_stick_out_less() -> None:
    box = Convex.box([0.6, 0.1, 0.1])
    few, many = (excess(cover(box, most=most, small=0.001), (box,)) for most in (2, 24))
    assert many < 0.5 * few
    exactly = np.sqrt(0.15**2 + 2 * 0.05**2) - 0.05  # two balls of that radius, 0.15 from the ends
    assert few == pytest.approx(exactly, rel=0.05)
    ball = Convex.sphere(0.2)
    assert excess(cover(ball), (ball,)) < 1e-9


def test_enclosing_balls_enclose_and_are_nearly_the_smallest() -> None:
    rng = np.random.default_rng(2)
    points = unit(rng, 200) * 0.7 + [1.0, 2.0, 3.0]
    centre, radius = ball(points)
    assert np.linalg.norm(points - centre, axis=1).max() <= radius
    assert radius < 0.7 * 1.03


def crowded(robot, rng: np.random.Generator, *, simple: bool = False) -> CollisionModel:
    model = CollisionModel(robot, Scene(robot, RobotSource("in code")))
    kinds = ["sphere", "capsule", "box", "cylinder"] if simple else list(MAKE)
    for k in range(12):
        angle, r = rng.uniform(-np.pi, np.pi), rng.uniform(1.1, 1.7)
        centre = r * np.cos(angle), r * np.sin(angle), rng.uniform(-0.1, 0.1)
        shape = MAKE[kinds[k % len(kinds)]](rng)
        model = model.add(f"thing{k}", [shape], pose(*centre, rotation(rng)))
    return model


def test_free_on_lanes_is_free_exactly() -> None:
    robot = planar(4)
    model = crowded(robot, np.random.default_rng(3))
    assert not model.lanes.decides[0]
    q = np.random.default_rng(4).uniform(-2.9, 2.9, (3000, robot.n))
    exact = model.hits(q) < 0
    assert 0.05 < exact.mean() < 0.95
    np.testing.assert_array_equal(model.free(q), exact)


def test_models_of_spheres_are_decided_on_lanes() -> None:
    robot = planar(4)
    balls = [Convex.sphere(0.04).at(pose(x)) for x in (0.05, 0.12, 0.2, 0.28, 0.35)]
    rng = np.random.default_rng(5)
    model = CollisionModel(robot, geometry={f"link{i}": balls for i in range(1, 5)})
    for k in range(10):
        shape = MAKE[["box", "cylinder", "sphere", "capsule"][k % 4]](rng)
        model = model.add(f"thing{k}", [shape], pose(*(unit(rng, 1)[0] * rng.uniform(0.4, 1.4)), rotation(rng)))
    assert model.lanes.decides[0]
    for checked in (model, model.with_clearance(0.03)):
        q = rng.uniform(-2.9, 2.9, (3000, robot.n))
        exact = checked.hits(q) < 0
        assert 0.05 < exact.mean() < 0.95
        np.testing.assert_array_equal(checked.free(q), exact)
    with pytest.raises(UnknownNameError, match="no frame named 'link9'"):
        CollisionModel(robot, geometry={"link9": balls})


@pytest.mark.parametrize("spheres", [True, False])
def test_motions_on_lanes_agree_with_the_exact_scan(spheres: bool) -> None:
    robot = planar(4)
    rng = np.random.default_rng(6)
    model = crowded(robot, rng, simple=True)
    if spheres:
        balls = [Convex.sphere(0.04).at(pose(x)) for x in (0.05, 0.12, 0.2, 0.28, 0.35)]
        model = CollisionModel(robot, geometry={f"link{i}": balls for i in range(1, 5)})
        model = model.add("post", [Convex.cylinder(0.1, 0.5)], pose(0.6, 0.5)).add(
            "box", [Convex.box([0.2, 0.3, 0.4])], pose(-0.6, 0.4)
        )
    q = rng.uniform(-2.9, 2.9, (120, robot.n))
    q = q[model.free(q)][:60]
    a, b = q[:-1], q[1:]
    free, hit = model.edges_free(a, b), model.edge_hits(a, b)[0] >= 0
    assert 0.02 < free.mean() < 0.98
    s = np.linspace(0.0, 1.0, 501)[:, None, None]
    least = model.distance(a + s * (b - a)).min(axis=0)
    assert (least[free] > -model.resolution).all()
    assert (least[~free] < 8e-3).all()
    different = free == hit  # only where the motion grazes something
    assert (np.abs(least[different]) < 8e-3).all()
    assert model.edges_free(q[0], q[0])


def test_a_sliding_robot_keeps_all_its_obstacles() -> None:
    """Obstacles out of reach are left out; what slides has no such reach."""
    robot = gantry()
    model = CollisionModel(robot, Scene(robot, RobotSource("in code"), boxes=(Box("far", np.full(3, 0.2), pose(1.8)),)))
    assert not model.free(np.array([1.8, 0.0, 0.0]))
    arm = planar(2)
    near, far = Box("near", np.full(3, 0.2), pose(0.8)), Box("far", np.full(3, 0.2), pose(3.0))
    model = CollisionModel(arm, Scene(arm, RobotSource("in code"), boxes=(near, far)))
    assert len(model.lanes.meets) == 1  # the outer link, and the near box
    assert not model.free(np.zeros(2))


def test_huge_joint_values_are_whole_turns() -> None:
    robot = planar(2)
    model = CollisionModel(
        robot, Scene(robot, RobotSource("in code"), boxes=(Box("post", np.full(3, 0.2), pose(0.7)),))
    )
    turns = 2.0 * np.pi * 1e6
    assert not model.free(np.array([turns, 0.0]))
    assert model.free(np.array([turns + np.pi, 0.0]))


def test_attached_bodies_are_on_lanes_too() -> None:
    robot = planar(3)
    model = crowded(robot, np.random.default_rng(7)).attach(
        Body.box([0.3, 0.05, 0.05], name="stick"), "tip", pose(0.15)
    )
    q = np.random.default_rng(8).uniform(-2.9, 2.9, (1500, robot.n))
    np.testing.assert_array_equal(model.free(q), model.hits(q) < 0)
