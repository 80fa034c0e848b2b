"""Contact models: bases, cones and their matrix inequalities."""

import numpy as np
import pytest

from apprehend.errors import InputError
from apprehend.grasp import Contact, ContactModel, Grasp

SPATIAL = tuple(ContactModel)


def made(model, mu=0.7, gamma=0.3):
    return Contact(np.array([0.1, 0.2, 0.3]), np.array([0.6, 0.0, 0.8]), mu, model, gamma)


@pytest.mark.parametrize("model", SPATIAL)
def test_lmi_is_positive_exactly_inside_the_cone(model):
    rng = np.random.default_rng(0)
    contact = made(model)
    seen = set()
    for _ in range(300):
        f = rng.normal(size=contact.size) * 0.5
        f[0 if contact.size == 1 else 2] = abs(f[0 if contact.size == 1 else 2])
        slack = float(contact.slack(f))
        if abs(slack) < 1e-3:
            continue
        smallest = np.linalg.eigvalsh(contact.lmi(f))[0]
        assert (smallest > 0) == (slack > 0)
        seen.add(slack > 0)
    assert True in seen


@pytest.mark.parametrize("model", SPATIAL)
def test_frame_is_a_rotation_with_the_normal_last(model):
    contact = made(model)
    R = contact.rotation
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-15)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R[:, 2], contact.normal)


def test_directions_are_the_basis_turned_into_the_body():
    contact = made(ContactModel.SOFT)
    R = contact.rotation
    f = np.array([0.1, -0.2, 1.0, 0.05])
    w = contact.directions @ f
    np.testing.assert_allclose(w[:3], R @ f[:3])
    np.testing.assert_allclose(w[3:], R[:, 2] * f[3])
    np.testing.assert_array_equal(contact.basis[:, 3], [0, 0, 0, 0, 0, 1])


def test_slack_is_the_normal_force_left_over():
    contact = made(ContactModel.COULOMB, mu=0.5)
    assert contact.slack([0.3, 0.4, 1.5]) == pytest.approx(0.5)
    box, ellipse = made(ContactModel.SOFT_BOX, 0.5, 0.1), made(ContactModel.SOFT, 0.5, 0.1)
    f = [0.3, 0.4, 2.0, 0.1]
    assert box.slack(f) == pytest.approx(1.0)
    assert ellipse.slack(f) == pytest.approx(2.0 - np.sqrt(2.0))
    assert made(ContactModel.COULOMB, mu=0.0).slack([1e-3, 0.0, 1.0]) == -np.inf


def test_planar_contact():
    contact = Contact(np.array([1.0, 0.0]), np.array([-1.0, 0.0]), 0.4)
    np.testing.assert_allclose(np.linalg.det(contact.rotation), 1.0)
    np.testing.assert_allclose(contact.rotation[:, 1], [-1.0, 0.0])
    assert contact.slack([0.2, 1.0]) == pytest.approx(0.5)
    assert np.linalg.eigvalsh(contact.lmi([0.2, 1.0]))[0] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0, 0, 0], [0, 0, 2.0]), "has length 2; expected 1: divide"),
        (([0, 0, 0], [0, 0, 0.0]), "needs a direction"),
        (([0, 0, 0], [0, 0, 1.0], -0.5), "friction is -0.5"),
        (([0, 0, 0], [0, 0, 1.0], 0.5, "sticky"), "'sticky'; expected one of 'frictionless'"),
        (([0, 0, 0], [0, 0, 1.0], 0.5, "soft", -1.0), "torsion is -1.0"),
        (([0, 0], [0, 0, 1.0]), r"shape \(2,\) and normal \(3,\)"),
        (([0, 0], [0, 1.0], 0.5, "soft"), "no meaning in the plane"),
        (([0, 0, 0], [0, 0, 1.0], 0.5, "soft", 0.1, np.array([0, 1.0, 1.0])), "square to the normal"),
    ],
)
def test_bad_contacts_are_named(arguments, message):
    arrays = [np.asarray(a, dtype=float) if i < 2 else a for i, a in enumerate(arguments)]
    with pytest.raises(InputError, match=message):
        Contact(*arrays)


def test_bad_grasps_are_named():
    import apprehend as ap

    with pytest.raises(InputError, match="contacts is empty"):
        Grasp([])
    flat = Contact(np.array([1.0, 0.0]), np.array([-1.0, 0.0]))
    with pytest.raises(InputError, match="plane and in space are mixed"):
        Grasp([flat, made(ContactModel.COULOMB)])
    with pytest.raises(InputError, match=r"contact 0 at .* lies .* mm off the surface of 'box'"):
        Grasp([made(ContactModel.COULOMB)], ap.Body.box((0.1, 0.1, 0.1), mass=1.0, name="box"))
    with pytest.raises(InputError, match=r"length is 0\.0"):
        Grasp([flat], length=0.0)
    with pytest.raises(InputError, match="shape"):
        made(ContactModel.COULOMB).slack([1.0, 2.0])
