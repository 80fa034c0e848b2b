"""Convex shapes where distances are hardest: touching, equal, parallel, thin, tiny and large; with certificates.

A distance is certified by planes across the answered normal that just hold the shapes (support functions written here),
a depth in addition by directions none of which separates sooner.
"""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.collision import Convex, HalfSpace, signed_distance
from apprehend.kernels.gjk import BOX, CONE, CYLINDER, ELLIPSOID
from tests.collision.makers import pose, rotation

QUARTERS = (np.eye(3), np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.diag([1.0, -1.0, -1.0]))
GAPS = (0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3, -1e-12, -1e-9, -1e-7, -1e-5, -1e-3)


def shapes(scale: float, stretch: float) -> dict[str, Convex]:
    """One of every kind, about *scale* wide and *stretch* times as long."""
    rng, s, long = np.random.default_rng(0), scale, scale * stretch
    return {
        "sphere": Convex.sphere(0.3 * s),
        "capsule": Convex.capsule(0.2 * s, 0.8 * long),
        "box": Convex.box([0.4 * s, 0.6 * s, 0.8 * long]),
        "plate": Convex.box([0.5 * s, 0.5 * s, 0.5 * s / stretch]),
        "cylinder": Convex.cylinder(0.3 * s, 0.8 * long),
        "disc": Convex.cylinder(0.3 * s, 0.2 * s / stretch),
        "cone": Convex.cone(0.3 * s, 0.8 * long),
        "ellipsoid": Convex.ellipsoid([0.2 * s, 0.3 * s, 0.4 * long]),
        "hull": Convex.hull(rng.normal(size=(40, 3)) * [0.2 * s, 0.3 * s, 0.4 * long]),
        "triangle": Convex.hull([[0.0, 0.0, 0.0], [0.5 * s, 0.0, 0.0], [0.0, 0.5 * long, 0.0]]),
        "segment": Convex.hull([[0.0, 0.0, -0.3 * long], [0.0, 0.0, 0.3 * long]]),
        "point": Convex.hull(np.zeros((2, 3))),
    }


def reach(shape: Convex, T: np.ndarray, d: np.ndarray) -> np.ndarray:
    """How far a shape at ``T (N, 4, 4)`` reaches along ``d (N, 3)``."""
    P = T @ shape.pose
    local = np.einsum("nij,ni->nj", P[:, :3, :3], d)
    across = np.hypot(local[:, 0], local[:, 1])
    if shape.kind == BOX:
        far = np.abs(local) @ shape.size
    elif shape.kind == CYLINDER:
        far = across * shape.size[0] + np.abs(local[:, 2]) * shape.size[1]
    elif shape.kind == CONE:
        far = np.maximum(local[:, 2] * shape.size[1], across * shape.size[0] - local[:, 2] * shape.size[1])
    elif shape.kind == ELLIPSOID:
        far = np.linalg.norm(local * shape.size, axis=1)
    else:
        far = (local @ shape.points.T).max(axis=1)
    return far + shape.radius + np.einsum("ni,ni->n", d, P[:, :3, 3])


def between_planes(a: Convex, b: Convex, TA: np.ndarray, TB: np.ndarray, n: np.ndarray) -> np.ndarray:
    return -reach(a, TA, -n) - reach(b, TB, n)


def places(a: Convex, b: Convex, scale: float, rng: np.random.Generator) -> np.ndarray:
    """Poses of *b*, with *a* at the origin: equal, concentric, parallel at every gap, and touching in one point."""
    turns = [rotation(rng) for _ in range(2)]
    out = [pose(R=R) for R in (*QUARTERS, *turns)]
    out += [pose(*(0.1 * scale * e)) for e in np.eye(3)]
    origin = np.eye(4)[None]
    for axis in np.eye(3):
        touch = reach(a, origin, axis[None])[0] + reach(b, origin, -axis[None])[0]
        out += [pose(*((touch + gap * scale) * axis)) for gap in GAPS]
    for R in turns:
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        on_a = signed_distance(a, HalfSpace.through(normal=-n), np.eye(4), np.eye(4)).points[0]
        on_b = signed_distance(b, HalfSpace.through(normal=R.T @ n), np.eye(4), np.eye(4)).points[0]
        out += [pose(*(on_a - R @ on_b + gap * scale * n), R) for gap in GAPS]
    return np.array(out)


def thin(stretch: float, long: float) -> dict[str, Convex]:
    """Things that are *long*, and thinner by *stretch*: sheets, strips, rods and needles, and a ball and a box."""
    rng, t = np.random.default_rng(0), long / stretch
    return {
        "ball": Convex.sphere(0.2 * long),
        "box": Convex.box([0.3 * long, 0.2 * long, 0.5 * long]),
        "bar": Convex.box([t, 1.3 * t, long]),
        "sheet": Convex.box([long, 0.7 * long, t]),
        "strip": Convex.box([long, 0.1 * long, t]),
        "rod": Convex.cylinder(0.5 * t, long),
        "disc": Convex.cylinder(0.5 * long, t),
        "needle": Convex.capsule(0.5 * t, long),
        "tip": Convex.cone(0.5 * t, long),
        "leaf": Convex.ellipsoid([0.5 * long, 0.3 * long, 0.5 * t]),
        "splinter": Convex.hull(rng.normal(size=(40, 3)) * [0.25 * t, 0.25 * t, 0.25 * long]),
        "flake": Convex.hull(rng.normal(size=(40, 3)) * [0.25 * long, 0.25 * long, 0.25 * t]),
        "wire": Convex.hull([[0.0, 0.0, -0.5 * long], [0.0, 0.0, 0.5 * long]]),
    }


@pytest.mark.parametrize(("scale", "stretch"), [(1.0, 1.0), (1e-6, 1.0), (1e3, 1.0), (1.0, 100.0)])
def test_hard_places_have_certified_answers(scale: float, stretch: float) -> None:
    certify(shapes(scale, stretch), scale, scale * stretch)


@pytest.mark.parametrize(("stretch", "long"), [(100.0, 2.0), (100.0, 0.01), (1000.0, 10.0), (1000.0, 0.1)])
def test_thin_things_have_certified_answers(stretch: float, long: float) -> None:
    kinds = thin(stretch, long)
    certify(kinds, long, long)
    certify(kinds, long / stretch, long)  # gaps and offsets within the thickness


def certify(kinds: dict[str, Convex], scale: float, size: float) -> None:
    rng = np.random.default_rng(1)
    spread = rng.normal(size=(20, 3))
    spread = np.concatenate([spread / np.linalg.norm(spread, axis=1)[:, None], np.eye(3), -np.eye(3)])
    for i, (name_b, b) in enumerate(kinds.items()):
        for name_a, a in list(kinds.items())[: i + 1]:
            TB = places(a, b, scale, rng)
            TA = np.tile(np.eye(4), (len(TB), 1, 1))
            for found, swap in ((signed_distance(a, b, TA, TB), False), (signed_distance(b, a, TB, TA), True)):
                n = -found.normal if swap else found.normal
                d, what = found.distance, f"{name_a}, {name_b}, swapped: {swap}"
                for numbers in (d, found.points, n):
                    assert np.isfinite(numbers).all(), what
                np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, atol=1e-9, err_msg=what)
                planes = between_planes(a, b, TA, TB, n)
                np.testing.assert_allclose(d, planes, atol=1e-9 * size, rtol=1e-9, err_msg=what)
                apart = found.points[:, 0] - found.points[:, 1]
                np.testing.assert_allclose(apart, d[:, None] * found.normal, atol=2e-6 * size, err_msg=what)
                for direction in spread:
                    other = between_planes(a, b, TA, TB, np.tile(direction, (len(TB), 1)))
                    assert (other <= d + 2e-9 * size).all(), what


def test_distances_grow_with_the_scene() -> None:
    """Shapes and places a million times smaller, or a thousand times larger: so are distance and depth."""
    rng = np.random.default_rng(2)
    one = shapes(1.0, 1.0)
    for name_a, name_b in zip(one, reversed(one), strict=True):
        T = np.array([pose(*rng.normal(size=3) * 0.4, rotation(rng)) for _ in range(40)])
        expected = signed_distance(one[name_a], one[name_b], np.eye(4), T).distance
        for scale in (1e-6, 1e3):
            other = shapes(scale, 1.0)
            there = T.copy()
            there[:, :3, 3] *= scale
            found = signed_distance(other[name_a], other[name_b], np.eye(4), there).distance
            np.testing.assert_allclose(found / scale, expected, atol=1e-9, err_msg=f"{name_a}, {name_b}, {scale}")


@pytest.mark.parametrize("kinds", [("box", "hull"), ("hull", "hull"), ("box", "box"), ("capsule", "box")])
def test_depths_of_polytopes_are_those_of_the_facets_of_their_difference(kinds: tuple[str, str]) -> None:
    from scipy.spatial import ConvexHull

    rng = np.random.default_rng(3)
    a, b = (shapes(1.0, 1.0)[kind] for kind in kinds)
    checked = 0
    for _ in range(30):
        T = pose(*rng.normal(size=3) * 0.1, rotation(rng))
        found = signed_distance(a, b, np.eye(4), T)
        corners = [corners_of(shape) @ P[:3, :3].T + P[:3, 3] for shape, P in ((a, a.pose), (b, T @ b.pose))]
        facets = ConvexHull((corners[0][:, None] - corners[1]).reshape(-1, 3)).equations
        depth = -facets[:, 3].max()
        if depth > 0.0:
            checked += 1
            assert found.distance == pytest.approx(-depth - a.radius - b.radius, abs=1e-12)
    assert checked > 5


def corners_of(shape: Convex) -> np.ndarray:
    if shape.kind == BOX:
        return np.array(np.meshgrid(*np.outer(shape.size, [-1.0, 1.0]))).reshape(3, -1).T
    return shape.points
