"""Models of bodies and of links are drawn in space and on pages."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from apprehend import Body, Robot
from apprehend.bodies import MODELS
from apprehend.bodies.mass import solid
from apprehend.bodies.topology import is_closed
from apprehend.errors import InputError
from apprehend.kinematics import link_models
from apprehend.viewer import render, show_body, show_robot
from apprehend.viewer.models import rods, things

SMALL = (90, 60)


def test_every_model_is_drawn_in_space() -> None:
    body = Body.household("can")
    plain = render(body, size=SMALL).astype(int)
    for name in MODELS:
        model = body.model(name, resolution=0.006)
        picture = render(model, size=SMALL)
        assert picture.shape == (60, 90, 3)
        assert picture.std() > 4
        if name != "surface":
            assert np.abs(render(body, model=model, size=SMALL) - plain).max() > 8
    for model in (body.section(normal=[1.0, 0.0, 0.0]), body.silhouette(), body.distance_field(0.006)):
        assert render(model, size=SMALL).std() > 2
    assert np.array_equal(render(body, model="boxes", size=SMALL), render(body, model=body.boxes(), size=SMALL))


def test_models_of_links_are_drawn_where_the_links_are() -> None:
    robot = Robot.load("ur5e")
    models = link_models(robot, "boxes")
    home, other = render(models, size=SMALL), render(models, robot.home + 0.5, size=SMALL)
    assert np.abs(home.astype(int) - other).mean() > 1.0
    over = render(robot, model=models, size=SMALL)
    assert np.array_equal(over, render(robot, model="boxes", size=SMALL))
    assert np.abs(over.astype(int) - render(robot, size=SMALL)).max() > 8


def test_rods_are_closed_and_as_long_as_their_lines() -> None:
    ends = np.random.default_rng(0).normal(size=(7, 2, 3))
    vertices, faces = rods(ends, 1e-3)
    assert is_closed(faces)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
    assert solid(vertices, faces).volume == pytest.approx(2e-6 * length, rel=0.01)
    with pytest.raises(InputError, match="no lines to draw"):
        rods(np.zeros((3, 2, 3)))


def test_what_has_no_model() -> None:
    with pytest.raises(InputError, match="a int has none"):
        render(3, model="boxes")
    with pytest.raises(InputError, match="the plane misses the body"):
        things(Body.household("can").section([0.0, 0.0, 9.0]))
    with pytest.raises(InputError, match="model is 'nothing'"):
        show_body(Body.household("can"), model="nothing")


def test_pages_show_models() -> None:
    quiet: dict[str, Any] = {
        "open_browser": False,
        "block": False,
        "port": 28080 + np.random.default_rng().integers(9000),
    }
    with show_body(Body.household("can"), model="capsules", **quiet) as page:
        assert any(name.startswith("/bodies/can/model") for name in page.handles)
    robot = Robot.load("ur5e")
    with show_robot(robot, models=link_models(robot, "spheres", 3), **quiet) as page:
        plain = show_robot(robot, **quiet)
        assert len(page.handles) > len(plain.handles)
        plain.stop()
