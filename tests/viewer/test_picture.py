"""Pictures: what is in them, where, and how light."""

from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image as Pillow

from apprehend import Body
from apprehend.bodies import shapes
from apprehend.errors import InputError
from apprehend.viewer import Camera, Item, jpeg, png
from apprehend.viewer.picture import _axes, corners_of, render, smooth_normals

RED = (0.8, 0.1, 0.1, 1.0)


def project(camera: Camera, points: np.ndarray, aspect: float) -> np.ndarray:
    """Picture coordinates in [−1, 1]² of what is inside."""
    right, down, forward = _axes(camera.target - camera.eye)
    rel = points - camera.eye
    k = np.tan(camera.field_of_view / 2.0)
    z = rel @ forward
    assert (z > 0.0).all()
    return np.stack([rel @ right / (k * aspect * z), rel @ down / (k * z)], axis=-1)


@given(st.integers(0, 10_000))
def test_a_camera_sees_all_points_and_is_as_near_as_that_allows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(20, 3)) * rng.uniform(0.01, 1.0, 3)
    aspect = rng.uniform(0.5, 2.0)
    camera = Camera.around(
        points, azimuth=rng.uniform(-3, 3), elevation=rng.uniform(-0.2, 1.4), aspect=aspect, margin=1.0
    )
    seen = np.abs(project(camera, points, aspect))
    nearest = float(((points - camera.eye) @ _axes(camera.target - camera.eye)[2]).min())
    assert seen.max() <= 1.0 + 1e-6
    assert seen.max() == pytest.approx(1.0, abs=1e-6) or nearest == pytest.approx(1e-3)  # no point behind the camera
    x, y = project(camera, points, aspect).T
    tight = [abs(v.min() + 1) < 1e-6 and abs(v.max() - 1) < 1e-6 for v in (x, y)]
    assert any(tight)


def test_a_red_box_in_the_middle() -> None:
    image = render([Item(*shapes.box([0.1, 0.1, 0.1]), rgba=RED)], size=(90, 60))
    assert image.shape == (60, 90, 3)
    assert image.dtype == np.uint8
    r, g, b = image[30, 45].astype(int)
    assert r > 2 * g
    assert r > 2 * b
    edge = image[2, 2].astype(int)
    assert np.ptp(edge) < 20  # the backdrop has no colour
    assert edge.min() > 150


def test_the_nearer_thing_hides_the_other() -> None:
    camera = Camera(np.array([0.0, -1.0, 0.0]), np.zeros(3))
    far, near = np.eye(4), np.eye(4)
    far[1, 3], near[1, 3] = 0.2, -0.2
    box = shapes.box([0.2, 0.1, 0.2])
    items = [Item(*box, pose=near, rgba=RED), Item(*box, pose=far, rgba=(0.1, 0.1, 0.8, 1.0))]
    for order in (items, items[::-1]):
        r, _, b = render(order, camera, size=(60, 60), floor=False)[30, 30].astype(int)
        assert r > 2 * b


def test_a_translucent_thing_lets_the_other_through() -> None:
    camera = Camera(np.array([0.0, -1.0, 0.0]), np.zeros(3))
    far, near = np.eye(4), np.eye(4)
    far[1, 3], near[1, 3] = 0.2, -0.2
    box = shapes.box([0.2, 0.1, 0.2])
    blue = Item(*box, pose=far, rgba=(0.1, 0.1, 0.8, 1.0))
    r, _, b = render([blue, Item(*box, pose=near, rgba=(*RED[:3], 0.5))], camera, size=(60, 60), floor=False)[
        30, 30
    ].astype(int)
    assert r > 60
    assert b > 60
    hidden = Item(*box, pose=far, rgba=(*RED[:3], 0.5))  # behind a solid thing it is not seen
    solid = Item(*box, pose=near, rgba=(0.1, 0.1, 0.8, 1.0))
    alone = render([solid], camera, size=(60, 60), floor=False)
    assert np.array_equal(
        render([solid, hidden], camera, size=(60, 60), floor=False)[25:35, 25:35], alone[25:35, 25:35]
    )


def test_a_thing_above_the_ground_casts_a_shadow() -> None:
    ball = Item(*shapes.sphere(0.05), pose=np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.05], [0, 0, 0, 1.0]]))
    focus = np.array([-0.2, -0.2, 0.0]), np.array([0.2, 0.2, 0.1])
    camera = Camera(np.array([0.0, -0.05, 1.0]), np.zeros(3))
    with_shadow = render([ball], camera, size=(120, 120), focus=focus).astype(int)
    without = render([Item(ball.vertices, ball.faces, ball.pose, shadow=False)], camera, size=(120, 120), focus=focus)
    darker = (without.astype(int) - with_shadow).max(axis=2) > 25
    assert 100 < darker.sum() < 3000
    # the sun is on the camera's left: the shadow falls to the right
    assert np.argwhere(darker)[:, 1].mean() > 65


def test_refusals() -> None:
    with pytest.raises(InputError, match="nothing to draw"):
        render([])
    with pytest.raises(InputError, match=r"size is \(0, 100\)"):
        render([Item(*shapes.box([1, 1, 1]))], size=(0, 100))
    with pytest.raises(InputError, match="pose of an item"):
        render([Item(*shapes.box([1, 1, 1]), pose=np.ones((4, 4)))])


def test_normals_are_smooth_where_the_surface_is() -> None:
    vertices, faces = shapes.box([1, 1, 1])
    normals = smooth_normals(vertices, faces)
    assert np.allclose(np.abs(normals).max(axis=-1), 1.0)  # edges of a box stay sharp
    vertices, faces = shapes.sphere(1.0)
    normals = smooth_normals(vertices, faces)
    assert np.einsum("fki,fki->fk", normals, vertices[faces]).min() > 0.999
    # vertices that an exporter has split count as one
    soup = smooth_normals(vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3))
    assert np.allclose(soup, normals, atol=1e-9)


def test_files() -> None:
    body = Body.household("cube")
    image = render([Item(body.vertices, body.faces)], size=(64, 48))
    assert np.array_equal(np.asarray(Pillow.open(io.BytesIO(png(image)))), image)
    close = np.asarray(Pillow.open(io.BytesIO(jpeg(image)))).astype(int)
    assert np.abs(close - image).mean() < 3.0


def test_corners_of_a_box() -> None:
    corners = corners_of(np.zeros(3), np.array([1.0, 2.0, 3.0]))
    assert len({tuple(c) for c in corners.tolist()}) == 8
    assert np.allclose(corners.mean(axis=0), [0.5, 1.0, 1.5])
