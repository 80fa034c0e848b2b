"""Variants of wrench spaces, patches, and the measures that need no wrench space."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import apprehend as ap
from apprehend.errors import InputError
from apprehend.grasp import Contact, ContactModel, Grasp, Limits, Patch
from tests.grasp.makers import contact, random_grasp
from tests.support import reference


def rectangle(mu=0.5, a=1.0, b=0.5):
    """G 2.11: a rectangle (2a × 2b) with two contacts below and one above, in the plane."""
    places = [([-0.5 * a, -b], [0.0, 1.0]), ([0.5 * a, -b], [0.0, 1.0]), ([0.0, b], [0.0, -1.0])]
    return Grasp([Contact(np.array(p), np.array(n), mu) for p, n in places], length=a)


def test_example_2_11_rectangle_with_three_contacts():
    """The wrench polytopes of G 2.2.3, each against the hull of all the sums and unions that define it."""
    grasp = rectangle()
    mu, a, b = 0.5, 1.0, 0.5
    columns = []
    for x, y, n in ((-0.5 * a, -b, 1.0), (0.5 * a, -b, 1.0), (0.0, b, -1.0)):
        columns += [[n, 0.0, -y * n / a], [0.0, n, x * n / a]]  # tangent (n, 0), normal (0, n), torque over the length
    np.testing.assert_allclose(grasp.matrix * grasp.scale[:, None], np.array(columns).T, atol=1e-15)
    edges = np.array([[s * mu * t + n for s in (1.0, -1.0)] for t, n in np.array(columns).reshape(3, 2, 3)])
    union = ConvexHull(np.vstack([edges.reshape(-1, 3), np.zeros(3)]))
    choices = [np.vstack([e, np.zeros(3)]) for e in edges]
    sums = (choices[0][:, None, None] + choices[1][None, :, None] + choices[2][None, None]).reshape(-1, 3)
    total = ConvexHull(sums)
    assert grasp.force_closure().success
    for cone in ("exact", "polyhedral"):  # in the plane two edges are exact
        one = grasp.quality(cone=cone, gap=1e-9)
        assert one.value == pytest.approx(-union.equations[:, -1].max(), abs=1e-9)
        each = grasp.quality(norm="linf", cone=cone, gap=1e-9)
        assert each.value == pytest.approx(-total.equations[:, -1].max(), abs=1e-8)
        assert each.value >= one.value  # W_L1 is part of W_Linf
    assert grasp.quality("volume").value == pytest.approx(union.volume)
    assert (union.points @ one.worst_wrench).max() == pytest.approx(one.value)
    # without friction nothing moves the rectangle sideways
    smooth = rectangle(mu=0.0)
    assert not smooth.force_closure().success
    assert smooth.quality().value == 0.0


@pytest.mark.parametrize("seed", range(3))
def test_polyhedral_sum_is_between_and_equals_a_hull(seed):
    rng = np.random.default_rng(seed)
    grasp = random_grasp(rng, 3, friction=0.8, spread=0.1)
    groups = [np.vstack([g, np.zeros(6)]) for g in grasp.edge_groups(3)]
    sums = (groups[0][:, None, None] + groups[1][None, :, None] + groups[2][None, None]).reshape(-1, 6)
    want = max(-ConvexHull(sums).equations[:, -1].max(), 0.0)
    assert grasp.quality(norm="linf", cone="polyhedral", m=3).value == pytest.approx(want, abs=1e-9)
    exact = grasp.quality(norm="linf", gap=1e-3)
    assert want <= exact.upper + 1e-12


def cap_support(grasp, u, add):
    """Support of forces of length at most one in each cone: the length of the projection of Gᵀu onto the cone."""
    values = []
    for c, s in zip(grasp.contacts, grasp.slices, strict=True):
        x, y, n = (grasp.scale[:, None] * grasp.matrix[:, s]).T @ u
        t, mu = np.hypot(x, y), c.friction
        inside, edge = np.hypot(t, n), (n + mu * t) / np.hypot(1.0, mu)
        values.append(max(inside if n > 0.0 and t <= mu * n else edge, 0.0))
    return sum(values) if add else max(values)


@pytest.mark.parametrize("norm", ["l1", "linf"])
def test_forces_bounded_in_magnitude(norm):
    rng = np.random.default_rng(5)
    for _ in range(5):
        grasp = random_grasp(rng, 4, friction=0.7, spread=0.1)
        found = grasp.quality(norm=norm, bound="magnitude", gap=0.01)
        directions = rng.normal(size=(4000, 6))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        least = min(cap_support(grasp, u, norm == "linf") for u in directions)
        assert found.lower <= least + 1e-12
        if found.upper > 0.0:
            assert cap_support(grasp, found.worst_wrench, norm == "linf") == pytest.approx(found.upper)
        normal = grasp.quality(norm=norm, gap=0.01)
        assert found.lower <= normal.upper + 1e-12  # ‖f‖ ≤ 1 is part of f_n ≤ 1
    soft = Grasp([Contact.soft([1.0, 0, 0], [-1.0, 0, 0], 0.5, 0.1)])
    with pytest.raises(InputError, match="soft fingers pass on a moment"):
        soft.quality(bound="magnitude")


def test_peer_metrics():
    for case in reference("grasp_closure.json")["cases"]:
        if not case["id"].startswith("peer_metrics"):
            continue
        given, want = case["inputs"], case["expected"]
        grasp = Grasp([contact(row) for row in given["contacts"]], reference=given["center"])
        lengths = grasp.quality(cone="polyhedral", bound="magnitude").value
        assert lengths == pytest.approx(want["own_hull_unit_force"], abs=1e-7)
        assert lengths == pytest.approx(max(want["frogger_ferrari_canny_L1"], 0.0), abs=1e-6)
        if want.get("own_hull_unit_normal") is not None:
            found = grasp.quality(cone="polyhedral").value
            assert found == pytest.approx(want["own_hull_unit_normal"], abs=1e-7)
        weight = grasp.quality("min_weight").value
        assert weight == pytest.approx(want["frogger_min_weight"], abs=1e-6)


def test_rays_of_the_reference():
    """Largest forces along given wrenches."""
    tested = 0
    for case in reference("grasp_epsilon.json")["cases"]:
        given, want = case["inputs"], case["expected"]
        if "ray_shooting" not in want:
            continue
        grasp = Grasp([contact(row) for row in given["contacts"]], reference=given["center"])
        for direction, reach in list(zip(want["ray_directions_first20"], want["ray_shooting"]["L1"]["first20"]))[:4]:
            wrench = np.array(direction)
            wrench[3:] /= given["torque_scale"]
            assert grasp.largest_force(wrench, Limits(total=1.0)).value == pytest.approx(reach, rel=1e-4, abs=1e-6)
            tested += 1
    assert tested


def test_lines_and_planes_of_wrench_space():
    grasp = random_grasp(np.random.default_rng(0), 5, friction=0.8, spread=0.1)
    line = grasp.quality(subspace=np.eye(6)[2:3])
    up, down = (grasp.largest_force(np.r_[0, 0, s, 0, 0, 0], Limits(total=1.0)) for s in (1.0, -1.0))
    # the projection reaches at least as far as the section
    assert line.value >= min(up.value, down.value) - 1e-9
    base, spread, _ = grasp.generators
    want = [np.max(s * base[:, 2] + np.linalg.norm(spread[:, :, 2], axis=1)) for s in (1.0, -1.0)]
    assert line.value == pytest.approx(min(want))
    plane = grasp.quality(subspace=np.eye(6)[1:3], gap=1e-6)
    assert plane.lower <= line.value + 1e-9


def test_patch_passes_on_the_wrenches_of_all_its_points():
    rng = np.random.default_rng(0)
    square = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]]
    patch = Patch(np.array(square), np.array([0.0, 0.0, 1.0]), 0.5)
    assert len(patch.contacts) == 4  # the middle is no corner
    assert patch.area == pytest.approx(4.0)
    np.testing.assert_allclose(patch.centroid, np.zeros(3), atol=1e-15)
    corners = Grasp([patch])
    for _ in range(50):
        inner = Grasp([Contact(np.append(rng.uniform(-1, 1, 2), 0.0), patch.normal, 0.5)])
        u = rng.normal(size=6)
        reach = [
            float(np.max(g.generators.base @ u + np.linalg.norm(g.generators.spread @ u, axis=1)))
            for g in (corners, inner)
        ]
        assert reach[1] <= reach[0] + 1e-12
    above = Contact(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0]), 0.5)
    held = Grasp([patch, above])
    assert held.parts == ((0, 1, 2, 3), (4,))
    assert held.force_closure().success
    assert held.removable() == ()
    # as a whole: the patch bears one unit, not one at every corner
    lid = Patch(patch.corners + [0.0, 0.0, 1.0], -patch.normal, 0.5)
    pressed = Grasp([patch, lid])
    assert pressed.quality(norm="linf").upper < 0.5 * Grasp(pressed.contacts).quality(norm="linf").lower
    assert pressed.quality(norm="linf", cone="polyhedral").value <= pressed.quality(norm="linf").upper + 1e-9
    one, each = held.quality(gap=1e-4), Grasp(held.contacts).quality(gap=1e-4)
    assert one.value == pytest.approx(each.value, rel=1e-3)  # the L1 hull knows no parts


def test_patch_as_a_soft_finger():
    turn = 2.0 * np.pi * np.arange(256) / 256
    disc = Patch(0.01 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1), np.array([0, 0, 1.0]), 0.6)
    even, hertz = disc.soft(), disc.soft("hertz", "soft_box")
    assert even.torsion == pytest.approx(0.6 * 0.01 * 2.0 / 3.0, rel=2e-3)
    assert hertz.torsion == pytest.approx(0.6 * 0.01 * 3.0 * np.pi / 16.0, rel=1e-3)
    assert even.model is ContactModel.SOFT
    assert hertz.model is ContactModel.SOFT_BOX


def test_patches_of_a_mesh_and_of_the_plane():
    box = ap.Body.box((0.1, 0.1, 0.1), mass=1.0)
    patch = Patch.on_surface(box, [0.0, 0.0, 0.06], 0.02)
    assert patch.area == pytest.approx(np.pi * 4e-4, rel=0.02)
    np.testing.assert_allclose(patch.normal, [0, 0, -1.0], atol=1e-12)
    edge = Patch.on_surface(box, [0.05, 0.0, 0.05], 0.02)  # half the pad reaches over the edge
    assert edge.area == pytest.approx(np.pi * 2e-4, rel=0.2)
    side = Patch(np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([1.0, 0.0]), 0.3)
    assert side.area == 1.0
    held = Grasp([side, Contact(np.array([1.0, 0.5]), np.array([-1.0, 0.0]), 0.3)])
    assert held.force_closure().success
    with pytest.raises(InputError, match="no moment about its normal"):
        side.soft()


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ([[0, 0, 0], [1, 0, 0]], "three or more"),
        ([[0, 0, 0], [0, 0, 0], [0, 0, 0]], "coincide"),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], "one line"),
        ([[0, 0, 0], [1, 0, 0.5], [0, 1, 0]], "off the plane of the normal"),
    ],
)
def test_bad_patches_are_named(corners, message):
    with pytest.raises(InputError, match=message):
        Patch(np.array(corners, float), np.array([0, 0, 1.0]))


def test_patches_of_bent_surfaces_are_refused():
    ball = ap.Body.sphere(0.01, mass=0.1)
    with pytest.raises(InputError, match="bends away"):
        Patch.on_surface(ball, [0.0, 0.0, 0.01], 0.5, depth=1e-9)
    with pytest.raises(InputError, match="radius is -1"):
        Patch.on_surface(ball, [0.0, 0.0, 0.01], -1)


def test_polygons():
    turn = 2.0 * np.pi * np.arange(5) / 5
    points = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    regular = Grasp([Contact(p, -p, 0.5) for p in points])
    assert regular.quality("polygon_shape").value == pytest.approx(0.0, abs=1e-12)
    assert regular.quality("polygon_area").value == pytest.approx(2.5 * np.sin(2.0 * np.pi / 5))
    assert regular.quality("normal_balance").value == pytest.approx(1.0)
    flat = Grasp([Contact(np.array([x, 0.0, 0.0]), np.array([0, 0, 1.0]), 0.5) for x in (0.0, 1.0, 2.0)])
    assert flat.quality("polygon_shape").value == pytest.approx(1.0)
    assert flat.quality("polygon_area").value == 0.0
    assert flat.quality("normal_balance").value == pytest.approx(0.0)
    with pytest.raises(InputError, match="three contacts; this grasp has 2"):
        Grasp(regular.contacts[:2]).quality("polygon_area")


def test_position_margin_is_safe():
    """Moving every contact by less than the margin in any way keeps force closure."""
    rng = np.random.default_rng(3)
    tested = 0
    while tested < 5:
        grasp = random_grasp(rng, 4, friction=0.8, spread=0.1)
        margin = grasp.quality("position_margin")
        if not grasp.force_closure().success:
            assert margin.value == 0.0
            continue
        assert margin.value > 0.0
        assert margin.upper == np.inf
        for _ in range(20):
            steps = rng.normal(size=(4, 3))
            steps *= 0.999 * margin.value / np.linalg.norm(steps, axis=1, keepdims=True)
            moved = [Contact(c.position + s, c.normal, c.friction) for c, s in zip(grasp.contacts, steps, strict=True)]
            assert Grasp(moved).force_closure().success
        tested += 1


def test_orthogonality():
    stick = ap.Body.box((0.02, 0.03, 0.3), mass=1.0)
    grasp = Grasp.on_surface(stick, [[0.01, 0, 0], [-0.01, 0, 0]], model="soft", torsion=0.01)
    for approach, want in (([0, 0, 1.0], 0.0), ([0, 2.0, 0], 0.0), ([0, 1.0, 1.0], np.pi / 4)):
        assert grasp.quality("orthogonality", approach=approach).value == pytest.approx(want, abs=1e-6)
    with pytest.raises(InputError, match="give the grasp its body"):
        Grasp(grasp.contacts).quality("orthogonality", approach=[0, 0, 1.0])
    with pytest.raises(InputError, match="expected a direction"):
        grasp.quality("orthogonality", approach=[0, 0, 0.0])


def test_min_weight_has_the_sign_of_closure():
    rng = np.random.default_rng(9)
    for _ in range(20):
        grasp = random_grasp(rng, 4, spread=0.5)
        found = grasp.quality("min_weight", m=16)
        if found.value > 1e-9:
            assert grasp.force_closure().success
