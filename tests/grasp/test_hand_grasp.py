"""Hand Jacobians against finite differences, the reference hands and the scripts' example of two SCARAs."""

import numpy as np
import pytest

import apprehend as ap
from apprehend.errors import InputError
from apprehend.grasp import Contact, ContactModel, ForceStatus, Grasp, HandGrasp, Limits, hand_jacobian
from tests.grasp.makers import contact, random_grasp
from tests.support import reference


def scara(l1, l2, t1, t2):
    """G 1.21: spatial Jacobian of a SCARA, joints (θ₁, θ₂, θ₃, z), with l₃ = 0."""
    x1, y1 = l1 * np.cos(t1), l1 * np.sin(t1)
    x2, y2 = x1 + l2 * np.cos(t1 + t2), y1 + l2 * np.sin(t1 + t2)
    J = np.zeros((6, 4))
    J[0, 1:3], J[1, 1:3], J[5, :3], J[2, 3] = (x1, x2), (y1, y2), 1.0, 1.0
    return J


def test_example_1_21_scara():
    """The printed spatial Jacobian, from a robot with the axes that the script reads off."""
    from apprehend.robots.description import Description, Joint, JointLimits, JointType, Link

    l1, l2 = 0.35, 0.25
    at = [np.zeros(3), np.array([0, l1, 0]), np.array([0, l2, 0]), np.zeros(3)]
    joints = []
    for i, (kind, p) in enumerate(zip([JointType.REVOLUTE] * 3 + [JointType.PRISMATIC], at, strict=True)):
        T = np.eye(4)
        T[:3, 3] = p
        limits = JointLimits(-3.0, 3.0, 1.0, 1.0, 1.0)
        joints.append(Joint(f"joint_{i}", kind, f"link_{i}", f"link_{i + 1}", T, np.array([0.0, 0, 1]), limits))
    links = {f"link_{i}": Link(f"link_{i}") for i in range(5)}
    robot = ap.Robot(Description("scara", "link_0", links, tuple(joints)))
    for q in np.random.default_rng(0).uniform(-1.0, 1.0, (5, 4)):
        found = robot.jacobian(q, "link_4", "spatial")
        np.testing.assert_allclose(found, scara(l1, l2, q[0], q[1]), atol=1e-15)


def adjoint_inverse(R, p):
    P = np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])
    A = np.zeros((6, 6))
    A[:3, :3] = A[3:, 3:] = R.T
    A[:3, 3:] = -R.T @ P
    return A


def box_in_two_scaras(model):
    """G 2.15: both Jacobians put together as in Definition 2.12."""
    r, a, b, l1, l2, t1, t2 = 0.1, 0.3, 0.5, 0.35, 0.25, 0.4, 0.7
    R1 = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
    R2 = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    contacts = [
        Contact(np.array([0, -r, 0]), R1[:, 2], 0.5, model, 0.1, R1[:, 0]),
        Contact(np.array([0, r, 0]), R2[:, 2], 0.5, model, 0.1, R2[:, 0]),
    ]
    grasp = Grasp(contacts)
    blocks = []
    for c, R, p in zip(contacts, (R1, R2), ([0, b - r, a], [0, r - b, a]), strict=True):
        blocks.append(c.basis.T @ adjoint_inverse(R, np.array(p)) @ scara(l1, l2, t1, t2))
    J = np.zeros((len(blocks[0]) + len(blocks[1]), 8))
    J[: len(blocks[0]), :4], J[len(blocks[0]) :, 4:] = blocks
    c1, c12, s1, s12 = np.cos(t1), np.cos(t1 + t2), np.sin(t1), np.sin(t1 + t2)
    printed = np.array(
        [
            [0, 0, 0, 1],
            [-b + r, -b + r + l1 * c1, -b + r + l1 * c1 + l2 * c12, 0],
            [0, l1 * s1, l1 * s1 + l2 * s12, 0],
        ]
    )
    return grasp, J, printed


def test_example_2_15_two_scaras():
    grasp, J, printed = box_in_two_scaras(ContactModel.SOFT)
    np.testing.assert_allclose(J[:3, :4], printed, atol=1e-15)
    r, b, l1, l2, t1, t2 = 0.1, 0.5, 0.35, 0.25, 0.4, 0.7
    c1, c12, s1, s12 = np.cos(t1), np.cos(t1 + t2), np.sin(t1), np.sin(t1 + t2)
    second = [
        [b - r, b - r + l1 * c1, b - r + l1 * c1 + l2 * c12, 0],
        [0, 0, 0, 1],
        [0, -l1 * s1, -l1 * s1 - l2 * s12, 0],
        [0, 0, 0, 0],
    ]
    np.testing.assert_allclose(J[4:, 4:], second, atol=1e-15)
    np.testing.assert_allclose(J[3], 0.0, atol=1e-15)  # no finger turns about its contact normal
    held = HandGrasp(grasp, J)
    assert grasp.force_closure().success
    assert not held.manipulable
    np.testing.assert_allclose(np.abs(held.immovable.T), [[0, 0, 0, 0, 1, 0]], atol=1e-12)
    # the moments about both normals are structural forces (the script's third one needs both tangents of one finger)
    S = held.structural_forces
    for index in (3, 7):
        e = np.eye(8)[index]
        np.testing.assert_allclose(S @ (S.T @ e), e, atol=1e-12)
    np.testing.assert_allclose(held.torques(S.T), 0.0, atol=1e-12)
    hard, J3, _ = box_in_two_scaras(ContactModel.COULOMB)
    held = HandGrasp(hard, J3)
    assert not hard.force_closure().success
    assert held.manipulable
    rows = {row.property: row for row in held.table()}
    assert not rows["force closure"].holds
    assert rows["manipulable"].holds
    assert rows["loose object motions"].dimension == 1
    assert rows["internal motions"].dimension == 8 - 6


def test_reference_hand_tables():
    for case in reference("hand_jacobian_allegro.json")["cases"]:
        given, want = case["inputs"], case["expected"]
        grasp = Grasp([contact(row) for row in given["contacts"]], reference=given["object_centre"])
        np.testing.assert_allclose(grasp.matrix, want["G"], atol=1e-9)
        held = HandGrasp(grasp, np.array(want["hand_jacobian"]))
        assert grasp.rank == want["rank_G"]
        assert grasp.null_space.shape[1] == want["dim_null_G_internal"]
        assert held.loose_motions.shape[1] == want["dim_null_GT_indeterminate"]
        assert held.internal_motions.shape[1] == want["dim_null_J_redundant"]
        assert held.structural_forces.shape[1] == want["dim_null_JT_defective"]
        assert held.manipulable == want["manipulable_G_T_in_range_J"]


def test_jacobian_equals_finite_differences_and_keeps_power():
    hand = ap.Hand.load("robotiq_2f_85")
    q = hand.jaw.q_at(0.05)
    tcp = hand.jaw.tcp_at(0.05)
    x = tcp[:3, 0]
    made = [Contact(tcp[:3, 3] + s * 0.025 * x, -s * x, 0.5, ContactModel.SOFT, 0.01) for s in (1.0, -1.0)]
    grasp = Grasp(made, reference=tcp[:3, 3])
    J = hand_jacobian(hand, q, grasp, hand.jaw.pad_links)
    h = 1e-6
    for i in range(hand.n):
        step = np.zeros(hand.n)
        step[i] = h
        for c, s, link in zip(made, grasp.slices, hand.jaw.pad_links, strict=True):
            T0, Tp, Tm = (hand.robot.fk(v, link) for v in (q, q + step, q - step))
            local = T0[:3, :3].T @ (c.position - T0[:3, 3])
            speed = ((Tp[:3, :3] - Tm[:3, :3]) @ local + Tp[:3, 3] - Tm[:3, 3]) / (2 * h)
            turning = (Tp[:3, :3] - Tm[:3, :3]) @ T0[:3, :3].T / (2 * h)
            omega = np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
            want = np.append(c.rotation.T @ speed, c.normal @ omega)
            np.testing.assert_allclose(J[s, i], want, atol=1e-7)
    held = HandGrasp.of(hand, q, grasp, hand.jaw.pad_links)
    rng = np.random.default_rng(0)
    f, rate = rng.normal(size=8), rng.normal(size=hand.n)
    assert held.torques(f) @ rate == pytest.approx(f @ held.contact_velocity(rate))
    V = rng.normal(size=6)
    assert grasp.object_wrench(f) @ V == pytest.approx(f @ grasp.contact_velocity(V))
    # one motor cannot move the object freely, but closing is a motion it can make
    assert not held.manipulable
    assert held.joint_velocity(np.zeros(6))[1] == pytest.approx(0.0)


def test_forces_and_velocities_both_ways():
    """Going there and back through the four maps of G 2.6."""
    rng = np.random.default_rng(0)
    grasp = random_grasp(rng, 3)
    J = rng.normal(size=(9, 12))
    held = HandGrasp(grasp, J)
    assert held.manipulable
    V = rng.normal(size=(4, 6))
    rates, left = held.joint_velocity(V)
    np.testing.assert_allclose(left, 0.0, atol=1e-12)
    back, slip = held.object_twist(rates)
    np.testing.assert_allclose(back, V, atol=1e-10)
    np.testing.assert_allclose(slip, 0.0, atol=1e-10)
    f = rng.normal(size=(4, 9))
    again, left = held.contact_forces(held.torques(f))
    np.testing.assert_allclose(again, f, atol=1e-10)
    np.testing.assert_allclose(left, 0.0, atol=1e-10)
    # power is the same everywhere: joints, contacts, object
    np.testing.assert_allclose(
        (held.torques(f) * rates).sum(axis=1), (grasp.object_wrench(f) * V).sum(axis=1), atol=1e-10
    )
    # torques on internal motions meet no contact
    idle = held.internal_motions[:, 0]
    force, left = held.contact_forces(idle)
    np.testing.assert_allclose(force, 0.0, atol=1e-10)
    assert left == pytest.approx(1.0)
    slipping = held.object_twist(np.linalg.pinv(J) @ grasp.null_space[:, 0])[1]
    assert slipping > 0.1


def test_measures_of_the_hand():
    rng = np.random.default_rng(1)
    grasp = Grasp(random_grasp(rng, 3).contacts, length=0.5)
    held = HandGrasp(grasp, rng.normal(size=(9, 10)))
    W = np.diag([1.0, 1, 1, 0.5, 0.5, 0.5])
    H = W @ np.linalg.pinv(grasp.matrix.T) @ held.jacobian
    s = np.linalg.svd(H, compute_uv=False)
    assert held.quality() == pytest.approx(s[-1])
    assert held.quality("manipulability") == pytest.approx(np.sqrt(np.linalg.det(H @ H.T)))
    assert held.quality("uniformity") == pytest.approx(s[-1] / s[0])
    d = rng.normal(size=6)
    unit = W @ d / np.linalg.norm(W @ d)
    want = 1.0 / np.sqrt(unit @ np.linalg.inv(H @ H.T) @ unit)
    assert held.quality("transmission", direction=d) == pytest.approx(want)
    one = HandGrasp(grasp, np.outer(np.ones(9), [1.0]))
    assert one.quality("transmission", direction=d) == 0.0
    assert one.quality() == 0.0
    low, high = np.full(10, -1.0), np.full(10, 3.0)
    assert held.quality("joint_centring", q=np.ones(10), lower=low, upper=high) == 0.0
    assert held.quality("joint_centring", q=high, lower=low, upper=high) == 1.0
    for kind, options, message in (
        ("beauty", {}, "kind is 'beauty'"),
        ("transmission", {}, "needs direction"),
        ("transmission", {"direction": np.zeros(6)}, "not all zero"),
        ("uniformity", {"q": 1}, "does not take q"),
        ("joint_centring", {"q": low, "lower": low, "upper": low}, "upper must be above lower"),
    ):
        with pytest.raises(InputError, match=message):
            held.quality(kind, **options)


def test_bad_hands_are_named():
    grasp = random_grasp(np.random.default_rng(0), 2)
    with pytest.raises(InputError, match=r"expected \(6, n\)"):
        HandGrasp(grasp, np.zeros((3, 2)))
    hand = ap.Hand.load("robotiq_2f_85")
    with pytest.raises(InputError, match="names 1 links; the grasp has 2"):
        hand_jacobian(hand, np.zeros(hand.n), grasp, ["base_link"])


def pair(mu=0.5):
    return Grasp(
        [Contact(np.array([s, 0.0, 0.0]), np.array([-s, 0.0, 0.0]), mu, ContactModel.SOFT, 0.1) for s in (1.0, -1.0)]
    )


def test_largest_force_along_a_direction():
    grasp, each = pair(), Limits(normal=10.0)
    up = np.array([0, 0, 1.0, 0, 0, 0])
    found = grasp.largest_force(up, each)
    assert found.success
    assert found.value == pytest.approx(10.0, rel=1e-7)  # 2 µ f
    assert found.bound == pytest.approx(10.0, rel=1e-7)
    np.testing.assert_allclose(grasp.matrix @ found.forces, found.wrench, atol=1e-6)
    loaded = grasp.largest_force(up, each, external=[0, 0, -4.0, 0, 0, 0])
    assert loaded.value == pytest.approx(6.0, rel=1e-7)
    aside = grasp.largest_force(up, each, opening=1.0)
    assert aside.value == pytest.approx(10.0, rel=1e-6)
    heavy = grasp.largest_force(up, each, external=[0, 0, -11.0, 0, 0, 0])
    assert heavy.status is ForceStatus.INFEASIBLE
    assert grasp.largest_force(up, Limits()).status is ForceStatus.UNBOUNDED
    along = np.array([1.0, 0, 0, 0, 0, 0])
    assert grasp.largest_force(along, each).value == pytest.approx(10.0, rel=1e-7)


def test_a_cone_of_directions_is_at_least_as_good():
    rng = np.random.default_rng(2)
    for _ in range(10):
        grasp = random_grasp(rng, 4, friction=0.7)
        F = np.append(rng.normal(size=3), np.zeros(3))
        one = grasp.largest_force(F, Limits(total=1.0))
        cone = grasp.largest_force(F, Limits(total=1.0), opening=0.5)
        assert cone.value >= one.value - 1e-8


@pytest.mark.parametrize(
    ("direction", "options", "message"),
    [
        (np.zeros(6), {}, "not all zero"),
        (np.eye(6)[3], {"opening": 0.1}, "no force part"),
        (np.eye(6)[0], {"opening": -0.1}, "opening is -0.1"),
        (np.eye(6)[0], {"external": [1.0]}, "external has shape"),
    ],
)
def test_bad_pushes_are_named(direction, options, message):
    with pytest.raises(InputError, match=message):
        pair().largest_force(direction, Limits(total=1.0), **options)
