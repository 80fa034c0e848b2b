"""The process with a hand of four fingers on an arm, in physics."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import Grasp, Scene
from apprehend.grasp import Contact
from apprehend.process import Episode, Process, StepStatus, pick_and_place
from apprehend.process.grasping import PlanGrasp

pytest.importorskip("cmeel", reason="the extra [robots] is not installed")


@pytest.fixture(scope="module")
def apple() -> Episode:
    scene = Scene.tabletop("ur5e", "allegro_right", body="apple")
    few = Process.default(scene.hand).replaced("plan", PlanGrasp(samples=96))
    return pick_and_place(scene, seed=2, process=few)


def test_four_fingers_place_an_apple(apple: Episode) -> None:
    assert apple.require_success()
    assert apple.verdict.slip < 2e-3
    heights = np.asarray(apple.recording["bodies"]["apple"])[:, 2]
    assert heights.max() - heights[0] > 0.1


def test_the_steps_are_those_of_fingers(apple: Episode) -> None:
    hand = Scene.tabletop("ur5e", "allegro_right", body="apple").hand
    steps = [step.name for step in Process.default(hand).steps]
    assert sorted(steps) == sorted(step.name for step in Process.default().steps)
    assert steps.index("preshape") < steps.index("reach")
    done = [step.name for step in apple.steps if step.status is not StepStatus.FAILED]
    assert [name for name in steps if name in done] == steps


def test_joints_press_within_their_efforts_with_contacts_that_close(apple: Episode) -> None:
    tau = np.abs(np.asarray(apple.recording["tau"]))
    assert (tau <= np.asarray(apple.recording["limits"]["effort"]) + 1e-3).all()
    close = apple.step("close")
    assert close.margins["closure"] > 0.0
    assert close.margins["slack"] > 0.0  # no contact force on the wall of its friction cone
    assert len(close.outputs["links"]) >= 2
    plan = apple.step("plan")
    contacts = [
        Contact(point, normal, 0.55) for point, normal in
        zip(plan.outputs["contacts"], plan.outputs["normals"], strict=True)
    ]  # fmt: skip
    assert Grasp(contacts).force_closure().success


def test_the_fingers_carry_the_weight(apple: Episode) -> None:
    rate = apple.step("rate")
    assert rate.margins["carried"] == pytest.approx(1.0, abs=0.05)
    assert sum(force > 0.0 for force in rate.outputs["forces"]) >= 2
