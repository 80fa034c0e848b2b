"""The one way to compile: every kernel of this package is decorated with `kernel`.

Numba reuses cached machine code of a kernel even when another kernel that it calls has changed. The cache directory
of a file of kernels is therefore keyed by a digest of that file and all that it imports: an edit starts fresh ones. `error_model="numpy"` lets
divisions vectorise, and the fast-math flags leave NaN and infinity meaning what they should.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import config

FAST = {"reassoc", "contract", "arcp", "nsz"}


def _cache_root() -> Path:
    explicit = os.environ.get("APPREHEND_CACHE")
    if explicit:
        return Path(explicit)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return base / "apprehend"


HERE = Path(__file__).parent
_IMPORT = re.compile(r"^\s*from (?:apprehend\.kernels)?\.(\w*) import (\([^)]*\)|.+)$", re.MULTILINE)


@cache
def _sources(path: Path) -> frozenset[Path]:
    """The kernel file *path* and every kernel file that it imports, directly or not."""
    found = {path}
    for module, names in _IMPORT.findall(path.read_text()):
        for name in (module,) if module else re.findall(r"\w+", names):
            other = HERE / f"{name}.py"
            if other.exists() and other not in found and other != path:
                found |= _sources(other)
    return frozenset(found)


@cache
def cache_dir(path: Path) -> Path:
    """Where the machine code of the kernels in *path* is kept: keyed by all the sources that it is made from."""
    state = hashlib.sha256(numba.__version__.encode())
    for source in sorted(_sources(path) | {Path(__file__)}):
        state.update(source.name.encode())
        state.update(source.read_bytes())
    return _cache_root() / "kernels" / f"{path.stem}-{state.hexdigest()[:16]}"


def kernel(
    function: Callable[..., object] | None = None,
    *,
    inline: bool = False,
    fast: bool = True,
    borrow: bool = False,
    splice: bool = False,
) -> Any:
    """Compile *function* lazily with Numba, cached on disk, releasing the GIL.

    *inline* splices the body into its callers (for small helpers in lane loops); *fast* = False keeps strict IEEE
    order of operations (for code whose last bits matter, such as exp and log near their edges). *borrow* is for what
    runs once per block, and neither makes nor returns an array: it counts no references to its arguments. (Each count
    is an atomic operation on a cache line that all threads share; two threads then hinder each other.) *splice* has
    the machine code spliced into its callers: for small helpers with many arguments, which a call would copy.
    """

    def wrap(f: Callable[..., object]) -> Any:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(cache_dir(Path(f.__code__.co_filename)))
        try:
            compiled = numba.njit(
                cache=True,
                nogil=True,
                error_model="numpy",
                fastmath=FAST if fast else False,
                inline="always" if inline else "never",
                _nrt=not borrow,
                forceinline=splice,
            )(f)
        finally:
            config.CACHE_DIR = before
        return compiled

    return wrap if function is None else wrap(function)
