"""Jaw grasps on real and made bodies: every claim of a candidate is checked by other means."""

import numpy as np
import pytest
import trimesh

import apprehend as ap
from apprehend import grasp, parallel
from apprehend.errors import InputError, MissingDependencyError
from apprehend.grasp import PlanStatus, Surface
from apprehend.robots.meshes import link_surface
from tests.support import shared

OBJECTS = ("ycb_banana.obj", "ycb_hammer.obj", "pybullet_random_042.obj")


@pytest.fixture(scope="module", params=["robotiq_2f_85", "panda_hand"])
def hand(request):
    try:
        return ap.Hand.load(request.param)
    except MissingDependencyError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def jaw():
    return ap.Hand.load("robotiq_2f_85")


def hand_points(hand, candidate, width, spacing=4e-3):
    """Points spread over the hand's surface, in the body frame, and whether each lies on a pad link."""
    q = hand.jaw.q_at(width)
    points, pads = [], []
    for name, link in hand.robot.description.links.items():
        vertices, faces = link_surface(link)
        if not len(faces):
            continue
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        count = max(50, int(mesh.area / spacing**2))
        p, _ = trimesh.sample.sample_surface(mesh, count, seed=0)
        T = candidate @ hand.robot.fk(q, name)
        points.append(p @ T[:3, :3].T + T[:3, 3])
        pads.append(np.full(len(p), name in hand.jaw.pad_links))
    return np.concatenate(points), np.concatenate(pads)


@pytest.mark.parametrize("name", OBJECTS)
def test_candidates_hold_what_they_claim(hand, name):
    body = ap.Body.load(shared(f"objects/{name}"), mass=0.3)
    table = body.stable_poses()[0].pose
    found = grasp.plan(hand, body, 12, rng=np.random.default_rng(0), table=table, samples=1000)
    assert found.success
    assert found.status is PlanStatus.SUCCESS
    surface = Surface(body.vertices, body.faces)
    up, height = table[2, :3], table[2, 3]
    previous = np.inf
    for c in found:
        assert 0.0 < c.quality <= previous
        previous = c.quality
        # the frames agree with the hand
        np.testing.assert_allclose(c.pose @ hand.jaw.tcp_at(c.width), c.tcp, atol=1e-9)
        # contacts lie at the surface, on either side, and their normals point at each other within the cones
        points = np.array([k.position for k in c.contacts])
        assert surface.nearest(points)[1].max() <= 2e-3
        line = points[0] - points[1]
        assert c.width == pytest.approx(line @ c.tcp[:3, 0], abs=2.1e-3)
        for contact, sign in zip(c.contacts, (-1.0, 1.0), strict=True):
            cosine = sign * contact.normal @ line / np.linalg.norm(line)
            assert np.arccos(np.clip(cosine, -1, 1)) <= np.arctan(body.friction) - c.margins["cone"] + 1e-9
        # no point of the open hand is inside the body, or under the table, on the way in
        for back in (0.0, 0.03, 0.1):
            points, _ = hand_points(hand, c.retreated(back), c.opening)
            assert not surface.contains(points).any()
            assert (points @ up + height).min() > 0.0
        # the closed hand touches with its pads only, no deeper than they give way
        points, pads = hand_points(hand, c.pose, c.width)
        inside = surface.contains(points)
        assert not (inside & ~pads).any()
        assert surface.nearest(points[inside])[1].max(initial=0.0) < 2.5e-3
        assert (points @ up + height).min() > 0.0
        assert c.required_force <= hand.jaw.max_force


def test_same_seed_same_answer_on_any_number_of_threads(jaw):
    body = ap.Body.box((0.05, 0.03, 0.1), mass=0.2)
    before = parallel.threads()
    try:
        answers = []
        for threads in (1, 2):
            parallel.set_threads(threads)
            answers.append(grasp.plan(jaw, body, 10, rng=np.random.default_rng(5), samples=300).poses)
    finally:
        parallel.set_threads(before)
    np.testing.assert_array_equal(*answers)


def test_contacts_lie_on_the_surface_of_coarse_round_bodies(jaw, tmp_path):
    trimesh.creation.icosphere(subdivisions=2, radius=0.03).export(tmp_path / "ball.stl")
    ball = ap.Body.load(tmp_path / "ball.stl", mass=0.2)
    found = grasp.plan(jaw, ball, 20, rng=np.random.default_rng(0))
    points = np.array([c.position for candidate in found for c in candidate.contacts])
    assert Surface(ball.vertices, ball.faces).nearest(points)[1].max() < 1e-9
    assert all(ap.Grasp(candidate.contacts, body=ball).force_closure().success for candidate in found)


def test_the_force_is_that_of_statics(jaw):
    """Two flat pads straight through the centre of mass: weight m g and acceleration a need m (g + a) / (2 µ) each."""
    body = ap.Body.box((0.04, 0.04, 0.04), mass=0.5, friction=0.5)
    found = grasp.plan(jaw, body, 50, rng=np.random.default_rng(2), samples=2000, safety=1.5, acceleration=1.0)
    best = min(found, key=lambda c: c.margins["com_distance"])
    assert best.margins["com_distance"] < 5e-3
    # the worst of the directions lies square to the closing line, or along it where the full weight comes on top
    slip = 1.5 * 0.5 * (9.81 + 1.0) / (2 * 0.5)
    assert slip * 0.95 < best.required_force < 2.2 * slip


def test_approach_directions_are_kept(jaw):
    body = ap.Body.cylinder(0.02, 0.12, mass=0.2)
    down = np.array([0.0, 0.0, -1.0])
    found = grasp.plan(jaw, body, 20, rng=np.random.default_rng(1), approach=down, approach_tolerance=0.3, samples=500)
    assert found.success
    assert all(c.approach @ down >= np.cos(0.3) - 1e-9 for c in found)


def test_candidates_lie_apart(jaw):
    body = ap.Body.cylinder(0.02, 0.12, mass=0.2)
    found = grasp.plan(jaw, body, 20, rng=np.random.default_rng(1), samples=500, apart=(0.02, 0.4))
    for i, a in enumerate(found):
        for b in list(found)[:i]:
            far = np.linalg.norm(a.tcp[:3, 3] - b.tcp[:3, 3]) >= 0.02
            turned = a.approach @ b.approach <= np.cos(0.4) or abs(a.tcp[:3, 0] @ b.tcp[:3, 0]) <= np.cos(0.4)
            assert far or turned


def test_failures_say_why(jaw):
    rng = np.random.default_rng(0)
    wide = grasp.plan(jaw, ap.Body.box((0.2, 0.15, 0.112), mass=1.0), rng=rng)
    assert wide.status is PlanStatus.TOO_WIDE
    assert "smallest graspable width 112 mm > 84 mm" in wide.explain()
    heavy = grasp.plan(jaw, ap.Body.box((0.05, 0.05, 0.05), mass=20.0), rng=rng, max_force=10.0, samples=300)
    assert heavy.status is PlanStatus.TOO_WEAK
    assert "10.0 N are allowed" in heavy.explain()
    flat = ap.Body.box((0.2, 0.15, 0.03), mass=0.3)
    table = np.eye(4)
    table[2, 3] = 0.015
    lying = grasp.plan(jaw, flat, rng=rng, table=table, samples=500)
    assert lying.status is PlanStatus.NO_ROOM
    assert "no finger fits between line and table" in lying.explain()
    slippery = grasp.plan(jaw, ap.Body.sphere(0.03, mass=0.1), rng=rng, friction=0.01, samples=50)
    assert slippery.status in (PlanStatus.NO_OPPOSITE_SIDES, PlanStatus.NO_CONTACT)
    with pytest.raises(ap.errors.UnsuccessfulError, match="wider than the jaw"):
        wide.require_success()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"samples": 0}, "samples is 0"),
        ({"friction": -1.0}, "friction is -1.0"),
        ({"clearance": np.nan}, "clearance is nan"),
        ({"table": np.zeros((1, 4))}, "normal is zero"),
        ({"approach": [0.0, 0.0, 0.0]}, "length zero"),
        ({"table": np.zeros((2, 3))}, "table has shape"),
    ],
)
def test_bad_arguments_are_named(jaw, options, message):
    with pytest.raises(InputError, match=message):
        grasp.plan(jaw, ap.Body.box((0.05, 0.05, 0.05), mass=0.1), rng=np.random.default_rng(0), **options)
