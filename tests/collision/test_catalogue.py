"""Collision models of every robot that is installed."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from apprehend.collision import CollisionModel, Convex
from apprehend.collision.allowed import sampled
from apprehend.errors import ApprehendError, InputError
from apprehend.kinematics import Robot
from apprehend.robots.catalogue import entry, names
from tests.collision.test_spheres import unit

HEAVY = (
    "bolt",
    "centauro",
    "double_pendulum",
    "finger_edu",
    "g1",
    "jaco",
    "romeo",
    "so101",
    "solo12",
    "tiago_pro",
    "z1",
)
"""Robots whose meshes take more than a second to cut into hulls for the first time."""

ROBOTS = [pytest.param(name, marks=[pytest.mark.slow] if name in HEAVY else []) for name in names()]


@functools.cache
def model_of(name: str) -> CollisionModel:
    if not entry(name).installed:
        pytest.skip(f"the wheel {entry(name).wheel} is not installed")
    try:
        robot = Robot.load(name)
    except ApprehendError as error:
        pytest.skip(str(error))
    if not any(link.collisions for link in robot.description.links.values()):
        with pytest.raises(InputError, match=f"robot {name!r} has no collision geometry"):
            CollisionModel(robot)
        pytest.skip("has no collision geometry, and says so")
    return CollisionModel(robot)


def inside(shape: Convex, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points of the shape, most of them on its surface, in the frame of its carrier."""
    from apprehend.collision.geometry import pack
    from apprehend.kernels.gjk import support

    arrays = pack((shape,))[:4]
    far = np.array([support(*arrays, 0, *d, 0)[:3] for d in rng.normal(size=(count, 3))])
    mixed = np.concatenate([far, 0.5 * (far + far[rng.permutation(count)])])
    return (mixed + shape.radius * unit(rng, 2 * count)) @ shape.pose[:3, :3].T + shape.pose[:3, 3]


@pytest.mark.parametrize("name", ROBOTS)
def test_spheres_hold_the_links_and_the_home_is_free(name: str) -> None:
    model = model_of(name)
    robot, lanes, rng = model.robot, model.lanes, np.random.default_rng(0)
    moving = [node for node in model.nodes if node.carrier >= 0]
    for node, (carrier, first, end) in zip(moving, lanes.parts, strict=True):
        assert carrier == node.carrier
        balls = lanes.spheres[first:end]
        for shape in node.shapes:
            assert isinstance(shape, Convex)
            points = inside(shape, 12, rng)
            gaps = np.linalg.norm(points[:, None] - balls[:, :3], axis=2) - balls[:, 3]
            assert gaps.min(axis=1).max() < 1e-9
    assert [str(touch) for touch in model.why(robot.home)] == []
    assert model.free(robot.home)
    q = rng.uniform(*sampled(robot), (40, robot.n))
    np.testing.assert_array_equal(model.free(q), model.hits(q) < 0)


@pytest.mark.parametrize("name", ROBOTS)
def test_no_pair_that_seldom_touches_is_left_out_unless_someone_said_so(name: str) -> None:
    """What the description does not allow is checked, but for neighbours, linkages, and what touches all the time."""
    model = model_of(name)
    robot, links = model.robot, model.nodes
    tested = {frozenset((links[a].name, links[b].name)) for a, b in model.compiled.blocks[:, :2]}
    parents = {frozenset((j.parent, j.child)) for j in robot.description.joints}
    spared = {p for p, reason in model.reasons.items() if reason == "connected by a joint"} - parents
    for a in links:
        for b in links:
            names_of = frozenset((a.name, b.name))
            if a.carrier != b.carrier and names_of not in model.reasons:
                assert names_of in tested
    if spared:  # a link between them has no geometry: they touch there
        found = CollisionModel(robot).forbid([tuple(sorted(p)) for p in spared])
        q = np.random.default_rng(1).uniform(*sampled(robot), (50, robot.n))
        distances = found.distances(q, within=0.0)
        often = dict(zip(map(frozenset, distances.names), (distances.distance <= 0.0).mean(axis=0), strict=True))
        assert all(often[p] > 0.3 for p in spared if p in often)
