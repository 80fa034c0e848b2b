"""Pages and pictures of planned paths."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.collision import Box, CollisionModel, RobotSource, Scene
from apprehend.errors import InputError
from apprehend.viewer import render_path, show_path
from apprehend.viewer.along import FAR, PathFacts, along, tool_of
from apprehend.viewer.draw import stage_of
from apprehend.viewer.paths import PathPlayer, _hidden, summary
from apprehend.viewer.stage import body_poses
from tests.collision.makers import planar, pose

PATH = np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.5, 1.0]])


def test_places_along_a_path() -> None:
    half = np.sqrt(0.5)
    np.testing.assert_allclose(along(PATH, 0.0), PATH[0])
    np.testing.assert_allclose(along(PATH, 1.0), PATH[-1])
    np.testing.assert_allclose(along(PATH, half / (1.0 + half)), PATH[1], atol=1e-12)
    np.testing.assert_allclose(along(PATH, 2.0), PATH[-1])
    np.testing.assert_array_equal(along(PATH[:1], 0.3), PATH[0])


def test_the_slider_moves_the_robot() -> None:
    robot = planar(3)
    port = 18080 + int(np.random.default_rng().integers(20_000))
    scene = Scene(robot, RobotSource("in code"), boxes=(Box("wall", np.array([0.1, 0.1, 0.4]), pose(0.9, 0.9)),))
    with show_path(scene, PATH, "tip", port=port, open_browser=False, block=False) as page:
        assert page.title == "path of planar"
        assert "/way" in page.handles
        assert "/surroundings/wall/mesh" in page.handles
    with show_path(robot, PATH, port=port, open_browser=False, block=False) as page:
        player = PathPlayer(page, stage_of(robot), PathFacts.of(robot, PATH, "tip"))
        for share in (0.0, 0.6, 1.0):
            player.go(share)
            frames = dict(zip(robot.frame_names, robot.fk(along(PATH, share))))
            for name in page.link_names:
                handle = page._links[name]
                np.testing.assert_allclose(body_poses([[*handle.position, *handle.wxyz]])[0], frames[name], atol=1e-6)
        assert f"{np.degrees(PATH[-1, 2]):.1f} °" in player.now.content
        player.slider.value = 100.0
        player.toggle()  # play from the end starts over
        assert player.slider.value == 0.0
        assert player.play.label == "Pause"
        player.toggle()


def test_what_is_near_along_a_path() -> None:
    robot = planar(3)
    scene = Scene(robot, RobotSource("in code"), boxes=(Box("wall", np.array([0.1, 0.1, 0.4]), pose(0.9, 0.9)),))
    model = CollisionModel(robot, scene)
    facts = PathFacts.of(robot, PATH, "tip", model)
    assert facts.length == pytest.approx(np.sqrt(0.5) + 1.0)
    assert facts.turned == pytest.approx(2.0)
    near = facts.near[0]
    assert near.label == "to the surroundings"
    assert {names[1] for names in near.names} | {names[0] for names in near.names} >= {"wall"}
    for k in (0, 40, near.least):
        parts = model.distances(facts.q[k])
        expected = min(d for names, d in zip(parts.names, parts.distance) if "wall" in names)
        assert near.distance[k] == pytest.approx(min(expected, FAR), abs=1e-9)
        if expected < FAR:
            assert near.distance[k] == pytest.approx(np.linalg.norm(np.diff(near.points[k], axis=0)), abs=1e-6)
    assert near.distance[near.least] < FAR
    dense = robot.fk(np.array([along(PATH, s) for s in np.linspace(0.0, 1.0, 5000)]), "tip")[:, :3, 3]
    assert facts.way == pytest.approx(np.linalg.norm(np.diff(dense, axis=0), axis=1).sum(), rel=1e-3)
    assert "wall" in summary(facts)
    assert f"{1e3 * near.distance[near.least]:.1f} mm" in summary(facts)
    assert [chart.title for chart in facts.charts()] == ["Nearest distance", "Joint angles"]


def test_a_wall_hides_what_is_behind_it() -> None:
    wall = np.array([[[0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 2.0]]])
    points = np.array([[1.0, 0.0, 0.0], [-0.5, 0.0, 0.0], [1.0, 5.0, 0.0], [0.0, 0.0, 0.0]])
    assert _hidden(points, np.array([-1.0, 0.0, 0.0]), wall).tolist() == [True, False, False, False]


def test_a_picture_shows_the_way() -> None:
    robot = planar(3)
    still, moved = (render_path(robot, path, size=(96, 64)).astype(int) for path in (PATH[-1:], PATH))
    assert still.shape == (64, 96, 3)
    orange = (moved[..., 0] - moved[..., 2]) > 60
    assert orange.sum() > 5
    assert tool_of(robot) == "tip"


def test_bad_paths_are_named() -> None:
    with pytest.raises(TypeError, match="pages have no option 'prot'; there are port, host"):
        show_path(planar(3), PATH, prot=3)  # type: ignore[call-arg]
    with pytest.raises(InputError, match="path has shape"):
        render_path(planar(3), np.zeros((2, 2)))
    with pytest.raises(InputError, match="no robot that could follow"):
        render_path(Body.household("cube"), PATH)
