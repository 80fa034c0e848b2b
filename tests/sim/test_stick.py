"""What is carried along a curve stays in the hand: the integrator's drift is taken out, friction's limit is not."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.arrays import Array
from apprehend.bodies import Body
from apprehend.sim import world as world_module

from .scenes import hold, slip


def drift_when_swung(name: str, force: float = 20.0) -> float:
    """Slip of an object in the hand while the arm turns by two rad about its first axis and back, in 2 s each."""
    held = hold(name, Body.box([0.05, 0.04, 0.03], mass=0.3, friction=0.6), force)
    held.turn_gravity_on()
    held.world.run(0.2, held.arm, held.gripper)
    start = held.arm.target.copy()

    def motion(t: float, order: int) -> Array:
        s, T = (t / 2.0, 2.0) if t <= 2.0 else ((t - 2.0) / 2.0, 2.0)
        shape = (
            10 * s**3 - 15 * s**4 + 6 * s**5, 30 * s**2 - 60 * s**3 + 30 * s**4, 60 * s - 180 * s**2 + 120 * s**3,
        )[order] / T**order  # fmt: skip
        turn = np.zeros(start.size)
        turn[0] = 2.0 * (shape if t <= 2.0 else (order == 0) - shape)
        return turn + (start if order == 0 else 0.0)

    before = held.in_hand()
    held.arm.follow(held.world, motion, 4.0)
    held.world.run(4.2, held.arm, held.gripper)
    return slip(before, held.in_hand())[0]


@pytest.mark.parametrize("name", ["ur5e", "panda"])
def test_carried_on_an_arc_without_drift(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert drift_when_swung(name) < 5e-5
    monkeypatch.setattr(world_module, "carry_along", lambda plant, data: None)
    assert drift_when_swung(name) > 2e-4


def test_friction_still_has_its_limit() -> None:
    """The same swing with a grip that can hardly carry the weight throws the object out of the hand."""
    assert drift_when_swung("panda", force=0.9 * 0.3 * 9.81 / (2 * 0.6)) > 0.01
