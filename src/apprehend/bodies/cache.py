"""Where the things are kept that can be computed again."""

from __future__ import annotations

from pathlib import Path


def cache_folder(name: str) -> Path:
    """The folder *name* of this user's cache (``APPREHEND_CACHE``, or the platform's own place)."""
    from ..kernels._jit import _cache_root

    return _cache_root() / name
