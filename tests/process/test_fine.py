"""The closer look: it takes out what the fixed cameras' calibration put in, and leaves what it does not see."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import Scene
from apprehend.process import Context, Locate, LocateByState, Process, Refine, StepStatus, pick_and_place, shuffled
from apprehend.process.fine import fused
from apprehend.process.pipeline import run_step
from apprehend.spatial import Rotation


def at_the_standoff(scene: Scene, locate: object, seed: int) -> Context:
    """The run up to the step before the closer look."""
    process = Process.default().replaced("locate", locate)
    context = Context.begin(scene, np.random.default_rng(seed))
    for step in process.steps[: process.index("refine")]:
        record, _ = run_step(step, context)
        assert record.status is StepStatus.SUCCESS, record.message
    return context


@pytest.mark.parametrize(("name", "seed"), [("mug", 1), ("bottle", 2), ("can", 3)])
def test_an_error_of_calibration_is_taken_out(name: str, seed: int) -> None:
    scene = shuffled(Scene.tabletop(body=name), seed)
    context = at_the_standoff(scene, Locate(calibration=(0.004, 0.01)), seed)
    outcome = Refine().run(context)
    assert outcome.success
    assert not outcome.skipped, outcome.message
    assert outcome.margins["error_before"] > 1e-3
    assert outcome.margins["error"] < 0.4 * outcome.margins["error_before"]
    standoff = context.robot.fk(context.q, context.hand.root)  # the hand went along with the correction
    wanted = context.robot.fk(context.chosen.approach[0], context.hand.root)
    assert np.abs(standoff - wanted).max() < 1e-3


def test_the_grasp_holds_after_a_correction() -> None:
    process = Process.default().replaced("locate", Locate(calibration=(0.006, 0.01)))
    episode = pick_and_place(Scene.tabletop(body="mug"), seed=1, process=process)
    assert episode.require_success()


def test_a_pose_that_is_known_exactly_is_kept() -> None:
    context = at_the_standoff(Scene.tabletop(body="can"), LocateByState(), 0)
    before = context.pose
    assert Refine().run(context).skipped
    assert context.pose is before


def test_two_estimates_are_combined_as_gaussians() -> None:
    rng = np.random.default_rng(0)
    com = rng.normal(size=3)
    one = np.eye(4)
    one[:3, :3], one[:3, 3] = Rotation.random(rng).matrix, rng.normal(size=3)
    roots = rng.normal(size=(2, 6, 6))
    A, B = roots @ roots.transpose(0, 2, 1)
    other = one.copy()
    other[:3, :3] = Rotation.exp([1e-3, -2e-3, 3e-3]).matrix @ one[:3, :3]
    shift = np.array([0.01, -0.02, 0.03])
    other[:3, 3] = one[:3, :3] @ com + one[:3, 3] + shift - other[:3, :3] @ com
    delta = np.concatenate([shift, [1e-3, -2e-3, 3e-3]])
    pose, covariance, distance = fused(com, one, A, other, B)
    information = np.linalg.inv(A) + np.linalg.inv(B)
    step = np.linalg.solve(information, np.linalg.solve(B, delta))
    assert covariance == pytest.approx(np.linalg.inv(information), rel=1e-8)
    assert (pose - one) @ np.append(com, 1.0) == pytest.approx([*step[:3], 0.0], abs=1e-12)
    assert Rotation(pose[:3, :3] @ one[:3, :3].T).log() == pytest.approx(step[3:], abs=1e-12)
    assert distance == pytest.approx(delta @ np.linalg.solve(A + B, delta))


def test_a_certain_estimate_outweighs_an_uncertain_one() -> None:
    one, other = np.eye(4), np.eye(4)
    other[0, 3] = 0.1
    sure, unsure = 1e-8 * np.eye(6), np.eye(6)
    assert fused(np.zeros(3), one, sure, other, unsure)[0] == pytest.approx(one, abs=1e-6)
    assert fused(np.zeros(3), one, unsure, other, sure)[0] == pytest.approx(other, abs=1e-6)
