"""Changed models: whatever came before, a model is that of what it holds, bit for bit."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apprehend.bodies import Body
from apprehend.collision import Box, Cloud, CollisionModel, Convex, Grid, HalfSpace, RobotSource, Scene, Union
from apprehend.collision.arrangement import KNOWN
from apprehend.errors import InputError
from apprehend.kinematics import Robot
from tests.collision.makers import gantry, planar, pose, rotation

ROBOT = planar(3)
CUBE = np.array([[x, y, z] for x in (0.0, 0.2) for y in (0.0, 0.2) for z in (0.0, 0.2)])
NODES = np.stack(np.meshgrid(*3 * [np.linspace(-0.2, 0.2, 9)], indexing="ij"), axis=-1)
THINGS = {
    "box": [Convex.box([0.1, 0.2, 0.3])],
    "pair": [Convex.cylinder(0.1, 0.2), Convex.sphere(0.05).at(pose(0.1))],
    "hull": [Convex.hull(CUBE + 0.1 * CUBE[::-1])],
    "floor": [HalfSpace.through([0.0, 0.0, -0.3])],
    "cloud": [Cloud(np.random.default_rng(0).normal(size=(40, 3)) * 0.1, 0.01)],
    "union": [Union.of([Convex.box([0.1, 0.1, 0.1]), Convex.cone(0.05, 0.1).at(pose(0.2))])],
    "surface": [Union.surface(CUBE[[0, 1, 2, 3] * 20] + 0.01 * np.arange(80)[:, None], np.arange(78).reshape(-1, 3))],
    "field": [Grid.of(np.linalg.norm(NODES, axis=-1) - 0.1, 0.05, (-0.2, -0.2, -0.2))],
}
HELD = ("box", "pair", "hull")
LINKS = ("link1", "link2", "link3")

numbers = st.integers(0, 2**16)
names = st.sampled_from(["a", "b", "c"])
changes = st.lists(
    st.one_of(
        st.tuples(st.just("add"), names, st.sampled_from(sorted(THINGS)), numbers),
        st.tuples(st.just("attach"), names, st.sampled_from(HELD), numbers),
        st.tuples(st.sampled_from(["remove", "detach", "put down"]), names, numbers),
        st.tuples(st.sampled_from(["allow", "forbid"]), st.sampled_from([*LINKS, "a", "b"]), st.sampled_from(LINKS)),
        st.tuples(st.just("clearance"), st.sampled_from([0.0, 0.02])),
        st.tuples(st.just("look")),
    ),
    max_size=12,
)


def somewhere(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return pose(*rng.uniform(-1.0, 1.0, 3), rotation(rng))


def changed(model: CollisionModel, change: tuple) -> CollisionModel:
    """One change; those that make no sense here change nothing."""
    kind, *what = change
    held = [n.name for n in model.nodes if n.attached_to is not None]
    if kind == "add":
        return model.add(what[0], THINGS[what[1]], somewhere(what[2]))
    if kind == "attach":
        return model.attach(THINGS[what[1]], "tip", somewhere(what[2]), name=what[0])
    if kind == "remove" and what[0] in model.names:
        return model.remove(what[0])
    if kind in ("detach", "put down") and what[0] in held:
        return model.detach(what[0], somewhere(what[1]) if kind == "put down" else None)
    if kind in ("allow", "forbid") and what[0] in model.names and what[0] != what[1]:
        return model.allow([tuple(what)]) if kind == "allow" else model.forbid([tuple(what)])
    if kind == "clearance":
        return model.with_clearance(what[0])
    if kind == "look":
        assert model.lanes is model.lanes
        assert model.compiled is model.compiled
    return model


def arrays(model: CollisionModel) -> list[np.ndarray]:
    exact = model.compiled
    both = [*exact._replace(shapes=None), *exact.shapes, *model.lanes]
    return [np.zeros(0) if array is None else array for array in both]


def made_at_once(model: CollisionModel) -> CollisionModel:
    """The same things and the same allowed pairs, put into a model that shares nothing with *model*."""
    fresh = CollisionModel(planar(3), clearance=model.clearance)
    for node in model.nodes[3:]:
        shapes = [type(s)(**{f: np.copy(getattr(s, f)) if isinstance(getattr(s, f), np.ndarray) else getattr(s, f)
                             for f in s.__dataclass_fields__}) for s in node.shapes]  # fmt: skip
        fresh = fresh.add(node.name, THINGS["box"]) if node.attached_to is None else fresh.attach(
            THINGS["box"], node.attached_to, node.pose, name=node.name, touching=[]
        )  # fmt: skip
        last = fresh.nodes[-1]
        object.__setattr__(last, "shapes", tuple(shapes))
        if node.travel is not None:
            object.__setattr__(last, "travel", node.travel)
    fresh = fresh.forbid([tuple(p) for p in fresh.allowed if p <= set(fresh.names)])
    return fresh.allow([tuple(p) for p in model.allowed if p <= set(model.names)])


@settings(deadline=None, max_examples=60)
@given(changes)
def test_a_changed_model_is_that_of_what_it_holds(steps: list[tuple]) -> None:
    model = CollisionModel(ROBOT)
    before = [array.copy() for array in arrays(model)]
    first = model
    for step in steps:
        model = changed(model, step)
    for one, other in zip(arrays(model), arrays(made_at_once(model)), strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    for one, other in zip(arrays(first), before, strict=True):  # the first model is what it was
        np.testing.assert_array_equal(one, other)


@settings(deadline=None, max_examples=25)
@given(changes, numbers)
def test_lanes_and_exact_shapes_agree_after_changes(steps: list[tuple], seed: int) -> None:
    """And the pairs that are tested are those that move against each other and may not touch."""
    model = CollisionModel(ROBOT)
    for step in steps:
        model = changed(model, step)
    q = np.random.default_rng(seed).uniform(-3.0, 3.0, (60, 3))
    np.testing.assert_array_equal(model.free(q), model.hits(q) < 0)
    tested = {frozenset((model.nodes[a].name, model.nodes[b].name)) for a, b in model.compiled.blocks[:, :2]}
    everything = {
        frozenset((a.name, b.name)) for a in model.nodes for b in model.nodes if a.carrier != b.carrier
    } - model.allowed
    assert tested == everything


def test_shapes_at_several_poses_share_what_does_not_depend_on_the_pose() -> None:
    cloud = Cloud.of(np.random.default_rng(1).normal(size=(50, 3)), 0.01)
    moved = cloud.at(pose(1.0)).at(pose(0.0, 2.0))
    assert moved.cells is cloud.cells
    np.testing.assert_allclose(moved.ball[0] - cloud.ball[0], [1.0, 2.0, 0.0], atol=1e-12)
    samples, radii = np.ones((3, 3, 3)), np.array([0.1, 0.2, 0.3])
    samples[1, 1, 1] = -0.1
    grid, ellipsoid = Grid.of(samples, 0.1), Convex.ellipsoid(radii)
    samples[:], radii[:] = 5.0, 5.0
    assert grid.samples.min() == -0.1  # what the caller does with the arrays later is no matter
    assert ellipsoid.size.max() == 0.3


def test_models_of_one_robot_share_its_arrays_as_long_as_it_lives() -> None:
    robot = planar(4)
    one = CollisionModel(robot)
    walls = (Box("wall", np.array([0.1, 1.0, 1.0]), pose(1.0)),)
    two = CollisionModel(robot, Scene(robot, RobotSource("in code"), boxes=walls))
    assert one.nodes[0] is two.nodes[0]
    assert CollisionModel(robot, clearance=0.1).nodes[0] is one.nodes[0]
    for k in range(20):
        CollisionModel(robot, clearance=1e-3 * k)
    assert len(KNOWN[robot]) <= 4
    assert CollisionModel(robot, geometry={"link1": [Convex.sphere(0.1)]}).names == ("link1",)
    before = len(KNOWN)
    del one, two, robot
    gc.collect()
    assert len(KNOWN) < before


def test_the_pieces_of_a_body_are_made_once() -> None:
    mug = Body.household("mug")
    model = CollisionModel(gantry()).add("one", mug).add("two", mug, pose(1.0))
    one, two = (node.shapes for node in model.nodes[-2:])
    assert all(a.points is b.points for a, b in zip(one, two, strict=True))


def test_a_body_that_was_held_is_an_obstacle_like_any_other() -> None:
    model = CollisionModel(ROBOT).attach(THINGS["box"], "tip", np.eye(4), name="box")
    assert not model.add("box", THINGS["box"]).reasons.keys() & {frozenset(("box", link)) for link in LINKS}
    kept = CollisionModel(ROBOT).add("post", THINGS["box"]).allow([("post", "link1")]).add("post", THINGS["hull"])
    assert frozenset(("post", "link1")) in kept.reasons
    with pytest.raises(InputError, match="'link2' is a link of the robot; an attached body needs another name"):
        model.attach(THINGS["box"], "tip", np.eye(4), name="link2")


def test_a_robot_that_was_loaded_twice_has_the_same_model() -> None:
    one, two = (CollisionModel(Robot.load("schunk_egk40")) for _ in range(2))
    for a, b in zip(arrays(one), arrays(two), strict=True):
        np.testing.assert_array_equal(a, b)
