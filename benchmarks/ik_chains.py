"""The arms on which the inverse-kinematics benchmarks run: URDF files that ship in wheels, with base and tip."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from apprehend import Robot
from apprehend.robots import subtree

DATA = "cmeel.prefix/share/example-robot-data/robots/"
CHAINS: dict[str, tuple[str, str, str]] = {
    # name: file below example-robot-data, link at which the chain starts (as in TRAC-IK's protocol), tip
    "panda": ("panda_description/urdf/panda.urdf", "panda_link0", "panda_hand"),
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "base_link", "tool0"),
    "ur10": ("ur_description/urdf/ur10_robot.urdf", "base_link", "tool0"),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", "link_base", "link_eef"),
    "baxter": ("baxter_description/urdf/baxter.urdf", "torso", "left_gripper"),
    "pr2": ("pr2_description/urdf/pr2.urdf", "torso_lift_link", "r_wrist_roll_link"),
    "jaco": ("kinova_description/robots/kinova.urdf", "root", "j2s6s200_end_effector"),
    "tiago": ("tiago_description/robots/tiago.urdf", "torso_lift_link", "arm_7_link"),
    "talos": ("talos_data/robots/talos_full_v2.urdf", "torso_2_link", "arm_left_7_link"),
    "z1": ("z1_description/urdf/z1.urdf", "link00", "link06"),
    "tiago+torso": ("tiago_description/robots/tiago.urdf", "base_link", "arm_7_link"),
    "icub": ("icub_description/robots/icub.urdf", "chest", "l_hand"),
    "romeo": ("romeo_description/urdf/romeo.urdf", "torso", "l_wrist"),
}


@dataclass(frozen=True)
class Arm:
    """One chain, with the file for peers that read URDF themselves."""

    name: str
    robot: Robot
    base: str
    tip: str
    urdf: Path

    def targets(self, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Random configurations within the limits (joints without limits: one turn) and their poses."""
        rng = np.random.default_rng(seed)
        robot = self.robot
        lower = np.where(np.isfinite(robot.limits.lower), robot.limits.lower, -np.pi)
        upper = np.where(np.isfinite(robot.limits.upper), robot.limits.upper, np.pi)
        moving = np.zeros(robot.n, dtype=bool)
        moving[list(robot.chain(self.tip))] = True
        q = np.where(moving, rng.uniform(lower, upper, (count, robot.n)), robot.home)
        return q, robot.fk(q, self.tip)


def arm(name: str) -> Arm:
    """One of `CHAINS`."""
    file, base, tip = CHAINS[name]
    spec = importlib.util.find_spec("pinocchio")
    site = next(p for p in map(Path, __import__("site").getsitepackages()) if (p / DATA).exists()) if spec else None
    if site is None:
        raise SystemExit("the benchmark needs the robots of the wheel example-robot-data")
    path = site / DATA / file
    robot = Robot.load(path)
    if robot.description.root != base and base in robot.frame_names:
        robot = Robot(subtree(robot.description, base))
    return Arm(name, robot, robot.description.root, tip, path)
