"""Convex pieces: convex, covering the body within the stated error, and kept on disk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from apprehend import Body
from apprehend.bodies import convex, shapes
from apprehend.bodies.mass import solid


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("APPREHEND_CACHE", str(tmp_path))
    return tmp_path / "convex"


def outside(points: np.ndarray, pieces: tuple[convex.Piece, ...]) -> np.ndarray:
    """How far points are beyond the nearest piece, measured on its planes (a lower bound of the distance)."""
    best = np.full(len(points), np.inf)
    for vertices, faces in pieces:
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        size = np.linalg.norm(normals, axis=1)
        keep = size > 1e-14
        normals = normals[keep] / size[keep, None]
        best = np.minimum(best, (points @ normals.T - np.einsum("ij,ij->i", normals, a[keep])).max(axis=1))
    return best


@pytest.mark.parametrize("name", ["banana", "hammer", "screwdriver"])
def test_pieces_are_convex_and_cover_the_body(name: str) -> None:
    body = Body.household(name)
    points, _, _ = body.sample_surface(3000, np.random.default_rng(0))
    assert 1 <= len(body.convex_pieces) <= 32
    assert 0.0 < body.convex_error < 0.006
    assert outside(points, body.convex_pieces).max() <= body.convex_error
    for piece in body.convex_pieces:
        assert outside(piece[0], (piece,)).max() < 1e-9
        assert solid(*piece).volume > 0.0
    total = sum(solid(*piece).volume for piece in body.convex_pieces)
    assert body.volume * 0.95 < total < body.volume * 1.4


def test_a_mug_keeps_its_hollow() -> None:
    """A point inside the mug, above its floor, is outside every piece."""
    mug = Body.household("mug")
    assert outside(np.array([[0.0, 0.0, 0.05], [0.054, 0.0, 0.05]]), mug.convex_pieces).min() > 0.0


def test_a_convex_body_is_its_own_piece(cache: Path) -> None:
    body = Body.box([0.1, 0.05, 0.02])
    assert len(body.convex_pieces) == 1
    assert body.convex_error == pytest.approx(0.0, abs=1e-12)
    assert solid(*body.convex_pieces[0]).volume == pytest.approx(body.volume)


def test_the_second_time_it_is_read_from_disk(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = Body.box([0.1, 0.05, 0.02])
    pieces = first.convex_pieces
    (kept,) = cache.iterdir()
    monkeypatch.setattr(convex, "_decompose", lambda *_: pytest.fail("was computed again"))
    again = Body.box([0.1, 0.05, 0.02])
    assert np.array_equal(again.convex_pieces[0][0], pieces[0][0])
    assert again.convex_error == first.convex_error
    monkeypatch.undo()
    monkeypatch.setenv("APPREHEND_CACHE", str(cache.parent))
    kept.write_bytes(kept.read_bytes()[:100])  # damaged: computed again and replaced
    assert len(Body.box([0.1, 0.05, 0.02]).convex_pieces) == 1
    assert kept.stat().st_size > 100


def test_another_mesh_has_another_key(cache: Path) -> None:
    for x in (0.1, 0.11):
        assert len(Body.box([x, 0.05, 0.02]).convex_pieces) == 1
    assert len(list(cache.iterdir())) == 2


def test_a_cache_that_cannot_be_written_only_costs_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("APPREHEND_CACHE", str(tmp_path / "file" / "below"))
    assert len(Body.box([0.1, 0.05, 0.02]).convex_pieces) == 1


def test_error_of_a_hull_around_a_notch_is_the_depth_of_the_notch() -> None:
    vertices, faces = shapes.revolve([(0, 0), (0.04, 0), (0.04, 0.1), (0.02, 0.1), (0.02, 0.05), (0, 0.05)])
    error = convex.distance_between([convex.hull(vertices)], vertices, faces)
    assert error == pytest.approx(0.02, rel=0.15)  # the middle of the mouth is 20 mm from the rim; a sample comes near


def test_error_of_a_piece_that_is_too_small() -> None:
    body = Body.box([0.1, 0.1, 0.1])
    small = convex.hull(body.vertices * 0.9)
    error = convex.distance_between([small], body.vertices, body.faces)
    assert error == pytest.approx(0.005 * np.sqrt(3), rel=1e-6)


@given(st.integers(0, 10_000))
def test_point_triangle_distance_against_trimesh(seed: int) -> None:
    rng = np.random.default_rng(seed)
    triangles, points = rng.normal(size=(20, 3, 3)), rng.normal(size=(20, 3)) * 2
    closest = trimesh.triangles.closest_point(triangles, points)
    expected = ((closest - points) ** 2).sum(axis=1)
    assert np.allclose(convex.point_triangle_squared(points, triangles), expected, atol=1e-12)
