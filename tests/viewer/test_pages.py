"""Live pages: they start, show the state asked for, and end."""

from __future__ import annotations

import urllib.request
from typing import Any

import numpy as np
import pytest

from apprehend import Body
from apprehend.bodies import shapes
from apprehend.errors import InputError
from apprehend.viewer import Page, show, show_body, show_grasp, show_robot
from apprehend.viewer.live import creased
from apprehend.viewer.marks import along, arrow, friction_cone, tube
from apprehend.viewer.pages import describe
from apprehend.viewer.picture import smooth_normals
from apprehend.viewer.record import Record
from apprehend.viewer.replay import Player
from apprehend.viewer.stage import Stage, body_poses, read

QUIET: dict[str, Any] = {"open_browser": False, "block": False}


@pytest.fixture
def ports() -> int:
    return 18080 + int(np.random.default_rng().integers(20_000))


def pose_of(handle: Any) -> np.ndarray:
    return body_poses([[*handle.position, *handle.wxyz]])[0]


def test_a_replay_draws_the_state_of_its_time(episode: dict[str, Any], ports: int) -> None:
    data, stage = read(episode)
    record = Record.of(data)
    assert stage.robot is not None
    with Page("test", port=ports) as page:
        page.add(stage)
        player = Player(page, stage, record, data)
        for seconds in (0.0, 1.7, 3.0):
            player.go(seconds)
            sample = record.at(seconds)
            frames = dict(zip(stage.robot.frame_names, stage.robot.fk(record.q[sample])))
            for name in page.link_names:
                assert np.allclose(pose_of(page._links[name]), frames[name], atol=1e-6)
            assert np.allclose(pose_of(page._bodies["cube"]), record.bodies["cube"][sample], atol=1e-6)
        assert "Set down" in player.now.content
        player._toggle()  # play from the end starts over
        assert player.play.label == "Pause"
        assert player.slider.value < 2.0


def test_a_page_is_served_to_this_machine_and_ends(ports: int) -> None:
    said: list[str] = []
    page = show_body(Body.household("cube"), port=ports, announce=said.append, **QUIET)
    try:
        assert said == [f"cube: {page.url}"]
        assert page.server.get_host() == "127.0.0.1"
        with urllib.request.urlopen(page.url, timeout=20) as answer:
            assert answer.status == 200
    finally:
        page.stop()
    assert page.stopped
    page.stop()  # a second time does nothing


def test_a_taken_port_means_the_next_one(ports: int, capfd: pytest.CaptureFixture[str]) -> None:
    with Page("one", port=ports) as one, Page("two", port=ports) as two:
        assert one.server.get_port() != two.server.get_port()
    assert capfd.readouterr().out == ""  # only the command line prints


def test_an_episode_by_its_path(episode: dict[str, Any], ports: int) -> None:
    with show(episode["path"], port=ports, **QUIET) as page:
        assert page.title == "arm picks <cube>"


def test_a_robot_with_its_sliders(ports: int) -> None:
    from apprehend.kinematics import Robot

    with show_robot(Robot.load("ur5e"), port=ports, **QUIET) as page:
        assert "wrist_3_link" in page.link_names


def test_a_failure_ends_the_page(ports: int) -> None:
    with pytest.raises(InputError, match="no grasps to show"):
        show_grasp(Body.household("cube"), [], None, port=ports, **QUIET)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="port is 0"):
        Page("x", port=0)


def test_grasps_of_a_cube(ports: int) -> None:
    from apprehend import grasp
    from apprehend.kinematics import Hand

    hand, cube = Hand.load("robotiq_2f_85"), Body.household("cube")
    plan = grasp.plan(hand, cube, n=5, rng=np.random.default_rng(0)).require_success()
    with show_grasp(cube, plan.candidates, hand, port=ports, **QUIET) as page:
        root = pose_of(page._links[page.link_names[0]])
        frames = dict(zip(hand.robot.frame_names, hand.robot.fk(hand.jaw.q_at(plan[0].width))))
        base = frames[hand.robot.frame_names[0]]
        expected = plan[0].pose @ np.linalg.inv(base) @ frames[page.link_names[0]]
        assert np.allclose(root, expected, atol=1e-6)


def test_grasps_of_a_hand_with_fingers(ports: int) -> None:
    from apprehend import grasp
    from apprehend.kinematics import Hand

    hand, ball = Hand.load("allegro_right"), Body.sphere(0.03, mass=0.05)
    plan = grasp.plan(hand, ball, n=1, rng=np.random.default_rng(0), samples=300).require_success()
    best = plan[0]
    assert isinstance(best, grasp.HandCandidate)
    with show_grasp(ball, plan.candidates, hand, port=ports, **QUIET) as page:
        frames = dict(zip(hand.robot.frame_names, hand.robot.fk(best.q)))
        for name in page.link_names:
            assert np.allclose(pose_of(page._links[name]), best.pose @ frames[name], atol=1e-5)
    assert f"{len(best.links)} contacts by {best.method}" in describe(best)


def test_contacts_with_their_wrench_space(ports: int) -> None:
    from scipy.spatial import ConvexHull

    from apprehend import grasp
    from apprehend.viewer import show_contacts
    from apprehend.viewer.contacts import wrench_space

    cube = Body.household("cube")
    made = grasp.Grasp.on_surface(cube, cube.com + 0.1 * np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0]]), model="soft")
    push = made.contact_forces([0, 0, -1.0, 0, 0, 0])
    with show_contacts(made, push.forces, port=ports, **QUIET) as page:
        assert {"/contacts/cone2", "/wrenches/force", "/wrenches/torque_ball"} <= set(page.handles)
    (vertices, faces), (sphere, _) = wrench_space(made, "force", np.zeros(3))
    corners = vertices[faces]
    volume = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert volume == pytest.approx(ConvexHull(vertices).volume, rel=1e-6)  # closed, faces outward
    hull = ConvexHull(vertices)
    assert (hull.equations[:, :3] @ sphere.T + hull.equations[:, 3:]).max() < 0.03 * made.length
    with pytest.raises(InputError, match="forces has shape"):
        show_contacts(made, [1.0], port=ports, **QUIET)


def test_an_episode_without_a_robot(episode: dict[str, Any], ports: int) -> None:
    data, _ = read(episode)
    with Page("x", port=ports) as page, pytest.raises(InputError, match="names no robot"):
        Player(page, Stage(), Record.of(data), data)


def test_split_vertices_give_the_browser_our_normals() -> None:
    """Averaging face normals at the split vertices is smooth on a round side and sharp at its rim."""
    vertices, faces = shapes.cylinder(0.1, 0.3)
    split, index = creased(vertices, faces)
    assert np.allclose(split[index], vertices[faces])
    a, b, c = (split[index[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    total = np.zeros_like(split)
    for k in range(3):
        np.add.at(total, index[:, k], area)
    total /= np.linalg.norm(total, axis=1)[:, None]
    assert np.einsum("fki,fki->fk", total[index], smooth_normals(vertices, faces)).min() > 0.999


def test_a_friction_cone_holds_the_forces_of_its_contact() -> None:
    point, normal, mu = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.6, 0.8]), 0.5
    vertices, _ = friction_cone(point, normal, mu, 0.05)
    rel = vertices - point
    depth = -rel @ normal
    assert depth.min() == pytest.approx(0.0, abs=1e-12)
    assert depth.max() == pytest.approx(0.05)
    sideways = np.linalg.norm(rel + depth[:, None] * normal, axis=1)
    assert np.all(sideways <= mu * depth + 1e-9)
    assert (sideways / np.maximum(depth, 1e-12)).max() == pytest.approx(mu)


def test_an_arrow_and_a_tube() -> None:
    vertices, _ = arrow([1.0, 0.0, 0.0], [0.0, 0.0, 0.5], 0.01)
    assert vertices[:, 2].max() == pytest.approx(0.5)
    assert np.allclose(vertices[:, 0].mean(), 1.0, atol=1e-9)
    assert tube(np.zeros((5, 3)), 0.01) is None
    line = np.linspace([0, 0, 0], [1, 0, 0], 50)
    mesh = tube(line, 0.01)
    assert mesh is not None
    assert np.abs(mesh[0][:, 1:]).max() == pytest.approx(0.01, rel=0.06)
    T = along([0.0, 3.0, 4.0])
    assert np.allclose(T[:3, 2], [0, 0.6, 0.8])
    assert np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3))
