"""Wireframes, sections and silhouettes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apprehend import Body
from apprehend.bodies import MeshIndex, Outline, Wireframe, shapes
from apprehend.bodies.section import section, silhouette
from apprehend.errors import InputError, MeshError


def test_the_edges_of_a_box_are_twelve() -> None:
    body = Body.box([0.1, 0.2, 0.3])
    frame = body.wireframe()
    assert len(frame) == len(frame.polylines) == 12
    assert frame.length == pytest.approx(4 * 0.6)
    assert frame.distance([0.05, 0.1, 0.0]) == pytest.approx(0.0, abs=1e-12)
    assert frame.distance([0.05, 0.0, 0.0]) == pytest.approx(0.1)
    deviation = body.deviation(frame)
    assert deviation.outward < 1e-9
    assert 0.1 <= deviation.inward < 0.102  # the middle of the 0.2 × 0.3 face


def test_the_edges_of_a_cylinder_are_two_circles() -> None:
    frame = Body.cylinder(0.05, 0.2).wireframe()
    assert len(frame) == 2 * shapes.SIDES
    assert len(frame.polylines) == 2
    assert all(np.array_equal(line[0], line[-1]) for line in frame.polylines)


def test_a_ball_is_shown_by_rings_and_rims_are_edges() -> None:
    body = Body.sphere(0.05)
    frame = body.wireframe()
    assert len(body.wireframe(rings=0)) == 0
    assert np.ptp(frame.points, axis=0).max() > 0.09
    assert body.closest_point(frame.points).distance.max() < 1e-9
    index = MeshIndex(body.vertices, body.faces[body.vertices[body.faces].mean(axis=1)[:, 2] < 0.0])
    rim = Wireframe.of(index, rings=0)
    assert len(rim.polylines) >= 1
    assert rim.points[:, 2].min() > -0.01
    with pytest.raises(InputError, match="has no edges"):
        body.wireframe(rings=0).distance([0.0, 0.0, 0.0])
    with pytest.raises(InputError, match="angle is 7"):
        body.wireframe(7.0)


def test_wireframes_come_back_from_both_formats(tmp_path: Path) -> None:
    frame = Body.household("mug").wireframe()
    for name in ("frame.npz", "frame.obj"):
        back = Wireframe.load(frame.save(tmp_path / name))
        assert np.array_equal(back.edges, frame.edges)
        assert np.allclose(back.points, frame.points, atol=1e-9)
    (tmp_path / "bad.obj").write_text("v 0 0 0\nl 1 2\n")
    with pytest.raises(MeshError, match="refers to vertex 2, but there are 1"):
        Wireframe.load(tmp_path / "bad.obj")
    (tmp_path / "bad.obj").write_text("v 0 0 zero\n")
    with pytest.raises(MeshError, match=r"bad\.obj:1: 'v 0 0 zero'"):
        Wireframe.load(tmp_path / "bad.obj")
    with pytest.raises(MeshError, match="does not exist"):
        Wireframe.load(tmp_path / "none.obj")


def test_sections_of_a_box() -> None:
    body = Body.box([0.1, 0.2, 0.3])
    for axis, area in enumerate((0.06, 0.03, 0.02)):
        for sign in (1.0, -1.0):
            cut = body.section(normal=sign * np.eye(3)[axis])
            assert len(cut) == 1
            assert cut.area == pytest.approx(area)
            assert np.abs(np.concatenate(cut.polylines) @ np.eye(3)[axis]).max() < 1e-12
    diagonal = body.section(normal=[1.0, 1.0, 1.0])
    assert np.abs(np.concatenate(diagonal.polylines).sum(axis=1)).max() < 1e-12
    assert len(body.section([0.0, 0.0, 1.0])) == 0
    pose, size = diagonal.rectangle()
    local = (np.concatenate(diagonal.polylines) - pose[:3, 3]) @ pose[:3, :3]
    assert np.allclose(np.abs(local).max(axis=0), [*(0.5 * size), 0.0], atol=1e-9)


def test_the_area_of_sections_adds_up_to_the_volume() -> None:
    body = Body.household("mug")
    low, high = body.bounds[:, 2]
    heights = np.linspace(low, high, 400, endpoint=False) + 0.5 * (high - low) / 400
    areas = [body.section([0.0, 0.0, z]).area for z in heights]
    assert np.mean(areas) * (high - low) == pytest.approx(body.volume, rel=1e-3)


def test_inside_of_a_section_is_inside_the_body() -> None:
    body = Body.household("mug")
    cut = body.section(normal=[0.2, 1.0, 0.3])
    assert len(cut) >= 1
    flat = np.random.default_rng(0).uniform(cut.points.min(axis=0), cut.points.max(axis=0), (4000, 2))
    points = flat @ cut.pose[:3, :2].T + cut.pose[:3, 3]
    clear = body.closest_point(points).distance > 1e-9
    assert np.array_equal(cut.inside(flat)[clear], body.inside(points)[clear])


def test_an_open_surface_has_open_lines() -> None:
    vertices, faces = shapes.sphere(0.05)
    index = MeshIndex(vertices, faces[vertices[faces].mean(axis=1)[:, 2] < 0.0])
    cut = section(index, np.zeros(3), [0.0, 1.0, 0.0])
    assert len(cut.lines) == 1
    assert cut.length == pytest.approx(np.pi * 0.05, rel=0.1)
    shadow = silhouette(index, [0.0, 0.0, 1.0])
    assert shadow.area == pytest.approx(np.pi * 0.05**2, rel=0.02)


def test_silhouettes_of_known_solids() -> None:
    box = Body.box([0.1, 0.2, 0.3])
    assert box.silhouette([0.0, 0.0, 1.0]).area == pytest.approx(0.02, rel=1e-6)
    assert box.silhouette([1.0, 1.0, 0.0]).area == pytest.approx(0.3 * 0.3 / np.sqrt(2.0), rel=1e-6)
    assert Body.sphere(0.05).silhouette([0.3, -0.4, 0.5]).area == pytest.approx(np.pi * 0.05**2, rel=0.01)
    mug = Body.household("mug").silhouette([0.0, 1.0, 0.0])
    assert sum(1 for loop in mug.loops if Outline((loop,)).area < 0.0) == 1  # one looks through the handle


def test_the_shadow_of_every_point_lies_in_the_silhouette() -> None:
    body = Body.household("screwdriver")
    direction = np.array([0.3, 0.5, 0.8])
    shadow = body.silhouette(direction)
    points = body.sample_surface(3000, np.random.default_rng(1))[0] @ shadow.pose[:3, :2]
    centre = points.mean(axis=0)
    assert shadow.inside(centre + (points - centre) * (1 - 1e-6)).mean() > 0.98
    missed = points[~shadow.inside(points)]
    if len(missed):
        lines = np.vstack([np.vstack([p, p[:1]]) for p in shadow.loops])
        assert min(np.linalg.norm(lines[:, None] - missed, axis=2).min(axis=0)) < 0.02


def test_simplified_outlines_stay_within_the_tolerance() -> None:
    outline = Body.household("banana").silhouette([0.0, 0.0, 1.0])
    for tolerance in (1e-4, 1e-3, 5e-3):
        thin = outline.simplified(tolerance)
        assert len(thin.points) < len(outline.points)
        frame = Wireframe(
            np.column_stack([thin.points, np.zeros(len(thin.points))]),
            np.column_stack([i := np.arange(len(thin.points)), np.roll(i, -1)]),
        )
        assert frame.distance(np.column_stack([outline.points, np.zeros(len(outline.points))])).max() <= tolerance
    with pytest.raises(InputError, match="tolerance is -1"):
        outline.simplified(-1.0)


def test_prisms_over_outlines() -> None:
    body = Body.household("mug")
    outline = body.section()
    prism = outline.extruded(-0.01, 0.02)
    assert prism.closed
    assert prism.volume == pytest.approx(0.03 * outline.area, rel=1e-6)
    assert body.bounds[0, 0] - 1e-9 <= prism.vertices[:, 0].min()
    circle = outline.circle()
    assert (np.linalg.norm(outline.points - circle.centre, axis=1) <= circle.radius).all()
    with pytest.raises(InputError, match="high above low"):
        outline.extruded(0.1, 0.1)
    empty = body.section([0.0, 0.0, 9.0])
    with pytest.raises(InputError, match="the plane misses the body"):
        empty.rectangle()


def test_outlines_are_saved_as_numbers_and_as_pictures(tmp_path: Path) -> None:
    outline = Body.household("mug").section(normal=[0.0, 1.0, 0.0])
    back = Outline.load(outline.save(tmp_path / "mug.npz"))
    assert back.area == outline.area
    assert np.array_equal(back.pose, outline.pose)
    text = outline.save(tmp_path / "mug.svg").read_text()
    assert text.startswith("<svg")
    assert text.count("M") == len(outline)
    with pytest.raises(InputError, match="normal is zero"):
        Body.household("mug").section(normal=[0, 0, 0])
    with pytest.raises(InputError, match="direction is zero"):
        Body.household("mug").silhouette([0, 0, 0])
