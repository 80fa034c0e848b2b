"""ε of grasps: beside SciPy's convex hull, and the certified interval beside a search.

python -m benchmarks.grasp_quality
"""

from __future__ import annotations

import numpy as np

from apprehend import parallel
from benchmarks._harness import interleave, table
from tests.grasp.makers import random_grasp


def support(grasp, directions: np.ndarray) -> np.ndarray:
    """Exact L1 support values of a grasp of Coulomb contacts along ``(N, 6)``."""
    base, spread, _ = grasp.generators
    h = directions @ base.T + np.linalg.norm(np.einsum("ksp,np->nks", spread, directions), axis=2)
    return np.maximum(h, 0.0).max(axis=1)


def searched(grasp, rng: np.random.Generator, starts: int = 2000, rounds: int = 60) -> float:
    """Smallest support value that a random search with shrinking steps finds: an upper bound of ε."""
    u = rng.normal(size=(starts, 6))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    u = u[np.argsort(support(grasp, u))[:40]]
    step = 0.5
    for _ in range(rounds):
        trial = (u[:, None] + step * rng.normal(size=(len(u), 12, 6))).reshape(-1, 6)
        trial = np.concatenate([u, trial / np.linalg.norm(trial, axis=1, keepdims=True)])
        u = trial[np.argsort(support(grasp, trial))[:40]]
        step *= 0.8
    return float(support(grasp, u).min())


def main() -> None:
    from scipy.spatial import ConvexHull

    rng = np.random.default_rng(0)
    parallel.set_threads(1)
    grasps = []
    while len(grasps) < 40:
        grasp = random_grasp(rng, 4, friction=0.8, spread=0.15)
        if grasp.force_closure().success:
            grasps.append(grasp)
    clouds = [np.vstack([g.edges(8), np.zeros(6)]) for g in grasps]
    worst = max(
        abs(g.quality(cone="polyhedral").value - float((-ConvexHull(c).equations[:, -1]).min()))
        for g, c in zip(grasps, clouds, strict=True)
    )
    timing = interleave(
        {
            "apprehend": (lambda: [g.quality(cone="polyhedral") for g in grasps], len(grasps)),
            "scipy.spatial.ConvexHull": (lambda: [ConvexHull(c) for c in clouds], len(grasps)),
        },
        rounds=3,
    )
    table(f"ε, L1, 4 contacts, 8 edges, 6-D (largest difference {worst:.1e})", timing, "apprehend")
    timing = interleave({"apprehend": (lambda: [g.quality(gap=0.01) for g in grasps], len(grasps))})
    table("ε, L1, exact cones, interval of 1 %", timing, "apprehend")
    inside_all, cases = 0, 1000
    for i in range(cases):
        grasp = random_grasp(rng, 3 + i % 3, friction=0.8, spread=0.2)
        found = grasp.quality(gap=0.01)
        best = searched(grasp, rng)
        inside_all += found.lower <= best + 1e-9 and found.upper <= best * (1.0 + 1e-2) + 1e-9
    print(f"\nsearch agrees with the certified interval in {inside_all} of {cases} cases")


if __name__ == "__main__":
    main()
