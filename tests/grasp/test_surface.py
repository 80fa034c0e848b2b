"""Rays and nearest points against an independent library, closed forms and the reference crossings."""

import numpy as np
import pytest
import trimesh

from apprehend.errors import InputError, MeshError
from apprehend.grasp import Surface
from tests.support import reference, shared


def test_crossings_of_real_objects_match_the_reference():
    surfaces = {}
    for case in reference("objects_antipodal_grasps.json")["cases"]:
        given, want = case["inputs"], case["expected"]
        name = given["object"]
        if name not in surfaces:
            mesh = trimesh.load(shared(f"objects/{name}"), process=False, force="mesh")
            surfaces[name] = Surface(mesh.vertices, mesh.faces)
        surface = surfaces[name]
        origin, direction = np.array(given["axis_origin"]), np.array(given["axis_direction"])
        found = surface.crossings([origin], [direction])
        assert found.counts[0] == want["n_surface_crossings"]
        ends = found.times[0, [0, found.counts[0] - 1]]
        np.testing.assert_allclose(origin + ends[0] * direction, want["p1"], atol=1e-9)
        np.testing.assert_allclose(origin + ends[1] * direction, want["p2"], atol=1e-9)
        np.testing.assert_allclose(-surface.normals[found.faces[0, 0]], want["n1_inward"], atol=1e-9)
        assert found.entering[0, 0]
        assert not found.entering[0, found.counts[0] - 1]


def test_rays_through_vertices_and_edges_never_slip_through():
    mesh = trimesh.creation.icosphere(subdivisions=3)
    surface = Surface(mesh.vertices, mesh.faces)
    targets = np.concatenate([mesh.vertices, mesh.vertices[mesh.edges_unique].mean(axis=1)])
    origins = np.random.default_rng(3).uniform(-0.4, 0.4, size=targets.shape)
    directions = np.random.default_rng(4).uniform(0.1, 3.0, size=(len(targets), 1)) * (targets - origins)
    np.testing.assert_array_equal(surface.crossings(origins, directions).counts, 1)
    along = surface.crossings(origins - 5.0 * directions / np.linalg.norm(directions, axis=1)[:, None], directions)
    np.testing.assert_array_equal(along.counts, 2)


def test_axis_parallel_rays_on_the_faces_of_a_box():
    box = trimesh.creation.box(extents=(2.0, 2.0, 2.0))
    surface = Surface(box.vertices, box.faces)
    found = surface.crossings([[0.3, 0.2, -5.0], [0.0, 0.0, -5.0], [1.5, 0.0, -5.0]], [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(found.counts, [2, 2, 0])
    np.testing.assert_allclose(found.times[:2, :2], [[4.0, 6.0]] * 2)
    assert np.isinf(found.times[2]).all()


def test_more_crossings_than_the_first_guess_are_all_found():
    lift = trimesh.transformations.translation_matrix
    parts = [trimesh.creation.box(extents=(1, 1, 0.01), transform=lift([0, 0, k])) for k in range(30)]
    mesh = trimesh.util.concatenate(parts)
    found = Surface(mesh.vertices, mesh.faces).crossings([[0.1, 0.2, -1.0]], [[0.0, 0.0, 1.0]], capacity=4)
    assert found.counts[0] == 60
    assert (np.diff(found.times[0, :60]) > 0).all()


def test_nearest_points_match_brute_force():
    mesh = trimesh.creation.torus(1.0, 0.3, major_sections=24, minor_sections=12)
    surface = Surface(mesh.vertices, mesh.faces)
    points = np.random.default_rng(0).normal(size=(200, 3))
    near, distance, faces = surface.nearest(points)
    triangles = mesh.triangles
    for p, q, d, f in zip(points, near, distance, faces, strict=True):
        every = trimesh.triangles.closest_point(triangles, np.repeat(p[None], len(triangles), axis=0))
        best = np.linalg.norm(every - p, axis=1)
        assert d == pytest.approx(best.min(), abs=1e-12)
        assert best[f] == pytest.approx(d, abs=1e-12)
        assert np.linalg.norm(q - p) == pytest.approx(d, abs=1e-12)


def test_inside_agrees_with_the_radius():
    mesh = trimesh.creation.icosphere(subdivisions=4)
    points = np.random.default_rng(1).normal(size=(500, 3))
    radius = np.linalg.norm(points, axis=1)
    clear = np.abs(radius - 1.0) > 0.01
    assert (Surface(mesh.vertices, mesh.faces).contains(points) == (radius < 1.0))[clear].all()


def test_bad_meshes_and_rays_are_named():
    with pytest.raises(MeshError, match="no faces"):
        Surface(np.zeros((3, 3)), np.empty((0, 3)))
    with pytest.raises(MeshError, match="vertex 7, but there are 3"):
        Surface(np.eye(3), [[0, 1, 7]])
    with pytest.raises(InputError, match="direction is zero"):
        Surface(np.eye(3), [[0, 1, 2]]).crossings([[0, 0, 0]], [[0, 0, 0]])
