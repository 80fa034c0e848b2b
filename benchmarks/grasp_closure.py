"""Exact force closure in batches, every verdict with its proof: grasps per second, beside one cone program each.

python -m benchmarks.grasp_closure
"""

from __future__ import annotations

import clarabel
import numpy as np
from scipy import sparse

from apprehend import parallel
from apprehend.grasp import Closures, Grasp, force_closures
from benchmarks._harness import interleave, table
from tests.grasp.makers import random_grasp


def wrong_proofs(grasps: list[Grasp], found: Closures) -> int:
    """How many proofs fail when they are recomputed from each grasp's own matrix and cones."""
    wrong = 0
    for i, grasp in enumerate(grasps):
        if found.closed[i]:
            f = found.forces[i, :, :3].ravel()
            slack = min(float(c.slack(f[s])) for c, s in zip(grasp.contacts, grasp.slices, strict=True))
            rest = float(np.abs(grasp.scale * (grasp.matrix @ f)).max())
            wrong += not (slack > 1e-8 and rest < 1e-10 and grasp.rank == 6)
        else:
            base, spread, _ = grasp.generators
            reach = base @ found.wrenches[i] + np.linalg.norm(spread @ found.wrenches[i], axis=1)
            wrong += not reach.max() < 1e-7
    return wrong


def program(grasp: Grasp) -> clarabel.DefaultSolver:
    """``max t`` over internal forces with slack t and normal forces that sum to one, ready to solve."""
    k, G = len(grasp), grasp.matrix
    mu = grasp.contacts[0].friction
    equal = np.zeros((7, 3 * k + 1))
    equal[:6, :-1], equal[6, 2:-1:3] = G, 1.0
    cones = np.zeros((3 * k, 3 * k + 1))
    for i in range(k):
        cones[3 * i, [3 * i + 2, -1]] = -mu, mu
        cones[3 * i + 1, 3 * i] = cones[3 * i + 2, 3 * i + 1] = -1.0
    A = sparse.csc_matrix(np.vstack([equal, cones]))
    b = np.concatenate([np.zeros(6), [1.0], np.zeros(3 * k)])
    q = np.zeros(3 * k + 1)
    q[-1] = -1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    kinds = [clarabel.ZeroConeT(7), *(clarabel.SecondOrderConeT(3) for _ in range(k))]
    return clarabel.DefaultSolver(sparse.csc_matrix((3 * k + 1, 3 * k + 1)), q, A, b, kinds, settings)


def main() -> None:
    rng = np.random.default_rng(0)
    for k in (3, 4, 5):
        grasps = [random_grasp(rng, k) for _ in range(4000)]
        points = np.array([[c.position for c in g.contacts] for g in grasps])
        normals = np.array([[c.normal for c in g.contacts] for g in grasps])
        few = grasps[:60]
        found = force_closures(points, normals)
        peer = np.array([program(g).solve().x[-1] > 1e-7 for g in few])
        for threads in (1, 2):
            parallel.set_threads(threads)
            timing = interleave(
                {
                    "apprehend": (lambda p=points, n=normals: force_closures(p, n), len(grasps)),
                    "Clarabel": (lambda f=few: [program(g).solve() for g in f], len(few)),
                },
                rounds=5,
            )
            table(f"force closure, {k} Coulomb contacts, {threads} thread(s)", timing, "apprehend")
            print(
                f"  {1.0 / timing['apprehend'].median:,.0f} grasps per second, {found.closed.mean():.0%} of them closed"
            )
        same = int((peer == found.closed[: len(few)]).sum())
        wrong = wrong_proofs(grasps, found)
        print(f"  Clarabel agrees on {same} of {len(few)}; {wrong} of {len(grasps)} proofs are wrong")


if __name__ == "__main__":
    main()
