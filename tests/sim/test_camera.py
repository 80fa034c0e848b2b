"""Simulated depth cameras see geometry where it is."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.errors import InputError, UnknownNameError
from apprehend.perception import Camera, Noise, look_at
from apprehend.sim import World, hand_camera, look

from .scenes import pendulum, rig, scene, table, translation


def test_depth_is_that_of_the_geometry() -> None:
    """A sphere on a table from above: closed forms for both."""
    radius, height = 0.05, 0.9
    ball = Body.sphere(radius, mass=0.1)
    world = World(scene(pendulum(), boxes=(table(),), ball=(ball, translation(0.5, 0.5, radius))))
    camera = Camera.from_fov(200, 200, np.radians(30.0))
    view = look(world, camera, look_at([0.5, 0.5, height], [0.5, 0.5, 0.0]))
    on_table, on_ball = view.shows("table"), view.shows("ball")
    assert view.image.depth[on_table] == pytest.approx(height, abs=1e-6)
    rays = camera.rays[on_ball]
    a, b, c = (rays**2).sum(1), -2.0 * rays[:, 2] * (height - radius), (height - radius) ** 2 - radius**2
    exact = (-b - np.sqrt(np.maximum(b * b - 4 * a * c, 0.0))) / (2 * a)
    distance_from_axis = np.linalg.norm(rays[:, :2], axis=1) * exact
    middle = distance_from_axis < 0.8 * radius
    assert view.image.depth[on_ball][middle] == pytest.approx(exact[middle], abs=6e-4)  # facets of the mesh
    assert view.pixels["ball"] + view.pixels["table"] == 200 * 200
    assert not view.shows("nothing").any()


def test_concave_meshes_are_seen_as_they_are() -> None:
    """Contacts see convex pieces; the camera looks into the mug."""
    mug = Body.household("mug")
    world = World(scene(pendulum(), boxes=(table(),), mug=(mug, translation(0.5, 0.5, -mug.bounds[0, 2]))))
    view = look(world, Camera.from_fov(120, 120, np.radians(25.0)), look_at([0.5, 0.5, 0.8], [0.5, 0.5, 0.0]))
    heights = view.image.points()[view.shows("mug")][:, 2]
    assert heights.max() == pytest.approx(mug.extents[2], abs=1e-3)
    assert heights.min() < 0.2 * mug.extents[2]


def test_the_robot_is_known_and_a_camera_moves_with_its_link() -> None:
    at = rig("ur5e")
    world = World(scene(at.robot, boxes=(table(),), hand_root=at.hand_root))
    world.set_q(at.q)
    tcp = at.hand.jaw.tcp_at(at.hand.jaw.max_width)
    mount = hand_camera(world, at.hand.root, tcp)
    view = look(world, Camera.from_fov(160, 120), mount, link=at.hand.root)
    assert view.image.pose == pytest.approx(world.frame(at.hand.root) @ mount)
    in_camera = np.linalg.solve(mount, tcp)[:3, 3]
    assert view.image.camera.project(in_camera) == pytest.approx([80.0, 60.0], abs=1e-6)
    robot = [name for name in view.pixels if name in world.plant.links]
    assert view.pixels["table"] > 0
    for name in robot:
        assert not view.image.valid[view.shows(name)].any()


def test_noise_comes_from_the_worlds_generator() -> None:
    camera, pose = Camera.from_fov(80, 60), look_at([0.5, 0.5, 1.0], [0.5, 0.4, 0.0])
    views = []
    for seed in (1, 1, 2):
        world = World(scene(pendulum(), boxes=(table(),)), rng=np.random.default_rng(seed))
        views.append(look(world, camera, pose, noise=Noise()).image.depth)
    assert np.array_equal(views[0], views[1])
    assert not np.array_equal(views[0], views[2])


def test_bad_arguments() -> None:
    world = World(scene(pendulum(), boxes=(table(),)))
    with pytest.raises(InputError, match="pose has shape"):
        look(world, Camera.from_fov(8, 6), np.tile(np.eye(4), (2, 1, 1)))
    with pytest.raises(UnknownNameError, match="no link named 'wrist'"):
        look(world, Camera.from_fov(8, 6), np.eye(4), link="wrist")
