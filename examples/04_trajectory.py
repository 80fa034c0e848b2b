"""A spline through waypoints, timed as fast as the limits allow, with the proof that they hold at all times."""

import numpy as np

import apprehend as ap

robot = ap.Robot.load("ur5e")
waypoints = robot.home + np.cumsum(np.random.default_rng(1).normal(0.0, 0.4, (6, robot.n)), axis=0)
timing = ap.trajectory.time_optimal(ap.trajectory.Spline(waypoints), robot.limits)
motion = timing.require_success().motion
report = motion.check(ap.trajectory.Limits(velocity=robot.limits.velocity, acceleration=robot.limits.acceleration))
print(f"{motion.duration:.3f} s;", report.explain())
assert report.success
