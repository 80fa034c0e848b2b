"""Many grasps at once: every verdict agrees with the cone program, and every proof is checked by hand."""

import numpy as np
import pytest

from apprehend.errors import InputError
from apprehend.grasp import Contact, ContactModel, Grasp, closed, force_closures
from tests.grasp.makers import random_grasp


def stacked(grasps):
    return (
        np.array([[c.position for c in g.contacts] for g in grasps]),
        np.array([[c.normal for c in g.contacts] for g in grasps]),
    )


def check_proofs(grasps, found):
    """Each verdict by its own proof, with the grasp's own matrix and cones."""
    for i, grasp in enumerate(grasps):
        if found.closed[i]:
            f = np.concatenate([found.forces[i, c, used(contact)] for c, contact in enumerate(grasp.contacts)])
            assert np.abs(grasp.scale * (grasp.matrix @ f)).max() < 1e-10
            slack = min(float(c.slack(f[s])) for c, s in zip(grasp.contacts, grasp.slices, strict=True))
            assert slack == pytest.approx(found.margin[i], abs=1e-12)
            assert slack > 1e-8
            assert grasp.rank == grasp.wrench_size
            assert found.forces[i, :, 2].sum() == pytest.approx(1.0)
        else:
            w = found.wrenches[i]
            assert np.linalg.norm(w) == pytest.approx(1.0)
            base, spread, box = grasp.generators
            s = spread @ w
            reach = np.where(box, np.hypot(s[:, 0], s[:, 1]) + np.abs(s[:, 2]), np.linalg.norm(s, axis=1))
            assert (base @ w + reach).max() < 1e-7


def used(contact):
    return [2] if contact.size == 1 else list(range(contact.size))


@pytest.mark.parametrize("model", list(ContactModel))
@pytest.mark.parametrize("k", [2, 3, 5, 8])
def test_proofs_and_agreement(model, k):
    rng = np.random.default_rng(k)
    grasps = [random_grasp(rng, k, model, torsion=0.2, spread=0.5) for _ in range(60)]
    found = force_closures(*stacked(grasps), 0.6, model, 0.2)
    check_proofs(grasps, found)
    np.testing.assert_array_equal(found.closed, closed(grasps))
    np.testing.assert_array_equal(found.closed, [g.force_closure().success for g in grasps])


def test_on_the_boundary():
    """Two contacts that face each other and a third: the origin is on the boundary of what they reach."""
    rng = np.random.default_rng(0)
    grasps = []
    for _ in range(40):
        third = random_grasp(rng, 1).contacts[0]
        pair = [Contact(np.array([s, 0.0, 0.0]), np.array([-s, 0.0, 0.0]), 0.6) for s in (1.0, -1.0)]
        grasps.append(Grasp([*pair, third]))
    found = force_closures(*stacked(grasps))
    check_proofs(grasps, found)
    assert not found.closed.all()


def test_batches_broadcast_and_scale():
    rng = np.random.default_rng(1)
    grasps = [random_grasp(rng, 4) for _ in range(12)]
    points, normals = stacked(grasps)
    flat = force_closures(points, normals)
    shaped = force_closures(points.reshape(3, 4, 4, 3), normals.reshape(3, 4, 4, 3), np.full(4, 0.6))
    np.testing.assert_array_equal(shaped.closed.ravel(), flat.closed)
    assert shaped.forces.shape == (3, 4, 4, 4)
    assert shaped.wrenches.shape == (3, 4, 6)
    # neither the unit of length nor the reference point decides
    moved = force_closures(1e-3 * points, normals, reference=1e-3 * points[:, 0], length=1e-3)
    np.testing.assert_array_equal(moved.closed, flat.closed)
    assert force_closures(points[:0], normals[:0]).closed.shape == (0,)


def test_margins_of_any_size():
    """Two fingers whose line leaves the cone by a hair, either way."""
    gaps = np.array([1e-2, 1e-4, 1e-6, -1e-6, -1e-4, -1e-2])
    mu = 0.5
    tilt = np.arctan(mu) - gaps
    normals = np.stack(
        [
            np.stack([np.cos(tilt), np.sin(tilt), 0.0 * tilt], axis=-1),
            np.stack([-np.cos(tilt), np.sin(tilt), 0.0 * tilt], axis=-1),
        ],
        axis=1,
    )
    points = np.broadcast_to([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], normals.shape)
    found = force_closures(points, normals, mu, "soft", 0.1)
    np.testing.assert_array_equal(found.closed, gaps > 0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p, n: (p, 2.0 * n), r"normals\[0, 0\] has length 2; expected 1"),
        (lambda p, n: (p[:, :2], n), "expected \\(..., k, 3\\) for both"),
        (lambda p, n: (p, n, -0.1), "friction\\[0, 0\\] is -0.1"),
        (lambda p, n: (p, n, 0.5, "sticky"), "'frictionless', 'coulomb'"),
        (lambda p, n: (p, n, np.ones(7)), r"friction has shape \(7,\); expected what spreads to \(2, 3\)"),
    ],
)
def test_bad_input_is_named(change, message):
    grasp = random_grasp(np.random.default_rng(0), 3)
    points, normals = stacked([grasp, grasp])
    with pytest.raises(InputError, match=message):
        force_closures(*change(points, normals))


def test_mixed_numbers_of_contacts_are_named():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match=r"\[2, 3\] contacts"):
        closed([random_grasp(rng, 2), random_grasp(rng, 3)])
    with pytest.raises(InputError, match="length is -1"):
        force_closures(np.zeros((2, 3)), np.tile([0.0, 0, 1], (2, 1)), length=-1.0)
