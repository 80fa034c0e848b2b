"""Resting poses: closed forms, a peer, and the definition itself on a grid of directions."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from apprehend import Body
from apprehend.bodies import shapes
from apprehend.bodies.repair import solid_angles
from apprehend.errors import InputError


def hull_body(seed: int, n: int = 12) -> Body:
    """A random convex polyhedron, with the centre of mass of its even density."""
    from apprehend.bodies.convex import hull

    rng = np.random.default_rng(seed)
    return Body.from_mesh(*hull(rng.normal(size=(n, 3)) * [0.03, 0.02, 0.04]), mass=1.0)


def rectangle_share(a: float, b: float, h: float) -> float:
    """Solid angle over 4π of a rectangle 2a × 2b seen from height h above its middle."""
    return float(np.arctan(a * b / (h * np.sqrt(a * a + b * b + h * h))) / np.pi)


def test_box_in_closed_form() -> None:
    size = np.array([0.1, 0.2, 0.3])
    poses = Body.box(size, mass=1.0).stable_poses()
    assert len(poses) == 6
    for pose in poses:
        axis = int(np.abs(pose.up).argmax())
        a, b = np.delete(size, axis) / 2
        h = size[axis] / 2
        assert pose.probability == pytest.approx(rectangle_share(a, b, h), rel=1e-9)
        assert pose.tip_angle == pytest.approx(np.arctan(min(a, b) / h), rel=1e-9)
        assert pose.tip_rise == pytest.approx(np.hypot(min(a, b), h) - h, rel=1e-9)
        assert pose.com_height == pytest.approx(h)


@given(st.integers(0, 500))
def test_every_pose_rests_on_the_plane(seed: int) -> None:
    body = hull_body(seed)
    poses = body.stable_poses(roughness=0.0)
    assert sum(p.probability for p in poses) == pytest.approx(1.0)
    assert [p.probability for p in poses] == sorted((p.probability for p in poses), reverse=True)
    for pose in poses:
        R = pose.pose[:3, :3]
        assert np.allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) > 0
        placed = body.vertices @ R.T + pose.pose[:3, 3]
        assert placed[:, 2].min() == pytest.approx(0.0, abs=1e-12)
        assert (placed[:, 2] < 1e-9).sum() >= 3
        assert np.allclose((R @ body.com + pose.pose[:3, 3]), [0, 0, pose.com_height], atol=1e-9)
        support = placed[placed[:, 2] < 1e-9, :2]
        corners = np.vstack([support, support + 1e-9])  # the foot is within the support polygon
        assert np.all(corners.min(axis=0) <= 1e-8)
        assert np.all(corners.max(axis=0) >= -1e-8)


def share_that_falls_over_a_corner(body: Body) -> float:
    """Solid angle over 4π of the faces whose point nearest to the foot of the centre of mass is a corner.

    There the fall has no single edge to go over, and the two implementations may choose differently.
    """
    triangles = body.triangles - body.com
    normals = body.face_normals
    feet = np.einsum("ij,ij->i", triangles[:, 0], normals)[:, None] * normals
    nearest = trimesh.triangles.closest_point(triangles, feet)
    corner = (np.linalg.norm(triangles - nearest[:, None], axis=2) < 1e-9).any(axis=1)
    return float(np.abs(solid_angles(triangles))[corner].sum() / (4 * np.pi))


@pytest.mark.parametrize("seed", range(8))
def test_probabilities_agree_with_trimesh(seed: int) -> None:
    body = hull_body(seed, 10)
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    transforms, chances = trimesh.poses.compute_stable_poses(mesh, center_mass=body.com, sigma=0.0, n_samples=1)
    ours = body.stable_poses(roughness=0.0)
    doubt = share_that_falls_over_a_corner(body)
    assert doubt < 0.2
    for T, chance in zip(transforms, chances):
        match = [p for p in ours if np.allclose(p.up, T[2, :3], atol=1e-6)]
        assert len(match) == 1
        assert match[0].probability == pytest.approx(chance, abs=doubt + 1e-9)


def basins_on_a_grid(body: Body, downs: np.ndarray) -> np.ndarray:
    """Rise of the lowest way from each pose to another, by flooding H(u) over an icosphere of directions."""
    sphere = trimesh.creation.icosphere(subdivisions=6)
    u = np.asarray(sphere.vertices)
    H = ((body.vertices - body.com) @ u.T).max(axis=0)
    neighbours = sphere.vertex_neighbors
    owner = {int(np.argmax(u @ d)): k for k, d in enumerate(downs)}
    root, holds, rise = {}, {}, np.full(len(downs), np.inf)

    def find(i: int) -> int:
        while root[i] != i:
            root[i] = root[root[i]]
            i = root[i]
        return i

    for i in np.argsort(H).tolist():
        root[i], holds[i] = i, {owner[i]} if i in owner else set()
        for j in neighbours[i]:
            if j in root and (a := find(i)) != (b := find(j)):
                if holds[a] and holds[b]:
                    for k in holds[a] | holds[b]:
                        rise[k] = min(rise[k], H[i])
                root[a] = b
                holds[b] |= holds[a]
    return rise


@pytest.mark.parametrize("seed", range(4))
def test_tip_rise_is_the_lowest_saddle_of_the_height(seed: int) -> None:
    body = hull_body(seed, 9)
    poses = body.stable_poses(roughness=0.0)
    saddle = basins_on_a_grid(body, np.array([-p.up for p in poses]))
    for pose, height in zip(poses, saddle):
        excess = height - (pose.com_height + pose.tip_rise)  # a path over grid points goes a little over the saddle
        assert -1e-4 * body.radius < excess < 0.02 * body.radius


def test_a_round_side_is_one_pose() -> None:
    can = Body.cylinder(0.033, 0.1, mass=0.3)
    poses = can.stable_poses()
    assert len(poses) == 3
    lying = [p for p in poses if abs(p.up[2]) < 1e-9]
    assert len(lying) == 1
    assert lying[0].probability == pytest.approx(0.05 / np.hypot(0.05, 0.033), rel=2e-3)
    assert len(can.stable_poses(roughness=0.0)) == 66
    standing = next(p for p in poses if p.up[2] > 0.9)
    assert standing.tip_angle == pytest.approx(np.arctan(0.033 / 0.05), rel=2e-3)


def test_a_ball_rests_anyhow() -> None:
    poses = Body.sphere(0.03).stable_poses()
    assert len(poses) == 1
    assert poses[0].probability == pytest.approx(1.0)
    assert poses[0].tip_angle == pytest.approx(np.pi)


def test_a_low_centre_of_mass_rights_itself() -> None:
    """A tumbler: a ball weighted at the bottom always comes to stand upright, on one of the facets down there."""
    tumbler = Body.from_mesh(*shapes.sphere(0.03), mass=0.1, com=[0, 0, -0.02])
    assert all(p.up[2] > 0.98 for p in tumbler.stable_poses(roughness=0.0))
    (pose,) = tumbler.stable_poses()
    assert pose.tip_angle == pytest.approx(np.pi)


def test_filters_and_arguments() -> None:
    body = Body.box([0.1, 0.2, 0.3])
    assert len(body.stable_poses(min_probability=0.1)) == 4
    assert len(body.stable_poses(min_tip_angle=1.0)) == 2
    with pytest.raises(InputError, match=r"roughness is -1\.0"):
        body.stable_poses(roughness=-1.0)
