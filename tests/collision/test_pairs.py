"""Distance and depth of pairs of convex shapes: closed forms, the reference file, coal, and laws."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.collision import Convex
from apprehend.collision.pairs import signed_distance
from apprehend.errors import InputError
from tests.collision.makers import pose, rotation
from tests.support import reference

SHAPES = {
    "sphere": lambda rng: Convex.sphere(rng.uniform(0.05, 0.5)),
    "capsule": lambda rng: Convex.capsule(rng.uniform(0.05, 0.3), rng.uniform(0.1, 1.0)),
    "box": lambda rng: Convex.box(rng.uniform(0.1, 1.0, 3)),
    "cylinder": lambda rng: Convex.cylinder(rng.uniform(0.05, 0.5), rng.uniform(0.1, 1.0)),
    "cone": lambda rng: Convex.cone(rng.uniform(0.05, 0.5), rng.uniform(0.1, 1.0)),
    "ellipsoid": lambda rng: Convex.ellipsoid(rng.uniform(0.1, 0.6, 3)),
    "hull": lambda rng: Convex.hull(rng.normal(size=(40, 3)) * rng.uniform(0.1, 0.5, 3)),
}


def from_reference(shape: dict) -> Convex:
    kind = shape["kind"]
    if kind == "box":
        return Convex.box(shape["size"])
    if kind == "sphere":
        return Convex.sphere(shape["radius"])
    if kind == "convex":
        return Convex.hull(shape["vertices"])
    if kind == "ellipsoid":
        return Convex.ellipsoid(shape["radii"])
    return {"capsule": Convex.capsule, "cylinder": Convex.cylinder, "cone": Convex.cone}[kind](
        shape["radius"], shape["length"]
    )


def test_reference_primitives() -> None:
    data = reference("collision_primitives.json")
    for case in data["cases"]:
        a, b = from_reference(case["inputs"]["A"]), from_reference(case["inputs"]["B"])
        found = signed_distance(a, b, np.array(case["inputs"]["TA"]), np.array(case["inputs"]["TB"]))
        expected = case["expected"]["signed_distance"]
        # shapes with curved sides: the references themselves are good to about 1e-8 separated, 1e-5 overlapping
        tolerance = 2e-8 if expected > 0.0 else case["tol"]["penetration_abs"]
        assert found.distance == pytest.approx(expected, abs=tolerance), case["id"]


def test_spheres_and_capsules_have_closed_forms() -> None:
    rng = np.random.default_rng(1)
    a, b = Convex.sphere(0.3), Convex.capsule(0.2, 0.8)
    for _ in range(300):
        T = pose(*rng.normal(size=3), rotation(rng))
        centre = rng.normal(size=3) * 0.8
        along = T[:3, :3].T @ (centre - T[:3, 3])
        expected = np.linalg.norm(along - [0.0, 0.0, np.clip(along[2], -0.4, 0.4)]) - 0.5
        found = signed_distance(a, b, pose(*centre), T)
        assert found.distance == pytest.approx(expected, abs=1e-12)


def test_box_and_sphere_have_a_closed_form() -> None:
    rng = np.random.default_rng(2)
    half = np.array([0.3, 0.5, 0.7])
    box, ball = Convex.box(2.0 * half), Convex.sphere(0.2)
    for _ in range(300):
        T = pose(*rng.normal(size=3), rotation(rng))
        centre = T[:3, 3] + rng.normal(size=3) * 0.7
        local = T[:3, :3].T @ (centre - T[:3, 3])
        out = np.maximum(np.abs(local) - half, 0.0)
        expected = np.linalg.norm(out) if out.any() else -(half - np.abs(local)).min()
        assert signed_distance(box, ball, T, pose(*centre)).distance == pytest.approx(expected - 0.2, abs=1e-11)


@pytest.mark.parametrize("kind_a", SHAPES)
@pytest.mark.parametrize("kind_b", SHAPES)
def test_laws(kind_a: str, kind_b: str) -> None:
    """Symmetry, frame invariance, witnesses on the answer, and separation by exactly the depth."""
    rng = np.random.default_rng([3, *map(ord, kind_a + kind_b)])
    for _ in range(12):
        a, b = SHAPES[kind_a](rng), SHAPES[kind_b](rng)
        TA = pose(*rng.normal(size=3) * 0.5, rotation(rng))
        TB = pose(*rng.normal(size=3) * 0.5, rotation(rng))
        there = signed_distance(a, b, TA, TB)
        back = signed_distance(b, a, TB, TA)
        assert np.isfinite(there.distance)
        assert there.distance == pytest.approx(back.distance, abs=2e-8)
        assert np.linalg.norm(there.normal) == pytest.approx(1.0, abs=1e-9)
        moved = pose(*rng.normal(size=3), rotation(rng))
        assert signed_distance(a, b, moved @ TA, moved @ TB).distance == pytest.approx(there.distance, abs=2e-8)
        gap = (there.points[0] - there.points[1]) @ there.normal
        assert gap == pytest.approx(there.distance, abs=2e-7)
        # moved apart by the depth along the normal they just touch; moved by 10 mm more they are 10 mm apart at most
        if there.distance < 0.0:
            away = pose(*((-there.distance + 1e-6) * there.normal)) @ TA
            after = signed_distance(a, b, away, TB).distance
            assert -1e-7 < after < 1e-5
        else:
            closer = pose(*(-(there.distance - 1e-6) * there.normal)) @ TA
            assert 0.0 < signed_distance(a, b, closer, TB).distance < 2e-6


def test_touching_and_equal_shapes_have_finite_answers() -> None:
    box, ball = Convex.box([1.0, 1.0, 1.0]), Convex.sphere(0.5)
    assert signed_distance(box, box, np.eye(4), pose(1.0)).distance == pytest.approx(0.0, abs=1e-12)
    assert signed_distance(box, box, np.eye(4), np.eye(4)).distance == pytest.approx(-1.0, abs=1e-12)
    assert signed_distance(ball, ball, np.eye(4), np.eye(4)).distance == pytest.approx(-1.0, abs=1e-12)
    capsule = Convex.capsule(0.1, 1.0)
    assert signed_distance(capsule, capsule, np.eye(4), np.eye(4)).distance == pytest.approx(-0.2, abs=1e-12)
    flat = Convex.hull([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    assert signed_distance(flat, flat, np.eye(4), pose(0.0, 0.0, 0.25)).distance == pytest.approx(0.25, abs=1e-12)
    assert signed_distance(flat, flat, np.eye(4), np.eye(4)).distance == pytest.approx(0.0, abs=1e-12)
    thin = Convex.hull(np.array([[0.0, 0.0, 0.0]]), radius=0.1)
    assert signed_distance(thin, thin, np.eye(4), pose(0.5)).distance == pytest.approx(0.3, abs=1e-12)


def test_extreme_shapes_have_exact_answers() -> None:
    """Thin, long, far, tiny and coincident shapes."""
    thin = Convex.box([1.0, 1.0, 1e-9])
    assert signed_distance(thin, thin, np.eye(4), pose(0.0, 0.0, 1e-8)).distance == pytest.approx(9e-9, rel=1e-6)
    needles = Convex.box([1e3, 1e-3, 1e-3]), Convex.box([1e-3, 1e3, 1e-3])
    assert signed_distance(*needles, np.eye(4), pose(0.0, 0.0, 0.01)).distance == pytest.approx(0.009, abs=1e-12)
    assert signed_distance(*needles, np.eye(4), np.eye(4)).distance == pytest.approx(-0.001, abs=1e-12)
    can = Convex.cylinder(0.1, 0.2)
    assert signed_distance(can, can, np.eye(4), pose(1e6)).distance == pytest.approx(1e6 - 0.2, abs=1e-6)
    assert signed_distance(can, can, np.eye(4), np.eye(4)).distance == pytest.approx(-0.2, abs=1e-12)
    egg = Convex.ellipsoid([0.1, 0.2, 0.3])
    assert signed_distance(egg, egg, np.eye(4), np.eye(4)).distance == pytest.approx(-0.2, abs=1e-9)
    cone = Convex.cone(0.1, 0.2)  # its width is least across its side: 2 r sin(atan(length / r))
    found = signed_distance(cone, cone, np.eye(4), np.eye(4))
    assert found.distance == pytest.approx(-0.2 * np.sin(np.arctan(2.0)), abs=1e-9)
    gap = (found.points[0] - found.points[1]) @ found.normal
    assert gap == pytest.approx(found.distance, abs=1e-7)
    line = Convex.hull([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    assert signed_distance(line, Convex.box([1.0, 1.0, 1.0]), np.eye(4), pose(1.0)).distance == pytest.approx(-0.5)
    point = Convex.hull([[0.0, 0.0, 0.0]])
    assert signed_distance(point, point, np.eye(4), np.eye(4)).distance == 0.0


def test_deepest_points_lie_apart_by_the_depth() -> None:
    """Where faces are parallel, too: the deepest points of a capsule in a box, along the normal."""
    rng = np.random.default_rng(8)
    a, b = Convex.box([0.6, 0.4, 0.5]), Convex.capsule(0.1, 0.4)
    for T in (pose(0.1, 0.05, 0.1), pose(0.0, 0.0, 0.2), pose(*rng.normal(size=3) * 0.1, rotation(rng))):
        found = signed_distance(a, b, np.eye(4), T)
        assert found.distance < 0.0
        np.testing.assert_allclose(found.points[0] - found.points[1], found.distance * found.normal, atol=1e-8)


def test_batches_broadcast() -> None:
    rng = np.random.default_rng(5)
    a, b = Convex.box([0.2, 0.3, 0.4]), Convex.cylinder(0.1, 0.3)
    TB = np.array([pose(*rng.normal(size=3), rotation(rng)) for _ in range(6)]).reshape(2, 3, 4, 4)
    many = signed_distance(a, b, np.eye(4), TB)
    assert many.distance.shape == (2, 3)
    assert many.points.shape == (2, 3, 2, 3)
    assert many.normal.shape == (2, 3, 3)
    assert many.distance[1, 2] == signed_distance(a, b, np.eye(4), TB[1, 2]).distance


def test_against_coal() -> None:
    coal = pytest.importorskip("coal")
    rng = np.random.default_rng(6)
    for _ in range(400):
        size, radius, length = rng.uniform(0.1, 1.0, 3), rng.uniform(0.05, 0.5), rng.uniform(0.1, 1.0)
        ours = [
            Convex.box(size),
            Convex.sphere(radius),
            Convex.capsule(radius, length),
            Convex.cylinder(radius, length),
        ]
        theirs = [coal.Box(size), coal.Sphere(radius), coal.Capsule(radius, length), coal.Cylinder(radius, length)]
        i, j = rng.integers(4, size=2)
        T = [pose(*rng.normal(size=3), rotation(rng)) for _ in range(2)]
        request, result = coal.DistanceRequest(True, True), coal.DistanceResult()
        request.gjk_tolerance = 1e-12
        places = [coal.Transform3s(t[:3, :3], t[:3, 3]) for t in T]
        coal.distance(theirs[i], places[0], theirs[j], places[1], request, result)
        if result.min_distance > 0.0:  # coal's depths are not reliable for every pair
            found = signed_distance(ours[i], ours[j], T[0], T[1]).distance
            assert found == pytest.approx(result.min_distance, abs=2e-8)


def test_climbed_hulls_agree_with_searched_ones() -> None:
    """A hull of many vertices is climbed; the same hull as several small ones is searched."""
    rng = np.random.default_rng(7)
    points = rng.normal(size=(120, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    whole, other = Convex.hull(points), Convex.box([0.5, 0.4, 0.3])
    corners = points[whole_faces(points)]
    for _ in range(10):
        T = pose(*(rng.normal(size=3) * 2.0), rotation(rng))
        d = signed_distance(whole, other, np.eye(4), T).distance
        if d > 0.0:
            least = min(signed_distance(Convex.hull(c), other, np.eye(4), T).distance for c in corners)
            assert d == pytest.approx(least, abs=1e-10)


def whole_faces(points: np.ndarray) -> np.ndarray:
    from scipy.spatial import ConvexHull

    return ConvexHull(points).simplices


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Convex.box([0.1, -0.1, 0.1]), "size of a box must be positive"),
        (lambda: Convex.sphere(0.0), "radius of a sphere must be positive"),
        (lambda: Convex.sphere("big"), "must be positive, in m; got 'big'"),
        (lambda: Convex.box([np.inf, 1.0, 1.0]), "must be positive, in m; got inf"),
        (lambda: Convex.hull([[np.nan, 0.0, 0.0]]), "every entry must be finite"),
        (
            lambda: signed_distance(Convex.sphere(1.0), Convex.sphere(1.0), np.full((4, 4), np.nan), np.eye(4)),
            r"T_a\[0, 0\] is nan",
        ),
        (lambda: Convex.capsule(0.1, -1.0), "length of a capsule is -1.0"),
        (lambda: Convex.cylinder(0.1, np.nan), "cylinder must be positive"),
        (lambda: Convex.hull(np.zeros((0, 3))), "at least one point"),
        (lambda: Convex.hull(np.zeros((3, 2))), r"expected \(..., 3\)"),
        (lambda: Convex.hull(np.zeros((3, 3)), radius=-1.0), "radius of a hull is -1.0"),
        (lambda: Convex.ellipsoid([1.0, 0.0, 1.0]), "radii of an ellipsoid"),
        (lambda: Convex.cone(1.0, 0.0), "cone must be positive"),
        (
            lambda: signed_distance(Convex.sphere(1.0), Convex.sphere(1.0), np.eye(3), np.eye(4)),
            r"T_a has shape \(3, 3\)",
        ),
    ],
)
def test_bad_shapes_are_named(make, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()
