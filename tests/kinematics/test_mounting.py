"""Where hands sit on a flange when nobody says it."""

import numpy as np
import pytest

from apprehend import Hand, Robot, Scene
from apprehend.kinematics.mounting import INSIDE, mounting
from apprehend.robots import link_surface


@pytest.mark.parametrize("name", ["robotiq_2f_85", "schunk_egk40", "allegro_right", "g1_right_hand", "pr2_gripper"])
def test_fingers_point_away_from_the_flange_and_the_palm_is_before_it(name: str) -> None:
    if name not in ("robotiq_2f_85", "schunk_egk40"):
        pytest.importorskip("cmeel", reason="the extra [robots] is not installed")
    robot = Robot.load(name)
    hand, T = Hand(robot), mounting(robot)
    assert np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3))
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
    q = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
    tips = np.mean([T @ robot.fk(q, f.tip) @ np.append(f.tip_point, 1.0) for f in hand.fingers], axis=0)
    assert np.argmax(np.abs(tips[:3])) == 2
    assert tips[2] > 0.0
    for link in robot.frame_names:
        points, _ = link_surface(robot.description.links[link], visual=False)
        if len(points) and not robot.chain(link):
            placed = T @ robot.fk(q, link)
            assert (points @ placed[2, :3] + placed[2, 3]).min() > -INSIDE


def test_grippers_with_their_frame_on_the_flange_stay_there() -> None:
    assert np.array_equal(mounting(Robot.load("robotiq_2f_85")), np.eye(4))


def test_a_hand_takes_the_place_of_the_arms_own() -> None:
    pytest.importorskip("cmeel", reason="the extra [robots] is not installed")
    scene = Scene.tabletop("panda", "robotiq_2f_85", body="can")
    assert "panda_leftfinger" not in scene.robot.frame_names
    q = scene.robot.home
    bare, own = Robot.load("panda_arm"), Robot.load("panda")
    arm = bare.fk(q[: bare.n], "panda_link8")
    assert np.allclose(scene.robot.fk(q, scene.hand.root)[:3, 3], arm[:3, 3])
    hand = own.fk(np.append(q[: bare.n], np.zeros(own.n - bare.n)), "panda_hand")
    assert np.allclose(scene.robot.fk(q, scene.hand.root)[:3, 2], hand[:3, 2])
