"""Strange MuJoCo models: moved and mirrored meshes, ellipsoids, height fields, mocap bodies, riders; there and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from apprehend import sim
from apprehend.bodies import Body
from apprehend.collision import CollisionModel, Convex, Scene
from apprehend.robots import read_world, shape_surface

HILL = " ".join(["0 1 2 3 1", "0 2 5 3 0", "1 2 2 0 0", "0 1 0 1 4"])

MODEL = f"""<mujoco model="strange"><compiler angle="degree" eulerseq="ZYX"/>
<asset><mesh name="ring" file="wedge.obj" scale="-0.1 0.12 0.08"/>
 <mesh name="moved" file="wedge.obj" scale="0.05 0.05 0.05" refpos="0.2 0.1 0" refquat="0.7 0.7 0.1 0"/>
 <hfield name="hill" nrow="4" ncol="5" size="0.4 0.3 0.1 0.05" elevation="{HILL}"/></asset>
<worldbody>
 <geom name="floor" type="plane" size="0 0 .1" pos="0 0 -0.5" euler="0 5 0"/>
 <geom name="hill" type="hfield" hfield="hill" pos="1.2 0.3 -0.3" euler="20 0 10"/>
 <geom name="egg" type="ellipsoid" size=".1 .2 .05" pos="-.5 .5 .3" euler="10 20 30"/>
 <body name="shelf" pos="0.5 -0.6 0.2" euler="0 0 30"><geom type="box" size=".2 .1 .01"/>
  <body name="nested" pos="0 0 .1" euler="0 45 0"><geom name="ring" type="mesh" mesh="ring"/></body></body>
 <body name="goal" mocap="true" pos=".7 .7 .7" euler="0 0 45"><geom type="box" size=".05 .06 .07"/></body>
 <body name="loose" pos=".4 .5 .3" euler="30 20 0"><freejoint/><geom name="lens" type="mesh" mesh="moved" mass=".2"/>
  <body name="rider" pos="0 .05 0"><geom type="box" size=".02 .01 .01" mass=".9"/></body></body>
 <body name="l1" pos="0 0 .1"><joint name="j1" axis="0 0 1" range="-170 170" limited="true"/>
  <geom type="capsule" fromto="0 0 0 0 0 .3" size=".04"/>
  <body name="l2" pos="0 0 .3"><joint name="j2" axis="0 1 0" range="-120 120" limited="true" ref="10"/>
   <geom name="long" type="ellipsoid" size=".2 .03 .03" pos=".15 0 0"/></body></body>
</worldbody><actuator><motor joint="j1"/><motor joint="j2"/></actuator></mujoco>"""


@pytest.fixture
def strange(tmp_path: Path) -> Path:
    ball = Body.sphere(1.0)
    Body.from_mesh(ball.vertices * [1.0, 0.6, 0.4] + 0.2 * ball.vertices[:, [1, 2, 0]], ball.faces).save(
        tmp_path / "wedge.obj"
    )
    path = tmp_path / "strange.xml"
    path.write_text(MODEL)
    return path


def test_meshes_are_where_the_engine_has_them(strange: Path) -> None:
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(strange))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    world = read_world(strange)
    mine = {thing.name: shape_surface(thing.shape)[0] for thing in world.fixed if thing.name == "ring" and thing.shape}
    loose = next(body for body in world.bodies if body.name == "loose")
    local = shape_surface(loose.shapes[0])[0]
    mine["lens"] = local @ loose.pose[:3, :3].T + loose.pose[:3, 3]
    for name, vertices in mine.items():
        g = model.geom(name).id
        k = int(model.geom_dataid[g])
        own = model.mesh_vert[model.mesh_vertadr[k] : model.mesh_vertadr[k] + model.mesh_vertnum[k]]
        placed = own @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g]
        assert cKDTree(placed).query(vertices)[0].max() < 1e-6, name


def test_ellipsoids_are_ellipsoids(strange: Path) -> None:
    scene = Scene.from_mujoco(strange)
    (egg,) = scene.obstacles["egg"].shapes
    assert isinstance(egg, Convex)
    np.testing.assert_allclose(egg.size, [0.1, 0.2, 0.05])
    shape = scene.robot.description.links["l2"].collisions[0]
    around = np.linalg.norm((shape_surface(shape)[0] - [0.15, 0.0, 0.0]) / [0.2, 0.03, 0.03], axis=1)
    assert around.min() >= 1.0
    assert around.max() < 1.02


def test_distances_and_masses_survive_a_file_and_the_engine(strange: Path, tmp_path: Path) -> None:
    scene = Scene.from_mujoco(strange)
    assert set(scene.obstacles) == {"floor", "hill", "egg", "ring"}
    assert [box.name for box in scene.boxes] == ["shelf", "goal"]
    q = np.random.default_rng(1).uniform(scene.robot.limits.lower, scene.robot.limits.upper, (100, 2))
    before = CollisionModel(scene.robot, scene).distance(q)
    saved = Scene.load(scene.save(tmp_path / "scene.toml"))
    assert 'arm = "strange.xml"' in (tmp_path / "scene.toml").read_text()
    np.testing.assert_allclose(CollisionModel(saved.robot, saved).distance(q), before, atol=1e-12)
    back = Scene.from_mujoco(sim.to_mujoco(scene, tmp_path / "back.xml"))
    after = CollisionModel(back.robot, back).distance(q)
    np.testing.assert_allclose(after[before > 0.0], before[before > 0.0], atol=2e-5)  # digits of the XML
    assert ((after > 0.0) == (before > 0.0)).all()
    for other, tolerance in ((saved.bodies["loose"], 1e-12), (back.bodies["body:loose"], 1e-5)):
        body = scene.bodies["loose"]
        np.testing.assert_allclose(other.pose, body.pose, atol=1e-6)
        np.testing.assert_allclose(other.body.com, body.body.com, atol=tolerance)
        np.testing.assert_allclose(other.body.inertia, body.body.inertia, atol=tolerance * 1e-2)
        assert other.body.mass == pytest.approx(body.body.mass)
        assert other.body.torsional_friction == body.body.torsional_friction
