"""A grasp with Coulomb margin does not creep; one without slips. Slip is the object's motion in the hand's frame."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.arrays import Array
from apprehend.bodies import Body
from apprehend.sim import Physics

from .scenes import Held, hold, slip, translation

SECONDS = 20.0
MU = 0.6


def body(kind: str, mass: float) -> tuple[Body, Array]:
    if kind == "box":
        return Body.box([0.05, 0.04, 0.03], mass=mass, friction=MU), np.eye(4)
    lying = np.eye(4)
    lying[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]  # the axis along the pads' y
    if kind == "cylinder":
        return Body.cylinder(0.02, 0.12, mass=mass, friction=MU), lying
    return Body.box([0.04, 0.16, 0.03], mass=mass, friction=MU), translation(0.0, 0.03, 0.0)  # held off its centre


def held_against_gravity(name: str, kind: str, mass: float, force: float, physics: Physics | None = None) -> Held:
    thing, offset = body(kind, mass)
    held = hold(name, thing, force, offset=offset, physics=physics)
    assert held.result.success
    held.turn_gravity_on()
    held.world.run(0.3, held.arm, held.gripper)
    return held


@pytest.mark.parametrize(
    ("name", "kind", "mass"),
    [
        ("ur5e", "box", 0.05),
        ("ur5e", "box", 1.5),
        ("ur5e", "cylinder", 0.4),
        ("panda", "box", 0.4),
        ("panda", "cylinder", 0.8),
    ],
)
def test_no_creep_with_margin(name: str, kind: str, mass: float) -> None:
    force = 1.5 * mass * 9.81 / (2 * MU)  # each pad carries half of the weight
    held = held_against_gravity(name, kind, mass, force)
    before = held.in_hand()
    held.world.run(SECONDS, held.arm, held.gripper)
    distance, angle = slip(before, held.in_hand())
    assert distance < 2e-4
    assert angle < np.radians(0.1)


@pytest.mark.parametrize("name", ["ur5e", "panda"])
def test_no_creep_under_torque_with_margin(name: str) -> None:
    """Held 3 cm beside its centre, the pads' faces carry the moment by friction."""
    held = held_against_gravity(name, "off-centre", 0.2, 40.0)
    before = held.in_hand()
    held.world.run(SECONDS, held.arm, held.gripper)
    distance, angle = slip(before, held.in_hand())
    assert distance < 2e-4
    assert angle < np.radians(0.1)


@pytest.mark.parametrize("name", ["ur5e", "panda"])
def test_slips_without_margin(name: str) -> None:
    mass = 0.4
    held = held_against_gravity(name, "box", mass, 0.5 * mass * 9.81 / (2 * MU))
    before = held.in_hand()
    held.world.run(1.0, held.arm, held.gripper)
    assert slip(before, held.in_hand())[0] > 0.01


def test_without_the_measures_it_would_creep() -> None:
    """The same grasp with the engine's ordinary settings moves visibly: the test above measures something."""
    ordinary = Physics(impratio=1.0, noslip_iterations=0)
    held = held_against_gravity("ur5e", "box", 0.4, 1.5 * 0.4 * 9.81 / (2 * MU), ordinary)
    before = held.in_hand()
    held.world.run(5.0, held.arm, held.gripper)
    assert slip(before, held.in_hand())[0] > 1e-3
