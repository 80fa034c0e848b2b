"""Threads: blocks of a batch spread over cores. Kernels release the GIL, so plain threads do.

The number of threads is a property of the process, not of a call: `set_threads`, or ``APPREHEND_THREADS`` in the
environment; the default is every core that the process may use. Results do not depend on it: each thread owns a
contiguous range of problems, and nothing is summed across threads.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from .errors import InputError

_pool: ThreadPoolExecutor | None = None
_threads = 0


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
    global _threads, _pool
    if n < 1:
        raise InputError(f"threads is {n}; expected 1 or more")
    if _pool is not None:
        _pool.shutdown()
        _pool = None
    _threads = n


def over_ranges(work: Callable[[int, int], object], count: int, grain: int = 1) -> None:
    """Call ``work(start, stop)`` on contiguous ranges that cover ``range(count)``, on several threads.

    *grain* is the smallest range worth a thread of its own; a batch below two grains runs in the caller's thread.
    An exception in any range is raised here.
    """
    global _pool
    parts = min(threads(), max(1, count // max(grain, 1)))
    if parts <= 1:
        work(0, count)
        return
    if _pool is None:
        _pool = ThreadPoolExecutor(max_workers=_threads, thread_name_prefix="apprehend")
    edges = [count * i // parts for i in range(parts + 1)]
    futures = [_pool.submit(work, a, b) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    for future in futures:
        future.result()
