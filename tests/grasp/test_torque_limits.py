"""Torque limits given directly are the same as those of `Limits`."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.errors import InputError
from apprehend.grasp import Contact, Grasp, Limits


def pinch() -> Grasp:
    return Grasp(
        [
            Contact([-0.02, 0, 0], [1, 0, 0], 0.8, "soft", 0.01),
            Contact([0.02, 0, 0], [-1, 0, 0], 0.8, "soft", 0.01),
        ]
    )


def test_the_short_way_is_the_long_way() -> None:
    grasp = pinch()
    J = np.random.default_rng(0).normal(size=(grasp.matrix.shape[1], 4))
    w = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
    long = grasp.contact_forces(w, "min_normal", Limits(hand_jacobian=J, torque_lower=-9.0, torque_upper=9.0))
    for bounds in (np.full(4, 9.0), np.tile([-9.0, 9.0], (4, 1))):
        short = grasp.contact_forces(w, objective="min_normal", torque_limits=bounds, hand_jacobian=J)
        assert short.status is long.status
        assert np.allclose(short.forces, long.forces, atol=1e-9)
        assert (np.abs(J.T @ short.forces) <= 9.0 + 1e-9).all()


def test_limits_without_a_jacobian_are_explained() -> None:
    with pytest.raises(InputError, match="torque_limits need hand_jacobian="):
        pinch().contact_forces(np.zeros(6), torque_limits=[1.0])


def test_limits_of_a_wrong_shape_are_explained() -> None:
    grasp = pinch()
    J = np.zeros((grasp.matrix.shape[1], 2))
    with pytest.raises(InputError, match=r"torque_limits has shape \(2, 3\); expected \(n,\) or \(n, 2\)"):
        grasp.contact_forces(np.zeros(6), torque_limits=np.zeros((2, 3)), hand_jacobian=J)
