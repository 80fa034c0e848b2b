"""Jaw grasp planning on household bodies with a few thousand faces: seconds per plan, and what is found.

python -m benchmarks.grasp_plan
"""

from __future__ import annotations

import time

import numpy as np

import apprehend as ap
from apprehend import grasp, parallel
from apprehend.bodies import HOUSEHOLD


def main() -> None:
    hand = ap.Hand.load("robotiq_2f_85")
    for threads in (1, 2):
        parallel.set_threads(threads)
        print(f"\n{threads} thread(s)")
        for name in HOUSEHOLD:
            body = ap.Body.household(name)
            table = body.stable_poses()[0].pose
            times = []
            for _ in range(3):
                start = time.perf_counter()
                found = grasp.plan(hand, body, 50, rng=np.random.default_rng(0), table=table)
                times.append(time.perf_counter() - start)
            print(f"  {name:<14} {len(body.faces):>6} faces  {min(times):6.2f} s  {found.explain()}")


if __name__ == "__main__":
    main()
