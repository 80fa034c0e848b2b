"""Reading the Panda's URDF without its meshes: ours, checked and with its repairs, against Pinocchio and urchin.

python -m benchmarks.robots_load
"""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Callable

from apprehend.robots import catalogue, load_description

from ._harness import interleave, seconds, table

START = "import time; t = time.perf_counter(); {}; print(time.perf_counter() - t)"
OURS = "from apprehend.robots import load_description as load; load('panda')"


def contenders(path: str) -> dict[str, tuple[Callable[[], object], int]]:
    """Ours, and the peers that are installed."""
    found: dict[str, tuple[Callable[[], object], int]] = {"apprehend": (lambda: load_description("panda"), 1)}
    try:
        import pinocchio as pin

        found["Pinocchio (C++, without geometry)"] = (lambda: pin.buildModelFromUrdf(path), 1)
    except ImportError:
        print("Pinocchio is not installed")
    try:
        import urchin

        found["urchin (lazy meshes)"] = (lambda: urchin.URDF.load(path, lazy_load_meshes=True), 1)
    except ImportError:
        print("urchin is not installed")
    return found


def main() -> None:
    path = str(catalogue.entry("panda").file())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        table("Panda URDF", interleave(contenders(path), rounds=15), "apprehend")
    runs = [
        float(subprocess.run([sys.executable, "-c", START.format(OURS)], capture_output=True, text=True).stdout)
        for _ in range(5)
    ]
    print(f"\nfresh process, import and load together: {seconds(sorted(runs)[2])} (fastest {seconds(min(runs))})")


if __name__ == "__main__":
    main()
