"""Pinhole camera, depth images, noise."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.errors import InputError
from apprehend.perception import Camera, DepthImage, Noise, look_at


def plane_image(z: float = 0.8) -> DepthImage:
    camera = Camera.from_fov(160, 120)
    return DepthImage(np.full((120, 160), z), camera, np.eye(4))


def test_rays_and_projection_are_inverse() -> None:
    camera = Camera(64, 48, 50.0, 60.0, 30.0, 25.0)
    points = camera.rays * np.random.default_rng(0).uniform(0.2, 2.0, (48, 64, 1))
    image = camera.project(points)
    assert image[..., 0] == pytest.approx(np.broadcast_to(np.arange(64) + 0.5, (48, 64)))
    assert image[..., 1] == pytest.approx(np.broadcast_to(np.arange(48)[:, None] + 0.5, (48, 64)))


def test_field_of_view_is_horizontal() -> None:
    camera = Camera.from_fov(640, 480, np.radians(60.0))
    edge = camera.project([np.tan(np.radians(30.0)), 0.0, 1.0])
    assert edge == pytest.approx([640.0, 240.0])


def test_look_at_puts_the_target_in_the_middle() -> None:
    camera = Camera.from_fov()
    for eye, target in (([1.0, 0.2, 0.7], [0.4, 0.0, 0.0]), ([0.0, 0.0, 1.0], [0.0, 0.0, 0.0])):
        T = look_at(eye, target)
        assert T[:3, :3].T @ T[:3, :3] == pytest.approx(np.eye(3))
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
        local = T[:3, :3].T @ (np.array(target) - T[:3, 3])
        assert camera.project(local) == pytest.approx([320.0, 240.0])
    up = look_at([1.0, 0.2, 0.7], [0.4, 0.0, 0.0])[:3, 1] @ [0, 0, 1]
    assert up < 0.0  # y of the image points down


def test_points_are_in_the_world() -> None:
    pose = look_at([0.3, 0.2, 1.0], [0.3, 0.2, 0.0])
    image = DepthImage(np.full((120, 160), 0.8), Camera.from_fov(160, 120), pose)
    assert image.points()[..., 2] == pytest.approx(0.2)
    known = np.zeros((120, 160), bool)
    known[:10] = True
    assert DepthImage(image.depth, image.camera, pose, known).valid.sum() == 110 * 160


def test_noise_has_its_deviation_and_repeats() -> None:
    image, noise = plane_image(1.4), Noise(dropout=0.01)
    one = image.with_noise(np.random.default_rng(3), noise)
    two = image.with_noise(np.random.default_rng(3), noise)
    assert np.array_equal(one.depth, two.depth)
    seen = one.depth > 0.0
    assert 1.0 - seen.mean() == pytest.approx(0.01, abs=0.004)
    assert (one.depth - 1.4)[seen].std() == pytest.approx(0.0007 + 0.0019, rel=0.05)
    assert (one.depth - 1.4)[seen].mean() == pytest.approx(0.0, abs=1e-4)


def test_grazing_surfaces_give_no_return() -> None:
    camera = Camera.from_fov(160, 120)
    below = np.maximum(camera.rays[..., 1], 1e-6)
    floor = DepthImage(
        np.where(camera.rays[..., 1] > 0.02, 0.05 / below, 0.0), camera, np.eye(4)
    )  # 5 cm below the lens
    noisy = floor.with_noise(np.random.default_rng(0), Noise(dropout=0.0, lateral=0.0))
    angle = np.arctan(camera.rays[..., 1]) * np.ones((120, 160))
    inside = (floor.depth > 0.0) & (angle < np.radians(7.0)) & (angle > np.radians(2.5))
    assert (noisy.depth[inside] == 0.0).mean() > 0.95
    assert (noisy.depth[angle > np.radians(12.0)] > 0.0).all()


def test_bad_input_is_named() -> None:
    with pytest.raises(InputError, match="fx is -1"):
        Camera(4, 4, -1.0, 1.0, 2.0, 2.0)
    with pytest.raises(InputError, match="expected at least 1"):
        Camera(0, 4, 1.0, 1.0, 2.0, 2.0)
    with pytest.raises(InputError, match="the principal point is"):
        Camera(4, 4, 1.0, 1.0, np.inf, 2.0)
    with pytest.raises(InputError, match="fov is 4"):
        Camera.from_fov(fov=4.0)
    with pytest.raises(InputError, match="only points in front"):
        Camera.from_fov().project([0.0, 0.0, -1.0])
    camera = Camera.from_fov(8, 6)
    with pytest.raises(InputError, match=r"depth has shape \(8, 6\); the camera makes images of \(6, 8\)"):
        DepthImage(np.ones((8, 6)), camera, np.eye(4))
    with pytest.raises(InputError, match="it is positive, or 0"):
        DepthImage(np.full((6, 8), -1.0), camera, np.eye(4))
    with pytest.raises(InputError, match="known has shape"):
        DepthImage(np.ones((6, 8)), camera, np.eye(4), np.ones((2, 2), bool))
    with pytest.raises(InputError, match="pose has shape"):
        DepthImage(np.ones((6, 8)), camera, np.tile(np.eye(4), (2, 1, 1)))
    with pytest.raises(InputError, match="the same point"):
        look_at([1.0, 0.0, 0.0], [1.0, 0.0, 0.0])
