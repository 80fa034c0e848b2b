"""Grasps for hands with several fingers: how many, how fast, and both ways of G 4's table side by side.

python -m benchmarks.grasp_hands
"""

from __future__ import annotations

import time

import numpy as np

from apprehend.bodies import Body
from apprehend.errors import ApprehendError
from apprehend.grasp import plan
from apprehend.kinematics import Hand

HANDS = ("allegro_right", "shadow_right", "adroit", "g1_right_hand")
BODIES = ("mug", "can", "box", "bottle")
TRIES = 480


def main() -> None:
    print(f"{TRIES} tries each; grasps that are force-closure with proof, free of penetration, and hold the body")
    for name in HANDS:
        try:
            hand = Hand.load(name)
        except ApprehendError as error:
            print(f"{name}: not installed ({error})")
            continue
        plan(hand, Body.sphere(0.03, mass=0.05), n=1, rng=np.random.default_rng(0), samples=1)  # compile and prepare
        for body in map(Body.household, BODIES):
            for method in ("inverse", "closing"):
                start = time.perf_counter()
                found = plan(
                    hand, body, n=TRIES, rng=np.random.default_rng(0), method=method, samples=TRIES, apart=(0.0, 0.0)
                )
                spent = time.perf_counter() - start
                best = found[0].quality if found.success else 0.0
                rate = f"{1e3 * spent / len(found):6.0f} ms per grasp" if len(found) else "              none"
                print(f"  {name:14} {body.name:7} {method:8} {len(found):4} grasps, {rate}, best ε {best:.3f}")


if __name__ == "__main__":
    main()
