"""Signed distance fields: exact on the grid, within the stated bounds between and beyond its points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apprehend import Body
from apprehend.bodies import DistanceField, MeshIndex, shapes
from apprehend.errors import InputError
from apprehend.parallel import set_threads, threads


def grid_points(field: DistanceField) -> np.ndarray:
    index = np.stack(np.meshgrid(*(np.arange(n) for n in field.values.shape), indexing="ij"), axis=-1)
    return np.asarray(field.origin + field.spacing * index)


@pytest.mark.parametrize("name", ["mug", "banana", "screwdriver"])
def test_grid_points_have_the_exact_distance(name: str) -> None:
    body = Body.household(name)
    field = body.distance_field(0.006)
    exact = body.signed_distance(grid_points(field))
    assert field.closed
    assert np.abs(field.values - exact).max() < 1e-7
    assert np.array_equal(field.values < 0.0, exact < 0.0)


@pytest.mark.parametrize("name", ["mug", "bottle"])
def test_answers_within_the_grid_keep_the_stated_bounds(name: str) -> None:
    body = Body.household(name)
    field = body.distance_field(0.005)
    points = np.random.default_rng(1).uniform(field.origin, field.upper, (20_000, 3))
    exact = body.signed_distance(points)
    found = field.distance(points)
    assert np.abs(found - exact).max() <= field.error
    assert np.abs(found - exact).max() > 0.1 * field.error  # the bound is no dream number
    low, high = field.bounds(points)
    assert (low <= exact + 1e-12).all()
    assert (exact <= high + 1e-12).all()
    assert (high - low).max() <= 2.0 * field.error
    clear = exact > 2.0 * field.spacing
    excess = found[clear] - exact[clear]
    assert (excess <= 3.0 * field.spacing**2 / (8.0 * (exact[clear] - np.sqrt(3.0) * field.spacing)) + 1e-7).all()


def test_beyond_the_grid_the_answer_is_never_too_large() -> None:
    body = Body.household("mug")
    field = body.distance_field(0.004, margin=0.01)
    points = np.random.default_rng(2).uniform(field.origin - 0.5, field.upper + 0.5, (5000, 3))
    clamped = np.clip(points, field.origin, field.upper)
    outside = (clamped != points).any(axis=1)
    exact, found = body.signed_distance(points)[outside], field.distance(points)[outside]
    assert (found <= exact + field.error).all()
    assert (found >= exact - field.distance(clamped[outside]) - field.error).all()


def test_gradients_are_the_derivatives_of_the_answers() -> None:
    body = Body.household("can")
    field = body.distance_field(0.005)
    points = np.random.default_rng(3).uniform(field.origin - 0.05, field.upper + 0.05, (4000, 3))
    step = 1e-6
    u = (points - field.origin) / field.spacing
    smooth = (np.abs(u - np.round(u)) > 1e-3).all(axis=1)  # away from the faces of the cells
    slope = field.gradient(points)
    for k in range(3):
        shift = step * np.eye(3)[k]
        numeric = (field.distance(points + shift) - field.distance(points - shift)) / (2.0 * step)
        assert np.abs(numeric - slope[:, k])[smooth].max() < 1e-4
    near = np.abs(body.signed_distance(points)) < 0.003
    normals = body.face_normals[body.closest_point(points[near]).faces]
    assert np.median(np.einsum("ij,ij->i", slope[near], normals)) > 0.999


def test_a_plane_is_reproduced_exactly() -> None:
    field = Body.box([0.3, 0.3, 0.02]).distance_field(0.004)
    points = np.random.default_rng(4).uniform([-0.1, -0.1, -0.022], [0.1, 0.1, -0.005], (1000, 3))
    assert np.abs(field.distance(points) - (np.abs(points[:, 2]) - 0.01)).max() < 1e-7


def test_a_mesh_with_a_hole_has_an_inside() -> None:
    vertices, faces = shapes.sphere(0.05)
    lid = vertices[faces].mean(axis=1)[:, 2] > 0.045
    index = MeshIndex(vertices, faces[~lid])
    field = DistanceField.of(index, 0.004)
    assert not field.closed
    assert field.distance([0.0, 0.0, 0.0]) == pytest.approx(-0.05, abs=field.error)
    assert field.distance([0.0, 0.0, 0.07]) > 0.015
    points = grid_points(field)
    winding = index.winding_number(points)
    clear = np.abs(winding - 0.5) > 0.02
    assert np.array_equal((field.values < 0.0)[clear], (winding > 0.5)[clear])
    assert np.abs(np.abs(field.values) - index.nearest(points).distance).max() < 1e-7


def test_degenerate_faces_do_no_harm() -> None:
    vertices, faces = shapes.box([0.1, 0.1, 0.1])
    extra = np.array([[0, 0, 0], [0, 1, 1], [0, 1, 0]])
    plain = DistanceField.of(MeshIndex(vertices, faces), 0.01)
    spoilt = DistanceField.of(MeshIndex(vertices, np.vstack([faces, extra])), 0.01)
    assert np.array_equal(plain.values, spoilt.values)


def test_the_same_answers_on_one_and_two_threads() -> None:
    before = threads()
    try:
        set_threads(1)
        points = np.random.default_rng(6).uniform(-0.1, 0.1, (9001, 3))
        one = Body.household("bowl").distance_field(0.005)
        first = Body.household("bowl").closest_point(points)
        set_threads(2)
        two = Body.household("bowl").distance_field(0.005)
        second = Body.household("bowl").closest_point(points)
    finally:
        set_threads(before)
    assert np.array_equal(one.values, two.values)
    assert all(np.array_equal(a, b) for a, b in zip(first, second))


def test_saved_fields_come_back(tmp_path: Path) -> None:
    field = Body.household("can").distance_field(0.008)
    back = DistanceField.load(field.save(tmp_path / "can.npz"))
    assert np.array_equal(back.values, field.values)
    assert (back.name, back.closed, back.spacing) == ("can", True, 0.008)
    assert np.array_equal(back.origin, field.origin)
    (tmp_path / "broken.npz").write_bytes(b"PK but no archive")
    with pytest.raises(InputError, match=r"broken\.npz cannot be read"):
        DistanceField.load(tmp_path / "broken.npz")
    with pytest.raises(InputError, match=r"gone\.npz does not exist"):
        DistanceField.load(tmp_path / "gone.npz")
    np.savez(tmp_path / "other.npz", kind="voxels")
    with pytest.raises(InputError, match="holds 'voxels'; expected a 'distance field'"):
        DistanceField.load(tmp_path / "other.npz")
    with pytest.raises(InputError, match=r"expected \.npz"):
        field.save(tmp_path / "can.txt")


def test_too_fine_a_grid_says_how_many_points_and_what_fits() -> None:
    body = Body.household("mug")
    with pytest.raises(
        InputError, match=r"mug at 1e-05 m has .* grid points \(.* GB\).*resolution of (\S+) m"
    ) as caught:
        body.distance_field(1e-5)
    fits = float(str(caught.value).split("resolution of ")[1].split()[0])
    assert 1e-4 < fits < 1e-3
    for bad in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="resolution is"):
            body.distance_field(bad)
        if bad:
            with pytest.raises(InputError, match="margin is"):
                body.distance_field(0.01, margin=bad)
    with pytest.raises(InputError, match="outside the grid"):
        body.distance_field(0.01).bounds([1.0, 0.0, 0.0])
