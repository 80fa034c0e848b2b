"""Optimal contact forces beside Clarabel and CVXPY: one wrench at a time, families of wrenches, and many grasps.

python -m benchmarks.grasp_forces
"""

from __future__ import annotations

import numpy as np

from apprehend import parallel
from apprehend.grasp import ForceStatus, Grasp, Limits, optimal_forces
from benchmarks._harness import interleave, table
from tests.grasp.makers import random_force, random_grasp


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
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-9  # ours

    def call() -> float:
        answer = clarabel.DefaultSolver(P, q, A, b, cones, settings).solve()
        return answer.obj_val if "Solved" in str(answer.status) else np.inf

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


def in_turn(calls, times: int):
    """All calls so many times, with their number: one alone would find the caches cold and be no average."""

    def run() -> None:
        for _ in range(times):
            for call in calls:
                call()

    return run, times * len(calls)


def problems(rng: np.random.Generator, k: int, count: int) -> list[tuple[Grasp, np.ndarray]]:
    """Random grasps with a wrench that they can balance."""
    out = []
    for _ in range(count):
        grasp = random_grasp(rng, k, friction=rng.uniform(0.3, 1.0))
        f = np.concatenate([rng.exponential() * random_force(rng, c) for c in grasp.contacts])
        out.append((grasp, -grasp.matrix @ f))
    return out


def one_at_a_time(rng: np.random.Generator, k: int, feasible: bool) -> None:
    cases = problems(rng, k, 60)
    if not feasible:  # the opposite of a wrench that can be held, unless the grasp holds everything
        cases = [(g, -w) for g, w in cases if not g.contact_forces(-w).success]
    if not cases:
        return
    contenders = {"apprehend": in_turn([lambda g=g, w=w: g.contact_forces(w) for g, w in cases], 10)}
    try:
        peers = [clarabel_call(g, w) for g, w in cases]
        contenders["Clarabel (set up and solved)"] = in_turn(peers, 2)
        found = [g.contact_forces(w) for g, w in cases]
        worst, agree = 0.0, 0
        for one, peer in zip(found, peers, strict=True):
            value = peer()
            agree += bool(one.success == np.isfinite(value))
            if one.success and np.isfinite(value):
                worst = max(worst, abs(one.value - value) / value)
        steps = np.mean([one.steps for one in found])
        print(f"\n{k} contacts: {agree} of {len(cases)} verdicts agree, values to {worst:.1e}, {steps:.1f} steps")
    except ImportError:
        print("Clarabel is not installed")
    try:
        contenders["CVXPY with Clarabel"] = in_turn([cvxpy_call(*case) for case in cases[:2]], 1)
        contenders["CVXPY with Clarabel"][0]()
    except ImportError:
        contenders.pop("CVXPY with Clarabel", None)
    kind = "that forces balance" if feasible else "that no forces balance"
    table(f"minimum normal forces, {k} Coulomb contacts, {kind}", interleave(contenders, rounds=9), "apprehend")


def batches(rng: np.random.Generator, threads: int) -> None:
    parallel.set_threads(threads)
    for k in (3, 5):
        grasp, count = closed_grasp(rng, k), 10_000
        W = rng.normal(size=(count, 6))
        p = rng.normal(size=(count, k, 3))
        p /= np.linalg.norm(p, axis=-1, keepdims=True)
        n = -p + 0.25 * rng.normal(size=p.shape)
        n /= np.linalg.norm(n, axis=-1, keepdims=True)
        t = 1e-3 * np.arange(count)[:, None]
        curve = np.cos(t) * W[0] + np.sin(t) * W[1] + 0.3 * np.sin(2.3 * t) * W[2]
        solved = optimal_forces(p, n, W).success.mean()
        timing = interleave(
            {
                "wrenches of one grasp": (lambda g=grasp, W=W: g.contact_forces(W), count),
                f"different grasps, {solved:.0%} can": (lambda p=p, n=n, W=W: optimal_forces(p, n, W), count),
                "a curve of wrenches, cold": (lambda g=grasp, W=curve: g.contact_forces(W), count),
                "a curve of wrenches, warm": (lambda g=grasp, W=curve: g.contact_forces(W, family=True), count),
            },
            rounds=5,
        )
        steps = [float(np.mean(grasp.contact_forces(curve, family=f).steps)) for f in (False, True)]
        table(f"batches of 10,000, {k} contacts, {threads} thread(s)", timing, "wrenches of one grasp")
        print(f"  steps along the curve: cold {steps[0]:.1f}, warm {steps[1]:.1f}")


def other_objectives(rng: np.random.Generator) -> None:
    grasp = closed_grasp(rng, 4)
    W = rng.normal(size=(200, 6))
    J = rng.normal(size=(12, 8))
    limits = Limits(normal=50.0, hand_jacobian=J, torque_upper=80.0)
    contenders = {}
    for objective in (
        "min_normal",
        "min_norm",
        "min_largest",
        "min_largest_norm",
        "max_margin",
        "min_torque",
        "barrier",
    ):
        found = grasp.contact_forces(W, objective, limits)
        assert set(found.status) <= {ForceStatus.OPTIMAL, ForceStatus.INFEASIBLE}
        contenders[objective] = (lambda o=objective: grasp.contact_forces(W, o, limits), len(W))
    timing = interleave(contenders, rounds=5)
    table("4 contacts, limits on 4 normal forces and 8 torques either way, batches of 200", timing, "min_normal")


def main() -> None:
    parallel.set_threads(1)
    for k in (3, 5, 16):
        for feasible in (True, False):
            one_at_a_time(np.random.default_rng(k), k, feasible)
    for threads in (1, 2):
        batches(np.random.default_rng(0), threads)
    parallel.set_threads(1)
    other_objectives(np.random.default_rng(0))


if __name__ == "__main__":
    main()
