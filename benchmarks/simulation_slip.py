"""Does a grasp with Coulomb margin creep, and how fast is a step? Ours against the engine's ordinary settings.

    python -m benchmarks.simulation_slip

Peer: the same scene, controllers and engine (MuJoCo) with its default friction settings (impratio 1, no no-slip
iterations, first-order sticking). A box is held for 20 s still, and 4 s swung on an arc, with 1.5 times the grip that
Coulomb's law needs at rest; slip is the change of its pose in the hand.
"""

from __future__ import annotations

import time

import numpy as np

import apprehend as ap
from apprehend.sim import Gripper, JointController, Load, Physics, World, grip
from apprehend.sim import world as world_module

MU, MASS, SIZE = 0.6, 0.4, (0.05, 0.04, 0.03)


def held(robot: str, physics: Physics, force: float) -> tuple[World, JointController, Gripper, str]:
    """The box between the pads of the robot at home, gravity switched on after the grip."""
    scene = ap.Scene.tabletop(robot, body=ap.Body.box(SIZE, mass=MASS, friction=MU, name="box"))
    hand, arm = scene.hand, scene.robot
    q = arm.home.copy()
    q[hand.indices_in(arm)] = hand.jaw.q_at(hand.jaw.max_width)
    world = World(scene.moved("box", arm.fk(q, hand.root) @ hand.jaw.tcp_at(SIZE[0])), physics=physics)
    world.model.opt.gravity[2] = 0.0
    world.set_q(q)
    controller, gripper = JointController(world, arm.chain(hand.root)), Gripper(world, hand)
    grip(world, gripper, force, controller).require_success()
    controller.load = Load(hand.root, MASS, in_hand(world, hand.root)[:3, 3])
    world.model.opt.gravity[2] = -scene.gravity
    world.run(0.5, controller, gripper)
    return world, controller, gripper, hand.root


def in_hand(world: World, root: str) -> np.ndarray:
    return np.linalg.solve(world.frame(root), world.body_pose("box"))


def swing(start: np.ndarray, seconds: float, turn: float):  # type: ignore[no-untyped-def]
    def motion(t: float, order: int) -> np.ndarray:
        s = t / seconds
        shape = (10 * s**3 - 15 * s**4 + 6 * s**5, 30 * s**2 - 60 * s**3 + 30 * s**4, 60 * s - 180 * s**2 + 120 * s**3)
        out = start.copy() if order == 0 else np.zeros_like(start)
        out[0] += turn * shape[order] / seconds**order
        return out

    return motion


def main() -> None:
    correction = world_module.carry_along
    settings = {"ours": Physics(), "engine's ordinary": Physics(impratio=1.0, noslip_iterations=0)}
    print(f"{'robot':8} {'settings':18} {'slip in 20 s':>14} {'slip on an arc':>15} {'real time':>10}")
    for robot in ("ur5e", "panda"):
        for name, physics in settings.items():
            world_module.carry_along = correction if name == "ours" else (lambda plant, data: None)
            world, arm, gripper, root = held(robot, physics, 1.5 * MASS * 9.81 / (2 * MU))
            before, start = in_hand(world, root), time.process_time()
            world.run(20.0, arm, gripper)
            speed = 20.0 / (time.process_time() - start)
            still = np.linalg.norm((np.linalg.solve(before, in_hand(world, root)))[:3, 3])
            world, arm, gripper, root = held(robot, physics, 20.0)
            before = in_hand(world, root)
            arm.follow(world, swing(arm.target.copy(), 3.0, 2.0), 3.0)
            world.run(4.0, arm, gripper)
            arc = np.linalg.norm((np.linalg.solve(before, in_hand(world, root)))[:3, 3])
            print(f"{robot:8} {name:18} {still * 1e3:11.4f} mm {arc * 1e3:12.4f} mm {speed:8.1f} ×")
    world_module.carry_along = correction


if __name__ == "__main__":
    main()
