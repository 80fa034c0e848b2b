"""Sampling of the surface, normals, and the shapes that bodies are made of."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import Body
from apprehend.bodies import HOUSEHOLD, shapes
from apprehend.bodies.convex import point_triangle_squared
from apprehend.bodies.mass import solid
from apprehend.errors import InputError, UnknownNameError


def test_samples_lie_on_their_faces_with_inward_normals() -> None:
    body = Body.household("mug")
    points, normals, face = body.sample_surface(500, np.random.default_rng(0))
    assert points.shape == normals.shape == (500, 3)
    assert np.sqrt(point_triangle_squared(points, body.triangles[face])).max() < 1e-12
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    # a step inwards along the normal is inside the wall: the winding number is one
    from apprehend.bodies.repair import solid_angles

    for point, normal in zip(points[:60], normals[:60]):
        inside = solid_angles(body.triangles - (point + 1e-4 * normal)).sum() / (4 * np.pi)
        assert inside == pytest.approx(1.0, abs=1e-6)


def test_samples_are_even_over_the_area() -> None:
    body = Body.box([0.1, 0.2, 0.3])
    _, normals, _ = body.sample_surface(60_000, np.random.default_rng(1))
    share = np.abs(normals).mean(axis=0)
    expected = np.array([0.06, 0.03, 0.02]) / 0.11
    assert np.allclose(share, expected, atol=0.01)
    assert np.allclose(normals.mean(axis=0), 0.0, atol=0.015)


def test_samples_repeat_with_the_seed() -> None:
    body = Body.household("banana")
    one, two = (body.sample_surface(50, np.random.default_rng(4))[0] for _ in range(2))
    assert np.array_equal(one, two)
    assert body.sample_surface(0, np.random.default_rng(4))[0].shape == (0, 3)
    with pytest.raises(InputError, match="n is -1"):
        body.sample_surface(-1, np.random.default_rng(0))


def test_a_sliver_takes_the_normal_of_its_neighbour() -> None:
    vertices, faces = shapes.box([0.1, 0.1, 0.1])
    middle = len(vertices)
    a, b, c = faces[0]
    vertices = np.vstack([vertices, 0.5 * (vertices[a] + vertices[b])])  # on an edge: a face without area
    other = next(i for i, f in enumerate(faces) if i and {a, b} <= set(f.tolist()))
    d = next(v for v in faces[other] if v not in (a, b))
    split = [[a, middle, c], [middle, b, c], [a, b, middle]]
    kept = [f for i, f in enumerate(faces.tolist()) if i not in (0,)]
    body = Body.from_mesh(vertices, [*split, *kept])
    assert d not in (a, b)
    assert body.watertight
    assert np.allclose(np.linalg.norm(body.face_normals, axis=1), 1.0)
    assert np.allclose(np.abs(body.face_normals).max(axis=1), 1.0)


def test_sizes() -> None:
    body = Body.box([0.1, 0.2, 0.3])
    assert np.allclose(body.extents, [0.1, 0.2, 0.3])
    assert body.radius == pytest.approx(np.linalg.norm([0.05, 0.1, 0.15]))
    assert body.area == pytest.approx(2 * (0.02 + 0.03 + 0.06))
    assert np.allclose(body.face_normals, np.sign(body.face_normals) * np.abs(body.face_normals).round())


def test_revolved_cylinder_and_ball_approach_their_formulas() -> None:
    n = shapes.SIDES
    prism = 0.5 * n * np.sin(2 * np.pi / n) * 0.03**2 * 0.1
    assert solid(*shapes.cylinder(0.03, 0.1)).volume == pytest.approx(prism, rel=1e-12)
    assert solid(*shapes.sphere(0.03)).volume == pytest.approx(4 / 3 * np.pi * 0.03**3, rel=0.01)


def test_a_swept_rod_has_the_volume_of_its_length() -> None:
    angle = np.linspace(0, np.pi, 200)
    arc = 0.1 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    vertices, faces = shapes.sweep(arc, shapes.circle(0.01, 64), 1.0, np.array([0.0, 0.0, 1.0]))
    assert solid(vertices, faces).volume == pytest.approx(np.pi * 0.01**2 * 0.1 * np.pi, rel=3e-3)


def test_a_profile_must_meet_the_axis() -> None:
    with pytest.raises(InputError, match="start and end on the axis"):
        shapes.revolve([(0.01, 0), (0.02, 0), (0, 0.1)])


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan")])
def test_shapes_without_size(bad: float) -> None:
    with pytest.raises(InputError, match="radius is"):
        Body.sphere(bad)
    with pytest.raises(InputError, match="height is"):
        Body.cylinder(0.1, bad)
    with pytest.raises(InputError, match="size"):
        Body.box([0.1, 0.1, bad])


@pytest.mark.parametrize("name", HOUSEHOLD)
def test_household_objects_are_sound(name: str) -> None:
    body = Body.household(name)
    assert body.name == name
    assert body.watertight
    assert body.repairs == ()
    assert body.bounds[0, 2] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(body.bounds.mean(axis=0)[:2]).max() < 0.16
    assert 0.03 < body.extents.max() < 0.30
    assert 100 < body.mass / body.volume < 9000  # from cardboard to steel
    assert 0.3 < body.friction < 1.0
    assert len(body.faces) < 6000


def test_unknown_household_object() -> None:
    with pytest.raises(UnknownNameError, match=r"no household object named 'mugg'.*Did you mean 'mug'\?"):
        Body.household("mugg")


def test_the_mug_has_a_handle_to_put_a_finger_through() -> None:
    """A closed surface with one handle has Euler characteristic 0."""
    body = Body.household("mug")
    assert len(body.vertices) - 3 * len(body.faces) // 2 + len(body.faces) == 0
