"""Queries of surfaces against closed forms and an independent ray caster."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.arrays import Array
from apprehend.bodies import Body
from apprehend.perception import ModelSurface


def plain_first_hits(triangles: Array, origin: Array, directions: Array) -> Array:
    """Every ray against every triangle: solve ``origin + t d = a + u (b − a) + v (c − a)``."""
    out = np.full(len(directions), np.inf)
    a, e1, e2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    for i, d in enumerate(directions):
        system = np.stack([np.broadcast_to(-d, a.shape), e1, e2], axis=-1)
        regular = np.abs(np.linalg.det(system)) > 1e-18
        t, u, v = np.linalg.solve(system[regular], (origin - a[regular])[..., None])[..., 0].T
        hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0)
        out[i] = t[hit].min(initial=np.inf)
    return out


def test_first_hits_equal_the_plain_ones() -> None:
    body = Body.household("mug")
    surface, rng = ModelSurface(body), np.random.default_rng(0)
    origin = np.array([0.3, 0.05, 0.2])
    directions = rng.uniform(body.bounds[0] - 0.02, body.bounds[1] + 0.02, (300, 3)) - origin
    times = surface.first_hits(origin, directions)
    expected = plain_first_hits(body.vertices[body.faces], origin, directions)
    hit = np.isfinite(expected)
    assert np.array_equal(np.isfinite(times), hit)
    assert 100 < hit.sum() < 300
    assert times[hit] == pytest.approx(expected[hit], abs=1e-9)


def test_nearest_facing_point_of_a_box() -> None:
    surface = ModelSurface(Body.box([0.2, 0.2, 0.2], mass=1.0))
    inside = np.array([[0.09, 0.0, 0.0]])
    near, distance = surface.nearest_facing(inside, np.array([[1.0, 0.0, 0.0]]))
    assert distance == pytest.approx([0.01])
    assert near == pytest.approx(np.array([[0.1, 0.0, 0.0]]))
    near, distance = surface.nearest_facing(
        inside, np.array([[-1.0, 0.0, 0.0]])
    )  # the near side does not face that way
    assert distance == pytest.approx([0.19])
    assert near == pytest.approx(np.array([[-0.1, 0.0, 0.0]]))
    assert surface.nearest(inside)[1] == pytest.approx([0.01])
