"""Ranges cover a batch exactly once on any number of threads, and errors surface."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend import parallel
from apprehend.errors import InputError


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, 7, 1000])
def test_ranges_cover_the_batch_once(threads: int, count: int) -> None:
    before = parallel.threads()
    parallel.set_threads(threads)
    try:
        hits = np.zeros(count, dtype=int)

        def work(a: int, b: int) -> None:
            hits[a:b] += 1

        parallel.over_ranges(work, count)
        assert (hits == 1).all()
    finally:
        parallel.set_threads(before)


def test_an_exception_in_a_range_is_raised() -> None:
    def work(a: int, b: int) -> None:
        raise RuntimeError(f"range {a}")

    with pytest.raises(RuntimeError, match="range"):
        parallel.over_ranges(work, 100)


def test_zero_threads_is_refused() -> None:
    with pytest.raises(InputError, match="threads is 0"):
        parallel.set_threads(0)


def test_ranges_within_ranges_do_not_wait_for_each_other() -> None:
    before = parallel.threads()
    parallel.set_threads(2)
    try:
        hits = np.zeros((4, 100), dtype=int)

        def outer(a: int, b: int) -> None:
            for row in range(a, b):

                def inner(c: int, d: int, row: int = row) -> None:
                    hits[row, c:d] += 1

                parallel.over_ranges(inner, 100)

        parallel.over_ranges(outer, 4)
        assert (hits == 1).all()
    finally:
        parallel.set_threads(before)
