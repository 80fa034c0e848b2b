"""Planning for hands with several fingers: every claim of a candidate is checked by other means."""

import numpy as np
import pytest

import apprehend as ap
from apprehend.collision import Convex, signed_distance
from apprehend.errors import DescriptionError, InputError
from apprehend.grasp import Grasp, HandCandidate, PlanStatus, hand_jacobian
from apprehend.grasp.closing import TOUCH, close, levers
from apprehend.grasp.fingers import fingers_of
from apprehend.grasp.surface import Surface
from apprehend.robots import link_surface


@pytest.fixture(scope="module")
def allegro():
    return ap.Hand.load("allegro_right")


@pytest.fixture(scope="module")
def can():
    return ap.Body.household("can")


@pytest.fixture(scope="module")
def planned(allegro, can):
    return ap.grasp.plan(allegro, can, n=8, rng=np.random.default_rng(3), samples=300, safety=1.2).require_success()


def test_both_ways_find_grasps(planned):
    assert {c.method for c in planned} == {"inverse", "closing"}
    assert "tries by inverse" in planned.explain()
    assert "tries by closing" in planned.explain()
    assert [c.quality for c in planned] == sorted((c.quality for c in planned), reverse=True)


def test_every_claim_of_a_candidate(planned, allegro, can):
    limits = allegro.robot.limits
    surface = Surface(can.vertices, can.faces)
    for found in planned:
        assert isinstance(found, HandCandidate)
        assert (found.q >= limits.lower - 1e-9).all()
        assert (found.q <= limits.upper + 1e-9).all()
        grasp = found.grasp(can)  # its contacts lie on the body
        points = np.array([c.position for c in found.contacts])
        assert surface.nearest(points)[1].max() < 1e-9
        # the proof of force closure
        assert np.abs(grasp.matrix @ found.internal_force).max() < 1e-9
        for contact, part in zip(grasp.contacts, grasp.slices, strict=True):
            assert float(contact.slack(found.internal_force[part])) > 0.0
        assert grasp.rank == 6
        assert found.margins["epsilon"] == found.quality
        assert grasp.quality(gap=0.01).upper >= found.quality
        # normals point into the body
        inside = surface.contains(points + 1e-4 * np.array([c.normal for c in found.contacts]))
        assert inside.all()
        # the hand is where it says: every link that touches is that near to its contact, and no link is inside
        nearest = np.inf
        for name in allegro.robot.frame_names:
            vertices, faces = link_surface(allegro.robot.description.links[name])
            if not len(vertices):
                continue
            T = found.pose @ allegro.robot.fk(found.q, name)
            corners = vertices[faces]
            cloud = np.concatenate([vertices, corners.mean(axis=1), 0.5 * (corners[:, 0] + corners[:, 1])])
            placed = cloud @ T[:3, :3].T + T[:3, 3]
            assert not surface.contains(placed).any()
            if name in found.links:
                contact = found.contacts[found.links.index(name)]
                link = Surface(vertices, faces)
                local = (contact.position - T[:3, 3]) @ T[:3, :3]
                # the planned shape is a hull: the mesh itself may lie a little behind it
                assert link.nearest(local[None])[1][0] < 4e-3
            nearest = min(nearest, float(surface.nearest(placed)[1].min()))
        assert 0.0 < found.margins["distance"] <= TOUCH
        J = hand_jacobian(allegro, found.q, grasp, found.links, np.linalg.inv(found.pose))
        assert J.shape == (grasp.matrix.shape[1], allegro.n)
        weight = np.array([0, 0, -can.mass * 9.81, 0, 0, 0])
        hold = grasp.contact_forces(weight, torque_limits=limits.effort, hand_jacobian=J)
        assert hold.success


def test_the_same_state_gives_the_same_grasps(allegro, can, planned):
    again = ap.grasp.plan(allegro, can, n=8, rng=np.random.default_rng(3), samples=300, safety=1.2)
    assert len(again) == len(planned)
    for a, b in zip(again, planned, strict=True):
        np.testing.assert_array_equal(a.q, b.q)
        np.testing.assert_array_equal(a.pose, b.pose)


def test_table_and_approach_are_kept(allegro):
    apple = ap.Body.household("apple")
    low = float(apple.vertices[:, 2].min())
    table = np.array([[0.0, 0.0, 1.0, low]])
    down = np.array([[0.0, 0.0, -1.0]])
    found = ap.grasp.plan(
        allegro, apple, n=2, rng=np.random.default_rng(0), method="closing", table=table, approach=down, safety=1.2
    ).require_success()
    surface = Surface(apple.vertices, apple.faces)
    for candidate in found:
        assert candidate.approach @ down[0] > 0.5
        for q, back in ((candidate.q, 0.0), (candidate.pregrasp, 0.0), (candidate.pregrasp, 0.05)):
            for name in allegro.robot.frame_names:
                vertices, _ = link_surface(allegro.robot.description.links[name])
                if len(vertices):
                    T = candidate.retreated(back) @ allegro.robot.fk(q, name)
                    placed = vertices @ T[:3, :3].T + T[:3, 3]
                    assert placed[:, 2].min() > low + 2.9e-3  # the table, by table_clearance
                    if q is candidate.pregrasp:
                        assert surface.nearest(placed)[1].min() > 9e-4  # the open hand leaves room all the way


def test_distances_equal_those_of_single_triangles(allegro):
    """The kernel against one convex pair per triangle."""
    body = ap.Body.box((0.05, 0.04, 0.03), mass=0.1)
    fingers, surface = fingers_of(allegro), Surface(body.vertices, body.faces)
    rng = np.random.default_rng(0)
    q = rng.uniform(allegro.robot.limits.lower, allegro.robot.limits.upper, (3, allegro.n))
    T = np.tile(np.eye(4), (3, 1, 1))
    T[:, :3, 3] = [[0.02, 0.0, -0.14], [0.1, 0.05, 0.0], [-0.04, 0.0, 0.06]]
    distance, near = fingers.distances(surface, q, T, 0.3)
    poses = fingers.shape_poses(q, T)
    triangles = [Convex.hull(t) for t in body.vertices[body.faces]]
    for i in range(3):
        for s, shape in enumerate(fingers.shapes):
            placed = poses[i, s] @ np.linalg.inv(shape.pose)
            want = min(float(signed_distance(shape, t, placed, np.eye(4)).distance) for t in triangles)
            if want > 1e-6:
                assert distance[i, s] == pytest.approx(want, rel=1e-5, abs=1e-8)
                gap = np.linalg.norm(near[i, s, 0] - near[i, s, 1])
                assert gap == pytest.approx(distance[i, s], rel=1e-6, abs=1e-9)
                assert surface.nearest(near[i, s, 1][None])[1][0] < 1e-9
            else:
                assert distance[i, s] <= 1e-6


def test_levers_bound_every_motion(allegro):
    fingers = fingers_of(allegro)
    lever = levers(fingers)
    rng = np.random.default_rng(1)
    limits = allegro.robot.limits
    for _ in range(10):
        a, b = rng.uniform(limits.lower, limits.upper, (2, 1, allegro.n))
        moved = [fingers.shape_poses(q, np.eye(4)[None])[0] for q in (a, b)]
        bound = np.abs(b - a)[0] @ lever.T
        for s, shape in enumerate(fingers.shapes):
            corners = shape.points if len(shape.points) else np.zeros((1, 3))
            ends = [corners @ T[s, :3, :3].T + T[s, :3, 3] for T in moved]
            assert np.linalg.norm(ends[0] - ends[1], axis=1).max() <= bound[s] + 1e-12


def test_closing_stops_at_the_surface_and_goes_on_beyond_a_link_that_touches(allegro):
    fingers = fingers_of(allegro)
    cages = fingers.cages
    ball = ap.Body.sphere(0.03, mass=0.1)
    surface = Surface(ball.vertices, ball.faces)
    T = np.tile(np.eye(4), (40, 1, 1))
    T[:, :3, 3] = -cages.focus[:40]
    open_enough = fingers.distances(surface, cages.q[:40], T, 0.02)[0].min(axis=1) > 1e-3
    q, T = cages.q[:40][open_enough], T[open_enough]
    targets = np.repeat(cages.focus[:40][open_enough][:, None], len(fingers.tips), axis=1)
    found = close(fingers, surface, q, T, targets)
    assert found.distance.min() > 0.0  # nothing goes in
    touched = (found.distance <= TOUCH).any(axis=1)
    assert touched.mean() > 0.9
    assert fingers.own.free(found.q).all()


def test_bad_questions_are_named(allegro, can):
    rng = np.random.default_rng(0)
    for options, message in (
        ({"method": "magic"}, "'both', 'inverse', 'closing'"),
        ({"samples": 0}, "samples is 0"),
        ({"friction": -1.0}, "friction is -1"),
        ({"acceleration": -1.0}, "acceleration is -1"),
        ({"max_force": 0.0}, "max_force is 0"),
    ):
        with pytest.raises(InputError, match=message):
            ap.grasp.plan(allegro, can, rng=rng, **options)
    with pytest.raises(DescriptionError, match="finger"):
        ap.grasp.plan(ap.Hand(ap.Robot.load("planar_2r")), can, rng=rng)


def test_why_there_are_no_grasps(allegro):
    wall = ap.Body.box((2.0, 2.0, 2.0), mass=1.0)
    found = ap.grasp.plan(allegro, wall, n=2, rng=np.random.default_rng(0), samples=96)
    assert not found.success
    assert found.status in (PlanStatus.NO_CLOSURE, PlanStatus.TOO_FEW, PlanStatus.OUT_OF_REACH, PlanStatus.NO_ROOM)
    assert "allegro_right" in found.explain()
    heavy = ap.Body.household("can")
    weak = ap.grasp.plan(allegro, heavy, n=2, rng=np.random.default_rng(0), samples=200, max_force=1e-3)
    assert weak.rejected["too weak"] > 0
    assert not weak.success


@pytest.mark.parametrize("name", ["g1_right_hand", "shadow_right"])
def test_other_hands(name):
    try:
        hand = ap.Hand.load(name)
    except ap.errors.ApprehendError as error:
        pytest.skip(f"{name} is not installed: {error}")
    ball = ap.Body.sphere(0.03, mass=0.05)
    found = ap.grasp.plan(hand, ball, n=3, rng=np.random.default_rng(1), friction=0.9, samples=300)
    assert found.success, found.explain()
    for candidate in found:
        assert Grasp(candidate.contacts, ball).force_closure().success
