"""Postures side by side: as many panels as joint vectors, each as `render` draws it."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import viewer
from apprehend.errors import InputError

from ..ik.makers import chain


def test_panels_differ_where_the_postures_do() -> None:
    from apprehend import Robot

    robot = Robot.load("ur5e")
    q = np.stack([robot.home, robot.home, robot.home + 0.5])
    image = viewer.render_postures(robot, q, ("a", "b", "c"), target=robot.fk(robot.home, "tool0"), size=(120, 100))
    assert image.shape == (100, 360, 3)
    first, second, third = image[40:, :120], image[40:, 120:240], image[40:, 240:]
    assert np.array_equal(first, second)
    assert np.abs(first.astype(int) - third).max() > 50


def test_bad_arguments_are_named() -> None:
    robot = chain("RRR")
    with pytest.raises(InputError, match="2 captions for 1 postures"):
        viewer.render_postures(robot, robot.home, ("a", "b"))
    with pytest.raises(InputError, match="a picture shows 1 to 64"):
        viewer.render_postures(robot, np.zeros((0, 3)))
