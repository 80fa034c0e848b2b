"""Ten thousand poses at once; every closed-form branch of one; and the reason why a pose cannot be reached."""

from importlib.util import find_spec

import numpy as np

import apprehend as ap

robot = ap.Robot.load("ur5e")
rng = np.random.default_rng(0)
q = rng.uniform(-np.pi, np.pi, (10_000, robot.n))
targets = robot.fk(q, "tool0")

answer = ap.ik.solve(robot, targets, "tool0")
print(f"{answer.success.mean():.2%} solved")
assert answer.success.mean() > 0.999

every = ap.ik.branches(robot, targets[0], "tool0", limits=False)
print(len(every.solutions()), "branches")
assert np.abs(robot.fk(every.solutions(), "tool0") - targets[0]).max() < 1e-9

far = np.eye(4)
far[0, 3] = 3.0
print(ap.ik.solve(robot, far, "tool0").reason())
assert not ap.ik.solve(robot, far, "tool0").success

# what the pseudo-inverse, damping, clipping and smooth clipping make of the singular values of a Jacobian
if find_spec("matplotlib"):
    sigma = np.linalg.svd(robot.jacobian(every.solutions()[0], "tool0"), compute_uv=False)
    axes = ap.ik.plot_inverses(0.1, sigma=sigma)  # axes.figure.savefig("inverses.png")
    assert len(axes.lines) == 8
