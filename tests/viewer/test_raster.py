"""The rasteriser against a slow twin that casts one ray for each pixel, and the light it computes."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import parallel
from apprehend.kernels import raster

SIZE = 24


def draw(screen: np.ndarray, depth: np.ndarray, size: int = SIZE) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    buffers = raster.empty_buffers(size, size)
    raster.rasterise(np.ascontiguousarray(screen), np.ascontiguousarray(depth), 0, size, *buffers)
    return buffers


def pinhole(corners: np.ndarray, focal: float = 20.0) -> tuple[np.ndarray, np.ndarray]:
    """Homogeneous pixel coordinates and depths of points in camera coordinates."""
    z = corners[..., 2]
    screen = np.stack([focal * corners[..., 0] + 0.5 * SIZE * z, focal * corners[..., 1] + 0.5 * SIZE * z, z], axis=-1)
    return screen, z


def cast(corners: np.ndarray, u: float, v: float, focal: float = 20.0) -> tuple[float, int, np.ndarray]:
    """Nearest hit of the ray through pixel (u, v): depth, face, barycentric coordinates (Möller & Trumbore)."""
    ray = np.array([(u - 0.5 * SIZE) / focal, (v - 0.5 * SIZE) / focal, 1.0])
    best = (np.inf, -1, np.zeros(3))
    for t, (a, b, c) in enumerate(corners):
        M = np.stack([a, b, c], axis=1)
        if abs(np.linalg.det(M)) < 1e-12:
            continue
        weights = np.linalg.solve(M, ray)
        total = weights.sum()
        if (weights >= 0.0).all() and total > 0.0:
            z = 1.0 / total
            if z < best[0]:
                best = (z, t, weights / total)
    return best


@pytest.mark.parametrize("seed", range(5))
def test_against_one_ray_for_each_pixel(seed: int) -> None:
    """Triangles that straddle the camera's plane included."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1.0, 1.0, (12, 3, 3)) + [0.0, 0.0, 1.2]
    depth, face, bary = draw(*pinhole(corners))
    for row in range(SIZE):
        for column in range(SIZE):
            z, t, weights = cast(corners, column + 0.5, row + 0.5)
            assert face[row, column] == t
            if t >= 0:
                assert depth[row, column] == pytest.approx(z, rel=1e-9)
                assert np.allclose(bary[row, column], weights[:2], atol=1e-9)
            else:
                assert np.isinf(depth[row, column])


def test_what_lies_behind_the_camera_is_not_seen() -> None:
    corners = np.array([[[-1.0, -1.0, -2.0], [1.0, -1.0, -2.0], [0.0, 1.0, -2.0]]])
    assert (draw(*pinhole(corners))[1] == raster.EMPTY).all()


def test_a_degenerate_triangle_draws_nothing() -> None:
    corners = np.array([[[-1.0, -1.0, 2.0], [1.0, 1.0, 2.0], [0.0, 0.0, 2.0]]])
    assert (draw(*pinhole(corners))[1] == raster.EMPTY).all()


def test_two_triangles_leave_no_seam() -> None:
    square = np.array(
        [[[-2.0, -2.0, 2.0], [2.0, -2.0, 2.0], [2.0, 2.0, 2.0]], [[-2.0, -2.0, 2.0], [2.0, 2.0, 2.0], [-2.0, 2.0, 2.0]]]
    )
    assert (draw(*pinhole(square))[1] >= 0).all()


def test_rows_may_be_drawn_apart() -> None:
    rng = np.random.default_rng(3)
    screen, z = (np.ascontiguousarray(x) for x in pinhole(rng.uniform(-1.0, 1.0, (20, 3, 3)) + [0, 0, 2.0]))
    whole, halves = raster.empty_buffers(SIZE, SIZE), raster.empty_buffers(SIZE, SIZE)
    raster.rasterise(screen, z, 0, SIZE, *whole)
    for a, b in ((0, 7), (7, SIZE)):
        raster.rasterise(screen, z, a, b, *halves)
    for one, two in zip(whole, halves):
        assert np.array_equal(one, two)


def test_pictures_do_not_depend_on_the_number_of_threads() -> None:
    from apprehend import Body
    from apprehend.viewer import Item, render

    body = Body.household("mug")
    before, images = parallel.threads(), []
    for threads in (1, 3):
        parallel.set_threads(threads)
        images.append(render([Item(body.vertices, body.faces)], size=(120, 90)))
    parallel.set_threads(before)
    assert np.array_equal(*images)


def test_average() -> None:
    image = np.arange(32.0).reshape(4, 4, 2)
    out = np.empty((2, 2, 2))
    raster.average(image, 2, 0, 2, out)
    assert np.allclose(out, image.reshape(2, 2, 2, 2, 2).mean(axis=(1, 3)))


def test_spirals_fill_the_disc() -> None:
    points = raster.spirals(8, 50, 0.5)
    radius = np.linalg.norm(points, axis=-1)
    assert radius.max() <= 1.0
    assert np.mean(radius**2) == pytest.approx(0.5, abs=0.03)  # even over the disc
    assert np.abs(points.mean(axis=(0, 1))).max() < 1e-12
