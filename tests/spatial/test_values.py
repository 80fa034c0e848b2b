"""Values: rotations, poses, twists, screws, wrenches; the script's formulas, its examples, and mistakes."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apprehend.arrays import Array
from apprehend.errors import InputError
from apprehend.spatial import Pose, Rotation, Screw, Twist, Wrench, quaternion, reciprocal, se3, so3


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def poses(rng: np.random.Generator, *shape: int) -> Array:
    return se3.transform(Rotation.random(rng, *shape).matrix, rng.normal(size=(*shape, 3)))


# rotations ------------------------------------------------------------------------------------------------------


def test_all_ways_to_a_rotation_agree(rng: np.random.Generator) -> None:
    R = Rotation.random(rng, 4, 5)
    assert R.shape == (4, 5)
    axis, angle = R.axis_angle()
    others = [
        Rotation.exp(R.log()),
        Rotation.from_axis_angle(3.0 * axis, angle),
        Rotation.from_axis_angles(*R.axis_angles()),
        Rotation.from_quaternion(R.quaternion()),
        Rotation.from_quaternion(-R.quaternion()),
        Rotation.from_rpy(R.rpy()),
        Rotation.from_euler(R.euler("zxz", "extrinsic"), "zxz", "extrinsic"),
        Rotation.nearest(R.matrix + 1e-9 * rng.normal(size=R.matrix.shape)),
    ]
    for other in others[:-1]:
        np.testing.assert_allclose(other.matrix, R.matrix, atol=5e-15)
    np.testing.assert_allclose(others[-1].matrix, R.matrix, atol=1e-8)


def test_axis_of_angles_is_the_turned_x_axis(rng: np.random.Generator) -> None:
    """G eq. 1.2 and 1.3."""
    phi, psi, theta = rng.uniform(-1, 1, 3)
    back = so3.basic("z", phi) @ so3.basic("y", psi)
    np.testing.assert_allclose(back[:, 0], so3.axis_of_angles(phi, psi), atol=1e-15)
    R = back @ so3.basic("x", theta) @ back.T
    np.testing.assert_allclose(Rotation.from_axis_angles(phi, psi, theta).matrix, R, atol=1e-15)
    f, p = so3.angles_of_axis([0.0, 0.0, -2.0])
    assert (f, p) == (0.0, np.pi / 2)


def test_yaw_pitch_roll_of_the_script() -> None:
    """G 1.2.3: R = R_z(φ) R_y(θ) R_x(ψ): turn about x, then the old y, then the old z."""
    psi, theta, phi = 0.3, -0.4, 1.1
    expected = so3.basic("z", phi) @ so3.basic("y", theta) @ so3.basic("x", psi)
    np.testing.assert_allclose(Rotation.from_rpy([psi, theta, phi]).matrix, expected, atol=1e-16)
    np.testing.assert_allclose(Rotation.from_euler([phi, theta, psi], "zyx", "intrinsic").matrix, expected, atol=1e-16)


def test_products_inverse_power_mean(rng: np.random.Generator) -> None:
    A, B = Rotation.random(rng, 6), Rotation.random(rng)
    np.testing.assert_array_equal((A @ B).matrix, A.matrix @ B.matrix)
    np.testing.assert_allclose((A @ A.inverse()).matrix, np.broadcast_to(np.eye(3), (6, 3, 3)), atol=1e-15)
    np.testing.assert_allclose((A.power(0.3) @ A.power(0.7)).matrix, A.matrix, atol=5e-15)
    np.testing.assert_allclose(A.apply([1.0, 2.0, 3.0]), A.matrix @ [1.0, 2.0, 3.0], atol=1e-15)
    np.testing.assert_allclose(A.angle_to(B), np.linalg.norm((A.inverse() @ B).log(), axis=-1), atol=1e-15)
    same = Rotation.exp(rng.normal(size=3) * 0.1 + np.zeros((4, 1)))
    np.testing.assert_allclose(same.mean().matrix, same[0].matrix, atol=1e-15)


@pytest.mark.parametrize("opposite", [False, True])
def test_between_turns_one_direction_into_the_other(rng: np.random.Generator, opposite: bool) -> None:
    a = rng.normal(size=(50, 3))
    a[:3] = np.eye(3)
    b = -2.0 * a if opposite else rng.normal(size=(50, 3))
    R = Rotation.between(a, b)
    turned = R.apply(a / np.linalg.norm(a, axis=1, keepdims=True))
    np.testing.assert_allclose(turned, b / np.linalg.norm(b, axis=1, keepdims=True), atol=1e-14)


def test_slerp_forms_are_equal_and_short(rng: np.random.Generator) -> None:
    q, p = rng.normal(size=(2, 30, 4))
    t = np.linspace(0, 1, 7)[:, None]
    forms = [quaternion.slerp(q, p, t, form) for form in quaternion.SLERP_FORMS]
    for form in forms[1:]:
        np.testing.assert_allclose(form, forms[0], atol=1e-14)
    A, B = Rotation.from_quaternion(q), Rotation.from_quaternion(p)
    np.testing.assert_allclose(quaternion.to_matrix(forms[0]), A.slerp(B, t).matrix, atol=1e-14)
    np.testing.assert_allclose(A.angle_to(A.slerp(B, 0.25)), 0.25 * A.angle_to(B), atol=1e-14)
    unit = np.sign((q * p).sum(-1, keepdims=True)) * p / np.linalg.norm(p, axis=-1, keepdims=True)
    np.testing.assert_allclose(quaternion.slerp_vectors(q, unit, t), forms[0], atol=1e-14)


def test_slerp_of_vectors_keeps_digits_when_they_are_close_and_refuses_opposite_ones() -> None:
    a = np.array([1.0, 0, 0, 0, 0])
    for small in (1e-5, 1e-8, 1e-12, 0.0):
        b = np.array([np.cos(small), np.sin(small), 0, 0, 0])
        half = quaternion.slerp_vectors(a, b, 0.5)
        np.testing.assert_allclose(half[:2], [np.cos(small / 2), np.sin(small / 2)], rtol=1e-15)
    with pytest.raises(InputError, match="opposite vectors"):
        quaternion.slerp_vectors(a, -a, 0.5)


def test_quaternion_algebra(rng: np.random.Generator) -> None:
    q, p, r = rng.normal(size=(3, 20, 4))
    one = np.array([1.0, 0, 0, 0])
    i, j, k = np.eye(4)[1:]
    np.testing.assert_array_equal(quaternion.multiply(i, j), k)
    np.testing.assert_array_equal(quaternion.multiply(quaternion.multiply(i, j), k), -one)
    np.testing.assert_allclose(
        quaternion.multiply(quaternion.multiply(q, p), r), quaternion.multiply(q, quaternion.multiply(p, r)), atol=1e-13
    )
    np.testing.assert_allclose(quaternion.multiply(q, quaternion.inverse(q)), np.tile(one, (20, 1)), atol=1e-14)
    np.testing.assert_allclose(
        quaternion.to_matrix(quaternion.multiply(q, p)), quaternion.to_matrix(q) @ quaternion.to_matrix(p), atol=1e-14
    )
    v = rng.normal(size=(20, 3))
    np.testing.assert_allclose(quaternion.rotate(q, v), Rotation.from_quaternion(q).apply(v), atol=1e-14)
    np.testing.assert_allclose(quaternion.power(-one, 0.5), [0, 1, 0, 0], atol=1e-15)


@settings(deadline=None, max_examples=60)
@given(st.lists(st.floats(-50, 50), min_size=3, max_size=3), st.floats(-3, 3))
def test_powers_about_one_axis_add(w: list[float], t: float) -> None:
    R = Rotation.exp(w)
    if np.linalg.norm(R.log()) < 3.1:
        np.testing.assert_allclose((R.power(t) @ R.power(1 - t)).matrix, R.matrix, atol=1e-13)


def test_left_jacobian_is_the_derivative_of_exp(rng: np.random.Generator) -> None:
    h = 1e-6
    for scale in (1e-9, 0.1, 1.0, 3.0):
        w, d = rng.normal(size=(2, 3)) * [[scale], [1]]
        rate = so3.vee((so3.exp(w + h * d) - so3.exp(w - h * d)) / (2 * h) @ so3.exp(w).T)
        np.testing.assert_allclose(so3.left_jacobian(w) @ d, rate, atol=1e-8)
        np.testing.assert_allclose(so3.inverse_left_jacobian(w) @ so3.left_jacobian(w), np.eye(3), atol=1e-13)
        xi, dxi = rng.normal(size=(2, 6)) * [[scale], [1]]
        T = se3.exp(xi)
        dT = (se3.exp(xi + h * dxi) - se3.exp(xi - h * dxi)) / (2 * h)
        np.testing.assert_allclose(
            se3.left_jacobian(xi) @ dxi, Twist.spatial(T, dT).coordinates, atol=1e-7 * max(1, scale)
        )
    with pytest.raises(InputError, match="invertible below 2 π"):
        so3.inverse_left_jacobian([7.0, 0, 0])


# poses, twists, wrenches ----------------------------------------------------------------------------------------


def test_example_of_a_rotation_beside_the_origin() -> None:
    """G examples 1.11 and 1.19: the twist of a rotation about a point on the y axis."""
    l1, l2, alpha = 0.7, 0.4, 0.9
    T = np.eye(4)
    T[:3, :3] = so3.basic("z", alpha)
    T[:3, 3] = [-l2 * np.sin(alpha), l1 + l2 * np.cos(alpha), 0]
    v = se3.log(T)
    half = np.sin(alpha) / (2 * (1 - np.cos(alpha)))
    expected = [alpha * (l1 - l2) / 2, alpha * half * (l1 + l2), 0, 0, 0, alpha]
    np.testing.assert_allclose(v, expected, atol=1e-15)
    start = np.eye(4)
    start[1, 3] = l1 + l2
    relative = se3.log(T @ se3.inverse(start))
    np.testing.assert_allclose(relative, alpha * np.array([l1, 0, 0, 0, 0, 1]), atol=1e-15)


def test_velocities_of_three_moving_frames(rng: np.random.Generator) -> None:
    """G lemma 1.20."""
    Tab, Tbc = (Pose(poses(rng), to=a, of=b) for a, b in ("ab", "bc"))
    xi, eta = rng.normal(size=(2, 6))
    dTab, dTbc = se3.hat_matrix(xi) @ Tab.matrix, se3.hat_matrix(eta) @ Tbc.matrix
    Tac = Tab @ Tbc
    assert (Tac.to, Tac.of) == ("a", "c")
    dTac = dTab @ Tbc.matrix + Tab.matrix @ dTbc
    total = Twist.spatial(Tac, dTac)
    summed = Twist.spatial(Tab, dTab) + Twist.spatial(Tbc, dTbc).transformed(Tab)
    np.testing.assert_allclose(summed.coordinates, total.coordinates, atol=1e-13)
    assert (summed.base, summed.body, summed.frame) == ("a", "c", "a")
    body = Twist.of_body(Tab, dTab).transformed(Tbc.inverse()) + Twist.of_body(Tbc, dTbc)
    np.testing.assert_allclose(body.coordinates, Twist.of_body(Tac, dTac).coordinates, atol=1e-13)
    back = -Twist.spatial(Tab, dTab)
    assert (back.base, back.body) == ("b", "a")
    dTba = -Tab.inverse().matrix @ dTab @ Tab.inverse().matrix
    np.testing.assert_allclose(back.coordinates, Twist.of_body(Tab.inverse(), dTba).coordinates, atol=1e-13)


def test_power_does_not_depend_on_the_frame(rng: np.random.Generator) -> None:
    """G 1.9 with eq. 1.24 corrected."""
    T = Pose(poses(rng, 8))
    V, F = Twist(rng.normal(size=6)), Wrench(rng.normal(size=6))
    np.testing.assert_allclose(V.transformed(T).power(F.transformed(T)), np.full(8, V.power(F)), atol=1e-12)
    np.testing.assert_allclose(se3.coadjoint(T.matrix), np.swapaxes(se3.adjoint(se3.inverse(T.matrix)), -1, -2))
    push = Wrench.of_force([0, 0, 2.0], [1.0, 0, 0])
    np.testing.assert_array_equal(push.torque, [0, -2.0, 0])
    np.testing.assert_allclose((push + 2.0 * push + (-push)).force, [0, 0, 4.0])


def test_points_move_and_directions_turn(rng: np.random.Generator) -> None:
    T = Pose(poses(rng, 5))
    p = rng.normal(size=3)
    np.testing.assert_allclose(T.points(p) - T.directions(p), T.translation, atol=1e-15)
    np.testing.assert_allclose(T.inverse().points(T.points(p)), np.tile(p, (5, 1)), atol=1e-14)
    np.testing.assert_allclose((T.power(0.5) @ T.power(0.5)).matrix, T.matrix, atol=1e-13)
    S = Pose(poses(rng, 5))
    np.testing.assert_allclose(T.interpolate(S, 1.0).matrix, S.matrix, atol=1e-13)
    np.testing.assert_allclose(T.interpolate(S, 0.0).matrix, T.matrix, atol=1e-15)
    whole = Pose.from_parts(T.rotation, T.translation)
    np.testing.assert_array_equal(whole.matrix, T.matrix)


def test_velocity_of_points(rng: np.random.Generator) -> None:
    V, p = Twist(rng.normal(size=6)), rng.normal(size=3)
    np.testing.assert_allclose(V.at(p), (se3.hat_matrix(V.coordinates) @ [*p, 1])[:3], atol=1e-15)
    np.testing.assert_allclose((2.0 * V).exp().matrix, V.exp().matrix @ V.exp().matrix, atol=1e-13)


def test_bracket_is_the_derivative_of_the_adjoint(rng: np.random.Generator) -> None:
    xi, eta = rng.normal(size=(2, 6))
    h = 1e-6
    rate = (se3.adjoint(se3.exp(h * xi)) - se3.adjoint(se3.exp(-h * xi))) @ eta / (2 * h)
    np.testing.assert_allclose(se3.bracket(xi) @ eta, rate, atol=1e-9)


# screws ---------------------------------------------------------------------------------------------------------


def test_screws_of_twists_and_wrenches_return(rng: np.random.Generator) -> None:
    for scale in (1.0, 1e-6, 1e-150, 1e150):
        xi = rng.normal(size=(40, 6)) * scale
        xi[:10, 3:] = 0.0
        xi[10:20, :3] = np.cross(rng.normal(size=(10, 3)), xi[10:20, 3:])  # no pitch
        screw = Screw.of_twist(xi)
        assert np.isinf(screw.pitch[:10]).all()
        np.testing.assert_allclose(screw.pitch[10:20], 0.0, atol=1e-12)
        np.testing.assert_allclose(screw.twist().coordinates, xi, rtol=1e-12, atol=1e-13 * scale)
        F = xi[:, [3, 4, 5, 0, 1, 2]]
        np.testing.assert_allclose(Wrench(F).screw().wrench().coordinates, F, rtol=1e-12, atol=1e-13 * scale)
    nothing = Screw.of_twist(np.zeros(6))
    assert nothing.magnitude == 0.0
    np.testing.assert_array_equal(nothing.twist().coordinates, np.zeros(6))


def test_chasles(rng: np.random.Generator) -> None:
    """G Satz 1.6: points of the axis only slide along it, by h M; a translation has infinite pitch."""
    T = Pose(poses(rng, 20))
    screw = T.screw()
    np.testing.assert_allclose(screw.motion().matrix, T.matrix, atol=1e-13)
    slid = T.points(screw.point) - screw.point
    np.testing.assert_allclose(slid, (screw.pitch * screw.magnitude)[:, None] * screw.direction, atol=1e-12)
    shift = Pose.from_parts(translation=[0, 3.0, 0]).screw()
    assert np.isinf(shift.pitch)
    assert shift.magnitude == 3.0
    np.testing.assert_array_equal(shift.direction, [0, 1, 0])


def test_reciprocal_spaces(rng: np.random.Generator) -> None:
    """G 1.9.2: a revolute joint bears every wrench without moment about its axis, and nothing else."""
    joint = Screw([0, 0, 1], [1.0, 2.0, 0.0]).twist().coordinates
    borne = reciprocal(joint[None])
    assert borne.shape == (5, 6)
    np.testing.assert_allclose(borne @ joint, 0.0, atol=1e-14)
    twists = rng.normal(size=(4, 3)) @ rng.normal(size=(3, 6))  # rank 3
    wrenches = reciprocal(twists)
    assert wrenches.shape == (3, 6)
    again = reciprocal(wrenches)
    np.testing.assert_allclose(again @ wrenches.T, 0.0, atol=1e-12)
    assert np.linalg.matrix_rank(np.vstack([again, twists]), tol=1e-9) == 3
    assert reciprocal(np.zeros((2, 6))).shape == (6, 6)
    assert reciprocal(np.zeros((0, 6))).shape == (6, 6)
    crossing = Screw([1, 0, 0], [5.0, 2.0, 0.0])  # a force through the joint's axis
    assert crossing.reciprocal_to(Screw([0, 0, 1], [1.0, 2.0, 0.0]))
    assert not crossing.reciprocal_to(Screw([0, 0, 1], [1.0, 3.0, 0.0]))


# values and mistakes --------------------------------------------------------------------------------------------


def test_values_are_frozen_indexable_and_pickle(rng: np.random.Generator) -> None:
    T = Pose(poses(rng, 3, 2), to="a", of="b")
    assert (len(T), T[1].shape, T[1, 0].shape, T[..., 1].shape) == (3, (2,), (), (3,))
    assert T[1].of == "b"
    again = pickle.loads(pickle.dumps(T))
    np.testing.assert_array_equal(again.matrix, T.matrix)
    assert again.to == "a"
    assert "Pose" in repr(T)
    assert "to='a'" in repr(T)
    np.testing.assert_array_equal(np.asarray(T), T.matrix)
    with pytest.raises(ValueError, match="read-only"):
        T.matrix[0] = 0.0
    with pytest.raises(AttributeError, match="Pose is frozen"):
        T.to = "c"
    with pytest.raises(TypeError, match="a single Pose has no length"):
        len(T[0, 0])
    with pytest.raises(TypeError, match="cannot be indexed"):
        T[0, 0][0]
    with pytest.raises(IndexError):
        T[0, 0, 0]


def test_frames_that_do_not_meet_are_refused(rng: np.random.Generator) -> None:
    T = poses(rng)
    with pytest.raises(InputError, match="T_a_b @ T_c_d: frame 'b' meets frame 'c'"):
        Pose(T, to="a", of="b") @ Pose(T, to="c", of="d")
    with pytest.raises(InputError, match="sum of twists: frame 'a' meets frame 'b'"):
        Twist(np.zeros(6), frame="a") + Twist(np.zeros(6), frame="b")
    with pytest.raises(InputError, match="power of a wrench on a twist: frame 'a' meets frame 'b'"):
        Twist(np.zeros(6), frame="a").power(Wrench(np.zeros(6), frame="b"))
    with pytest.raises(InputError, match="transformation of a wrench"):
        Wrench(np.zeros(6), frame="a").transformed(Pose(T, of="b"))
    with pytest.raises(InputError, match="transformation of a twist"):
        Twist(np.zeros(6), frame="a").transformed(Pose(T, of="b"))
    assert Wrench(np.zeros(6), frame="b").transformed(Pose(T, to="a", of="b")).frame == "a"


def test_mistakes_are_named() -> None:
    with pytest.raises(InputError, match=r"matrix is not a rotation: RᵀR differs from 1 by"):
        Rotation(np.diag([1.0, 1.0, 1.1]))
    with pytest.raises(InputError, match="matrix is a reflection"):
        Rotation(np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(InputError, match=r"axis\[1\] is zero"):
        Rotation.from_axis_angle([[1, 0, 0], [0, 0, 0]], 0.1)
    with pytest.raises(InputError, match="quaternion is zero"):
        Rotation.from_quaternion([0, 0, 0, 0])
    with pytest.raises(InputError, match="axes is 'xxz'; expected one of 'xyz'"):
        Rotation.from_euler([0, 0, 0], "xxz", "intrinsic")
    with pytest.raises(InputError, match="frame is 'body'; expected one of 'intrinsic', 'extrinsic'"):
        Rotation.identity().euler("xyz", "body")
    with pytest.raises(InputError, match="no nearest rotation"):
        Rotation.nearest(np.zeros((3, 3)))
    with pytest.raises(InputError, match="the mean of 2 rotations needs weights"):
        Rotation.identity(2).mean([0.0, 0.0])
    with pytest.raises(InputError, match="magnitude is -1"):
        Screw([0, 0, 1], magnitude=-1.0)
    with pytest.raises(InputError, match="pitch contains NaN"):
        Screw([0, 0, 1], pitch=np.nan)
    with pytest.raises(InputError, match="form is 'x'"):
        quaternion.slerp([1, 0, 0, 0], [1, 0, 0, 0], 0.5, "x")
    with pytest.raises(InputError, match=r"vectors has shape \(6,\); expected \(k, 6\)"):
        reciprocal(np.zeros(6))
    with pytest.raises(InputError, match="first is a number"):
        quaternion.slerp_vectors(1.0, [1.0], 0.5)
