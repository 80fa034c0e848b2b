"""Optimal contact forces beside Clarabel and CVXPY: one wrench at a time, and families of wrenches.

python -m benchmarks.grasp_forces
"""

from __future__ import annotations

import numpy as np

from apprehend import parallel
from apprehend.grasp import Grasp
from benchmarks._harness import interleave, table
from tests.grasp.makers import random_grasp


def closed_grasp(rng: np.random.Generator, k: int) -> Grasp:
    while True:
        grasp = random_grasp(rng, k)
        if grasp.force_closure().success:
            return grasp


def clarabel_call(grasp: Grasp, wrench: np.ndarray):
    """A function that sets up and solves the same program with Clarabel, and returns its value."""
    import clarabel
    import scipy.sparse as sp

    m, k = grasp.matrix.shape[1], len(grasp)
    mu = np.array([c.friction for c in grasp.contacts])
    cone = np.zeros((m, m))
    for i in range(k):
        cone[3 * i, 3 * i + 2] = -mu[i]
        cone[3 * i + 1, 3 * i] = cone[3 * i + 2, 3 * i + 1] = -1.0
    A = sp.csc_matrix(np.vstack([grasp.matrix, cone]))
    P = sp.csc_matrix((m, m))
    q = np.zeros(m)
    q[2::3] = 1.0
    b = np.concatenate([-wrench, np.zeros(m)])
    cones = [clarabel.ZeroConeT(6), *(clarabel.SecondOrderConeT(3) for _ in range(k))]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1

    def call() -> float:
        return clarabel.DefaultSolver(P, q, A, b, cones, settings).solve().obj_val

    return call


def cvxpy_call(grasp: Grasp, wrench: np.ndarray):
    import cvxpy as cp

    def call() -> float:
        f = cp.Variable((len(grasp), 3))
        stacked = cp.reshape(f, (3 * len(grasp),), order="C")
        cones = [cp.SOC(c.friction * f[i, 2], f[i, :2]) for i, c in enumerate(grasp.contacts)]
        problem = cp.Problem(cp.Minimize(cp.sum(f[:, 2])), [grasp.matrix @ stacked == -wrench, *cones])
        return float(problem.solve(solver=cp.CLARABEL))

    return call


def repeated(call, times: int):
    """A function that makes the call so many times: one alone would find the caches cold."""

    def calls() -> None:
        for _ in range(times):
            call()

    return calls


def main() -> None:
    rng = np.random.default_rng(0)
    for k in (3, 5, 16):
        grasp = closed_grasp(rng, k)
        w = rng.normal(size=6)
        contenders = {"apprehend": (repeated(lambda g=grasp, w=w: g.contact_forces(w), 200), 200)}
        try:
            peer = clarabel_call(grasp, w)
            contenders["Clarabel (set up and solved)"] = (repeated(peer, 50), 50)
            ours = grasp.contact_forces(w)
            print(f"{k} contacts: values differ by {abs(ours.value - peer()) / ours.value:.1e}, {ours.steps} steps")
        except ImportError:
            print("Clarabel is not installed")
        try:
            contenders["CVXPY with Clarabel"] = (cvxpy_call(grasp, w), 1)
            contenders["CVXPY with Clarabel"][0]()
        except ImportError:
            contenders.pop("CVXPY with Clarabel", None)
        table(
            f"minimum normal forces, {k} Coulomb contacts, one wrench", interleave(contenders, rounds=15), "apprehend"
        )
    for threads in (1, 2):
        parallel.set_threads(threads)
        for k in (3, 5):
            grasp = closed_grasp(rng, k)
            W = rng.normal(size=(10_000, 6))
            found = grasp.contact_forces(W)
            timing = interleave({"apprehend": (lambda g=grasp, W=W: g.contact_forces(W), len(W))}, rounds=5)
            table(
                f"10,000 wrenches, {k} contacts, {threads} thread(s), {found.success.mean():.2%} solved",
                timing,
                "apprehend",
            )


if __name__ == "__main__":
    main()
