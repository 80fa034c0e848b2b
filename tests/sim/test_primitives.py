"""Round pieces are recognised, and others are not."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.bodies import Body
from apprehend.sim import World
from apprehend.sim.primitives import as_round
from apprehend.spatial import so3

from .scenes import pendulum, scene, table, translation


def volume(body: Body) -> float:
    a, b, c = body.triangles.transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


@pytest.mark.parametrize("seed", range(4))
def test_turned_and_shifted_spheres_and_cylinders_are_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    R, t = so3.exp(rng.normal(size=3)), rng.normal(size=3)
    ball = Body.sphere(0.04, mass=1.0)
    found = as_round(ball.vertices @ R.T + t, volume(ball))
    assert found is not None
    assert (found.radius, found.height) == (pytest.approx(0.04, rel=1e-3), 0.0)
    assert found.pose[:3, 3] == pytest.approx(t, abs=1e-6)
    can = Body.cylinder(0.03, 0.11, mass=1.0)
    found = as_round(can.vertices @ R.T + t, volume(can))
    assert found is not None
    assert (found.radius, found.height) == (pytest.approx(0.03, rel=1e-3), pytest.approx(0.11, rel=1e-3))
    assert found.pose[:3, 3] == pytest.approx(t, abs=1e-6)
    assert abs(found.pose[:3, 2] @ R[:, 2]) == pytest.approx(1.0, abs=1e-9)


def test_what_is_not_round_stays_a_hull() -> None:
    box = Body.box([0.1, 0.1, 0.1], mass=1.0)
    assert as_round(box.vertices, volume(box)) is None
    ball = Body.sphere(0.04, mass=1.0)
    egg = ball.vertices * [1.0, 1.0, 1.02]
    assert as_round(egg, volume(ball) * 1.02) is None
    half = np.vstack([ball.vertices[ball.vertices[:, 2] <= 0.0], [[0.0, 0.0, 0.0]]])
    assert as_round(half, 0.5 * volume(ball)) is None
    can = Body.cylinder(0.03, 0.11, mass=1.0)
    assert as_round(can.vertices * [1.0, 1.02, 1.0], volume(can) * 1.02) is None


def test_a_ball_rolls_as_a_ball() -> None:
    """Pushed at v it comes to rest after v² (1 + 2/5) r / (2 g δ), δ the coefficient of rolling friction."""
    radius, v = 0.03, 0.1
    ball = Body.sphere(radius, mass=0.1, friction=0.8)
    world = World(scene(pendulum(), boxes=(table(),), ball=(ball, translation(0.0, 0.6, radius))))
    world.settle()
    start = world.body_pose("ball")[0, 3]
    at = world.model.jnt_dofadr[world.model.body_jntadr[world.plant.bodies["ball"]]]
    world.data.qvel[at], world.data.qvel[at + 4] = v, v / radius
    world.settle(time_limit=6.0).require_success()
    delta = world.plant.physics.rolling
    expected = v**2 * 1.4 * radius / (2.0 * 9.81 * delta)
    assert world.body_pose("ball")[0, 3] - start == pytest.approx(expected, rel=0.1)
