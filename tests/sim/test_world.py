"""State, contacts, settling and recording."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.errors import InputError, UnknownNameError
from apprehend.sim import JointController, SettleStatus, World

from .scenes import pendulum, scene, slip, table, translation


def block(**options: float) -> Body:
    return Body.box([0.08, 0.06, 0.04], mass=0.5, **options)


def test_a_resting_body_is_carried_by_its_weight() -> None:
    world = World(scene(pendulum(), boxes=(table(),), block=(block(), translation(0.5, 0.6, 0.021))))
    assert world.settle().require_success().status is SettleStatus.SUCCESS
    force = world.contact_force("block", "table")
    assert force == pytest.approx([0.0, 0.0, 0.5 * 9.81, 0.0, 0.0, 0.0], abs=1e-3)
    assert world.contact_force("block") == pytest.approx(force)
    assert world.contact_force("block", ["arm", "base"]) == pytest.approx(np.zeros(6))
    touches = world.contacts("block", "table")
    assert len(touches) >= 3
    assert sum(t.normal_force for t in touches) == pytest.approx(0.5 * 9.81, rel=1e-3)
    signs = [1.0 if t.second == "block" else -1.0 for t in touches]
    assert all(sign * t.frame[2, 2] == pytest.approx(1.0) for sign, t in zip(signs, touches, strict=True))
    assert sum(sign * t.force[2] for sign, t in zip(signs, touches, strict=True)) == pytest.approx(0.5 * 9.81, rel=1e-3)
    assert not world.contacts("block", "arm")


def test_torque_of_a_contact_force_is_about_the_given_point() -> None:
    world = World(scene(pendulum(), boxes=(table(),), block=(block(), translation(0.5, 0.6, 0.021))))
    world.settle()
    wrench = world.contact_force("block", about=[0.0, 0.0, 0.0])
    x, y, _ = world.body_pose("block")[:3, 3]
    assert wrench[3:] == pytest.approx(np.cross([x, y, 0.0], [0.0, 0.0, 0.5 * 9.81]), abs=2e-3)


def test_sliding_friction_slows_with_mu_g() -> None:
    mu, v0 = 0.4, 1.0
    world = World(scene(pendulum(), boxes=(table(),), block=(block(friction=mu), translation(-0.5, 0.6, 0.02))))
    world.settle()
    world.data.qvel[world.model.jnt_dofadr[world.model.body_jntadr[world.plant.bodies["block"]]]] = v0
    start = world.body_pose("block")[0, 3]
    world.settle(time_limit=2.0).require_success()
    assert world.body_pose("block")[0, 3] - start == pytest.approx(v0**2 / (2 * mu * 9.81), rel=0.03)


def test_a_snapshot_brings_back_the_same_future() -> None:
    world = World(scene(pendulum(), boxes=(table(),), block=(block(), translation(0.5, 0.6, 0.1))))
    world.run(0.1)
    state = world.snapshot()
    world.run(0.3)
    first = world.body_pose("block"), world.q
    world.restore(state)
    assert world.time == pytest.approx(0.1)
    world.run(0.3)
    assert np.array_equal(world.body_pose("block"), first[0])
    assert np.array_equal(world.q, first[1])


def test_settling_reports_what_still_moves() -> None:
    world = World(scene(pendulum(), block=(block(), translation(0.5, 0.6, 0.1))))
    result = world.settle(time_limit=0.2)
    assert result.status is SettleStatus.MOVING
    assert result.body == "block"
    assert result.speed == pytest.approx(9.81 * 0.2, rel=1e-3)
    assert "'block' moved with" in result.explain()


def test_settling_holds_the_robot() -> None:
    world = World(scene(pendulum(), boxes=(table(-0.6),), block=(block(), translation(0.5, 0.6, -0.57))))
    world.set_q([0.3])
    world.settle().require_success()
    assert world.q == pytest.approx([0.3], abs=1e-6)


def test_a_body_is_put_where_it_is_told() -> None:
    world = World(scene(pendulum(), block=(block(), translation(0.5, 0.6, 0.1))))
    T = translation(0.1, 0.2, 0.3)
    T[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    world.set_body_pose("block", T)
    assert max(slip(T, world.body_pose("block"))) < 1e-12
    assert world.body_velocity("block") == pytest.approx(np.zeros(6))


def test_recording_has_the_rate_and_the_forces() -> None:
    world = World(scene(pendulum(), boxes=(table(),), block=(block(), translation(0.5, 0.6, 0.02))))
    with pytest.raises(InputError, match="nothing was recorded"):
        world.recording()
    world.record(50.0)
    world.run(1.0, JointController(world))
    found = world.recording()
    assert found.time == pytest.approx(np.arange(51) / 50.0, abs=world.timestep)
    assert found.q.shape == found.qd.shape == found.tau.shape == (51, 1)
    assert found.poses["block"].shape == (51, 4, 4)
    assert found.other_force["block"][-1] == pytest.approx([0, 0, 0.5 * 9.81, 0, 0, 0], abs=1e-2)
    assert found.robot_force["block"][-1] == pytest.approx(np.zeros(6))
    assert np.array_equal(found.poses["block"][-1], world.body_pose("block"))
    assert found.tau[-1] == pytest.approx([-2.0 * 9.81 * 0.5], rel=1e-6)  # carries its own weight
    with pytest.raises(InputError, match="rate is 0"):
        world.record(0)


def test_names_that_do_not_exist() -> None:
    world = World(scene(pendulum(), block=(block(), np.eye(4))))
    with pytest.raises(UnknownNameError, match=r"no movable body named 'blok'.* Did you mean 'block'"):
        world.body_pose("blok")
    with pytest.raises(UnknownNameError, match="no link named 'ar'"):
        world.frame("ar")
    with pytest.raises(UnknownNameError, match="no link, body or box named 'x'"):
        world.contacts("block", "x")
    with pytest.raises(InputError, match="q has shape"):
        world.set_q([0.0, 1.0])
    with pytest.raises(InputError, match=r"pose has shape \(2, 4, 4\)"):
        world.set_body_pose("block", np.tile(np.eye(4), (2, 1, 1)))
    with pytest.raises(InputError, match="duration is -1"):
        world.run(-1.0)
