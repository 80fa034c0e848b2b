"""Qualities against reference numbers, closed forms and another hull."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from apprehend.errors import InputError
from apprehend.grasp import Contact, ContactModel, Grasp
from tests.grasp.makers import contact, random_grasp
from tests.support import reference


def test_reference_wrench_spaces():
    for case in reference("grasp_epsilon.json")["cases"]:
        given, want = case["inputs"], case["expected"]
        grasp = Grasp(
            [contact(row) for row in given["contacts"]],
            reference=given["center"],
            length=1.0 / given["torque_scale"],
        )
        np.testing.assert_allclose(grasp.matrix, want["G_columns"], atol=1e-12)
        assert grasp.rank == want["rank_G"]
        for m in (4, 8, 16):
            row = want["polyhedral"].get(f"L1_m{m}")
            if row is None or any(c.model is ContactModel.SOFT for c in grasp.contacts):
                continue
            assert grasp.quality(cone="polyhedral", m=m).value == pytest.approx(row["epsilon"], abs=1e-7)
            if (length := want["polyhedral"].get(f"L1_unit_force_magnitude_m{m}")) is not None:
                found = grasp.quality(cone="polyhedral", m=m, bound="magnitude").value
                assert found == pytest.approx(length["epsilon"], abs=1e-7), case["id"]
            if m < 16:
                assert grasp.quality("volume", m=m).value == pytest.approx(row["volume"], abs=1e-9)
        for m in (4, 8):
            if (row := want["polyhedral"].get(f"Linf_m{m}")) is not None:
                found = grasp.quality(norm="linf", cone="polyhedral", m=m).value
                assert found == pytest.approx(row["epsilon"], abs=1e-7), (case["id"], m)
        kinds = {"L1": {}, "Linf": {"norm": "linf"}, "L1_unit_force_magnitude": {"bound": "magnitude"}}
        for norm, bracket in want["epsilon_exact_cone"].items():
            found = grasp.quality(gap=0.02, **kinds[norm])
            assert found.lower <= bracket["upper"] + 1e-9, (case["id"], norm)
            assert found.upper >= bracket["lower"] - 1e-9, (case["id"], norm)
            assert found.upper - found.lower <= 0.02 * found.upper + 1e-9


def test_planar_reference():
    for case in reference("grasp_closure.json")["cases"]:
        if not case["id"].startswith("planar_eps"):
            continue
        given, want = case["inputs"], case["expected"]
        grasp = Grasp(
            [
                Contact(np.array(p, float), np.array(n, float), given["mu"])
                for p, n in zip(given["points"], given["normals_inward"], strict=True)
            ]
        )
        assert grasp.quality(cone="polyhedral").value == pytest.approx(want["epsilon_L1"], abs=1e-9)
        assert grasp.quality("volume").value == pytest.approx(want["volume_L1"], abs=1e-9)
        assert grasp.quality(norm="linf", gap=1e-9).value == pytest.approx(want["epsilon_Linf"], abs=1e-8)
        assert grasp.force_closure().success == want["force_closure"]


def test_objects_reference():
    for case in reference("objects_antipodal_grasps.json")["cases"][::7]:
        given, want = case["inputs"], case["expected"]
        ends = [(np.array(want[f"p{i}"]), np.array(want[f"n{i}_inward"])) for i in (1, 2)]
        grasp = Grasp(
            [Contact(p, n, given["mu"], ContactModel.SOFT_BOX, given["gamma"]) for p, n in ends],
            reference=given["center"],
            length=1.0 / given["torque_scale"],
        )
        found = grasp.quality(cone="polyhedral", m=16).value
        assert found == pytest.approx(want["epsilon_L1_soft_mls_m16"], abs=1e-9)


@pytest.mark.parametrize("k", [3, 4, 5])
def test_polyhedral_epsilon_volume_and_mean_equal_another_hull(k):
    rng = np.random.default_rng(k)
    tested = 0
    while tested < 6:
        grasp = random_grasp(rng, k, friction=0.8, spread=0.15)
        points = np.vstack([grasp.edges(8), np.zeros(6)])
        hull = ConvexHull(points)
        distance = -hull.equations[:, -1]
        found = grasp.quality(cone="polyhedral")
        assert found.value == pytest.approx(max(distance.min(), 0.0), abs=1e-9)
        assert grasp.quality("volume").value == pytest.approx(hull.volume, rel=1e-9)
        if found.value > 1e-6:
            tested += 1
            # the worst wrench is where the polytope's support is smallest
            assert (points @ found.worst_wrench).max() == pytest.approx(found.value, abs=1e-9)
            assert grasp.quality("mean_facet_distance").value == pytest.approx(distance.mean(), rel=0.05)


def support(grasp, u, norm):
    base, spread, box = grasp.generators
    s = spread @ u
    h = base @ u + np.where(box, np.hypot(s[:, 0], s[:, 1]) + np.abs(s[:, 2]), np.linalg.norm(s, axis=1))
    return max(h.max(), 0.0) if norm == "l1" else np.maximum(h, 0.0).sum()


@pytest.mark.parametrize("norm", ["l1", "linf"])
@pytest.mark.parametrize("model", [ContactModel.COULOMB, ContactModel.SOFT, ContactModel.SOFT_BOX])
def test_the_interval_contains_what_a_search_finds(norm, model):
    from scipy.optimize import minimize

    rng = np.random.default_rng(1)
    for _ in range(6):
        grasp = random_grasp(rng, 3, model, friction=0.8, torsion=0.3)
        found = grasp.quality(norm=norm, gap=0.02)
        searched = np.inf
        for _ in range(12):
            answer = minimize(
                lambda u, grasp=grasp: support(grasp, u / np.linalg.norm(u), norm), rng.normal(size=6), method="Powell",
                options={"maxiter": 2000},
            )  # fmt: skip
            searched = min(searched, answer.fun)
        assert found.lower <= searched + 1e-9
        if found.upper > 0.0:
            assert support(grasp, found.worst_wrench, norm) == pytest.approx(found.upper)
            assert found.upper <= searched * 1.03 + 1e-9


def test_epsilon_does_not_change_with_the_frame():
    rng = np.random.default_rng(4)
    grasp = random_grasp(rng, 4, friction=0.8)
    Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    Q *= np.sign(np.linalg.det(Q))
    shift = rng.normal(size=3)
    moved = Grasp([Contact(Q @ c.position + shift, Q @ c.normal, c.friction) for c in grasp.contacts], reference=shift)
    a, b = grasp.quality(gap=1e-3), moved.quality(gap=1e-3)
    assert a.lower <= b.upper
    assert b.lower <= a.upper


def test_subspaces_and_task_ellipsoid():
    """Antipodal soft fingers at ±1 along x: forces along x reach 1 with L1, along y and z µ."""
    pair = [
        Contact(np.array([s, 0.0, 0.0]), np.array([-s, 0.0, 0.0]), 0.5, ContactModel.SOFT_BOX, 0.2) for s in (1.0, -1.0)
    ]
    grasp = Grasp(pair)
    force = grasp.quality(subspace="force", gap=1e-6)
    assert force.value == pytest.approx(0.5 / np.sqrt(1.25), rel=1e-4) or force.value <= 0.5
    assert force.worst_wrench[3:] == pytest.approx(np.zeros(3))
    torque = grasp.quality(subspace="torque", gap=1e-6)
    assert torque.value == pytest.approx(0.2, rel=1e-5)
    ball = grasp.quality("task_ellipsoid", sigma=np.eye(6), gap=1e-4)
    epsilon = grasp.quality(norm="linf", gap=1e-5)
    assert ball.lower <= epsilon.upper**2 * (1 + 1e-9)
    assert ball.upper >= epsilon.lower**2 * (1 - 1e-9)
    # a task that needs little but the weak torque: the ellipsoid grows as its other axes shrink
    thin = grasp.quality("task_ellipsoid", sigma=np.diag([0.04, 0.04, 0.04, 0.04, 0.04, 0.04]), gap=1e-4)
    assert thin.value == pytest.approx(ball.value / 0.04, rel=1e-3)
    shifted = grasp.quality("task_ellipsoid", sigma=np.eye(6), centre=[0, 0.3, 0, 0, 0, 0], gap=1e-4)
    assert shifted.value <= ball.value + 1e-9


def test_simple_measures():
    grasp = random_grasp(np.random.default_rng(0), 3)
    s = np.linalg.svd(grasp.matrix, compute_uv=False)
    assert grasp.quality("min_singular_value").value == pytest.approx(s[-1])
    assert grasp.quality("isotropy").value == pytest.approx(s[-1] / s[0])
    assert grasp.quality("grasp_volume").value == pytest.approx(np.sqrt(np.linalg.det(grasp.matrix @ grasp.matrix.T)))
    points = np.array([c.position for c in grasp.contacts])
    area = 0.5 * np.linalg.norm(np.cross(points[1] - points[0], points[2] - points[0]))
    assert grasp.quality("polygon_area").value == pytest.approx(area)
    assert grasp.quality("centroid_distance").value == pytest.approx(np.linalg.norm(points.mean(axis=0)))


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        ("beauty", {}, "kind is 'beauty'"),
        ("epsilon", {"norm": "l2"}, "norm is 'l2'"),
        ("epsilon", {"gap": 0.0}, "gap is 0.0; expected a share"),
        ("epsilon", {"bound": "energy"}, "bound is 'energy'"),
        ("epsilon", {"cone": "polyhedral", "m": 2}, "at least 3 edges"),
        ("epsilon", {"subspace": np.ones((2, 6))}, "orthonormal rows"),
        ("isotropy", {"m": 3}, "takes no options; got m"),
        ("task_ellipsoid", {"sigma": np.zeros((6, 6))}, "positive definite"),
        ("task_ellipsoid", {"sigma": np.eye(5)}, "symmetric matrix"),
        ("task_ellipsoid", {"sigma": np.eye(6), "centre": [1.0]}, "centre has shape"),
    ],
)
def test_bad_questions_are_named(kind, options, message):
    with pytest.raises(InputError, match=message):
        random_grasp(np.random.default_rng(0), 4).quality(kind, **options)
