"""Proven bounds of derivatives along a path: nothing that is measured exceeds them, on arms, trees and slides."""

from __future__ import annotations

import numpy as np
import pytest

import apprehend as ap
from apprehend import trajectory as tj
from apprehend.kernels import jets
from apprehend.trajectory.constraints import QUARTIC_ERROR, dynamics_along
from apprehend.trajectory.timing import make_grid

FIVE = np.linspace(0.0, 1.0, 5)
FINE = np.linspace(0.0, 1.0, 33)
QUARTIC = np.array([[np.prod([(x - b) / (a - b) for b in FIVE if b != a]) for a in FIVE] for x in FINE])


def robot_of(name: str) -> ap.Robot:
    try:
        return ap.Robot.load(name)
    except ap.errors.MissingDependencyError as error:
        pytest.skip(str(error))


def paths(robot: ap.Robot) -> list[tj.PolynomialPath]:
    rng = np.random.default_rng(3)
    low, high = np.maximum(robot.limits.lower, -2.0), np.minimum(robot.limits.upper, 2.0)
    points = rng.uniform(low, high, size=(9, robot.n))
    return [tj.Spline(points[:4]), tj.BSpline.through(points, 7), tj.rounded(points[:4], 0.3)]


def places(grid: np.ndarray, shares: np.ndarray) -> np.ndarray:
    s = grid[:-1, None] + np.diff(grid)[:, None] * shares
    s[:, -1] = np.nextafter(grid[1:], -np.inf)
    return s


def test_the_error_of_a_quartic() -> None:
    """The constant is the largest |σ(σ − ¼)(σ − ½)(σ − ¾)(σ − 1)|, and quintics reach it."""
    x = np.linspace(0.0, 1.0, 100001)
    assert pytest.approx(np.abs(np.prod(x[:, None] - FIVE, axis=1)).max(), rel=1e-4) == QUARTIC_ERROR
    assert np.abs(np.prod(x[:, None] - FIVE, axis=1)).max() <= QUARTIC_ERROR


@pytest.mark.parametrize("name", ["panda", "ur5", "allegro_right"])
def test_torques_along_a_path(name: str) -> None:
    robot = robot_of(name)
    for path in paths(robot):
        grid = make_grid(path, 30)
        h = np.diff(grid)
        for power in (False, True):
            found = np.empty((h.size, robot.n, 3, jets.ORDERS))
            jets.torque_jets(robot.model, 9.81, path.breaks, path.coefficients, grid, power, found)
            five, fine = (dynamics_along(robot, path, places(grid, x)) for x in (FIVE, FINE))
            for k in range(3):
                scale = h[:, None] ** ((1.0, 2.0, 0.0)[k] + power)
                coarse, dense = five[k], fine[k]
                if power:
                    coarse, dense = coarse * path(places(grid, FIVE), 1), dense * path(places(grid, FINE), 1)
                size = np.abs(dense).max(axis=1) * scale
                assert (size <= found[:, :, k, 0] * (1.0 + 1e-9) + 1e-12).all()
                error = np.abs(QUARTIC @ coarse - dense).max(axis=1) * scale
                assert (error <= QUARTIC_ERROR * found[:, :, k, 5] + 1e-10 * size.max()).all()


@pytest.mark.parametrize("name", ["panda", "allegro_right"])
def test_motion_of_a_frame_along_a_path(name: str) -> None:
    robot = robot_of(name)
    frame = max(robot.frame_names, key=lambda f: len(robot.chain(f)))
    for path in paths(robot):
        grid = make_grid(path, 30)
        h = np.diff(grid)[:, None]
        found = np.empty((h.size, 4, jets.ORDERS))
        jets.frame_jets(robot.chain_model(frame), path.breaks, path.coefficients, grid, found)
        values = []
        for shares in (FIVE, FINE):
            s = places(grid, shares)
            q, dq, ddq = (path(s, k) for k in range(3))
            twist = np.einsum("nkij,nkj->nki", robot.jacobian(q, frame), dq)
            values.append((twist, ap.kinematics.acceleration(robot, q, dq, ddq, frame)))
        for order in (0, 1):
            for part, jet in ((slice(3, 6), 2 * order), (slice(0, 3), 2 * order + 1)):
                five, fine = values[0][order][..., part], values[1][order][..., part]
                scale = h[:, 0] ** (order + 1)
                size = np.linalg.norm(fine, axis=-1).max(axis=1) * scale
                assert (size <= found[:, jet, 0] * (1.0 + 1e-9) + 1e-12).all()
                error = np.linalg.norm(np.einsum("fk,nki->nfi", QUARTIC, five) - fine, axis=-1).max(axis=1) * scale
                assert (error <= QUARTIC_ERROR * found[:, jet, 5] + 1e-10 * size.max()).all()


def test_jets_of_a_path_bound_its_derivatives() -> None:
    path = tj.BSpline.through(np.random.default_rng(0).normal(size=(9, 3)), 5)
    grid = make_grid(path, 100)  # more than a block of lanes
    fine = places(grid, FINE)
    h = np.diff(grid)
    factorial = np.cumprod([1.0, *range(1, jets.DEEP)])
    for start in (0, 64):
        out = np.empty((3, jets.DEEP, 64))
        jets.path_jets(path.breaks, path.coefficients, grid, start, out)
        for lane in (0, 17, 35):
            for k in range(jets.DEEP):
                true = np.abs(path(fine[start + lane], k)).max(axis=0) * h[start + lane] ** k / factorial[k]
                assert (true <= out[:, k, lane] * (1.0 + 1e-9)).all()
                if k < 3:
                    assert (out[:, k, lane] <= 3.0 * true + 1.0).all()
