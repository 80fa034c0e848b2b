"""Force and form closure against published cases, and every proof checked by hand."""

import numpy as np
import pytest
from scipy.optimize import linprog

import apprehend as ap
from apprehend.errors import InputError
from apprehend.grasp import ClosureStatus, Contact, ContactModel, Grasp, closed
from tests.grasp.makers import random_grasp
from tests.support import reference


def prove(grasp, found):
    """Check the proof that a verdict carries."""
    if found.success:
        f = found.internal_force
        assert np.abs(grasp.matrix @ f).max() < 1e-12
        slack = min(float(c.slack(f[s])) for c, s in zip(grasp.contacts, grasp.slices, strict=True))
        assert slack == pytest.approx(found.margin)
        assert slack > 0.0
    else:
        assert np.linalg.norm(found.wrench) == pytest.approx(1.0)
        base, spread, box = grasp.generators
        s = spread @ found.wrench
        reach = np.where(box, np.hypot(s[:, 0], s[:, 1]) + np.abs(s[:, 2]), np.linalg.norm(s, axis=1))
        assert (base @ found.wrench + reach).max() < 1e-7


def test_published_cases():
    for case in reference("grasp_closure.json")["cases"]:
        given, want = case["inputs"], case["expected"]
        if "form_closure" in want:
            normals = given.get("normals_inward") or given["forces_inward"]
            grasp = Grasp(
                [
                    Contact(np.array(p, float), np.array(n, float) / np.linalg.norm(n), 0.0, ContactModel.FRICTIONLESS)
                    for p, n in zip(given["points"], normals, strict=True)
                ]
            )
            found = grasp.form_closure()
            assert found.success == want["form_closure"], case["id"]
            assert grasp.rank == want["rank"]
            prove(grasp, found)
        elif "force_closure_soft" in want:
            for model in (ContactModel.SOFT_BOX, ContactModel.SOFT):
                grasp = Grasp(
                    [
                        Contact(np.array(given[f"p{i}"]), np.array(given[f"n{i}_inward"]), given["mu"], model, 0.1)
                        for i in (1, 2)
                    ]
                )
                found = grasp.force_closure()
                assert found.success == want["force_closure_soft"] == grasp.antipodal(), case["id"]
                assert closed([grasp])[0] == found.success
                prove(grasp, found)
            hard = Grasp([Contact(c.position, c.normal, c.friction) for c in grasp.contacts])
            assert hard.force_closure().success == want["force_closure_hard"]
            assert hard.rank == want["rank_hard_fingers"]
        elif "force_closure" in want and "friction" in given:
            d = len(given["points"][0])
            grasp = Grasp(
                [
                    Contact(np.array(p, float), np.array(n, float) / np.linalg.norm(n), mu)
                    for p, n, mu in zip(given["points"], given["forces_inward"], given["friction"], strict=True)
                ]
            )
            found = grasp.force_closure()
            assert d in (2, 3)
            assert found.success == want["force_closure"], case["id"]
            prove(grasp, found)


def test_grasps_of_real_objects():
    for case in reference("objects_antipodal_grasps.json")["cases"]:
        given, want = case["inputs"], case["expected"]
        grasp = Grasp(
            [
                Contact(
                    np.array(want[f"p{i}"]), np.array(want[f"n{i}_inward"]), given["mu"], ContactModel.SOFT_BOX,
                    given["gamma"],
                )
                for i in (1, 2)
            ],
            reference=given["center"],
            length=1.0 / given["torque_scale"],
        )  # fmt: skip
        found = grasp.force_closure()
        assert found.success == want["force_closure_soft"], case["id"]
        assert closed([grasp])[0] == want["force_closure_soft"], case["id"]
        prove(grasp, found)


def test_example_2_2_and_2_15_box_between_two_fingers():
    """G 2.2: without torsion no moment about y; G 2.15: soft fingers close the grasp."""
    r = 0.5
    R1 = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
    R2 = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    want = np.array(
        [
            [0, 1, 0, 1, 0, 0], [0, 0, 1, 0, 0, -1], [1, 0, 0, 0, 1, 0],
            [-r, 0, 0, 0, r, 0], [0, 0, 0, 0, 0, 0], [0, r, 0, -r, 0, 0],
        ]
    )  # fmt: skip

    def box(model):
        return Grasp(
            [
                Contact(np.array([0, -r, 0]), R1[:, 2], 0.5, model, 0.1, R1[:, 0]),
                Contact(np.array([0, r, 0]), R2[:, 2], 0.5, model, 0.1, R2[:, 0]),
            ]
        )

    hard = box(ContactModel.COULOMB)
    np.testing.assert_allclose(hard.matrix, want, atol=1e-15)
    found = hard.force_closure()
    assert found.status is ClosureStatus.FLAT
    np.testing.assert_allclose(np.abs(found.wrench), [0, 0, 0, 0, 1, 0], atol=1e-12)
    assert "at least 3, there are 2" in found.explain()
    soft = box(ContactModel.SOFT)
    assert soft.rank == 6
    assert soft.null_space.shape == (8, 2)
    np.testing.assert_allclose(soft.matrix[:, [3, 7]], np.outer([0, 0, 0, 0, 1, 0], [1, -1]), atol=1e-15)
    assert soft.force_closure().success
    assert not soft.form_closure().success
    assert "at least 7, there are 2" in soft.form_closure().explain()


@pytest.mark.parametrize("model", [ContactModel.COULOMB, ContactModel.SOFT, ContactModel.SOFT_BOX])
@pytest.mark.parametrize("k", [2, 3, 4, 6])
def test_random_grasps_agree_with_a_linear_program_of_many_edges(model, k):
    rng = np.random.default_rng(k)
    grasps = [random_grasp(rng, k, model, torsion=0.2, spread=0.6) for _ in range(25)]
    fast = closed(grasps)
    for grasp, quick in zip(grasps, fast, strict=True):
        found = grasp.force_closure()
        assert found.success == quick
        prove(grasp, found)
        if grasp.rank < 6:
            continue
        W = grasp.edges(64).T  # largest common weight t of an even split
        c = np.zeros(W.shape[1] + 1)
        c[-1] = -1.0
        A = np.column_stack([W, W.sum(axis=1)])
        bounds = [(0, None)] * W.shape[1] + [(None, None)]
        total = np.append(np.ones(W.shape[1]), W.shape[1])[None]
        lp = linprog(c, A_eq=np.vstack([A, total]), b_eq=np.append(np.zeros(6), 1.0), bounds=bounds)
        polyhedral = lp.status == 0 and -lp.fun > 1e-9
        if polyhedral:  # inscribed cones: closure with them is closure; the other way only off the border
            assert found.success
        elif found.margin > 5e-3:
            assert polyhedral


def test_mixed_models_and_removable_contacts():
    box = ap.Body.box((0.1, 0.1, 0.1), mass=1.0)
    points = np.array([[0.05, 0, 0], [-0.05, 0, 0], [0, 0.05, 0], [0, -0.05, 0.0]])
    grasp = Grasp.on_surface(box, points, model="soft", torsion=0.01)
    assert grasp.force_closure().success
    assert grasp.removable() == (0, 1, 2, 3)
    pair = Grasp(grasp.contacts[:2], box)
    assert pair.removable() == ()
    smooth = Contact(np.array([0.0, 0.05, 0.0]), np.array([0.0, -1.0, 0.0]), 0.0, ContactModel.FRICTIONLESS)
    mixed = Grasp([*grasp.contacts[:2], smooth], box)
    assert mixed.matrix.shape == (6, 9)
    # the third contact pushes only one way and nothing opposes it but friction: it can carry an internal force
    assert mixed.force_closure().success
    prove(mixed, mixed.force_closure())


def test_antipodal_needs_two_contacts():
    with pytest.raises(InputError, match="has 3"):
        random_grasp(np.random.default_rng(0), 3).antipodal()
