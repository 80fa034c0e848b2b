"""What callers get wrong, or ask of grasps that hold nothing: every answer is finite or infinite, and says why."""

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.errors import InputError, UnsuccessfulError
from apprehend.grasp import Contact, ContactModel, ForceStatus, Grasp, Limits, optimal_forces
from apprehend.grasp.forces import OBJECTIVES

WEIGHT = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])


def ring(k, model="coulomb", friction=0.5):
    angles = 2.0 * np.pi * np.arange(k) / k
    out = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    return Grasp([Contact(p, -p, friction, ContactModel(model), 0.02) for p in out])


@pytest.mark.parametrize("objective", [o for o in OBJECTIVES if o not in ("min_torque", "max_margin", "barrier")])
@pytest.mark.parametrize("model", [m.value for m in ContactModel])
def test_a_weight_that_nothing_holds_has_an_infinite_value(objective, model):
    grasp = ring(1, model) if model != "frictionless" else ring(3, model)
    one = grasp.contact_forces(WEIGHT, objective)
    many = grasp.contact_forces([WEIGHT, 2.0 * WEIGHT], objective)
    assert one.status is ForceStatus.INFEASIBLE
    assert one.value == one.bound == np.inf
    assert (many.value == np.inf).all()
    assert (many.bound == np.inf).all()
    assert list(many.status) == [ForceStatus.INFEASIBLE] * 2
    assert not one.forces.any()
    assert np.dot(one.certificate, -WEIGHT) > 0.0


def test_a_largest_margin_that_does_not_exist_is_minus_infinite():
    answer = ring(3, "frictionless").contact_forces(WEIGHT, "max_margin")
    assert answer.status is ForceStatus.INFEASIBLE
    assert answer.value == -np.inf


def test_a_batch_tells_which_wrench_is_not_held():
    grasp = ring(3)
    assert grasp.contact_forces([WEIGHT, WEIGHT]).require_success().success.all()
    heavy = grasp.contact_forces([WEIGHT, 9.0 * WEIGHT], limits=Limits(normal=1.0))
    with pytest.raises(UnsuccessfulError, match="forces for 1 of 2 wrenches; wrench 1: no contact forces within"):
        heavy.require_success()
    assert grasp.contact_forces(np.zeros((0, 6))).explain() == "forces for 0 of 0 wrenches"


@pytest.mark.parametrize("objective", ["min_normal", "barrier"])
def test_wrenches_too_large_for_numbers_are_refused(objective):
    with pytest.raises(InputError, match="too large to compute with; expected forces in N"):
        ring(3).contact_forces(1e300 * WEIGHT, objective)
    with pytest.raises(InputError, match="wrench 1 of 2 is too large to compute with"):
        ring(3).contact_forces([WEIGHT, 1e300 * WEIGHT], objective)


def test_an_empty_batch_of_grasps_has_empty_answers():
    none = np.zeros((0, 3, 3))
    answer = optimal_forces(none, none, np.zeros((0, 6)))
    shapes = [answer.forces.shape, answer.value.shape, answer.residual.shape, answer.certificate.shape]
    assert shapes == [(0, 9), (0,), (0,), (0, 6)]


def test_a_hand_jacobian_without_limits_is_used():
    grasp = ring(3)
    J = np.random.default_rng(0).normal(size=(9, 4))
    answer = grasp.contact_forces(WEIGHT, "min_torque", hand_jacobian=J)
    assert answer.value == pytest.approx(np.linalg.norm(J.T @ answer.forces), rel=1e-6)
    assert answer.torques == pytest.approx(J.T @ answer.forces)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Grasp(ring(1).contacts[0]), "a single contact; expected a sequence"),
        (lambda: Grasp([ring(1).contacts[0], np.zeros(3)]), r"contacts\[1\] is a ndarray; expected a Contact"),
        (lambda: ring(3).quality("volume", norm="l1"), "'volume' has no option 'norm'; it takes m, subspace"),
        (lambda: ring(3).quality("task_ellipsoid"), "'task_ellipsoid' needs the option 'sigma'"),
        (lambda: ring(3).contact_forces(WEIGHT, limits=Limits(total=np.nan)), "limits.total is nan"),
        (lambda: ring(3).contact_forces(WEIGHT, limits=Limits(normal=[1, -2, 1])), "limits.normal is"),
        (lambda: Grasp.on_surface(Body.box((1, 1, 1)), [[1, 0, 0]], model="hard"), "expected one of 'frictionless'"),
    ],
)
def test_slips_of_callers_are_named(call, message):
    with pytest.raises(InputError, match=message):
        call()
