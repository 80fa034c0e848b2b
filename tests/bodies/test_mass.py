"""Mass properties: closed forms, references, and the laws of rigid motion."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from apprehend import Body
from apprehend.bodies import shapes
from apprehend.bodies.mass import check_inertia, solid
from apprehend.errors import InputError
from tests.support import reference, shared


def test_box_has_the_textbook_inertia() -> None:
    a, b, c, m = 0.1, 0.2, 0.3, 1.7
    body = Body.box([a, b, c], mass=m)
    expected = m / 12.0 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    assert np.allclose(body.inertia, expected, rtol=0, atol=1e-15)
    assert np.allclose(body.com, 0.0, atol=1e-16)
    assert body.volume == pytest.approx(a * b * c, rel=1e-14)


def test_tetrahedron_in_closed_form() -> None:
    """∫x² over the unit simplex is 1/60, ∫xy is 1/120, the volume 1/6, the centroid 1/4."""
    vertices = np.vstack([np.zeros(3), np.eye(3)])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    region = solid(vertices, faces)
    assert region.volume == pytest.approx(1 / 6, rel=1e-14)
    assert np.allclose(region.centroid, 0.25)
    raw = region.moments + region.volume * np.outer(region.centroid, region.centroid)
    assert np.allclose(raw, np.full((3, 3), 1 / 120) + np.eye(3) / 120, atol=1e-16)


@given(seed=st.integers(0, 10_000))
def test_moments_follow_a_rigid_motion(seed: int) -> None:
    """volume' = volume, c' = R c + p, I' = R I Rᵀ; also far from the origin, where cancellation would show."""
    rng = np.random.default_rng(seed)
    vertices, faces = shapes.revolve([(0, 0), (0.05, 0.01), (0.02, 0.05), (0.04, 0.09), (0, 0.1)], 7)
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    R *= np.linalg.det(R)
    p = rng.normal(size=3) * 10.0
    one, two = solid(vertices, faces), solid(vertices @ R.T + p, faces)
    assert two.volume == pytest.approx(one.volume, rel=1e-9)
    assert np.allclose(two.centroid, R @ one.centroid + p, atol=1e-10)
    assert np.allclose(two.inertia, R @ one.inertia @ R.T, rtol=0, atol=1e-8 * np.abs(one.inertia).max())


def test_reference_meshes() -> None:
    data = reference("mesh_queries.json")
    cases = [c for c in data["cases"] if "volume" in c["expected"]]
    assert cases
    for case in cases:
        mesh = data["conventions"]["meshes"][case["inputs"]["mesh"]]
        body = Body.from_mesh(mesh["vertices"], mesh["faces"], density=case["inputs"]["density"])
        expected = case["expected"]
        assert body.repairs == ()
        assert body.volume == pytest.approx(expected["volume"], rel=1e-9)
        assert body.mass == pytest.approx(expected["mass"], rel=1e-9)
        assert body.area == pytest.approx(expected["area"], rel=1e-9)
        assert np.allclose(body.com, expected["com"], atol=1e-12)
        scale = np.abs(expected["inertia_about_com"]).max()
        assert np.allclose(body.inertia, expected["inertia_about_com"], rtol=0, atol=1e-9 * scale)


def test_scanned_objects() -> None:
    """The manifest was computed before the coordinates were rounded to a file, hence 1e-6."""
    manifest = json.loads(shared("objects/MANIFEST.json").read_text())
    for entry in manifest:
        body = Body.load(shared(f"objects/{entry['file']}"), density=1.0)
        assert body.watertight, entry["file"]
        assert np.allclose(body.extents, entry["extents_m"], rtol=1e-5)
        if entry["volume_m3"] is not None:
            assert body.volume == pytest.approx(entry["volume_m3"], rel=1e-6)
            assert np.allclose(body.com, entry["com_m"], atol=1e-7)
            scale = np.abs(entry["inertia_unit_density"]).max()
            assert np.allclose(body.inertia, entry["inertia_unit_density"], rtol=0, atol=1e-6 * scale)


def test_mass_scales_the_inertia() -> None:
    body = Body.box([0.1, 0.1, 0.1], density=800.0)
    heavy = body.with_(mass=2 * body.mass)
    assert body.mass == pytest.approx(0.8)
    assert body.mass_source == "density"
    assert np.allclose(heavy.inertia, 2 * body.inertia)
    assert heavy.mass_source == "given"


def test_without_mass_or_density_it_says_assumed() -> None:
    body = Body.box([0.1, 0.1, 0.1])
    assert body.mass_source == "assumed"
    assert body.mass == pytest.approx(0.5)


@pytest.mark.parametrize("mass", [0.0, -1.0, float("nan"), float("inf")])
def test_masses_that_no_body_has(mass: float) -> None:
    with pytest.raises(InputError, match=r"mass is .* kg; expected a positive, finite number"):
        Body.box([0.1, 0.1, 0.1], mass=mass)
    with pytest.raises(InputError, match=r"density is .* kg/m³; expected a positive"):
        Body.box([0.1, 0.1, 0.1], density=mass)


def test_words_are_no_numbers() -> None:
    with pytest.raises(InputError, match="mass is 'heavy' kg"):
        Body.box([0.1, 0.1, 0.1], mass="heavy")
    with pytest.raises(InputError, match="friction is 'rough'"):
        Body.box([0.1, 0.1, 0.1], friction="rough")
    with pytest.raises(InputError, match="friction is -1"):
        Body.box([0.1, 0.1, 0.1]).with_(friction=-1)


def test_mass_and_density_together() -> None:
    with pytest.raises(InputError, match=r"mass 1\.0 and density 2\.0 are both given"):
        Body.box([0.1, 0.1, 0.1], mass=1.0, density=2.0)


@pytest.mark.parametrize("value", [-0.1, float("nan")])
def test_frictions_that_no_body_has(value: float) -> None:
    with pytest.raises(InputError, match=r"friction is .* zero or more"):
        Body.box([0.1, 0.1, 0.1], friction=value)
    with pytest.raises(InputError, match="torsional_friction is"):
        Body.box([0.1, 0.1, 0.1], torsional_friction=value)


def test_a_measured_inertia_is_checked() -> None:
    with pytest.raises(InputError, match="two smaller ones must add up"):
        Body.box([0.1, 0.1, 0.1], mass=1.0, inertia=np.diag([1.0, 1.0, 3.0]))
    with pytest.raises(InputError, match="all must be positive"):
        check_inertia(np.diag([-1.0, 1.0, 1.0]), "inertia")
    with pytest.raises(InputError, match="not symmetric"):
        check_inertia(np.array([[1.0, 0.5, 0], [0, 1.0, 0], [0, 0, 1.0]]), "inertia")
    with pytest.raises(InputError, match="outside the convex hull"):
        Body.box([0.1, 0.1, 0.1], mass=1.0, com=[0.2, 0.0, 0.0])


def test_a_measured_centre_of_mass_is_kept() -> None:
    body = Body.box([0.1, 0.1, 0.1], mass=1.0, com=[0.0, 0.0, -0.03])
    assert np.array_equal(body.com, [0.0, 0.0, -0.03])


def test_only_surface_and_mass_may_change() -> None:
    with pytest.raises(InputError, match="no changeable 'vertices'"):
        Body.box([0.1, 0.1, 0.1]).with_(vertices=None)
    with pytest.raises(InputError, match="mass is 0"):
        Body.box([0.1, 0.1, 0.1]).with_(mass=0.0)
