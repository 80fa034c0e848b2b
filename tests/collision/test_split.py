"""A few hulls that contain a mesh."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from apprehend.bodies import Body
from apprehend.bodies.parts import cut
from apprehend.bodies.repair import union
from apprehend.bodies.shapes import box
from apprehend.bodies.surface import sample, unit_normals
from apprehend.collision import Convex, signed_distance
from apprehend.collision.shapes import mesh_hulls
from apprehend.collision.split import split, volume
from tests.collision.makers import pose, rotation


def volume_of(shapes: tuple[Convex, ...]) -> float:
    return sum(volume(shape.points) for shape in shapes)


def angle_bracket() -> tuple[np.ndarray, np.ndarray]:
    """An L of two legs 0.3 long and 0.05 thick, extruded by 0.1."""
    outline = np.array([[0, 0], [0.3, 0], [0.3, 0.05], [0.05, 0.05], [0.05, 0.3], [0, 0.3]])
    caps = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    vertices = np.array([[x, y, z] for z in (0.0, 0.1) for x, y in outline])
    faces = [[a, c, b] for a, b, c in caps] + [[a + 6, b + 6, c + 6] for a, b, c in caps]
    for i in range(6):
        j = (i + 1) % 6
        faces += [[i, j, j + 6], [i, j + 6, i + 6]]
    return vertices, np.array(faces)


def test_an_angle_bracket_becomes_little_more_than_its_legs() -> None:
    vertices, faces = angle_bracket()
    shapes = mesh_hulls(vertices, faces)
    exact = (0.3 * 0.05 + 0.25 * 0.05) * 0.1
    assert volume(vertices) > 1.5 * exact  # the hull alone
    assert exact * (1.0 - 1e-9) <= volume_of(shapes) < 1.25 * exact
    assert len(shapes) <= 8


@pytest.mark.parametrize("name", ["mug", "bowl", "screwdriver"])
def test_the_hulls_hold_the_whole_mesh(name: str) -> None:
    body = Body.household(name)
    rng = np.random.default_rng(0)
    T = pose(*rng.normal(size=3), rotation(rng))
    vertices = body.vertices @ T[:3, :3].T + T[:3, 3]
    shapes = mesh_hulls(vertices, body.faces)
    points, _, _ = body.sample_surface(300, rng)
    places = np.tile(np.eye(4), (300, 1, 1))
    places[:, :3, 3] = points @ T[:3, :3].T + T[:3, 3]
    point = Convex.hull(np.zeros((1, 3)))
    nearest = np.min([signed_distance(point, shape, places, np.eye(4)).distance for shape in shapes], axis=0)
    assert nearest.max() < 1e-9
    assert volume_of(shapes) <= volume(vertices) * (1.0 + 1e-9)


def test_convex_meshes_stay_whole_and_flat_ones_are_no_trouble() -> None:
    solid = Body.box([0.1, 0.2, 0.3])
    (shape,) = mesh_hulls(solid.vertices, solid.faces)
    assert volume_of((shape,)) == pytest.approx(0.006)
    sheet = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert len(mesh_hulls(sheet, np.array([[0, 1, 2], [0, 2, 3]]))) == 1


def test_cuts_share_their_rim_and_are_kept(tmp_path, monkeypatch) -> None:
    vertices, faces = angle_bracket()
    below, above = cut(vertices[faces], 0, 0.1)
    assert below[..., 0].max() == pytest.approx(0.1)
    assert above[..., 0].min() == pytest.approx(0.1)
    monkeypatch.setenv("APPREHEND_CACHE", str(tmp_path))
    first = split(vertices, faces)
    (kept,) = (tmp_path / "parts").iterdir()
    second = split(vertices, faces)
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)
    kept.write_bytes(b"spoiled")
    assert len(split(vertices, faces)) == len(first)


@pytest.mark.parametrize("seed", [2, 3, 5, 7])
def test_the_hulls_hold_the_surface_of_coarse_meshes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocks = []
    for _ in range(4):
        vertices, faces = box(rng.uniform(0.02, 0.3, 3))
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        blocks.append((vertices @ (turn * np.linalg.det(turn)).T + rng.uniform(-0.1, 0.1, 3), faces))
    whole = union(blocks)
    assert whole is not None
    triangles = whole[0][whole[1]]
    areas = 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    points = sample(triangles, areas, unit_normals(triangles), 5000, rng)[0]
    parts = split(*whole)
    assert len(parts) > 2
    planes = [ConvexHull(part).equations for part in parts]
    outside = np.min([(points @ p[:, :3].T + p[:, 3]).max(axis=1) for p in planes], axis=0)
    assert outside.max() < 1e-9
