"""Objects of another type than a function expects: the message names the argument, what came, and how to get one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import apprehend as ap
from apprehend.errors import InputError

T = np.eye(4)
Q = np.zeros(6)
PINCH = ap.Grasp([ap.Contact(np.zeros(3), np.eye(3)[2])])
CALLS: dict[str, tuple[Callable[[Any], object], str]] = {
    "Robot.load": (lambda x: ap.Robot.load(x), "a name of the catalogue"),
    "Hand.load": (lambda x: ap.Hand.load(x), "a name of the catalogue"),
    "Body.load": (lambda x: ap.Body.load(x), "the path of a mesh file"),
    "Scene.load": (lambda x: ap.Scene.load(x), "the path of a scene file"),
    "Hand.within": (lambda x: ap.Hand.within(x), "robot is .*expected a Robot"),
    "ik.solve": (lambda x: ap.ik.solve(x, T, "tool0"), "robot is .*expected a Robot"),
    "ik.branches": (lambda x: ap.ik.branches(x, T), "robot is .*expected a Robot"),
    "ik.step": (lambda x: ap.ik.step(x, Q, [ap.ik.PoseTask("tool0", T)], 0.01), "robot is .*expected a Robot"),
    "ReachabilityMap.build": (lambda x: ap.ReachabilityMap.build(x, "tool0"), "robot is .*expected a Robot"),
    "straight_line": (lambda x: ap.trajectory.straight_line(x, T, T), "robot is .*expected a Robot"),
    "CollisionModel": (lambda x: ap.collision.CollisionModel(x), "robot is .*expected a Robot"),
    "grasp.plan": (lambda x: ap.grasp.plan(x, x, n=1, rng=x), "hand is .*expected a Hand"),
    "planning.plan": (lambda x: ap.planning.plan(x, Q, Q, rng=x), "model is .*expected a CollisionModel"),
    "locate": (lambda x: ap.perception.locate([], x, rng=x), "body is .*expected a Body"),
    "contact_forces": (lambda x: PINCH.contact_forces(np.zeros(6), limits=x), r"limits is .*Limits\(normal"),
    "Grasp": (lambda x: ap.Grasp([ap.Contact(np.zeros(3), np.eye(3)[2])], body=x), "body is .*expected a Body"),
}


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("wrong", [{}, 3, object()], ids=["dict", "int", "object"])
def test_the_message_says_what_is_expected(name: str, wrong: object) -> None:
    call, message = CALLS[name]
    with pytest.raises(InputError, match=message):
        call(wrong)


def test_a_name_where_a_robot_is_expected_is_shown() -> None:
    with pytest.raises(InputError, match=r"robot is 'panda'; expected a Robot: Robot\.load\(name_or_file\)"):
        ap.ik.solve("panda", T, "panda_hand")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"other is 'hand'; expected a Robot"):
        ap.Robot.load("ur5e").attach("hand", "tool0")  # type: ignore[arg-type]
