"""Published and independently computed numbers: DH robots, Puma 560, ARMAR-I, planar arm, Panda and UR5."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from apprehend.arrays import Array
from apprehend.kinematics import Robot, dh_table, dh_transform, joint_torques
from apprehend.robots.description import Description, Inertial, Joint, JointType, Link
from tests.support import reference, shared


def arm_of(rows: list[dict[str, Any]], convention: str, dynamics: list[dict[str, Any]] | None = None) -> Robot:
    """A robot with frames f1 … fn of a DH table: a joint about (or along) z between two fixed transforms."""
    joints: list[Joint] = []
    links = {"f0": Link("f0")}
    for i, row in enumerate(rows, 1):
        before, after = np.eye(4), dh_transform(0.0, row["d"], row["a"], row["alpha"])
        offset = dh_transform(row["theta"] + row["offset"], 0, 0, 0)
        if convention == "modified":
            before, after = dh_transform(0, 0, row["a"], row["alpha"]), dh_transform(0, row["d"], 0, 0)
        kind = JointType.PRISMATIC if row["sigma"] else JointType.REVOLUTE
        inertial, rotor = None, 0.0
        if dynamics:
            dyn = dynamics[i - 1]
            inertial = Inertial(dyn["m"], np.array(dyn["r"]), np.array(dyn["I"]))
            rotor = dyn["Jm"] * dyn["G"] ** 2
        links |= {f"m{i}": Link(f"m{i}"), f"f{i}": Link(f"f{i}", inertial)}
        axis = np.array([0.0, 0.0, -1.0 if row["flip"] else 1.0])
        moving = Joint(f"j{i}", kind, f"f{i - 1}", f"m{i}", before @ offset, axis, armature=rotor)
        joints += [moving, Joint(f"a{i}", JointType.FIXED, f"m{i}", f"f{i}", after)]
    return Robot(Description("dh", "f0", links, tuple(joints)))


def test_dh_robots() -> None:
    robots: dict[str, Robot] = {}
    for case in reference("kin_rtb_dh_robots.json")["cases"]:
        given, expected = case["inputs"], case["expected"]
        if given["robot"] not in robots:
            robots[given["robot"]] = arm_of(given["links"], given["dh"]).placed(given["base"])
        robot = robots[given["robot"]]
        q = np.array(given["q"])
        tip = f"f{robot.n}"
        frames = robot.fk(q)[[robot.frame_index(f"f{i}") for i in range(robot.n + 1)]]
        np.testing.assert_allclose(frames, expected["fkine_all"], atol=1e-12)
        np.testing.assert_allclose(frames[-1] @ np.array(given["tool"]), expected["fkine"], atol=1e-12)
        np.testing.assert_allclose(dh_table(robot, tip).fk(q), frames[-1], atol=1e-12)


def test_jacobians_of_dh_robots() -> None:
    for case in reference("kin_rtb_dh_robots.json")["cases"]:
        given, expected = case["inputs"], case["expected"]
        if not np.array_equal(given["tool"], np.eye(4)):
            continue
        robot = arm_of(given["links"], given["dh"]).placed(given["base"])
        tip = f"f{robot.n}"
        np.testing.assert_allclose(robot.jacobian(given["q"], tip), expected["jacob0"], atol=1e-12)
        np.testing.assert_allclose(robot.jacobian(given["q"], tip, "body"), expected["jacobe"], atol=1e-12)


def test_puma_560_dynamics() -> None:
    data = reference("dyn_rtb_puma560.json")
    conventions = data["conventions"]
    robot = arm_of(conventions["links_dh"], "standard", conventions["links_dyn"])
    checked = 0
    for case in data["cases"]:
        given, expected = case["inputs"], case["expected"]
        q = given["q"]
        if "inertia" in expected:
            np.testing.assert_allclose(robot.mass_matrix(q), expected["inertia"], atol=1e-10)
        if "gravload" in expected:
            np.testing.assert_allclose(robot.gravity(q), expected["gravload"], atol=1e-10)
        if "coriolis_times_qd" in expected:
            C = robot.coriolis(q, given["qd"])
            np.testing.assert_allclose(C @ given["qd"], expected["coriolis_times_qd"], atol=1e-10)
        if "rne_nofriction" in expected:
            rotors = np.array([d["Jm"] * d["G"] ** 2 for d in conventions["links_dyn"]])
            tau = robot.inverse_dynamics(q, given["qd"], given["qdd"])
            without = tau - rotors * np.array(given["qdd"])
            close = [np.allclose(t, expected["rne_nofriction"], atol=1e-9) for t in (tau, without)]
            assert any(close)  # the reference leaves the rotors out of this figure
            again = robot.forward_dynamics(q, given["qd"], tau)
            np.testing.assert_allclose(again, given["qdd"], atol=1e-9)
            checked += 1
    assert checked


def test_armar_arm() -> None:
    data = reference("kin_armar1.json")
    rows = [
        {
            "theta": np.deg2rad(r["theta_offset_deg"]),
            "offset": 0.0,
            "d": r["d_mm"] / 1000,
            "a": r["a_mm"] / 1000,
            "alpha": np.deg2rad(r["alpha_deg"]),
            "sigma": 0,
            "flip": False,
        }
        for r in data["conventions"]["dh_rows"]
    ]
    robot = arm_of(rows, "standard")
    for case in data["cases"]:
        np.testing.assert_allclose(robot.fk(case["inputs"]["q"], "f7"), case["expected"]["T"], atol=1e-12)


def test_planar_arm_closed_form() -> None:
    for case in reference("kin_planar2r_closed_form.json")["cases"]:
        given, expected = case["inputs"], case["expected"]
        if "dyn" not in given:
            continue
        dyn = given["dyn"]
        joints, links = [], {"root": Link("root")}
        for i, (length, previous) in enumerate(((given["l1"], 0.0), (given["l2"], given["l1"])), 1):
            T = np.eye(4)
            T[0, 3] = previous
            com, I = np.array([dyn[f"r{i}"], 0, 0]), np.diag([0.0, 0.0, dyn[f"I{i}"]])
            links[f"l{i}"] = Link(f"l{i}", Inertial(dyn[f"m{i}"], com, I))
            joints.append(Joint(f"j{i}", JointType.REVOLUTE, f"l{i - 1}" if i > 1 else "root", f"l{i}", T))
            end = length
        tip = np.eye(4)
        tip[0, 3] = end
        links["tip"] = Link("tip")
        joints.append(Joint("t", JointType.FIXED, "l2", "tip", tip))
        # gravity along −y of the arm: its base stands upright
        upright = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
        robot = Robot(Description("planar", "root", links, tuple(joints)), base=upright)
        q = given["q"]
        plane: Array = upright[:3, :3]
        np.testing.assert_allclose((plane.T @ robot.fk(q, "tip")[:3, 3])[:2], expected["xy"], atol=1e-12)
        J = (plane.T @ robot.jacobian(q, "tip")[:3])[:2]
        np.testing.assert_allclose(J, expected["jacobian"], atol=1e-12)
        tau = robot.inverse_dynamics(q, given["qd"], given["qdd"])
        np.testing.assert_allclose(tau, expected["inverse_dynamics"], atol=1e-9)
        F = plane @ [*given["force_on_tip"], 0.0]
        statics = joint_torques(robot, q, "tip", [*F, 0, 0, 0])
        np.testing.assert_allclose(statics, expected["torques_to_resist_or_JT_F"], atol=1e-9)


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_arms_computed_by_pinocchio(name: str) -> None:
    description = Robot.load(shared(f"reference/models/{name}.urdf")).description
    data = reference(f"kin_pinocchio_{name}.json")
    free = tuple(dataclasses.replace(joint, mimic=None) for joint in description.joints)
    robot = Robot(dataclasses.replace(description, joints=free))
    order = [data["conventions"]["joint_order"].index(j) for j in robot.joint_names]
    kinds = {"LOCAL": "body", "WORLD": "spatial", "LOCAL_WORLD_ALIGNED": "mixed"}
    for case in data["cases"]:
        given, expected = case["inputs"], case["expected"]
        q, v, a = (np.array(given[k])[order] for k in ("q", "v", "a"))
        for frame, T in expected["frame_placements"].items():
            np.testing.assert_allclose(robot.fk(q, frame), T, atol=1e-12)
        for frame, by_kind in expected["jacobians"].items():
            for kind, J in by_kind.items():
                ours = robot.jacobian(q, frame, kinds[kind])
                np.testing.assert_allclose(ours, np.array(J)[:, order], atol=1e-12)
        np.testing.assert_allclose(robot.inverse_dynamics(q, v, a), np.array(expected["rnea"])[order], atol=1e-10)
        np.testing.assert_allclose(robot.gravity(q), np.array(expected["gravity"])[order], atol=1e-10)
        np.testing.assert_allclose(
            robot.inverse_dynamics(q, v), np.array(expected["nonlinear_effects"])[order], atol=1e-10
        )
        M = np.array(expected["mass_matrix"])[np.ix_(order, order)]
        np.testing.assert_allclose(robot.mass_matrix(q), M, atol=1e-10)
