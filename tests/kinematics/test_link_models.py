"""Models of a robot's links enclose them, state their excess, and serve as collision geometry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from apprehend import Robot
from apprehend.errors import InputError
from apprehend.kinematics import link_models
from apprehend.kinematics.link_models import KINDS
from apprehend.robots.description import Link, Shape, ShapeKind
from apprehend.robots.meshes import link_surface


def surface_points(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    return np.vstack([vertices, vertices[faces].mean(axis=1)])


@pytest.mark.parametrize("kind", ["blocks", "boxes", "spheres", "capsules"])
def test_every_link_is_enclosed_within_the_stated_excess(kind: str) -> None:
    robot = Robot.load("ur5e")
    models = link_models(robot, kind, 2)
    assert models.outward < 0.3
    assert len(models.report().splitlines()) == len(models.links)
    for name, model in models.links.items():
        vertices, faces = link_surface(robot.description.links[name])
        assert len(model) <= 2
        assert model.distance(surface_points(vertices, faces)).max() <= 1e-9
        deviation = models.deviations[name]
        assert deviation.encloses
        corners = np.concatenate([v for v, _ in model.meshes()])
        assert models.surfaces[name].signed_distance(corners).max() <= deviation.outward


def test_round_links_are_enclosed_though_they_are_known_as_polyhedra() -> None:
    robot = Robot.load("ur5e")
    link = robot.description.links["forearm_link"]
    shapes = (
        Shape(ShapeKind.CYLINDER, (0.05, 0.3), np.eye(4)),
        Shape(ShapeKind.CAPSULE, (0.04, 0.5), np.eye(4)),
        Shape(ShapeKind.SPHERE, (0.1,), np.eye(4)),
    )
    for shape in shapes:
        links = {**robot.description.links, "forearm_link": replace(link, collisions=(shape,))}
        model = link_models(Robot(replace(robot.description, links=links)), "capsules").links["forearm_link"]
        angle = np.linspace(0.0, 2.0 * np.pi, 997)
        ring = shape.size[0] * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
        assert model.distance(ring).max() <= 0.0
        assert model.distance(ring[:, [2, 0, 1]]).max() <= 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_model(kind: str) -> None:
    if kind == "convex":
        pytest.skip("decomposes every link, which takes long the first time; the models of bodies test it")
    robot = Robot.load("panda")
    models = link_models(robot, kind)
    q = robot.home
    poses = models.at(q)
    assert set(poses) == set(models.links)
    point = poses["panda_link4"][:3, 3]
    near = models.distance([point, point + [0.0, 0.0, 5.0]], q)
    assert near[0] < 0.2
    assert near[1] > 4.0
    assert models.at(np.stack([q, q]))["panda_link4"].shape == (2, 4, 4)


def test_the_models_replace_the_collision_geometry(tmp_path: Path) -> None:
    robot = Robot.load("panda")
    spheres = link_models(robot, "spheres", 4)
    for path in (tmp_path / "panda.urdf", tmp_path / "panda.xml"):
        back = Robot.load(spheres.save(path))
        shapes = back.description.links["panda_link3"].collisions
        assert {s.kind for s in shapes} == {ShapeKind.SPHERE}
        found = sorted(s.size[0] for s in shapes)
        assert found == pytest.approx(sorted(spheres.links["panda_link3"].radii), abs=1e-6)
    capsules = link_models(robot, "capsules")
    back = Robot.load(capsules.save(tmp_path / "capsules.xml"))
    shape = back.description.links["panda_link3"].collisions[0]
    ends = shape.pose[:3, 3] + np.outer([-0.5, 0.5], shape.size[1] * shape.pose[:3, 2])
    assert np.allclose(ends, capsules.links["panda_link3"].ends[0], atol=1e-6)


def test_mistakes_are_named(tmp_path: Path) -> None:
    robot = Robot.load("ur5e")
    with pytest.raises(InputError, match="kind is 'cones'; expected one of"):
        link_models(robot, "cones")
    with pytest.raises(InputError, match="count is 0"):
        link_models(robot, "spheres", 0)
    capsules = link_models(robot, "capsules")
    with pytest.raises(InputError, match="URDF has no capsules"):
        capsules.save(tmp_path / "robot.urdf")
    with pytest.raises(InputError, match=r"'\.stl' is none of a robot"):
        capsules.save(tmp_path / "robot.stl")
    with pytest.raises(InputError, match="kind is 'wireframe'"):
        link_models(robot, "wireframe").description()
    links = {name: Link(name) for name in robot.description.links}
    bare = Robot(replace(robot.description, name="bare", links=links))
    with pytest.raises(InputError, match="no link of bare has a collision shape"):
        link_models(bare)
