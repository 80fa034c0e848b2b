"""Exact questions about points: closest point, inside, signed distance, winding numbers."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import Body
from apprehend.bodies import MeshIndex, shapes
from apprehend.bodies.convex import point_triangle_squared
from apprehend.bodies.repair import solid_angles
from apprehend.errors import InputError
from tests.support import reference


def test_distances_equal_the_reference() -> None:
    data = reference("mesh_queries.json")
    cases = [c for c in data["cases"] if c["id"].startswith("point/")]
    assert len(cases) >= 50
    for name, mesh in data["conventions"]["meshes"].items():
        index = MeshIndex(np.array(mesh["vertices"]), np.array(mesh["faces"], dtype=np.int64))
        own = [c for c in cases if c["inputs"]["mesh"] == name]
        if not own:
            continue
        points = np.array([c["inputs"]["point"] for c in own])
        expected = [c["expected"] for c in own]
        assert np.abs(index.nearest(points).distance - [e["unsigned_distance"] for e in expected]).max() < 1e-9
        assert np.array_equal(index.inside(points), [e["inside"] for e in expected])
        signed = [e["signed_distance_neg_inside"] for e in expected]
        assert np.abs(index.signed_distance(points) - signed).max() < 1e-9


def test_a_box_has_its_closed_form() -> None:
    half = np.array([0.05, 0.1, 0.15])
    body = Body.box(2 * half)
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (40, 50, 3))
    beyond = np.abs(points) - half
    expected = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + np.minimum(beyond.max(axis=-1), 0.0)
    assert np.abs(body.signed_distance(points) - expected).max() < 1e-12
    assert np.array_equal(body.inside(points), (beyond < 0.0).all(axis=-1))
    near = body.closest_point(points)
    assert near.points.shape == (40, 50, 3)
    assert near.faces.shape == near.distance.shape == (40, 50)
    assert np.allclose(np.linalg.norm(points - near.points, axis=-1), near.distance, atol=1e-12)


def test_many_points_have_the_same_answers_as_few() -> None:
    """Large batches are answered on lanes, in another order."""
    body = Body.household("mug")
    points = np.random.default_rng(1).uniform(body.bounds[0] - 0.05, body.bounds[1] + 0.05, (5003, 3))
    together = body.closest_point(points)
    apart = [body.closest_point(points[i : i + 1000]) for i in range(0, 5003, 1000)]
    assert np.abs(together.distance - np.concatenate([a.distance for a in apart])).max() < 1e-15
    assert np.allclose(np.linalg.norm(points - together.points, axis=1), together.distance, atol=1e-15)
    assert np.sqrt(point_triangle_squared(points, body.triangles[together.faces])) == pytest.approx(together.distance)
    one = np.zeros((4096, 3))
    assert np.ptp(body.closest_point(one).distance) == 0.0


def sum_of_angles(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The winding number by its definition."""
    return np.array([solid_angles(vertices[faces] - p).sum() / (4.0 * np.pi) for p in points])


@pytest.mark.parametrize("keep", [1.0, 0.97, 0.5, 0.01])
def test_winding_numbers_equal_the_sum_over_all_faces(keep: float) -> None:
    rng = np.random.default_rng(3)
    body = Body.household("mug")
    faces = body.faces[rng.random(len(body.faces)) < keep]
    index = MeshIndex(body.vertices, faces)
    assert index.closed == (keep == 1.0)
    points = rng.uniform(body.bounds[0] - 0.02, body.bounds[1] + 0.02, (300, 3))
    expected = sum_of_angles(body.vertices, faces, points)
    assert np.abs(index.winding_number(points) - expected).max() < 1e-9
    clear = np.abs(expected - 0.5) > 0.02  # far holes count as dipoles
    assert np.array_equal(index.inside(points)[clear], expected[clear] > 0.5)


def test_rays_through_edges_and_corners_are_counted_once() -> None:
    body = Body.box([0.2, 0.2, 0.2])
    steps = np.linspace(-0.2, 0.2, 9)  # among them the planes of the faces' edges and diagonals
    points = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    clear = np.abs(np.abs(points).max(axis=1) - 0.1) > 1e-9
    assert np.array_equal(body.inside(points)[clear], np.abs(points[clear]).max(axis=1) < 0.1)


def test_overlapping_parts_wind_twice_and_turned_ones_backwards() -> None:
    vertices, faces = shapes.box([0.1, 0.1, 0.1])
    both = np.vstack([vertices, vertices + 0.05]), np.vstack([faces, faces + len(vertices)])
    index = MeshIndex(*both)
    assert np.allclose(index.winding_number([[0.03, 0.03, 0.03], [-0.03, -0.03, -0.03], [0.2, 0, 0]]), [2, 1, 0])
    assert index.inside([0.03, 0.03, 0.03])
    assert np.allclose(MeshIndex(vertices, faces[:, ::-1]).winding_number([[0.0, 0.0, 0.01]]), -1)


def test_points_must_have_three_coordinates() -> None:
    body = Body.box([0.1, 0.1, 0.1])
    for ask in (body.closest_point, body.signed_distance, body.inside):
        with pytest.raises(InputError, match=r"points has shape \(2,\); expected \(\.\.\., 3\)"):
            ask([0.0, 1.0])
        with pytest.raises(InputError, match="nan"):
            ask([0.0, 1.0, np.nan])
    assert body.signed_distance(np.empty((0, 3))).shape == (0,)
