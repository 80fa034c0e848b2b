"""How the functions of this room meet kernels: leading dimensions to rows and back."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError


def rows(array: Array, width: int, tail: int) -> Array:
    """*array*, whose last *tail* dimensions are one item, as writable contiguous ``(N, width)``."""
    count = math.prod(array.shape[: array.ndim - tail])
    flat = np.ascontiguousarray(array).reshape(count, width)
    return flat if flat.flags.writeable else flat.copy()


def apply(kernel: Callable[..., Any], array: Array, tail: tuple[int, ...], out: tuple[int, ...], *more: Any) -> Array:
    """Run *kernel* on all items ``(..., *tail)`` of *array*; its answers have shape ``(..., *out)``."""
    flat = rows(array, math.prod(tail), len(tail))
    answer = np.empty((flat.shape[0], math.prod(out)))
    kernel(flat, *more, answer)
    return answer.reshape(*array.shape[: array.ndim - len(tail)], *out)


def unit(vector: ArrayLike, name: str) -> Array:
    """*vector* ``(..., k)`` divided by its length; `InputError` where that is zero."""
    array = as_array(vector, name)
    if array.ndim == 0:
        raise InputError(f"{name} is a number; expected a vector")
    largest = np.abs(array).max(axis=-1, keepdims=True, initial=0.0)
    if not largest.all():
        where = tuple(int(i) for i in np.argwhere(largest[..., 0] == 0.0)[0])
        raise InputError(f"{name}{list(where) if where else ''} is zero: it has no direction")
    scaled = array / largest
    answer: Array = scaled / np.linalg.norm(scaled, axis=-1, keepdims=True)
    return answer
