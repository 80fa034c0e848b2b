"""Contacts of the physics engine as grasps."""

import mujoco
import numpy as np
import pytest

from apprehend.errors import InputError, UnknownNameError
from apprehend.grasp import ContactModel, Limits, hand_jacobian
from apprehend.sim import held, simulated

VICE = """<mujoco>
  <option timestep="0.001" gravity="0 0 -9.81" cone="elliptic" impratio="20"/>
  <worldbody>
    <body name="left" pos="-0.05 0 0"><joint name="a" type="slide" axis="1 0 0"/>
      <geom type="box" size="0.01 0.01 0.01" mass="0.2" friction="0.8 0.01 0" condim="{dim}"/></body>
    <body name="right" pos="0.05 0 0"><joint name="b" type="slide" axis="-1 0 0"/>
      <geom type="box" size="0.01 0.01 0.01" mass="0.2" friction="0.8 0.01 0" condim="{dim}"/></body>
    <body name="thing" pos="0 0 0" euler="0 0 5"><freejoint/>
      <geom type="sphere" size="0.039" mass="0.3" friction="0.8 0.01 0" condim="{dim}"/></body>
  </worldbody>
  <actuator><motor joint="a" gear="1"/><motor joint="b" gear="1"/></actuator>
  <keyframe><key ctrl="20 20"/></keyframe>
</mujoco>"""


def vice(tmp_path, dim=4):
    path = tmp_path / "vice.xml"
    path.write_text(VICE.format(dim=dim))
    return path


@pytest.mark.parametrize(
    ("dim", "model"), [(1, ContactModel.FRICTIONLESS), (3, ContactModel.COULOMB), (4, ContactModel.SOFT)]
)
def test_a_ball_in_a_vice(tmp_path, dim, model):
    found = simulated(vice(tmp_path, dim), "thing", 1.0 if dim > 1 else 0.05)
    grasp = found.grasp
    assert sorted(found.touching) == ["left", "right"]
    assert [c.model for c in grasp.contacts] == [model, model]
    assert grasp.force_closure().success == (dim == 4)
    points = np.array([c.position for c in grasp.contacts]) @ found.pose[:3, :3].T + found.pose[:3, 3]
    np.testing.assert_allclose(sorted(points[:, 0]), [-0.039, 0.039], atol=3e-3)
    for contact, point in zip(grasp.contacts, points, strict=True):
        inward = found.pose[:3, :3] @ contact.normal
        assert inward[0] * point[0] < 0.0  # into the ball
    for contact, s in zip(grasp.contacts, grasp.slices, strict=True):
        assert contact.slack(found.forces[s]) > -1e-6
        if dim > 1:
            assert found.forces[s][2] == pytest.approx(20.0, rel=0.05)
    if dim > 1:
        assert grasp.contacts[0].friction == pytest.approx(0.8)
    if dim == 4:
        assert grasp.contacts[0].torsion == pytest.approx(0.01)
        weight = found.pose[:3, :3].T @ [0.0, 0.0, -0.3 * 9.81]
        np.testing.assert_allclose(found.wrench[:3], -weight, atol=0.1)  # at rest the contacts bear the weight
        least = grasp.contact_forces(np.append(weight, np.zeros(3)), "min_normal", Limits(normal=20.0))
        assert least.success
        assert least.value < 40.0


def test_the_wrench_is_what_the_engine_applies(tmp_path):
    """Against the engine's own generalised forces of the contacts."""
    model = mujoco.MjModel.from_xml_string(VICE.format(dim=4))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qvel[model.jnt_dofadr[2] :][:6] = [0.3, 0.1, -0.2, 1.0, -2.0, 3.0]  # sliding and spinning
    for _ in range(20):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    found = held(model, data, "thing")
    at = model.jnt_dofadr[2]
    # of a free joint: force in the world, torque in the body, about the body's frame (here the centre of mass)
    want = data.qfrc_constraint[at : at + 6]
    np.testing.assert_allclose(found.pose[:3, :3] @ found.wrench[:3], want[:3], atol=1e-9)
    np.testing.assert_allclose(found.wrench[3:], want[3:], atol=1e-9)
    assert (found.depth > -1e-3).all()
    one = held(model, data, "thing", by=["left"])
    assert one.touching == ("left",)


def test_the_jaw_of_a_hand_in_a_world():
    from apprehend.bodies import Body
    from apprehend.sim import held_in
    from tests.sim.scenes import hold

    rig = hold("panda", Body.box([0.04, 0.03, 0.025], mass=0.2), 20.0)
    rig.world.run(0.3, rig.arm, rig.gripper)
    before = rig.world.snapshot()
    hand = rig.rig.hand
    found = held_in(rig.world, "object", hand.jaw.pad_links)
    np.testing.assert_array_equal(rig.world.snapshot(), before)  # looking changes nothing
    assert set(found.touching) == set(hand.jaw.pad_links)
    assert found.grasp.force_closure().success
    np.testing.assert_allclose(found.pose, rig.world.body_pose("object"))
    total = sum(found.forces[s][2] for s in found.grasp.slices)
    assert total == pytest.approx(40.0, rel=0.05)
    J = hand_jacobian(rig.rig.robot, rig.world.q, found.grasp, found.touching, found.pose)
    assert J.shape == (found.grasp.matrix.shape[1], rig.rig.robot.n)
    with pytest.raises(UnknownNameError, match="no movable body named 'objekt'"):
        held_in(rig.world, "objekt")


def test_bad_questions_are_named(tmp_path):
    path = vice(tmp_path)
    with pytest.raises(UnknownNameError, match="no body named 'thin' in the model"):
        simulated(path, "thin")
    with pytest.raises(InputError, match="nothing touches 'thing' at 0"):
        simulated(path, "thing")
    with pytest.raises(InputError, match="none of 'thing' touches 'left'"):
        simulated(path, "left", by=["thing"])
    with pytest.raises(InputError, match="no such file"):
        simulated(tmp_path / "other.xml", "thing")
    with pytest.raises(InputError, match="time is -1"):
        simulated(path, "thing", -1.0)
    bad = tmp_path / "bad.xml"
    bad.write_text("<mujoco><worldbody><geom type='blob'/></worldbody></mujoco>")
    with pytest.raises(InputError, match="not a model that the engine takes"):
        simulated(bad, "thing")
