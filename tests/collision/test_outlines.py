"""Geometry as triangles: on the surface, and the right size."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.collision import Cloud, Convex, HalfSpace, Scene, Union, signed_distance
from apprehend.collision.outlines import triangles
from tests.collision.makers import pose, rotation

SHAPES = {
    "box": (Convex.box([0.1, 0.2, 0.3]), 0.006),
    "ball": (Convex.sphere(0.1), 4.0 / 3.0 * np.pi * 0.001),
    "capsule": (Convex.capsule(0.1, 0.2), 4.0 / 3.0 * np.pi * 0.001 + np.pi * 0.01 * 0.2),
    "cylinder": (Convex.cylinder(0.1, 0.2), np.pi * 0.01 * 0.2),
    "cone": (Convex.cone(0.1, 0.3), np.pi * 0.01 * 0.1),
    "egg": (Convex.ellipsoid([0.1, 0.2, 0.3]), 4.0 / 3.0 * np.pi * 0.006),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_triangles_enclose_nearly_the_volume(kind: str) -> None:
    shape, volume = SHAPES[kind]
    placed = shape.at(pose(0.3, -0.2, 0.1, rotation(np.random.default_rng(1))))
    vertices, faces = triangles(placed)
    p = vertices[faces] - vertices.mean(axis=0)
    found = np.einsum("fi,fi->", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6.0
    assert 0.95 * volume < found <= volume * (1.0 + 1e-6)
    T = np.array([pose(*v) for v in vertices])
    on = signed_distance(Convex.hull([[0.0, 0.0, 0.0]]), placed, T, np.eye(4)).distance
    assert np.abs(on).max() < 1e-7


def test_the_others_have_triangles_too() -> None:
    scene = Scene.tabletop("ur5e", body="can")
    things = {
        "ground": HalfSpace.through([0.0, 0.0, -1.0], [0.0, 1.0, 1.0]),
        "seen": Cloud.of(np.random.default_rng(2).normal(size=(20, 3))),
        "skin": Union.surface(np.eye(3), [[0, 1, 2]]),
        "parts": Union.of([Convex.box([0.1, 0.1, 0.1])]),
        "field": scene.bodies["can"].body.distance_field(0.01),
    }
    for name, thing in things.items():
        scene = scene.with_obstacle(name, thing)
        vertices, faces = triangles(scene.obstacles[name].shapes[0])
        assert np.isfinite(vertices).all()
        assert faces.max() < len(vertices)
    flat = scene.obstacles["ground"].shapes[0]
    np.testing.assert_allclose(triangles(flat)[0] @ flat.normal, flat.offset, atol=1e-12)
    from apprehend.viewer import render

    assert render(scene, size=(64, 48)).shape == (48, 64, 3)
