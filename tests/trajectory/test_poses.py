"""Paths of poses: lines, arcs, screws and splines, their ends, twists, and laws."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import trajectory as tj
from apprehend.errors import InputError
from apprehend.spatial import se3, so3
from tests.support import reference

RNG = np.random.default_rng(0)


def random_pose(rng: np.random.Generator = RNG) -> np.ndarray:
    return se3.exp(rng.normal(size=6))


def numeric_twist(path, s: float, e: float = 1e-5) -> np.ndarray:
    a, b, m = path(s - e), path(s + e), path(s)
    R = (b[:3, :3] - a[:3, :3]) / (2 * e) @ m[:3, :3].T
    return np.concatenate([(b[:3, 3] - a[:3, 3]) / (2 * e), so3.vee(0.5 * (R - R.T))])


def paths() -> list:
    poses = np.stack([random_pose() for _ in range(5)])
    T0, T1 = random_pose(), random_pose()
    return [
        tj.Line(T0, T1),
        tj.ScrewLine(T0, T1),
        tj.Arc(T0, RNG.normal(size=3), T1),
        tj.PoseSpline(poses),
        tj.PoseSpline(poses, knots=[0.0, 0.2, 0.5, 0.6, 1.0]),
    ]


@pytest.mark.parametrize("path", paths(), ids=lambda p: type(p).__name__)
def test_twists_are_derivatives(path) -> None:
    for s in (0.13, 0.4, 0.77):
        np.testing.assert_allclose(path(s, 1), numeric_twist(path, s), atol=1e-6)
        e = 1e-6
        np.testing.assert_allclose(path(s, 2), (path(s + e, 1) - path(s - e, 1)) / (2 * e), atol=1e-3)
    assert path(np.linspace(0.0, 1.0, 6).reshape(2, 3)).shape == (2, 3, 4, 4)


def test_ends_and_middles() -> None:
    T0, T1 = random_pose(), random_pose()
    for made in (tj.Line(T0, T1), tj.ScrewLine(T0, T1)):
        np.testing.assert_allclose(made([0.0, 1.0]), [T0, T1], atol=1e-12)
    s = np.linspace(0.0, 1.0, 9)
    straight = tj.Line(T0, T1)(s)
    np.testing.assert_allclose(straight[:, :3, 3], T0[:3, 3] + s[:, None] * (T1 - T0)[:3, 3], atol=1e-12)
    screw = tj.ScrewLine(T0, T1)
    expected = np.stack([se3.exp(x * se3.log(T1 @ se3.inverse(T0))) @ T0 for x in s])
    np.testing.assert_allclose(screw(s), expected, atol=1e-12)
    via = np.array([0.3, 0.5, -0.2])
    arc = tj.Arc(T0, via, T1)
    np.testing.assert_allclose(arc([0.0, 1.0]), [T0, T1], atol=1e-9)
    radii = np.linalg.norm(arc(s)[:, :3, 3] - arc.centre, axis=1)
    np.testing.assert_allclose(radii, radii[0], rtol=1e-12)
    assert np.abs(np.linalg.norm(via - arc.centre) - radii[0]) < 1e-9
    dense = arc(np.linspace(0.0, 1.0, 20001))[:, :3, 3]
    assert np.linalg.norm(dense - via, axis=1).min() < 1e-3  # it passes the via point, the right way round
    assert arc.length == pytest.approx(np.linalg.norm(np.diff(dense, axis=0), axis=1).sum(), rel=1e-6)


def test_screw_without_rotation_is_a_line() -> None:
    T0 = random_pose()
    T1 = T0.copy()
    T1[:3, 3] += [1.0, 2.0, 3.0]
    np.testing.assert_allclose(tj.ScrewLine(T0, T1)(0.3), tj.Line(T0, T1)(0.3), atol=1e-12)


def test_spline_through_poses() -> None:
    poses = np.stack([random_pose() for _ in range(6)])
    spline = tj.PoseSpline(poses)
    np.testing.assert_allclose(spline(spline.knots), poses, atol=1e-9)
    for k in spline.knots[1:-1]:  # C²
        for order in (1, 2):
            left, right = spline(k - 1e-9, order), spline(k + 1e-9, order)
            np.testing.assert_allclose(left, right, atol=1e-4 * (1 + np.abs(left).max()))


def test_reference_rotation_splines() -> None:
    from apprehend.spatial import quaternion

    seen = 0
    for case in reference("traj_polynomial_splines.json")["cases"]:
        if case["id"].startswith("rotation_spline/"):
            g, e = case["inputs"], case["expected"]
            poses = se3.transform(
                quaternion.to_matrix(g["quats_wxyz"]), np.arange(len(g["times"]))[:, None] * np.ones(3)
            )
            spline = tj.PoseSpline(poses, g["times"])
            np.testing.assert_allclose(spline(e["t"])[:, :3, :3], quaternion.to_matrix(e["quats_wxyz"]), atol=1e-8)
            seen += 1
    assert seen


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: tj.Line(np.eye(4), np.eye(3)), "T1 has shape"),
        (lambda: tj.Line(np.eye(4), 2 * np.eye(4)), "last row|not a rotation"),
        (lambda: tj.Line(np.eye(4), np.eye(4))(1.5), "outside"),
        (lambda: tj.Line(np.eye(4), np.eye(4))(0.5, 3), "orders 0, 1 and 2"),
        (lambda: tj.Arc(np.eye(4), [0, 0, 0.5], se3.transform(translation=[0, 0, 1])), "on a straight line"),
        (lambda: tj.PoseSpline(np.eye(4)), "expected \\(M, 4, 4\\)"),
        (lambda: tj.PoseSpline(np.stack([np.eye(4)] * 2), [1.0, 0.0]), "strictly increasing"),
        (lambda: tj.PoseSpline(np.stack([np.eye(4), random_pose()]))(0.1, 3), "orders 0, 1 and 2"),
    ],
)
def test_bad_input(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
