"""Checks and shapes of array arguments: every public function reads its arguments through these.

They turn what the caller gave into contiguous float64 arrays, or raise `InputError` with the name of the argument,
what was found, and what is expected.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError

Array = NDArray[np.float64]
"""A float64 array."""
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

ROTATION_TOLERANCE = 1e-6
"""Largest entry of ``R.T @ R - 1`` that still counts as a rotation given with rounded digits."""


def is_complex(value: Any) -> bool:
    """Whether an array holds complex numbers, whose imaginary part NumPy would drop with a warning."""
    return getattr(getattr(value, "dtype", None), "kind", "") == "c"


def as_array(value: ArrayLike, name: str, *, finite: bool = True) -> Array:
    """*value* as a C-contiguous float64 array; NaN and inf are refused unless *finite* is False."""
    if is_complex(value):
        raise InputError(f"{name} is complex; expected real numbers")
    try:
        array = np.asarray(value, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be numbers in a rectangular array; {error}") from error
    if not array.flags.writeable:
        array = array.copy()  # kernels would be compiled a second time for read-only arrays
    if finite and not np.isfinite(array).all():
        bad = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{name}{list(bad) if bad else ''} is {array[bad]}; every entry must be finite")
    return array


def as_own(value: ArrayLike, name: str, *, finite: bool = True) -> Array:
    """As `as_array`, but never the caller's own memory: for values that are kept."""
    array = as_array(value, name, finite=finite)
    return array.copy() if isinstance(value, np.ndarray) and np.may_share_memory(array, value) else array


def spread(array: Array, shape: tuple[int, ...]) -> Array:
    """*array* broadcast to *shape*, contiguous and writable, so that kernels meet one type; itself if it has it."""
    return array if array.shape == shape else np.array(np.broadcast_to(array, shape), order="C")


def as_shaped(value: ArrayLike, name: str, *tail: int, finite: bool = True) -> Array:
    """*value* as float64 of shape ``(..., *tail)``; any leading batch shape is kept."""
    array = as_array(value, name, finite=finite)
    if array.shape[array.ndim - len(tail) :] != tail or array.ndim < len(tail):
        expected = ", ".join(("...", *map(str, tail)))
        raise InputError(f"{name} has shape {array.shape}; expected ({expected})")
    return array


def as_vector(value: ArrayLike, name: str, n: int) -> Array:
    """*value* as float64 of shape ``(n,)``; a scalar is spread over all entries."""
    array = as_array(value, name, finite=False)
    if np.isnan(array).any():
        raise InputError(f"{name} contains NaN; every entry must be a number")
    if array.ndim == 0:
        return np.full(n, float(array))
    if array.shape != (n,):
        raise InputError(f"{name} has shape {array.shape}; expected ({n},)")
    return array


def as_pose(value: ArrayLike, name: str) -> Array:
    """*value* as homogeneous transforms ``(..., 4, 4)`` whose rotation is proper within `ROTATION_TOLERANCE`."""
    if not isinstance(value, np.ndarray) and hasattr(value, "matrix"):
        value = value.matrix
    T = as_shaped(value, name, 4, 4)
    if not np.array_equal(T[..., 3, :], np.broadcast_to([0.0, 0.0, 0.0, 1.0], T.shape[:-2] + (4,))):
        raise InputError(f"{name} has a last row other than (0, 0, 0, 1): not a homogeneous transform")
    check_rotation(T[..., :3, :3], name)
    return T


def check_rotation(R: Array, name: str) -> None:
    """Raise `InputError` unless every matrix of *R* ``(..., 3, 3)`` is a proper rotation."""
    error = np.abs(np.einsum("...ki,...kj->...ij", R, R) - np.eye(3))
    worst = float(error.max(initial=0.0))
    if worst > ROTATION_TOLERANCE:
        raise InputError(
            f"{name} is not a rotation: RᵀR differs from 1 by {worst:.3g} (at most {ROTATION_TOLERANCE:g}); "
            "normalise it, or check the order of its entries"
        )
    if R.size and float(np.linalg.det(R).min()) < 0.0:
        raise InputError(f"{name} is a reflection (determinant −1); expected a rotation (determinant +1)")


def choice(value: Any, name: str, allowed: tuple[str, ...]) -> str:
    """*value* if it is one of *allowed*, else `InputError` that lists them."""
    if value not in allowed:
        raise InputError(f"{name} is {value!r}; expected one of {', '.join(map(repr, allowed))}")
    return str(value)
