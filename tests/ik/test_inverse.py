"""The textbook inverses: Penrose's laws, the curves of the singular values, weights, and the optimal transpose step."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import ik
from apprehend.errors import InputError


@pytest.mark.parametrize("shape", [(6, 7), (6, 6), (6, 4), (3, 3)])
@pytest.mark.parametrize("rank", [2, 3, 6])
def test_rank_cases_obey_penrose(shape: tuple[int, int], rank: int) -> None:
    rng = np.random.default_rng(rank)
    r = min(rank, *shape)
    J = rng.normal(size=(5, shape[0], r)) @ rng.normal(size=(5, r, shape[1]))
    P = ik.inverse_jacobian(J)
    assert np.allclose(J @ P @ J, J)
    assert np.allclose(P @ J @ P, P)
    assert np.allclose(P, np.linalg.pinv(J, rcond=1e-10))
    N = ik.null_space_projector(J)
    assert np.allclose(J @ N, 0.0, atol=1e-9)
    assert np.allclose(N @ N, N)


def test_damping_is_lambda_squared_on_the_diagonal() -> None:
    J = np.random.default_rng(0).normal(size=(6, 7))
    P = ik.inverse_jacobian(J, "damped", 0.3)
    assert np.allclose(P, J.T @ np.linalg.inv(J @ J.T + 0.3**2 * np.eye(6)))


def test_the_curves_meet_where_they_should() -> None:
    s = np.linspace(0.0, 1.0, 10001)
    plain = ik.inverse_singular_values(s)
    clipped = ik.inverse_singular_values(s, "clipped", 0.2)
    smooth = ik.inverse_singular_values(s, "smooth", 0.2)
    above = s >= 0.2
    assert np.allclose(clipped[above], plain[above])
    assert np.allclose(smooth[above], plain[above])
    assert (clipped[~above] == 0.0).all()
    assert smooth[0] == 0.0
    assert np.abs(np.diff(smooth)).max() < 0.01  # no jump
    slope = np.diff(smooth) / np.diff(s)
    assert np.abs(np.diff(slope))[1500:].max() < 0.2  # no kink at 0.2
    assert np.abs(np.diff(clipped)).max() > 4.9


def test_weights() -> None:
    J = np.random.default_rng(1).normal(size=(3, 5))
    held = ik.inverse_jacobian(J, joint_weight=[1, 1, 0, 1, 1])
    assert np.allclose(held[2], 0.0)
    assert np.allclose(J @ held, np.eye(3))
    given_up = ik.inverse_jacobian(J, task_weight=[1, 0, 1])
    assert np.allclose(given_up[:, 1], 0.0)
    assert np.allclose((J @ given_up)[np.ix_([0, 2], [0, 2])], np.eye(2))


def test_the_transpose_step_is_the_best_along_its_direction() -> None:
    rng = np.random.default_rng(2)
    J, dx = rng.normal(size=(20, 6, 7)), rng.normal(size=(20, 6))
    step = ik.transpose_step(J, dx)
    left = np.linalg.norm(np.einsum("bmn,bn->bm", J, step) - dx, axis=1)
    for factor in (0.9, 1.1):
        other = np.linalg.norm(np.einsum("bmn,bn->bm", J, factor * step) - dx, axis=1)
        assert (left < other).all()
    assert np.allclose(ik.transpose_step(np.zeros((6, 7)), np.ones(6)), 0.0)


def test_bad_arguments_are_named() -> None:
    with pytest.raises(InputError, match="method is 'svd'; expected one of 'rank'"):
        ik.inverse_jacobian(np.eye(3), "svd")
    with pytest.raises(InputError, match="sigma has the negative entry"):
        ik.inverse_singular_values([-1.0])
    with pytest.raises(InputError, match="parameter is 0"):
        ik.inverse_singular_values([1.0], "damped", 0)
    with pytest.raises(InputError, match=r"J has shape \(3,\)"):
        ik.inverse_jacobian(np.ones(3))
    with pytest.raises(InputError, match="must not be negative"):
        ik.inverse_jacobian(np.eye(3), joint_weight=[1, 1, -1])


def test_the_curves_are_drawn_with_their_jump_and_the_marks_of_a_jacobian() -> None:
    pytest.importorskip("matplotlib")
    sigma = np.linalg.svd(np.random.default_rng(3).normal(size=(6, 7)), compute_uv=False)
    axes = ik.plot_inverses(0.2, sigma=sigma)
    curves = {line.get_label(): line.get_xydata() for line in axes.lines if not line.get_label().startswith("_")}
    assert len(curves) == 4
    smooth = next(v for k, v in curves.items() if k.startswith("smooth"))
    assert np.allclose(smooth[:, 1], ik.inverse_singular_values(smooth[:, 0], "smooth", 0.2))
    marks = [line for line in axes.lines if line.get_marker() == "o"]
    assert np.allclose(marks[0].get_ydata(), 1.0 / sigma)
    assert ik.plot_inverses(axes=axes) is axes
    with pytest.raises(InputError, match=r"sigma has shape \(1, 2\)"):
        ik.plot_inverses(sigma=[[1.0, 2.0]])
    with pytest.raises(InputError, match="has no inverse to draw"):
        ik.plot_inverses(sigma=[0.0])
