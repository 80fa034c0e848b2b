"""Load a robot, move it, and see that its Jacobian predicts where the hand goes."""

import numpy as np

import apprehend as ap

robot = ap.Robot.load("ur5e")
q = robot.home
T = robot.fk(q, "tool0")
J = robot.jacobian(q, "tool0")  # "mixed": origin at the tool, axes of the world (the scripts' classical Jacobian)

step = 1e-6 * np.arange(1.0, 7.0)
moved = robot.fk(q + step, "tool0")[:3, 3] - T[:3, 3]
print("predicted", J[:3] @ step, "moved", moved)
assert np.allclose(J[:3] @ step, moved, atol=1e-10)
