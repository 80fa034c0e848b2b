"""Large answers never share memory while both are alive, and memory is used again afterwards."""

from __future__ import annotations

import numpy as np

from apprehend.arrays import Array
from apprehend.kinematics import memory


def start_of(array: Array) -> int:
    return int(array.__array_interface__["data"][0])


def test_living_arrays_never_overlap() -> None:
    alive = [memory.empty(200_000 + 10_000 * i) for i in range(12)]
    for i, a in enumerate(alive):
        a[:] = i
    view = alive[3][5:10].reshape(5, 1)
    del alive[3]
    more = [memory.empty(230_000) for _ in range(4)]
    for m in more:
        m[:] = -1.0
    assert (view == 3).all()
    for i, a in zip([*range(3), *range(4, 12)], alive, strict=True):
        assert (a == i).all()


def test_memory_is_used_again() -> None:
    memory._kept.clear()
    first = memory.empty(300, 1000)
    address = start_of(first)
    del first
    again = {start_of(memory.empty(290, 1000)) for _ in range(5)}
    assert again == {address}


def test_kept_memory_is_bounded() -> None:
    arrays = [memory.empty(3_000_000) for _ in range(9)]
    assert sum(b.size for b in memory._kept) <= memory.LARGEST
    assert len({start_of(a) for a in arrays}) == 9
    assert memory.empty(3, 4).shape == (3, 4)
    assert np.shares_memory(memory.empty(10), np.empty(1)) is False
