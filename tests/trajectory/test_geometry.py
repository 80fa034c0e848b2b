"""Arc length, curvature, torsion and bending energy against circles, helices and lines."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import trajectory as tj
from apprehend.errors import InputError
from tests.support import reference


class Helix:
    """(a cos t, a sin t, b t): curvature a/(a² + b²), torsion b/(a² + b²)."""

    n = 3

    def __init__(self, a: float, b: float, end: float, start: float = 0.0) -> None:
        self.a, self.b, self.interval = a, b, (start, end)

    def __call__(self, s, order=0, /):
        s = np.asarray(s, dtype=float)
        shift = order * np.pi / 2
        z = self.b * (s if order == 0 else np.full_like(s, float(order == 1)))
        return np.stack([self.a * np.cos(s + shift), self.a * np.sin(s + shift), z], axis=-1)


@pytest.mark.parametrize("a, b", [(1.0, 0.5), (2.0, -0.3), (0.1, 0.0)])
def test_helices_and_circles(a: float, b: float) -> None:
    curve = Helix(a, b, 7.0)
    s = np.linspace(0.1, 6.9, 11)
    total = a**2 + b**2
    np.testing.assert_allclose(tj.curvature(curve, s), a / total, rtol=1e-12)
    np.testing.assert_allclose(tj.torsion(curve, s), b / total, rtol=1e-12, atol=1e-12)
    assert tj.arc_length(curve) == pytest.approx(7.0 * np.sqrt(total), rel=1e-12)
    assert tj.bending_energy(curve) == pytest.approx((a / total) ** 2 * 7.0 * np.sqrt(total), rel=1e-11)
    np.testing.assert_allclose(np.linalg.norm(tj.tangent(curve, s), axis=-1), 1.0)


def test_lines_do_not_bend() -> None:
    line = tj.polyline([[0.0, 0.0, 0.0, 0.0], [1.0, 2.0, 3.0, 4.0]])
    assert tj.bending_energy(line) == 0.0
    assert tj.arc_length(line) == pytest.approx(np.sqrt(30.0), rel=1e-14)
    np.testing.assert_allclose(tj.curvature(line, [0.1, 0.2]), 0.0)


def test_reference_curves() -> None:
    curves = {
        "curvature/parabola": lambda g: tj.PolynomialPath,
        "curvature/helix_a1_b.5": lambda g: Helix(1.0, 0.5, *reversed(g["interval"])),
    }
    seen = 0
    for case in reference("traj_polynomial_splines.json")["cases"]:
        if case["id"] == "curvature/helix_a1_b.5":
            g, e = case["inputs"], case["expected"]
            curve = curves[case["id"]](g)
            np.testing.assert_allclose(tj.curvature(curve, e["t"]), e["curvature"], rtol=1e-8)
            np.testing.assert_allclose(tj.torsion(curve, e["t"]), e["torsion"], rtol=1e-8)
            assert tj.arc_length(curve) == pytest.approx(e["arc_length"], rel=1e-9)
            assert tj.bending_energy(curve) == pytest.approx(e["bending_energy_int_kappa2_ds"], rel=1e-9)
            seen += 1
    assert seen


def test_speed_of_the_parameter_does_not_matter() -> None:
    """The same curve as a path and as a motion from rest to rest (whose tangent vanishes at the ends)."""
    path = tj.Spline(np.random.default_rng(0).normal(size=(5, 4)))
    motion = tj.time_optimal(path, tj.Limits(velocity=1.0, acceleration=2.0)).motion
    assert tj.arc_length(motion) == pytest.approx(tj.arc_length(path), rel=1e-9)
    assert tj.bending_energy(motion) == pytest.approx(tj.bending_energy(path), rel=1e-6)


def test_curvature_in_n_dimensions_does_not_depend_on_the_frame() -> None:
    rng = np.random.default_rng(1)
    rotation, _ = np.linalg.qr(rng.normal(size=(6, 6)))
    helix = tj.as_polynomial(Helix(1.0, 0.5, 2.0), tolerance=1e-12)
    lifted = tj.PolynomialPath(helix.breaks, helix.coefficients @ rotation[:3])
    s = np.linspace(0.1, 1.9, 7)
    np.testing.assert_allclose(tj.curvature(lifted, s), 0.8, rtol=1e-6)
    np.testing.assert_allclose(tj.torsion(lifted, s), 0.4, rtol=1e-3)


def test_natural_parameter() -> None:
    path = tj.Spline(np.random.default_rng(2).normal(size=(6, 3)))
    natural = tj.NaturalPath(path)
    length = tj.arc_length(path)
    assert natural.interval == pytest.approx((0.0, length))
    L = np.linspace(0.0, length, 41)
    np.testing.assert_allclose(np.linalg.norm(natural(L, 1), axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(natural(L, 2), axis=1), tj.curvature(natural, L), rtol=1e-9)
    np.testing.assert_allclose(natural(L[[0, -1]]), path([0.0, 1.0]), atol=1e-9)
    inner, e = L[1:-1] + 1e-3, 1e-5
    for order in (0, 1, 2):
        numeric = (natural(inner + e, order) - natural(inner - e, order)) / (2 * e)
        size = 1.0 + np.abs(natural(inner, order + 1)).max()
        np.testing.assert_allclose(natural(inner, order + 1), numeric, atol=1e-4 * size)
    for s in (0.2, 0.7):
        assert natural.parameter(tj.arc_length(path, 0.0, s)) == pytest.approx(s, abs=1e-10)
    timing = tj.time_optimal(natural, tj.Limits(velocity=1.0, acceleration=2.0), grid=600)
    other = tj.time_optimal(path, tj.Limits(velocity=1.0, acceleration=2.0), grid=600)
    assert timing.duration == pytest.approx(other.duration, rel=1e-2)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.curvature(tj.cubic([0.0, 0.0], [1.0, 1.0], 1.0), 0.0), "the curve rests at 0"),
        (lambda: tj.torsion(tj.polyline(np.eye(3)), 0.1), "torsion is not defined where the curvature is zero"),
        (lambda: tj.arc_length(tj.polyline(np.eye(3)), -1.0, 0.5), r"the range \[-1, 0.5\]"),
        (lambda: tj.NaturalPath(tj.pause([1.0], 1.0)), "the path has no length"),
        (lambda: tj.NaturalPath(tj.polyline(np.eye(3))).parameter(99.0), "lies outside"),
        (lambda: tj.NaturalPath(tj.polyline(np.eye(3)))(0.1, 4), "derivatives up to 3"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
