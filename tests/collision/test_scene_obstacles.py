"""Obstacles and allowed pairs in scenes, in scene files, and from and to MuJoCo models."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apprehend import sim
from apprehend.bodies import Body
from apprehend.collision import Cloud, CollisionModel, Convex, HalfSpace, Obstacle, Scene, Union, signed_distance
from apprehend.errors import ApprehendError, DescriptionError, InputError, UnknownNameError
from tests.collision.makers import pose, rotation

HEAD = '[robot]\narm = "ur5e"\n'


def cell(extra: str = "", keyframe: bool = True) -> str:
    key = '<keyframe><key name="home" qpos="{}"/></keyframe>'.format(".6 .1 .55 1 0 0 0 .3 .4 .1") if keyframe else ""
    return f"""<mujoco model="cell"><option gravity="0 0 -3.7"/>
<asset><mesh name="wedge" vertex="0 0 0 .2 0 0 0 .2 0 0 0 .3"/>
 <hfield name="hill" nrow="4" ncol="5" size=".5 .6 .2 .05" elevation="{" ".join(["0 1 2 1 0"] * 4)}"/></asset>
<worldbody>
 <geom name="floor" type="plane" size="0 0 1" pos="0 0 -.1"/>
 <geom name="table" type="box" size=".3 .4 .02" pos=".6 0 .4" friction=".7 .01 .01"/>
 <geom name="edge" type="mesh" mesh="wedge" pos=".5 .5 .5"/><geom name="hill" type="hfield" hfield="hill" pos="-2 0 0"/>
 <geom name="seen" type="sphere" size="5" contype="0" conaffinity="0"/>
 <body name="pillar" pos="-.5 0 0"><geom name="post" type="cylinder" size=".05 .5"/></body>
 <body name="can" pos=".6 0 .5"><freejoint/><geom type="cylinder" size=".03 .05" mass=".3"/>
  <body pos="0 0 .05"><geom type="sphere" size=".03" mass=".05"/></body></body>
 <body name="arm" pos="0 0 .1"><joint name="j1" axis="0 0 1" range="-3 3" limited="true"/>
  <geom type="capsule" fromto="0 0 0 0 0 .4" size=".05"/>
  <body name="fore" pos="0 0 .4"><joint name="j2" axis="0 1 0" range="-2 2" limited="true"/>
   <geom type="capsule" fromto="0 0 0 .4 0 0" size=".04"/></body></body>
 <body name="door" pos="2 0 0"><joint name="hinge" axis="0 0 1"/><geom name="leaf" type="box" size=".4 .02 .5"/></body>
</worldbody><actuator><motor joint="j1"/><motor joint="j2"/></actuator>
<contact><exclude body1="world" body2="arm"/></contact>{key}{extra}</mujoco>"""


def test_a_scene_of_a_mujoco_model_touches_what_mujoco_touches(tmp_path: Path) -> None:
    import mujoco

    path = tmp_path / "cell.xml"
    path.write_text(cell())
    model = mujoco.MjModel.from_xml_path(str(path))
    for source in (path, str(path), model):
        scene = Scene.from_mujoco(source)
        assert scene.robot.joint_names == ("j1", "j2")
        np.testing.assert_allclose(scene.robot.home, [0.3, 0.4])
        assert [box.name for box in scene.boxes] == ["table", "leaf"]
        assert scene.box("table").friction == 0.7
        assert set(scene.obstacles) == {"floor", "edge", "hill", "post"}
        assert scene.gravity == pytest.approx(3.7)
        assert ("floor", "arm") in {tuple(sorted(p, reverse=True)) for p in scene.allowed}
        can = scene.placed_body("can")
        np.testing.assert_allclose(can.pose[:3, 3], [0.6, 0.1, 0.55])
        assert can.body.mass == pytest.approx(0.35)
        np.testing.assert_allclose(can.body.com, [0.0, 0.0, 0.05 * 0.05 / 0.35], atol=1e-9)
        left = [repair.where for repair in scene.robot.description.repairs]
        assert any("'door'" in where for where in left)
        # contacts of random configurations, and distances by the engine
        check = CollisionModel(scene.robot, scene)
        rng = np.random.default_rng(0)
        q = rng.uniform(scene.robot.limits.lower, scene.robot.limits.upper, (60, 2))
        data, mine = mujoco.MjData(model), check.distance(q)
        fore = model.body("fore").id
        geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == fore]
        others = [
            g for g in range(model.ngeom)
            if model.geom_bodyid[g] not in (fore, model.body("arm").id) and model.geom(g).name not in ("seen", "hill")
        ]  # fmt: skip
        for value, q_i in zip(mine, q, strict=True):
            mujoco.mj_resetDataKeyframe(model, data, 0)
            data.qpos[model.joint("j1").qposadr[0]], data.qpos[model.joint("j2").qposadr[0]] = q_i
            mujoco.mj_kinematics(model, data)
            least = min(mujoco.mj_geomDistance(model, data, g, o, 10.0, np.zeros(6)) for g in geoms for o in others)
            if value > 0.0 or least > 0.0:
                assert value == pytest.approx(least, abs=2e-3)  # the can's round sides are facets here


def test_robots_of_a_model_can_be_chosen(tmp_path: Path) -> None:
    path = tmp_path / "cell.xml"
    path.write_text(cell())
    scene = Scene.from_mujoco(path, robot="door")
    assert scene.robot.joint_names == ("hinge",)
    assert "arm" not in scene.robot.frame_names
    kept = scene.save(tmp_path / "door.toml")
    assert Scene.load(kept).robot.joint_names == ("hinge",)
    with pytest.raises(UnknownNameError, match="Did you mean 'door'"):
        Scene.from_mujoco(path, robot="doors")
    with pytest.raises(DescriptionError, match="'pillar' has no joints"):
        Scene.from_mujoco(path, robot="pillar")
    path.write_text('<mujoco><worldbody><body><freejoint/><geom size=".1"/></body></worldbody></mujoco>')
    with pytest.raises(DescriptionError, match="there is no robot"):
        Scene.from_mujoco(path)
    with pytest.raises(InputError, match="source is a int"):
        Scene.from_mujoco(3)
    with pytest.raises(DescriptionError, match="does not exist"):
        Scene.from_mujoco(tmp_path / "none.xml")


def test_a_model_in_memory_cannot_be_named_in_a_file(tmp_path: Path) -> None:
    import mujoco

    scene = Scene.from_mujoco(mujoco.MjModel.from_xml_string(cell()))
    with pytest.raises(InputError, match="a model in memory"):
        scene.save(tmp_path / "scene.toml")


def test_to_mujoco_and_back(tmp_path: Path) -> None:
    try:
        scene = Scene.tabletop("ur5e", body="can")
    except ApprehendError as error:
        pytest.skip(str(error))
    pillar = Convex.capsule(0.05, 0.6).at(pose(0.4, 0.4, 0.3))
    scene = scene.with_obstacle("ground", HalfSpace.through([0.0, 0.0, -0.72])).with_obstacle("pillar", pillar)
    scene = scene.with_obstacle("seen", Cloud.of([[1.0, 1.0, 1.0]])).allowing(("wrist_1_link", "pillar"))
    back = Scene.from_mujoco(sim.to_mujoco(scene, tmp_path / "table.xml"))
    assert back.robot.n == scene.robot.n
    np.testing.assert_allclose(back.robot.home, scene.robot.home, atol=1e-5)
    assert set(back.bodies) == {"body:can"}
    assert {"obstacle:ground", "obstacle:pillar"} == set(back.obstacles)
    q = np.random.default_rng(1).uniform(-2.0, 2.0, (80, scene.robot.n))
    lower, upper = scene.robot.limits.lower, scene.robot.limits.upper
    q = np.clip(q, lower, upper)
    mine = CollisionModel(scene.robot, scene.without("seen").allowing())
    theirs = CollisionModel(back.robot, back)
    np.testing.assert_allclose(theirs.robot.fk(q, "link:wrist_3_link"), mine.robot.fk(q, "wrist_3_link"), atol=1e-5)
    # the engine leaves out a few pairs of links more: those that always touch there
    plain = [tuple(name.split(":")[1] for name in p) for p in theirs.allowed]
    assert ("pillar", "wrist_1_link") in [tuple(sorted(p)) for p in plain]
    one, other = mine.allow(p for p in plain if set(p) <= set(mine.names)).distance(q), theirs.distance(q)
    np.testing.assert_allclose(one[one > 0.0], other[one > 0.0], atol=1e-4)
    assert ((one > 0.0) == (other > 0.0)).all()
    world = sim.World(scene)
    assert any("obstacle seen" in sentence and "Cloud" in sentence for sentence in world.plant.assumptions)


def test_obstacles_of_every_kind_survive_a_file(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    box = Body.box([0.1, 0.2, 0.3], name="brick")
    things: dict[str, object] = {
        "ground": HalfSpace.through([0.0, 0.0, -1.0], [0.1, 0.0, 1.0]),
        "box": Convex.box([0.1, 0.2, 0.3]),
        "ball": Convex.sphere(0.1),
        "pin": Convex.capsule(0.05, 0.4),
        "post": Convex.cylinder(0.05, 0.4),
        "tip": Convex.cone(0.05, 0.4),
        "egg": Convex.ellipsoid([0.1, 0.2, 0.3]),
        "rock": Convex.hull(rng.normal(size=(20, 3)) * 0.1, 0.01),
        "cloud": Cloud.of(rng.normal(size=(30, 3)), 0.01),
        "parts": Union.of([Convex.box([0.1, 0.1, 0.1]), Convex.hull(rng.normal(size=(9, 3)))]),
        "skin": Union.surface(box.vertices, box.faces),
        "field": box.distance_field(0.02),
        "several": [Convex.sphere(0.1), Convex.box([0.1, 0.1, 0.1])],
    }
    scene = Scene.tabletop("ur5e", body="can")
    for name, thing in things.items():
        scene = scene.with_obstacle(name, thing, pose(*rng.normal(size=3), rotation(rng)))
    scene = scene.allowing(("ground", "base_link_inertia"), ("ground", "shoulder_link"))
    again = Scene.load(scene.save(tmp_path / "all.toml"))
    twice = Scene.load(again.save(tmp_path / "again" / "all.toml"))
    probe, T = Convex.box([0.2, 0.1, 0.1]), np.array([pose(*rng.normal(size=3), rotation(rng)) for _ in range(8)])
    for other in (again, twice):
        assert other.allowed == scene.allowed
        assert list(other.obstacles) == list(things)
        for name, obstacle in scene.obstacles.items():
            for one, two in zip(obstacle.shapes, other.obstacles[name].shapes, strict=True):
                a, b = (signed_distance(probe, shape, T, np.eye(4)).distance for shape in (one, two))
                np.testing.assert_allclose(a, b, atol=1e-6 if name == "field" else 1e-9)
    model = CollisionModel(scene.robot, scene)
    assert frozenset(("ground", "shoulder_link")) in model.allowed
    assert set(things) <= set(model.names)
    smaller = scene.without("ground")
    assert "ground" not in smaller.obstacles
    assert smaller.allowed == ()


def test_obstacle_tables(tmp_path: Path) -> None:
    np.save(tmp_path / "points.npy", np.random.default_rng(3).uniform(size=(50, 3)))
    np.savetxt(tmp_path / "points.csv", [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]], delimiter=",")
    Body.box([0.1, 0.2, 0.3]).save(tmp_path / "brick.obj")
    (tmp_path / "r.srdf").write_text(
        '<robot name="ur5e"><disable_collisions link1="shoulder_link" link2="forearm_link"/></robot>'
    )
    text = f"""
allowed = [["floor", "base_link_inertia"]]
srdf = "r.srdf"
{HEAD}
[[obstacle]]
name = "floor"
half_space = [0, 0, 2]
pose = {{xyz = [0, 0, -0.1]}}
[[obstacle]]
name = "seen"
cloud = "points.npy"
radius = 0.01
spacing = 0.1
[[obstacle]]
name = "two"
cloud = "points.csv"
[[obstacle]]
name = "brick"
mesh = "brick.obj"
as = "field"
spacing = 0.02
[[obstacle]]
name = "skin"
mesh = "brick.obj"
as = "surface"
[[obstacle]]
name = "bricks"
mesh = "brick.obj"
pose = {{xyz = [1, 0, 0]}}
[[obstacle]]
name = "rock"
hull = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
radius = 0.1
"""
    (tmp_path / "scene.toml").write_text(text)
    scene = Scene.load(tmp_path / "scene.toml")
    assert scene.allowed == (("floor", "base_link_inertia"), ("forearm_link", "shoulder_link"))
    kinds = {name: type(o.shapes[0]).__name__ for name, o in scene.obstacles.items()}
    expected = ["HalfSpace", "Cloud", "Cloud", "Grid", "Union", "Convex", "Convex"]
    assert list(kinds.values()) == expected
    np.testing.assert_allclose(scene.obstacles["two"].shapes[0].points, [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
    assert Scene.load(scene.save(tmp_path / "saved.toml")).allowed == scene.allowed


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('name = "a"', "needs one of box, cylinder.*it has none"),
        ('name = "a"\nsphere = 1.0\nbox = [1, 1, 1]', "it has box and sphere"),
        ("sphere = 1.0", "no 'name'"),
        ('name = "a"\nsphere = -1.0', "number 1: the radius of a sphere must be positive"),
        ('name = "a"\nhalf_space = [0, 0, 0]', "expected a direction"),
        ('name = "a"\nsphere = 1.0\nspacing = 1.0', "spacing belongs to cloud or mesh, not to sphere"),
        ('name = "a"\ncloud = "none.npy"', "no file of points"),
        ('name = "a"\ncloud = "scene.toml"', "unknown kind; points are read from"),
        ('name = "a"\ncloud = "bad.npy"', "holds no readable points"),
        ('name = "a"\ngeometry = "bad.npy"', "holds no geometry"),
        ('name = "a"\ngeometry = "none.npz"', "no file of geometry"),
        ('name = "a"\nmesh = "none.obj"', "none.obj"),
        (
            'name = "a"\ncylinder = 0.3',
            r"^scene [^ ]*, \[\[obstacle\]\] number 1: cylinder is 0.3; expected a list of 2",
        ),
        ('name = "a"\ncloud = "bda.npy"', "no file of points .*Did you mean 'bad.npy'"),
        ('name = "a"\nmesh = "m.obj"\nas = "dust"', "as is 'dust'; expected one of 'pieces'"),
        ('name = "a"\nmesh = "m.obj"\nspacing = 0.1', "spacing belongs to as"),
        ('name = "a"\nsphere = 1.0\n[[obstacle]]\nname = "a"\nsphere = 1.0', "name of another obstacle"),
        ('name = "a"\nspher = 1.0', "Did you mean 'sphere'"),
    ],
)
def test_bad_tables_are_named(tmp_path: Path, table: str, words: str) -> None:
    (tmp_path / "bad.npy").write_bytes(b"nothing")
    Body.box([0.1, 0.2, 0.3]).save(tmp_path / "m.obj")
    (tmp_path / "scene.toml").write_text(f"{HEAD}[[obstacle]]\n{table}\n")
    with pytest.raises(ApprehendError, match=words):
        Scene.load(tmp_path / "scene.toml")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('allowed = [["a"]]', "expected a list of pairs"),
        ('allowed = [["shoulder_lnk", "forearm_link"]]', "in its allowed pairs.*Did you mean 'shoulder_link'"),
        ('srdf = "none.srdf"', "none.srdf does not exist"),
    ],
)
def test_bad_allowed_pairs_are_named(tmp_path: Path, line: str, words: str) -> None:
    (tmp_path / "scene.toml").write_text(f"{line}\n{HEAD}")
    with pytest.raises(ApprehendError, match=words):
        Scene.load(tmp_path / "scene.toml")


def test_obstacles_need_names() -> None:
    with pytest.raises(InputError, match="needs a name"):
        Obstacle.of("", Convex.sphere(1.0))
    scene = Scene.tabletop("ur5e", body="can")
    with pytest.raises(InputError, match="'table' names two things"):
        scene.with_obstacle("table", Convex.sphere(1.0))
