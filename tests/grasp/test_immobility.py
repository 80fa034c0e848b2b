"""First-order immobility against form closure, and its motions by moving the body."""

import numpy as np
import pytest

from apprehend.grasp import Contact, ContactModel, Grasp, ImmobilityStatus
from tests.support import reference


def smooth(points, normals):
    return Grasp([Contact(np.array(p, float), np.array(n, float), 0.0, ContactModel.FRICTIONLESS)
                  for p, n in zip(points, normals, strict=True)])  # fmt: skip


def test_is_form_closure():
    for case in reference("grasp_closure.json")["cases"]:
        want = case["expected"].get("form_closure")
        if want is None:
            continue
        normals = case["inputs"].get("normals_inward") or case["inputs"]["forces_inward"]
        grasp = smooth(case["inputs"]["points"], [np.array(n) / np.linalg.norm(n) for n in normals])
        found = grasp.immobility()
        assert found.success == want, case["id"]
        if not want:
            rates = grasp.matrix.T @ found.motion
            assert rates.min() > -1e-9
            assert np.linalg.norm(found.motion) > 1e-3
            np.testing.assert_allclose(rates, found.rates, atol=1e-9)


def test_a_body_that_can_leave():
    grasp = smooth([[0, 0, 0], [1, 0, 0]], [[0, 0, 1], [0, 0, 1]])
    found = grasp.immobility()
    assert found.status is ImmobilityStatus.MOBILE
    assert found.motion @ [0, 0, 1, 0, 0, 0] == pytest.approx(1.0)
    assert "contacts 0, 1 are left" in found.explain()


def test_a_disc_between_three_fingers_slides_only():
    turn = 2.0 * np.pi * np.arange(3) / 3
    points = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    found = smooth(points, -points).immobility()
    assert found.status is ImmobilityStatus.SLIDING
    assert found.freedom == 1
    np.testing.assert_allclose(np.abs(found.motion), [0, 0, 1], atol=1e-12)  # it turns
    assert "curvature decides" in found.explain()


def test_friction_does_not_count():
    """Two fingers with friction hold a box, and leave it every motion square to them."""
    pair = Grasp([Contact(np.array([s, 0.0, 0.0]), np.array([-s, 0.0, 0.0]), 0.5, ContactModel.SOFT, 0.1)
                  for s in (1.0, -1.0)])  # fmt: skip
    assert pair.force_closure().success
    found = pair.immobility()
    assert found.status is ImmobilityStatus.SLIDING
    assert found.freedom == 5
