"""Memory for large answers, used again once the caller has let go of it.

A fresh array of tens of megabytes costs more in page faults than the kernel that fills it. Buffers handed out here are
kept, and given again when nothing refers to them any more (every view of an array holds on to its base).
"""

from __future__ import annotations

import math
import sys
import threading

import numpy as np

from ..arrays import Array

SMALLEST = 1 << 17
"""Entries (1 MB) below which an array is simply allocated."""

LARGEST = 1 << 24
"""Entries (128 MB) that are kept in all; beyond, the least recently used buffers are let go."""

_lock = threading.Lock()
_kept: list[Array] = []


def _unused(index: int) -> bool:
    """Whether only the list refers to a buffer: the list itself and the argument of `getrefcount`."""
    return sys.getrefcount(_kept[index]) <= 2


def empty(*shape: int) -> Array:
    """An uninitialised float64 array, like `numpy.empty`."""
    size = math.prod(shape)
    if size < SMALLEST or size > LARGEST:
        return np.empty(shape)
    with _lock:
        for i, buffer_size in enumerate([buffer.size for buffer in _kept]):
            if size <= buffer_size <= 2 * size and _unused(i):
                buffer = _kept.pop(i)
                break
        else:
            buffer = np.empty(size)
        _kept.append(buffer)
        while sum(b.size for b in _kept) > LARGEST:
            _kept.pop(0)
        return buffer[:size].reshape(shape)
