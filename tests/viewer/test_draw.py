"""One call draws a scene, a robot, a body, a stage or bare meshes."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import Body, Robot, Scene
from apprehend.errors import InputError
from apprehend.viewer import Item, Stage, render
from apprehend.viewer.draw import stage_of

SMALL = (90, 60)


def test_everything_that_can_be_drawn() -> None:
    body, robot = Body.household("mug"), Robot.load("ur5e")
    scene = Scene.tabletop("ur5e", body=body)
    pictures = [
        render(what, size=SMALL) for what in (body, robot, scene, stage_of(body), [Item(body.vertices, body.faces)])
    ]
    assert all(p.shape == (60, 90, 3) and p.std() > 5 for p in pictures)
    assert np.array_equal(pictures[0], pictures[3])
    moved = render(robot, robot.home + 0.5, size=SMALL)
    assert np.abs(moved.astype(int) - pictures[1]).mean() > 1.0


def test_a_scene_has_its_bodies_boxes_and_goal() -> None:
    scene = Scene.tabletop("ur5e", body=Body.household("mug"))
    stage = stage_of(scene)
    assert {t.name for t in stage.bodies} == set(scene.bodies)
    assert len(stage.boxes) == len(scene.boxes)
    assert len(stage.ghosts) == len(scene.goals)


def test_what_cannot_be_drawn() -> None:
    with pytest.raises(InputError, match="cannot draw a int"):
        render(3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no robot"):
        render(Body.household("cube"), [0.0])
    with pytest.raises(InputError, match="no robot among bare meshes"):
        render([Item(np.eye(3), np.array([[0, 1, 2]]))], [0.0])
    with pytest.raises(InputError, match="nothing to draw"):
        render(Stage())
    with pytest.raises(InputError, match=r"q has shape \(2,\)"):
        render(Robot.load("ur5e"), [0.0, 0.0])
