"""The one way to compile: every kernel of this package is decorated with `kernel`.

Numba reuses cached machine code of a kernel even when another kernel that it calls has changed. The cache directory
is therefore keyed by a digest of all kernel sources: any edit starts a fresh directory. `error_model="numpy"` lets
divisions vectorise, and the fast-math flags leave NaN and infinity meaning what they should.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

import numba
from numba.core import config

FAST = {"reassoc", "contract", "arcp", "nsz"}

F = TypeVar("F", bound=Callable[..., object])


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


def _digest() -> str:
    here = Path(__file__).parent
    state = hashlib.sha256()
    for path in sorted(here.rglob("*.py")):
        state.update(path.relative_to(here).as_posix().encode())
        state.update(path.read_bytes())
    state.update(numba.__version__.encode())
    return state.hexdigest()[:16]


CACHE_DIR = _cache_root() / "kernels" / _digest()


def kernel(function: F | None = None, *, inline: bool = False, fast: bool = True) -> F | Callable[[F], F]:
    """Compile *function* lazily with Numba, cached on disk, releasing the GIL.

    *inline* splices the body into its callers (for small helpers in lane loops); *fast* = False keeps strict IEEE
    order of operations (for code whose last bits matter, such as exp and log near their edges).
    """

    def wrap(f: F) -> F:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(CACHE_DIR)
        try:
            compiled = numba.njit(
                cache=True,
                nogil=True,
                error_model="numpy",
                fastmath=FAST if fast else False,
                inline="always" if inline else "never",
            )(f)
        finally:
            config.CACHE_DIR = before
        return cast(F, compiled)

    return wrap if function is None else wrap(function)
