"""Random tasks on a table: a resting pose of the object and a place for it, drawn from a seed."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..collision import Scene
from ..errors import InputError

NEAREST, FARTHEST = 0.42, 0.68
"""Distance of the object from the robot's base, as shares of the arm's horizontal reach."""

APART = 0.22
"""Least distance of the goal from the start, as a share of the reach."""

TRIES = 1000


def shuffled(scene: Scene, seed: int | np.random.Generator) -> Scene:
    """The scene with its picked body in a random resting pose on z = 0, and a goal in the same posture elsewhere.

    The posture is drawn by the probability of the stable poses, yaw and places evenly over the sector in front of the
    robot. Raises `InputError` where no two places are far enough apart.
    """
    from ..collision.tabletop import horizontal_reach, resting

    if scene.pick is None:
        raise InputError("the scene has no body to pick; there is nothing to shuffle")
    rng = np.random.default_rng(seed)
    body = scene.bodies[scene.pick].body
    poses = body.stable_poses()
    chances = np.array([p.probability for p in poses])
    posture = int(rng.choice(len(poses), p=chances / chances.sum()))
    reach = horizontal_reach(scene.robot)
    yaw = float(rng.uniform(-np.pi, np.pi))
    for _ in range(TRIES):
        (xs, ys), (xg, yg) = (place(rng, reach) for _ in range(2))
        if np.hypot(xg - xs, yg - ys) >= APART * reach:
            start = resting(body, xs, ys, yaw=yaw, choose=posture)
            goal = resting(body, xg, yg, yaw=yaw + float(rng.uniform(-0.5, 0.5)), choose=posture)
            return scene.moved(scene.pick, start).with_task(scene.pick, goal, upright=scene.upright)
    raise InputError(f"no two places {APART * reach:.2f} m apart were found on the table")


def place(rng: np.random.Generator, reach: float) -> Array:
    """A point (x, y) in the sector in front of the robot, evenly distributed."""
    r = reach * np.sqrt(rng.uniform(NEAREST**2, FARTHEST**2))
    a = rng.uniform(-0.9, 0.9)
    return np.array([r * np.cos(a), r * np.sin(a)])
