"""Threads: blocks of a batch spread over cores. Kernels release the GIL, so plain threads do.

The number of threads is a property of the process, not of a call: `set_threads`, or ``APPREHEND_THREADS`` in the
environment; the default is every core that the process may use. Results do not depend on it: each thread owns a
contiguous range of problems, and nothing is summed across threads.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait

from .errors import InputError

_pool: ThreadPoolExecutor | None = None
_helping = 0
_threads = 0
_this = threading.local()


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


def threads() -> int:
    """Number of threads that batched functions use."""
    if not _threads:
        text = os.environ.get("APPREHEND_THREADS", "")
        set_threads(int(text) if text.isdigit() and int(text) > 0 else _cores())
    return _threads


def set_threads(n: int) -> None:
    """Use *n* threads from now on."""
    global _threads
    if n < 1:
        raise InputError(f"threads is {n}; expected 1 or more")
    _threads = n


def over_ranges(work: Callable[[int, int], object], count: int, grain: int = 1, step: int = 1) -> None:
    """Call ``work(start, stop)`` on contiguous ranges that cover ``range(count)``, on several threads.

    *grain* is the smallest range worth a thread of its own; the first range, and all of a batch below two grains, runs
    in the caller's thread, and so does all that is asked for within a range. Ranges begin at multiples of *step*, for
    work that carries something from one problem to the next. An exception in any range is raised here.
    """
    parts = min(threads(), max(1, count // max(grain, step, 1)))
    if parts <= 1 or getattr(_this, "helps", False):
        work(0, count)
        return
    pool = _helpers(parts - 1)
    edges = [*(count * i // (parts * step) * step for i in range(parts)), count]
    futures = [pool.submit(_help, work, a, b) for a, b in zip(edges[1:-1], edges[2:], strict=True)]
    try:
        work(edges[0], edges[1])
    finally:
        wait(futures)
    for future in futures:
        future.result()


def _help(work: Callable[[int, int], object], start: int, stop: int) -> None:
    _this.helps = True
    work(start, stop)


def _helpers(n: int) -> ThreadPoolExecutor:
    """A pool of at least *n* threads, which lives on from call to call."""
    global _pool, _helping
    if _pool is None or _helping < n:
        _pool, _helping = ThreadPoolExecutor(max_workers=n, thread_name_prefix="apprehend"), n
    return _pool
