"""Each defect is repaired, named, and the body that comes out is the sound one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from apprehend import Body
from apprehend.bodies import shapes, topology
from apprehend.bodies.body import _enclosed
from apprehend.bodies.convex import ConvexParts
from apprehend.bodies.mass import solid
from apprehend.bodies.repair import Mended, mend
from apprehend.errors import MeshError

BOX = shapes.box([0.1, 0.06, 0.04])
VOLUME = 0.1 * 0.06 * 0.04


def moebius_band() -> tuple[np.ndarray, list[list[int]]]:
    n = 24
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    sides = []
    for s in (-0.015, 0.015):
        r = 0.05 + s * np.cos(angle / 2)
        sides.append(np.stack([r * np.cos(angle), r * np.sin(angle), s * np.sin(angle / 2)], axis=1))
    faces = []
    for i in range(n):
        a, b = i, n + i
        c, d = (i + 1, n + i + 1) if i + 1 < n else (n, 0)
        faces += [[a, c, b], [b, c, d]]
    return np.vstack(sides), faces


def two(one: shapes.Mesh, other: shapes.Mesh, shift: tuple[float, float, float]) -> shapes.Mesh:
    return np.vstack([one[0], other[0] + shift]), np.vstack([one[1], other[1] + len(one[0])])


def test_a_sound_mesh_is_left_alone() -> None:
    mesh = mend(*BOX)
    assert mesh.repairs == ()
    assert np.array_equal(mesh.vertices, BOX[0])
    assert np.array_equal(mesh.faces, BOX[1])


def test_triangle_soup_is_one_surface() -> None:
    """STL repeats every vertex: that is no defect, and no repair is reported."""
    mesh = mend(BOX[0][BOX[1]].reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert mesh.closed
    assert mesh.repairs == ()
    assert len(mesh.vertices) == 8


def test_cracks_are_welded() -> None:
    rng = np.random.default_rng(0)
    soup = BOX[0][BOX[1]].reshape(-1, 3)
    body = Body.from_mesh(soup + rng.uniform(-1e-7, 1e-7, soup.shape), np.arange(36).reshape(-1, 3))
    assert body.watertight
    assert body.repairs[0].startswith("welded 28 vertices closer than")
    assert body.volume == pytest.approx(VOLUME, rel=1e-4)


@given(st.sets(st.integers(0, 11), min_size=1, max_size=11))
def test_turned_faces_are_turned_back(turned: set[int]) -> None:
    faces = BOX[1].copy()
    faces[sorted(turned)] = faces[sorted(turned)][:, ::-1]
    body = Body.from_mesh(BOX[0], faces)
    assert body.watertight
    assert body.volume == pytest.approx(VOLUME)
    assert any("turned" in note for note in body.repairs)


def test_inside_out() -> None:
    body = Body.from_mesh(BOX[0], BOX[1][:, ::-1])
    assert body.volume == pytest.approx(VOLUME)
    assert body.repairs == ("turned 1 part that faced inwards",)


@pytest.mark.parametrize("missing", [[0], [0, 1], [4, 5], [0, 7]])
def test_holes_in_a_box_are_capped(missing: list[int]) -> None:
    body = Body.from_mesh(BOX[0], np.delete(BOX[1], missing, axis=0))
    assert body.watertight
    assert body.volume == pytest.approx(VOLUME)
    assert "capped" in body.repairs[0]
    assert "hole" in body.repairs[0]


def test_the_open_underside_of_a_scan_is_capped() -> None:
    vertices, faces = shapes.cylinder(0.03, 0.1)
    bottom = (faces == len(vertices) - 2).any(axis=1)
    body = Body.from_mesh(vertices, faces[~bottom])
    assert body.watertight
    assert body.volume == pytest.approx(solid(vertices, faces).volume)
    assert "longest rim 188 mm" in body.repairs[0]


def test_a_rim_that_is_not_plane_is_capped_too() -> None:
    vertices, faces = shapes.sphere(0.04)
    rng = np.random.default_rng(3)
    seed = vertices[rng.integers(len(vertices))]
    near = np.linalg.norm(vertices[faces].mean(axis=1) - seed, axis=1) < 0.012
    body = Body.from_mesh(vertices, faces[~near])
    assert body.watertight
    assert body.volume == pytest.approx(solid(vertices, faces).volume, rel=0.05)


@given(seed=st.integers(0, 1000))
def test_scattered_holes(seed: int) -> None:
    vertices, faces = shapes.sphere(0.04)
    rng = np.random.default_rng(seed)
    keep = np.ones(len(faces), dtype=bool)
    keep[rng.choice(len(faces), 12, replace=False)] = False
    body = Body.from_mesh(vertices, faces[keep])
    assert body.watertight
    assert body.volume == pytest.approx(solid(vertices, faces).volume, rel=1e-2)


def test_doubled_and_collapsed_faces_go() -> None:
    faces = np.vstack([BOX[1][:-1], BOX[1][:2], [[3, 3, 5]]])
    body = Body.from_mesh(BOX[0], faces)
    assert body.volume == pytest.approx(VOLUME)
    text = "; ".join(body.repairs)
    assert "dropped 1 face with repeated corners" in text
    assert "dropped 2 doubled faces" in text
    assert "capped 1 hole" in text


def test_flaps_and_crumbs_go() -> None:
    vertices = np.vstack([BOX[0], [[0.2, 0, 0], [0.2, 0.01, 0], [0.21, 0, 0]]])
    faces = np.vstack([BOX[1], [[8, 9, 10], [8, 10, 9]]])
    body = Body.from_mesh(vertices, faces)
    assert body.repairs == ("dropped 1 flap (a face and its reverse)",)
    assert body.extents[0] == pytest.approx(0.1)
    body = Body.from_mesh(*two(BOX, shapes.box([1e-5, 1e-5, 1e-5]), (0.2, 0, 0)))
    assert body.repairs == ("dropped 1 crumb of next to no volume",)


def test_overlapping_parts_are_united() -> None:
    body = Body.from_mesh(*two(BOX, BOX, (0.05, 0.01, 0.01)))
    overlap = 0.05 * 0.05 * 0.03
    assert body.volume == pytest.approx(2 * VOLUME - overlap)
    assert body.watertight
    assert "united 2 parts" in body.repairs[0]


def test_separate_parts_are_kept() -> None:
    body = Body.from_mesh(*two(BOX, BOX, (0.2, 0.0, 0.0)))
    assert body.volume == pytest.approx(2 * VOLUME)
    assert body.repairs == ()


def test_many_parts() -> None:
    """Three hundred dice, some facing inwards, some sharing a place: quick, and each counted once."""
    rng = np.random.default_rng(0)
    places = np.array([[i, j, k] for i in range(10) for j in range(10) for k in range(3)]) * 0.02
    die = shapes.box([0.01, 0.01, 0.01])
    inward = rng.random(300) < 0.2
    vertices = np.vstack([die[0] + p for p in places])
    faces = np.vstack([(die[1][:, ::-1] if flip else die[1]) + 8 * i for i, flip in enumerate(inward)])
    body = Body.from_mesh(vertices, faces)
    assert body.volume == pytest.approx(300e-6)
    assert body.repairs == (f"turned {inward.sum()} parts that faced inwards",)


def test_a_cavity_stays_hollow() -> None:
    inner = shapes.box([0.05, 0.03, 0.02])
    body = Body.from_mesh(*two(BOX, (inner[0], inner[1][:, ::-1]), (0, 0, 0)))
    assert body.volume == pytest.approx(VOLUME - 0.05 * 0.03 * 0.02)
    assert body.repairs == ()


def test_a_part_inside_another_counts_once() -> None:
    body = Body.from_mesh(*two(BOX, shapes.box([0.05, 0.03, 0.02]), (0, 0, 0)))
    assert body.volume == pytest.approx(VOLUME)


def test_two_parts_that_share_an_edge_are_closed() -> None:
    """Four faces at one edge: no 2-manifold, but a surface without boundary and a volume without doubt."""
    vertices, faces = two(BOX, BOX, (0.1, 0.06, 0.0))
    body = Body.from_mesh(vertices, faces)
    assert body.watertight
    assert body.volume == pytest.approx(2 * VOLUME)


def test_what_cannot_be_closed_or_covered_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("apprehend.bodies.body.decompose", lambda *_: ConvexParts((), float("inf")))
    with pytest.raises(MeshError, match=r"does not enclose a volume.*could not be repaired.*thickness"):
        Body.from_mesh(*moebius_band())


def test_a_moebius_band_has_no_inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It cannot be wound or closed; the note says what was weighed instead."""
    monkeypatch.setenv("APPREHEND_CACHE", str(tmp_path))
    body = Body.from_mesh(*moebius_band())
    assert not body.watertight
    assert "convex pieces that cover it" in body.repairs[-1]
    assert 0.0 < body.volume < np.pi * 0.065**2 * 0.03
    assert np.linalg.norm(body.com) < 0.02
    assert body.convex_error < 0.01


def test_a_surface_that_winds_twice_is_weighed_by_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two layers, both facing outwards, are closed, but count their inside twice: more than the hull holds."""
    monkeypatch.setenv("APPREHEND_CACHE", str(tmp_path))
    layers = two(BOX, (BOX[0] * 0.99, BOX[1]), (0, 0, 0))
    region, mesh, sound = _enclosed(Mended(*layers), "box")
    assert not sound
    assert "closed surface encloses 473 cm³ of a hull of 240 cm³" in mesh.repairs[-1]
    assert region.volume == pytest.approx(VOLUME, rel=0.15)  # the pieces cover it, a little generously


def test_winding_and_closure_agree_with_trimesh() -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        vertices, faces = shapes.revolve([(0, 0), (0.05, 0.01), (0.02, 0.05), (0, 0.1)], 9)
        faces = faces.copy()
        flip = rng.random(len(faces)) < 0.4
        faces[flip] = faces[flip][:, ::-1]
        fixed, _ = topology.wind_alike(faces)
        mesh = trimesh.Trimesh(vertices, fixed, process=False)
        assert mesh.is_winding_consistent
        assert topology.is_closed(fixed) == mesh.is_watertight
