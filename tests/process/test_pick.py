"""The whole process, in physics: it places real objects, repeats itself, and says what went wrong when it cannot."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import Body, Robot, Scene
from apprehend.errors import InputError, UnknownNameError
from apprehend.process import (
    Context,
    Episode,
    EpisodeStatus,
    Outcome,
    Process,
    StepStatus,
    pick_and_place,
    shuffled,
)
from apprehend.process.grasping import Close


@pytest.fixture(scope="module")
def can() -> Episode:
    return pick_and_place(Scene.tabletop(body="can"), seed=3)


def test_a_can_is_placed(can: Episode) -> None:
    assert can.require_success()
    assert can.verdict.position_error < 0.015
    assert can.verdict.angle_error < np.radians(10.0)
    assert can.verdict.slip < 0.002


def test_every_step_is_on_record(can: Episode) -> None:
    names = [step.name for step in can.steps]
    assert names == [step.name for step in Process.default().steps]
    assert all(step.status is StepStatus.SUCCESS and step.message and step.duration >= 0 for step in can.steps)
    assert sum(step.simulated for step in can.steps) > 3.0


def test_the_motion_keeps_the_limits(can: Episode) -> None:
    limits = {k: np.asarray(v) for k, v in can.recording["limits"].items()}
    q, qd, tau = (np.asarray(can.recording[k]) for k in ("q", "qd", "tau"))
    arm = list(can.recording["arm"])
    assert (q[:, arm] >= limits["lower"][arm] - 1e-4).all()
    assert (q[:, arm] <= limits["upper"][arm] + 1e-4).all()
    assert (np.abs(qd[:, arm]) <= limits["velocity"][arm] + 1e-3).all()
    assert (np.abs(tau) <= limits["effort"] + 1e-3).all()


def test_the_object_really_flew(can: Episode) -> None:
    heights = np.asarray(can.recording["bodies"]["can"])[:, 2]
    assert heights.max() - heights[0] > 0.1
    assert abs(heights[-1] - heights[0]) < 2e-3


def test_the_same_seed_gives_the_same_episode(can: Episode) -> None:
    again = pick_and_place(Scene.tabletop(body="can"), seed=3)
    assert np.array_equal(again.recording["q"], can.recording["q"])
    assert again.verdict == can.verdict


def test_another_robot_and_a_random_task() -> None:
    pytest.importorskip("cmeel", reason="the extra [robots] is not installed")
    episode = pick_and_place(shuffled(Scene.tabletop("panda", body="screwdriver"), 5), seed=5)
    assert episode.require_success()


def test_what_is_too_wide_is_said() -> None:
    episode = pick_and_place(Scene.tabletop(body=Body.box([0.2, 0.2, 0.2], mass=0.5, name="crate")))
    assert episode.status is EpisodeStatus.FAILED_STEP
    assert episode.steps[-1].name == "plan"
    assert "wid" in episode.verdict.reason


def test_what_is_out_of_reach_is_said() -> None:
    scene = Scene.tabletop(body="can")
    far = scene.bodies["can"].pose.copy()
    far[:2, 3] = (1.6, 0.0)
    floor = scene.box("table")
    scene = scene.without("table").with_box(type(floor)("table", np.array([4.0, 4.0, 0.04]), floor.pose))
    episode = pick_and_place(scene.moved("can", far))
    assert episode.status is EpisodeStatus.FAILED_STEP
    assert "out of reach" in episode.verdict.reason


def test_too_heavy_is_said() -> None:
    heavy = Body.box([0.05, 0.05, 0.1], mass=60.0, name="anvil")
    episode = pick_and_place(Scene.tabletop("ur5e", body=heavy))
    assert not episode.success
    assert episode.steps[-1].name == "plan"


class Blind:
    """A locate step that sees nothing."""

    name = "locate"
    title = "Look"

    def run(self, context: Context) -> Outcome:
        return Outcome(False, "the camera is covered")


def test_steps_can_be_replaced() -> None:
    process = Process.default().replaced("locate", Blind())
    episode = pick_and_place(Scene.tabletop(body="can"), process=process)
    assert episode.verdict.reason == "Look failed: the camera is covered"
    with pytest.raises(UnknownNameError, match="Did you mean 'locate'"):
        process.replaced("localte", Blind())


class Clumsy(Close):
    """Closing that fails the first time."""

    failures = 1

    def run(self, context: Context) -> Outcome:
        if Clumsy.failures:
            Clumsy.failures -= 1
            return Outcome(False, "the fingers slipped off", retry=True)
        return super().run(context)


def test_after_a_failed_grasp_another_one_is_tried() -> None:
    Clumsy.failures = 1
    process = Process.default().replaced("close", Clumsy())
    episode = pick_and_place(Scene.tabletop(body="can"), seed=1, process=process)
    assert episode.require_success()
    names = [step.name for step in episode.steps]
    assert names.count("plan") == 2
    assert names.count("close") == 2
    first, second = (step.outputs["pose"] for step in episode.steps if step.name == "plan")
    assert not np.allclose(first, second)


def test_a_scene_without_a_task_is_refused() -> None:
    scene = Scene.tabletop(body="can")
    with pytest.raises(InputError, match=r"no task.*with_task"):
        pick_and_place(scene.without("can"))
    with pytest.raises(InputError, match="expected a Scene"):
        pick_and_place(Robot.load("ur5e"))  # type: ignore[arg-type]


def test_what_is_fixed_cannot_be_picked() -> None:
    scene = Scene.tabletop(body="can")
    placed = scene.bodies["can"]
    with pytest.raises(InputError, match="movable = false"):
        pick_and_place(scene.with_body("can", placed.body, placed.pose, movable=False))


def test_shuffled_tasks_rest_on_the_table_apart() -> None:
    scene = Scene.tabletop(body="bottle")
    name = scene.pick or ""
    for seed in range(20):
        task = shuffled(scene, seed)
        body = task.bodies[name].body
        for pose in (task.bodies[name].pose, task.goals[name]):
            lowest = (body.vertices @ pose[2, :3] + pose[2, 3]).min()
            assert abs(lowest) < 1e-9
        assert np.linalg.norm(task.bodies[name].pose[:2, 3] - task.goals[name][:2, 3]) > 0.1
