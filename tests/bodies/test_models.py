"""Models of a body: each encloses or approximates it within the bound that it states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import Delaunay

from apprehend import Body
from apprehend.bodies import (
    MODELS,
    Boxes,
    Capsules,
    ConvexPieces,
    MeshIndex,
    Primitives,
    Spheres,
    SurfaceMesh,
    Voxels,
    shapes,
)
from apprehend.bodies.deviation import farthest_of_solid
from apprehend.bodies.parts import partitions
from apprehend.errors import InputError, MeshError, UnknownNameError

RNG = np.random.default_rng


def inner_points(body: Body, n: int = 4000) -> np.ndarray:
    points = RNG(0).uniform(*body.bounds, (4 * n, 3))
    return np.vstack([points[body.inside(points)][:n], body.vertices, body.sample_surface(n, RNG(1))[0]])


def points_of(model: Primitives, n: int = 20_000) -> np.ndarray:
    points = RNG(2).uniform(*model.bounds, (n, 3))
    return np.vstack([points[model.inside(points)], *(v for v, _ in model.meshes())])


@pytest.mark.parametrize("name", ["mug", "banana", "screwdriver"])
@pytest.mark.parametrize(
    ("kind", "count"), [("boxes", 1), ("boxes", 6), ("blocks", 3), ("spheres", 1), ("spheres", 20), ("capsules", 3)]
)
def test_simple_shapes_enclose_the_body_and_state_their_excess(name: str, kind: str, count: int) -> None:
    body = Body.household(name)
    model = body.model(kind, count)
    assert 1 <= len(model) <= count
    assert model.distance(inner_points(body)).max() <= 1e-9
    deviation = body.deviation(model)
    assert deviation.encloses
    assert deviation.inward == 0.0
    found = np.maximum(body.signed_distance(points_of(model)), 0.0).max()
    assert found <= deviation.outward <= 1.25 * found + 0.02 * body.extents.max()
    assert deviation.hausdorff == deviation.outward
    assert deviation.volume_excess > 0.0
    union = SurfaceMesh(*model.mesh)
    assert union.closed
    assert union.volume <= model.volume * (1 + 1e-9)
    assert union.volume == pytest.approx(model.volume, rel=0.02)


def test_a_solid_stays_enclosed_when_it_is_cut() -> None:
    """The middle of a solid belongs to the parts, too, not only its surface."""
    body = Body.sphere(0.1)
    points = inner_points(body, 2000)
    for model in (body.boxes(8), body.spheres(30)):
        assert model.distance(points).max() <= 1e-9
    deep = points[np.linalg.norm(points, axis=1) < 0.099]
    *_, partition = partitions(body.vertices, body.faces, 12, lambda s: 4.0 * float(np.prod(s)))
    assert len(partition) >= 10
    assert np.any([Delaunay(part).find_simplex(deep) >= 0 for part in partition], axis=0).all()


def test_more_shapes_fit_closer() -> None:
    body = Body.household("banana")
    for kind in ("boxes", "spheres", "capsules"):
        volumes = [body.model(kind, count).volume for count in (1, 3, 8)]
        assert volumes[0] > volumes[1] > volumes[2]


def test_shapes_of_known_solids_are_found() -> None:
    box = Body.box([0.05, 0.1, 0.2])
    turn = np.linalg.qr(RNG(5).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    turned = MeshIndex(box.vertices @ turn.T + 0.3, box.faces)
    model = Boxes.around(turned)
    assert np.allclose(np.sort(model.sizes[0]), [0.05, 0.1, 0.2], atol=1e-8)
    assert model.deviation(turned).outward < 2e-3  # the search stops at 0.5 % of the size
    aligned = Boxes.around(turned, oriented=False)
    assert np.allclose(aligned.poses[0, :3, :3], np.eye(3))
    assert aligned.volume > 1.5 * model.volume
    ball = Body.sphere(0.04).spheres(1)
    assert ball.volume == pytest.approx(4.0 / 3.0 * np.pi * ball.radii[0] ** 3)
    assert ball.radii[0] == pytest.approx(0.04, rel=0.01)
    rod = Body.cylinder(0.01, 0.3).capsules(1)
    assert rod.radii[0] == pytest.approx(0.01, rel=0.02)
    assert np.linalg.norm(np.diff(rod.ends[0], axis=0)) == pytest.approx(0.3, rel=0.01)


def test_distances_of_the_shapes_have_their_closed_forms() -> None:
    points = RNG(3).normal(size=(5, 40, 3))
    sphere = Spheres(np.array([[1.0, 0.0, 0.0]]), np.array([0.5]))
    assert np.allclose(sphere.distance(points), np.linalg.norm(points - [1.0, 0.0, 0.0], axis=-1) - 0.5)
    capsule = Capsules(np.array([[[0, 0, -1.0], [0, 0, 1.0]]]), np.array([0.2]))
    foot = np.clip(points[..., 2:], -1.0, 1.0) * [0.0, 0.0, 1.0]
    assert np.allclose(capsule.distance(points), np.linalg.norm(points - foot, axis=-1) - 0.2)
    pose = np.eye(4)
    pose[:3, 3] = [0.1, 0.2, 0.3]
    for model in (sphere, capsule, Boxes(np.eye(4)[None], np.array([[1.0, 2.0, 3.0]]))):
        assert np.allclose(model.at(pose).distance(points + pose[:3, 3]), model.distance(points))
    mesh = SurfaceMesh(*shapes.box([1.0, 2.0, 3.0]))
    assert np.allclose(Boxes(np.eye(4)[None], np.array([[1.0, 2.0, 3.0]])).distance(points), mesh.distance(points))


def test_convex_pieces_state_a_bound_that_holds() -> None:
    body = Body.household("screwdriver")
    model = body.convex()
    deviation = body.deviation(model)
    assert not deviation.encloses
    assert model.distance(inner_points(body)).max() <= deviation.inward
    assert body.signed_distance(points_of(model)).max() <= deviation.outward
    assert deviation.outward >= body.convex_error - 1e-9 or deviation.inward >= body.convex_error - 1e-9
    back = ConvexPieces(model.pieces).at(np.eye(4))
    assert np.allclose(back.distance(body.vertices), model.distance(body.vertices))


@pytest.mark.parametrize("name", ["mug", "bottle"])
def test_thinned_surfaces_keep_their_bound(name: str) -> None:
    body = Body.household(name)
    thin = body.simplified(800)
    assert len(thin.faces) <= 840
    deviation = body.deviation(thin)
    there = body.closest_point(np.vstack([thin.vertices, thin.vertices[thin.faces].mean(axis=1)])).distance.max()
    back = thin.index.nearest(body.sample_surface(5000, RNG(4))[0]).distance.max()
    assert there <= deviation.outward < 2.0 * there + 2e-3
    assert back <= deviation.inward < 2.0 * back + 2e-3
    same = body.simplified(10**6)
    assert body.deviation(same).hausdorff < 1e-3 * body.extents.max()
    with pytest.raises(InputError, match="faces is 3"):
        body.simplified(3)


@pytest.mark.parametrize("name", ["mug", "banana"])
def test_voxels_enclose_within_their_diagonal(name: str) -> None:
    body = Body.household(name)
    voxels = body.voxels(0.005)
    assert voxels.inside(inner_points(body)).all()
    deviation = body.deviation(voxels)
    assert deviation.encloses
    assert body.signed_distance(voxels.mesh[0]).max() <= deviation.outward <= np.sqrt(3.0) * 0.005 * 1.001
    assert SurfaceMesh(*voxels.mesh).closed
    assert SurfaceMesh(*voxels.mesh).volume == pytest.approx(voxels.volume, rel=1e-9)
    boxes = voxels.boxes()
    assert len(boxes) < 0.1 * len(voxels)
    assert np.prod(boxes.sizes, axis=1).sum() == pytest.approx(voxels.volume, rel=1e-9)
    points = RNG(5).uniform(*body.bounds, (3000, 3))
    assert np.array_equal(boxes.inside(points), voxels.inside(points))
    centred = body.voxels(0.005, "centres")
    assert 0.8 < centred.volume / body.volume < 1.2
    missed = body.deviation(centred)
    assert not missed.encloses
    outside = centred.surface.distance(inner_points(body)).max()
    assert outside <= missed.inward


def test_a_body_thinner_than_the_voxels() -> None:
    plate = Body.box([0.1, 0.1, 0.001])
    assert plate.voxels(0.01).inside(inner_points(plate)).all()
    with pytest.raises(InputError, match="no voxel is filled"):
        _ = Voxels(np.zeros(3), 0.01, np.zeros((3, 3, 3), dtype=bool)).surface
    with pytest.raises(InputError, match="rule is 'some'"):
        plate.voxels(0.01, "some")


@pytest.mark.parametrize("name", ["mug", "banana"])
def test_surfaces_of_a_field_are_closed_and_near(name: str) -> None:
    body = Body.household(name)
    field = body.distance_field(0.004)
    surface = field.surface()
    assert surface.closed
    assert body.closest_point(surface.vertices).distance.max() <= field.error
    assert surface.volume == pytest.approx(body.volume, rel=0.15)
    around = field.surface(field.error)
    assert (around.distance(inner_points(body)) < 0.0).all()
    assert Body.from_mesh(*surface.mesh, mass=1.0).watertight
    with pytest.raises(InputError, match="there is no surface at 9"):
        field.surface(9.0)


def test_an_open_mesh_is_closed_by_its_field() -> None:
    vertices, faces = shapes.sphere(0.05)
    from apprehend.bodies import DistanceField

    cut = MeshIndex(vertices, faces[vertices[faces].mean(axis=1)[:, 2] < 0.045])
    surface = DistanceField.of(cut, 0.003).surface()
    assert surface.closed
    assert surface.volume == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.05)


def test_of_an_open_surface_the_surface_is_enclosed() -> None:
    vertices, faces = shapes.sphere(0.05)
    index = MeshIndex(vertices, faces[vertices[faces].mean(axis=1)[:, 2] < 0.02])
    points = index.tree.triangles.mean(axis=1)
    for model in (Boxes.around(index, 5), Spheres.around(index, 9), Capsules.around(index, 3)):
        assert model.distance(points).max() <= 1e-9
        deviation = model.deviation(index)
        assert 0.0 < deviation.volume_excess < 3.0  # of the ball below the fan over the hole
        corners = np.concatenate([v for v, _ in model.meshes()])
        assert index.capped.closed
        assert index.capped.signed_distance(corners).max() <= deviation.outward


@pytest.mark.parametrize("kind", ["boxes", "spheres", "capsules", "convex", "voxels"])
def test_saved_models_come_back(kind: str, tmp_path: Path) -> None:
    body = Body.household("screwdriver")
    model = body.model(kind, 3)
    back = type(model).load(model.save(tmp_path / "model.npz"))
    points = inner_points(body, 200)
    assert np.array_equal(model.inside(points), back.inside(points))
    mesh = SurfaceMesh.load(model.save(tmp_path / "model.stl"))
    assert np.allclose(np.ptp(mesh.vertices, axis=0), np.ptp(model.mesh[0], axis=0), rtol=1e-5)
    with pytest.raises(MeshError, match=r"'\.txt' is not a mesh format"):
        model.save(tmp_path / "model.txt")
    with pytest.raises(InputError, match=r"expected a '(boxes|spheres)'"):
        (Spheres if kind == "boxes" else Boxes).load(tmp_path / "model.npz")


def test_shapes_are_checked(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="got 2 centres, 1 radii; expected as many of each"):
        Spheres(np.zeros((2, 3)), np.ones(1))
    with pytest.raises(InputError, match="radii contains -1"):
        Capsules(np.zeros((1, 2, 3)), np.array([-1.0]))
    with pytest.raises(InputError, match=r"sizes has shape \(3,\)"):
        Boxes(np.eye(4)[None], np.ones(3))
    with pytest.raises(InputError, match="one entry per shape"):
        Spheres(np.zeros((0, 3)), np.zeros(0))
    np.savez(tmp_path / "half.npz", kind="spheres", centres=np.zeros((1, 3)))
    with pytest.raises(InputError, match=r"half\.npz lacks 'radii': the file is damaged"):
        Spheres.load(tmp_path / "half.npz")


def test_every_model_has_a_name() -> None:
    body = Body.household("can")
    for name in MODELS:
        model = body.model(name)
        deviation = body.deviation(model)
        assert deviation.outward < 0.1
        assert str(deviation).startswith(("encloses it, sticks", "misses at most"))
    with pytest.raises(UnknownNameError, match=r"no model named 'sphere'.*'spheres'"):
        body.model("sphere")
    for bad in (0, 10_000):
        with pytest.raises(InputError, match="count is"):
            body.boxes(bad)


def test_branch_and_bound_finds_the_closed_form() -> None:
    """A ball of radius 2 about a ball of radius 1: no point is farther than 1 from it."""
    lower, upper = farthest_of_solid(
        lambda p: np.linalg.norm(p, axis=1) - 2.0,
        np.full(3, -2.1),
        np.full(3, 2.1),
        lambda p: np.linalg.norm(p, axis=1) - 1.0,
    )
    assert lower <= 1.0 <= upper
    assert upper - lower < 0.07


def test_the_part_that_sticks_out_is_cut_first() -> None:
    """A dumb-bell with one wide end: the model gets closer with every few shapes, as far as the shapes allow."""
    rod, end = Body.cylinder(0.004, 0.2), Body.sphere(0.02)
    vertices = np.concatenate([rod.vertices, end.vertices + [0.0, 0.0, 0.1], 0.6 * end.vertices - [0.0, 0.0, 0.1]])
    n = len(rod.vertices)
    faces = np.concatenate([rod.faces, end.faces + n, end.faces + n + len(end.vertices)])
    body = Body.from_mesh(vertices, faces)
    for kind in ("boxes", "spheres", "capsules"):
        out = [body.deviation(body.model(kind, count)).outward for count in (1, 4, 16)]
        assert out[1] < 0.9 * out[0]
        assert out[2] <= 1.06 * out[1]


def test_distance_from_convex_pieces_is_a_lower_bound_with_the_right_sign() -> None:
    body = Body.household("screwdriver")
    model = body.convex()
    points = RNG(6).uniform(body.bounds[0] - 0.05, body.bounds[1] + 0.05, (3000, 3))
    found = model.distance(points)
    each = [SurfaceMesh(*piece).distance(points) for piece in model.pieces]
    exact = np.min(each, axis=0)
    assert ((found <= 0.0) == (exact <= 0.0)).all()
    outside = exact > 0.0
    assert (found[outside] <= exact[outside] + 1e-12).all()
