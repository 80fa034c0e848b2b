"""Optimal contact forces against the reference, a peer solver, and their own certificates."""

import numpy as np
import pytest

from apprehend.errors import InputError
from apprehend.grasp import Contact, ContactModel, ForceStatus, Grasp, Limits
from tests.grasp.makers import contact, random_grasp
from tests.support import reference

OBJECTIVES = {
    "min_sum_sq": "min_norm", "min_sum_normal": "min_normal", "min_max_normal": "min_largest",
    "min_max_force_norm": "min_largest_norm", "max_margin": "max_margin",
}  # fmt: skip


def limits_of(given, grasp):
    if given["torque_limit"] is None:
        return Limits(normal=given["normal_force_max"])
    blocks = [np.array(J) for J in given["finger_jacobian_contact_frame"]]
    J = np.zeros((grasp.matrix.shape[1], sum(b.shape[1] for b in blocks)))
    column = 0
    for b, s in zip(blocks, grasp.slices, strict=True):
        J[s.start : s.start + 3, column : column + b.shape[1]] = b
        column += b.shape[1]
    return Limits(
        normal=given["normal_force_max"], hand_jacobian=J, torque_upper=np.concatenate(given["torque_limit"]),
        torque_offset=np.concatenate(given["torque_offset"]),
    )  # fmt: skip


def check(grasp, wrench, found):
    assert np.abs(grasp.matrix @ found.forces + wrench).max() < 1e-7 * (1 + np.abs(wrench).max())
    assert found.slack.min() > -1e-7 * (1 + np.abs(found.forces).max())


def test_reference_optima():
    for case in reference("grasp_force_optimization.json")["cases"]:
        given, want = case["inputs"], case["expected"]
        if given["objective"] not in OBJECTIVES:
            continue
        grasp = Grasp([contact(row) for row in given["contacts"]], reference=np.zeros(3), length=0.05)
        w = np.array(given["external_wrench_at_origin"])
        found = grasp.contact_forces(w, OBJECTIVES[given["objective"]], limits_of(given, grasp))
        if not want.get("feasible", True):
            assert found.status is ForceStatus.INFEASIBLE
            d = found.certificate
            scaled = grasp.scale[:, None] * grasp.matrix
            base, spread, _ = grasp.generators
            assert d @ (grasp.scale * -w) > 0
            assert (base @ d + np.linalg.norm(spread @ d, axis=1)).max() <= 1e-7 * np.abs(scaled.T @ d).max()
            continue
        assert found.success, case["id"]
        assert found.value == pytest.approx(want["optimum"], rel=1e-7), case["id"]
        assert found.gap <= 1e-7 * (1 + abs(found.value))
        check(grasp, w, found)


def test_barrier_reference_centre_is_stationary():
    """The reference's barrier has another matrix; ours is checked by its optimality: no internal force improves it."""
    for case in reference("grasp_force_optimization.json")["cases"]:
        given = case["inputs"]
        if given["objective"] != "lmi_analytic_centre":
            continue
        grasp = Grasp([contact(row) for row in given["contacts"]], reference=np.zeros(3), length=0.05)
        w = np.array(given["external_wrench_at_origin"])
        found = grasp.contact_forces(w, "barrier", limits_of(given, grasp))
        assert found.success
        check(grasp, w, found)
        assert found.slack.min() > 0.0

        def value(f, grasp=grasp):
            total = 0.0
            for c, s in zip(grasp.contacts, grasp.slices, strict=True):
                total += f[s][2] - np.linalg.slogdet(c.lmi(f[s]))[1]
            return total

        assert value(found.forces) == pytest.approx(found.value)
        for direction in grasp.null_space.T:
            for sign in (-1e-4, 1e-4):
                assert value(found.forces + sign * direction) >= found.value - 1e-9


def clarabel_value(grasp, w, objective):
    clarabel = pytest.importorskip("clarabel")
    import scipy.sparse as sp

    m = grasp.matrix.shape[1]
    rows, right, cones = [grasp.matrix], [-w], [clarabel.ZeroConeT(6)]
    normal = np.zeros(m)
    for c, s in zip(grasp.contacts, grasp.slices, strict=True):
        B = np.zeros((c.size if c.size > 1 else 1, m))
        if c.size == 1:
            B[0, s.start] = -1.0
            normal[s.start] = 1.0
            cones.append(clarabel.NonnegativeConeT(1))
            rows.append(B)
            right.append(np.zeros(1))
            continue
        normal[s.start + 2] = 1.0
        B[0, s.start + 2] = -1.0
        B[1, s.start], B[2, s.start + 1] = -1.0 / c.friction, -1.0 / c.friction
        if c.model is ContactModel.SOFT:
            B[3, s.start + 3] = -1.0 / c.torsion
        if c.model is ContactModel.SOFT_BOX:
            B = B[:3]
            T = np.zeros((2, m))
            T[:, s.start + 2] = -c.torsion
            T[0, s.start + 3], T[1, s.start + 3] = 1.0, -1.0
            rows.append(T)
            right.append(np.zeros(2))
            cones.append(clarabel.NonnegativeConeT(2))
        rows.append(B)
        right.append(np.zeros(len(B)))
        cones.append(clarabel.SecondOrderConeT(len(B)))
    quadratic = objective == "min_norm"
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    solver = clarabel.DefaultSolver(
        sp.csc_matrix(2.0 * np.eye(m) if quadratic else np.zeros((m, m))), np.zeros(m) if quadratic else normal,
        sp.csc_matrix(np.vstack(rows)), np.concatenate(right), cones, settings,
    )  # fmt: skip
    answer = solver.solve()
    text = str(answer.status)
    return answer.obj_val if "Solved" in text else None if "Infeasible" in text else np.nan


@pytest.mark.parametrize("objective", ["min_normal", "min_norm"])
@pytest.mark.parametrize("k", [2, 3, 5, 16])
def test_equal_to_a_peer_on_random_grasps(objective, k):
    rng = np.random.default_rng(k)
    models = list(ContactModel)
    for _ in range(25):
        chosen = [models[i] for i in rng.integers(0, 4, size=k)]
        grasp = random_grasp(rng, k, chosen, torsion=0.2)
        w = rng.normal(size=6) * 10.0 ** rng.uniform(-3, 3)
        found, peer = grasp.contact_forces(w, objective), clarabel_value(grasp, w, objective)
        if peer is not None and np.isnan(peer):
            continue
        if peer is None:
            assert found.status is ForceStatus.INFEASIBLE
            assert found.certificate @ (grasp.scale * -w) > 0.0
        else:
            assert found.success
            assert found.value == pytest.approx(peer, rel=1e-7, abs=1e-9)
            check(grasp, w, found)


def test_batches_equal_single_calls_and_scale():
    rng = np.random.default_rng(0)
    grasp = random_grasp(rng, 5)
    W = rng.normal(size=(40, 6))
    batch = grasp.contact_forces(W)
    for i in range(0, 40, 7):
        one = grasp.contact_forces(W[i])
        assert batch.status[i] is one.status
        assert batch.value[i] == one.value
    np.testing.assert_allclose(grasp.contact_forces(1e4 * W).value, 1e4 * batch.value, rtol=1e-7)


def test_limits_bind_and_are_named():
    pair = [
        Contact(np.array([s, 0.0, 0.0]), np.array([-s, 0.0, 0.0]), 0.5, ContactModel.SOFT, 0.1) for s in (1.0, -1.0)
    ]
    grasp = Grasp(pair)
    weight = np.array([0, 0, -10.0, 0, 0, 0])
    free = grasp.contact_forces(weight)
    assert free.value == pytest.approx(20.0)  # 10 N on each side hold 2 · µ · 10 = 10 N
    assert "friction cone of contact 0" in free.active
    assert grasp.contact_forces(weight, limits=Limits(normal=9.9)).status is ForceStatus.INFEASIBLE
    assert grasp.contact_forces(weight, limits=Limits(total=19.9)).status is ForceStatus.INFEASIBLE
    most = grasp.contact_forces(weight, "max_margin", Limits(normal=[15.0, 20.0]))
    assert most.success
    assert any("normal force of contact 0" in name for name in most.active)
    assert most.value == pytest.approx(15.0 - 10.0, rel=1e-6)  # f₃ − ‖f_t‖ / µ = 15 − 5 / 0.5
    J = np.zeros((8, 2))
    J[2, 0] = J[6, 1] = 0.1
    torque = grasp.contact_forces(weight, "min_torque", Limits(hand_jacobian=J))
    assert torque.value == pytest.approx(np.hypot(1.0, 1.0), rel=1e-7)
    np.testing.assert_allclose(torque.torques, [1.0, 1.0], atol=1e-6)
    tight = Limits(hand_jacobian=J, torque_lower=[-1, -1], torque_upper=[0.9, 2.0])
    assert grasp.contact_forces(weight, limits=tight).status is ForceStatus.INFEASIBLE


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"objective": "fastest"}, "objective is 'fastest'"),
        ({"objective": "min_torque"}, "needs limits.hand_jacobian"),
        ({"limits": Limits(normal=-1.0)}, "limits.normal is -1.0"),
        ({"limits": Limits(torque_upper=1.0)}, "without limits.hand_jacobian"),
        ({"limits": Limits(hand_jacobian=np.zeros((2, 2)))}, r"expected \(9, n\)"),
        (
            {"limits": Limits(hand_jacobian=np.zeros((9, 2)), torque_lower=[1, 0], torque_upper=[0, 1])},
            "joint 0 exclude each other",
        ),
        ({"weights": [1.0]}, "weights has shape"),
    ],
)
def test_bad_requests_are_named(options, message):
    with pytest.raises(InputError, match=message):
        random_grasp(np.random.default_rng(0), 3).contact_forces(np.ones(6), **options)
