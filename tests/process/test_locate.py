"""Seeing: the located pose is near the truth, and turned as described where images leave the turn open."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import Body, Scene
from apprehend.process import Context, shuffled
from apprehend.process.locate import Locate, LocateByState, as_described
from apprehend.spatial import Rotation


@pytest.mark.parametrize("name", ["mug", "bottle", "can", "apple"])
@pytest.mark.parametrize("seed", [1, 2])
def test_the_object_is_found_where_it_is(name: str, seed: int) -> None:
    scene = shuffled(Scene.tabletop(body=name), seed)
    context = Context.begin(scene, np.random.default_rng(seed))
    outcome = Locate().run(context)
    assert outcome.success, outcome.message
    assert outcome.margins["error"] < 0.003
    assert outcome.margins["turn"] < np.radians(3.0)


def test_an_object_that_was_moved_is_still_found() -> None:
    scene = Scene.tabletop(body="mug")
    context = Context.begin(scene, np.random.default_rng(0))
    pose = context.world.body_pose("mug")
    pose[:2, 3] += (0.05, -0.04)
    context.world.set_body_pose("mug", pose)
    assert Locate().run(context).margins["error"] < 0.003


def test_an_absent_object_is_said() -> None:
    scene = Scene.tabletop(body="can")
    context = Context.begin(scene, np.random.default_rng(0))
    far = context.world.body_pose("can")
    far[0, 3] -= 0.9  # behind the robot
    context.world.set_body_pose("can", far)
    outcome = Locate().run(context)
    assert not outcome.success
    assert context.pose is None


def test_perfect_perception_reads_the_simulator() -> None:
    context = Context.begin(Scene.tabletop(body="can"), np.random.default_rng(0))
    assert LocateByState().run(context).success
    assert np.array_equal(context.pose, context.world.body_pose("can"))


def test_the_open_turn_of_a_cylinder_is_the_described_one() -> None:
    body = Body.cylinder(0.03, 0.1, mass=0.3)
    described, pose = np.eye(4), np.eye(4)
    pose[:3, :3] = (Rotation.basic("x", 0.1) @ Rotation.basic("z", 2.0)).matrix
    covariance = np.diag([1e-8, 1e-8, 1e-8, 1e-6, 1e-6, 1.0])
    axis = pose[:3, 2]
    covariance[3:, 3:] = 1e-6 * np.eye(3) + np.outer(axis, axis)
    found = as_described(body, pose, described, covariance)
    assert found[:3, 2] == pytest.approx(pose[:3, 2], abs=1e-9)  # the axis stays
    assert Rotation(found[:3, :3]).angle_to(Rotation(described[:3, :3])) == pytest.approx(0.1, abs=1e-9)


def test_the_turn_of_a_mug_is_never_changed() -> None:
    mug = Body.household("mug")
    pose = np.eye(4)
    pose[:3, :3] = Rotation.basic("z", 2.0).matrix
    covariance = np.diag([1e-8] * 5 + [1e-2])
    assert np.array_equal(as_described(mug, pose, np.eye(4), covariance), pose)
