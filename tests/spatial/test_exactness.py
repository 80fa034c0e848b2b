"""exp, log, quaternions and Euler angles give back what went in, to the last digits, at every angle."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.arrays import Array
from apprehend.spatial import Pose, euler, quaternion, se3, so3
from tests.support import reference

EDGES = np.concatenate(
    [
        np.pi - 10.0 ** -np.arange(2, 13),
        [np.pi, 0.0, 1e-300, 1e-200, 1e-160, 1e-100, 1e-30, 1e-16, 1e-12, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3],
        [0.2499999, 0.25, 0.2500001, 0.4999999, 0.5, np.pi / 2, 1.9, 2.0, 2.1],
        np.linspace(0.0, np.pi, 60),
    ]
)
WORST = 5e-15


def axes(count: int, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    w = rng.normal(size=(count, 3))
    w[: count // 10] *= 10.0 ** rng.uniform(-12, 0, (count // 10, 3))  # close to coordinate planes and axes
    w[:6] = np.vstack([np.eye(3), -np.eye(3)])
    return np.asarray(w / np.linalg.norm(w, axis=1, keepdims=True))


def test_rotations_return_from_their_logarithm() -> None:
    w = axes(500)
    for angle in EDGES:
        R = so3.exp(angle * w)
        v = so3.log(R)
        assert np.abs(so3.exp(v) - R).max() <= WORST
        assert (np.linalg.norm(v, axis=1) <= np.pi * (1 + 1e-15)).all()
        if angle < np.pi - 1e-6:
            np.testing.assert_allclose(v, angle * w, rtol=0, atol=max(2e-15, 4e-16 / max(np.pi - angle, 1e-6)))
        if angle < 1e-3:  # tiny rotations keep their relative digits
            np.testing.assert_allclose(v, angle * w, rtol=1e-9, atol=1e-15 * angle)


def test_matrices_are_rotations_to_the_last_digits() -> None:
    for angle in EDGES:
        R = so3.exp(angle * axes(100))
        assert np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max() <= 3e-15


def test_motions_return_from_their_logarithm_relative_to_their_size() -> None:
    rng = np.random.default_rng(1)
    w = axes(300)
    for angle in EDGES:
        for size in (0.0, 1e-9, 1.0, 1e3):
            xi = np.hstack([size * rng.normal(size=w.shape), angle * w])
            T = se3.exp(xi)
            again = se3.exp(se3.log(T))
            assert np.abs(again[:, :3, :3] - T[:, :3, :3]).max() <= WORST
            assert np.abs(again[:, :3, 3] - T[:, :3, 3]).max() <= WORST * max(size * 4, 1e-300)


def test_motions_return_from_their_screws_relative_to_their_size() -> None:
    rng = np.random.default_rng(4)
    w = axes(200)
    for angle in [*EDGES, 1e-310, 5e-324]:
        for size in (0.0, 1e-9, 1.0, 1e3):
            T = Pose.exp(np.hstack([size * rng.normal(size=w.shape), angle * w]))
            screw = T.screw()
            again = screw.motion().matrix
            assert np.abs(again[:, :3, :3] - T.matrix[:, :3, :3]).max() <= WORST
            assert np.abs(again[:, :3, 3] - T.translation).max() <= WORST * max(size * 4, 1e-300)
            assert (
                np.abs((screw.point * screw.direction).sum(axis=-1)) <= 1e-14 * np.abs(screw.point).max(axis=-1)
            ).all()


def test_quaternions_return() -> None:
    for angle in EDGES:
        R = so3.exp(angle * axes(200))
        q = quaternion.from_matrix(R)
        assert (q[:, 0] >= 0.0).all()
        np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=5e-16)
        assert np.abs(quaternion.to_matrix(q) - R).max() <= WORST
        assert np.abs(quaternion.to_matrix(-3.0 * q) - R).max() <= WORST


@pytest.mark.parametrize("frame", euler.FRAMES)
@pytest.mark.parametrize("sequence", euler.SEQUENCES)
def test_euler_angles_return_away_from_at_and_near_the_lock(sequence: str, frame: str) -> None:
    rng = np.random.default_rng(2)
    locks = [0.0, np.pi] if sequence[0] == sequence[2] else [-np.pi / 2, np.pi / 2]
    near = [0.0, *(s * 10.0**-k for k in range(1, 17) for s in (1, -1))]
    middle = np.concatenate([rng.uniform(-np.pi, np.pi, 100), *[lock + np.array(near) for lock in locks]])
    a = np.column_stack([rng.uniform(-np.pi, np.pi, middle.size), middle, rng.uniform(-np.pi, np.pi, middle.size)])
    a[:10, 0] = 0.0
    R = euler.to_matrix(a, sequence, frame)
    again = euler.from_matrix(R, sequence, frame)
    assert np.abs(euler.to_matrix(again, sequence, frame) - R).max() <= WORST
    inside = (again[:, 1] >= -1e-15) if sequence[0] == sequence[2] else (np.abs(again[:, 1]) <= np.pi / 2 + 1e-15)
    assert inside.all()


@pytest.mark.parametrize("sequence", euler.SEQUENCES)
def test_at_the_lock_the_first_angle_is_zero(sequence: str) -> None:
    lock = 0.0 if sequence[0] == sequence[2] else np.pi / 2
    R = euler.to_matrix([0.7, lock, 0.4], sequence, "intrinsic")
    assert euler.from_matrix(R, sequence, "intrinsic")[0] == 0.0


def test_so3_reference() -> None:
    for case in reference("rot_so3_exp_log_edge.json")["cases"]:
        w, expected = np.array(case["inputs"]["rotvec"]), case["expected"]
        R = np.array(expected["R"])
        np.testing.assert_allclose(so3.exp(w), R, atol=3.2e-15, err_msg=case["id"])
        angle = float(np.linalg.norm(w))
        if angle < np.pi - 1e-6:
            np.testing.assert_allclose(so3.log(so3.exp(w)), expected["log_principal"], atol=1e-9, err_msg=case["id"])
        else:
            np.testing.assert_allclose(so3.exp(so3.log(R)), R, atol=5e-15)
        np.testing.assert_allclose(so3.left_jacobian(w), expected["left_jacobian"], atol=1e-14, err_msg=case["id"])
        if angle < 6.2:
            inverse = so3.inverse_left_jacobian(w)
            np.testing.assert_allclose(inverse, expected["left_jacobian_inv"], rtol=1e-9, atol=1e-12)


def test_se3_reference() -> None:
    def swap(m: Array) -> Array:
        return np.block([[m[3:, 3:], m[3:, :3]], [m[:3, 3:], m[:3, :3]]])

    for case in reference("rot_se3_exp_log.json")["cases"]:
        xi = np.array(case["inputs"]["twist_w_v"])[[3, 4, 5, 0, 1, 2]]
        expected = case["expected"]
        T = np.array(expected["T"])
        scale = max(1.0, float(np.abs(T).max()))
        np.testing.assert_allclose(se3.exp(xi), T, atol=1e-14 * scale, err_msg=case["id"])
        np.testing.assert_allclose(se3.adjoint(T), swap(np.array(expected["Ad_w_first"])), atol=1e-12 * scale)
        np.testing.assert_allclose(se3.inverse(T), expected["T_inv"], atol=1e-14 * scale)
        np.testing.assert_allclose(
            se3.left_jacobian(xi), swap(np.array(expected["left_jacobian_6x6"])), atol=1e-12 * scale
        )
        if case["inputs"]["theta"] < np.pi - 1e-6:
            log = np.array(expected["log"])[[3, 4, 5, 0, 1, 2]]
            np.testing.assert_allclose(se3.log(T), log, atol=2e-9 * scale, err_msg=case["id"])
        np.testing.assert_allclose(se3.exp(se3.log(T)), T, atol=5e-15 * scale)


def test_euler_reference() -> None:
    for case in reference("rot_euler24.json")["cases"]:
        given, expected = case["inputs"], case["expected"]
        frame = "intrinsic" if given["intrinsic"] else "extrinsic"
        R = euler.to_matrix(given["angles"], given["seq"], frame)
        np.testing.assert_allclose(R, expected["R"], atol=1e-14)
        again = euler.from_matrix(R, given["seq"], frame)
        np.testing.assert_allclose(euler.to_matrix(again, given["seq"], frame), R, atol=5e-15)
        if not given["gimbal_lock"]:
            np.testing.assert_allclose(again, expected["euler_recovered"], atol=1e-9)


def test_interpolation_and_mean_reference() -> None:
    for case in reference("rot_interp_mean.json")["cases"]:
        given, expected = case["inputs"], case["expected"]
        kind = case["id"].split("/")[0]
        if kind == "slerp":
            for form in quaternion.SLERP_FORMS:
                q = quaternion.slerp(given["q0_wxyz"], given["q1_wxyz"], np.array(given["t"]), form)
                np.testing.assert_allclose(quaternion.to_matrix(q), expected["R"], atol=1e-12)
        elif kind == "chordal_mean":
            R = so3.mean(quaternion.to_matrix(given["quats_wxyz"]), given["weights"])
            np.testing.assert_allclose(R, expected["R"], atol=1e-9)
        elif kind == "sclerp":
            T = se3.interpolate(given["A"], given["B"], np.array(given["t"]))
            np.testing.assert_allclose(T, expected["T"], atol=1e-9)
