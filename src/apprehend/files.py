"""Writing files so that nothing is ever half-written: a temporary name first, then a rename."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError


@contextmanager
def replace_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside *path*; it takes the name *path* when the block ends without an exception."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=target.suffix, dir=target.parent)
    os.close(handle)
    work = Path(name)
    mask = os.umask(0)
    os.umask(mask)
    work.chmod(0o666 & ~mask)  # a temporary file is private; a written one is as readable as any other
    try:
        yield work
        work.chmod(0o666 & ~_umask())
        work.replace(target)
    finally:
        work.unlink(missing_ok=True)


def _umask() -> int:
    """The process's mask for new files; temporary files are made readable by their owner alone."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


@contextmanager
def replace_directory(path: str | Path, marker: str) -> Iterator[Path]:
    """Yield a temporary directory that becomes *path* when the block ends without an exception.

    An existing *path* is replaced only if it is empty or holds the file *marker* (that is, if it is such a directory).
    """
    target = Path(path)
    if target.exists() and not target.is_dir():
        raise InputError(f"{target} is a file; give a directory")
    if target.is_dir() and any(target.iterdir()) and not (target / marker).exists():
        raise InputError(f"{target} is not empty and holds no {marker}; give a new directory, or empty this one")
    target.parent.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        yield work
        work.chmod(0o777 & ~_umask())
        if target.exists():
            shutil.rmtree(target)
        work.replace(target)
    finally:
        shutil.rmtree(work, ignore_errors=True)
