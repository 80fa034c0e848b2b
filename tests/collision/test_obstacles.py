"""Half-spaces, clouds, unions and fields: distances of every pair of kinds, and obstacles of robots."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.collision import Cloud, CollisionModel, Convex, Grid, HalfSpace, Union, signed_distance
from apprehend.errors import InputError
from tests.collision.makers import gantry, planar, pose, rotation
from tests.support import reference

BALL, SPACING = 0.3, 0.05
CORE = {
    "sphere": lambda rng: Convex.sphere(rng.uniform(0.05, 0.3)),
    "capsule": lambda rng: Convex.capsule(rng.uniform(0.05, 0.2), rng.uniform(0.1, 0.5)),
    "box": lambda rng: Convex.box(rng.uniform(0.1, 0.5, 3)),
    "cylinder": lambda rng: Convex.cylinder(rng.uniform(0.05, 0.3), rng.uniform(0.1, 0.5)),
    "hull": lambda rng: Convex.hull(rng.normal(size=(20, 3)) * 0.15),
}


def places(rng: np.random.Generator, count: int, spread: float = 0.4) -> np.ndarray:
    return np.array([pose(*rng.normal(size=3) * spread, rotation(rng)) for _ in range(count)])


def at(p: np.ndarray) -> np.ndarray:
    return pose(*p)


def ball_field() -> Grid:
    axes = [(np.arange(n) - 0.5 * (n - 1)) * SPACING for n in (25, 26, 27)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return Grid.of(np.linalg.norm(nodes, axis=-1) - BALL, SPACING, [axis[0] for axis in axes])


def check_witnesses(found, T_a=None) -> None:
    assert np.isfinite(found.points).all()
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=-1), 1.0, atol=1e-9)
    gap = np.einsum("...i,...i->...", found.points[..., 0, :] - found.points[..., 1, :], found.normal)
    np.testing.assert_allclose(gap, found.distance, atol=2e-7)


@pytest.mark.parametrize("kind", CORE)
def test_half_spaces_clouds_and_unions_have_obvious_distances(kind: str) -> None:
    rng = np.random.default_rng([1, *map(ord, kind)])
    shape, TA, TB = CORE[kind](rng), places(rng, 12), places(rng, 12)
    # a half-space is a huge box
    floor = HalfSpace.through([0.1, 0.2, 0.3], [1.0, 2.0, -0.5])
    found = signed_distance(shape, floor, TA, TB)
    huge = Convex.box([20.0, 20.0, 20.0]).at(floor.pose @ pose(0.0, 0.0, -10.0))
    np.testing.assert_allclose(found.distance, signed_distance(shape, huge, TA, TB).distance, atol=1e-11)
    check_witnesses(found)
    # a cloud is many balls, a union many shapes
    points = rng.normal(size=(40, 3)) * 0.2
    parts = [CORE[k](rng).at(T) for k, T in zip(CORE, places(rng, len(CORE)), strict=True)]
    for whole, pieces in (
        (Cloud.of(points, 0.01), [Convex.sphere(0.01).at(at(p)) for p in points]),
        (Union.of(parts), parts),
    ):
        found = signed_distance(shape, whole, TA, TB)
        each = np.array([signed_distance(shape, piece, TA, TB).distance for piece in pieces])
        np.testing.assert_allclose(found.distance, each.min(axis=0), atol=1e-9)
        check_witnesses(found)
        back = signed_distance(whole, shape, TB, TA)
        np.testing.assert_array_equal(back.distance, found.distance)
        np.testing.assert_array_equal(back.normal, -found.normal)
        np.testing.assert_array_equal(back.points[:, 0], found.points[:, 1])


@pytest.mark.parametrize("kind", CORE)
def test_a_field_of_a_ball_is_a_ball(kind: str) -> None:
    rng = np.random.default_rng([2, *map(ord, kind)])
    shape, field = CORE[kind](rng), ball_field()
    TA = places(rng, 15, 0.25)
    before = signed_distance(shape, Convex.sphere(BALL), TA, np.eye(4))
    exact = np.linspace(-0.02, 0.12, 15)
    TA[:, :3, 3] += (exact - before.distance)[:, None] * before.normal  # that far apart, the same points nearest
    found = signed_distance(shape, field, TA, np.eye(4))
    bound = 3.0 * SPACING**2 / (8.0 * BALL) + 0.02 * SPACING
    assert np.abs(found.distance - exact).max() < bound
    check_witnesses(found)
    far = places(rng, 5, 0.1) + pose(2.0) - np.eye(4)
    exact = signed_distance(shape, Convex.sphere(BALL), far, np.eye(4)).distance
    beyond = signed_distance(shape, field, far, np.eye(4)).distance
    assert (beyond <= exact * 1.02).all()
    assert (beyond > 0.6 * exact).all()


def test_unions_clouds_fields_and_half_spaces_among_themselves() -> None:
    rng = np.random.default_rng(3)
    TA, TB = places(rng, 8), places(rng, 8)
    parts = [Convex.hull(rng.normal(size=(10, 3)) * 0.1).at(T) for T in places(rng, 20)]
    points = [rng.normal(size=(n, 3)) * 0.2 for n in (30, 20)]
    union, (one, two) = Union.of(parts), (Cloud.of(p, 0.01) for p in points)
    world = [
        np.einsum("nij,kj->nki", T[:, :3, :3], p) + T[:, None, :3, 3] for T, p in ((TA, points[0]), (TB, points[1]))
    ]
    gaps = np.linalg.norm(world[0][:, :, None] - world[1][:, None], axis=-1).min(axis=(1, 2)) - 0.02
    np.testing.assert_allclose(signed_distance(one, two, TA, TB).distance, gaps, atol=1e-12)
    each = np.array([signed_distance(part, one, TA, TB).distance for part in parts])
    np.testing.assert_allclose(signed_distance(union, one, TA, TB).distance, each.min(axis=0), atol=1e-9)
    each = np.array([signed_distance(part, union, TA, TB).distance for part in parts])
    np.testing.assert_allclose(signed_distance(union, union, TA, TB).distance, each.min(axis=0), atol=1e-9)
    floor, field, ball = HalfSpace.through(), ball_field(), Convex.sphere(BALL)
    for thing in (union, one):
        leaves = parts if thing is union else [Convex.sphere(0.01).at(at(p)) for p in points[0]]
        lowest = np.min([signed_distance(leaf, floor, TA, TB).distance for leaf in leaves], axis=0)
        np.testing.assert_allclose(signed_distance(thing, floor, TA, TB).distance, lowest, atol=1e-12)
        exact = signed_distance(thing, ball, TA, TB).distance
        close = np.abs(exact) < 0.05
        assert np.abs(signed_distance(thing, field, TA, TB).distance - exact)[close].max(initial=0.0) < 4e-3
    exact = signed_distance(ball, floor, TA, TB).distance
    np.testing.assert_allclose(signed_distance(field, floor, TA, TB).distance, exact, atol=2e-3)
    touching = signed_distance(field, field, np.eye(4), pose(2.0 * BALL + 0.01))
    assert touching.distance == pytest.approx(0.01, abs=3e-3)
    facing = signed_distance(floor, floor, pose(0.0, 0.0, -0.2), pose(0.0, 0.0, 0.0, np.diag([1.0, -1.0, -1.0])))
    assert facing.distance == pytest.approx(0.2)
    assert signed_distance(floor, floor, np.eye(4), np.eye(4)).distance == -np.inf


def test_surfaces_of_the_reference_meshes() -> None:
    data = reference("collision_meshes.json")
    meshes = {name: Union.surface(m["vertices"], m["faces"]) for name, m in data["conventions"]["meshes"].items()}
    for case in data["cases"][::3]:
        inputs = case["inputs"]
        a, b = meshes[inputs["A"]], meshes[inputs["B"]]
        found = signed_distance(a, b, np.array(inputs["TA"]), np.array(inputs["TB"])).distance
        assert max(float(found), 0.0) == pytest.approx(case["expected"]["surface_distance"], abs=1e-9), case["id"]


def test_points_and_the_reference_meshes() -> None:
    data = reference("mesh_queries.json")
    meshes = {name: Union.surface(m["vertices"], m["faces"]) for name, m in data["conventions"]["meshes"].items()}
    point = Convex.hull([[0.0, 0.0, 0.0]])
    cases = [case for case in data["cases"] if case["id"].startswith("point/")]
    for name, surface in meshes.items():
        mine = [case for case in cases if case["inputs"]["mesh"] == name]
        T = np.array([at(case["inputs"]["point"]) for case in mine])
        expected = [case["expected"]["unsigned_distance"] for case in mine]
        np.testing.assert_allclose(signed_distance(point, surface, T, np.eye(4)).distance, expected, atol=1e-9)


def test_the_field_of_a_body_agrees_with_its_surface() -> None:
    mug = Body.household("mug")
    field, surface = Grid.of(mug.distance_field(0.003, margin=0.05)), Union.surface(mug.vertices, mug.faces)
    rng = np.random.default_rng(4)
    stick = Convex.capsule(0.01, 0.05)
    centre = 0.5 * (mug.vertices.min(axis=0) + mug.vertices.max(axis=0))
    T = np.array([pose(*(centre + rng.normal(size=3) * 0.15), rotation(rng)) for _ in range(40)])
    before = signed_distance(stick, surface, T, np.eye(4))
    T[:, :3, 3] += (np.linspace(0.001, 0.006, 40) - before.distance)[:, None] * before.normal
    exact = signed_distance(stick, surface, T, np.eye(4)).distance
    found = signed_distance(stick, field, T, np.eye(4)).distance
    apart = (exact > 0.0) & (before.distance > 0.006)
    assert apart.sum() > 20
    assert np.abs(found - exact)[apart].max() < 0.003


# --- as obstacles --------------------------------------------------------------------------------------------------
def test_a_gantry_over_a_half_space() -> None:
    robot = gantry()
    model = CollisionModel(robot).add("floor", HalfSpace.through([0.0, 0.0, -0.5]))
    q = np.random.default_rng(5).uniform(-1.0, 1.0, (300, 3))
    expected = q[:, 2] + 0.5 - 0.1
    np.testing.assert_allclose(model.distance(q), expected, atol=1e-12)
    assert model.lanes.decides[0]
    assert (model.free(q) == (expected > 0.0)).all()
    np.testing.assert_allclose(model.distance_gradient(q)[1], np.tile([0.0, 0.0, 1.0], (300, 1)), atol=1e-12)
    assert not model.edges_free([0.0, 0.0, 0.5], [0.0, 0.0, -0.45])
    assert model.edges_free([0.0, 0.0, 0.5], [0.5, 0.0, -0.35])


def obstacles() -> dict[str, object]:
    rng = np.random.default_rng(6)
    half = np.array([0.1, 0.15, 0.3])
    points = rng.uniform(-1.0, 1.0, (3000, 3))
    axis = rng.integers(3, size=len(points))
    points[np.arange(len(points)), axis] = np.sign(points[np.arange(len(points)), axis])
    many = [Convex.box([0.02, 0.02, 0.02]).at(at(p)) for p in points[:100] * half]
    return {
        "cloud": Cloud.of(points * half, 0.005),
        "field": ball_field(),
        "few": Union.of([Convex.box(2.0 * half), Convex.sphere(0.2).at(pose(0.0, 0.2))]),
        "many": Union.of(many),
        "tilted floor": HalfSpace.through([-0.6, -0.5, 0.0], [0.7, 0.7, 0.1]),
    }


@pytest.mark.parametrize("kind", obstacles())
def test_every_obstacle_on_lanes_exactly_and_along_motions(kind: str) -> None:
    """Spheres never call free what is hit; the distance is that of the pairs; motions agree with dense sampling."""
    robot, thing = planar(3), obstacles()[kind]
    place = pose(0.7, 0.3, 0.05, rotation(np.random.default_rng(7)) if kind != "tilted floor" else None)
    model = CollisionModel(robot).allow([("link1", "link3")]).add("thing", thing, place)
    rng = np.random.default_rng(8)
    q = rng.uniform(-2.9, 2.9, (150, robot.n))
    free = model.free(q)
    assert 0.05 < free.mean() < 0.95
    np.testing.assert_array_equal(free, model.hits(q) < 0)
    link, frames = Convex.box([0.34, 0.06, 0.06]), robot.fk(q[:25])
    least = np.full(25, np.inf)
    for i in (1, 2, 3):
        carried = frames[:, robot.frame_names.index(f"link{i}")] @ pose(0.2)
        least = np.minimum(least, signed_distance(link, thing, carried, place).distance)
    found = model.distance(q[:25])
    np.testing.assert_allclose(found, least, atol=1e-9 if kind != "field" else 0.02)
    assert (found[free[:25]] > 0.0).all()
    count = 30 if kind != "field" else 8
    a, b = q[free][:count], q[free][1 : count + 1]
    edges = model.edges_free(a, b)
    s = np.linspace(0.0, 1.0, 101 if kind != "field" else 41)[:, None, None]
    along = model.distance(a + s * (b - a)).min(axis=0)
    assert (along[edges] > -model.resolution).all()
    assert (along[~edges] < 0.03).all()
    proven = model.sweep(a, b).free
    assert (along[proven] > 0.0).all()
    assert not (proven & ~edges).any()


def test_a_cloud_is_thinned_without_losing_a_point() -> None:
    rng = np.random.default_rng(9)
    points = rng.uniform(-0.2, 0.2, (2000, 3))
    points[5] = np.nan
    thin = Cloud.of(points, 0.002, spacing=0.02)
    assert len(thin.points) < 1900
    kept = np.delete(points, 5, axis=0)
    gaps = np.linalg.norm(kept[:, None] - thin.points[None], axis=-1).min(axis=1)
    assert (gaps + 0.002 <= thin.radius + 1e-12).all()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: HalfSpace.through(normal=[0.0, 0.0, 0.0]), "expected a direction"),
        (lambda: HalfSpace.through([np.nan, 0.0, 0.0]), r"point\[0\] is nan"),
        (lambda: Cloud.of(np.full((4, 3), np.nan)), "at least one point"),
        (lambda: Cloud.of([[0.0, 0.0, np.inf]]), "every entry must be finite"),
        (lambda: Cloud.of(np.zeros((4, 3)), -1.0), "radius of a cloud is -1"),
        (lambda: Cloud.of(np.zeros((4, 3)), spacing=0.0), "spacing of a cloud must be positive"),
        (lambda: Cloud.of(np.zeros((4, 2))), r"expected \(..., 3\)"),
        (lambda: Union.of([]), "at least one shape"),
        (lambda: Union.of([HalfSpace.through()]), "a HalfSpace is none"),
        (lambda: Union.surface(np.zeros((3, 3)), [[0, 1, 3]]), "faces name vertex 3; there are 3"),
        (lambda: Union.surface(np.zeros((3, 3)), [[0.0, 1.0, 2.0]]), "whole numbers"),
        (lambda: Grid.of(np.ones((1, 4, 4)), 0.1), "at least 2 along each axis"),
        (lambda: Grid.of(np.ones((4, 4, 4))), "need their spacing"),
        (lambda: Grid.of(np.zeros((4, 4, 4)), 0.1), "on the border of its grid"),
        (lambda: Grid.of(np.ones((4, 4, 4)), 0.1).crossings, "positive everywhere"),
        (lambda: signed_distance("box", Convex.sphere(1.0), np.eye(4), np.eye(4)), "a is str; expected a Convex"),
        (lambda: CollisionModel(gantry()).add("thing", []), "non-empty sequence"),
        (lambda: CollisionModel(gantry()).attach(HalfSpace.through(), "ball", np.eye(4), name="x"), "can be attached"),
        (lambda: Convex.sphere(1.0).at(np.tile(np.eye(4), (2, 1, 1))), "expected one"),
    ],
)
def test_bad_geometry_is_named(make, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()
