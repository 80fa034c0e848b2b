"""Arguments are read or refused with the name, the place and the remedy."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.arrays import as_array, as_pose, as_shaped, as_vector, choice
from apprehend.errors import InputError, UnknownNameError, unknown_name


def test_nan_is_named_with_its_index() -> None:
    with pytest.raises(InputError, match=r"q\[1, 2\] is nan"):
        as_array([[0, 0, 0], [0, 0, np.nan]], "q")


def test_text_is_refused() -> None:
    with pytest.raises(InputError, match="q must be numbers"):
        as_array([["a"]], "q")  # type: ignore[list-item]


def test_ragged_is_refused() -> None:
    with pytest.raises(InputError, match="rectangular"):
        as_array([[1, 2], [3]], "q")  # type: ignore[list-item]


def test_wrong_shape_tells_both_shapes() -> None:
    with pytest.raises(InputError, match=r"q has shape \(5,\); expected \(\.\.\., 6\)"):
        as_shaped(np.zeros(5), "q", 6)


def test_scalar_spreads_over_a_vector() -> None:
    assert np.array_equal(as_vector(2.0, "weights", 3), [2, 2, 2])


def test_vector_of_wrong_length() -> None:
    with pytest.raises(InputError, match=r"weights has shape \(2,\); expected \(3,\)"):
        as_vector([1, 2], "weights", 3)


def test_pose_must_be_homogeneous() -> None:
    with pytest.raises(InputError, match="last row"):
        as_pose(np.ones((4, 4)), "T")


def test_pose_must_be_a_rotation() -> None:
    T = np.eye(4)
    T[0, 0] = 1.1
    with pytest.raises(InputError, match="T is not a rotation"):
        as_pose(T, "T")


def test_reflection_is_named() -> None:
    with pytest.raises(InputError, match="T is a reflection"):
        as_pose(np.diag([1.0, 1.0, -1.0, 1.0]), "T")


def test_choice_lists_what_is_allowed() -> None:
    with pytest.raises(InputError, match="reference is 'x'; expected one of 'a', 'b'"):
        choice("x", "reference", ("a", "b"))


def test_unknown_name_suggests() -> None:
    with pytest.raises(UnknownNameError, match=r"no robot named 'pandda'.* Did you mean 'panda'\?"):
        unknown_name("robot", "pandda", ["panda", "ur5e"])


def test_unknown_name_without_a_close_match_lists_all() -> None:
    with pytest.raises(UnknownNameError, match="There are: panda, ur5e"):
        unknown_name("robot", "xyz", ["panda", "ur5e"])
