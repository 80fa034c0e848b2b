"""A full mug carried around a wall: it may tilt by 10 degrees, all along the path, and does not."""

import numpy as np

import apprehend as ap
from apprehend.collision import CollisionModel, Convex
from apprehend.planning import Upright, plan

robot = ap.Robot.load("ur5e")
wall = np.eye(4)
wall[:3, 3] = 0.6, 0.0, 0.225
model = CollisionModel(robot).add("wall", [Convex.box([0.5, 0.04, 0.45])], wall)
mug = np.eye(4)
mug[2, 3] = 0.06  # in front of the flange
model = model.attach([Convex.cylinder(0.04, 0.1)], "tool0", mug, name="mug")

start = np.array([-0.9, -1.0, 1.57, -2.14, -1.57, 0.0])
goal = start * [-1, 1, 1, 1, 1, 1]
full = Upright("tool0", axis=(0.0, 0.0, -1.0), angle=np.radians(10.0))
free = plan(model, start, goal, rng=np.random.default_rng(0)).require_success()
kept = plan(model, start, goal, rng=np.random.default_rng(0), constraints=[full]).require_success()
for words, path in (("anyhow", free.path), ("upright", kept.path)):
    s = np.linspace(0.0, 1.0, 100)[:, None, None]
    q = (path[:-1] + s * np.diff(path, axis=0)).reshape(-1, robot.n)
    tilt = np.degrees(np.arccos(np.clip(-robot.fk(q, "tool0")[:, 2, 2], -1.0, 1.0)))
    print(f"{words:8} {len(path):2} configurations, tilted by up to {tilt.max():.1f}°")
assert tilt.max() <= 10.0
