"""Where the things are kept that can be computed again."""

from __future__ import annotations

from pathlib import Path

from ..files import replace_file


def cache_folder(name: str) -> Path:
    """The folder *name* of this user's cache (``APPREHEND_CACHE``, or the platform's own place)."""
    from ..kernels._jit import _cache_root

    return _cache_root() / name


def write_whole(path: Path, data: bytes) -> None:
    """Write *data* to *path* so that the file is there whole or not at all."""
    with replace_file(path) as work:
        work.write_bytes(data)
