"""Contact forces of families and of many grasps, derivatives of the optimum, proofs, and hostile cases."""

import numpy as np
import pytest

from apprehend.errors import InputError
from apprehend.grasp import Contact, ContactModel, ForceStatus, Grasp, Limits, optimal_forces
from tests.grasp.makers import random_force, random_grasp
from tests.grasp.test_forces import clarabel_value

COSTS = ("min_normal", "min_norm", "min_largest", "min_largest_norm")


def closed_grasp(rng, k, **options):
    while True:
        grasp = random_grasp(rng, k, **options)
        if grasp.force_closure().success:
            return grasp


def loop(rng, count, step):
    """Wrenches along a curve."""
    a, b = rng.normal(size=(2, 6))
    t = step * np.arange(count)[:, None]
    return np.cos(t) * a + np.sin(t) * b


def push(grasp, d):
    """The most that unit normal forces in the cones push along a direction d of scaled wrench space."""
    most = []
    for contact, s in zip(grasp.contacts, grasp.slices, strict=True):
        g = (grasp.scale[:, None] * grasp.matrix).T[s] @ d
        if contact.size == 1:
            most.append(g[0])
            continue
        tangential = contact.friction * np.hypot(g[0], g[1])
        twist = contact.torsion * abs(g[3]) if contact.size == 4 else 0.0
        both = np.hypot(tangential, twist) if contact.model is ContactModel.SOFT else tangential + twist
        most.append(g[2] + both)
    return np.array(most)


@pytest.mark.parametrize("objective", ["min_normal", "min_norm", "max_margin"])
def test_families_take_fewer_steps_to_the_same_values(objective):
    rng = np.random.default_rng(3)
    grasp, W = closed_grasp(rng, 4), loop(rng, 400, 1e-3)
    limits = Limits(normal=40.0) if objective == "max_margin" else None
    cold, warm = (grasp.contact_forces(W, objective, limits, family=f) for f in (False, True))
    assert cold.success.all()
    assert warm.success.all()
    np.testing.assert_allclose(warm.value, cold.value, rtol=1e-7)
    assert warm.steps.mean() < 0.7 * cold.steps.mean()


def test_a_family_may_pass_through_what_cannot_be_held():
    rng = np.random.default_rng(0)
    grasp = random_grasp(rng, 3)
    turn = 1e-2 * np.arange(600)[:, None]
    held = -grasp.matrix @ np.concatenate([random_force(rng, c) for c in grasp.contacts])
    W = np.cos(turn) * held + 0.1 * np.sin(turn) * rng.normal(size=6)
    cold, warm = grasp.contact_forces(W), grasp.contact_forces(W, family=True)
    assert 0.01 < cold.success.mean() < 0.9
    np.testing.assert_array_equal(warm.codes, cold.codes)


def test_one_answer_starts_the_next():
    rng = np.random.default_rng(1)
    grasp, w = closed_grasp(rng, 5), rng.normal(size=6)
    first = grasp.contact_forces(w)
    near = w + 1e-3 * rng.normal(size=6)
    cold, warm = grasp.contact_forces(near), grasp.contact_forces(near, start=first)
    assert warm.value == pytest.approx(cold.value, rel=1e-8)
    assert warm.steps < cold.steps
    with pytest.raises(InputError, match="answer of another objective"):
        grasp.contact_forces(near, limits=Limits(normal=1e3), start=first)


@pytest.mark.parametrize("model", list(ContactModel))
def test_many_grasps_equal_each_grasp(model):
    rng = np.random.default_rng(2)
    N, k = 21, 8 if model is ContactModel.FRICTIONLESS else 4
    p = rng.normal(size=(N, k, 3))
    p /= np.linalg.norm(p, axis=-1, keepdims=True)
    n = -p + 0.2 * rng.normal(size=p.shape)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    mu, gamma = rng.uniform(0.2, 1.0, (N, k)), rng.uniform(0.05, 0.2, (N, k))
    about, length, w = 0.1 * rng.normal(size=(N, 3)), rng.uniform(0.5, 2.0, N), rng.normal(size=(N, 6))
    p[3], n[3] = p[3, 0], n[3, 0]  # all contacts at one place: flat, solved by itself
    for objective, limits in (("min_normal", None), ("min_norm", None), ("min_largest_norm", Limits(normal=20.0))):
        found = optimal_forces(
            p, n, w, mu, model, gamma, objective=objective, limits=limits, reference=about, length=length
        )
        for i in range(N):
            contacts = [Contact(p[i, c], n[i, c], mu[i, c], model, gamma[i, c]) for c in range(k)]
            grasp = Grasp(contacts, reference=about[i], length=length[i])
            one = grasp.contact_forces(w[i], objective, limits)
            assert found.status[i] is one.status
            if one.success:
                assert found.value[i] == pytest.approx(one.value, rel=1e-7)
                np.testing.assert_allclose(grasp.matrix @ found.forces[i], -w[i], atol=1e-10)
            else:
                assert found.certificate[i] @ (grasp.scale * -w[i]) > 0.0


def test_many_grasps_in_any_shape_and_wrong_ones():
    p = np.array([[1.0, 0, 0], [-1.0, 0, 0]]) * np.ones((2, 3, 1, 1))
    found = optimal_forces(p, -p, [0, 0, -10.0, 0, 0, 0], 0.5, "soft", 0.1)
    np.testing.assert_allclose(found.value, np.full((2, 3), 20.0), rtol=1e-8)
    assert found.forces.shape == (2, 3, 8)
    assert found.status[1, 2] is ForceStatus.OPTIMAL
    with pytest.raises(InputError, match=r"wrenches have shape \(4, 6\); expected \(2, 3, 6\)"):
        optimal_forces(p, -p, np.ones((4, 6)))
    with pytest.raises(InputError, match="objective is 'barrier'"):
        optimal_forces(p, -p, np.ones(6), objective="barrier")


def test_the_gradient_and_the_multipliers_are_derivatives():
    rng = np.random.default_rng(5)
    grasp, w = closed_grasp(rng, 5, friction=0.5), rng.normal(size=6)
    J = grasp.null_space[:, :1]
    for objective in COSTS:
        free = grasp.contact_forces(w, objective)
        step = 1e-5 * rng.normal(size=6)
        ahead, behind = (grasp.contact_forces(w + s * step, objective).value for s in (1, -1))
        assert (ahead - behind) / 2 == pytest.approx(free.gradient @ step, rel=1e-3, abs=1e-9)
    plain, even = (grasp.contact_forces(w, objective) for objective in ("min_normal", "min_largest"))
    most = 0.5 * float(plain.forces[2::3].max() + even.value)
    least = grasp.contact_forces(w, "min_torque", Limits(hand_jacobian=J)).value
    torque = 0.5 * (float(np.abs(J.T @ plain.forces).max()) + least)
    for limits, grown in (
        (Limits(normal=most), Limits(normal=most * 1.0001)),
        (Limits(hand_jacobian=J, torque_upper=torque), Limits(hand_jacobian=J, torque_upper=torque * 1.0001)),
    ):
        tight, wider = (grasp.contact_forces(w, "min_normal", limit) for limit in (limits, grown))
        assert tight.success
        assert tight.reached
        assert set(tight.reached) == {name for name, v in tight.multipliers.items() if v > 1e-5}
        gain = sum(tight.multipliers.values()) * 1e-4 * (most if limits.normal is not None else torque)
        assert tight.value - wider.value == pytest.approx(gain, rel=2e-2)


def test_certificates_are_proofs():
    rng = np.random.default_rng(7)
    models = list(ContactModel)
    proofs = 0
    for i in range(150):
        k = int(rng.integers(1, 6))
        grasp = random_grasp(rng, k, [models[j] for j in rng.integers(0, 4, size=k)], torsion=0.2)
        w = rng.normal(size=6) * 10.0 ** rng.uniform(-4, 5)
        limits = Limits(normal=np.linalg.norm(w) * rng.uniform(0.1, 2.0)) if i % 2 else None
        found = grasp.contact_forces(w, "min_norm", limits)
        if found.status is not ForceStatus.INFEASIBLE:
            continue
        proofs += 1
        d, pushed = found.certificate, push(grasp, found.certificate)
        allowed = 0.0
        if limits is not None:
            weight = np.array([found.multipliers[f"normal force of contact {c}"] for c in range(k)])
            assert (weight > -1e-9).all()
            pushed = pushed - weight
            allowed = float(weight.sum() * limits.normal)
        size = np.abs(grasp.scale[:, None] * grasp.matrix).max() * np.linalg.norm(d)
        assert pushed.max() <= 1e-6 * size
        assert d @ (grasp.scale * -w) > allowed * (1 - 1e-7)
        assert d @ (grasp.scale * -w) > 0.0
    assert proofs > 40


def hostile(rng, kind):
    k = int(rng.choice([2, 3, 4, 5, 8]))
    contacts = list(random_grasp(rng, k, friction=rng.uniform(0.2, 1.0)).contacts)
    if kind == "one place":
        contacts[1] = Contact(contacts[0].position, contacts[1].normal, contacts[1].friction)
    if kind == "redundant":
        contacts += contacts[:2]
    if kind == "flat":
        squeeze = np.array([1.0, 1.0, 10.0 ** rng.uniform(-6, -1)])
        contacts = [Contact(squeeze * c.position, c.normal, c.friction) for c in contacts]
    if kind == "millimetres":
        contacts = [Contact(1e3 * c.position, c.normal, c.friction) for c in contacts]
    grasp = Grasp(contacts, reference=np.zeros(3))
    f = np.concatenate([random_force(rng, c) * rng.exponential() for c in contacts])
    if kind == "boundary":
        turn = rng.uniform(0, 2 * np.pi, len(contacts))
        rim = [[c.friction * np.cos(a), c.friction * np.sin(a), 1.0] for c, a in zip(contacts, turn, strict=True)]
        f = np.concatenate([rng.exponential() * np.array(r) * (rng.random() < 0.7) for r in rim])
    w = -grasp.matrix @ f
    if rng.random() < 0.3 and kind != "boundary":
        w = rng.normal(size=6) * np.abs(w).max()
    return grasp, w * 10.0 ** rng.uniform(-4, 4)


@pytest.mark.parametrize("kind", ["one place", "redundant", "flat", "millimetres", "boundary"])
def test_hostile_grasps_beside_a_peer(kind):
    rng = np.random.default_rng(11)
    compared = 0
    for _ in range(60):
        grasp, w = hostile(rng, kind)
        # the peer gets the same problem in comparable units, which it needs more than we do
        size = float(np.abs(w).max()) or 1.0
        found = grasp.contact_forces(w)
        peer = clarabel_value(grasp, w / size, "min_normal")
        assert np.isfinite(found.forces).all()
        assert not np.isnan([found.value, found.bound, found.residual]).any()
        assert found.status in (ForceStatus.OPTIMAL, ForceStatus.INFEASIBLE)
        if found.success:
            rest = np.abs(grasp.scale * (grasp.matrix @ found.forces + w)).max()
            assert rest <= 1e-11 * max(np.abs(grasp.scale * w).max(), np.abs(found.forces).max() * 1e3)
            assert found.slack.min() >= -1e-8 * np.abs(found.forces).max()
        if peer is not None and not np.isnan(peer) and found.success:
            compared += 1
            if kind != "millimetres":  # there the peer's own digits end
                assert found.value == pytest.approx(
                    peer * size, rel=1e-6 if kind in ("flat", "boundary") else 1e-7, abs=1e-9 * size
                )
    assert compared > 15


def test_no_wrench_needs_no_forces():
    rng = np.random.default_rng(0)
    grasp = closed_grasp(rng, 4)
    for objective in (*COSTS, "feasible"):
        found = grasp.contact_forces(np.zeros(6), objective)
        assert found.success
        assert not found.forces.any()
        assert found.value == found.bound == 0.0
    assert grasp.contact_forces(np.zeros(6), "max_margin").status is ForceStatus.UNBOUNDED
    assert grasp.contact_forces(np.zeros(6), "max_margin", Limits(total=4.0)).value > 0.1


@pytest.mark.parametrize("wrench", [[np.nan, 0, 0, 0, 0, 0], [np.inf, 0, 0, 0, 0, 0]])
def test_wrenches_that_are_not_finite_are_named(wrench):
    grasp = random_grasp(np.random.default_rng(0), 4)
    for given in (np.array(wrench), wrench, [wrench]):
        with pytest.raises(InputError, match=r"wrench\[.*0\] is (nan|inf)"):
            grasp.contact_forces(given)


def test_the_balance_holds_to_the_last_digits():
    rng = np.random.default_rng(4)
    grasp = closed_grasp(rng, 5)
    W = rng.normal(size=(50, 6))
    for objective in (*COSTS, "feasible"):
        found = grasp.contact_forces(W, objective)
        np.testing.assert_allclose(found.forces @ grasp.matrix.T, -W, atol=1e-11 * np.abs(found.forces).max())


def test_centres_in_batches_are_those_of_single_wrenches():
    rng = np.random.default_rng(6)
    grasp = closed_grasp(rng, 4, model=ContactModel.SOFT)
    W = rng.normal(size=(2, 5, 6))
    limits = Limits(normal=60.0)
    for given in (None, limits):
        found = grasp.contact_forces(W, "barrier", given)
        assert found.success.all()
        for i in np.ndindex(2, 5):
            one = grasp.contact_forces(W[i], "barrier", given)
            assert one.value == pytest.approx(found.value[i], rel=1e-9)
            np.testing.assert_allclose(one.forces, found.forces[i], rtol=1e-6)
            for direction in grasp.null_space.T:
                for sign in (-1e-3, 1e-3):
                    moved = one.forces + sign * direction
                    value = sum(
                        moved[s][2] - np.linalg.slogdet(c.lmi(moved[s]))[1]
                        for c, s in zip(grasp.contacts, grasp.slices, strict=True)
                    )
                    assert value >= one.value - 1e-8
    assert grasp.contact_forces(W[0, 0], "barrier", weights=np.zeros(4)).status is ForceStatus.UNBOUNDED
    open_grasp = random_grasp(rng, 1)
    assert open_grasp.contact_forces(W[0, 0], "barrier").status is ForceStatus.INFEASIBLE
